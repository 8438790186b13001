"""Aluminium that freezes against a mould and shrinks away from it, small (case F2-1D; A9 properties).

Nodes along the rod store enthalpy; the unknown s runs through solid, mush and melt without turning back, as in
docs/theory.md.  The left end is insulated, the right one sees a mould of 400 K through h = k_g/(g + g_m).
x[0, 1] is the gap [m]; T and f_s are at the nodes, the tip last.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from coupler.fmu.half import Block

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from fake_halves import FakeHalf, blocks_of

Array = NDArray[np.float64]
RHO, K_S, K_L, C_S, C_L, LATENT, T_M, T_0, T_W = 2500.0, 210.0, 95.0, 1100.0, 1180.0, 3.97e5, 933.0, 940.0, 400.0
K_G, G_M, SHRINKAGE, ALPHA, LENGTH = 0.06, 30e-6, 0.0225026, 2.6e-5, 0.02
MUSH = LATENT / C_S  # K, the width of the mush in s
GAMMA = 1.0 - 1.0 / np.sqrt(2.0)


def parts(s: Array) -> tuple[Array, Array, Array]:
    """T [K], f_s and enthalpy [J/kg] of s."""
    over = s - T_M
    f = np.clip(1.0 - over / MUSH, 0.0, 1.0)
    T = np.where(over < 0.0, s, np.where(over < MUSH, T_M, s - MUSH))
    return T, f, C_S * np.minimum(over, MUSH) + C_L * np.maximum(over - MUSH, 0.0)


def gap_of(T: Array, f: Array) -> float:
    """The gap that freezing and cooling have made [m], by the trapezium rule over the nodes."""
    v = SHRINKAGE * f + ALPHA * np.maximum(T_M - T, 0.0)
    return float(LENGTH / (len(v) - 1) * (v.sum() - 0.5 * (v[0] + v[-1])))


def share_solid(f: Array) -> float:
    return float((f.sum() - 0.5 * (f[0] + f[-1])) / (len(f) - 1))


@dataclass(frozen=True)
class Freezing:
    """n cells."""

    n: int = 100

    @property
    def mass(self) -> Array:
        m = np.full(self.n + 1, RHO * LENGTH / self.n)
        m[[0, -1]] *= 0.5
        return m

    def flow(self, s: Array, h: float) -> tuple[Array, Array]:
        """Heat into the nodes (n + 1,) [W/m2], and its derivative by s, k held, as bands (3, n + 1)."""
        T, f, _ = parts(s)
        k = K_L + (K_S - K_L) * f
        G = 0.5 * (k[1:] + k[:-1]) * self.n / LENGTH
        q = G * np.diff(T)
        flow, bands = np.zeros(self.n + 1), np.zeros((3, self.n + 1))
        flow[:-1] += q
        flow[1:] -= q
        flow[-1] -= h * (T[-1] - T_W)
        moves = ((s < T_M) | (s > T_M + MUSH)).astype(float)  # dT/ds
        bands[0, 1:], bands[2, :-1] = G * moves[1:], G * moves[:-1]
        bands[1, :-1] -= G * moves[:-1]
        bands[1, 1:] -= G * moves[1:]
        bands[1, -1] -= h * moves[-1]
        return flow, bands

    def implicit(self, known: Array, guess: Array, tau: float, h: float) -> Array:
        """s with enthalpy(s) = known [J/kg] + tau flow(s)/mass.  Raises RuntimeError where Newton does not end."""
        s, m = guess, self.mass
        for k in range(400):
            flow, bands = self.flow(s, h)
            H = parts(s)[2]
            r = m * (known - H) + tau * flow
            if np.abs(r).max() < 1e-9 * m[1] * LATENT:
                return s
            matrix = -tau * bands
            matrix[1] += m * np.where(s > T_M + MUSH, C_L, C_S)
            s = _bounded(s, solve_banded((1, 1), matrix, r), k)
        raise RuntimeError(f"400 iterations leave {np.abs(r).max():.1e} J/m2")

    def step(self, method: str, s: Array, dt: float, h: float) -> Array:
        """s dt [s] later by backward_euler or sdirk2."""
        if method == "backward_euler":
            return self.implicit(parts(s)[2], s, dt, h)
        H = parts(s)[2]
        stage = self.implicit(H, s, GAMMA * dt, h)
        return self.implicit(H + (1.0 - GAMMA) / GAMMA * (parts(stage)[2] - H), stage, GAMMA * dt, h)


def _bounded(s: Array, step: Array, k: int) -> Array:
    """A step that stops at the edges of phases it would cross; shorter where the iteration takes long."""
    new = s + (step if k < 60 else 0.5 * step)
    hair = 1e-9
    for edge in (T_M, T_M + MUSH):
        new = np.where((s < edge) & (new > edge), edge + hair, np.where((s > edge) & (new < edge), edge - hair, new))
    return new


def freezing(rod: Freezing, method: str = "sdirk2", damped: int = 4) -> FakeHalf:
    """The thermal half from melt at 940 K; its first substep is made of `damped` steps of backward Euler."""

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        s, begun = state[:-1], state[-1]
        before = float(rod.mass @ parts(s)[2])
        film = K_G / (max(float(inputs["x"][0, 1]), 0.0) + G_M)
        if begun == 0.0:
            for _ in range(damped):
                s = rod.step("backward_euler", s, h / damped, film)
        else:
            s = rod.step(method, s, h, film)
        T, f, _ = parts(s)
        gained = np.array(float(rod.mass @ parts(s)[2]) - before)
        return np.append(s, 1.0), {"T": T, "f_s": f, "heat.stored.rod": gained}

    m = rod.n + 1
    blocks = blocks_of(Block("T", (m,), "K", "output", "Real"), Block("f_s", (m,), "1", "output", "Real"),
                       Block("x", (1, 2), "m", "input", "Real"), Block("heat.stored.rod", (), "J", "output", "Real"))
    return FakeHalf("freezing rod", blocks, rule, np.append(np.full(m, T_0 + MUSH), 0.0))


def leaving(rod: Freezing) -> FakeHalf:
    """The mechanical half: the gap of T and f_s at the end of the step."""

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        return state, {"x": np.array([[0.0, gap_of(np.asarray(inputs["T"]), np.asarray(inputs["f_s"]))]])}

    m = rod.n + 1
    blocks = blocks_of(Block("T", (m,), "K", "input", "Real"), Block("f_s", (m,), "1", "input", "Real"),
                       Block("x", (1, 2), "m", "output", "Real"))
    return FakeHalf("leaving rod", blocks, rule, np.zeros(1))
