"""A rod that conducts to its tip, and the gap or pressure its expansion makes there (cases E3a-c, D9, D13).

Linear elements along the rod, consistent storage, the left end held at a temperature.  At the tip the heat flow out of
the rod is h (T - T_w) + s with h, s from a law of what the mechanical half tells: x[0, 1] is the gap (negative where it
would overlap), t_N <= 0.  The law is linear in T, so a step is one solve whatever the law is.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Block

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from fake_halves import FakeHalf, blocks_of

Array = NDArray[np.float64]
Law = Callable[[float, float], tuple[float, float]]  # x, t_N -> h, s
GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
SHIFT = 1000.0  # K, told on top of a temperature without a unit: the coupler holds that T is above 0


@dataclass(frozen=True)
class Rod:
    """n cells of length L/n; k [W/mK]; rho_c [J/m3K]; T_left held; T_w of the wall; shift: told T less own T."""

    law: Law
    n: int = 40
    L: float = 1.0
    k: float = 1.0
    rho_c: float = 1.0
    T_left: float = 0.0
    T_w: float = 0.0
    shift: float = SHIFT
    _kept: dict[float, Array] = field(default_factory=dict, compare=False)

    @property
    def matrices(self) -> tuple[Array, Array]:
        """Storage M and conduction K, (n + 1, n + 1)."""
        h = self.L / self.n
        M, K = np.zeros((self.n + 1,) * 2), np.zeros((self.n + 1,) * 2)
        for i in range(self.n):
            M[i:i + 2, i:i + 2] += self.rho_c * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
            K[i:i + 2, i:i + 2] += self.k / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return M, K

    def _solver(self, tau: float) -> tuple[Array, Array, Array]:
        """(M/tau + K)^-1 of the free nodes, M of them, and the flow the held end sends, kept for each tau."""
        if tau not in self._kept:
            M, K = self.matrices
            self._kept[tau] = (np.linalg.inv(M[1:, 1:] / tau + K[1:, 1:]), M[1:, 1:] / tau, -K[1:, 0] * self.T_left)
        return self._kept[tau]

    def implicit(self, known: Array, tau: float, at: tuple[float, float]) -> Array:
        """(n,) free nodes after a step of backward Euler of tau [s] from `known`; at : h, s of the tip."""
        inverse, storage, sent = self._solver(tau)
        plain, tip = inverse @ (storage @ known + sent), inverse[:, -1]
        h, s = at
        q = (h * (plain[-1] - self.T_w) + s) / (1.0 + h * tip[-1])
        return plain - tip * q

    def step(self, method: str, T: Array, dt: float, at: tuple[float, float]) -> Array:
        """(n,) free nodes dt [s] later by backward_euler, midpoint or sdirk2."""
        if method == "backward_euler":
            return self.implicit(T, dt, at)
        if method == "midpoint":
            return 2.0 * self.implicit(T, dt / 2.0, at) - T
        stage = self.implicit(T, GAMMA * dt, at)
        return self.implicit(T + (1.0 - GAMMA) / GAMMA * (stage - T), GAMMA * dt, at)


def conducting(rod: Rod, T: Array, method: str = "backward_euler") -> FakeHalf:
    """The thermal half.  T : (n + 1,) first temperatures, the held end first."""

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        at = rod.law(float(inputs["x"][0, 1]), float(np.sum(inputs.get("contact.t_N", 0.0))))
        new = np.concatenate([[rod.T_left], rod.step(method, state[1:], h, at)])
        return new, {"T": new + rod.shift}

    blocks = blocks_of(Block("T", (rod.n + 1,), "K", "output", "Real"), Block("x", (1, 2), "m", "input", "Real"),
                       Block("contact.t_N", (1,), "Pa", "input", "Real"))
    return FakeHalf("conducting rod", blocks, rule, np.array(T, dtype=float))


@dataclass(frozen=True)
class Growth:
    """gap = g_0 - grows mean(T - T_ref); where that is negative, p = stiffness (-gap).  stiffness 0: no pressure."""

    g_0: float
    grows: float
    T_ref: float = 0.0
    stiffness: float = 0.0

    def told(self, T: Array) -> tuple[float, float]:
        """Gap [m] (< 0: what would overlap) and t_N [Pa] of own temperatures (n + 1,)."""
        mean = float((T[0] + T[-1]) / 2.0 + T[1:-1].sum()) / (len(T) - 1)
        gap = self.g_0 - self.grows * (mean - self.T_ref)
        return gap, -self.stiffness * max(-gap, 0.0)


def growing(growth: Growth, n: int, T: Array, shift: float = SHIFT) -> FakeHalf:
    """The mechanical half of a rod of n cells.  T : (n + 1,) first temperatures."""

    def told(own: Array) -> dict[str, Array]:
        gap, t_N = growth.told(own)
        return {"x": np.array([[0.0, gap]]), "contact.t_N": np.array([t_N])}

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        return state, told(np.asarray(inputs["T"]) - shift)

    blocks = blocks_of(Block("T", (n + 1,), "K", "input", "Real"), Block("x", (1, 2), "m", "output", "Real"),
                       Block("contact.t_N", (1,), "Pa", "output", "Real"))
    return FakeHalf("growing rod", blocks, rule, told(np.asarray(T, dtype=float))["x"])
