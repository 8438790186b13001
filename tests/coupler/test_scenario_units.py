"""Values with units: the same numbers to the last bit, and what is of another kind is refused with its place."""

from __future__ import annotations

import random
import re
import sys
from pathlib import Path

import jsonschema
import pytest

from contact.problem.units import CALLED, SYMBOLS, UnitError, as_float, quantity_from, unit_from
from coupler.scenario.document import document_from
from coupler.scenario.quantities import with_plain_numbers
from coupler.scenario.versions import json_schema

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, error_of, line_of, load_text

# Pieces of the good scenario, and the same with units; every kind of place a number has.
SAME = {
    "size: [2, 1], cells: [4, 2]": "size: [2000 mm, 100 cm], cells: [4, 2]",
    "rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20}":
        "rho: 8 g/cm3, c: 0.5 kJ/(kg K), k: 30 W/(m*K), E: 200 GPa, nu: 30 %, alpha: 12e-6/K, T_ref: 20 degC}",
    "T0: 100": "T0: 100 degC",
    "gap_max: 0.1": "gap_max: 100 mm",
    "h: 2000}": "h: 2 kW/m2K}",
    "k_g: 0.05, g_m: 25.0e-6": "k_g: 50 mW/mK, g_m: 25 um",
    "flux: 1000": "flux: 1 kW/m²",
    "h: 40, T: 200, gap: {d_cut: 1.0e-3": "h: 40 W/m2/K, T: 200 °C, gap: {d_cut: 1 mm",
    "push: {t: [0, 10, 10, 30], value: [0, 0, -1.0e-4, -2.0e-4]}":
        "push: {t: [0, 10 s, 10, 0.5 min], value: [0, 0 mm, -100 um, -0.2 mm]}",
    "value: [20, 400]": "value: [20 degC, 400]",
    "face: 1.0e6": "face: 1 MPa",
    "end: 40\n  kinks: [25]": "end: 40 s\n  kinks: [25000 ms]",
    "size: 1}": "size: 1 s}",
    "at: [12.5]": "at: [12.5 s]",
    "{T: lower.top.left}": "{T: {at: [0 mm, 1 m], body: lower}}",
}


def with_units() -> str:
    text = GOOD
    for old, new in SAME.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def test_a_scenario_with_units_is_the_same_scenario(tmp_path: Path) -> None:
    plain = load_text(tmp_path, GOOD.replace("{T: lower.top.left}", "{T: {at: [0, 1], body: lower}}"))
    units = load_text(tmp_path, with_units())
    assert units.resolved == plain.resolved
    assert units.models == plain.models
    assert units.hash == plain.hash
    assert (units.interface.nodes == plain.interface.nodes).all()


def test_each_piece_alone_changes_nothing(tmp_path: Path) -> None:
    plain = load_text(tmp_path, GOOD)
    for old, new in SAME.items():
        if "probe" not in old and "T: lower" not in old:
            assert load_text(tmp_path, GOOD.replace(old, new)).hash == plain.hash, new


@pytest.mark.parametrize(("unit", "power"), [("mm", -3), ("um", -6), ("kPa", 3), ("GPa", 9), ("kW/m2", 3), ("ms", -3),
                                            ("N/mm2", 6), ("g/cm3", 3), ("1/MPa", -6), ("%", -2), ("km", 3)])
def test_a_power_of_ten_is_exact(unit: str, power: int) -> None:
    """Rounded once: as if the number had been written with its exponent."""
    of = random.Random(7)
    for _ in range(300):
        digits = f"{of.choice(['', '-'])}{of.randrange(10**of.randrange(1, 15))}.{of.randrange(10**6)}"
        quantity = quantity_from(f"{digits} {unit}")
        assert quantity is not None
        assert as_float(quantity.si()) == float(f"{digits}e{power}")


@pytest.mark.parametrize(("text", "si"), [  # NIST SP 811, appendix B, to the digits given there
    ("1 psi", 6.894757e3), ("1 ft", 3.048e-1), ("1 lbf", 4.448222), ("1 atm", 1.01325e5), ("100 degF", 310.9278),
    ("1 rpm", 0.10471976), ("1 h", 3600.0), ("1 lb", 4.535924e-1), ("180 deg", 3.14159265), ("1 W/m2°C", 1.0),
    ("9 1/°F", 16.2), ("1 ksi", 6.894757e6), ("2 t", 2000.0), ("1 kN m", 1000.0), ("1 kNm", 1000.0),
    ("2 m s^-2", 2.0), ("3 1/(MPa^2 s)", 3e-12), ("4 MPa s^0.5", 4e6), ("1 cm²", 1e-4), ("3 mPa s", 3e-3)])
def test_known_values(text: str, si: float) -> None:
    quantity = quantity_from(text)
    assert quantity is not None
    assert as_float(quantity.si()) == pytest.approx(si, rel=2e-7)


def test_temperatures_are_in_the_unit_of_the_file(tmp_path: Path) -> None:
    def T0(unit: str, text: str) -> float:
        file = f"slideline: 2\nunits: {{temperature: {unit}}}\nbodies: {{a: {{T0: {text}}}}}\n"
        return float(with_plain_numbers(document_from(tmp_path / "s.yaml", file)).tree["bodies"]["a"]["T0"])

    assert [T0("degC", "25 degC"), T0("K", "25 degC"), T0("K", "300 K")] == [25.0, 298.15, 300.0]
    assert T0("degC", "298.15 K") == 25.0
    assert T0("degC", "212 degF") == 100.0
    assert T0("K", "-40 °F") == 233.15


WRONG = {  # old text, new text, key, words of the message or its remedy
    "a length for a temperature": ("T0: 100", "T0: 20 mm", "bodies.upper.T0",
                                   "a temperature (degC, K or degF) is needed here, not a length [m]"),
    "a temperature for a length": ("gap_max: 0.1", "gap_max: 5 degC", "contact.face.gap_max",
                                   "a length [m] is needed here, not a temperature [K]"),
    "a flux for a conductance": ("h: 2000}", "h: 2 kW/m2}", "contact.face.conduction.closed.h",
                                 "a conductance [W/m2K] is needed here, not a heat flux [W/m2]"),
    "a length for a share": ("nu: 0.3", "nu: 3 mm", "materials.steel.nu", "a pure number is needed here"),
    "in a list": ("kinks: [25]", "kinks: [25, 3 mm]", "coupling.kinks.1", "a time [s] is needed here, not a length"),
    "in a table of a signal": ("t: [0, 7]", "t: [0, 7 mm]", "signals.idle.t.1", "a time [s]"),
    "a film of another exponent": ("h: 40, T", "h: 40 W/m2K, exponent: 0.25, T", "thermal.boundary.2.convection.h",
                                   "W/m2K"),
    "an unknown unit": ("gap_max: 0.1", "gap_max: 4 furlong", "contact.face.gap_max", "'furlong' is not known"),
    "a near unit": ("E: 2.0e11", "E: 200 Gpa", "materials.steel.E", "Did you mean GPa"),
    "celsius by its old letter": ("T0: 100", "T0: 100 C", "bodies.upper.T0", "'C' is not known"),
    "two readings": ("h: 2000}", "h: 2 kW/m2*K}", "contact.face.conduction.closed.h", "can be read in two ways"),
    "below absolute zero": ("T0: 100", "T0: -300 degC", "bodies.upper.T0", "below absolute zero"),
    "out of bounds": ("E: 2.0e11", "E: -200 GPa", "materials.steel.E", "must be greater than zero"),
    "a count with a unit": ("cells: [4, 2]", "cells: [4 mm, 2]", "bodies.lower.mesh.rectangle.cells.0", "number"),
    "two kinds in one signal": ("value: [0, 1]}", "value: [0 mm, 1 s]}", "signals.idle.value.1",
                                "a length [m] before, and a time [s] here"),
    "a number too large": ("T0: 100", "T0: 1e300000 K", "bodies.upper.T0", "too large"),
    "a power too large": ("T0: 100", "T0: 1 mm^999999", "bodies.upper.T0", "power above"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_of_another_kind_is_refused(case: str, tmp_path: Path) -> None:
    old, new, key, words = WRONG[case]
    error = error_of(tmp_path, old, new)
    assert error.key == key
    assert words in f"{error.message} {error.remedy}"
    assert error.line == line_of(new, GOOD.replace(old, new))
    if "," not in new and "[" not in new:
        assert repr(new.partition(": ")[2].rstrip("}")) in str(error), "as it was written"


def test_all_are_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("T0: 100", "T0: 20 mm").replace("gap_max: 0.1", "gap_max: 3 s")
    error = error_of(tmp_path, GOOD, text)
    assert {e.key for e in (error, *error.others)} == {"bodies.upper.T0", "contact.face.gap_max"}


def test_a_difference_is_in_kelvin(tmp_path: Path) -> None:
    adaptive = "  windows:\n    - {until: 10, size: 1}\n    - {until: 40, first: 1, last: 5}\n"
    made = load_text(tmp_path, GOOD.replace(
        adaptive, "  adaptive: {tolerance: {temperature: {atol: 500 K, rtol: 1 %}}}\n"))
    assert made.coupling.adaptive is not None
    tolerance = made.coupling.adaptive.tolerance.temperature
    assert (tolerance.atol, tolerance.rtol) == (500.0, 0.01)
    error = error_of(tmp_path, adaptive, "  adaptive: {tolerance: {temperature: {atol: 2 degC}}}\n")
    assert error.key == "coupling.adaptive.tolerance.temperature.atol"
    assert "a difference of temperatures [K] is needed here" in error.message
    assert "Write 2 K" in error.remedy


def test_a_signal_is_of_the_kind_of_its_key(tmp_path: Path) -> None:
    idle = ("idle: {t: [0, 7], value: [0, 1]}", "idle: {t: [0, 7], value: [0 mm, 1 mm]}")
    text = GOOD.replace(*idle)
    load_text(tmp_path, text)
    error = error_of(tmp_path, GOOD, text.replace("flux: 1000", "flux: idle"))
    assert error.key == "thermal.boundary.1.flux"
    assert "a heat flux [W/m2] is needed here, but the signal 'idle' is a length [m]" in error.message
    in_kelvin = GOOD.replace("value: [20, 400]", "value: [293.15 K, 673.15 K]")
    assert load_text(tmp_path, in_kelvin).models["thermal"] == load_text(tmp_path, GOOD).models["thermal"]


def test_units_of_powers_follow_their_exponent(tmp_path: Path) -> None:
    creep = GOOD.replace("T_ref: 20}", "T_ref: 20, creep: {A: 2e-30 1/(MPa^5 s), n: 5, Q: 200 kJ/mol}}")
    found = load_text(tmp_path, creep).models["mechanical"]["materials"]["steel"]["creep"]
    assert (found["A"], found["Q"]) == (2e-60, 200e3)
    film = GOOD.replace("h: 40, T", "h: 40 W/m2K^1.25, exponent: 0.25, T")
    assert load_text(tmp_path, film).models["thermal"]["boundary"][2]["convection"]["h"] == 40.0


def test_overrides_and_tables_take_units(tmp_path: Path) -> None:
    found = load_text(tmp_path, GOOD, {"bodies.upper.T0": "373.15 K", "contact.face.gap_max": "10cm",
                                       "materials.steel.k": {"T": ["273.15 K", 100], "value": ["30 W/mK", 40]}})
    assert found.resolved["bodies"]["upper"]["T0"] == 100.0
    assert found.resolved["contact"]["face"]["gap_max"] == 0.1
    assert found.resolved["materials"]["steel"]["k"] == {"T": [0.0, 100], "value": [30.0, 40]}


def test_the_json_schema_takes_values_with_units(tmp_path: Path) -> None:
    schema = jsonschema.Draft202012Validator(json_schema())
    assert schema.is_valid(document_from(tmp_path / "s.yaml", with_units()).tree)
    for old, new in (("T0: 100", "T0: warm"), ("T0: 100", "T0: '100'"), ("rho: 8000", "rho: -1"),
                     ("cells: [4, 2]", "cells: [4 mm, 2]")):
        assert not schema.is_valid(document_from(tmp_path / "s.yaml", GOOD.replace(old, new)).tree), new


def test_every_unit_of_a_key_is_read() -> None:
    """Each symbol has a dimension, and each SI unit of the list is its own name."""
    for name in SYMBOLS:
        assert unit_from(name).factor > 0
    for name in CALLED:
        assert unit_from(name).factor == 1, name


@pytest.mark.parametrize("text", ["m)", "(m", "((m))", "W/(m/K)", "m m2 furlong", "/", "^2", "m^", "1" * 61])
def test_what_is_no_unit_is_refused(text: str) -> None:
    with pytest.raises(UnitError):
        unit_from(text)


def test_the_page_lists_every_symbol() -> None:
    page = (Path(__file__).parents[2] / "docs/scenario.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"`([^`\n]+)`", page[page.index("## Values with units"):page.index("## Top level")]))
    same = {"µm": "um", "μm": "um", "µs": "us"}
    assert {same.get(name, name) for name in SYMBOLS} - {"1"} <= listed
