"""Rules act where what they look at passes its bound, in windows of any size, and say how late they are where not."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from coupler import Results, run
from coupler.rules.instant import has_instant, passed, standing
from coupler.scenario.load import scenario_from
from coupler.scenario.options import Scheme
from coupler.scenario.rule_model import Change, Give, Passed, Retry, Rule, Stop, Substeps, Test, UseScheme, When
from coupler.scenario.rule_model import Of as What
from coupler.trust.in_time import instants
from coupler.trust.in_time.instants import NAME, Acted, InstantLog

OFF = (Give("thermal", "load.heater", Change(to=0.0)),)
HOT = Test("T", above=400.0)


def rule(*tests: Test, do: tuple[Any, ...] = OFF, **more: Any) -> Rule:
    return Rule("off", When(tests), do, **more)


# Which rules have an instant, and how far they are from it

def test_rules_that_act_on_the_scene_have_an_instant():
    assert has_instant(rule(HOT))
    assert has_instant(rule(HOT, do=(Stop("hot"),)))
    assert has_instant(rule(Test("t", above=5.0)))
    assert has_instant(rule(Test("mechanical.reaction.ram[2]", below=-3e5)))


@pytest.mark.parametrize("other", [
    rule(HOT, do=(Retry(),)), rule(HOT, do=(*OFF, Retry())), rule(HOT, do=(Substeps("thermal", Change(times=2.0)),)),
    rule(HOT, do=(UseScheme(Scheme.ITERATED),)), rule(HOT, do=(Give("thermal", "control.method", Change(to=1.0)),)),
    rule(), rule(Test("T", above=400.0, windows=3)), rule(Test("T", of=What.RATE, above=1.0)),
    rule(HOT, Test("iterations", above=3.0)), rule(Test("thermal.max_dT", above=3.0)),
    rule(Test("mechanical.iterations", above=3.0))])
def test_rules_of_how_the_run_is_solved_have_none(other):
    assert not has_instant(other)


@pytest.mark.parametrize(("when", "T", "p", "found"), [
    (When((HOT,)), 390.0, 0.0, (False, (10.0,))), (When((HOT,)), 401.0, 0.0, (True, ())),
    (When((Test("T", above=350.0, below=400.0),)), 402.0, 0.0, (False, (2.0,))),
    (When((HOT, Test("p", below=1.0))), 390.0, 0.0, (False, (10.0,))),
    (When((HOT, Test("p", below=1.0))), 390.0, 3.0, (False, ())),
    (When(any=((HOT,), (Test("p", above=1.0),))), 390.0, 0.5, (False, (10.0, 0.5))),
    (When(any=((HOT,), (Test("p", above=1.0),))), 390.0, 3.0, (True, ())),
    (When((Test("p", above=1.0),), ((HOT,), (Test("T", below=200.0),))), 390.0, 0.5, (False, ())),
    (When((HOT,)), math.nan, 0.0, (None, ()))])
def test_how_far_each_quantity_is_that_alone_is_missing(when, T, p, found):
    assert standing(Rule("r", when, OFF), False, {"t": 1.0, "T": T, "p": p}) == found


def test_time_is_a_condition_too():
    late = rule(HOT, after=5.0, until=9.0)
    assert standing(late, False, {"t": 3.0, "T": 500.0}) == (False, (2.0,))
    assert standing(late, False, {"t": 9.5, "T": 500.0}) == (False, ())
    assert standing(late, True, {"t": 7.0, "T": 500.0}) == (False, ()), "once, and it has"


def test_a_bound_that_is_just_reached_is_not_passed():
    acts, (left,) = standing(rule(HOT), False, {"t": 1.0, "T": 400.0})
    assert acts is False
    assert left > 0.0


def test_how_late_a_rule_is():
    last, now = {"t": 10.0, "T": 380.0, "p": 0.0}, {"t": 12.0, "T": 405.0, "p": 10.0}
    assert passed(rule(HOT), False, last, now) == Passed("T", 5.0, 0.2)
    assert passed(rule(HOT, Test("p", above=9.0)), False, last, now) == Passed("p", 1.0, 0.1), "the last one tells"
    assert passed(rule(HOT), True, last, now) is None
    assert passed(rule(HOT), False, now, now) is None, "it acted before"
    assert passed(rule(HOT), False, {"t": 10.0}, now) is None


# In a run: a block of 1 MJ/m3K that takes 1 K/s, and is to take no more at 400 K, at 100 s of 1000

def heated(coupling: dict[str, Any], do: list[Any], when: dict[str, Any] | None = None) -> dict[str, Any]:
    return {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
            "materials": {"m": {"rho": 1000, "c": 1000, "k": 1e4, "E": 1e9, "nu": 0.3, "alpha": 0, "T_ref": 300}},
            "bodies": {"block": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.01, 0.01], "cells": [1, 1]}},
                                 "material": "m", "T0": 300}},
            "thermal": {"boundary": [{"on": "block.left", "flux": 1e4, "name": "heater"}]},
            "mechanical": {"half": "rigid", "rigid": {}}, "coupling": {"end": 1000, **coupling},
            "rules": [{"name": "off", "when": when or {"T": {"above": 400}}, "do": do}],
            "probes": {"T": {"T": {"mean": "block.right"}}}}


def ran(tmp_path: Path, doc: dict[str, Any]) -> Results:
    return run(scenario_from(json.dumps(doc), Path("scene.yaml"), {}), tmp_path / "run.h5")


def row(results: Results) -> Any:
    return next(c for c in results.trust if c.name == NAME)


SWITCH, STOP = [{"set": {"load.heater": 0}}], [{"stop": "hot"}]
FIXED = {"windows": [{"until": 1000, "size": 40}]}


@pytest.mark.few("iterated")
@pytest.mark.parametrize("coupling", [
    {}, FIXED | {"events": {"locate": True}}, FIXED | {"events": {"locate": True}, "scheme": "iterated"}],
    ids=["defaults", "fixed", "iterated"])
def test_a_heater_is_switched_off_when_it_must(tmp_path, coupling):
    """With all defaults windows had grown to 76 s by then: 460 K, and nothing was said."""
    results = ran(tmp_path, heated(coupling, SWITCH))
    assert results.probe("T")[1][-1] == pytest.approx(400.0, abs=0.02)
    assert any(text == "rule off acts" for text in results.events.values())
    assert row(results).verdict == "holds"
    assert not results.broken


@pytest.mark.few("when1")
@pytest.mark.parametrize("when", [{"T": {"above": 400}}, {"t": {"above": 100}}])
def test_a_run_ends_when_it_must(tmp_path, when):
    results = ran(tmp_path, heated({}, STOP, when))
    assert results.t[-1] == pytest.approx(100.0, abs=0.02)


def test_a_rule_that_is_late_in_fixed_windows_is_told(tmp_path):
    """At 120 s it is 420 K: a sixth of what it rose by."""
    results = ran(tmp_path, heated(FIXED, SWITCH))
    assert results.probe("T")[1][-1] == pytest.approx(420.0, abs=0.02)
    assert row(results).verdict == "noted"
    assert row(results).number == pytest.approx(1.0 / 6.0, abs=1e-3)
    assert "rule off acted up to 20 s late, at t = 120 s: T had gone 20 past its bound" in row(results).sentence


def test_a_rule_that_is_very_late_is_not_to_be_trusted(tmp_path):
    results = ran(tmp_path, heated({"windows": [{"until": 1000, "size": 90}]}, SWITCH))
    assert NAME in [c.name for c in results.broken]


def test_rules_that_do_not_act_on_the_scene_have_no_row(tmp_path):
    results = ran(tmp_path, heated(FIXED, [{"scheme": "iterated"}]))
    assert NAME not in [c.name for c in results.trust]


def test_a_quantity_that_jumps_is_late_by_its_time():
    """A pressure that was 0 and is 10 MPa: how far that is past 1 MPa tells nothing."""
    log, before = InstantLog(), {"p": 0.0}
    for k, p in enumerate((0.0, 0.0, 1e7, 1e7)):
        late = {"lower": Passed("p", 9e6, 0.9)} if k == 2 else {}
        log, before = instants.watched(log, Acted(10.0 * (k + 1), 10.0, before, {"p": p}, late)), {"p": p}
    assert log.worst == pytest.approx(0.9 * 10.0 / 30.0)


def test_a_window_that_ends_at_the_event_is_not_late_however_far_the_quantity_jumps():
    acted = Acted(10.0, 10.0, {"p": 0.0}, {"p": 1e7}, {"lower": Passed("p", 9e6, 0.9)}, located=True)
    assert instants.watched(InstantLog(), acted).worst == 0.0
    assert instants.watched(InstantLog(), Acted(10.0, 10.0, {"p": 0.0}, {"p": 1e7}, dict(acted.late))).worst > 0.5
