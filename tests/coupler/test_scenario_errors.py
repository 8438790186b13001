"""Every wrong input is one ScenarioError that says where it is and what to write instead."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from coupler.errors import ScenarioError

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, error_of, line_of, load_text

LAMP = "{on: upper.top, flux: 1000, name: lamp}"
PUSH = "push: {t: [0, 10, 10, 30], value: [0, 0, -1.0e-4, -2.0e-4]}"
STEEL = "{rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20}"
WINDOWS = "    - {until: 10, size: 1}\n    - {until: 40, first: 1, last: 5}\n"

# old text, new text, dotted key, words that the message or its remedy must hold
WRONG = {
    "unknown key": ("  scheme: extrapolated", "  sheme: extrapolated", "coupling.sheme", "Did you mean 'scheme'"),
    "unknown key at the top": ("title:", "titel:", "titel", "Did you mean 'title'"),
    "unknown key of a material": ("rho: 8000", "roh: 8000", "materials.steel.roh", "Did you mean 'rho'"),
    "unknown key of a table": (PUSH, "push: {t: [0, 1], values: [0, 1]}", "signals.push.values", "'value'"),
    "missing key": ("  end: 40\n", "", "coupling.end", "missing"),
    "text for a number": ("gap_max: 0.1", "gap_max: wide", "contact.face.gap_max", "number"),
    "number in quotes": ("gap_max: 0.1", "gap_max: '0.1'", "contact.face.gap_max", "without quotes"),
    "an unknown unit": ("gap_max: 0.1", "gap_max: 4 furlong", "contact.face.gap_max", "furlong"),
    "true for a number": ("gap_max: 0.1", "gap_max: true", "contact.face.gap_max", "true or false"),
    "a list for a number": ("gap_max: 0.1", "gap_max: [1]", "contact.face.gap_max", "a list"),
    "nothing for a number": ("gap_max: 0.1", "gap_max:", "contact.face.gap_max", "nothing"),
    "a number for a mapping": ("rectangle: {origin: [0, 0], size: [2, 1], cells: [4, 2]}", "rectangle: 3",
                               "bodies.lower.mesh.rectangle", "mapping"),
    "a number for friction": ("gap_max: 0.1", "gap_max: 0.1\n    friction: 0.3", "contact.face.friction",
                              "Write {mu: 0.3}."),
    "two kinds of condition": ("u_y: push}\n      - {at", "u_y: push, t_y: 5}\n      - {at",
                               "mechanical.elastic.boundary.1", "Write an entry for each of u_y and t_y."),
    "NaN": ("T0: 100", "T0: .nan", "bodies.upper.T0", "not finite"),
    "infinity": ("T0: 100", "T0: .inf", "bodies.upper.T0", "not finite"),
    "NaN in a law": ("h: 2000}", "h: .nan}", "contact.face.conduction.closed.h", "not finite"),
    "a number of which powers overflow": ("E: 2.0e11", "E: 2.0e76", "materials.steel.E", "at most 1e+75"),
    "a comma for a point": ("k: 30", "k: '30,5'", "materials.steel.k", "60.5 for 60,5"),
    "points between thousands": ("E: 2.0e11", "E: 210.000.000.000", "materials.steel.E", "its thousands"),
    "too large a number": ("T0: 100", "T0: 1" + 400 * "0", "bodies.upper.T0", "too large"),
    "negative rho": ("rho: 8000", "rho: -1", "materials.steel.rho", "greater than zero"),
    "negative c": ("c: 500", "c: -1", "materials.steel.c", "greater than zero"),
    "zero k": ("k: 30", "k: 0", "materials.steel.k", "greater than zero"),
    "negative E": ("E: 2.0e11", "E: -2.0e11", "materials.steel.E", "greater than zero"),
    "negative k in a table": ("k: 30", "k: {T: [0, 9], value: [1, -1]}", "materials.steel.k.value.1", "greater"),
    "a polynomial negative at T0": ("k: 30", "k: {polynomial: [1, -1]}", "materials.steel.k", "T0"),
    "temperatures not increasing": ("k: 30", "k: {T: [9, 0], value: [1, 1]}", "materials.steel.k.T.1", "increase"),
    "nu of one half": ("nu: 0.3", "nu: 0.5", "materials.steel.nu", "0.4999"),
    "nu of minus one": ("nu: 0.3", "nu: -1", "materials.steel.nu", "between -1 and 0.5"),
    "time backwards": (PUSH, "push: {t: [0, 10, 5], value: [0, 1, 2]}", "signals.push.t.2", "backwards"),
    "three values at one time": (PUSH, "push: {t: [0, 1, 1, 1], value: [0, 1, 2, 3]}", "signals.push", "at most two"),
    "more times than values": (PUSH, "push: {t: [0, 1], value: [0]}", "signals.push", "2 times, but 1 value"),
    "unknown signal": ("u_y: push}\n      - {at", "u_y: pushh}\n      - {at", "mechanical.elastic.boundary.1.u_y",
                       "Did you mean 'push'"),
    "a signal that names a signal": ("  idle: {t: [0, 7], value: [0, 1]}", "  idle: push", "signals.idle", "another"),
    "unknown surface of a pair": ("slave: upper.bottom", "slave: upper.botom", "contact.face.slave",
                                  "lower.bottom, lower.left, lower.right, lower.top, upper.bottom"),
    "sides with a common node": ("slave: upper.bottom", "slave: lower.left", "contact.face.master", "in common"),
    "unknown surface of a boundary": ("{on: lower.bottom, temperature", "{on: lower.floor, temperature",
                                      "thermal.boundary.0.on", "lower.bottom"),
    "unknown point": ("{at: upper.top.left", "{at: upper.top.lft", "mechanical.elastic.boundary.2.at",
                      "Did you mean 'upper.top.left'"),
    "a flux at a point": (LAMP, "{at: upper.top.left, flux: 1}", "thermal.boundary.1.at", "on a surface"),
    "two conditions in one": (LAMP, "{on: upper.top, flux: 1, temperature: 2}", "thermal.boundary.1", "exactly one"),
    "no place": (LAMP, "{flux: 1}", "thermal.boundary.1", "exactly one of on, at"),
    "unknown thermal half": ("half: thermal", "half: termal", "thermal.half", "Did you mean 'thermal'"),
    "unknown mechanical half": ("half: elastic", "half: plastic", "mechanical.half", "Did you mean 'elastic'"),
    "a half in the wrong place": ("half: thermal", "half: elastic", "thermal.half", "lumped, replay, rod, thermal"),
    "unknown scheme": ("scheme: extrapolated", "scheme: extrapolate", "coupling.scheme", "Did you mean 'extrapolated'"),
    "unknown method": ("half: thermal", "half: thermal\n  method: euler", "thermal.method", "backward_euler"),
    "unknown link": ("  end: 40", "  end: 40\n  link: carrier-pigeon", "coupling.link", "zenoh"),
    "unknown geometry": ("geometry: plane", "geometry: plain", "geometry", "Did you mean 'plane'"),
    "unknown unit of temperature": ("{temperature: degC}", "{temperature: C}", "units.temperature", "degC"),
    "another version": ("slideline: 2", "slideline: 3", "slideline", "versions 1 to 2"),
    "window of size zero": ("size: 1}", "size: 0}", "coupling.windows.0.size", "greater than zero"),
    "window of negative size": ("first: 1,", "first: -1,", "coupling.windows.1.first", "greater than zero"),
    "windows backwards": ("{until: 10, size: 1}", "{until: 40, size: 1}", "coupling.windows.1.until", "backwards"),
    "window longer than its range": ("size: 1}", "size: 11}", "coupling.windows.0.size", "longer than its range"),
    "end not covered": ("{until: 40,", "{until: 39,", "coupling.windows.1.until", "Add a range"),
    "no windows": (WINDOWS, "    []\n", "coupling.windows", "cover"),
    "size and first": ("size: 1}", "size: 1, first: 2}", "coupling.windows.0", "either"),
    "first alone": ("first: 1, last: 5", "first: 1", "coupling.windows.1", "both"),
    "far too many windows": ("size: 1}", "size: 1.0e-9}", "coupling.windows.0", "larger windows"),
    "kink before the start": ("kinks: [25]", "kinks: [25, -1]", "coupling.kinks.1", "before the run begins"),
    "half a substep": ("  end: 40", "  end: 40\n  substeps: {thermal: 0.5}", "coupling.substeps.thermal", "whole"),
    "below absolute zero": ("T0: 100", "T0: -300", "bodies.upper.T0", "below absolute zero"),
    "a surrounding below zero": ("T: 200", "T: -274", "thermal.boundary.2.convection.T", "below absolute zero"),
    "a signal below zero": ("oven: {t: [0, 20], value: [20, 400]}", "oven: {t: [0, 20], value: [20, -400]}",
                            "thermal.boundary.0.temperature", "below absolute zero"),
    "a material lacks E": ("E: 2.0e11, ", "", "materials.steel", "lacks E, which the half 'elastic' needs"),
    "a material lacks nu": ("nu: 0.3, ", "", "materials.steel", "lacks nu"),
    "a material lacks rho": ("rho: 8000, ", "", "materials.steel", "lacks rho"),
    "expansion without T_ref": (", T_ref: 20", "", "materials.steel", "T_ref"),
    "unknown material": ("    material: steel\n    T0: 100", "    material: stel\n    T0: 100", "bodies.upper.material",
                         "Did you mean 'steel'"),
    "unknown law": ("law: constant", "law: constent", "contact.face.conduction.closed.law", "Did you mean 'constant'"),
    "a law lacks a parameter": (", g_m: 25.0e-6", "", "contact.face.conduction.open.g_m", "missing"),
    "a negative parameter": ("k_g: 0.05", "k_g: -0.05", "contact.face.conduction.open.k_g", "must not be negative"),
    "an unknown parameter": ("k_g: 0.05", "kg: 0.05", "contact.face.conduction.open.kg", "Did you mean 'k_g'"),
    "a law missing": ("      open: {law: gas, k_g: 0.05, g_m: 25.0e-6}\n", "",
                      "contact.face.conduction.open", "missing"),
    "a factor without a law": ("      open: {law: gas, k_g: 0.05, g_m: 25.0e-6}\n", "      open: null\n"
                               "      open_factor: idle\n", "contact.face.conduction.open_factor", "null"),
    "a negative factor": ("      open: {law: gas", "      open_factor: push\n      open: {law: gas",
                          "contact.face.conduction.open_factor",
                          "must not be negative, but the signal reaches -0.0001"),
    "gap factor out of order": ("d_cut: 1.0e-3", "d_cut: 1.0e-2",
                                "thermal.boundary.2.convection.gap.d_full", "greater"),
    "no cells": ("cells: [4, 2]", "cells: [4, 0]", "bodies.lower.mesh.rectangle.cells.1", "1 or more"),
    "half a cell": ("cells: [4, 2]", "cells: [4, 2.5]", "bodies.lower.mesh.rectangle.cells.1", "whole"),
    "too few cells": ("cells: [4, 2]", "cells: [4]", "bodies.lower.mesh.rectangle.cells", "short"),
    "billions of cells": ("cells: [4, 2]", "cells: [99999, 99999]", "bodies.lower.mesh.rectangle.cells", "more than"),
    "no mesh": ("    mesh: {rectangle: {origin: [0, 1], size: [2, 1], cells: [5, 2]}}", "    mesh: {}",
                "bodies.upper.mesh", "exactly one of rectangle, file"),
    "a name used twice": ("{on: lower.top, convection", "{on: lower.top, name: lamp, convection",
                          "thermal.boundary.2.name", "already"),
    "a name with a dot": ("  upper:\n", "  up.per:\n", "bodies.up.per", "not usable as a name"),
    "a negative pressure": ("half: elastic\n", "half: rigid\n", "mechanical.rigid.pressure.face",
                            "must not be negative"),
    "probe off the mesh": ("{T: lower.top.left}", "{T: {at: [0, 5], body: lower}}", "probes.face.left.T.at",
                           "not on the mesh"),
    "probe of no body": ("{T: lower.top.left}", "{T: {at: [0, 0], body: lowr}}", "probes.face.left.T.body", "'lower'"),
    "probe of no point": ("{T: lower.top.left}", "{T: lower.top.lefd}", "probes.face.left.T", "'lower.top.left'"),
    "probe of a whole surface": ("{T: lower.top.left}", "{T: lower.top}", "probes.face.left.T", "{max: lower.top}"),
    "probe of p off the contact": ("{T: lower.top.left}", "{p: lower.bottom.left}", "probes.face.left.p",
                                   "only on contact surfaces"),
    "probe of two quantities": ("{T: lower.top.left}", "{T: lower.top.left, u_x: lower.top.left}", "probes.face.left",
                                "exactly one"),
    "probe of no surface": ("{max: upper.bottom}", "{max: upper.botom}", "probes.face.p.p.max", "'upper.bottom'"),
    "fields after the end": ("at: [12.5]", "at: [50]", "output.fields.at.0", "after the end"),
    "options of our own half": ("half: thermal", "half: thermal\n  options: {a: 1}", "thermal.options", "own"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_named(case: str, tmp_path: Path) -> None:
    old, new, key, words = WRONG[case]
    overrides = {"mechanical.rigid.pressure.face": -1} if case == "a negative pressure" else None
    error = error_of(tmp_path, old, new, overrides)
    assert error.key == key
    assert words in f"{error.message} {error.remedy}"
    assert error.file == str(tmp_path / "s.yaml")
    text = str(error)
    assert key in text
    assert "\n" not in text
    assert len(text) < 600
    if case != "a negative pressure":
        assert error.line > 0


@pytest.mark.parametrize(("old", "new", "piece"), [
    ("T0: 100", "T0: -300", "T0: -300"),
    ("size: 1}", "size: -1}", "{until: 10"),
    ("h: 2000}", "h: -2000}", "closed:"),
    (LAMP, "{on: upper.top, flux: lamp}", "flux: lamp"),
    (STEEL, STEEL.replace("nu: 0.3", "nu: 0.7"), "nu: 0.7"),
])
def test_the_line_is_that_of_the_wrong_value(old: str, new: str, piece: str, tmp_path: Path) -> None:
    text = GOOD.replace(old, new)
    assert error_of(tmp_path, old, new).line == line_of(piece, text)


def test_the_value_is_shown_as_it_stood(tmp_path: Path) -> None:
    assert "got '-40 mm'" in str(error_of(tmp_path, "gap_max: 0.1", "gap_max: -40 mm"))
    assert "got -300" in str(error_of(tmp_path, "T0: 100", "T0: -300"))


def test_an_axisymmetric_body_must_not_cross_the_axis(tmp_path: Path) -> None:
    error = error_of(tmp_path, "geometry: plane", "geometry: axisymmetric", {
        "bodies.lower.mesh.rectangle.origin": [-1, 0]})
    assert error.key == "bodies.lower.mesh"
    assert "axis" in error.message


def test_a_missing_elastic_block_is_said(tmp_path: Path) -> None:
    start, stop = GOOD.index("  elastic:\n"), GOOD.index("  rigid:\n")
    error = error_of(tmp_path, GOOD[start:stop], "")
    assert error.key == "mechanical"
    assert "mechanical.elastic" in error.message


# Keys that are misspelt or nobody's, and errors across fields beside them: all are told, and nothing that only follows.
BESIDE = {
    "a probe that is not there": ([("title:", "titel:"), ("{T: lower.top.left}", "{T: lower.top.lefd}")],
                                  ["titel", "probes.face.left.T"]),
    "a name in a misspelt block": ([("signals:", "singals:"), ("T: 200", "T: -274")],
                                   ["singals", "thermal.boundary.2.convection.T"]),
    "pairs in a misspelt block": ([("contact:", "contacts:"), ("flux: 1000", "flux: idel")],
                                  ["contacts", "thermal.boundary.1.flux"]),
    "what a misspelt key holds may come of the guess": ([("slave: upper.bottom", "slaves: upper.botom")],
                                                        ["contact.face.slaves"]),
    "an empty key": ([("title: Two blocks", '"": 1'), ("T: 200", "T: -274")],
                     ["", "thermal.boundary.2.convection.T"]),
    "a key of nobody": ([("title:", "colour:"), ("material: steel\n    T0: 100", "material: stel\n    T0: 100")],
                        ["colour", "bodies.upper.material"]),
    "two keys, one in the other": ([("output:", "ouput:"), ("every: 5", "evry: 5"), ("end: 40", "end: 41")],
                                   ["ouput", "coupling.windows.1.until"]),
    "a value of the wrong form hides the rest": ([("title:", "titel:"), ("gap_max: 0.1", "gap_max: wide"),
                                                  ("flux: 1000", "flux: idel")], ["titel", "contact.face.gap_max"]),
}


@pytest.mark.parametrize("case", BESIDE)
def test_a_misspelt_key_hides_no_error_across_fields(case: str, tmp_path: Path) -> None:
    changes, keys = BESIDE[case]
    text = GOOD
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, text)
    assert [e.key for e in (caught.value, *caught.value.others)] == keys
    assert all(e.line > 0 for e in (caught.value, *caught.value.others))


def test_a_pair_with_a_wrong_surface_is_told_once(tmp_path: Path) -> None:
    """Where the half rigid names the pair it is not told to be missing: it stands in the file."""
    text = (Path(__file__).resolve().parents[2] / "scenarios/heated_bars.yaml").read_text(encoding="utf-8")
    with pytest.raises(ScenarioError) as told:
        load_text(tmp_path, text.replace("slave: cold.bottom", "slave: cold.botom"))
    assert (told.value.key, told.value.others) == ("contact.interface.slave", ())
