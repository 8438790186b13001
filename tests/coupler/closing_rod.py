"""Case D13 of the verification page in two tiny halves: a rod grows into a wall, presses, and is cooled there.

Exact in space and time while it is open: modes of a rod held at one end and insulated at the other.  T is told as (tip,
mean).  Against the wall the modes are those, with the heat of the tip as their source.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from coupler.fmu.half import Block
from coupler.schemes.state import CoupledState

sys.path.insert(0, str(Path(__file__).parent))
from coupled_run import start
from fake_halves import FakeHalf, blocks_of

L, K, RHO_C, ALPHA, E = 0.1, 45.0, 7850.0 * 460.0, 1.2e-5, 2e9
T_0, T_HOT, G_0 = 300.0, 500.0, 60e-6
H_0, H_1 = 1000.0, 2e-4  # W/m2K, per Pa
MODES = 60
M = (np.arange(MODES) + 0.5) * np.pi / L
SIGN = np.sin(M * L)
A_0 = -(T_HOT - T_0) * 2.0 / (M * L)  # T = T_HOT + sum a sin(m x)


def temperatures(a: np.ndarray) -> np.ndarray:
    """(tip, mean) [K]."""
    return np.array([T_HOT + a @ SIGN, T_HOT + (a / (M * L)).sum()])


def told(T: np.ndarray) -> dict[str, np.ndarray]:
    """x, pressure and gap of a mean temperature."""
    gap = G_0 - ALPHA * L * (float(T[1]) - T_0)
    return {"x": np.array([[0.0, gap]]), "contact.t_N": np.array([min(E * gap / L, 0.0)]),
            "contact.gap": np.array([max(gap, 0.0)]), "contact.touching": np.array(float(gap < 0.0))}


def heated() -> FakeHalf:
    """The thermal half."""

    def rule(a, inputs, t, h):
        p = -float(inputs["contact.t_N"][0])
        film = H_0 + H_1 * p if p > 0.0 else 0.0
        rate = np.diag(-K / RHO_C * M**2) - 2.0 * film / (L * RHO_C) * np.outer(SIGN, SIGN)
        if film == 0.0:
            new = a * np.exp(np.diag(rate) * h)
        else:
            w, V = np.linalg.eigh(rate)
            rest = np.linalg.solve(rate, 2.0 * film / (L * RHO_C) * (T_HOT - T_0) * SIGN)
            new = rest + V @ (np.exp(w * h) * (V.T @ (a - rest)))
        return new, {"T": temperatures(new)}

    blocks = blocks_of(Block("T", (2,), "K", "output", "Real"), Block("x", (1, 2), "m", "input", "Real"),
                       Block("contact.t_N", (1,), "Pa", "input", "Real"))
    return FakeHalf("heated", blocks, rule, A_0.copy())


def growing() -> FakeHalf:
    """The mechanical half."""
    blocks = blocks_of(Block("T", (2,), "K", "input", "Real"), Block("x", (1, 2), "m", "output", "Real"), *(
        Block(f"contact.{n}", shape, unit, "output", "Real")
        for n, shape, unit in (("t_N", (1,), "Pa"), ("gap", (1,), "m"), ("touching", (), "1"))))
    return FakeHalf("growing", blocks, lambda s, i, t, h: (s, told(np.asarray(i["T"]))), np.zeros(1))


def closing_rod() -> tuple[tuple[FakeHalf, FakeHalf], CoupledState]:
    """Both halves, and the first state."""
    T = temperatures(A_0)
    out = told(T)
    first = start(T_0, 0.0, 0.0)
    now = replace(first.now, T=T, x=out["x"], t_N=out["contact.t_N"], gap=out["contact.gap"])
    return (heated(), growing()), replace(first, now=now)
