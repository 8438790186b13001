"""Units that an FMU declares: millimetres and degrees Celsius become SI at the border, what nobody knows is refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import read_interface
from coupler import load_scenario
from coupler.errors import HalfError
from coupler.fmu.bounds import wrong_blocks
from coupler.fmu.description import read_description
from coupler.fmu.fmi import load_half
from coupler.fmu.launch import build_half
from coupler.fmu.units import SI, Conversion, DeclaredUnit, conversion_of
from coupler.verify.border import conversion_findings

BARS = Path(__file__).resolve().parents[2] / "scenarios/heated_bars.yaml"
XML = """<fmiModelDescription fmiVersion="2.0" guid="g" generationTool="by hand">
<CoSimulation modelIdentifier="m"/>{units}<ModelVariables>
<ScalarVariable name="T[1]" valueReference="0" causality="output"><Real{T}/></ScalarVariable>
<ScalarVariable name="x[1,1]" valueReference="1" causality="input"><Real{x}/></ScalarVariable>
<ScalarVariable name="x[1,2]" valueReference="2" causality="input"><Real{x}/></ScalarVariable>
<ScalarVariable name="mine" valueReference="3" causality="output"><Real unit="furlong"/></ScalarVariable>
</ModelVariables></fmiModelDescription>"""


def described(folder: Path, T: str = "", x: str = "", units: str = ""):
    text = XML.format(T=T and f' unit="{T}"', x=x and f' unit="{x}"', units=units)
    (folder / "modelDescription.xml").write_text(text)
    return read_description(folder)


@pytest.mark.parametrize(("unit", "to", "how"), [
    ("K", "K", SI), ("degC", "K", Conversion(1.0, 273.15)), ("mm", "m", Conversion(1e-3)),
    ("MPa", "Pa", Conversion(1e6)), ("kJ", "J", Conversion(1e3)), ("mm", "K", None), ("furlong", "m", None)])
def test_a_unit_is_known_by_its_name(unit, to, how):
    assert conversion_of(unit, to, {}) == how


@pytest.mark.parametrize(("own", "how"), [
    (DeclaredUnit({"m": 1}, Conversion(201.168)), Conversion(201.168)),
    (DeclaredUnit({"s": 1}, Conversion(201.168)), None)])
def test_a_unit_of_its_own_is_known_by_its_definition(own, how):
    assert conversion_of("furlong", "m", {"furlong": own}) == how


def test_a_name_and_a_definition_that_differ_are_no_unit():
    """`mm` defined as a metre: one of the two is a mistake, and nobody can tell which."""
    assert conversion_of("mm", "m", {"mm": DeclaredUnit({"m": 1}, Conversion(1.0))}) is None
    assert conversion_of("mm", "m", {"mm": DeclaredUnit({"m": 1}, Conversion(1e-3))}) == Conversion(1e-3)
    assert conversion_of("m", "m", {"m": DeclaredUnit({"m": 1}, Conversion(1e-3))}) is None


def test_blocks_come_in_si_from_the_xml_and_from_its_cache(tmp_path):
    units = ('<UnitDefinitions><Unit name="degR"><BaseUnit K="1" factor="0.5"/></Unit><Unit name="mm"/>'
             "</UnitDefinitions>")
    for _ in range(2):
        fields = described(tmp_path, "degR", "mm", units).fields
        assert {n: (f.block.unit, f.declared, f.conversion) for n, f in fields.items()} == {
            "T": ("K", "degR", Conversion(0.5)), "x": ("m", "mm", Conversion(1e-3)), "mine": ("furlong", "furlong", SI)}
    assert conversion_findings(described(tmp_path, "degR", "mm", units))[0].reason == "T from degR, x from mm"
    assert conversion_findings(described(tmp_path, "K", "m")) == []


def test_a_unit_that_is_not_known_is_refused_by_a_run(tmp_path):
    blocks = {n: f.block for n, f in described(tmp_path, "Fahrenheit", "m").fields.items()}
    wrong = [str(w) for w in wrong_blocks("thermal", blocks, None)]
    assert len(wrong) == 1
    assert "its T is in Fahrenheit, which cannot be made K. Declare K, or define Fahrenheit" in wrong[0]


def test_a_block_that_states_no_unit_is_taken_for_si(tmp_path):
    blocks = {n: f.block for n, f in described(tmp_path).fields.items()}
    assert list(wrong_blocks("thermal", blocks, None)) == []


def test_numbers_of_an_fmu_are_turned_both_ways(tmp_path):
    """One that speaks K and m, but says degC and mm: what it gives is 273.15 more, what it is given a thousand times.
    """
    scenario = load_scenario(BARS)
    fmu = build_half(scenario.write_half("thermal", tmp_path), tmp_path)
    folder = Path(shutil.copytree(fmu.with_suffix(""), tmp_path / "half"))
    xml = folder / "modelDescription.xml"
    text = xml.read_text().replace('unit="K"', 'unit="degC"').replace('unit="m"', 'unit="mm"')
    units = text[text.index("<UnitDefinitions>"):text.index("</UnitDefinitions>") + len("</UnitDefinitions>")]
    xml.write_text(text.replace(units, '<UnitDefinitions><Unit name="degC"/><Unit name="mm"/></UnitDefinitions>'))
    (folder / "blocks.json").unlink(missing_ok=True)
    right, odd = load_half(fmu, None, "right"), load_half(fmu, folder, "odd")
    X = read_interface(tmp_path / "interface.h5").nodes
    # What it reads as m is what we send it as mm: a thousandth of it makes the same bodies.
    T = right.initialise(0.0, 10.0, {}, {"x": X}, ["T"])["T"]
    assert np.allclose(odd.initialise(0.0, 10.0, {}, {"x": 1e-3 * X}, ["T"])["T"], T + 273.15, rtol=1e-14)
    assert np.allclose(odd.read(["x"])["x"], 1e-3 * X, rtol=1e-14)
    stepped = [h.advance(0.0, 1.0, {}, ["T"]).outputs["T"] for h in (right, odd)]
    assert np.allclose(stepped[1], stepped[0] + 273.15, rtol=1e-12)
    for half in (right, odd):
        half.close()
    with pytest.raises(HalfError):
        odd.read(["T"])
