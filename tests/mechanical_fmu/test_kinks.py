"""A block on a floor that moves by a table: friction follows each kink of that at once."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.functions import Signal

sys.path.insert(0, str(Path(__file__).parent))
from test_coming_to_rest import went
from test_friction_inertia import MASS, MU, V0, G, sliding

BOUND = MU * G
TIMES = (0.0, 0.02, 0.05, 0.08, 0.11, 0.14)  # in the first piece the block comes to lie on the floor
# What stops does so in the first step behind a kink.
SPEEDS = {"it starts": (V0, V0 + 0.6, V0 + 0.5, V0 + 0.5, V0 + 0.6), "to and fro": (V0, 0.0, 1.5, 0.3, 1.4),
          "caught up with": (V0, V0 + 0.01, V0 + 0.005, V0 - 0.008, V0)}


def exact(speeds):
    """x (5,) [m] of the block at the end of each piece of the table, and the heat (5,) [J] of each."""
    x, v, rows = 0.0, V0, []
    for T, V in zip(np.diff(TIMES), speeds, strict=True):
        slip = V - v
        t = min(abs(slip) / BOUND, T)
        end = v + np.sign(slip) * BOUND * t
        x += 0.5 * (v + end) * t + V * (T - t)
        v = end
        rows.append((x, MASS * BOUND * 0.5 * (abs(slip) + abs(V - v)) * t))
    return np.array(rows).T


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("pieces", [1, 3, 5])
@pytest.mark.parametrize("case", SPEEDS)
def test_friction_follows_the_kinks_of_a_motion(case: str, pieces: int, swapped: bool) -> None:
    """It was that of before for half of each step behind a kink, of whatever size: nothing saw that."""
    speeds = SPEEDS[case]
    ways = np.concatenate([[0.0], np.cumsum(np.diff(TIMES) * speeds)])
    half = sliding(True, swapped, floor={"t": list(TIMES), "value": ways.tolist()})
    _, u, _, heat = went(half, (*(5e-4,) * 40, *np.repeat(np.diff(TIMES)[1:] / pieces, pieces)))
    x, friction = exact(speeds)
    assert np.abs(u[39::pieces, 0] - x).max() < 2e-6
    # What is caught up with slips by no more than some hundred times what strains the spring of sticking.
    off = 2e-2 if case == "caught up with" else 2e-4
    assert heat[40:].reshape(-1, pieces).sum(axis=1) == pytest.approx(friction[1:], rel=off)


def test_slopes_of_a_signal() -> None:
    signal = Signal(np.array([0.0, 1.0, 1.0, 3.0]), np.array([0.0, 2.0, 5.0, 4.0]))
    assert [signal.slope(t, side) for t in (0.0, 1.0, 3.0) for side in (-1, 1)] == [0.0, 2.0, 2.0, -0.5, -0.5, 0.0]
    assert Signal(np.zeros(1), np.ones(1)).slope(0.0) == 0.0
