"""Overrides: what they reach, and what they are told when they reach nothing."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.errors import ScenarioError
from coupler.scenario import parse_override
from coupler.scenario.options import WindowRange

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text


@pytest.mark.parametrize(("text", "key", "value"), [
    ("mechanical.half=rigid", "mechanical.half", "rigid"),
    ("bodies.upper.mesh.rectangle.cells=[31, 24]", "bodies.upper.mesh.rectangle.cells", [31, 24]),
    ("coupling.end = 1e3", "coupling.end", 1000.0),
    ("a={b: null, c: 'x=y'}", "a", {"b": None, "c": "x=y"}),
    ("title=a=b", "title", "a=b"),
    ("title=", "title", None),
])
def test_command_line_text_is_yaml(text: str, key: str, value: object) -> None:
    assert parse_override(text) == (key, value)


@pytest.mark.parametrize("text", ["mechanical.half", "=3", "a=[1,", "a={b: 1, b: 2}"])
def test_text_of_another_form_is_refused(text: str) -> None:
    with pytest.raises(ScenarioError):
        parse_override(text)


def test_values_are_put_in_place(tmp_path: Path) -> None:
    s = load_text(tmp_path, GOOD, {
        "bodies.upper.mesh.rectangle.cells": np.array([7, 3]), "coupling.windows.1.size": 2,
        "signals.push.value.3": -1e-3, "thermal.tolerance": 1e-6, "output.fields.every": 2,
        "probes.face.left.T": "lower.top.right", "coupling.substeps.thermal": np.int64(3)})
    assert (s.interface.quad_body == 1).sum() == 21
    # `size` takes the place of first and last.
    assert s.coupling.windows[1] == WindowRange(40.0, 2.0, 2.0)
    assert s.signals["push"].at(30.0) == -1e-3
    assert s.models["thermal"]["tolerance"] == 1e-6
    assert s.output.every == 2
    assert s.interface.nodes[s.probes["face.left"].nodes[0]] == pytest.approx([2.0, 1.0])
    assert s.coupling.substeps["thermal"] == 3


def test_a_new_probe_can_be_added(tmp_path: Path) -> None:
    assert "extra" in load_text(tmp_path, GOOD, {"probes.extra": {"u_y": "upper.top.left"}}).probes


@pytest.mark.parametrize(("key", "value", "words"), [
    ("coupling.shceme", "staggered", "Did you mean 'scheme'"),
    ("mechanical.hlaf", "rigid", "Did you mean 'half'"),
    ("bodies.upper.mesh.rectangle.cels", [1, 1], "Did you mean 'cells'"),
    ("nonsense", 1, "unknown key"),
    ("nonsense.deep.down", 1, "unknown key"),
    ("coupling.windows.7.size", 1, "0 to 1"),
    ("coupling.windows.first.size", 1, "a list of 2"),
    ("coupling.end.seconds", 1, "single value"),
    ("coupling.end", "40 mm", "a time [s] is needed here, not a length [m]"),
    ("coupling.end", -1, "greater than zero"),
    ("coupling.end", float("nan"), "not finite"),
    ("coupling.end", object(), "cannot hold"),
    ("", 1, "unknown key"),
])
def test_an_override_that_makes_no_sense_is_named(key: str, value: object, words: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, GOOD, {key: value})
    error = caught.value
    assert words in f"{error.message} {error.remedy}"
    assert error.key.split(".")[0] == key.split(".")[0]
    assert error.line == 0, "what an override set stands on no line of the file"


def test_the_file_is_not_changed_by_an_override(tmp_path: Path) -> None:
    s = load_text(tmp_path, GOOD, {"title": "Other"})
    assert s.title == "Other"
    assert load_text(tmp_path, GOOD).title == "Two blocks"


def test_options_of_a_half_go_with_it(tmp_path: Path) -> None:
    """Options stand for the half of the file: another in its place has none of them, the same keeps them."""
    text = GOOD.replace("half: thermal", "half: ccx\n  options: {time_limit: 5}")
    assert load_text(tmp_path, text, {}).models["thermal"]["options"] == {"time_limit": 5}
    assert load_text(tmp_path, text, {"thermal.half": "ccx"}).models["thermal"]["options"] == {"time_limit": 5}
    own = load_text(tmp_path, text, {"thermal.half": "lumped"})
    assert "options" not in own.resolved["thermal"]
    other = load_text(tmp_path, text, {"mechanical.half": "ccx", "mechanical.options": {"contact": "displacement"}})
    assert other.models["thermal"]["options"] == {"time_limit": 5}
    assert other.models["mechanical"]["options"] == {"contact": "displacement"}
    with pytest.raises(ScenarioError, match="options are for halves of other packages"):
        load_text(tmp_path, text, {"thermal.half": "lumped", "thermal.options.time_limit": 5})
