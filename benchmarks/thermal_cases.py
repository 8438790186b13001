"""Three cases with closed forms for the thermal half: NAFEMS T3, the two-phase Stefan problem, two half-spaces."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc, erfcx

from contact.half.interface import Interface, Pair
from contact.half.model import Variable

Floats = NDArray[np.float64]
ZERO = 273.15  # K at 0 degC


@dataclass(frozen=True)
class Case:
    """A strip along y, cut into n cells a body along it and some across, so that a finer mesh costs what it does.

    exact : y (n,) [m] -> T (n,) [K] at `end` [s].  lengths : of each body [m], bodies meet at y = 0.
    judged : largest |y| [m] at which the error is taken; beyond it the strip's far end is no half-space.
    """

    name: str
    lengths: tuple[float, ...]
    end: float
    spec: dict[str, Any]
    exact: Callable[[Floats], Floats]
    judged: float = math.inf
    pairs: tuple[Pair, ...] = ()
    pressure: float = 0.0

    def mesh(self, n: int, across: int) -> Interface:
        """n cells a body along, some across, all of one size."""
        return strip(self.lengths, n, across, self.pairs)


def strip(lengths: tuple[float, ...], n: int, across: int, pairs: tuple[Pair, ...] = ()) -> Interface:
    """Bodies "a", "b" of these lengths [m] along y, with surfaces .bottom and .top; n cells along, some across.

    A body alone begins at y = 0; of a pair the first one ends and the second one begins there.
    """
    width = across * lengths[0] / n
    nodes, cells, bodies, surfaces, first = [], [], [], {}, 0
    for body, (name, L) in enumerate(zip(("a", "b"), lengths, strict=False)):
        start = -L if pairs and body == 0 else 0.0
        X, Y = np.meshgrid(np.linspace(0.0, width, across + 1), np.linspace(start, start + L, n + 1))
        grid = first + np.arange(X.size).reshape(X.shape)
        nodes.append(np.stack([X.ravel(), Y.ravel()], axis=1))
        cells.append(np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4))
        bodies.append(np.full(len(cells[-1]), body, dtype=np.int32))
        for side, line in (("bottom", grid[0]), ("top", grid[-1, ::-1])):
            surfaces[f"{name}.{side}"] = np.stack([line[:-1], line[1:]], axis=1).astype(np.int32)
        first += X.size
    names = ("a", "b")[: len(lengths)]
    return Interface("plane", np.concatenate(nodes), np.concatenate(cells).astype(np.int32),
                     np.empty((0, 3), np.int32), np.concatenate(bodies), np.empty(0, np.int32), names,
                     names, surfaces, {}, pairs)


def first_inputs(variables: Iterable[Variable]) -> dict[str, Any]:
    """The inputs of a half at their start values."""
    values = {v.name: np.broadcast_to(v.start, v.shape).copy() if v.shape else v.start
              for v in variables if v.causality == "input"}
    return values | {"control.event": 0, "control.method": 0}


def _body(T0: float, material: str = "m") -> dict[str, Any]:
    return {"material": material, "T0": T0}


def _spec(materials: dict[str, Any], bodies: dict[str, Any], boundary: list[dict[str, Any]],
          **more: Any) -> dict[str, Any]:
    return {"half": "thermal", "format": 2, "materials": materials, "bodies": bodies, "boundary": boundary, **more}


def nafems_t3() -> Case:
    """One face held, the other at 100 sin(pi t/40): smooth."""
    L, end, w, a = 0.1, 32.0, math.pi / 40.0, 35.0 / (440.5 * 7200.0)
    t = np.linspace(0.0, end, 8001)  # the straight pieces are within 1e-5 K of the sine
    wave = {"t": t.tolist(), "value": (ZERO + 100.0 * np.sin(w * t)).tolist()}

    def exact(y: Floats) -> Floats:
        m = np.arange(1, 4001) * math.pi / L
        rate = a * m**2
        share = -2.0 * np.cos(m * L) / (m * L)  # of y/L
        b = -100.0 * w * share * (rate * math.cos(w * end) + w * math.sin(w * end)
                                  - rate * np.exp(-rate * end)) / (rate**2 + w**2)
        return ZERO + 100.0 * math.sin(w * end) * y / L + np.sin(np.outer(y, m)) @ b

    spec = _spec({"m": {"rho": 7200.0, "k": 35.0, "c": 440.5}}, {"a": _body(ZERO)},
                 [{"on": "a.bottom", "temperature": ZERO},
                  {"on": "a.top", "temperature": wave}])
    return Case("A5", (L,), end, spec, exact)


@dataclass(frozen=True)
class Stefan:
    """Aluminium that freezes from a cold wall at y = 0."""

    rho: float = 2500.0
    k_s: float = 210.0
    c_s: float = 1100.0
    k_l: float = 95.0
    c_l: float = 1180.0
    L: float = 3.97e5
    T_m: float = 933.0
    wall: float = 293.15
    melt: float = 940.0

    @cached_property
    def growth(self) -> float:
        """lambda of the front 2 lambda sqrt(a_s t), by bisection of the balance of heat at the front."""
        nu = math.sqrt(self.a_s / self.a_l)
        low, high = 1e-3, 3.0
        for _ in range(200):
            z = 0.5 * (low + high)
            # erfcx(z) = exp(z^2) erfc(z)
            gain = (self.c_s * (self.T_m - self.wall) * math.exp(-z * z) / math.erf(z)
                    - self.k_l / (self.rho * math.sqrt(self.a_s * self.a_l)) * (self.melt - self.T_m)
                    / float(erfcx(z * nu)) - z * math.sqrt(math.pi) * self.L)
            low, high = (z, high) if gain > 0.0 else (low, z)
        return 0.5 * (low + high)

    @property
    def a_s(self) -> float:
        return self.k_s / (self.rho * self.c_s)

    @property
    def a_l(self) -> float:
        return self.k_l / (self.rho * self.c_l)

    def front(self, t: float) -> float:
        """[m]"""
        return 2.0 * self.growth * math.sqrt(self.a_s * t)

    def T(self, y: Floats, t: float) -> Floats:
        """[K] at depth y : (n,) [m]."""
        z, nu = self.growth, math.sqrt(self.a_s / self.a_l)
        solid = self.wall + (self.T_m - self.wall) * (1.0 - erfc(y / (2.0 * math.sqrt(self.a_s * t)))) / math.erf(z)
        liquid = self.melt - (self.melt - self.T_m) * erfc(y / (2.0 * math.sqrt(self.a_l * t))) / erfc(z * nu)
        return np.where(y < self.front(t), solid, liquid)


def stefan() -> Case:
    """Two-phase, isothermal melting."""
    s, end = Stefan(), 10.0
    material = {"rho": s.rho, "k": {"solid": s.k_s, "liquid": s.k_l}, "c": {"solid": s.c_s, "liquid": s.c_l},
                "latent": {"L": s.L, "T_s": s.T_m, "T_l": s.T_m}}
    spec = _spec({"m": material}, {"a": _body(s.melt)}, [{"on": "a.bottom", "temperature": s.wall}])
    return Case("A9", (0.15,), end, spec, lambda y: s.T(y, end), judged=0.1)


def half_spaces() -> Case:
    """Aluminium at 500 K and steel at 300 K touch with conductance h from t = 0."""
    end, h, hot, cold = 10.0, 2000.0, 500.0, 300.0
    k, heat = (210.0, 45.0), (2.75e6, 3.744e6)
    effusivity = [math.sqrt(a * b) for a, b in zip(k, heat, strict=True)]
    H = h * sum(1.0 / e for e in effusivity)

    def drop(y: Floats, side: int) -> Floats:
        root = np.abs(y) / (2.0 * math.sqrt(k[side] / heat[side] * end))
        far = root + H * math.sqrt(end)
        # exp(2 root H sqrt(t) + H^2 t) erfc(far) = exp(-root^2) erfcx(far)
        return h * (hot - cold) / (effusivity[side] * H) * (erfc(root) - np.exp(-root**2) * erfcx(far))

    def exact(y: Floats) -> Floats:
        return np.where(y < 0.0, hot - drop(y, 0), cold + drop(y, 1))

    materials = {name: {"rho": 1000.0, "k": k_i, "c": c_i / 1000.0}
                 for name, k_i, c_i in zip(("m", "n"), k, heat, strict=True)}
    spec = _spec(materials, {"a": _body(hot), "b": _body(cold, "n")}, [],
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}})
    return Case("D2", (0.2, 0.08), end, spec, exact, pairs=(Pair("p", "b.bottom", "a.top", 0.01, 1e12),),
                pressure=1e6)


CASES = {"A5": nafems_t3, "A9": stefan, "D2": half_spaces}
