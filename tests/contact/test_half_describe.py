"""Units, layout and modelDescription.xml of halves."""

from __future__ import annotations

import time
from xml.etree import ElementTree

import numpy as np
import pytest

from contact.half.layout import (
    base_exponents,
    checked_output,
    layout_of,
    model_description,
    scalar_names,
    standard_variables,
)
from contact.half.model import Variable
from contact.half.slave import VariableStore

OWN = (Variable("T", (3,), "output", "K"), Variable("x", (3, 2), "input", "m", start=np.arange(6.0).reshape(3, 2)),
       Variable("load.heat", (), "input", start=1.0), Variable("iterations", kind="Integer", start=0))
STANDARD = (Variable("status.code", kind="Integer", start=0), Variable("contact.link", (), "parameter",
                                                                      kind="String", start="direct"))


def description(own=OWN) -> ElementTree.Element:
    return ElementTree.fromstring(model_description(layout_of(own, STANDARD), "toy", "g", "tool", "a toy"))


@pytest.mark.parametrize(("unit", "expected"), [
    ("1", {}), ("K", {"K": 1}), ("Pa", {"kg": 1, "m": -1, "s": -2}), ("W/m2K", {"kg": 1, "s": -3, "K": -1}),
    ("J/kgK", {"m": 2, "s": -2, "K": -1}), ("1/s", {"s": -1}), ("kg/m3", {"kg": 1, "m": -3}), ("N", {
        "kg": 1, "m": 1, "s": -2}), ("m2/s", {"m": 2, "s": -1}), ("N.m", {"kg": 1, "m": 2, "s": -2}),
    ("kg.m2/s2", {"kg": 1, "m": 2, "s": -2})])
def test_units_are_taken_apart(unit, expected):
    assert base_exponents(unit) == expected


@pytest.mark.parametrize("unit", ["", "degC", "mm", "W/m2/K", "W/", "K ", "m-1", "N.", ".m", "N..m", "m.m"])
def test_what_is_no_si_unit_is_refused(unit):
    with pytest.raises(ValueError, match="unit"):
        base_exponents(unit)


def test_value_references_are_places_and_inputs_come_first():
    layout = layout_of(OWN, STANDARD)
    assert layout.first == {"x": 0, "load.heat": 6, "T": 7, "iterations": 10, "status.code": 11, "contact.link": 12}
    assert (layout.n_set, layout.n_real) == (7, 10)
    assert layout.start_store()[:7].tolist() == [0, 1, 2, 3, 4, 5, 1]
    assert np.isnan(layout.start_store()[7:]).all()


def test_names_are_one_based_with_the_last_index_fastest():
    assert list(scalar_names(OWN[1])) == ["x[1,1]", "x[1,2]", "x[2,1]", "x[2,2]", "x[3,1]", "x[3,2]"]
    scalars = description().findall("ModelVariables/ScalarVariable")
    found = {s.get("name"): (int(s.get("valueReference")), s[0].get("start"), s[0].get("unit")) for s in scalars}
    assert found["x[2,1]"] == (2, "2.0", "m")
    assert found["T[3]"] == (9, None, "K")
    assert found["contact.link"] == (12, "direct", None)


def test_outputs_and_initial_unknowns_are_the_outputs_that_are_computed():
    root = description()
    names = [s.get("name") for s in root.findall("ModelVariables/ScalarVariable")]
    for group in ("Outputs", "InitialUnknowns"):
        listed = [names[int(u.get("index")) - 1] for u in root.findall(f"ModelStructure/{group}/Unknown")]
        assert listed == ["T[1]", "T[2]", "T[3]", "iterations", "status.code"]


def test_texts_are_quoted():
    own = (Variable("note", kind="String", start='<&">', variability="constant", description='a "b" & c'),)
    node = next(n for n in description(own).iter("ScalarVariable") if n.get("name") == "note")
    assert node[0].get("start") == '<&">'
    assert node.get("description") == 'a "b" & c'


def test_twenty_thousand_variables_take_well_under_a_second():
    layout = layout_of((Variable("T", (20000,), "output", "K"), Variable("x", (5000, 2), "input", "m")), STANDARD)
    best = min(timed(lambda: model_description(layout, "toy", "g", "tool", "a toy")) for _ in range(3))
    assert best < 1.0, "measured 0.06 s alone"


def timed(work) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def test_every_half_says_what_it_was_built_from():
    from toy_halves import interface  # beside this file

    layout = layout_of((), standard_variables(interface(3), "contact:ab"))
    store = VariableStore(layout)
    assert store.text("mesh.hash") == interface(3).mesh_hash
    assert store.text("packages.hash") == "contact:ab"
    assert store.text("geometry") == "plane"
    assert store.text("contact.link") == "direct"
    assert layout_of((Variable("control.method", (), "input", kind="Integer", start=2),),
                     standard_variables(interface(3), "")).integers[0].start == 2


@pytest.mark.parametrize(("value", "match"), [(np.zeros(2), "shape"), ("a", "text|convert|could not")])
def test_outputs_of_another_shape_or_kind_are_refused(value, match):
    with pytest.raises(ValueError, match=match):
        checked_output(OWN[0], value)


def test_variables_that_do_not_fit_together_are_refused():
    for wrong in ({"causality": "local"}, {"kind": "Boolean"}, {"shape": (2,), "kind": "Integer", "start": 0},
                  {"start": "text"}, {"shape": (2,), "start": np.zeros(3)}):
        with pytest.raises(ValueError, match="variable v"):
            Variable("v", **wrong)
    with pytest.raises(ValueError, match="twice: T"):
        layout_of((OWN[0], OWN[0]), ())
