"""What a modelDescription.xml of FMI 3.0 says of arrays, and one clear error for each that is damaged."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler.errors import HalfError
from coupler.fmu.description import Description, read_description

XML = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="{{t}}" generationTool="other">
<CoSimulation modelIdentifier="m" canGetAndSetFMUState="true" canSerializeFMUState="false"/>
<UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
<TypeDefinitions><Float64Type name="Temperature" unit="degC"/></TypeDefinitions>
<Annotations><Annotation type="slideline"><Blocks><Block name="T" on="nodes"/></Blocks></Annotation></Annotations>
<ModelVariables>{}</ModelVariables><ModelStructure/></fmiModelDescription>"""
SIZE = '<UInt64 name="n" valueReference="{}" causality="structuralParameter" variability="fixed" start="{}"/>'


def described(folder: Path, *variables: str) -> Description:
    (folder / "modelDescription.xml").write_text(XML.format("".join(variables)))
    return read_description(folder)


def array(name: str, reference: int, dimensions: str, more: str = "", kind: str = "Float64") -> str:
    return f'<{kind} name="{name}" valueReference="{reference}" {more}>{dimensions}</{kind}>'


def of(*sizes: object) -> str:
    return "".join(f'<Dimension start="{size}"/>' for size in sizes)


def test_an_array_is_a_block(tmp_path: Path) -> None:
    found = described(
        tmp_path, SIZE.format(9, 4), array("T", 1, '<Dimension valueReference="9"/>', 'declaredType="Temperature" '
                                           'causality="output"'),
        array("x", 2, '<Dimension valueReference="9"/>' + of(2), 'unit="mm" causality="input" start="0"'),
        array("f_s", 3, of(4), 'causality="input" variability="discrete"'),
        *(f'<Float64 name="E_M[{k + 1}]" valueReference="{20 + k}" causality="input" unit="J"/>' for k in range(3)),
        '<String name="mesh.hash" valueReference="30" causality="output"><Start value="abc"/></String>',
        '<Int32 name="status.code" valueReference="31" causality="output"/>',
        '<Float64 name="a" valueReference="32"><Alias name="b" description="of a"/></Float64>')
    assert (found.fmi, found.guid, found.can_save, found.can_serialise) == (3, "{t}", True, False)
    fields = found.fields
    assert {n: f.block.shape for n, f in fields.items()} == {
        "n": (), "T": (4,), "x": (4, 2), "f_s": (4,), "E_M": (3,), "mesh.hash": (), "status.code": (), "a": (), "b": ()}
    assert (fields["T"].block.unit, fields["T"].conversion.offset, fields["T"].block.causality) == ("K", 273.15,
                                                                                                   "output")
    assert (fields["x"].declared, fields["x"].conversion.factor, fields["x"].references.tolist()) == ("mm", 1e-3, [2])
    assert (fields["f_s"].variability, fields["T"].variability, fields["status.code"].variability) == (
        "discrete", "continuous", "discrete")
    assert fields["E_M"].references.tolist() == [20, 21, 22]
    assert fields["mesh.hash"].start == "abc"
    assert (fields["status.code"].type, fields["status.code"].block.kind) == ("Int32", "Integer")
    assert fields["b"].references.tolist() == [32]
    again = read_description(tmp_path)  # from the cache
    assert {n: (f.block, f.type, f.references.tolist()) for n, f in again.fields.items()} == {
        n: (f.block, f.type, f.references.tolist()) for n, f in fields.items()}


@pytest.mark.parametrize(("variables", "said"), [
    ([array("T", 1, of(-3))], "a Dimension of T is '-3': a size is a whole number of 1 or more"),
    ([array("T", 1, of(0))], "a Dimension of T is '0'"),
    ([array("T", 1, of("2.5"))], "a Dimension of T is '2.5'"),
    ([array("T", 1, of(10**12))], "T has 1000000000000 values, more than 134217728"),
    ([array("x", 1, of(10**6, 10**6))], "x has 1000000 x 1000000 values, more than"),
    ([array("T", 1, of("9" * 5000))], "a Dimension of T has 5000 digits"),
    ([array("T", 1, "<Dimension/>")], "a Dimension of T must have either a start or a valueReference"),
    ([array("T", 1, '<Dimension start="3" valueReference="9"/>'), SIZE.format(9, 3)], "must have either"),
    ([array("T", 1, '<Dimension valueReference="7"/>')], "valueReference 7, which is no structural parameter"),
    ([array("T", 1, '<Dimension valueReference="9"/>'), '<Float64 name="n" valueReference="9" start="3"/>'],
     "valueReference 9, which is no structural parameter"),
    ([array("T", 1, '<Dimension valueReference="9"/>'), SIZE.format(9, -1)], "n, a size of T, is '-1'"),
    ([array("T", 1, '<Dimension valueReference="9"/>'), SIZE.format(9, 10**12)], "T has 1000000000000 values"),
    ([array("T", 1, of(3)), array("x", 1, of(3, 2))], "variables 'T' and 'x' have the same valueReference 1"),
    ([array("T", 1, of(3)), array("T", 2, of(3))], "two variables are named 'T'"),
    ([array("T", 1, of(3)), '<Float64 name="T[1]" valueReference="2"/>'], "T is an array, and there are scalars"),
    ([array("T", 1, of(3), kind="Real")], "a variable of type Real, which FMI 3.0 has not"),
    ([array("", 1, of(3))], "has no name"),
    ([array("T", -1, of(3))], "the valueReference of 'T' is '-1', no number of 32 bits"),
])
def test_what_is_damaged_is_one_clear_error(tmp_path: Path, variables: list[str], said: str) -> None:
    with pytest.raises(HalfError) as raised:
        described(tmp_path, *variables)
    assert "is damaged: " in str(raised.value)
    assert said in str(raised.value)
    assert len(str(raised.value)) < 400


def test_what_is_no_float64_is_no_number_of_the_border(tmp_path: Path) -> None:
    fields = described(tmp_path, array("T", 1, of(3), 'unit="K" causality="output"', "Float32"),
                       array("x", 2, of(3, 2), 'causality="input"', "Int64")).fields
    assert (fields["T"].block.kind, fields["x"].block.kind) == ("Float32", "Integer")
