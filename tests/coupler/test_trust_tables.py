"""Tables of materials over temperature: what lies beyond their ends is told, for the cells that ask for it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler.scenario.load import Scenario, scenario_from
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.laws.tables import NAME, MaterialTables, TableLog

TABLE = {"T": [300, 900], "value": [50, 30]}


def scene(material: dict[str, Any] | None = None, body: dict[str, Any] | None = None,
          film: dict[str, Any] | None = None, radiation: dict[str, Any] | None = None) -> Scenario:
    """Two bars side by side, of steel and of copper, and a block of the first of another material."""
    plain = {"rho": 7800, "c": 500, "k": 50}
    def bar(x: float) -> dict[str, Any]:
        return {"rectangle": {"origin": [x, 0], "size": [1, 1], "cells": [2, 2]}}

    return scenario_from(json.dumps({
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"steel": plain | (material or {}), "copper": plain},
        "bodies": {"one": {"mesh": bar(0.0), "material": "steel", "T0": 300} | (body or {}),
                   "two": {"mesh": bar(2.0), "material": "copper", "T0": 300}},
        "contact": {"slit": {"slave": "one.right", "master": "two.left", "gap_max": 2, "conduction": {
            "closed": None, "open": None}} | ({"radiation": radiation} if radiation else {})},
        "thermal": {"boundary": [{"on": "one.left", "convection": {"h": 1, "T": 300} | (film or {})}]},
        "mechanical": {"half": "rigid"}, "coupling": {"end": 1}}), Path("scene.yaml"), {})


def told(of: Scenario, *temperatures: tuple[float, float]) -> Check | None:
    """temperatures : [K] of both bars at each level."""
    interface = of.interface
    tables, log = MaterialTables(interface, of.models), TableLog()
    none = np.zeros(0)
    for k, (one, two) in enumerate(temperatures):
        T = np.where(interface.node_body == 0, one, two)
        log = tables.watched(log, Level(float(k), T, interface.nodes, none, none, none))
    checks = tables.checks(log)
    assert len(checks) <= 1
    return checks[0] if checks else None


def test_without_tables_there_is_no_row() -> None:
    assert told(scene(), (2000.0, 300.0)) is None
    assert told(scene({"k": {"polynomial": [50, -0.01]}}), (2000.0, 300.0)) is None


@pytest.mark.parametrize(("low", "high", "share"), [(300.0, 900.0, 0.0), (300.0, 905.0, 5 / 600), (300.0, 1200.0, 0.5),
                                                    (180.0, 400.0, 0.2)])
def test_how_far_beyond_its_ends_a_table_was_asked(low: float, high: float, share: float) -> None:
    """At any time; the other bar has no table, however hot it is."""
    check = told(scene({"k": TABLE}), (400.0, 3000.0), (high, 20.0), (low, 300.0), (400.0, 300.0))
    assert check is not None
    assert (check.name, check.number) == (NAME, pytest.approx(share))
    assert check.verdict is (TrustVerdict.NOTED if share > 0.01 else TrustVerdict.HOLDS)
    if share > 0.01:
        assert "the table k of steel goes from 300 to 900 K" in check.what
        assert f"from {low:g} to {high:g} K" in check.what


def test_all_of_them_are_named() -> None:
    check = told(scene({"k": TABLE, "c": {"T": [300, 600], "value": [450, 500]}},
                       {"Q_T": 1.0, "Q_T_factor": {"T": [300, 1000], "value": [1, 2]}}), (1200.0, 300.0))
    assert check is not None
    assert check.number == pytest.approx(2.0)
    assert check.what.startswith("the table c of steel")
    assert "so does Q_T_factor of one, k of steel" in check.what


def test_a_phase_is_asked_for_where_it_is() -> None:
    """The solid up to the solidus, the liquid from the liquidus on."""
    latent = {"L": 1e5, "T_s": 700, "T_l": 800}
    phases = {"k": {"solid": {"T": [300, 700], "value": [50, 40]}, "liquid": {"T": [800, 1500], "value": [20, 25]}}}
    check = told(scene(phases | {"latent": latent}), (300.0, 300.0), (1500.0, 300.0))
    assert check is not None
    assert check.verdict is TrustVerdict.HOLDS
    phases["k"]["liquid"]["T"] = [900, 1500]
    check = told(scene(phases | {"latent": latent}), (300.0, 300.0), (1500.0, 300.0))
    assert check is not None
    assert check.what.startswith("the table k of steel (liquid)")
    assert check.number == pytest.approx(100.0 / 600.0)


def test_a_film_is_asked_for_at_its_surface() -> None:
    of = scene(film={"h_factor": TABLE})
    assert told(of, (900.0, 300.0)) is not None
    interface = of.interface
    tables, none = MaterialTables(interface, of.models), np.zeros(0)
    T = np.where(interface.nodes[:, 0] == 0.0, 900.0, 2000.0)
    level = Level(0.0, T, interface.nodes, none, none, none)
    assert tables.checks(tables.watched(TableLog(), level))[0].verdict is TrustVerdict.HOLDS
    hot = tables.watched(TableLog(), replace(level, T=T + 600.0))
    assert "h_factor on one.left" in tables.checks(hot)[0].what


def test_a_region_has_the_tables_of_its_material() -> None:
    of = scene(body={"material": "copper", "regions": {"hot": {
        "rectangle": {"origin": [0, 0], "size": [0.5, 1.0]}, "material": "steel"}}}, material={"k": TABLE})
    tables = MaterialTables(of.interface, of.models)
    assert [t.what for t in tables.tables] == ["k of steel"]
    assert of.interface.nodes[tables.nodes[0], 0].max() == 0.5


def test_emissivities_of_a_pair_are_asked_for_at_their_own_sides() -> None:
    check = told(scene(radiation={"emissivity_slave": TABLE | {"value": [0.3, 0.5]}, "emissivity_master": 0.8}),
                 (600.0, 2000.0))
    assert check is not None
    assert check.verdict is TrustVerdict.HOLDS
    check = told(scene(radiation={"emissivity_slave": 0.8, "emissivity_master": TABLE | {"value": [0.3, 0.5]}}),
                 (600.0, 1200.0))
    assert check is not None
    assert check.number == pytest.approx(0.5)
    assert check.what.startswith("the table emissivity_master of pair slit")


@pytest.mark.parametrize(("law", "share"), [
    ({"law": "table", "variable": "T", "x": [300, 500], "h": [100, 900]}, 0.5),
    ({"law": "sum", "of": [{"law": "constant", "h": 5},
                           {"law": "table", "variable": "T", "x": [300, 600], "h": [100, 900]}]}, 0.0),
    ({"law": "table", "x": [0, 1e6], "h": [100, 900]}, None), ({"law": "constant", "h": 10}, None)])
def test_a_conductance_over_temperature_is_asked_at_the_mean_of_both_sides(law: dict[str, Any], share: float | None
                                                                           ) -> None:
    of = scene()
    thermal = dict(of.models["thermal"])
    thermal["pairs"] = {"slit": {"conduction": {"closed": law, "open": None}}}
    check = told(replace(of, models=dict(of.models) | {"thermal": thermal}), (300.0, 300.0), (900.0, 300.0))
    assert (check is None) is (share is None)
    if check is not None:
        assert check.number == pytest.approx(share)
        assert ("conductance of pair slit goes from 300 to 500 K, but was read from 300 to 600 K" in check.what
                ) is bool(share)
