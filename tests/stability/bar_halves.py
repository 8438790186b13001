"""A thermoelastic bar, mode by mode, without units (case E1): D = c = 1, coupling delta.

With u = U sin kx and T = Theta cos kx the bar is U'' = -k^2 U + k Theta, Theta' = -k^2 Theta - delta k U'; every wave
number k is on its own.  Midpoint rule in both fields.  x[i, 1] is U and T[i] is Theta + 1000 of wave number i.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Block

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from fake_halves import FakeHalf, blocks_of

Array = NDArray[np.float64]
SHIFT = 1000.0
DELTA = 0.36


def conducting_bar(k: Array, Theta: Array) -> FakeHalf:
    """Thermal half: E_S moves Theta at the start of the step, E_M comes evenly in it."""

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        s, none = k**2 * h, np.zeros(len(k))
        first = state + inputs.get("E_S", none)
        new = ((1.0 - s / 2.0) * first + inputs.get("E_M", none)) / (1.0 + s / 2.0)
        return new, {"T": new + SHIFT}

    m = len(k)
    blocks = blocks_of(Block("T", (m,), "K", "output", "Real"), Block("x", (m, 2), "m", "input", "Real"),
                       Block("E_M", (m,), "J", "input", "Real"), Block("E_S", (m,), "J", "input", "Real"))
    return FakeHalf("conducting bar", blocks, rule, np.array(Theta, dtype=float))


def moving_bar(k: Array, U: Array, Theta: Array, sees: str = "held", delta: float = DELTA) -> FakeHalf:
    """Mechanical half from rest.  sees : `held`, the T it is given through the step; `interpolated`, the mean of that
    and of the one before.  control.mode 1: entropy is frozen at that T, and the bar is stiffer by 1 + delta.
    """

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        u, v, before = state
        given = np.asarray(inputs["T"]) - SHIFT
        frozen = int(inputs.get("control.mode", 0)) == 1
        theta = 0.5 * (before + given) if sees == "interpolated" else given
        K = k**2 * (1.0 + delta if frozen else 1.0)
        force = k * theta + (delta * k**2 * u if frozen else 0.0)
        # v' = -K u + force, u' = v, both at the middle of the step.
        new_v = (v * (1.0 - K * h**2 / 4.0) + h * (force - K * u)) / (1.0 + K * h**2 / 4.0)
        new_u = u + h / 2.0 * (v + new_v)
        made, none = -delta * k * (new_u - u), np.zeros(len(k))
        out = {"x": np.column_stack([np.zeros(len(k)), new_u]), "E_M": none if frozen else made,
               "E_S": made if frozen else none}
        return np.array([new_u, new_v, given]), out

    m = len(k)
    blocks = blocks_of(Block("T", (m,), "K", "input", "Real"), Block("x", (m, 2), "m", "output", "Real"),
                       Block("E_M", (m,), "J", "output", "Real"), Block("E_S", (m,), "J", "output", "Real"),
                       Block("control.mode", (), "", "input", "Integer"))
    return FakeHalf("moving bar", blocks, rule, np.array([U, np.zeros(m), Theta], dtype=float))
