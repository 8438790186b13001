"""Functions that halves are told of (signals, fields, properties), and shape functions of the kinds of cells."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contact.problem.curves import FieldSum, Form, Polynomial, PropertyTable, SignalTable
from contact.problem.errors import made
from contact.problem.values import SignalName

Floats = NDArray[np.float64]

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

# Signals: boundary data as a function of time, constant or piecewise linear, with jumps.

# A step's end is t + h in floating point: a time this close (relative) to a point of the table is that point.
SNAP = 1e-13


@dataclass(frozen=True)
class Signal:
    """A piecewise linear function of time, held constant outside its table.

    A jump is written as two points at one time: the first holds before it, the second from it on.

    t : (n,) [s], not decreasing.  value : (n,), unit of the quantity.
    """

    t: NDArray[np.float64]
    value: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.t.ndim != 1 or self.t.shape != self.value.shape or self.t.size == 0:
            raise ValueError("a signal needs as many values as times, and at least one")
        if not (np.isfinite(self.t).all() and np.isfinite(self.value).all()):
            raise ValueError("a signal holds finite numbers only")
        if (np.diff(self.t) < 0).any():
            raise ValueError("the times of a signal must not decrease")
        if ((np.diff(self.t[:-1]) == 0) & (np.diff(self.t[1:]) == 0)).any():
            raise ValueError("a signal has at most two values at one time (before and after a jump)")

    def at(self, t: float, side: int = 1) -> float:
        """Value at time t [s]; at a jump the limit from the left (side=-1) or from the right (side=+1)."""
        if self.t.size == 1:
            return float(self.value[0])
        t, i = self._piece(t, side)
        if i == 0:
            return float(self.value[0])
        if i == self.t.size:
            return float(self.value[-1])
        t0, t1 = self.t[i - 1], self.t[i]
        w = (t - t0) / (t1 - t0)
        return float((1.0 - w) * self.value[i - 1] + w * self.value[i])

    def slope(self, t: float, side: int = 1) -> float:
        """Slope, per second, at time t [s]; at a kink the one before it (side=-1) or behind it (side=+1)."""
        _, i = self._piece(t, side)
        if i in (0, self.t.size):
            return 0.0
        return float((self.value[i] - self.value[i - 1]) / (self.t[i] - self.t[i - 1]))

    def _piece(self, t: float, side: int) -> tuple[float, int]:
        """The time, that of a point of the table where it is that, and how many points are before it."""
        nearest = self.t[min(int(np.searchsorted(self.t, t)), self.t.size - 1)]
        below = self.t[max(int(np.searchsorted(self.t, t)) - 1, 0)]
        for point in (below, nearest):
            if abs(t - point) <= SNAP * max(abs(t), abs(point)):
                t = float(point)
        return t, int(np.searchsorted(self.t, t, side="right" if side > 0 else "left"))

    @property
    def kinks(self) -> NDArray[np.float64]:
        """Return the times (n,) [s], ascending, at which the signal jumps or changes its slope."""
        return np.unique(self.t) if self.t.size > 1 else np.empty(0)


def signal_from(spec: float | Mapping[str, Any] | SignalName | SignalTable) -> Signal:
    """Make a Signal of a number or of {"t": [...], "value": [...]} (the form of model.json).

    Raises ValueError if the table is not a function of time, or where a name stands that was not looked up.
    """
    if isinstance(spec, SignalTable):
        return Signal(np.asarray(spec.t, dtype=float), np.asarray(spec.value, dtype=float))
    if isinstance(spec, str):
        raise ValueError(f"there is no signal {str(spec)!r} here: write a number or a table")
    if isinstance(spec, Mapping):
        return Signal(np.asarray(spec["t"], dtype=float), np.asarray(spec["value"], dtype=float))
    return Signal(np.zeros(1), np.array([float(spec)]))


# Fields: boundary data as a function of time and place, a sum of products of a signal and two profiles.

# What a field is at one time: its value where it is the same everywhere, else the (n_terms,) factors of its terms.
Level = float | Floats


@dataclass(frozen=True)
class Profile:
    """A function of one coordinate: piecewise linear (constant outside), or a polynomial.

    at : (n,) [m], increasing, with value : (n,);  or at None and value the coefficients a0, a1 ... [1/m^i].
    """

    at: Floats | None
    value: Floats

    def __post_init__(self) -> None:
        if self.value.ndim != 1 or self.value.size == 0 or not np.isfinite(self.value).all():
            raise ValueError(f"a profile needs a list of one or more finite numbers, not {self.value.tolist()}")
        if self.at is None:
            return
        if self.at.shape != self.value.shape or not np.isfinite(self.at).all():
            raise ValueError("a profile needs as many values as places `at`, all finite")
        if not (np.diff(self.at) > 0).all():
            raise ValueError(f"the places `at` of a profile must increase, not {self.at.tolist()}")

    def __call__(self, s: Floats) -> Floats:
        """Return the values at s : any shape [m], same shape, in the unit of the profile."""
        if self.at is None:
            return np.asarray(np.polynomial.polynomial.polyval(s, self.value), dtype=np.float64)
        return np.interp(s, self.at, self.value)


# A part of a cell or of an edge that is less than this share of it is no part.
SLIVER = 1e-9


@dataclass(frozen=True)
class FieldTerm:
    """t(time) x(x) y(y); a profile that is None is 1."""

    t: Signal
    x: Profile | None
    y: Profile | None


@dataclass(frozen=True)
class Field:
    """The sum of its terms at the current coordinates x (r) and y (z)."""

    terms: tuple[FieldTerm, ...]

    @cached_property
    def is_uniform(self) -> bool:
        """True where it depends on time alone."""
        return all(term.x is None and term.y is None for term in self.terms)

    @cached_property
    def is_zero(self) -> bool:
        """True where every signal is 0 at all times."""
        return not any(term.t.value.any() for term in self.terms)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The signals of its terms."""
        return tuple(term.t for term in self.terms)

    def level(self, t: float, side: int = 1) -> Level:
        """What it is at t [s]; at a jump the limit from the left (side=-1) or from the right."""
        if not self.is_uniform:
            # fault: a field not resolved by its terms -> return np.array([s.at(t, 1) for s in self.signals]) |
            #   contact/test_half_field
            return np.array([s.at(t, side) for s in self.signals])
        # One signal as it is: 0.0 + (-0.0) is another number.
        first = self.terms[0].t
        return first.at(t, side) if len(self.terms) == 1 else float(sum(s.at(t, side) for s in self.signals))

    def shapes(self, x: Floats) -> Floats | None:
        """Return the products of the profiles (n_terms, n) at coordinates x : (n, 2) [m]; None where it is uniform."""
        if self.is_uniform:
            return None
        out = np.ones((len(self.terms), len(x)))
        for row, term in zip(out, self.terms, strict=True):
            for profile, s in ((term.x, x[:, 0]), (term.y, x[:, 1])):
                if profile is not None:
                    # fault: last profile of a term only -> row[:] = profile(s) | contact/test_half_field
                    row *= profile(s)
        return out

    @cached_property
    def kinks(self) -> tuple[Floats, Floats]:
        """Places (n,) [m], ascending, at which a profile of x or of y changes its slope; of each coordinate."""
        found: list[Floats] = []
        for profiles in ([term.x for term in self.terms], [term.y for term in self.terms]):
            # A table of one place is the same everywhere.
            tables = [p.at for p in profiles if p is not None and p.at is not None and len(p.at) > 1]
            found.append(np.unique(np.concatenate(tables)) if tables else np.empty(0))
        return found[0], found[1]

    @property
    def narrowest(self) -> float:
        """Width [m] of the narrowest part of its tables over place, inf where it has none.

        Of a jump, which is stated by two places side by side, the plateaus count.
        """
        tables = [p.at for term in self.terms for p in (term.x, term.y)
                  if p is not None and p.at is not None and len(p.at) > 1]
        # fault: a jump is taken for the narrowest part -> parts = [np.diff(at).min() for at in tables] |
        #   coupler/test_trust_skipped
        parts = [(at[2:] - at[:-2]).min() if len(at) > 2 else at[1] - at[0] for at in tables]
        return float(min(parts, default=np.inf))

    @property
    def is_curved(self) -> bool:
        """Whether a polynomial over place is no straight line."""
        profiles = (p for term in self.terms for p in (term.x, term.y) if p is not None and p.at is None)
        # fault: a parabola is taken for a line -> return False | coupler/test_trust_at_nodes
        return any(bool(p.value[2:].any()) for p in profiles)

    def bends_within(self, corners: Floats) -> NDArray[np.bool_]:
        """Say, (n,), in which cells or edges a profile changes its slope, but for changes at their own sides.

        corners : (n, 2 of an edge, 3 or 4, 2) [m].
        """
        low, high = corners.min(axis=1), corners.max(axis=1)
        margin = SLIVER * (high - low)
        found = np.zeros(len(corners), dtype=bool)
        for axis, kinks in enumerate(self.kinks):
            first = np.searchsorted(kinks, (low + margin)[:, axis], "right")
            # fault: bends between nodes are not looked for -> found |= False & (first > 0) |
            #   coupler/test_trust_at_nodes thermal_fmu/test_source_strip
            found |= first < np.searchsorted(kinks, (high - margin)[:, axis], "left")
        return found

    def at(self, x: Floats, t: float, side: int = 1) -> Floats:
        """Return the values (n,), in the unit of the field, at coordinates x : (n, 2) [m] and time t [s]."""
        return np.broadcast_to(resolve(self.level(t, side), self.shapes(x)), (len(x),)).copy()

    @cached_property
    def least(self) -> float | None:
        """The least value it takes anywhere at any time; None where that is not worked out."""
        if self.is_uniform:
            times = np.unique(np.concatenate([s.t for s in self.signals]))
            return min(float(np.sum(self.level(t, side))) for t in times for side in (-1, 1))
        return _least(self.terms[0]) if len(self.terms) == 1 else None


def resolve(level: Level, shapes: Floats | None) -> float | Floats:
    """Return the values of a field : (n,), or one number where it is uniform, in the unit of the field.

    level : the number, or (n_terms,) factors of the terms at a time.  shapes : (n_terms, n) products of the profiles at
    n places, None where the field is uniform.  Each product of the two is in the unit of the field.
    """
    return level if shapes is None else np.asarray(level @ shapes, dtype=np.float64)


def _least(term: FieldTerm) -> float | None:
    low = high = 1.0
    for part in (term.t, term.x, term.y):
        if part is None:
            continue
        if isinstance(part, Profile) and part.at is None and part.value[1:].any():
            return None
        value = part.value[:1] if isinstance(part, Profile) and part.at is None else part.value
        ends = (low * value.min(), low * value.max(), high * value.min(), high * value.max())
        low, high = float(min(ends)), float(max(ends))
    return low


def field_from(spec: float | Mapping[str, Any] | SignalName | SignalTable | FieldSum) -> Field:
    """A Field from a SIGNAL or from {"terms": [{"t"?, "x"?, "y"?}, ...]} (the forms of model.json).

    Raises ValueError naming the term where it is no such thing.
    """
    if isinstance(spec, FieldSum):
        spec = spec.plain()
    if not (isinstance(spec, Mapping) and "terms" in spec):
        return Field((FieldTerm(signal_from(spec), None, None),))
    if set(spec) != {"terms"} or not isinstance(spec["terms"], list) or not spec["terms"]:
        raise ValueError('a field is a number, {"t", "value"}, or {"terms": [...]} with one term or more, nothing else')
    return Field(tuple(_term(term, i) for i, term in enumerate(spec["terms"])))


def _term(spec: Any, i: int) -> FieldTerm:
    if not isinstance(spec, Mapping) or set(spec) - {"t", "x", "y"}:
        raise ValueError(f"terms[{i}]: an object with t, x, y (each may be left out) is needed, not {spec!r}")
    try:
        x, y = (profile_from(spec[key]) if key in spec else None for key in ("x", "y"))
        return FieldTerm(signal_from(spec.get("t", 1.0)), x, y)
    except (ValueError, TypeError, KeyError) as exc:
        raise ValueError(f"terms[{i}]: {exc}") from exc


def profile_from(spec: Any) -> Profile:
    """A Profile from {"at": [...], "value": [...]} or {"polynomial": [...]}.  Raises ValueError."""
    if isinstance(spec, Mapping) and set(spec) == {"polynomial"}:
        return Profile(None, np.asarray(spec["polynomial"], dtype=float))
    if isinstance(spec, Mapping) and set(spec) == {"at", "value"}:
        return Profile(np.asarray(spec["at"], dtype=float), np.asarray(spec["value"], dtype=float))
    raise ValueError(f'a profile is {{"at", "value"}} or {{"polynomial"}}, not {spec!r}')


# Properties: material data as a function of temperature, with derivative and exact integral.

# At fewer temperatures a compiled loop takes half of the time of scipy's, or less: most of that is for the call alone.
SMALL = 4096


@cache
def _piecewise() -> Callable[[Floats, Floats, float, float, Floats], None]:
    from contact.half.piecewise import piecewise  # numba takes 0.3 s to import, and most halves have no curve

    return piecewise


@dataclass(frozen=True)
class Property:
    """A function of temperature T [K]: constant, polynomial or table, one piecewise polynomial inside.

    Beyond its table a property keeps the value of the table's end.
    """

    constant: float | None
    curve: PPoly | None = None
    low: float = -np.inf
    high: float = np.inf

    def __call__(self, T: Floats) -> Floats:
        """Return the value at T : any shape [K], same shape, in the unit of the property."""
        if self.curve is None:
            # A third of the time of np.full, which matters: this is asked for small arrays in every iteration.
            same = np.empty(np.shape(T))
            same.fill(self.constant)
            return same
        return self._at(self.curve, T)

    def slope(self, T: Floats) -> Floats:
        """Return the derivative by temperature, same shape as T [unit of the property per K]; 0 beyond a table.

        T : any shape [K].
        """
        if self.curve is None:
            return np.zeros(np.shape(T))
        inside = (self.low <= T) & (self.high >= T)
        return np.where(inside, self._at(self._derivative, T), 0.0)

    def increase(self, T0: Floats, T: Floats) -> Floats:
        """Return the exact integral over temperature from T0 to T, same shape [unit of the property times K].

        T0 : any shape [K].  T : same shape [K].
        One antiderivative serves every temperature, so the increases of a path add up to that of its ends.  For a
        constant the difference is taken before the product: no round-off of large temperatures.
        """
        if self.curve is None:
            assert self.constant is not None
            return self.constant * (T - T0)
        return self._integral(T) - self._integral(T0)

    def _integral(self, T: Floats) -> Floats:
        assert self.curve is not None
        inner = np.clip(T, self.low, self.high)
        total = self._at(self._antiderivative, inner)
        outside = T - inner
        if outside.any():
            total = total + outside * self._at(self.curve, inner)
        return total

    def _at(self, curve: PPoly, T: Floats) -> Floats:
        """One of the curves at T : any shape [K], same shape, beyond the table as at its end."""
        at = np.array(T, dtype=np.float64, order="C")
        if at.size > SMALL:
            return np.asarray(curve(np.clip(at, self.low, self.high)))
        _piecewise()(curve.c, curve.x, self.low, self.high, at.reshape(-1))
        return at

    # Made once, not at every call: they are asked for in every iteration.

    @cached_property
    def _derivative(self) -> PPoly:
        assert self.curve is not None
        return self.curve.derivative()

    @cached_property
    def _antiderivative(self) -> PPoly:
        assert self.curve is not None
        return self.curve.antiderivative()

    @property
    def is_constant(self) -> bool:
        """True where the property does not depend on temperature."""
        return self.curve is None


def property_from(spec: float | Mapping[str, Any] | PropertyTable | Polynomial) -> Property:
    """Make a Property of what stands at a key, or of its form in model.json.

    A number, {"T": [...], "value": [...], "form": "linear" | "cubic"} (left out: linear), or
    {"polynomial": [a0, a1, ...], "T_ref": K}, which is a0 + a1 (T - T_ref) + ...  Raises ValueError where it is none of
    them.
    """
    if isinstance(spec, Mapping):
        return property_from(made(Polynomial, spec) if "polynomial" in spec else made(PropertyTable, spec))
    if isinstance(spec, Polynomial):
        a = np.asarray(spec.polynomial, dtype=float)
        from scipy.interpolate import PPoly  # 0.2 s, and most scenes have no curve

        # One piece wide enough for any temperature; PPoly wants the highest power first, about its left end.
        return Property(None, PPoly(a[::-1, None], np.array([spec.T_ref, spec.T_ref + 1e9])))
    if not isinstance(spec, PropertyTable):
        return Property(float(spec))
    T, value = np.asarray(spec.T, dtype=float), np.asarray(spec.value, dtype=float)
    if T.size == 1:
        return Property(float(value[0]))
    from scipy.interpolate import PchipInterpolator, PPoly

    if T.size == 2 or spec.form is Form.LINEAR:
        curve = PPoly(np.stack([np.diff(value) / np.diff(T), value[:-1]]), T)
    else:
        cubic = PchipInterpolator(T, value)
        curve = PPoly(cubic.c, cubic.x)
    return Property(None, curve, float(T[0]), float(T[-1]))


# Shape functions and quadrature of the kinds of cells, as tables that compiled loops can use.

@dataclass(frozen=True)
class CellQuadrature:
    """Shape functions of one kind of cell at its quadrature points.

    N : (nq, nn) [1].  dN : (nq, nn, 2) [1], derivatives by reference coordinates.  w : (nq,) weights [1].
    """

    N: Floats
    dN: Floats
    w: Floats


@cache
def table_of(kind: str) -> CellQuadrature:
    """Return the table of "quad" (4 nodes) or "triangle" (3 nodes), nodes anticlockwise."""
    # Loaded where there is a mesh to solve on: a half without one need not wait for it.
    from skfem import ElementQuad1, ElementTriP1
    from skfem.quadrature import get_quadrature

    # 2 x 2 Gauss points on quads, 3 points inside triangles: both integrate products of two shape functions, or of two
    # of their gradients, exactly on a straight-sided plane cell, and all weights are positive (a negative one could
    # make the storage at a point negative).
    element, order = {"quad": (ElementQuad1(), 3), "triangle": (ElementTriP1(), 2)}[kind]
    X, w = get_quadrature(element.refdom, order)
    basis = [element.lbasis(X, i) for i in range(element.refdom.nnodes)]
    N = np.array([np.broadcast_to(phi, w.shape) for phi, _ in basis]).T
    dN = np.array([np.broadcast_to(dphi, X.shape) for _, dphi in basis]).transpose(2, 0, 1)
    return CellQuadrature(np.ascontiguousarray(N, dtype=float), np.ascontiguousarray(dN, dtype=float), np.array(w))
