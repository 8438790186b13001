"""Cells too few for stress: what the elastic half tells of its mesh ends in the trust table, and in exit code 4."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler import load_scenario, run
from coupler.fmu.launch import launch
from coupler.trust.in_space import mesh

sys.path.insert(0, str(Path(__file__).parent))
from untrusted_runs import trust_both_ways

SCENE = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  m: {{rho: 8000, c: 500, k: 20, alpha: 0, T_ref: 300, E: 1.0e9, nu: 0.3}}
bodies:
  beam: {{mesh: {{rectangle: {{origin: [0, 0], size: [10, 1], cells: {cells}}}}}, material: m, T0: 300}}
thermal: {{half: thermal}}
mechanical:
  half: elastic
  elastic:
    state: plane_stress
    {more}
    boundary: [{{on: beam.left, u_x: 0, u_y: 0}}, {{on: beam.right, t_y: {{t: [0, 1, 2], value: [0, 1000, 0]}}}}]
coupling: {{scheme: staggered, end: 2, windows: [{{until: 2, size: 0.5}}]}}
"""


def scene(folder, cells, more=""):
    file = folder / "beam.yaml"
    file.write_text(SCENE.format(cells=cells, more=more))
    return file


def check_of(rows):
    return next((c for c in rows if c.name == mesh.NAME), None)


@pytest.mark.few("[10, 2]--broken", "[60, 6]--holds")
@pytest.mark.parametrize(("cells", "more", "verdict"), [
    ("[10, 2]", "", "broken"), ("[20, 2]", "", "noted"), ("[60, 6]", "", "holds"),
    ("[10, 2]", "element: enhanced", "holds")])
def test_a_cantilever_by_its_cells(tmp_path, cells, more, verdict):
    """29, 11, 1.5 and 0.9 % off in deflection; unloaded at the end, which makes nothing good."""
    check = check_of(run(load_scenario(scene(tmp_path, cells, more)), tmp_path / "run.h5").trust)
    assert check.verdict == verdict
    if verdict != "holds":
        assert check.t == 1.0
        assert "the mesh of beam" in check.sentence
        assert "times as many cells" in check.sentence


@pytest.mark.slow
def test_the_command_line_ends_with_4_and_processes_tell_the_same(tmp_path):
    embedded, apart = map(check_of, trust_both_ways(scene(tmp_path, "[10, 2]"), tmp_path))
    assert embedded == apart


def test_it_is_read_from_a_half_when_it_is_asked_for(tmp_path):
    scenario = load_scenario(scene(tmp_path, "[10, 2]"))
    with launch(scenario, processes=False) as halves:
        names = mesh.mesh_outputs(halves.mechanical.blocks)
        assert names == ["mesh.missed.beam", "mesh.energy.beam", "mesh.heat.beam", "mesh.uneven.beam"]
        assert all(halves.mechanical.blocks[n].unit == "J" for n in names)
        assert mesh.mesh_outputs(halves.thermal.blocks) == []


def test_the_largest_of_the_run_counts_and_bodies_without_load_do_not():
    assert mesh.checks(mesh.MeshLog()) == ()
    log = mesh.MeshLog()
    for t, missed, energy in ((1.0, 0.1, 1.0), (2.0, 1.0, 100.0), (3.0, 0.5, 0.5)):
        log = mesh.watched(log, {"mesh.missed.a": missed, "mesh.energy.a": energy, "mesh.missed.b": 1e-3 * t,
                                 "mesh.energy.b": 1e-3 * t}, t)
    (check,) = mesh.checks(log)
    assert check.number == pytest.approx(0.1)
    assert (check.verdict, check.t) == ("holds", 2.0)
    nothing = mesh.watched(mesh.MeshLog(), {"mesh.missed.a": 0.0, "mesh.energy.a": 0.0}, 1.0)
    assert mesh.checks(nothing)[0].number == 0.0
    half = mesh.watched(mesh.MeshLog(), {"mesh.missed.a": 1.0, "mesh.energy.a": 2.0}, 1.0)
    (check,) = mesh.checks(half)
    assert check.number == pytest.approx(np.sqrt(0.5))
    assert (check.verdict, "4 times as many cells" in check.remedy) == ("broken", True)


def test_a_stress_that_is_faint_beside_the_heat_is_not_held_against_the_mesh():
    """Elastic strain of less than 1e-4 of the change of the thermal strain, energies as squares."""
    rows = {}
    for J in (1e-8, 1e-3):
        log = mesh.MeshLog()
        for t, heat in ((0.0, 25.0), (1.0, 100.0), (2.0, 625.0)):
            log = mesh.watched(log, {"mesh.missed.a": J, "mesh.energy.a": J, "mesh.heat.a": heat}, t)
        assert log.heat["a"] == pytest.approx((5.0, 25.0))
        rows[J] = mesh.checks(log)[0]
    assert (rows[1e-8].number, rows[1e-8].verdict) == (0.0, "holds")
    assert rows[1e-3].verdict == "broken"
    # Heat that does not change frees no body of its mesh.
    log = mesh.watched(mesh.MeshLog(), {"mesh.missed.a": 1e-8, "mesh.energy.a": 1e-8, "mesh.heat.a": 625.0}, 1.0)
    assert mesh.checks(log)[0].verdict == "broken"


WARMS = """
slideline: 2
units: {temperature: degC}
geometry: axisymmetric
materials:
  al: {rho: 2700, c: 900, k: 200, E: 70.0e9, nu: 0.33, alpha: 2.3e-5, T_ref: 20}
bodies:
  disc: {mesh: {rectangle: {origin: [0, 0], size: [0.05, 0.01], cells: [5, 2]}}, material: al, T0: 200}
thermal:
  boundary: [{on: disc.top, convection: {h: 10, T: 20}}, {on: disc.bottom, convection: {h: 5, T: 20}}]
mechanical:
  half: elastic
  elastic:
    boundary: [{on: disc.bottom, u_y: 0}]
coupling: {end: 2000}
"""


def test_a_disc_that_cools_evenly_is_trusted(tmp_path):
    """Biot numbers of 2e-4 and less: it shrinks by 4e-3; of its kPa of stress two cells have little."""
    file = tmp_path / "disc.yaml"
    file.write_text(WARMS)
    results = run(load_scenario(file), tmp_path / "run.h5")
    assert check_of(results.trust).verdict == "holds"
    assert 0.0 < results.extremes["mechanical.sigma_v"].max() < 1e5
    assert results.broken == ()


BOWS = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  m: {{rho: 7800, c: 480, k: 45, E: 2.1e11, nu: 0.3, alpha: 1.2e-5, T_ref: 300}}
bodies:
  plate: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.1, 0.005], cells: {cells}}}}}, material: m, T0: 300}}
thermal:
  method: steady
  boundary: [{{on: plate.bottom, temperature: 300}}, {{on: plate.top, temperature: {{t: [0, 1], value: [300, 400]}}}}]
mechanical:
  half: elastic
  elastic:
    state: {state}
    boundary: [{{on: plate.left, u_x: 0}}, {{at: plate.left.bottom, u_y: 0}}]
coupling: {{end: 1, windows: [{{until: 1, size: 0.5}}]}}
probes: {{tip: {{u_y: plate.right.centre}}}}
"""


@pytest.mark.parametrize("state", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize(("cells", "verdict", "off"), [("[20, 4]", "broken", 0.2), ("[80, 4]", "noted", 0.04),
                                                       ("[160, 16]", "holds", 0.0)])
def test_a_plate_that_bows_by_heat(tmp_path, state, cells, verdict, off):
    """Free of stress in its plane: what its cells make of it is no measure, nor what holds it across the plane."""
    file = tmp_path / "plate.yaml"
    file.write_text(BOWS.format(cells=cells, state=state))
    results = run(load_scenario(file), tmp_path / "run.h5")
    exact = -1.2e-5 * 100.0 / 0.005 * 0.1**2 / 2.0 * (1.3 if state == "plane_strain" else 1.0)
    tip = float(results.probe("tip")[1][-1])
    assert off < 1.0 - tip / exact < 2.0 * off + 0.03
    assert check_of(results.trust).verdict == verdict


def test_heat_that_has_just_come_in_counts_by_its_share():
    """A tenth of the thermal strain, in energy, is there when the mesh misses most of it; a load counts in full."""
    numbers = {}
    for energy in (30.0, 50.0):
        log = mesh.MeshLog()
        for t, missed, heat in ((1.0, 10.0, 20.0), (2.0, 0.5, 200.0)):
            log = mesh.watched(log, {"mesh.missed.a": missed, "mesh.energy.a": energy, "mesh.heat.a": heat,
                                     "mesh.uneven.a": 10.0}, t)
        (check,) = mesh.checks(log)
        numbers[energy] = check.number
        assert check.t == 1.0
    assert numbers[30.0] == pytest.approx(np.sqrt(1.0 / 40.0))
    assert numbers[50.0] == pytest.approx(np.sqrt(10.0 / 60.0))
