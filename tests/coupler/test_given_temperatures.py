"""Temperatures that are given over time in all of a body: mechanics alone, or one body's data for another."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler.errors import ScenarioError

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import BAR, edited, linear, loaded, solved, temperatures

HEATING = {"terms": [{"t": 300.0}, {"t": {"t": [0, 10, 20], "value": [0, 1, 0]}, "x": {"polynomial": [0.0, 800.0]},
                                    "y": {"polynomial": [1.0, 50.0]}}]}


def given(field: Any, **more: Any) -> dict[str, Any]:
    return edited(BAR, thermal__boundary=[{"body": "bar", "temperature": field}], **more)


def errors_of(folder: Path, doc: dict[str, Any]) -> list[ScenarioError]:
    with pytest.raises(ScenarioError) as told:
        loaded(folder, doc)
    return [told.value, *told.value.others]


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
def test_every_node_has_what_is_given_at_every_time(tmp_path, method):
    results = solved(tmp_path, given(HEATING, thermal__method=method, bodies__bar__Q_T=1e9))
    t, T = results.field("thermal.T")
    x, y = loaded(tmp_path, given(HEATING)).interface.nodes.T
    expected = 300.0 + 800.0 * np.interp(t, [0, 10, 20], [0, 1, 0])[:, None] * x * (1.0 + 50.0 * y)
    np.testing.assert_allclose(T, expected, rtol=0, atol=1e-9)
    assert not results.broken
    assert results.heat_imbalance < 1e-9


def test_mechanics_alone_follows(tmp_path):
    """A bar held along x and warmed evenly presses with E alpha dT, plane stress."""
    held = {"half": "elastic", "elastic": {"state": "plane_stress", "boundary": [
        {"on": "bar.left", "u_x": 0}, {"on": "bar.right", "u_x": 0}, {"at": "bar.left.bottom", "u_y": 0}]}}
    doc = given({"t": [0, 20], "value": [300.0, 305.0]}, mechanical=held)
    results = solved(tmp_path, doc)
    (t, sigma), dT = results.field("mechanical.sigma"), 0.25 * results.field("mechanical.sigma")[0]
    np.testing.assert_allclose(sigma[:, :, 0], np.outer(-2e11 * 1.2e-5 * dT, np.ones(20)), rtol=1e-3, atol=1e3)
    assert t[-1] == 20.0


def test_one_body_may_be_given_beside_one_that_is_solved_for(tmp_path):
    """A tool of given temperature heats a bar through a contact as a wall behind a resistance does."""
    tool = {**BAR["bodies"]["bar"], "mesh": {"rectangle": {"origin": [0.1, 0], "size": [0.05, 0.02], "cells": [5, 2]}}}
    doc = edited(BAR, bodies={**BAR["bodies"], "tool": tool}, thermal__method="steady", thermal__boundary=[
        {"body": "tool", "temperature": 500.0}, {"on": "bar.left", "temperature": 300.0}],
        contact={"face": {"slave": "bar.right", "master": "tool.left", "gap_max": 0.01,
                          "conduction": {"closed": {"law": "constant", "h": 800.0},
                                         "open": {"law": "constant", "h": 800.0}}}})
    results = solved(tmp_path, doc)
    x = loaded(tmp_path, doc).interface.nodes[:66 // 2, 0]
    q = 200.0 / (0.1 / 40.0 + 1.0 / 800.0)
    np.testing.assert_allclose(temperatures(results)[-1][:33], 300.0 + q * x / 40.0, rtol=0, atol=1e-7)


def recorded(folder: Path) -> None:
    """first.h5: the bar of BAR, warmed as HEATING says, in frames of 2 s."""
    solved(folder, given(HEATING, thermal__method="backward_euler", bodies__bar__T0=300.0), "first")


def test_another_run_gives_its_frames_on_straight_lines(tmp_path):
    recorded(tmp_path)
    held = {"half": "elastic", "elastic": {"boundary": [{"on": "bar.left", "u_x": 0, "u_y": 0}]}}
    doc = given({"from": "first.h5"}, mechanical=held, coupling__end=24.0, units__temperature="degC",
                materials__steel__T_ref=20.0, bodies__bar__T0=26.85,
                coupling__windows=[{"until": 24.0, "size": 1.0}])
    scenario, results = loaded(tmp_path, doc), solved(tmp_path, doc)
    t, T = results.field("thermal.T")
    x, y = scenario.interface.nodes.T
    expected = 300.0 + 800.0 * np.interp(t, [0, 10, 20], [0, 1, 0])[:, None] * x * (1.0 + 50.0 * y)
    np.testing.assert_allclose(T, expected, rtol=0, atol=1e-8)
    assert scenario.notes[0] == ("body bar has the temperatures of first.h5 from 0 to 20 s, 11 frames; until the end "
                                 "at 24 s the last one stays")
    assert len(results.header["starts"][0]["sha256"]) == 64
    assert not results.broken
    assert scenario.models["thermal"]["format"] == 3
    assert np.abs(results.field("mechanical.u")[1][10]).max() > 1e-5


def test_frames_on_another_mesh_are_interpolated_and_that_is_told(tmp_path):
    recorded(tmp_path)
    doc = given({"from": "first.h5"}, bodies__bar__mesh__rectangle__cells=[5, 2])
    T = temperatures(solved(tmp_path, doc))
    fine = temperatures(solved(tmp_path, given({"from": "first.h5"}), "fine"))
    nodes, own = (loaded(tmp_path, d).interface.nodes for d in (given({"from": "first.h5"}), doc))
    same = [int(np.flatnonzero(np.abs(nodes - at).max(axis=1) < 1e-9)[0]) for at in own]
    np.testing.assert_allclose(T, fine[:, same], rtol=0, atol=1e-8)
    assert "on another mesh" in loaded(tmp_path, doc).notes[0]


def test_frames_that_cannot_be_taken_are_refused(tmp_path):
    recorded(tmp_path)
    (error,) = errors_of(tmp_path, given({"from": "none.h5"}))
    assert (error.key, "there is no file" in str(error)) == ("thermal.boundary.0.temperature.from", True)
    (error,) = errors_of(tmp_path, given({"from": "first.h5", "body": "bra"}))
    assert "Did you mean 'bar'?" in str(error)
    (error,) = errors_of(tmp_path, given({"dataset": "start/T.bar", "least": 1.0, "most": 2.0}))
    assert "Write {from: run.h5}" in str(error)
    (error,) = errors_of(tmp_path, given({"from": "first.h5"}, thermal__half="lumped"))
    assert "takes data that depend on time alone" in str(error)
    (error,) = errors_of(tmp_path, edited(BAR, thermal__boundary=[{"on": "bar.left", "temperature": {
        "from": "first.h5"}}]))
    assert "are those of a body" in str(error)


def test_what_is_given_twice_or_nowhere_is_refused(tmp_path):
    twice = given(300.0)
    twice["thermal"]["boundary"] += [{"on": "bar.left", "temperature": 400.0}, {"body": "bar", "temperature": 1.0}]
    found = errors_of(tmp_path, twice)
    assert [e.key for e in found] == ["thermal.boundary.1.on", "thermal.boundary.2.body"]
    assert "the temperature of all of bar is already prescribed by entry 0" in str(found[0])
    (error,) = errors_of(tmp_path, edited(BAR, thermal__boundary=[{"body": "bra", "temperature": 300.0}]))
    assert "Did you mean 'bar'?" in str(error)
    (error,) = errors_of(tmp_path, edited(BAR, thermal__boundary=[{"body": "bar", "flux": 300.0}]))
    assert "flux acts on a surface, not in a body" in str(error)
    (error,) = errors_of(tmp_path, given(linear(-1.0, 0.0)))
    assert error.key == "thermal.boundary.0.temperature.terms"
    (error,) = errors_of(tmp_path, edited(BAR, thermal__boundary=[{"body": "bar", "on": "bar.left",
                                                                   "temperature": 300.0}]))
    assert "exactly one of on, at, body" in str(error)
