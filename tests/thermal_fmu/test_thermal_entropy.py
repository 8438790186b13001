"""The entropy part of the adiabatic split: E_S makes a temperature jump at the start of a substep."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, imbalance, inputs_of, scene, spec, the_context

from contact.half.model import Done
from contact.half.state import from_bytes, to_bytes
from thermal_fmu import phase_change
from thermal_fmu.half import load

CURVED = {"polynomial": [900.0, 0.4, 1e-3]}


def stepped(mesh, model, E_S, h=1e-9, state=None, **given):
    half, link = load(mesh, model), FlatContact()
    inputs = inputs_of(mesh, half, **given)
    if state is None:
        state, _ = half.start(inputs, 0.0, link)
    done = half.step(state, inputs | {"E_S": np.asarray(E_S, dtype=float)}, 0.0, h, link)
    assert isinstance(done, Done), done
    return done


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a_uniform_jump_is_the_enthalpy_of_the_jump(geometry):
    """E_S = rho V int_300^340 c dT in every cell: T jumps to 340 everywhere, at once, c(T) curved."""
    mesh = scene(Box(0.1, 0.3, 0, 0.1, 4, 3), geometry=geometry)
    model = spec([], k=20.0, c=CURVED, rho=2000.0, T0=300.0)
    X = mesh.nodes[mesh.quads]
    area = 0.05 * 0.1 / 3.0
    volume = area * (2.0 * np.pi * X[:, :, 0].mean(axis=1) if geometry == "axisymmetric" else np.ones(12))
    dh = 900.0 * 40.0 + 0.2 * (340.0**2 - 300.0**2) + 1e-3 / 3.0 * (340.0**3 - 300.0**3)
    done = stepped(mesh, model, 2000.0 * volume * dh)
    assert np.abs(done.outputs["T"] - 340.0).max() < 1e-6
    assert done.outputs["max_dT"] == pytest.approx(40.0)
    assert done.outputs["heat.entropy"] == pytest.approx(2000.0 * volume.sum() * dh, rel=1e-12)
    assert done.outputs["heat_stored"] == pytest.approx(done.outputs["heat.entropy"], rel=1e-12)


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("adaptive", [None, {"tolerance": 0.5}])
def test_the_balance_closes_and_prescribed_nodes_hold(method, adaptive):
    """Uneven E_S of both signs beside a wall: what the wall holds back counts as heat.temperature.*."""
    mesh = scene(Box(0, 0.2, 0, 0.1, 5, 3, triangles=True))
    model = spec([{"on": "a.left", "temperature": 350.0},
                  {"on": "a.right", "convection": {"h": 100.0, "T": 300.0}}], k=20.0, c=CURVED, rho=2000.0,
                 T0=350.0, method=method, adaptive=adaptive)
    E_S = 4e3 * np.sin(np.arange(len(mesh.triangles)))
    first = stepped(mesh, model, E_S, h=5.0)
    second = stepped(mesh, model, 0.5 * E_S, h=5.0, state=first.state)
    wall = np.unique(mesh.surfaces["a.left"])
    for done in (first, second):
        assert imbalance([done.outputs]) < EXPECTED["A16"]["tolerance"]
        assert np.abs(done.outputs["T"][wall] - 350.0).max() < 1e-12
        assert done.outputs["heat.temperature.in"] - done.outputs["heat.temperature.out"] != 0.0
    assert first.outputs["heat.entropy"] == pytest.approx(E_S.sum(), rel=1e-12)


def test_the_jump_comes_first_and_then_conduction():
    """The same end as a half that starts with the jump done; so not spread over the substep as E_M is."""
    mesh = scene(Box(0, 1, 0, 1, 6, 1))
    walls = [{"on": "a.right", "convection": {"h": 2.0, "T": 300.0}}]
    E_S = np.full(6, 50.0 / 6.0)
    jumped = stepped(mesh, spec(walls, T0=300.0), E_S, h=0.3)
    begun = stepped(mesh, spec(walls, T0=350.0), 0.0 * E_S, h=0.3)
    assert np.abs(jumped.outputs["T"] - begun.outputs["T"]).max() < 1e-9
    assert begun.outputs["heat.entropy"] == 0.0
    assert begun.state.anchor_S is None  # no entropy, no cost


def test_latent_heat_takes_its_share():
    """100 kJ/kg into a body at its melting point with L = 400 kJ/kg: T stays, a quarter melts."""
    mesh = scene(Box(0, 1, 0, 1, 3, 3))
    model = spec([], k=200.0, c=1000.0, rho=2700.0, T0=899.999999)
    model["materials"]["m"]["latent"] = {"L": 4e5, "T_s": 900.0, "T_l": 900.0}
    done = stepped(mesh, model, np.full(9, 2700.0 / 9.0 * 1e5))
    assert np.abs(done.outputs["T"] - 900.0).max() < 1e-5
    f_s = phase_change.solid_fraction(the_context(mesh, model).scene.melting, done.state.s)
    assert np.abs(f_s - 0.75).max() < 1e-6
    assert imbalance([done.outputs]) < EXPECTED["A16"]["tolerance"]


def test_its_factors_are_state_too():
    """Above 400 unknowns old factors serve: hot, cold and restored halves give the same bits."""
    mesh = scene(Box(0, 1, 0, 1, 24, 20))
    model = spec([{"on": "a.left", "temperature": 300.0}], c=CURVED, T0=300.0)
    E_S = 20.0 * np.sin(0.1 * np.arange(480))
    middle = stepped(mesh, model, E_S, h=0.1).state
    assert middle.anchor_S is not None
    half, link = load(mesh, model), FlatContact()
    inputs = inputs_of(mesh, half) | {"E_S": 1.1 * E_S}
    restored = from_bytes(to_bytes(middle), {"thermal_fmu"})
    ends = [h.step(state, inputs, 0.1, 0.1, link).state
            for h, state in ((half, middle), (half, restored), (load(mesh, model), middle))]
    assert len({to_bytes(state) for state in ends}) == 1
