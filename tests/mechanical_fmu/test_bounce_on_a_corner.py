"""A rigid block that falls onto its corner, without friction: its centre stays above where it was, its energy too."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface, Pair

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, elastic, hold, rectangle
from test_coming_to_rest import went

WIDE, HIGH, ABOVE, RHO, V0 = 0.1, 0.05, 1e-4, 7800.0, 1.0
EPS = 1e14  # [Pa/m]
MASS = RHO * WIDE * HIGH
INERTIA = MASS * (WIDE**2 + HIGH**2) / 12.0


def drawn(tilt: float, swapped: bool, split: bool) -> tuple[Interface, np.ndarray]:
    """A block turned by `tilt` whose lowest corner is ABOVE a floor, and its nodes.

    split : its sides are of one surface each.
    """
    n1, c1, s1 = rectangle(np.linspace(-0.2, 0.2, 12), np.array([-0.01, 0.0]))
    n2, c2, s2 = rectangle(np.linspace(0.0, WIDE, 4), np.linspace(0.0, HIGH, 3), first=len(n1))
    turn = np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]])
    n2 = n2 @ turn
    n2[:, 1] += ABOVE - n2[:, 1].min()
    body = np.r_[np.zeros(len(c1), np.int32), np.ones(len(c2), np.int32)]
    skin = np.concatenate([s2[k] for k in ("bottom", "right", "top", "left")])
    surfaces = {"floor.top": s1["top"]} | (
        {f"block.{k}": v for k, v in s2.items()} if split else {"block.skin": skin})
    of_block = ["block.bottom", "block.left" if tilt > 0.0 else "block.right"] if split else ["block.skin"]
    pairs = tuple(Pair(f"p{i}", *(("floor.top", s) if swapped else (s, "floor.top")), 0.05, EPS)
                  for i, s in enumerate(of_block))
    return Interface("plane", np.concatenate([n1, n2]), np.concatenate([c1, c2]).astype(np.int32), NO_CELLS[3],
                     body, body[:0], ("floor", "block"), ("m", "m"), surfaces, {}, pairs), n2


def falling(interface: Interface, floor: bool = True):
    """The half of that block, which falls.  floor : it does not deform."""
    bodies = {"floor": {"material": "m", "rigid": floor}, "block": {"material": "m", "v0": [0.0, -V0], "rigid": True}}
    held = [hold("floor", 0), hold("floor", 1), hold("floor", 2)] if floor else []
    return elastic(interface, held, {"rho": RHO}, tolerance=1e-10, bodies=bodies, dynamics={})


@pytest.mark.parametrize("tilt", [0.1, -0.45, 0.8])
@pytest.mark.parametrize(("swapped", "split"), [(False, False), (True, False), (False, True)])
def test_a_block_comes_back_straight_up(tilt: float, swapped: bool, split: bool) -> None:
    """It came aside by 2 to 16 % of its way; the impulse is that of rigid bodies that lose nothing."""
    interface, nodes = drawn(tilt, swapped, split)
    arm = nodes.mean(axis=0) - nodes[nodes[:, 1].argmin()]
    impulse = 2.0 * V0 / (1.0 / MASS + arm[0]**2 / INERTIA)
    steps = (0.9 * ABOVE / V0, *(2e-6,) * 200)
    t, u, kinetic, _ = went(falling(interface), steps)
    assert kinetic[-1] == pytest.approx(0.5 * MASS * V0**2, rel=1e-3)
    late = slice(-5, None)
    up = np.diff(u[late, 1]).mean() / np.diff(t[late]).mean()
    assert up == pytest.approx(impulse / MASS - V0, abs=0.01 * V0)
    # The mean of the nodes is the centre, which goes straight.
    assert abs(u[:, 0]).max() < 1e-3 * abs(u[:, 1]).max()


def test_corners_lean_to_faces_that_do_not_deform() -> None:
    """A floor that deforms comes to fit what sinks in, and its normals jump there: nothing would find equilibrium."""
    interface, _ = drawn(0.1, False, True)
    both = tuple(replace(pair, two_pass=True) for pair in interface.pairs)
    for pairs in (interface.pairs, both):
        for floor in (True, False):
            passes = falling(replace(interface, pairs=pairs), floor).system.contact.message.passes
            rigid = {passes.master[0]: floor, passes.slave[0]: True}
            assert passes.leaning.tolist() == [int(rigid.get(m, True)) for m in passes.master]
