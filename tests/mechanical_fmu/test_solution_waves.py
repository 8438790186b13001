"""Explicit dynamics against closed forms of waves: a bar that is struck, and two blocks that collide."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, blocks, done, elastic, hold, inputs_of

E, RHO = 1e9, 1000.0
SPEED = np.sqrt(E / RHO)  # of waves along a bar with nu = 0
MATERIAL = {"E": E, "nu": 0.0, "alpha": 0.0, "rho": RHO}
V = 0.1  # m/s


def energies(half, state):
    """Kinetic and strain energy [J]; strains are small, so the latter is u.f/2."""
    m = half.system.masses.lumped.reshape(-1, 2)
    f = half.system.volume.forces(np.array(state.u), half.system.moduli(np.array(state.drive.T)))
    return 0.5 * (m * state.v**2).sum(), 0.5 * (state.u * f).sum()


def test_a_wave_arrives_when_it_must_and_keeps_its_energy():
    """One end of a bar moves on at V: behind the front, at c t, all moves at V; strain and kinetic energy are alike."""
    n = 100
    half = elastic(block(np.linspace(0.0, 1.0, n + 1), [0.0, 0.01]),
                   [hold("block.left", 0, {"t": [0.0, 1.0], "value": [0.0, V]}),
                    *(hold(f"block.{side}", 1) for side in ("bottom", "top"))], MATERIAL, method="explicit")
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    t, steps = 0.8 / SPEED, 80
    middle, arrived = 2 * (n // 2), []
    for i in range(steps):
        state, outputs = done(half.step(state, inputs_of(half), i * t / steps, t / steps, NoLink()))
        arrived.append(state.v[middle, 0])
    assert outputs["cuts"] == 0
    # Half of V passes the middle at 0.5/c; the front is some cells wide.
    when = np.interp(0.5 * V, arrived[:60], t * np.arange(1, 61) / steps)
    assert when == pytest.approx(0.5 / SPEED, rel=0.02)
    assert state.v[:100, 0].mean() == pytest.approx(V, rel=0.02)
    assert np.abs(state.v[-20:, 0]).max() <= 0.02 * V
    kinetic, strain = energies(half, state)
    assert kinetic == pytest.approx(0.5 * RHO * V**2 * 0.8 * 0.01, rel=0.03)
    # The end was driven against the stress rho c V all the while.
    assert kinetic + strain == pytest.approx(RHO * SPEED * V**2 * t * 0.01, rel=0.02)


@pytest.mark.few("how0-1.0")
@pytest.mark.parametrize(("how", "penalty"), [({"method": "explicit"}, 1.0), ({"method": "explicit"}, 20.0),
                                              ({"dynamics": {"mass": "lumped"}}, 1.0),
                                              ({"dynamics": {"rho_inf": 0.8}}, 20.0)])
def test_two_blocks_collide_and_exchange_their_velocities(how, penalty):
    """Like blocks, nu = 0: the contact lasts 2 L/c, then the upper one rests and the lower one flies on.

    With twenty times E/h the surfaces rattle against each other; the sums must hold all the same.
    """
    n = 10
    sides = [hold(f"{body}.{side}", 0) for body in ("lower", "upper") for side in ("left", "right")]
    half = elastic(blocks(n, n, gap=1e-4, eps_N=penalty * E * n), sides, MATERIAL, tolerance=1e-9,
                   bodies={"lower": {"material": "m"}, "upper": {"material": "m", "v0": [0.0, -V]}}, **how)
    with_contact = open_link("direct")
    inputs = inputs_of(half)
    state, _ = half.start(inputs, 0.0, with_contact)
    m = half.system.masses.lumped.reshape(-1, 2)
    lower = half.system.interface.node_body == 0
    begin, pressed = 0.5 * RHO * V**2, []
    t, steps = 1e-4 / V + 4.0 / SPEED, 100
    # The gap is flown through in one step, then the collision is followed.
    times = np.concatenate([[0.0], np.linspace(0.98e-4 / V, t, steps)])
    for a, b in pairwise(times):
        state, outputs = done(half.step(state, inputs, a, b - a, with_contact))
        pressed.append(float(outputs["contact.t_N"].min()))
    with_contact.close()
    momentum = (m * state.v)[:, 1]
    assert momentum.sum() == pytest.approx(-RHO * V, rel=1e-6)
    assert momentum[lower].sum() == pytest.approx(-RHO * V, rel=0.03)
    assert abs(momentum[~lower].sum()) <= 0.03 * RHO * V
    kinetic, strain = energies(half, state)
    assert kinetic + strain == pytest.approx(begin, rel=0.02)
    if penalty > 1.0:
        return
    # The pressure of the plateau is rho c V/2, over which it ripples with the cells, and it lasts 2 L/c.
    p = -np.array(pressed)
    lasts = (p > 0.1 * RHO * SPEED * V).sum() * (times[-1] - times[1]) / (steps - 1)
    assert lasts == pytest.approx(2.0 / SPEED, rel=0.1)
    mean = p.sum() * (times[-1] - times[1]) / (steps - 1) * SPEED / 2.0
    assert mean == pytest.approx(0.5 * RHO * SPEED * V, rel=0.03)
