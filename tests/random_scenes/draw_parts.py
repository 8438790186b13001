"""Materials, laws, signals and conditions of random scenes, as hypothesis strategies.

What matters in a scene are ratios (a gap over what expansion closes, a conductance over that of the body, a window over
the diffusion time of a cell), so ratios are drawn, over decades, and numbers made of them.  Strategies put the plainest
first: that is where hypothesis shrinks to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

Doc = dict[str, Any]


def one_of(*values: Any) -> st.SearchStrategy[Any]:
    """One of these values, the plainest first."""
    return st.sampled_from(values)


def one_in(n: int) -> st.SearchStrategy[bool]:
    """True once in n."""
    return st.sampled_from([False] * (n - 1) + [True])


def decades(low: float, high: float, plain: float) -> st.SearchStrategy[float]:
    """1, 2 or 5 times a power of ten between low and high, evenly by logarithm; shrinks to what is nearest `plain`."""
    values = [float(f"{m}e{k}") for k in range(-16, 16) for m in (1, 2, 5)]
    kept = [v for v in values if low <= v <= high]
    return st.sampled_from(sorted(kept, key=lambda v: abs(v - plain) / max(v, plain)))


def rounded(value: float) -> float:
    """A value to four digits: short in a file."""
    return float(f"{value:.4g}")


# Materials

@st.composite
def materials(draw: DrawFn, T_low: float, T_high: float, axes: bool) -> Doc:
    """A solid over the range of engineering; T_low, T_high [K] : between which its tables bend.

    axes : whether it may conduct differently along two axes.
    """
    k, c = draw(decades(0.1, 400, 50)), draw(decades(200, 5000, 500))
    found: Doc = {"rho": draw(decades(500, 20000, 5000)), "c": c, "k": k,
                  "E": draw(decades(1e6, 4e11, 2e11)), "nu": draw(one_of(0.3, 0, 0.2, 0.45, 0.49, 0.4999)),
                  "alpha": draw(one_of(1e-5, 0, 2e-5, 5e-5, 1e-6)), "T_ref": T_low}
    how = draw(one_of("plain", "plain", "plain", "plain", "k(T)", "c(T)", "E(T)", "axes"))
    if how in ("k(T)", "c(T)", "E(T)"):
        name = how[0]
        other = rounded(found[name] * draw(one_of(0.5, 2, 0.2)))
        found[name] = {"T": [T_low, T_high], "value": [found[name], other]}
    elif how == "axes" and axes:
        found["k"] = {"k_1": k, "k_2": rounded(k * draw(one_of(0.5, 0.1))), "angle": draw(one_of(0, 30, 90)),
                      "turns": draw(one_of(True, False))}
    return found


@st.composite
def flow_laws(draw: DrawFn, E: float, T_low: float) -> Doc:
    """What a material that flows has besides: plastic, creeping, or nothing."""
    kind = draw(one_of("none", "none", "none", "plastic", "creep"))
    if kind == "plastic":
        s_y = rounded(E * draw(one_of(1e-3, 3e-4, 1e-2)))
        hardening = draw(one_of(None, {"law": "linear", "H": rounded(0.05 * E)},
                                {"law": "voce", "Q": s_y, "b": 20, "H": 0}))
        return {"plastic": {"s_y": s_y} | ({"hardening": hardening} if hardening else {})}
    if kind == "creep":
        n = draw(one_of(1, 3, 5))
        s = 1e-3 * E  # the stress at which a strain of 1e-4 a second is reached
        return {"creep": {"A": float(f"{1e-4 / s**n:.3g}"), "n": n}}
    return {}


@st.composite
def latent_heats(draw: DrawFn, c: float, T_low: float, T_high: float) -> Doc:
    """Latent heat between the temperatures of the scene, or nothing."""
    if draw(one_in(6)):
        T_m = rounded(T_low + 0.5 * (T_high - T_low))
        L = rounded(c * (T_high - T_low) * draw(one_of(1, 0.1, 10)))
        return {"latent": draw(one_of({"L": L, "T_s": T_m, "T_l": rounded(T_m + 0.1 * (T_high - T_low))},
                                      {"L": L, "T_m": T_m}))}
    return {}


# Heat across a pair

@st.composite
def conductions(draw: DrawFn, h: float, p: float, gap: float) -> Doc:
    """Laws of a pair.  h [W/m2K] : where it just touches.  p [Pa], gap [m] : of the scene's size."""
    closed = draw(one_of(
        {"law": "constant", "h": h},
        {"law": "power", "h0": h, "h1": rounded(10 * h), "p0": rounded(p), "exponent": 0.95},
        {"law": "power", "h0": h, "h1": rounded(100 * h), "p0": rounded(p), "exponent": 1, "p_max": rounded(10 * p)},
        {"law": "table", "x": [0, rounded(p), rounded(3 * p)], "h": [h, rounded(3 * h), rounded(5 * h)]},
        {"law": "sum", "of": [{"law": "constant", "h": h}, {"law": "cmy", "k_s": rounded(h * 1e-6), "m": 0.1,
                                                            "sigma": 1e-6, "H": rounded(30 * p)}]}))
    layer = rounded(gap * draw(decades(1e-3, 1, 0.1)))
    falling = {"law": "table", "x": [0, layer, rounded(4 * layer)], "h": [h, rounded(h / 3), rounded(h / 50)]}
    open_ = draw(one_of({"law": "gas", "k_g": rounded(h * layer), "g_m": layer}, None,
                        {"law": "constant", "h": rounded(0.01 * h)}, falling))
    return {"closed": closed, "open": open_}


# What changes over time

@st.composite
def courses(draw: DrawFn, end: float, first: float, last: float) -> Any:
    """A SIGNAL from `first` to about `last`: constant, ramps, jumps, up and down.  end [s] : of the run."""
    a, b = rounded(first), rounded(last)
    mid = rounded(0.5 * end)
    kind = draw(one_of("ramp and hold", "ramp", "jump", "up and down", "constant"))
    if kind == "constant":
        return b
    if kind == "jump":
        at = rounded(end * draw(one_of(0.3, 0.5, 0.05)))
        return {"t": [at, at], "value": [a, b]}
    if kind == "ramp":
        return {"t": [0, end], "value": [a, b]}
    if kind == "ramp and hold":
        at = rounded(end * draw(one_of(0.3, 0.5, 0.1, 0.02)))
        return {"t": [0, at], "value": [a, b]}
    return {"t": [0, rounded(0.3 * end), mid, rounded(0.8 * end)], "value": [a, b, b, a]}


@st.composite
def thermal_conditions(draw: DrawFn, on: str, h_body: float, temperatures: Sequence[float], end: float) -> list[Doc]:
    """What happens to the heat of one free surface: nothing, or one condition, seldom two."""
    T_low, T_high = min(temperatures), max(temperatures)
    kind = draw(one_of("insulated", "temperature", "convection", "temperature course", "radiation", "flux", "two"))
    if kind == "insulated":
        return []
    T = draw(st.sampled_from(sorted(temperatures)))
    if kind == "temperature":
        return [{"on": on, "temperature": T}]
    if kind == "temperature course":
        return [{"on": on, "temperature": draw(courses(end, T, T_low if 0.5 * (T_low + T_high) < T else T_high))}]
    if kind == "flux":
        q = rounded(h_body * max(T_high - T_low, 1.0) * draw(one_of(0.5, -0.1, 0.05)))
        return [{"on": on, "flux": draw(courses(end, 0.0, q))}]
    film = {"on": on, "convection": {"h": rounded(h_body * draw(decades(0.01, 1000, 1))), "T": T}}
    if kind == "convection":
        return [film]
    radiation = {"on": on, "radiation": {"emissivity": draw(one_of(0.8, 0.2, 1)), "T": T}}
    return [radiation] if kind == "radiation" else [film, radiation]


@st.composite
def held_warm(draw: DrawFn, on: str, h_body: float, T: float, sharply: bool) -> Doc:
    """A surface kept at about T [K]: sharply where that may be, or by a film of what the body conducts or more."""
    if sharply and draw(one_of(True, True, False)):
        return {"on": on, "temperature": T}
    return {"on": on, "convection": {"h": rounded(h_body * draw(decades(1, 1000, 10))), "T": T}}


@st.composite
def over_place(draw: DrawFn, condition: Doc, size: float, span: float) -> Doc:
    """The same condition, its temperature rising along x.  size [m] : of the scene; span [K]."""
    T = condition.get("temperature")
    if not isinstance(T, float):
        return condition
    rise = rounded(span * draw(one_of(0.1, -0.1)))
    return condition | {"temperature": {"terms": [{"t": T}, {"x": {"at": [0, size], "value": [0, rise]}}]}}
