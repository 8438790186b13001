"""Units mistaken: numbers far from those of engineering are told, with the unit that was meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler.errors import ScenarioError
from coupler.init.shipped import shipped_scenarios
from coupler.init.templates import templates
from coupler.scenario import Scenario, load_scenario

SCENE = """
slideline: 2
title: a bar
units: {{temperature: {unit}}}
geometry: plane
materials:
  steel: {{E: {E}, nu: 0.3, rho: {rho}, c: {c}, k: {k}, alpha: {alpha}, T_ref: {T_ref}, plastic: {{s_y: {s_y}}}}}
bodies:
  bar: {{material: steel, T0: {T0}, mesh: {{rectangle: {{origin: [{at}, 0], size: [{length}, 0.01], cells: [4, 1]}}}}}}
thermal:
  boundary: [{{on: bar.left, temperature: 300}}]
mechanical:
  half: elastic
  elastic: {{boundary: [{{on: bar.bottom, u_x: 0, u_y: 0}}]}}
coupling: {{end: 10}}
"""
RIGHT = {"unit": "degC", "E": "2.0e11", "rho": 7850, "c": 460, "k": 45, "alpha": "1.2e-5", "s_y": "250.0e6",
         "length": 0.1, "at": 0, "T_ref": 20, "T0": 20}


def scene(folder: Path, **wrong: object) -> Scenario:
    path = folder / "bar.yaml"
    path.write_text(SCENE.format(**{**RIGHT, **wrong}))
    return load_scenario(path)


def test_what_is_usual_is_not_told(tmp_path: Path) -> None:
    assert scene(tmp_path).notes == ()


@pytest.mark.parametrize(("wrong", "told"), [
    ({"E": 200}, "material steel: E is 200 Pa (in GPa it would be 2e+11)"),
    ({"E": 210000}, "material steel: E is 210000 Pa (in MPa it would be 2.1e+11)"),
    ({"E": 210000, "rho": 1100}, ""),  # a gel, a foam, a rubber
    ({"E": "2.0e7"}, ""),  # a soil
    ({"k": 0.045}, "k is 0.045 W/mK (in W/mmK it would be 45)"),
    ({"k": 0.2, "E": "3.0e9"}, ""),  # a filled resin
    ({"rho": 7.85}, "rho is 7.85 kg/m3 (in g/cm3 it would be 7850)"),
    ({"rho": "7.85e-9"}, "rho is 7.85e-09 kg/m3 (in t/mm3 it would be 7850)"),
    ({"c": 0.46}, "c is 0.46 J/kgK (in kJ/kgK it would be 460)"),
    ({"c": "4.6e8"}, "c is 4.6e+08 J/kgK (in mJ/tK it would be 460)"),
    ({"alpha": 12}, "alpha is 12 1/K (in 1e-6/K it would be 1.2e-05)"),
    ({"alpha": "{T: [0, 500], value: [12, 14]}"}, "alpha is 14 1/K (in 1e-6/K it would be 1.4e-05)"),
    ({"s_y": 250}, "plastic.s_y is 250 Pa (in MPa it would be 2.5e+08)"),
    ({"s_y": "50e3"}, "plastic.s_y is 50000 Pa (in kPa it would be 5e+07)"),
    ({"s_y": "50e3", "E": "1.0e9", "k": 0.5}, ""),  # what is soft may yield so soon
    ({"s_y": "{T: [20, 1400], value: [2.5e8, 1.0e4]}"}, ""),
    ({"E": 200, "alpha": 12}, "E is 200 Pa (in GPa it would be 2e+11), alpha is 12 1/K"),
    ({"length": 100}, "body bar is 100 m long: is mm meant?"),
    ({"length": 100}, "Lengths are in metres, those of a mesh file times its `unit`"),
    ({"at": 500}, ""),
    ({"at": 1e5}, "body bar lies 1e+05 m from the origin, where coordinates are rounded to 1.5e-11 m, 1e-09 of"),
    ({"T_ref": 293}, "material steel: T_ref is 293 degC, and bodies of it start at 20 degC, with the strain of 273 K"),
    ({"T_ref": 293.15}, "is 293.15 K meant?"),
    ({"T_ref": 293, "alpha": 0}, ""),
    ({"T_ref": 293, "T0": 290}, ""),
    ({"T_ref": 600}, ""),  # a casting
    ({"T0": 293}, "body bar starts at 293 degC, with the strain of 273 K from T_ref of steel: is 293 K meant?"),
    ({"T0": 300}, ""),
    ({"unit": "K", "T0": 300}, "start at 300 K, with the strain of 280 K: is 20 degC meant?"),
    ({"unit": "K", "T0": 300, "T_ref": 700}, ""),
    ({"unit": "K"}, "body bar starts at 20 K (-253.15 degC): for degrees Celsius write units: {temperature: degC}"),
])
def test_a_unit_mistaken_is_told_with_the_one_meant(tmp_path: Path, wrong: dict[str, object], told: str) -> None:
    notes = scene(tmp_path, **wrong).notes
    assert any(told in note for note in notes) if told else notes == ()
    assert len(notes) == bool(told)


@pytest.mark.parametrize(("wrong", "error"), [
    ({"old": ", T_ref: 20", "new": ""}, "has no T_ref"),  # found last, when the scene is made
    ({"old": "geometry: plane", "new": "geometry: plain"}, "not known here"),  # found first, key by key
    ({"old": "nu: 0.3", "new": "nu: 3"}, "nu"),  # in the material itself
])
def test_a_unit_mistaken_is_told_beside_errors(tmp_path: Path, wrong: dict[str, str], error: str) -> None:
    path = tmp_path / "bar.yaml"
    path.write_text(SCENE.format(**{**RIGHT, "alpha": 12}).replace(wrong["old"], wrong["new"]))
    with pytest.raises(ScenarioError) as raised:
        load_scenario(path)
    assert error in str(raised.value)
    assert [note for note in raised.value.__notes__ if note.startswith("note: material steel: alpha is 12 1/K (in")]


OWN = [*shipped_scenarios().glob("*.yaml"), *(template.document.path for template in templates().values())]


@pytest.mark.few("sliding_blocks", "aluminium_can", "casting_1d", "hot_upsetting", "brake_pad")
@pytest.mark.parametrize("path", OWN, ids=lambda path: path.stem)
def test_our_own_scenes_are_usual(path: Path) -> None:
    told = ("no engineering material", " m long", " m from the origin", "for degrees Celsius")
    assert not [note for note in load_scenario(path).notes if any(words in note for words in told)]
