"""Thermal contact laws: conductance h_CI [W/m2K] from pressure, gap and temperature.  Eqs. (7)-(10).

A law is a pure function of (p_N, g_N, T): touching points give it their pressure and the gap 0, open points
the pressure 0 and their gap.  So one law may serve both branches; then they join.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

CMY_FACTOR = 1.25  # Cooper-Mikic-Yovanovich, h = 1.25 k_s (m/sigma) (p/H)^0.95
CMY_EXPONENT = 0.95


@dataclass(frozen=True)
class Law:
    """A conductance law.

    name : its word in model.json.
    of : (p_N [Pa], g_N [m], T [K]) -> (h [W/m2K], dh/dT [W/m2K2]), of one shape; p_N, g_N >= 0.
    """

    name: str
    of: Callable[[Array, Array, Array], tuple[Array, Array]]


def parse_law(spec: Mapping[str, Any]) -> Law:
    """The law a LAW entry of model.json describes (docs/design.md).

    Raises ValueError naming key and value where a parameter is unknown, missing, no number or out of range.
    """
    if not isinstance(spec, Mapping):
        raise ValueError(f"a law is a table of parameters, got {spec!r}")
    kind = spec.get("law")
    if not isinstance(kind, str) or kind not in _LAWS:
        raise ValueError(f"law: {kind!r} is not one of {', '.join(_LAWS)}")
    required, optional, make = _LAWS[kind]
    for key in spec:
        if key not in ("law", *required, *optional):
            raise ValueError(f"law {kind}: unknown parameter {key!r} (value {spec[key]!r}); "
                             f"it has {', '.join((*required, *optional))}")
    for key in required:
        if key not in spec:
            raise ValueError(f"law {kind}: parameter {key!r} is missing")
    return Law(kind, make(spec))


def closed_conductance(law: Law, p: ArrayLike, T_mean: ArrayLike) -> tuple[Array, Array]:
    """Touching: (h, dh/dT) from pressure p : (n,) [Pa] and T_mean = (T_a + T_b)/2 : (n,) [K].  Eq. (9)."""
    p_, T = np.broadcast_arrays(np.asarray(p, dtype=float), np.asarray(T_mean, dtype=float))
    return law.of(np.maximum(p_, 0.0), np.zeros(p_.shape), T)


def open_conductance(law: Law, g: ArrayLike, T_mean: ArrayLike) -> tuple[Array, Array]:
    """Apart: (h, dh/dT) from gap g : (n,) [m] and T_mean : (n,) [K]; a negative gap reads as 0.  Eq. (10)."""
    g_, T = np.broadcast_arrays(np.asarray(g, dtype=float), np.asarray(T_mean, dtype=float))
    # fault: negative gaps reach the law -> return law.of(np.zeros(g_.shape), g_, T) | contact/test_laws
    return law.of(np.zeros(g_.shape), np.maximum(g_, 0.0), T)


def branch_jump(closed: Law, opened: Law, T: float) -> float:
    """h(p -> 0+) - h(g -> 0+) [W/m2K] at temperature T [K]: zero where the two branches join."""
    h_closed, _ = closed_conductance(closed, 0.0, T)
    h_open, _ = open_conductance(opened, 0.0, T)
    return float(h_closed - h_open)


def gap_factor(g: ArrayLike, d_cut: float, d_full: float) -> Array:
    """kappa = clip((g - d_cut)/(d_full - d_cut), 0, 1) of convection in a gap g : (n,) [m].  Eq. (7), mended.

    Raises ValueError unless 0 <= d_cut < d_full.
    """
    if not 0.0 <= d_cut < d_full:
        raise ValueError(f"the gap factor needs 0 <= d_cut < d_full, got {d_cut!r} and {d_full!r}")
    # fault: gap factor as misprinted in the paper -> return np.clip((np.asarray(g, dtype=float) - d_full) / (d_full -
    #   d_cut), 0.0, 1.0) | contact/test_laws
    return np.clip((np.asarray(g, dtype=float) - d_cut) / (d_full - d_cut), 0.0, 1.0)


def _number(spec: Mapping[str, Any], key: str, *, positive: bool = False,
            default: float | None = None) -> float:
    """A finite parameter >= 0 (> 0 where positive)."""
    value = spec.get(key, default)
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ValueError(f"law {spec['law']}: {key} must be a number, got {value!r}")
    number = float(value)
    if key not in spec:
        return number  # a default may be infinite
    if not np.isfinite(number) or number < 0.0 or (positive and number == 0.0):
        least = "> 0" if positive else ">= 0"
        raise ValueError(f"law {spec['law']}: {key} must be {least} and finite, got {value!r}")
    return number


Of = Callable[[Array, Array, Array], tuple[Array, Array]]


def _constant(spec: Mapping[str, Any]) -> Of:
    """h."""
    h = _number(spec, "h")
    return lambda p, g, T: (np.full(p.shape, h), np.zeros(p.shape))


def _power(spec: Mapping[str, Any]) -> Of:
    """h0 + h1 (min(p, p_max)/p0)^exponent."""
    h0, h1, p0 = _number(spec, "h0"), _number(spec, "h1"), _number(spec, "p0", positive=True)
    exponent = _number(spec, "exponent", positive=True)
    p_max = _number(spec, "p_max", positive=True, default=np.inf)
    return lambda p, g, T: (h0 + h1 * (np.minimum(p, p_max) / p0) ** exponent, np.zeros(p.shape))


def _cmy(spec: Mapping[str, Any]) -> Of:
    """1.25 k_s (m/sigma) (p/H)^0.95, with k_s = 2 k_1 k_2/(k_1 + k_2)."""
    k_s, m = _number(spec, "k_s"), _number(spec, "m")
    sigma, H = _number(spec, "sigma", positive=True), _number(spec, "H", positive=True)
    factor = CMY_FACTOR * k_s * m / sigma
    return lambda p, g, T: (factor * (p / H) ** CMY_EXPONENT, np.zeros(p.shape))


def _gas(spec: Mapping[str, Any]) -> Of:
    """k_g/(g + g_m): the jump distance g_m is the floor that keeps h finite at g = 0."""
    k_g, g_m = _number(spec, "k_g"), _number(spec, "g_m", positive=True)
    return lambda p, g, T: (k_g / (g + g_m), np.zeros(p.shape))


def _table(spec: Mapping[str, Any]) -> Of:
    """Monotone cubic through (x, h), ends held; x is p_N (touching) and g_N (open), or T by `variable`."""
    name = f"law {spec['law']}"
    try:
        x, h = np.asarray(spec["x"], dtype=float), np.asarray(spec["h"], dtype=float)
    except (TypeError, ValueError) as exc:
        raise ValueError(f"{name}: x and h must be lists of numbers ({exc})") from exc
    if x.ndim != 1 or x.shape != h.shape or x.size < 2:
        raise ValueError(f"{name}: x and h must be equally long lists of 2 or more numbers, "
                         f"got {spec['x']!r}, {spec['h']!r}")
    if not (np.isfinite(x).all() and (np.diff(x) > 0).all() and x[0] >= 0.0):
        raise ValueError(f"{name}: x must be finite, >= 0 and increase, got {spec['x']!r}")
    if not (np.isfinite(h).all() and (h >= 0).all()):
        raise ValueError(f"{name}: h must be finite and >= 0, got {spec['h']!r}")
    variable = spec.get("variable", "x")
    if variable not in ("x", "T"):
        raise ValueError(f"{name}: variable must be 'x' (pressure or gap) or 'T', got {variable!r}")
    curve = PchipInterpolator(x, h)
    if variable == "x":
        # The other of p and g is zero, whichever branch asks, so their sum is the one meant.
        return lambda p, g, T: (np.asarray(curve(np.clip(p + g, x[0], x[-1]))), np.zeros(p.shape))
    slope = curve.derivative()

    def of_temperature(p: Array, g: Array, T: Array) -> tuple[Array, Array]:
        inner = np.clip(T, x[0], x[-1])
        return np.asarray(curve(inner)), np.where(inner == T, slope(inner), 0.0)

    return of_temperature


def _sum(spec: Mapping[str, Any]) -> Of:
    """Sum of laws side by side, as solid spots and gas between them."""
    if not isinstance(spec["of"], (list, tuple)) or not spec["of"]:
        raise ValueError(f"law sum: of must be a list of laws, got {spec['of']!r}")
    laws = [parse_law(part) for part in spec["of"]]

    def total(p: Array, g: Array, T: Array) -> tuple[Array, Array]:
        parts = [law.of(p, g, T) for law in laws]
        return sum((h for h, _ in parts), np.zeros(p.shape)), sum((d for _, d in parts), np.zeros(p.shape))

    return total


# word -> (required parameters, optional parameters, maker): a new law is one function and one line here.
_LAWS: dict[str, tuple[tuple[str, ...], tuple[str, ...], Callable[[Mapping[str, Any]], Of]]] = {
    "constant": (("h",), (), _constant),
    "power": (("h0", "h1", "p0", "exponent"), ("p_max",), _power),
    "cmy": (("k_s", "m", "sigma", "H"), (), _cmy),
    "gas": (("k_g", "g_m"), (), _gas),
    "table": (("x", "h"), ("variable",), _table),
    "sum": (("of",), (), _sum),
}
