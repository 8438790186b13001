"""Versions of the scenario form, its JSON Schema, all errors at once, and what a half of another package is told."""

from __future__ import annotations

import sys
from pathlib import Path

import jsonschema
import pytest
from typer.testing import CliRunner

from contact.half import ForeignMechanical, ForeignThermal, read_problem
from coupler import ScenarioError, load_scenario
from coupler.cli.cli import app
from coupler.scenario import document
from coupler.scenario.problems import problem_of
from coupler.scenario.schema import VERSION
from coupler.scenario.stated import Stated
from coupler.scenario.versions import json_schema

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, ROOT, load_text

SCENES = sorted((*(ROOT / "scenarios").glob("*.yaml"), *(ROOT / "coupler/templates").glob("*.yaml")))
TABLE = "k: {T: [0, 100, 200], value: [1, 100, 1]}"
BENT = GOOD.replace("k: 30", TABLE)
BLOCK = GOOD.replace("  steel: {rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20}", """\
  steel:
    rho: 8000  # kept
    c: {solid: 500, liquid: {T: [0, 1, 2], value: [5, 6, 7]}}
    latent: {L: 1, T_m: 1500}
    k:
      T: [0, 100, 200]
      value: [1, 100, 1]
    <<: &elastic {E: {T: [0, 10, 300], value: [2.0e11, 1.0e11, 1.0e11]}, nu: 0.3}
    alpha: 1.2e-5
    T_ref: 20""").replace("closed: {law: constant, h: 2000}",
                        "closed: {law: sum, of: [{law: table, x: [0, 1, 2], h: [1, 2, 2]}]}")


def k_of(scenario: object) -> object:
    return scenario.models["thermal"]["materials"]["steel"]["k"]


def test_tables_are_linear_and_those_of_version_1_cubic(tmp_path: Path) -> None:
    assert k_of(load_text(tmp_path, BENT))["form"] == "linear"
    old = load_text(tmp_path, BENT.replace("slideline: 2", "slideline: 1"))
    assert k_of(old)["form"] == "cubic"
    assert old.notes == ("s.yaml is of version 1 of the scenario form, so 1 table without `form` is read as cubic; "
                         "`slideline migrate s.yaml` writes version 2 with the same numbers",)
    said = BENT.replace("slideline: 2", "slideline: 1").replace("[1, 100, 1]", "[1, 100, 1], form: linear")
    assert k_of(load_text(tmp_path, said))["form"] == "linear"


@pytest.mark.parametrize("text", [BENT, BLOCK, GOOD])
def test_a_migrated_file_gives_the_same_models(text: str, tmp_path: Path) -> None:
    before = load_text(tmp_path, text.replace("slideline: 2", "slideline: 1"))
    told = CliRunner().invoke(app, ["migrate", str(tmp_path / "s.yaml")])
    assert told.exit_code == 0
    assert "version 1 -> 2" in told.output
    after = load_scenario(tmp_path / "s.yaml")
    assert after.models == before.models
    assert after.interface.surfaces_hash == before.interface.surfaces_hash
    assert after.notes == before.notes[1:]
    assert "# kept" in (tmp_path / "s.yaml").read_text() or text is not BLOCK
    assert "already" in CliRunner().invoke(app, ["migrate", str(tmp_path / "s.yaml")]).output


def test_all_errors_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("gap_max: 0.1", "gap_max: 40 s").replace("  scheme: extr", "  sheme: extr").replace(
        "T0: 100", "T0: hot").replace("law: constant, h: 2000", "law: constant, h: -2")
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, text)
    errors = (caught.value, *caught.value.others)
    assert [e.key for e in errors] == ["coupling.sheme", "bodies.upper.T0", "contact.face.gap_max",
                                       "contact.face.conduction.closed.h"]
    assert all(e.file and e.line > 1 for e in errors)
    assert [e.value for e in errors] == ["extrapolated", "hot", "40 s", -2]
    assert str(caught.value).count("\n") == 3


def test_what_keys_make_together_is_told_at_once_too(tmp_path: Path) -> None:
    """Names, temperatures, places, windows, probes: none hides another."""
    text = GOOD.replace("temperature: oven", "temperature: ovn").replace("T: 200,", "T: -300,").replace(
        "{on: upper.top, u_y", "{on: upper.tp, u_y").replace("until: 40", "until: 39").replace(
        "{T: lower.top.left}", "{T: lower.top.lft}").replace("at: [12.5]", "at: [50]")
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, text)
    assert [e.key for e in (caught.value, *caught.value.others)] == [
        "thermal.boundary.0.temperature", "thermal.boundary.2.convection.T", "mechanical.elastic.boundary.1.on",
        "coupling.windows.1.until", "probes.face.left.T", "output.fields.at.0"]


@pytest.mark.few("sliding_blocks", "aluminium_can", "casting_1d", "hot_upsetting", "brake_pad")
@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_the_json_schema_takes_our_scenes(path: Path) -> None:
    jsonschema.Draft202012Validator(json_schema()).validate(document.read_document(path).tree)


@pytest.mark.parametrize(("old", "new", "words"), [
    ("gap_max: 0.1", "gap_max: wide", "wide"), ("  scheme:", "  sheme:", "sheme"), ("rho: 8000", "rho: -1", "-1"),
    ("law: constant, h", "law: constant, g", "g"), ("{at: upper.top.left, u_x: 0}", "{at: [1, 2], u_x: 0}", "1, 2")])
def test_the_json_schema_refuses_what_is_wrong(old: str, new: str, words: str, tmp_path: Path) -> None:
    schema = jsonschema.Draft202012Validator(json_schema())
    assert schema.is_valid(document.document_from(tmp_path / "s.yaml", GOOD).tree)
    tree = document.document_from(tmp_path / "s.yaml", GOOD.replace(old, new)).tree
    assert any(words in error.message for error in schema.iter_errors(tree))


def test_the_schema_says_units_bounds_and_defaults() -> None:
    schema = json_schema()["$defs"]
    assert schema["Convection"]["properties"]["T"]["description"].endswith("[in the unit of units.temperature]")
    assert schema["ContactPair"]["properties"]["gap_max"]["description"].endswith("[m]")
    assert schema["Plastic"]["properties"]["chi"]["default"] == 0.9
    assert schema["Plastic"]["properties"]["chi"]["anyOf"][0]["maximum"] == 1.0
    assert json_schema()["properties"]["slideline"]["enum"] == list(range(1, VERSION + 1))


def test_the_command_writes_the_schema(tmp_path: Path) -> None:
    out = tmp_path / "scenario.schema.json"
    assert CliRunner().invoke(app, ["schema", "-o", str(out)]).exit_code == 0
    assert out.read_text(encoding="utf-8") == CliRunner().invoke(app, ["schema"]).output


def test_a_half_of_another_package_is_told_the_same_checked_model(tmp_path: Path) -> None:
    """Boundary, laws, penalties and signals too: what ours is told, and whole materials and pairs."""
    ours = load_text(tmp_path, GOOD)
    stated = Stated(ours.stated, ours.interface, "K", 0.0, tmp_path)
    thermal = problem_of(stated, "thermal", "mine").plain()
    assert thermal["boundary"] == ours.models["thermal"]["boundary"]
    assert thermal["pairs"]["face"]["conduction"] == ours.models["thermal"]["pairs"]["face"]["conduction"]
    assert thermal["pairs"]["face"]["penalty"] == ours.interface.pairs[0].eps_N
    assert set(thermal["materials"]["steel"]) == {"rho", "c", "k", "E", "nu", "alpha", "T_ref"}
    assert thermal["options"] == {}
    mechanical = problem_of(stated, "mechanical", "mine").plain()
    assert mechanical["boundary"] == ours.models["mechanical"]["boundary"]
    assert mechanical["rigid"]["pressure"] == {"face": 1e6}
    assert mechanical["bodies"]["upper"]["T0"] == 373.15
    assert read_problem(ForeignThermal, thermal, "mine").boundary[2].convection.T == 473.15
    assert read_problem(ForeignMechanical, mechanical, "mine").boundary[1].u_y.t == (0.0, 10.0, 10.0, 30.0)
