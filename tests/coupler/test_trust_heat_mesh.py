"""Cells too large for heat: what the thermal half tells of its mesh ends in the trust table, and in exit code 4."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mesh_scenes import DIVIDED, trust_whole_and_divided
from untrusted_runs import trust_both_ways

from coupler import load_scenario, run
from coupler.fmu.launch import launch
from coupler.running.resume import resume
from coupler.trust.checks import TrustVerdict
from coupler.trust.in_space import heat_mesh
from coupler.trust.laws.temperatures import TemperatureLog

WALL = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  steel: {{rho: 7800, c: 500, k: 45, alpha: 0}}
bodies:
  wall: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.1, 0.02], cells: {cells}}}}}, material: steel, T0: 300}}
thermal:
  half: thermal
  boundary: [{{on: wall.left, {how}}}]
mechanical: {{half: rigid, rigid: {{motion: {{wall: {{}}}}}}}}
coupling: {{scheme: staggered, end: {end}, windows: [{{until: {end}, size: {size}}}]}}
output: {{checkpoint: 0}}
"""
SHOCK, FILM = "temperature: 800", "convection: {h: 40, T: 800}"


def scene(folder, cells="[10, 2]", how=SHOCK, end=2, size=1):
    file = folder / "wall.yaml"
    file.write_text(WALL.format(cells=cells, how=how, end=end, size=size))
    return file


def check_of(rows):
    return next((c for c in rows if c.name == heat_mesh.NAME), None)


@pytest.mark.few(
    "[10, 2]-temperature: 800-2-1-broken", "[100, 2]-temperature: 800-2-0.1-holds",
    "[10, 2]-temperature: 800-60-2-holds")
@pytest.mark.parametrize(("cells", "how", "end", "size", "verdict"), [
    ("[10, 2]", SHOCK, 2, 1, "broken"),  # takes in 30 % too much
    ("[10, 2]", SHOCK, 8, 1, "noted"),  # 8 %
    ("[10, 2]", SHOCK, 60, 2, "holds"),  # what was wrong in its first seconds is made good
    ("[100, 2]", SHOCK, 2, 0.1, "holds"),  # 1 mm
    ("[10, 2]", FILM, 60, 2, "holds")])  # Biot number of a cell below 0.01
def test_a_wall_by_its_cells(tmp_path, cells, how, end, size, verdict):
    result = run(load_scenario(scene(tmp_path, cells, how, end, size)), tmp_path / "run.h5")
    check = check_of(result.trust)
    assert check.verdict == verdict
    if verdict != "holds":
        assert check.t == end
        assert "the cells of wall are too large" in check.sentence
        assert "times as many cells" in check.sentence


@pytest.mark.slow
def test_the_command_line_ends_with_4_and_processes_tell_the_same(tmp_path):
    embedded, apart = map(check_of, trust_both_ways(scene(tmp_path), tmp_path))
    assert embedded == apart


def test_a_run_that_went_on_tells_the_same(tmp_path):
    file = scene(tmp_path, end=8)
    whole = run(load_scenario(file), tmp_path / "whole.h5")
    run(load_scenario(file), tmp_path / "part.h5", until=3.0)
    parts = resume(tmp_path / "part.h5")
    assert check_of(parts.trust) == check_of(whole.trust)


def test_it_is_an_output_of_each_body(tmp_path):
    with launch(load_scenario(scene(tmp_path)), processes=False) as halves:
        assert heat_mesh.heat_mesh_outputs(halves.thermal.blocks) == ["mesh.T_missed.wall"]
        assert halves.thermal.blocks["mesh.T_missed.wall"].unit == "K"
        assert heat_mesh.heat_mesh_outputs(halves.mechanical.blocks) == []


@pytest.mark.parametrize("more", DIVIDED)
def test_however_bodies_are_divided_it_is_told(tmp_path, more):
    one, other = map(check_of, trust_whole_and_divided(tmp_path, more))
    assert other.number == pytest.approx(one.number, rel=1e-6)
    assert other.number > 5e-4


def test_what_bodies_that_meet_miss_is_added():
    assert heat_mesh.checks(heat_mesh.HeatMeshLog(), 1.0, ()) == ()
    names = {"mesh.T_missed.a": 3.0, "mesh.T_missed.b": 4.0, "mesh.T_missed.c": 6.0}
    log = heat_mesh.watched(heat_mesh.HeatMeshLog(), names, 2.0)
    for meeting, number in (((), 0.06), ((("a", "b"),), 0.07), ((("a", "b"), ("b", "c")), 0.1),
                            ((("c", "c"), ("a", "elsewhere")), 0.06)):
        (check,) = heat_mesh.checks(log, 100.0, meeting)
        assert check.number == pytest.approx(number)
        assert (check.verdict, check.t) == ("noted", 2.0)
    assert "b and c" not in check.sentence
    assert heat_mesh.watched(log, {}, 3.0) == log
    (rest,) = heat_mesh.checks(heat_mesh.watched(log, dict.fromkeys(names, 0.0), 1.0), 0.0, ())
    assert (rest.number, rest.verdict) == (0.0, "holds")
    (check,) = heat_mesh.checks(heat_mesh.watched(log, {"mesh.T_missed.a": 45.0}, 1.0), 100.0, ())
    assert (check.verdict, "3 times as many cells" in check.remedy) == ("broken", True)


@pytest.mark.parametrize(("warmer", "missed", "verdict"), [
    (1e-9, 1e-9, "holds"),  # a block at rest on a slope, warmed by the last of its friction
    (2e-3, 1e-3, "broken"),
    (2e-5, 1e-5, "broken")])
def test_bodies_that_hardly_warm_are_not_held_against_their_own_warmth(warmer, missed, verdict):
    log = heat_mesh.watched(heat_mesh.HeatMeshLog(), {"mesh.T_missed.a": missed}, 1.0)
    (check,) = heat_mesh.checks(log, TemperatureLog(300.0, 300.0, least=300.0, most=300.0 + warmer).span, ())
    assert check.verdict == verdict


@pytest.mark.parametrize(("log", "span"), [
    (TemperatureLog(0.0, 800.0, sky=(0.0, 0.0), least=700.0, most=800.0), 200.0),  # into space, as a film to 600 K
    (TemperatureLog(0.0, 800.0, sky=(0.0, 0.0), least=300.0, most=800.0), 500.0),  # from end to end
    (TemperatureLog(0.0, 800.0, cold=300.0, hot=300.0, sky=(0.0, 0.0), least=700.0, most=800.0), 500.0),  # and air
    (TemperatureLog(299.0, 300.0, sky=(299.0, 299.0), least=300.0, most=300.0), 0.995),
    (TemperatureLog(300.0, 1200.0, sky=(1200.0, 1200.0), least=300.0, most=400.0), 900.0),  # warmed by a fire
])
def test_what_drives_heat_that_is_radiated(log, span):
    assert log.heat_span == pytest.approx(span, rel=1e-3)


FIN = """
slideline: 2
units: {temperature: K}
geometry: plane
materials: {aluminium: {rho: 2700, c: 900, k: 200}}
bodies:
  fin: {mesh: {rectangle: {origin: [0, 0], size: [0.3, 0.002], cells: [10, 1]}}, material: aluminium, T0: 500}
thermal:
  method: steady
  boundary:
    - {on: fin.left, name: root, temperature: 673.15}
    - {on: fin.top, radiation: {emissivity: 0.9, T: 0}}
    - {on: fin.bottom, radiation: {emissivity: 0.9, T: 0}}
mechanical: {half: rigid}
coupling: {end: 1}
probes: {root: {heat.root: value}}
"""


def test_of_a_fin_that_radiates_into_space(tmp_path):
    """Its heat is 3 % off (1469.86 W, fine solution along it): held against all of 673 K, 1 % would be told."""
    (tmp_path / "fin.yaml").write_text(FIN)
    result = run(load_scenario(tmp_path / "fin.yaml"), tmp_path / "run.h5")
    t, heat = result.probe("root")
    true = float((heat[-1] - heat[-2]) / (t[-1] - t[-2])) / 1469.86 - 1.0
    assert true == pytest.approx(0.03, abs=0.003)
    assert 0.6 * true < check_of(result.trust).number < 1.2 * true


def test_cells_that_miss_less_than_windows_may_err_by_are_noted_only() -> None:
    """A block that slides for a second warms by 1.5 mK: exit 4 for heat that was right to 1 %."""
    log = heat_mesh.watched(heat_mesh.HeatMeshLog(), {"mesh.T_missed.a": 1.4e-3}, 1.0)
    for slight, verdict in ((0.0, TrustVerdict.BROKEN), (1e-3, TrustVerdict.BROKEN), (8e-3, TrustVerdict.NOTED)):
        (check,) = heat_mesh.checks(log, 1.5e-3, (), slight)
        assert check.verdict is verdict
        assert "0.0014 K" in check.what
