"""Weight acts where the mass is: what falls freely is under no stress, whatever has no mass of its own."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import done, elastic, inputs_of
from test_impact import bars

G, RHO = (3.0, -9.81), 7800.0


def falling(cells="quads", geometry="plane", how=None, rigid=False):
    """Two bars, one above the other, that nothing holds; nodes of the surfaces of their pair have no mass."""
    bodies = {"lower": {"material": "m"} | ({"rigid": True} if rigid else {}), "upper": {"material": "m"}}
    pull = {"y": G[1]} if geometry == "axisymmetric" else {"x": G[0], "y": G[1]}
    return elastic(bars("bars", 6, 1.0, 0.3, cells=cells, geometry=geometry, grade=1.3), [],
                   {"E": 1e7, "nu": 0.3, "rho": RHO}, tolerance=1e-11, bodies=bodies, dynamics=how or {}, gravity=pull)


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("cells", ["quads", "triangles"])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_weight_is_the_mass_matrix_times_gravity(cells: str, mass: str, rigid: bool) -> None:
    """Surfaces weighed as if they had mass: 2.7 N apart of 64 N."""
    half = falling(cells, how={"mass": mass}, rigid=rigid)
    masses = half.system.masses
    assert masses.without.any()
    weight = masses.dead.at(np.array([G[load.component] for load in half.system.spec.dead]))
    inertia = (masses.matrix(mass == "lumped") @ np.tile(G, masses.n)).reshape(-1, 2)
    upper = np.flatnonzero(half.system.interface.node_body == 1)  # the weight of a rigid body goes to its point later
    assert np.abs(weight[upper] - inertia[upper]).max() < 1e-12 * np.abs(inertia[upper]).sum()
    assert weight.sum(axis=0) == pytest.approx(RHO * 0.2 * np.array(G))


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_what_falls_freely_is_not_strained(geometry: str) -> None:
    """It had a fifth of the stress that its weight makes where it stands."""
    half = falling(geometry=geometry)
    link, t, h = open_link("direct"), 0.0, 2e-3
    state, _ = half.start(inputs_of(half), t, link)
    for _ in range(5):
        state, _ = done(half.step(state, inputs_of(half), t, h, link))
        t += h
    link.close()
    u = np.array(state.u)
    f = half.system.volume.forces(u, half.system.moduli(np.array(state.drive.T)))
    assert np.abs(u[:, 1] - 0.5 * G[1] * t**2).max() < 1e-9 * abs(0.5 * G[1] * t**2)
    assert np.abs(f).max() < 1e-9 * RHO * abs(G[1]) * 0.1
