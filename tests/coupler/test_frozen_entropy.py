"""The scheme `adiabatic` in a file whose mechanics cannot hold their entropy: an error with its line, before any build.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from coupler import ScenarioError, load_scenario, run
from coupler.scenario.options import Scheme

pytestmark = pytest.mark.usefixtures("unlooked")

SCENE = """\
slideline: 2
units: {temperature: K}
geometry: plane
materials:
  m: {rho: 8000, c: 500, k: 20, alpha: 1.0e-5, T_ref: 300, E: 2.0e11, nu: 0.3}
bodies:
  b: {mesh: {rectangle: {origin: [0, 0], size: [1, 1], cells: [2, 2]}}, material: m, T0: 300}
thermal: {half: thermal}
mechanical:
  half: elastic
  elastic: {adiabatic: true, boundary: [{on: b.left, u_x: 0}, {at: b.left.centre, u_y: 0}]}
coupling:
  scheme: adiabatic
  end: 4
  windows: [{until: 4, size: 1}]
"""
RULE = """\
rules:
  - {name: freeze, when: {max_T: {above: 301}}, do: [{scheme: adiabatic}]}
"""


def file_of(folder: Path, *changes: tuple[str, str]) -> Path:
    text = SCENE
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def error_of(path: Path) -> ScenarioError:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    return caught.value


def test_what_can_hold_its_entropy_is_taken(tmp_path):
    assert load_scenario(file_of(tmp_path)).coupling.scheme is Scheme.ADIABATIC


def test_without_the_key_it_is_refused_with_line_key_and_remedy(tmp_path):
    path = file_of(tmp_path, ("adiabatic: true, ", ""))
    exc = error_of(path)
    assert (exc.line, exc.key) == (13, "coupling.scheme")
    assert "mechanical.elastic.adiabatic" in str(exc)
    assert "{elastic: {adiabatic: true}}" in exc.remedy
    done = subprocess.run([sys.executable, "-m", "coupler.cli", "check", str(path)], capture_output=True, text=True,
                          timeout=300, check=False)
    assert done.returncode == 2, done.stdout
    assert f"{path}:13: coupling.scheme" in done.stderr


def test_a_rule_may_not_choose_it_either(tmp_path):
    path = file_of(tmp_path, ("adiabatic: true, ", ""), ("scheme: adiabatic", "scheme: staggered"))
    path.write_text(path.read_text() + RULE)
    exc = error_of(path)
    assert (exc.line, exc.key) == (17, "rules.0.do.0.scheme")


def test_halves_without_stress_and_substeps_in_a_window_are_refused(tmp_path):
    rigid = error_of(file_of(tmp_path, ("half: elastic", "half: rigid"), (
        "elastic: {adiabatic: true, boundary: [{on: b.left, u_x: 0}, {at: b.left.centre, u_y: 0}]}",
        "rigid: {motion: {b: {}}}")))
    assert "which the half rigid does not have" in str(rigid)
    twice = error_of(file_of(tmp_path, ("  end: 4", "  substeps: {mechanical: 2}\n  end: 4")))
    assert "2 substeps" in str(twice)


@pytest.mark.parametrize(("scheme", "more", "told"), [
    ("auto", "", True), ("staggered", "", True), ("adiabatic", "", False),
    ("auto", "thermoelastic_heat: true, ", False)])
def test_heat_of_compression_that_other_schemes_leave_out_is_told(tmp_path, scheme, more, told):
    """A block pressed by 200 MPa stayed at 300 K in place of 300.353 K, with `auto`."""
    path = file_of(tmp_path, ("scheme: adiabatic", f"scheme: {scheme}"),
                   ("{adiabatic: true, ", f"{{adiabatic: true, {more}"))
    assert bool([note for note in load_scenario(path).notes if "leave that heat out" in note]) == told


def capacities(path: Path) -> list[str]:
    return [note for note in load_scenario(path).notes if "thermoelastic_heat `c`" in note]


def test_a_heat_capacity_of_what_is_held_is_told(tmp_path):
    """9 kappa alpha^2 T/(rho c) = 9 x 166.67 GPa x 1e-10 x 300/(8000 x 500) = 1.125 %: a free body is colder by it."""
    free = ("scheme: adiabatic", "scheme: auto"), ("{adiabatic: true, ", "{thermoelastic_heat: true, ")
    note, = capacities(file_of(tmp_path, *free))
    assert "takes 1.12 % more heat" in note
    assert "write 494.4" in note
    assert not capacities(file_of(tmp_path, *free, ("alpha: 1.0e-5, T_ref: 300", "alpha: 1.0e-6, T_ref: 300")))
    assert not capacities(file_of(tmp_path))


def test_a_free_body_of_that_capacity_warms_as_the_handbook_says(tmp_path):
    """A source of 1 MW/m3 warms it by q t/(rho c_p), to what windows leave."""
    warmed = []
    for c in (500.0, 500.0 * (1.0 - 0.01125)):
        path = file_of(tmp_path, ("scheme: adiabatic", "scheme: iterated"),
                       ("{adiabatic: true, boundary: [{on: b.left, u_x: 0}, {at: b.left.centre, u_y: 0}]}",
                        "{thermoelastic_heat: true, boundary: [{on: b.left, u_x: 0}, {on: b.bottom, u_y: 0}]}"),
                       ("geometry: plane", "geometry: axisymmetric"), ("c: 500", f"c: {c}"),
                       ("material: m, T0: 300", "material: m, T0: 300, Q_T: 1.0e6"))
        path.write_text(path.read_text().replace("{on: b.left, u_x: 0}, ", ""))
        results = run(load_scenario(path), tmp_path / "run.h5")
        warmed.append(float(results.field("thermal.T")[1][-1].mean() - 300.0))
    told = 1e6 * 4.0 / (8000 * 500)
    assert warmed[0] == pytest.approx(told / 1.01125, rel=1e-4)
    assert warmed[1] == pytest.approx(told, rel=2e-4)
