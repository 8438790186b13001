"""Advice without a run: simplifications, edits, deviations of runs, what is accepted, what is written."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler import load_scenario
from coupler.errors import ScenarioError
from coupler.experiments.advice_text import advice, misses
from coupler.experiments.advise import AdviceOptions, advise, advised, text_of, variant
from coupler.experiments.findings import (
    Findings,
    Goal,
    GoalRequest,
    SimplificationTrial,
    combination_of,
    compare,
    goals_of,
    largest_ratio,
    parse_goal,
    worst_probe,
)
from coupler.experiments.trial import TrialResult
from coupler.experiments.variants import (
    Aspect,
    Edit,
    Simplification,
    contact_probes,
    edited,
    mesh_factor,
    meshed,
    simplifications_of,
    timed,
    windows_factor,
)
from coupler.scenario.document import document_from, read_document
from coupler.scenario.edits import apply_overrides

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, ROOT

BLOCKS, CASTING = ROOT / "scenarios/sliding_blocks.yaml", ROOT / "scenarios/casting_1d.yaml"
RUBBING = ROOT / "scenarios/rubbing_block.yaml"


def names(path: Path) -> list[str]:
    return [s.name for s in simplifications_of(read_document(path).tree)]


def test_the_simplifications_of_the_sliding_blocks() -> None:
    assert names(BLOCKS) == [
        "bodies at rest (uncoupled)", "rigid bodies (one-way)", "one temperature a body", "scheme staggered",
        "convection on lower.top", "convection on upper.bottom", "conduction across the gap (interface)",
        "conduction where they touch (interface)", "windows 2 times as long", "windows 4 times as long"]


def test_the_simplifications_of_the_casting() -> None:
    """Nothing drives its bodies, so rigid ones are at rest; it has latent heat, expansion, shrinkage."""
    assert names(CASTING) == [
        "rigid bodies, at rest as nothing drives them (uncoupled)", "all expansion and shrinkage (one-way)",
        "one temperature a body", "scheme staggered",
        "conduction across the gap (interface)", "conduction where they touch (interface)",
        "latent heat of aluminium", "thermal expansion of aluminium", "shrinkage of aluminium",
        "windows 2 times as long", "windows 4 times as long"]


def test_simplifications_of_what_an_elastic_scene_may_have() -> None:
    tree = edited(document_from(Path("s.yaml"), GOOD).tree, [Edit({
        ("materials", "steel", "plastic"): {"s_y": 2.5e8}, ("materials", "steel", "creep"): {"K": 1e9, "m": 0.5},
        ("contact", "face", "friction"): {"mu": 0.3},
        ("contact", "face", "radiation"): {"emissivity_slave": 0.8, "emissivity_master": 0.8},
        ("mechanical", "elastic", "dynamics"): {}, ("mechanical", "elastic", "thermoelastic_heat"): True,
        ("mechanical", "elastic", "gravity"): {"y": -9.81}, ("bodies", "upper", "Q_T"): 100.0})])
    found = {s.name for s in simplifications_of(tree)}
    assert found >= {"the heat flux on upper.top", "near radiation (face)", "friction (face)", "plasticity of steel",
                     "plastic heat of steel", "heat of creep of steel", "creep of steel", "inertia", "gravity",
                     "thermoelastic heat", "thermal expansion of steel", "the heat source in upper"}


@pytest.mark.parametrize("path", [CASTING, RUBBING])
def test_every_simplification_is_a_scenario_that_differs(path: Path) -> None:
    document = read_document(path)
    for s in simplifications_of(document.tree):
        tree = edited(document.tree, [s.edit])
        edits = [s.edit, timed(tree, s.windows)]
        assert edited(document.tree, edits) != document.tree, s.name
        found = variant(document, [*edits, meshed(tree, 0.2), contact_probes(tree)])
        assert len(found.probes) == len(tree["probes"]) + 4, s.name


def test_rigid_bodies_move_as_the_elastic_ones_are_driven() -> None:
    document = read_document(RUBBING)
    rigid = next(r for r in simplifications_of(document.tree) if r.name == "rigid bodies (one-way)")
    found = variant(document, [rigid.edit])
    assert found.mechanical_half == "rigid"
    assert found.resolved["mechanical"]["rigid"] == {"motion": {"block": {"u_x": "drag", "u_y": "press"}}}
    assert "friction" not in found.resolved["contact"]["face"]


def test_drops_keep_the_numbers_of_list_items() -> None:
    tree = {"a": [10, 11, 12, 13], "b": {"c": 1}}
    assert edited(tree, [Edit(drop=(("a", 1),)), Edit({("b", "d"): 2}, (("a", 2), ("b", "c"), ("b", "nothing")))]) == {
        "a": [10, 13], "b": {"d": 2}}
    assert tree["a"] == [10, 11, 12, 13]


def test_coarse() -> None:
    tree = read_document(BLOCKS).tree
    assert mesh_factor(tree) == pytest.approx(1 / 3)
    assert mesh_factor(read_document(CASTING).tree) == pytest.approx(0.64)
    cells = edited(tree, [meshed(tree, 1 / 3)])["bodies"]["upper"]["mesh"]["rectangle"]["cells"]
    assert cells == [8, 8]
    odd = {"bodies": {"b": {"mesh": {"rectangle": {"cells": [10, 3]}}}}}
    # Even stays even: 5 would leave no node in the middle.
    assert meshed(odd, 0.5).put["bodies", "b", "mesh", "rectangle", "cells"] == [4, 2]
    assert windows_factor(817, 1 / 3) == 2.0
    assert windows_factor(817, 1.0) == 1.0
    assert windows_factor(100, 1 / 3) == 1.0


@pytest.mark.parametrize(("text", "found"), [
    ("lower.top.left=1K", GoalRequest("lower.top.left", 1.0, "K")), ("g=.5um", GoalRequest("g", 0.5, "um")),
    ("'p'=2 %", GoalRequest("'p'", 2.0, "%")),
    ("f=1e-3", GoalRequest("f", 1e-3, ""))])
def test_goals_as_texts(text, found) -> None:
    assert parse_goal(text) == found


@pytest.mark.parametrize("text", ["T", "T=", "=1K", "T=0K", "T=-1K", "T=1 furlong", "T=1e", "T=nan"])
def test_goals_that_are_none(text: str) -> None:
    with pytest.raises(ScenarioError, match="--for"):
        parse_goal(text)


T = np.linspace(0.0, 10.0, 11)
FULL = TrialResult("", 100, 2.0, 2.0, 3.0, t=T, scenario="full",
             probes={"T": 300 + 10 * T, "g": 1e-6 * T, "still": 0 * T, "advise.f.p.max": 2e6 * (T < 8),
              "advise.f.p.mean": 1e6 * (T < 8), "advise.f.u_x": 0 * T,
              "advise.f.u_y": 1e-3 * T + 4e-6 * (T < 8) + 1e-6 * (T == 3)},
             units={"T": "K", "g": "m", "still": "m", "advise.f.p.max": "Pa", "advise.f.p.mean": "Pa",
                    "advise.f.u_x": "m", "advise.f.u_y": "m"})


def moved(**by: float) -> TrialResult:
    return replace(FULL, probes={n: v + by.get(n, 0.0) * (T == 6) for n, v in FULL.probes.items()})


def test_goals_of_a_run() -> None:
    by_default = {g.probe: g.tolerance for g in goals_of([], FULL)}
    # A probe at rest is held against the largest range of its unit.
    assert by_default == pytest.approx({"T": 1.0, "g": 1e-7, "still": 9.996e-5})
    assert goals_of([parse_goal("?=1%"), parse_goal("g=2um")], FULL) == (
        Goal("T", 1.0, 100.0, "K"), Goal("g", pytest.approx(2e-6), pytest.approx(1e-5), "m"))
    for wrong in ("x=1", "T=1um", "g=1K", "advise.f.p.max=1"):
        with pytest.raises(ScenarioError, match="--for"):
            goals_of([parse_goal(wrong)], FULL)


def test_how_far_one_run_is_from_another() -> None:
    goals = goals_of([parse_goal("T=2K"), parse_goal("g=1um")], FULL)
    found = compare(moved(T=-3.0, g=1e-7), FULL, goals)
    assert (found["T"].largest, found["T"].when, found["T"].ratio) == pytest.approx((3.0, 6.0, 1.5))
    assert worst_probe(found) == "T"
    assert largest_ratio(found) == pytest.approx(1.5)
    # A run of fewer windows is compared at its own.
    half = replace(FULL, t=T[::2], probes={n: v[::2] for n, v in FULL.probes.items()})
    assert largest_ratio(compare(half, FULL, goals)) < 1e-12
    assert largest_ratio(compare(replace(FULL, probes={"g": FULL.probes["g"]}), FULL, goals)) == float("inf")


GOALS = (Goal("T", 2.0, 100.0, "K"),)


def step(name: str, kind: Aspect, by: float, solves: int = 100, **more: object) -> SimplificationTrial:
    trial = replace(moved(T=by), solver_calls=solves)
    return SimplificationTrial(Simplification(name, kind, **more), trial, FULL, compare(trial, FULL, GOALS))


def test_what_is_taken() -> None:
    findings = Findings(goals=GOALS, full=FULL, iterated=FULL, base=FULL, trials=(
        step("rest", Aspect.MECHANICS, 50.0),
        step("rigid", Aspect.MECHANICS, 1.0, edit=Edit({("mechanical", "half"): "rigid"})),
        step("rod", Aspect.MECHANICS, 0.1), step("once", Aspect.SCHEME, 0.1, 99),
        step("friction", Aspect.EFFECT, 0.1, needs_deformation=True),
        step("near", Aspect.EFFECT, 0.1, 103), step("dear", Aspect.EFFECT, 0.1, 110), step("far", Aspect.EFFECT, 2.1),
        step("x2", Aspect.WINDOWS, 0.1, 50), step("x4", Aspect.WINDOWS, 0.2, 25), step("cells", Aspect.MESH, 0.1)))
    assert [r.name for r in combination_of(findings)] == ["rigid", "near", "x4", "cells"]
    out = [s.simplification for s in findings.trials if s.simplification.name in ("rigid", "x4")]
    assert [r.name for r in combination_of(findings, out)] == ["rod", "friction", "near", "x2", "cells"]
    # A coarse mesh that nobody held against the scenario's own, or that is far from it, gives no mesh and no windows.
    for fine in ({}, compare(moved(T=3.0), FULL, GOALS)):
        coarse = replace(findings, mesh=0.5, mesh_error=fine)
        assert [r.name for r in combination_of(coarse)] == ["rigid", "near"]
    near = replace(findings, mesh=0.5, mesh_error=compare(moved(T=1.0), FULL, GOALS))
    assert combination_of(near)[-1].name == "cells"


def test_the_mesh_counts_too() -> None:
    near = compare(moved(T=1.5), FULL, GOALS)
    assert Findings(goals=GOALS, combined_error=near).combined_ratio == pytest.approx(0.75)
    assert Findings(goals=GOALS, combined_error=near, mesh=0.5, mesh_error=near).combined_ratio == pytest.approx(1.5)
    assert Findings(goals=GOALS).combined_ratio == float("inf")


def test_what_is_missed() -> None:
    """The rigid half knows no pressure but the prescribed, and its surface is not pressed in."""
    simple = replace(FULL, probes={**FULL.probes, "advise.f.p.max": 1e6 * (T < 8), "advise.f.u_y": 1e-3 * T,
                                   "g": 1.5 * FULL.probes["g"]})
    lines = list(misses(Findings(goals=GOALS, full=FULL, iterated=FULL, combined=simple)))
    assert lines == [
        "pressure at f: up to 2 MPa at t = 0 s, 2 times the mean (corners and edges); the advised model gives 1 MPa",
        "the slave side of f is off by 5 um along y at t = 3 s; it springs back by 5 um when contact is lost, "
        "at t = 8 s",
        "g: by 5 um at t = 10 s (50 % of its range)"]


def test_sentences() -> None:
    steps = (step("near radiation (f)", Aspect.EFFECT, 0.2, 82), step("far radiation on a", Aspect.EFFECT, 30.0, 90),
             SimplificationTrial(Simplification("latent heat of m", Aspect.EFFECT), TrialResult("no such thing"), FULL))
    text = advice(Findings(goals=GOALS, full=FULL, iterated=FULL, base=FULL, trials=steps, untried=("inertia",)))
    assert "  dropping near radiation (f) changes T by 0.2 K at t = 6 s (0.2 % of its range) and saves 18 % of the " \
        "solver calls: within the tolerance" in text
    assert "  dropping far radiation on a changes T by 30 K at t = 6 s (30 % of its range) and saves 10 % of the " \
        "solver calls: outside the tolerance" in text
    assert "  dropping latent heat of m: cannot be tried (no such thing)" in text
    assert "not tried, for lack of time: inertia" in text
    goals = (*GOALS, Goal("still", 1.0, 5.0, "m"))
    still = Findings(goals=goals, full=FULL, iterated=FULL, base=FULL, stopped="time is up")
    assert "goal: T within 2 K (its range is 100 K)" in advice(still)
    assert "goal: still within 1 m (it hardly changes; 5 m is used as its range)" in advice(still)
    assert advice(still)[-1].startswith("time is up; no advice yet; finished trials are stored")
    assert advice(Findings(stopped="stopped by Ctrl-C")) == ["no result: stopped by Ctrl-C"]


def test_mesh_and_windows_of_the_advised_scenario_are_told() -> None:
    longer = step("windows 2 times as long", Aspect.WINDOWS, 0.1, 50, windows=2.0)
    own = "it has the scenario's own mesh and "
    whole = Findings(goals=GOALS, full=FULL, iterated=FULL, base=FULL, combined=FULL,
                     combined_error=compare(FULL, FULL, GOALS))
    coarse = replace(whole, mesh=0.5, windows=2.0, trials=(longer,))
    near, far = (compare(moved(T=by), FULL, GOALS) for by in (1.0, 3.0))
    only = "; longer windows were within the tolerance there only"
    for findings, says in (
            (whole, f"{own}its own windows"),
            (replace(whole, accepted=(longer.simplification,), trials=(longer,)), f"{own}windows 2 times as long"),
            (coarse, f"{own}its own windows: the error of the coarser mesh of the trials is unknown{only}"),
            (replace(coarse, mesh_error=far), f"{own}its own windows: the coarser mesh of the trials is outside the "
                                              f"tolerance{only}"),
            (replace(coarse, mesh_error=near),
             "it has 0.5 times the scenario's cells along an edge and windows 2 times as long")):
        assert says in advice(findings)


def test_the_file_that_is_written(tmp_path: Path) -> None:
    document = apply_overrides(read_document(BLOCKS), {"coupling.windows.5.size": 20, "thermal.method": "sdirk2"})
    taken = tuple(s for s in simplifications_of(document.tree)
                  if s.name in ("rigid bodies (one-way)", "convection on lower.top"))
    findings = Findings(goals=GOALS, mesh=1 / 3, windows=2.0, accepted=taken, combined_error=compare(FULL, FULL, GOALS))
    path = tmp_path / "advised.yaml"
    path.write_text(text_of(document, advised(document, findings), ["first line"], path), encoding="utf-8")
    found = load_scenario(path)
    assert path.read_text().startswith("# first line\n#\n# Two hot blocks")
    assert "# The drive. Gap 50.8 mm" in path.read_text()
    assert found.mechanical_half == "rigid"
    assert [e["on"] for e in found.resolved["thermal"]["boundary"]] == ["lower.bottom", "upper.top", "upper.bottom"]
    # The mesh was not held against the scenario's own, so both mesh and windows are the scenario's.
    assert found.resolved["bodies"] == document.tree["bodies"]
    assert found.resolved["coupling"] == document.tree["coupling"]
    assert found.resolved["thermal"]["method"] == "sdirk2"
    coarse = edited(document.tree, advised(document, replace(findings, mesh_error=compare(FULL, FULL, GOALS))))
    assert coarse["bodies"]["upper"]["mesh"]["rectangle"]["cells"] == [8, 8]
    assert coarse["coupling"]["windows"][5]["size"] == 40


def test_a_file_with_anchors_is_written_anew(tmp_path: Path) -> None:
    text = GOOD.replace("material: steel\n    T0: 20", "material: &m steel\n    T0: 20").replace(
        "material: steel\n    T0: 100", "material: *m\n    T0: 100")
    assert "&m" in text
    assert "*m" in text
    document = document_from(tmp_path / "s.yaml", text)
    edits = [Edit(drop=(("thermal", "boundary", 1),))]
    written = text_of(document, edits, ["x"], tmp_path / "advised.yaml")
    assert document_from(tmp_path / "advised.yaml", written).tree == edited(document.tree, edits)


def test_a_scenario_without_probes_is_refused_before_anything_runs(tmp_path: Path) -> None:
    path = tmp_path / "bars.yaml"
    path.write_text((ROOT / "scenarios" / "heated_bars.yaml").read_text("utf-8").partition("\nprobes:")[0] + "\n",
                    "utf-8")
    with pytest.raises(ScenarioError, match="no probe, so no deviation"):
        advise(path, tmp_path / "advice", AdviceOptions((), {}, 600.0, 8))
    assert not (tmp_path / "advice").exists()


def test_a_probe_that_is_not_there_is_told_before_anything_runs(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"--for.*no such probe.*foo"):
        advise(ROOT / "scenarios" / "heated_bars.yaml", tmp_path / "advice", AdviceOptions(("foo=1K",), {}, 600.0, 8))
    assert not (tmp_path / "advice").exists()
