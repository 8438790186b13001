"""modelDescription.xml of any FMU: scalars gathered to blocks."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from coupler.errors import HalfError
from coupler.fmu.description import read_description, unpack
from coupler.fmu.launch import build_halves
from coupler.init.shipped import shipped_scenarios
from coupler.scenario import load_scenario

XML = """<fmiModelDescription fmiVersion="{version}" guid="g" generationTool="by hand">
{cs}<ModelVariables>{variables}</ModelVariables></fmiModelDescription>"""
CS = '<CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true"/>'


def real(name: str, vr: int, more: str = 'causality="input"', start: str = ' start="1"') -> str:
    return f'<ScalarVariable name="{name}" valueReference="{vr}" {more}><Real unit="K"{start}/></ScalarVariable>'


def described(tmp_path, *variables: str, version: str = "2.0", cs: str = CS):
    (tmp_path / "modelDescription.xml").write_text(XML.format(version=version, cs=cs, variables="".join(variables)))
    return read_description(tmp_path)


def test_a_box_of_indices_is_a_block_in_index_order_whatever_the_references(tmp_path):
    d = described(tmp_path, real("x[2,1]", 7), real("x[1,1]", 9), real("x[1,2]", 3), real("x[2,2]", 4), real("a.b", 0))
    assert {n: f.block.shape for n, f in d.fields.items()} == {"x": (2, 2), "a.b": ()}
    assert d.fields["x"].references.tolist() == [9, 3, 7, 4]
    assert (d.can_save, d.can_serialise, d.fields["a.b"].start) == (True, False, "1")


@pytest.mark.parametrize("names", [["T[1]", "T[3]"], ["T[0]", "T[1]"], ["T", "T[1]"], ["T[1]", "T[1,1]"],
                                   ["T[1]", "T[2]", "T[2]"]])
def test_what_fills_no_box_stays_scalar(tmp_path, names):
    d = described(tmp_path, *(real(n, i) for i, n in enumerate(names)))
    assert set(d.fields) == set(names)
    assert all(f.block.shape == () for f in d.fields.values())


def test_a_mixed_group_stays_scalar(tmp_path):
    d = described(tmp_path, real("T[1]", 0), real("T[2]", 1, 'causality="output"', ""))
    assert {n: f.block.causality for n, f in d.fields.items()} == {"T[1]": "input", "T[2]": "output"}


def test_the_second_reading_comes_from_the_cache_and_is_the_same(tmp_path):
    first = described(tmp_path, *(real(f"T[{i}]", i) for i in range(1, 6)), real("y[1]", 9), real("y[2]", 3))
    cache = tmp_path / "blocks.json"
    kept = json.loads(cache.read_text())
    again = read_description(tmp_path)
    assert again.fields.keys() == first.fields.keys()
    for name in first.fields:
        assert again.fields[name].block == first.fields[name].block
        assert np.array_equal(again.fields[name].references, first.fields[name].references)
    kept["guid"] = "from the cache"
    cache.write_text(json.dumps(kept))
    assert read_description(tmp_path).guid == "from the cache"
    assert described(tmp_path, real("T", 0)).guid == "g", "another description is read anew"


def test_a_damaged_cache_is_made_anew(tmp_path):
    described(tmp_path, real("T", 0))
    (tmp_path / "blocks.json").write_text("{")
    assert set(read_description(tmp_path).fields) == {"T"}


@pytest.mark.parametrize(("change", "match"), [
    ({"version": "4.0"}, "FMI 4.0; a half must be FMI 2.0 or 3.0"), ({"version": "1.0"}, "FMI 1.0"),
    ({"cs": ""}, "no CoSimulation"), ({"cs": "<"}, "is not XML")])
def test_what_is_no_co_simulation_is_refused(tmp_path, change, match):
    with pytest.raises(HalfError, match=match):
        described(tmp_path, real("T", 0), **change)


@pytest.mark.parametrize(("variable", "match"), [
    (real("T", 0).replace('valueReference="0"', 'valueReference="x"'), "valueReference of 'T' is 'x', no number"),
    (real("T", 0).replace('valueReference="0"', ""), "ScalarVariable 'T' has no valueReference"),
    (real("T", 2**32), "no number of 32 bits"), (real("", 0), "ScalarVariable '' has no name"),
    ('<ScalarVariable name="T" valueReference="0"/>', "variable 'T' has no type")])
def test_a_damaged_variable_is_told(tmp_path, variable, match):
    with pytest.raises(HalfError, match=f"is damaged.*{match}"):
        described(tmp_path, variable)


def test_a_directory_without_a_description_is_no_fmu(tmp_path):
    with pytest.raises(HalfError, match="holds no FMU"):
        read_description(tmp_path)


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """Both FMUs of a scene with contact, conditions and friction, unpacked."""
    folder = tmp_path_factory.mktemp("fmus")
    scene = load_scenario(shipped_scenarios() / "hot_upsetting.yaml")
    return [unpack(fmu, folder / fmu.stem) for fmu in build_halves(scene, folder)]


def fresh(extracted):
    (extracted / "blocks.json").unlink(missing_ok=True)
    return read_description(extracted)


def told_of(description):
    return [(name, f.block, f.references.tolist(), f.start, f.variability, f.declared, f.conversion)
            for name, f in description.fields.items()]


def test_the_table_of_blocks_says_what_the_description_says(unpacked, tmp_path):
    for extracted in unpacked:
        table = extracted / "resources" / "blocks.json"
        quick = fresh(extracted)
        kept = table.read_bytes()
        table.unlink()
        whole = fresh(extracted)
        table.write_bytes(kept)
        assert sum(f.references.size for f in whole.fields.values()) > 1000
        assert told_of(quick) == told_of(whole)
        assert replace(quick, fields={}) == replace(whole, fields={})


@pytest.mark.parametrize("damage", [b"{", b"[]", b'{"variables": "0", "blocks": []}'])
def test_a_table_that_is_not_of_the_description_is_not_believed(unpacked, damage):
    extracted = unpacked[0]
    right, table = told_of(fresh(extracted)), extracted / "resources" / "blocks.json"
    kept = table.read_bytes()
    other = json.loads(kept)
    other["blocks"][0][0] = "another"
    for text in (damage, json.dumps({**other, "variables": "0" * 64}).encode(),
                 json.dumps({**other, "blocks": other["blocks"][1:]}).encode()):
        table.write_bytes(text)
        assert told_of(fresh(extracted)) == right
    table.write_bytes(kept)
