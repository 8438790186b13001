"""The heat balance of a run closes to 1e-10 of the heat moved, whatever the conductance and the level of T."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from thermal_scenes import Box, run, scene, spec

from contact.half.interface import Pair


@pytest.mark.few("1000.0-100000000.0")
@pytest.mark.parametrize("h", [1e2, 1e5, 1e8])
@pytest.mark.parametrize("level", [0.0, 1000.0])
def test_contact_that_conducts_much_loses_nothing(level: float, h: float) -> None:
    """A coat of 1 nm between two bodies that a kelvin drives: steps near the steady state were taken as they were
    guessed, and each left 16 roundings of the largest entry."""
    mesh = scene(Box(0, 1, 0, 1, 8, 4), Box(0, 1, -1, 0, 11, 4),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),))
    boundary = [{"on": "a.top", "temperature": level + 1.0}, {"on": "b.bottom", "temperature": level}]
    model = spec(boundary, T0=level, pairs={"p": {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": level}
    ran = run(mesh, model, 0.5, 60, t_N=np.full(len(mesh.contact_nodes), -1e6))
    assert ran.imbalance() < 1e-10


@pytest.mark.few("midpoint")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
def test_a17_far_above_zero_loses_nothing(method: str) -> None:
    """A17 at 273.15 K: round-off of T is a 1e-10 of a step's heat, and 4e-10 of a run's was left of what lay below it.
    """
    law = {"polynomial": [1.0, 0.5], "T_ref": 273.15}
    for dt, n in ((0.01, 100), (1e-3, 200)):
        ran = run(scene(Box(0, 2, 0, 1, 40)), spec([{"on": "a.left", "flux": 1.0}], k=law, c=law, T0=273.15,
                                                   method=method), dt, n)
        assert ran.imbalance() < 2e-11


@pytest.mark.few("1.0-1000.0")
@pytest.mark.parametrize("T", [300.0, 1000.0])
@pytest.mark.parametrize("dt", [1.0, 1e4])
def test_near_and_far_radiation_loses_nothing(dt: float, T: float) -> None:
    mesh = scene(Box(0, 1, 0.01, 1.01, 8, 4), Box(0, 1, -1, 0, 11, 4),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),))
    laws = {"conduction": {"closed": None, "open": {"law": "gas", "k_g": 0.05, "g_m": 0}},
            "radiation": {"emissivity_slave": 0.5, "emissivity_master": 0.9}}
    boundary = [{"on": "a.top", "radiation": {"emissivity": 0.8, "T": T}},
                {"on": "b.bottom", "radiation": {"emissivity": 0.5, "T": 290.0}}]
    model = spec(boundary, k=1.0, rho=1000.0, c=500.0, T0=T + 0.5, pairs={"p": laws})
    model["bodies"]["b"] = {"material": "m", "T0": 299.0}
    assert run(mesh, model, dt, 60).imbalance() < 2e-11


def test_bodies_of_one_temperature_exchange_exactly_nothing() -> None:
    """Differences are taken before shape functions: else round-off of T times h A is a flow, and asks for a solve."""
    mesh = scene(Box(0, 1, 0, 1, 8, 4), Box(0, 1, -1, 0, 11, 4),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),))
    model = spec([], T0=1000.0 / 3.0, pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 1e8},
                                                                  "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 1000.0 / 3.0}
    ran = run(mesh, model, 0.5, 3, t_N=np.full(len(mesh.contact_nodes), -1e6))
    assert np.ptp(ran.T) == 0.0
    assert ran.outputs[-1]["iterations"] == 0.0


@pytest.mark.parametrize(("n", "h"), [(4, 1e8), (4, 1e17), (16, 1e10), (16, 1e12), (16, 1e17)])
def test_heat_that_is_little_beside_round_off_of_a_contact_is_not_lost(n: int, h: float) -> None:
    """What warms two bodies as a whole does not see how well they conduct to each other: round-off of h A T is the
    heat of the whole step where h is 1e15, as it is under a pressure law far beyond its data."""
    mesh = scene(Box(0, 1, 0, 1, n, n), Box(0, 1, -1, 0, n, n),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),))
    model = spec([{"on": "a.top", "flux": 100.0}], T0=1000.0,
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 1000.0}
    ran = run(mesh, model, 0.5, 8, t_N=np.full(len(mesh.contact_nodes), -1e6))
    assert ran.outputs[-1]["heat_stored"] == pytest.approx(100.0 * 0.5 * 8, rel=1e-11)
    assert min(o["iterations"] for o in ran.outputs) >= 1
    assert max(o["iterations"] for o in ran.outputs[1:]) <= 4


@pytest.mark.parametrize("dt", [1e2, 1e5, 1e7])
def test_slow_heat_in_long_steps_is_stored(dt: float) -> None:
    """A microkelvin a step: less than round-off of what the cells could conduct in a step, and lost before."""
    mesh = scene(Box(0, 1, 0, 1, 8, 4))
    start, rise = 1000.0 / 3.0, 1e-6
    ran = run(mesh, spec([{"on": "a.top", "flux": rise / dt}], T0=start), dt, 40)
    assert ran.outputs[-1]["heat_stored"] == pytest.approx(40 * rise, rel=1e-6)  # one rounding of T is 6e-8 of a rise
    assert ran.imbalance() < 1e-7
