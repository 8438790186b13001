"""Loads and surroundings in a unit that was not meant are told with the one in which they would be usual."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler.init.shipped import shipped_scenarios
from coupler.init.templates import templates
from coupler.scenario import load_scenario

SI = {"units": "{temperature: degC}", "E": "2.0e11", "rho": 7850, "c": 460, "k": 45, "length": 0.1,
      "flux": 1e4, "h": 50, "T_e": 20, "sky": 20, "Q_T": 0, "p": 1e6, "t_x": 0, "g": -9.81, "T0": 20}
MM = {"units": "{temperature: degC, length: mm, stress: MPa}", "E": 2e5, "rho": 7.85e-9, "c": 4.6e8, "k": 45,
      "length": 100, "flux": 10, "h": 0.05, "T_e": 20, "sky": 20, "Q_T": 0, "p": 1, "t_x": 0, "g": -9810, "T0": 20}
SCENE = """
slideline: 2
title: a bar
units: {units}
geometry: plane
materials:
  steel: {{E: {E}, nu: 0.3, rho: {rho}, c: {c}, k: {k}, alpha: 1.2e-5, T_ref: {T0}}}
bodies:
  bar:
    {{material: steel, T0: {T0}, Q_T: {Q_T},
     mesh: {{rectangle: {{origin: [0, 0], size: [{length}, {length}], cells: [2, 1]}}}}}}
thermal:
  boundary:
    - {{on: bar.left, flux: {flux}}}
    - {{on: bar.right, convection: {{h: {h}, T: {T_e}}}}}
    - {{on: bar.top, radiation: {{emissivity: 0.8, T: {sky}}}}}
mechanical:
  half: elastic
  elastic:
    gravity: {{y: {g}}}
    boundary: [{{on: bar.bottom, u_x: 0, u_y: 0}}, {{on: bar.top, pressure: {p}}}, {{on: bar.right, t_x: {t_x}}}]
coupling: {{end: 10}}
"""
KELVIN = {"units": "{temperature: K}", "T0": 293.15, "T_e": 293.15, "sky": 293.15}


def notes_of(folder: Path, base: dict[str, object], wrong: dict[str, object]) -> tuple[str, ...]:
    path = folder / "bar.yaml"
    path.write_text(SCENE.format(**{**base, **wrong}))
    return load_scenario(path).notes


@pytest.mark.parametrize("base", [SI, MM, {**SI, **KELVIN}], ids=["SI", "mm, MPa", "K"])
def test_what_is_usual_is_not_told(tmp_path: Path, base: dict[str, object]) -> None:
    assert notes_of(tmp_path, base, {}) == ()


TABLE = "{t: [0, 10], value: [0, 1.0e6]}"
PLACE = "{terms: [{t: 5, x: {at: [0, 100], value: [0, 10]}}]}"


@pytest.mark.parametrize(("wrong", "told"), [
    ({"h": 50}, "convection.h of bar.right is 50 mW/mm2K, which is 5e+04 W/m2K: is 50 W/m2K meant?"),
    ({"h": 50}, "Plain numbers are in mm, MPa and s; a number may have its unit"),
    ({"h": PLACE}, "is 50 mW/mm2K"),
    ({"h": "50 W/m2K"}, ""),
    ({"flux": -2e7}, "flux of bar.left is 2e+07 mW/mm2, which is 2e+10 W/m2: is 2e+07 W/m2 meant?"),
    ({"Q_T": 1e6}, "Q_T of bar is 1e+06 mW/mm3, which is 1e+12 W/m3: is 1e+06 W/m3 meant?"),
    ({"p": 1e6}, "pressure of bar.top is 1e+06 MPa, which is 1e+12 Pa: is 1e+06 Pa meant?"),
    ({"p": TABLE}, "pressure of bar.top is 1e+06 MPa"),
    ({"t_x": -1e6}, "t_x of bar.right is 1e+06 MPa"),
    ({"g": -9.81}, "gravity.y is 9.81 mm/s2, 0.00981 m/s2: are 9.81 m/s2 meant?"),
])
def test_si_in_a_file_in_mm_is_told(tmp_path: Path, wrong: dict[str, object], told: str) -> None:
    found = notes_of(tmp_path, MM, wrong)
    assert any(told in note for note in found) if told else found == ()
    assert len(found) == bool(told)


def test_a_film_in_W_per_mm2_is_told(tmp_path: Path) -> None:
    told = "convection.h of bar.right is 0.0005 W/m2K, which lets next to no heat through: is 0.0005 W/mm2K, 500 W/m2K"
    assert [note.startswith(told) for note in notes_of(tmp_path, SI, {"h": "5.0e-4"})] == [True]
    for h in (0, 0.01, 0.5):  # nothing, vacuum, a wall that is insulated
        assert notes_of(tmp_path, SI, {"h": h}) == ()


def test_gravity_as_authors_round_it(tmp_path: Path) -> None:
    for g in ("-9.8", "9.80665"):
        assert any("m/s2 meant?" in note for note in notes_of(tmp_path, MM, {"g": g}))
    assert any("gravity.y is 9810 m/s2: are mm/s2 meant?" in note for note in notes_of(tmp_path, SI, {"g": -9810}))
    assert notes_of(tmp_path, SI, {"g": -5000}) == ()  # a centrifuge


@pytest.mark.parametrize(("base", "wrong", "told"), [
    (SI, {"T_e": 293}, "convection.T of bar.right is 293 degC, 273 K from where any body starts: are 293 K meant?"),
    (SI, {"sky": 298.15}, "radiation.T of bar.top is 298.15 degC"),
    (SI, {"T_e": 293, "T0": 300}, ""),
    (SI, {"T_e": 800}, ""),
    ({**SI, **KELVIN}, {"sky": 20},
     "radiation.T of bar.top is 20 K, 273 K from where any body starts: are 20 degC meant?"),
    ({**SI, **KELVIN}, {"sky": 3}, ""),  # space
])
def test_surroundings_in_the_other_unit_are_told(tmp_path: Path, base: dict[str, object], wrong: dict[str, object],
                                                 told: str) -> None:
    found = [note for note in notes_of(tmp_path, base, wrong) if note.startswith(("convection", "radiation"))]
    assert any(told in note for note in found) if told else found == []
    assert len(found) == bool(told)


OWN = [*shipped_scenarios().glob("*.yaml"), *(template.document.path for template in templates().values())]


@pytest.mark.few("sliding_blocks", "sealed_container_fire", "superplastic_bulge")
@pytest.mark.parametrize("path", OWN, ids=lambda path: path.stem)
def test_our_own_scenes_are_usual(path: Path) -> None:
    assert not [note for note in load_scenario(path).notes if "meant?" in note]


@pytest.mark.parametrize(("wrong", "told"), [
    ({"T0": 1e70}, ["bar starts at 1e+70 degC: no solid and no melt is as hot"]),
    ({"T0": 6000}, ["bar starts at 6000 degC: no solid and no melt is as hot"]), ({"T0": 5500}, []),
])
def test_what_is_hotter_than_any_melt_is_told(tmp_path: Path, wrong: dict[str, object], told: list[str]) -> None:
    assert [note for note in notes_of(tmp_path, SI, wrong) if "as hot" in note] == told


def test_a_prescribed_temperature_hotter_than_any_melt_is_told(tmp_path: Path) -> None:
    held = SCENE.replace("flux: {flux}", "temperature: {flux}")
    (tmp_path / "bar.yaml").write_text(held.format(**{**SI, "flux": "{t: [0, 1], value: [20, 1.0e5]}"}))
    assert "temperature of bar.left is 100000 degC: no solid and no melt is as hot" in load_scenario(
        tmp_path / "bar.yaml").notes
