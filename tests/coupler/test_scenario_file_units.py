"""Units of a whole file: numbers written in mm, MPa are the same scenario as in SI; what they leave open is refused."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import jsonschema
import pytest
from typer.testing import CliRunner

from contact.problem.units import unit_from
from coupler.cli.cli import app
from coupler.errors import ScenarioError
from coupler.report.scene import scene_figure
from coupler.scenario.document import document_from
from coupler.scenario.load import scenario_from
from coupler.scenario.unit_system import system_of
from coupler.scenario.versions import json_schema

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text

# By hand: t, mm, s, N, MPa, mJ, mW.
IN_MM = {
    "size: [2, 1], cells: [4, 2]": "size: [2000, 1000], cells: [4, 2]",
    "origin: [0, 1], size: [2, 1]": "origin: [0, 1000], size: [2000, 1000]",
    "rho: 8000, c: 500, k: 30, E: 2.0e11": "rho: 8.0e-9, c: 5.0e8, k: 30, E: 2.0e5",
    "gap_max: 0.1": "gap_max: 100",
    "h: 2000}": "h: 2}",
    "g_m: 25.0e-6": "g_m: 0.025",
    "flux: 1000": "flux: 1",
    "h: 40, T: 200, gap: {d_cut: 1.0e-3, d_full: 6.0e-3": "h: 0.04, T: 200, gap: {d_cut: 1, d_full: 6",
    "[0, 0, -1.0e-4, -2.0e-4]": "[0, 0, -0.1, -0.2]",
    "face: 1.0e6": "face: 1",
}
UNITS = {"mapping": "units: {temperature: degC, length: mm, stress: MPa}", "text": "units: mm, MPa, degC",
         "force": "units: {temperature: degC, length: mm, force: N}", "mass": "units: mm, t, s, degC"}
SI = "units: {temperature: degC}"
# Less common units, each once.
MORE = (GOOD.replace("T_ref: 20}", "T_ref: 20, creep: {A: 2.0e-30, n: 5, Q: 2.0e5}}")
        .replace("k: 30", "k: {polynomial: [30, 0.01]}")
        .replace("    T0: 100", "    T0: 100\n    Q_T: {terms: [{t: 5.0e5, x: {polynomial: [1, 0.5, 0.25]}},"
                                " {t: 3.0e5, y: {at: [0, 2], value: [0, 1]}}]}")
        .replace("    conduction:", "    penalty: 3.0e12\n    conduction:"))
MORE_IN_MM = {"A: 2.0e-30": "A: 2.0", "Q: 2.0e5": "Q: 2.0e8", "penalty: 3.0e12": "penalty: 3.0e3",
              "t: 5.0e5, x: {polynomial: [1, 0.5, 0.25]}": "t: 0.5, x: {polynomial: [1, 0.5e-3, 0.25e-6]}",
              "t: 3.0e5, y: {at: [0, 2]": "t: 0.3, y: {at: [0, 2000]"}


def in_mm(text: str = GOOD, units: str = "mapping", **more: str) -> str:
    for old, new in {**IN_MM, **(MORE_IN_MM if "penalty" in text else {}), SI: UNITS[units], **more}.items():
        old = old.replace("k: 30", "k: {polynomial: [30, 0.01]}") if "penalty" in text else old
        new = new.replace("k: 30", "k: {polynomial: [30, 0.01]}") if "penalty" in text else new
        assert text.count(old) >= 1, old
        text = text.replace(old, new)
    return text


def error_of(folder: Path, text: str, overrides: dict[str, object] | None = None) -> ScenarioError:
    with pytest.raises(ScenarioError) as found:
        load_text(folder, text, overrides)
    return found.value


@pytest.mark.parametrize("units", UNITS)
def test_a_file_in_mm_is_the_file_in_si(units: str, tmp_path: Path) -> None:
    """To the last bit: each number is rounded once."""
    si, mm = load_text(tmp_path, GOOD), load_text(tmp_path, in_mm(units=units))
    assert mm.resolved == {**si.resolved, "signals": {**si.resolved["signals"]}}
    assert mm.models == si.models
    assert mm.hash == si.hash
    assert (mm.interface.nodes == si.interface.nodes).all()


def test_units_with_powers_and_coefficients(tmp_path: Path) -> None:
    """A: 1/(MPa^5 s) is 1e-30 of SI; the coefficients of a profile are per mm and per mm2."""
    si, mm = load_text(tmp_path, MORE), load_text(tmp_path, in_mm(MORE))
    assert mm.models == si.models
    assert mm.hash == si.hash


def test_a_force_is_that_of_a_slice(tmp_path: Path) -> None:
    """1 N on each mm of depth is 1000 N on a metre; about an axis it is the force of the whole turn."""
    force = "      - {at: upper.top.left, u_x: 0}\n      - {at: upper.top.right, f_x: 5}\n"
    plane = GOOD.replace("      - {at: upper.top.left, u_x: 0}\n", force)

    def f_x(text: str) -> float:
        boundary = load_text(tmp_path, text).models["mechanical"]["boundary"]
        return float(next(entry["f_x"] for entry in boundary if entry.get("f_x") is not None))

    assert (f_x(plane), f_x(in_mm(plane)), f_x(in_mm(plane).replace("f_x: 5", "f_x: 5 N"))) == (5.0, 5000.0, 5.0)
    assert f_x(in_mm(plane).replace("geometry: plane", "geometry: axisymmetric")) == 5.0
    error = error_of(tmp_path, in_mm(plane).replace("end: 40", "end: -40").replace("f_x: 5", "f_x: 1.0e999"))
    assert {e.key for e in (error, *error.others)} >= {"coupling.end"}


def test_other_lengths_and_masses() -> None:
    """Consistent units as analysts know them: m-kg-s, mm-t-s, mm-kg-s (kPa), cm-g-s (0.1 Pa)."""
    known = {("m", "mass", "kg"): ("Pa", "N", "J"), ("mm", "mass", "t"): ("MPa", "N", "mJ"),
             ("mm", "mass", "kg"): ("kPa", "(0.001 N)", "(1e-06 J)"), ("m", "stress", "MPa"): ("MPa", "MN", "MJ")}
    for (length, what, symbol), names in known.items():
        system = system_of({"length": length, what: symbol})
        assert system is not None
        assert tuple(system.name(unit_from(si).powers) for si in ("Pa", "N", "J")) == names
    system = system_of({"length": "mm", "stress": "MPa"})
    assert system is not None
    assert system.name(unit_from("J/kgK").powers) == "mJ/tK"
    assert float(system.factor(unit_from("kg/m3").powers)) == 1e12


WRONG_UNITS = {
    "length alone": ("{temperature: degC, length: mm}", "units.length", "leaves open what stresses"),
    "stress alone": ("{temperature: degC, stress: MPa}", "units.stress", "leaves open what lengths"),
    "two of mass": ("{temperature: degC, length: mm, stress: MPa, force: N}", "units.force", "both fix the unit"),
    "two of length": ("mm, cm, MPa, degC", "units", "two units of length"),
    "no temperature": ("mm, MPa", "units", "no unit of temperature"),
    "an unknown one": ("mm, Mpa, degC", "units", "Did you mean 'MPa'"),
    "an unknown length": ("{temperature: degC, length: furlong, stress: MPa}", "units.length", "not known here"),
}


@pytest.mark.parametrize("case", WRONG_UNITS)
def test_units_that_leave_something_open_are_refused(case: str, tmp_path: Path) -> None:
    units, key, words = WRONG_UNITS[case]
    error = error_of(tmp_path, GOOD.replace(SI, f"units: {units}"))
    assert error.key == key
    assert error.line == 3
    assert words in f"{error.message} {error.remedy}"


RULE = "probes:\n"
OPEN = {
    "a bound of a rule": (RULE, "rules:\n  - {name: hot, when: {max_p: {above: 100}}, do: [{stop: hot}]}\nprobes:\n",
                          "rules.0.when.max_p.above", "the unit of its monitor"),
    "a value of a grid": (RULE, "study: {grid: {contact.face.gap_max: [10, 20]}}\nprobes:\n",
                          "study.grid.contact.face.gap_max.0", "put in place of those of the file"),
    "a signal of two kinds": ("flux: 1,", "flux: push,", "signals.push.value.2", "is used as"),
}


@pytest.mark.parametrize("case", OPEN)
def test_what_the_units_leave_open_is_refused(case: str, tmp_path: Path) -> None:
    old, new, key, words = OPEN[case]
    error = error_of(tmp_path, in_mm().replace(old, new))
    found = {e.key: e for e in (error, *error.others)}
    assert key in found
    assert words in found[key].message
    assert found[key].remedy
    if "rules" in new:  # in SI the same is a rule
        assert all(e.key != key for e in _errors(tmp_path, GOOD.replace(old, new)))


def _errors(folder: Path, text: str) -> tuple[ScenarioError, ...]:
    try:
        load_text(folder, text)
    except ScenarioError as exc:
        return exc, *exc.others
    return ()


def test_a_wrong_number_is_told_as_it_stands(tmp_path: Path) -> None:
    error = error_of(tmp_path, in_mm().replace("gap_max: 100", "gap_max: -100"))
    assert (error.key, error.value) == ("contact.face.gap_max", "-100 mm")
    both = error_of(tmp_path, in_mm().replace("gap_max: 100", "gap_max: -100").replace("E: 2.0e5", "E: -1"))
    assert {e.key for e in (both, *both.others)} == {"contact.face.gap_max", "materials.steel.E"}


def test_overrides_are_in_si(tmp_path: Path) -> None:
    """Studies, advice and companions compute them from SI; on the command line a unit says the rest."""
    mm = in_mm()
    assert load_text(tmp_path, mm, {"contact.face.gap_max": 0.2}).hash == load_text(
        tmp_path, GOOD, {"contact.face.gap_max": 0.2}).hash
    assert load_text(tmp_path, mm, {"contact.face.gap_max": "200 mm"}).interface.pairs[0].gap_max == 0.2
    for key, value in (("units.length", "cm"), ("units.temperature", "K"), ("units", "mm, MPa, K")):
        assert "those of its own numbers" in error_of(tmp_path, mm, {key: value}).message
    assert load_text(tmp_path, GOOD, {"units.temperature": "K"}).temperature_unit == "K"
    in_si = {"units.length": "mm", "units.stress": "MPa"}
    assert "those of its own numbers" in error_of(tmp_path, GOOD, in_si).message
    whole = load_text(tmp_path, GOOD).resolved
    assert load_text(tmp_path, GOOD, {"units": whole["units"]}).hash == load_text(tmp_path, GOOD).hash


def test_what_is_written_again_is_the_same(tmp_path: Path) -> None:
    """A scenario's text and overrides, as run.h5 keeps them, make it anew."""
    mm = load_text(tmp_path, in_mm(), {"contact.face.gap_max": 0.2})
    assert scenario_from(mm.text, mm.file, mm.overrides).hash == mm.hash


# One cell of 2000 x 1000 with its upper and lower side.
MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "bottom"
1 2 "top"
2 3 "all"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 2000 0 0
3 2000 1000 0
4 0 1000 0
$EndNodes
$Elements
3
1 1 2 1 1 1 2
2 1 2 2 2 3 4
3 3 2 3 3 1 2 3 4
$EndElements
"""


def test_a_mesh_file_is_in_the_unit_of_the_file(tmp_path: Path) -> None:
    """Its coordinates are plain numbers too; a `unit` of its own holds."""
    (tmp_path / "m.msh").write_text(MESH, encoding="utf-8")
    rectangle = "rectangle: {origin: [0, 0], size: [2000, 1000], cells: [4, 2]}"
    text = in_mm().replace("{T: lower.top.left}", "{T: {at: [0, 1000], body: lower}}")
    for unit, size in (("", 2.0), (", unit: mm", 2.0), (", unit: m", 2000.0)):
        made = text.replace(rectangle, f"file: {{path: m.msh{unit}}}")
        assert load_text(tmp_path, made).interface.nodes[:4, 0].max() == size
    si = GOOD.replace("rectangle: {origin: [0, 0], size: [2, 1], cells: [4, 2]}", "file: {path: m.msh, unit: mm}")
    assert load_text(tmp_path, si.replace("{T: lower.top.left}", "{T: {at: [0, 1], body: lower}}")).models == load_text(
        tmp_path, text.replace(rectangle, "file: {path: m.msh}")).models


def test_check_and_show_tell_the_units(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(in_mm(), encoding="utf-8")
    said = CliRunner().invoke(app, ["check", str(path)])
    assert said.exit_code == 0, said.output
    assert "plain numbers are in mm, MPa and s, so mass t, force N, energy mJ, power mW, density t/mm3" in said.output
    assert json.loads(CliRunner().invoke(app, ["check", "--json", str(path)]).output)["units"] == "mm, MPa"
    words = " ".join(text.get_text() for text in scene_figure(load_text(tmp_path, in_mm())).texts)
    assert "the file is in mm, MPa; all numbers here are SI" in words
    path.write_text(GOOD, encoding="utf-8")
    assert "plain numbers" not in CliRunner().invoke(app, ["check", str(path)]).output


def test_a_number_in_si_is_told(tmp_path: Path) -> None:
    notes = " ".join(load_text(tmp_path, in_mm().replace("rho: 8.0e-9", "rho: 8000")).notes)
    assert "rho is 8000 t/mm3 (in kg/m3 it would be usual)" in notes
    assert "Plain numbers are in mm, MPa and s" in notes
    assert "engineering material" not in " ".join(load_text(tmp_path, in_mm()).notes)


def test_the_json_schema_takes_units_of_a_file(tmp_path: Path) -> None:
    schema = jsonschema.Draft202012Validator(json_schema())
    for units in UNITS:
        assert schema.is_valid(document_from(tmp_path / "s.yaml", in_mm(units=units)).tree)
    assert not schema.is_valid(document_from(
        tmp_path / "s.yaml", GOOD.replace(SI, "units: {temperature: degC, length: furlong, stress: MPa}")).tree)
