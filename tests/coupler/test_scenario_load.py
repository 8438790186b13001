"""What a good scenario becomes: models in SI and kelvin, pairs, kinks, directories."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import read_interface
from coupler.scenario import load_scenario
from coupler.scenario.options import Scheme, WindowRange

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, ROOT, load_text


def test_temperatures_become_kelvin_everywhere(tmp_path: Path) -> None:
    text = GOOD.replace("k: 30,", "k: {T: [0, 100], value: [30, 40]},").replace(
        "c: 500,", "c: {polynomial: [500, 1], T_ref: 20},")
    thermal = load_text(tmp_path, text).models["thermal"]
    assert thermal["bodies"]["lower"]["T0"] == pytest.approx(293.15)
    steel = thermal["materials"]["steel"]
    assert steel["k"] == {"T": [273.15, 373.15], "value": [30.0, 40.0], "form": "linear"}
    assert steel["c"] == {"polynomial": [500.0, 1.0], "T_ref": 293.15}
    oven, flux, film = thermal["boundary"]
    assert oven["temperature"] == {"t": [0.0, 20.0], "value": [293.15, 673.15]}
    assert flux == {"flux": 1000.0, "on": "upper.top", "name": "lamp"}
    assert film["convection"] == {"T": 473.15, "h": 40.0, "exponent": 0.0, "gap": {"d_cut": 1e-3, "d_full": 6e-3}}


def test_kelvin_stays_kelvin_and_other_signals_are_not_shifted(tmp_path: Path) -> None:
    s = load_text(tmp_path, GOOD.replace("degC", "K"))
    assert s.temperature_unit == "K"
    assert s.models["thermal"]["bodies"]["upper"]["T0"] == 100.0
    c = load_text(tmp_path, GOOD)
    assert c.models["mechanical"]["boundary"][1]["u_y"]["value"] == [0.0, 0.0, -1e-4, -2e-4]
    assert c.models["mechanical"]["materials"]["steel"]["T_ref"] == pytest.approx(293.15)


def test_models_have_the_documented_form(tmp_path: Path) -> None:
    elastic = load_text(tmp_path, GOOD).models["mechanical"]
    assert elastic["half"] == "elastic"
    push = {"t": [0.0, 10.0, 10.0, 30.0], "value": [0.0, 0.0, -1e-4, -2e-4]}
    assert elastic["boundary"] == [{"on": "lower.bottom", "u_x": 0.0, "u_y": 0.0}, {"on": "upper.top", "u_y": push},
                                   {"at": "upper.top.left", "u_x": 0.0}]
    assert elastic["tolerance"] == 1e-8
    thermal = load_text(tmp_path, GOOD).models["thermal"]
    assert thermal["method"] == "midpoint"
    assert thermal["pairs"]["face"]["conduction"] == {
        "closed": {"law": "constant", "h": 2000.0}, "closed_factor": 1.0,
        "open": {"law": "gas", "k_g": 0.05, "g_m": 25e-6}, "open_factor": 1.0}


def test_swapping_the_half_uses_what_the_file_says_of_the_other(tmp_path: Path) -> None:
    rigid = load_text(tmp_path, GOOD, {"mechanical.half": "rigid"})
    assert rigid.mechanical_half == "rigid"
    assert rigid.thermal_half == "thermal"
    model = rigid.models["mechanical"]
    assert model["pressure"] == {"face": 1e6}
    assert model["motion"]["upper"]["u_y"]["t"] == [0.0, 10.0, 10.0, 30.0]
    assert rigid.interface.mesh_hash == load_text(tmp_path, GOOD).interface.mesh_hash


def test_thermal_data_that_only_bend_restart_nothing(tmp_path: Path) -> None:
    """A sine sampled every second must not cost the midpoint rule its order; jumps and what moves bodies do restart."""
    c = load_text(tmp_path, GOOD, {"signals.oven": {"t": [0, 20, 28, 28], "value": [0, 100, 50, 70]}}).coupling
    assert c.kinks == (10.0, 20.0, 25.0, 28.0, 30.0)
    assert c.bends == {20.0}


def test_without_a_title_a_run_is_called_by_its_file(tmp_path: Path) -> None:
    assert load_text(tmp_path, GOOD).title == "Two blocks"
    assert load_text(tmp_path, GOOD.replace("title: Two blocks\n", "")).title == "s"


def test_kinks_come_from_the_file_and_from_signals_in_use_only(tmp_path: Path) -> None:
    c = load_text(tmp_path, GOOD).coupling
    # push: 10, 30; oven: 20; stated: 25. `idle` has a kink at 7 but drives nothing.
    assert c.kinks == (10.0, 20.0, 25.0, 30.0)
    assert c.windows == (WindowRange(10.0, 1.0, 1.0), WindowRange(40.0, 1.0, 5.0))
    assert (c.scheme, c.end, c.link) == (Scheme.EXTRAPOLATED, 40.0, "direct")
    assert c.substeps == {"thermal": 1, "mechanical": 1}


def test_frames_are_due_by_count_and_at_times_each_once(tmp_path: Path) -> None:
    frames = load_text(tmp_path, GOOD).output.frames()
    assert [frames.due(n, float(t)) for n, t in ((1, 1), (5, 5), (6, 12), (7, 13), (8, 14), (10, 20))] == [
        False, True, False, True, False, True]
    assert not load_text(tmp_path, GOOD, {"output": {}}).output.frames().due(100, 40.0)


def test_a_half_finds_in_its_directory_what_the_scenario_says(tmp_path: Path) -> None:
    s = load_text(tmp_path, GOOD)
    for role in ("thermal", "mechanical"):
        directory = tmp_path / "out" / role
        assert s.write_half(role, directory) == s.models[role]["half"]
        interface = read_interface(directory / "interface.h5")
        assert interface.mesh_hash == s.interface.mesh_hash
        assert interface.surfaces_hash == s.interface.surfaces_hash
        assert json.loads((directory / "model.json").read_text()) == s.models[role]


def test_the_hash_follows_values_not_layout(tmp_path: Path) -> None:
    first = load_text(tmp_path, GOOD).hash
    assert load_text(tmp_path, "# a comment\n" + GOOD.replace("end: 40", "end:   40")).hash == first
    assert load_text(tmp_path, GOOD.replace("T0: 100", "T0: 101")).hash != first
    assert load_text(tmp_path, GOOD, {"bodies.upper.T0": 101}).hash == load_text(
        tmp_path, GOOD.replace("T0: 100", "T0: 101")).hash


def test_the_source_is_kept_and_the_scenario_is_frozen(tmp_path: Path) -> None:
    s = load_text(tmp_path, GOOD, {"bodies.upper.T0": 150})
    assert s.text == GOOD
    assert s.resolved["bodies"]["upper"]["T0"] == 150
    assert s.signals["push"].at(20.0) == pytest.approx(-1.5e-4)
    with pytest.raises(dataclasses.FrozenInstanceError):
        s.title = "other"  # type: ignore[misc]


@pytest.mark.parametrize("name", sorted(p.name for p in (ROOT / "scenarios").glob("*.yaml")))
def test_every_shipped_scenario_is_good_with_both_halves(name: str) -> None:
    path = ROOT / "scenarios" / name
    s = load_scenario(path)
    assert s.probes
    assert s.models["mechanical"]["half"] == s.mechanical_half
    # The rigid half has no forces, so it refuses friction.
    # It takes no loads either, so no rule can drive one.
    changes = {"mechanical.half": "rigid", "rules": []}
    changes |= {f"contact.{p.name}.friction": None for p in s.interface.pairs if p.mu}
    assert load_scenario(path, changes).models["mechanical"]["half"] == "rigid"


def test_sliding_blocks_are_those_of_the_paper() -> None:
    s = load_scenario(ROOT / "scenarios" / "sliding_blocks.yaml")
    assert s.coupling.kinks == pytest.approx((2500, 10000, 12500, 12500 + 2500 / 1.1, 14776, 15000))
    assert set(s.probes) >= {"lower.top.left", "lower.top.centre", "lower.top.right", "upper.bottom.centre"}
    gap = s.interface.nodes[s.interface.surfaces["upper.bottom"]][..., 1].min() - np.max(
        s.interface.nodes[s.interface.surfaces["lower.top"]][..., 1])
    assert gap == pytest.approx(0.0508)


def test_a_condition_at_a_point_without_a_node_goes_to_the_nearest_and_says_so(tmp_path):
    scenario = load_text(tmp_path, GOOD.replace("{at: upper.top.left", "{at: upper.top.centre"))
    model = scenario.models["mechanical"]
    (name,) = {b["at"] for b in model["boundary"] if b.get("at", "").endswith(".nearest")}
    (node,) = scenario.interface.node_sets[name]
    top = scenario.interface.nodes[scenario.interface.surfaces["upper.top"]].reshape(-1, 2)
    centre = 0.5 * (top.min(axis=0) + top.max(axis=0))
    distance = np.linalg.norm(top - centre, axis=1).min()
    assert np.linalg.norm(scenario.interface.nodes[node] - centre) == pytest.approx(distance)
    assert distance > 0
    assert scenario.notes[0].startswith("no node lies at upper.top.centre")
    assert load_text(tmp_path, GOOD).notes == ()


def test_an_earlier_end_cuts_the_windows_off(tmp_path):
    whole, cut = load_text(tmp_path, GOOD).coupling, load_text(tmp_path, GOOD, {"coupling.end": 15.0}).coupling
    assert cut.end == 15.0
    assert cut.windows == whole.windows[:len(cut.windows)]
    assert all(k < 15.0 for k in cut.kinks)


def test_laws_that_do_not_join_at_touch_are_told(tmp_path):
    assert load_scenario(ROOT / "scenarios/sliding_blocks.yaml").notes == ()
    torn = load_scenario(ROOT / "scenarios/sliding_blocks.yaml", {"contact.interface.conduction.open.k_g": 0.04})
    assert "interface: the conductance jumps from 1600 to 2000 W/m2K" in torn.notes[0]


@pytest.mark.parametrize(("origin", "told"), [(0.0762, False), (0.0760, False), (0.0362, True), (0.127, False)])
def test_bodies_that_start_deep_inside_each_other_are_told(origin, told):
    notes = load_scenario(ROOT / "scenarios/sliding_blocks.yaml", {
        "bodies.upper.mesh.rectangle.origin": [0, origin]}).notes
    assert any("start inside lower" in n for n in notes) == told



def test_a_block_that_touches_with_one_side_is_not_told_to_be_inside():
    """Of a pair of another side the nodes that it rests on are far, and on its outline."""
    notes = load_scenario(ROOT / "scenarios/sliding_blocks.yaml", {
        "bodies.upper.mesh.rectangle.origin": [0, 0.0762],
        "contact.side": {"slave": "upper.right", "master": "lower.top", "gap_max": 0.001}}).notes
    assert not any("start inside" in n for n in notes)
