"""Bends of the laws of contact as events: each found where it is, once, at little cost."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler import run
from coupler.control.contact_status import (
    Branch,
    ContactState,
    PairNodes,
    branches_of,
    pair_nodes_of,
    reaches_of,
    side,
)
from coupler.errors import ScenarioError
from coupler.running.setup import plan_of
from coupler.scenario import load_scenario
from coupler.scenario.options import Scheme
from coupler.schemes.levels import Level

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import ROOT
from test_events import TIP, events, moving, plan, solved

GAP, PRESSURE = Branch(TIP, 4e-4), Branch(TIP, 2e5, pressure=True)
DOWN, UP = "gap 0.0004 m of pair tip is passed downwards", "gap 0.0004 m of pair tip is passed upwards"
MORE, LESS = (f"pressure 200000 Pa of pair tip is passed {w}" for w in ("upwards", "downwards"))
CLOSES, OPENS = "pair tip closes", "pair tip opens"


def looked_for(size: float, scheme: Scheme = Scheme.EXTRAPOLATED):
    both = plan(40.0, size, scheme)
    return replace(both, locate=replace(both.locate, branches=(GAP, PRESSURE)))


@pytest.mark.parametrize("size", [0.37, 1.3, 3.1])
def test_every_bend_that_is_passed_is_found_once(size: float) -> None:
    tried = solved(*moving(lambda t: 1e-3 - 1e-4 * t), looked_for(size))
    found = events(tried)
    assert [text for text, _ in found] == [DOWN, CLOSES, MORE]
    assert [t for _, t in found] == pytest.approx([6.0, 10.0, 12.0], abs=3e-6)
    assert sum(not w.accepted for w in tried) <= 5
    assert tried[-1].solved.state.events == 3


def test_to_and_fro_and_no_chatter() -> None:
    tried = solved(*moving(lambda t: 1e-3 * np.cos(2.0 * np.pi * t / 30.0)), looked_for(1.3))
    found = events(tried)
    gaps = 30.0 * np.arccos(0.4) / (2.0 * np.pi)
    presses = 30.0 * np.arccos(-0.2) / (2.0 * np.pi)
    assert [text for text, _ in found] == [DOWN, CLOSES, MORE, LESS, OPENS, UP, DOWN, CLOSES, MORE]
    assert [t for _, t in found] == pytest.approx(
        [gaps, 7.5, presses, 30 - presses, 22.5, 30 - gaps, 30 + gaps, 37.5, 30 + presses], abs=3e-6)
    assert sum(not w.accepted for w in tried) <= 33


def test_what_is_not_asked_for_is_not_cut() -> None:
    both = looked_for(1.3)
    tried = solved(*moving(lambda t: 1e-3 - 1e-4 * t), replace(both, locate=replace(both.locate, branches=())))
    assert [text for text, _ in events(tried)] == [CLOSES]


def test_on_which_side_a_pair_is() -> None:
    place = PairNodes("a", np.array([0, 1, 2]), 0.1)

    def at(gap: list[float], t_N: list[float], covered: list[float]) -> Level:
        return Level(1.0, np.zeros(1), np.zeros((3, 2)), np.array(t_N), np.array(gap), np.array(covered))

    near = at([0.02, 0.01, 0.1], [0.0, -3.0, 0.0], [1.0, 1.0, 0.0])
    assert side(Branch(place, 0.03), near) == (ContactState.BELOW, (pytest.approx(0.02),))
    assert side(Branch(place, 0.004), near) == (ContactState.ABOVE, (pytest.approx(0.006),))
    assert side(Branch(place, 5.0, pressure=True), near) == (ContactState.BELOW, (2.0,))
    nothing = at([0.1, 0.1, np.nan], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    assert side(Branch(place, 0.03), nothing) == (ContactState.APART, ())


def test_bends_of_a_scenario() -> None:
    file = ROOT / "scenarios/sliding_blocks.yaml"
    found = plan_of(load_scenario(file, {"coupling.events.branches": True})).locate
    assert found.on
    assert [(b.at, b.pressure) for b in found.branches] == [(1e-3, False), (6e-3, False), (1e7, True)]
    assert plan_of(load_scenario(file, {"coupling.events.locate": True})).locate.branches == ()
    with pytest.raises(ScenarioError, match="not located"):
        load_scenario(file, {"coupling.events": {"branches": True, "locate": False}})


def test_bends_of_radiation_and_of_sums() -> None:
    scenario = load_scenario(ROOT / "scenarios/sliding_blocks.yaml")
    power = {"law": "power", "h0": 1.0, "h1": 1.0, "p0": 1.0, "exponent": 1.0, "p_max": 3e6}
    total = {"law": "sum", "of": [power, {"law": "constant", "h": 1.0}]}
    thermal = {"pairs": {"interface": {"radiation": {"gap": {"d_near": 0.0, "d_far": 2e-3}},
                                       "conduction": {"closed": total}}}}
    pairs = scenario.interface.pairs
    found = branches_of(thermal, pairs, pair_nodes_of(scenario.interface))
    assert [(b.at, b.pressure) for b in found] == [(2e-3, False), (3e6, True)]


# Where a law still lets heat cross at gap_max, that ends there at once: an event, as touch is.

APART = """
slideline: 2
units: {temperature: K}
geometry: plane
materials: {m: {rho: 7800, k: 1000, c: 480, E: 2e11, nu: 0.3, alpha: 0, T_ref: 300}}
bodies:
  a: {mesh: {rectangle: {origin: [0, -0.01], size: [0.02, 0.01], cells: [2, 1]}}, material: m, T0: 300}
  b: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.01], cells: [3, 1]}}, material: m, T0: 400}
contact:
  p: {slave: b.bottom, master: a.top, gap_max: 5 mm,
      conduction: {closed: {law: constant, h: 200}, open: {law: constant, h: 200}}}
thermal: {boundary: [{body: a, temperature: 300}]}
mechanical: {half: rigid, rigid: {motion: {b: {u_y: {t: [0, 100], value: [0, 0.008]}}}}}
coupling: {end: 100}
probes: {T: {T: {mean: b}}}
"""


def at(dx: float, dy: float, angle: float) -> tuple[ContactState, tuple[float, ...]]:
    """The status of a lid of 1 m on a floor of 1 m that moved so far, all of it turned; a reach of 0.5 m."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0 + dx, 0.0 + dy], [1.0 + dx, 0.0 + dy]]) @ turn.T
    faces = abs(dx) < 1.0 and dy < 0.5
    level = Level(1.0, np.zeros(4), x, np.zeros(2), np.full(2, dy if faces else 0.5), np.full(2, float(faces)))
    branch = Branch(PairNodes("p", np.array([0, 1]), 0.5), 0.5, sides=(np.array([0, 1]), np.array([2, 3])))
    return side(branch, level)


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.785, 2.0])
def test_surfaces_leave_each_others_reach_in_any_frame(angle: float) -> None:
    assert at(0.0, 0.2, angle) == (ContactState.BELOW, (pytest.approx(0.3),))
    assert at(0.0, 0.6, angle) == (ContactState.ABOVE, ())
    assert at(0.4, 0.6, angle) == (ContactState.ABOVE, ())
    assert at(1.7, 0.2, angle) == (ContactState.APART, ())
    assert at(1.7, 0.6, angle) == (ContactState.APART, ())


def test_only_pairs_whose_heat_ends_at_once_have_a_reach_as_event() -> None:
    scenario = load_scenario(ROOT / "scenarios/sliding_blocks.yaml")
    nodes = pair_nodes_of(scenario.interface)
    assert reaches_of((), scenario.interface, nodes) == ()
    found = reaches_of({"interface"}, scenario.interface, nodes)
    assert [(b.at, b.name) for b in found] == [(nodes[0].gap_max, f"gap {nodes[0].gap_max:g} m of pair interface")]


def test_a_block_that_leaves_the_reach_of_a_plate_conducts_until_then(tmp_path: Path) -> None:
    file = tmp_path / "apart.yaml"
    file.write_text(APART)
    found = run(load_scenario(file), tmp_path / "r.h5")
    assert np.abs(found.probe("T")[0] - 62.5).min() < 1e-5
    # 10 mm of 7800 x 480 J/m3K by 200 W/m2K until then; the block conducts so well that it has one temperature
    exact = 300.0 + 100.0 * np.exp(-200.0 * 62.5 / (7800.0 * 480.0 * 0.01))
    assert found.probe("T")[1][-1] == pytest.approx(exact, abs=0.1)
