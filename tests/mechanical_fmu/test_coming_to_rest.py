"""What comes to rest on a surface: heat is the energy it had, it stays where it stopped, and nothing hops or rings."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, done, elastic, hold, inputs_of, rectangle
from test_friction_inertia import MASS, MU, SIDE, V0, G, sliding
from test_impact import stiff

BLOCK = 1  # the second body


def went(half, steps):
    """t (n,), mean displacement (n, 2) [m] of the block, energy (n,) and friction heat (n,) [J] of each step."""
    link, t, rows = open_link("direct"), 0.0, []
    state, _ = half.start(inputs_of(half), t, link)
    of = half.system.interface.node_body == BLOCK
    for h in steps:
        state, out = done(half.step(state, inputs_of(half), t, h, link))
        t += h
        rows.append((t, *np.array(state.u)[of].mean(axis=0), stiff(half, state).sum(),
                     float(np.sum(out.get("contact.E_friction", 0.0)))))
    link.close()
    found = np.array(rows)
    return found[:, 0], found[:, 1:3], found[:, 3], found[:, 4]


UNEVEN = tuple(1e-3 * (1.0 + (3 * k) % 7) for k in range(100))  # 0.4 s


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("steps", "rho_inf"), [
    pytest.param((1e-3,) * 380, 1.0, marks=pytest.mark.slow), ((6e-3,) * 65, 1.0), ((6e-3,) * 65, 0.5),
    pytest.param(UNEVEN, 1.0, marks=pytest.mark.slow)])
def test_a_block_that_friction_stops_stays_where_it_stopped(steps, rho_inf, swapped) -> None:
    """It hopped, and ended without equilibrium where it sticks; its heat was 0.3 % off by then."""
    t, u, kinetic, heat = went(sliding(True, swapped, dynamics={"rho_inf": rho_inf}), steps)
    stops = V0 / (MU * G)
    rests = t > stops + 3.0 * max(steps)
    assert u[-1, 0] == pytest.approx(0.5 * V0 * stops, rel=3e-4)
    assert heat.sum() == pytest.approx(0.5 * MASS * V0**2, rel=1e-4 if rho_inf == 1.0 else 1e-3)
    assert np.ptp(u[rests, 0]) < 1e-8
    assert heat[rests].max() < 1e-9
    assert kinetic[rests].max() < 1e-8 * kinetic[0]
    assert abs(u[-1, 1]) < 1e-9


@pytest.mark.parametrize("swapped", [False, True])
def test_a_block_thrown_up_a_slope_slides_back(swapped: bool) -> None:
    """Friction turns round with it: up it goes for v0/(g sin + mu g cos), and down by g sin - mu g cos."""
    across, along = 0.8 * G, 0.6 * G
    half = sliding(True, swapped, gravity={"x": -along, "y": -across})
    t, u, _, heat = went(half, (4e-3,) * 100)
    up, down = along + MU * across, along - MU * across
    turns = V0 / up
    top = 0.5 * V0 * turns
    exact = np.where(t < turns, V0 * t - 0.5 * up * t**2, top - 0.5 * down * (t - turns)**2)
    # It turns round at the end of a step.
    assert np.abs(u[:, 0] - exact).max() < 1e-3
    assert heat.sum() == pytest.approx(MU * MASS * across * (top + top - exact[-1]), rel=5e-3)


def colliding():
    """A block that flies at another one of the same mass."""
    n1, c1, s1 = rectangle(np.linspace(0.0, SIDE, 3), np.linspace(0.0, SIDE, 3))
    n2, c2, s2 = rectangle(np.linspace(SIDE + 1e-3, 2.0 * SIDE + 1e-3, 3), np.linspace(0.0, SIDE, 3), first=len(n1))
    body = np.r_[np.zeros(len(c1), np.int32), np.ones(len(c2), np.int32)]
    surfaces = {f"a.{k}": v for k, v in s1.items()} | {f"b.{k}": v for k, v in s2.items()}
    interface = Interface("plane", np.concatenate([n1, n2]), np.concatenate([c1, c2]).astype(np.int32), NO_CELLS[3],
                          body, body[:0], ("a", "b"), ("m", "m"), surfaces, {},
                          (Pair("face", "b.left", "a.right", 0.01, 1e11),))
    bodies = {"a": {"material": "m", "v0": [V0, 0.0], "rigid": True}, "b": {"material": "m", "rigid": True}}
    return elastic(interface, [hold("a", 1), hold("a", 2), hold("b", 1), hold("b", 2)], {"rho": 7800.0},
                   tolerance=1e-10, bodies=bodies, dynamics={})


@pytest.mark.parametrize("share", [0.05, 0.15, 0.22, 0.3, 0.45])
def test_a_bounce_keeps_its_energy(share: float) -> None:
    """share : of the time that the blocks touch, of a step."""
    touch = np.pi * np.sqrt(0.5 * MASS / (1e11 * SIDE))
    h = share * touch
    steps = (1e-3 / V0 - 0.4 * h, *(h,) * int(4.0 / share))
    t, u, kinetic, _ = went(colliding(), steps)
    assert kinetic[-1] == pytest.approx(0.5 * MASS * V0**2, rel=1e-3)
    after = t[-1] - 1e-3 / V0 - touch
    assert u[-1, 0] == pytest.approx(V0 * (after + 0.5 * touch), rel=0.05)
