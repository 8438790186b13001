"""Fields: boundary data as a function of time and place, a sum of products of a signal and two profiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.signal import Signal, signal_from

Floats = NDArray[np.float64]

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
        """Values at s : any shape [m]."""
        if self.at is None:
            return np.asarray(np.polynomial.polynomial.polyval(s, self.value), dtype=np.float64)
        return np.interp(s, self.at, self.value)


@dataclass(frozen=True)
class Term:
    """t(time) x(x) y(y); a profile that is None is 1."""

    t: Signal
    x: Profile | None
    y: Profile | None


@dataclass(frozen=True)
class Field:
    """The sum of its terms at the current coordinates x (r) and y (z)."""

    terms: tuple[Term, ...]

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
        """(n_terms, n) products of the profiles at coordinates x : (n, 2) [m]; None where it is uniform."""
        if self.is_uniform:
            return None
        out = np.ones((len(self.terms), len(x)))
        for row, term in zip(out, self.terms, strict=True):
            for profile, s in ((term.x, x[:, 0]), (term.y, x[:, 1])):
                if profile is not None:
                    # fault: last profile of a term only -> row[:] = profile(s) | contact/test_half_field
                    row *= profile(s)
        return out

    def at(self, x: Floats, t: float, side: int = 1) -> Floats:
        """(n,) values at coordinates x : (n, 2) [m] and time t [s]."""
        return np.broadcast_to(resolve(self.level(t, side), self.shapes(x)), (len(x),)).copy()

    @cached_property
    def least(self) -> float | None:
        """The least value it takes anywhere at any time; None where that is not worked out."""
        if self.is_uniform:
            times = np.unique(np.concatenate([s.t for s in self.signals]))
            return min(float(np.sum(self.level(t, side))) for t in times for side in (-1, 1))
        return _least(self.terms[0]) if len(self.terms) == 1 else None


def resolve(level: Level, shapes: Floats | None) -> float | Floats:
    """A field's values from its level at a time and its shapes (n_terms, n): (n,), or one number where uniform."""
    return level if shapes is None else np.asarray(level @ shapes, dtype=np.float64)


def _least(term: Term) -> float | None:
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


def field_from(spec: float | Mapping[str, Any]) -> Field:
    """A Field from a SIGNAL or from {"terms": [{"t"?, "x"?, "y"?}, ...]} (the forms of model.json).

    Raises ValueError naming the term where it is no such thing.
    """
    if not (isinstance(spec, Mapping) and "terms" in spec):
        return Field((Term(signal_from(spec), None, None),))
    if set(spec) != {"terms"} or not isinstance(spec["terms"], list) or not spec["terms"]:
        raise ValueError('a field is a number, {"t", "value"}, or {"terms": [...]} with one term or more, nothing else')
    return Field(tuple(_term(term, i) for i, term in enumerate(spec["terms"])))


def _term(spec: Any, i: int) -> Term:
    if not isinstance(spec, Mapping) or set(spec) - {"t", "x", "y"}:
        raise ValueError(f"terms[{i}]: an object with t, x, y (each may be left out) is needed, not {spec!r}")
    try:
        x, y = (profile_from(spec[key]) if key in spec else None for key in ("x", "y"))
        return Term(signal_from(spec.get("t", 1.0)), x, y)
    except (ValueError, TypeError, KeyError) as exc:
        raise ValueError(f"terms[{i}]: {exc}") from exc


def profile_from(spec: Any) -> Profile:
    """A Profile from {"at": [...], "value": [...]} or {"polynomial": [...]}.  Raises ValueError."""
    if isinstance(spec, Mapping) and set(spec) == {"polynomial"}:
        return Profile(None, np.asarray(spec["polynomial"], dtype=float))
    if isinstance(spec, Mapping) and set(spec) == {"at", "value"}:
        return Profile(np.asarray(spec["at"], dtype=float), np.asarray(spec["value"], dtype=float))
    raise ValueError(f'a profile is {{"at", "value"}} or {{"polynomial"}}, not {spec!r}')
