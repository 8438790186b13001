"""Rules on fake halves: each kind fires, is told, and goes back with its window."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.codec import decode, encode, kinds_of
from coupler.control.loop import Plan, windows
from coupler.errors import CouplingError
from coupler.rules import engine as rules
from coupler.rules.drive import Driven
from coupler.rules.engine import Memory, Past, fire, fire_failed
from coupler.scenario.options import Adaptive, OnCycle, Scheme, WindowRange
from coupler.scenario.rule_model import (
    Change,
    Drive,
    Give,
    Of,
    Retry,
    Rule,
    Stop,
    Substeps,
    Test,
    UseScheme,
    When,
    Window,
)
from coupler.schemes.schedule import schedule
from coupler.schemes.state import Settings, Verdict, wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
from coupled_run import start
from fake_halves import B_LAG, T_STAR, gap_of, lumped, shrinking
from ruled_run import heating, ruled, still

HOT = When((Test("thermal.max_dT", above=2.0),))
PLAIN = Settings(Scheme.STAGGERED, {"thermal": 1, "mechanical": 1})


def sizes(tried) -> list[float]:
    return [round(w.H, 12) for w in tried if w.accepted]


def seen(t: float, **monitors: float) -> dict[str, float]:
    return {"t": t, "window": 1.0, **monitors}


def firing_times(rule: Rule, values: list[float]) -> list[int]:
    """Numbers (from 1) of the windows of 1 s in which a rule on monitor `a` fires."""
    memory, times = Memory(last={"t": 0.0, "a": 0.0}), []
    for n, a in enumerate(values, 1):
        fired = fire([rule], memory, seen(float(n), a=a), PLAIN)
        memory = fired.memory
        times += [n] if fired.log else []
    return times


def test_monitors_have_the_units_of_what_they_look_at():
    blocks = {"thermal": lumped(400.0).blocks, "mechanical": shrinking(400.0).blocks}
    watched = [Rule("r", When(tuple(Test(name, above=1.0) for name in (
        "thermal.T[1]", "mechanical.x", "window", "max_p", "iterations", "error.gap"))), (Stop("x"),))]
    assert rules.units(watched, blocks) == {"thermal.T": "K", "thermal.T[1]": "K", "mechanical.x": "m",
                                            "window": "s", "max_p": "Pa", "iterations": "1", "error.gap": "1"}


TWICE = Give("thermal", "load.x", Change(times=2.0), 1.0)


def on_a(do=(TWICE,), windows=1, of=Of.VALUE, **options) -> Rule:
    return Rule("r", When((Test("a", of, above=1.0, windows=windows),)), tuple(do), **options)


def test_bounds_themselves_do_not_count():
    assert firing_times(on_a(), [1.0, 1.0 + 1e-12, 2.0]) == [2, 3]
    between = Rule("r", When((Test("a", above=1.0, below=2.0),)), (Stop("x"),))
    assert firing_times(between, [1.0, 1.5, 2.0]) == [2]


def test_windows_in_a_row_are_counted_anew_after_a_firing():
    assert firing_times(on_a(windows=3), [2, 2, 0, 2, 2, 2, 2, 2, 2, 2]) == [6, 9]


def test_change_and_rate():
    assert firing_times(on_a(of=Of.CHANGE), [1.0, 2.5, 3.0, 5.0]) == [2, 4]
    rate = on_a(of=Of.RATE)
    fired = fire([rate], Memory(last={"t": 1.0, "a": 0.0}), {"t": 1.5, "window": 0.5, "a": 0.6}, PLAIN)
    assert fired.log[0].values == {"rate of a": pytest.approx(1.2)}
    assert not fire([rate], Memory(), {"t": 1.5, "window": 0.5, "a": 0.6}, PLAIN).log, "nothing to compare with"


def test_once_cooldown_after_until():
    assert firing_times(on_a(once=True), [2] * 6) == [1]
    assert firing_times(on_a(cooldown=2), [2] * 8) == [1, 4, 7]
    assert firing_times(on_a(after=2.0, until=4.0), [2] * 6) == [3, 4]


def test_all_and_any():
    rule = Rule("r", When((Test("a", above=0.0),), ((Test("b", above=0.0), Test("c", above=0.0)),
                                                    (Test("d", above=0.0),))), (Stop("x"),))
    def fires(**m): return bool(fire([rule], Memory(), seen(1.0, **m), PLAIN).log)
    assert fires(a=1, b=1, c=1)
    assert fires(a=1, d=1)
    assert not fires(a=1, b=1)
    assert not fires(a=1, c=1, d=-1)
    assert not fires(b=1, c=1, d=1)


def test_what_rules_change_in_settings():
    do = (Substeps("mechanical", Change(times=2.0, least=1, most=16)),
          Give("thermal", "control.method", Change(to=2.0)), Give("mechanical", "load.p", Change(times=1.5), 1.0),
          UseScheme(Scheme.ITERATED), Window(Change(times=0.5)), Window(Change(to=2.0)))
    rule, settings, memory = on_a(do), PLAIN, Memory()
    for n in range(1, 7):
        fired = fire([rule], memory, seen(n, a=2.0), settings)
        settings, memory = fired.settings, fired.memory
    assert settings.substeps == {"thermal": 1, "mechanical": 16}
    assert settings.inputs == {"thermal": {"control.method": 2.0}, "mechanical": {"load.p": pytest.approx(1.5**6)}}
    assert settings.scheme is Scheme.ITERATED
    assert settings.window_factor == 0.5**6
    assert settings.window_cap == 2.0
    assert PLAIN.substeps == {"thermal": 1, "mechanical": 1}
    assert fired.log[0].text == ("mechanical.substeps x2, thermal.control.method 2, mechanical.load.p x1.5, "
                                 "scheme iterated, window x0.5, window 2 s at most")


def test_the_first_of_several_rules_acts_first():
    set_, twice = (Rule(n, When(), (Give("thermal", "load.x", c, 1.0),)) for n, c in (
        ("set", Change(to=5.0)), ("twice", Change(times=2.0))))
    for order, value in (((set_, twice), 10.0), ((twice, set_), 5.0)):
        assert fire(order, Memory(), seen(1.0), PLAIN).settings.inputs["thermal"]["load.x"] == value


def test_a_window_that_heats_too_much_is_put_back_and_halved():
    thermal = heating(lambda t: 10.0 if t < 2.0 else 1.0)
    tried = ruled([Rule("soft start", HOT, (Retry(0.5),))], (thermal, still()), (4.0, 4))
    back = [w for w in tried if not w.accepted]
    assert {w.solved.verdict for w in back} == {Verdict.RULE}
    assert max(sizes(tried)[:2]) < 0.2
    assert sizes(tried)[-2:] == [1.0, 1.0]
    assert back[0].solved.message == "rule 'soft start': window rejected, x0.5"
    assert back[0].fired[0].values == {"thermal.max_dT": pytest.approx(10.0)}
    assert thermal.state[0] == pytest.approx(300.0 + 20.0 + 2.0), "heated once over each window"


def test_a_retry_stops_at_its_least():
    tried = ruled([Rule("soft", HOT, (Retry(0.5, least=0.5),))], (heating(), still()), (2.0, 2))
    assert sizes(tried) == [0.5] * 4
    assert [len(w.fired) for w in tried] == [1, 0, 0, 1, 0, 0], "told only where it did something"


def test_a_rule_that_is_never_content_ends_the_run_in_its_own_words():
    with pytest.raises(CouplingError, match=r"rule 'never': window rejected, x0\.5; the window was halved 10 times"):
        ruled([Rule("never", When(), (Retry(0.5),))], (heating(), still()), (2.0, 2))


def test_windows_that_find_their_own_size_are_put_back_too():
    """They grow until 2 K a window is passed; the rule then cuts them, and is content at its least."""
    adaptive = Adaptive(first=0.1, least=0.05, most=1.0)
    soft = Rule("soft", HOT, (Retry(0.5, least=0.05),))
    tried = ruled([soft], (heating(), still()), (4.0, 4), plan={"adaptive": adaptive})
    assert max(sizes(tried)) <= 0.2
    assert tried[-1].solved.state.now.T[0] == pytest.approx(340.0)
    tried = ruled([replace(soft, do=(Retry(0.5, least=0.3),))], (heating(), still()), (4.0, 4),
                  plan={"adaptive": adaptive})
    assert 0.3 <= max(sizes(tried)) < 0.6


def test_once_holds_for_a_window_that_is_put_back():
    tried = ruled([Rule("soft", HOT, (Retry(0.5),), once=True)], (heating(), still()), (2.0, 2))
    assert [w.accepted for w in tried] == [False, True, True, True]
    tried = ruled([Rule("soft", HOT, (Retry(0.5),), cooldown=3)], (heating(), still()), (4.0, 4))
    assert [w.accepted for w in tried] == [False, True, True, True, False, True, True, True]


def test_a_window_put_back_takes_the_memory_of_all_rules_with_it():
    """Six windows of 1 s; the fourth is put back once. Others see its halves only, and count each second as it is."""
    heats = heating(lambda t: 3.0 if 3.0 < t < 4.0 else 1.0)
    count = Rule("count", When((Test("thermal.max_dT", above=0.9, windows=4),)), (TWICE,))
    soft = Rule("soft", HOT, (Retry(0.5),))
    tried = ruled([soft, count], (heats, still()), (6.0, 6))
    back = next(i for i, w in enumerate(tried) if not w.accepted)
    before, after = tried[back - 1].after.control, tried[back].after.control
    assert before.rules.rules["count"] == Past(streaks=(3,))
    assert after.rules.rules["count"] == before.rules.rules["count"]
    assert after.rules.rules["soft"] == Past(fired=1, streaks=(0,))
    assert (after.rules.last, after.settings) == (before.rules.last, before.settings)
    # 1.5 K in each half of 3.0 to 4.0 s: the first of them is the fourth in a row.
    fired = [round(w.t + w.H, 9) for w in tried if any(f.rule == "count" for f in w.fired)]
    assert fired == [3.5]


def test_actions_of_other_rules_go_back_with_the_window():
    grow = Rule("grow", When((Test("t", above=1.5),)), (Substeps("thermal", Change(times=2.0, most=64)),), once=True)
    soft = Rule("soft", HOT, (Retry(0.5),))
    heats = heating(lambda t: 3.0 if t > 1.0 else 1.0)
    tried = ruled([grow, soft], (heats, still()), (2.0, 2))
    assert [(w.accepted, w.after.control.settings.substeps["thermal"]) for w in tried] == [
        (True, 1), (False, 1), (True, 1), (True, 2)]
    assert [f.rule for w in tried for f in w.fired] == ["soft", "grow"]


DRIVE = Drive("thermal", "load.lamp", "thermal.max_dT", 20.0, 1.0, 1e-3, 1e3, log=True, gain=1.0)
KINDS = {
    "retry": Rule("r", do=(Retry(0.5),), once=True, after=1.5),
    "substeps": Rule("r", do=(Substeps("thermal", Change(times=2.0, most=64)),), once=True, after=1.5),
    "method": Rule("r", do=(Give("thermal", "control.method", Change(to=3.0)),), once=True, after=1.5),
    "load": Rule("r", do=(Give("thermal", "load.lamp", Change(times=2.0), 1.0),), once=True, after=1.5),
    "scheme": Rule("r", do=(UseScheme(Scheme.PARALLEL),), once=True, after=1.5),
    "window factor": Rule("r", do=(Window(Change(times=0.5)),), once=True, after=1.5),
    "window cap": Rule("r", do=(Window(Change(to=0.25)),), once=True, after=1.5),
    "stop": Rule("r", do=(Stop("enough"),), once=True, after=1.5),
    "drive": Rule("r", drive=DRIVE, after=1.5),
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_rule_fires_and_is_rolled_back(kind: str) -> None:
    """Windows of 1 s; the second is put back once by another rule, or by the rule itself, then taken in two."""
    other = Rule("other", When((Test("number", above=1.5),)), (Retry(0.5),), once=True)
    rule = KINDS[kind]
    tried = ruled([rule] if kind == "retry" else [rule, other], (heating(), still()), (4.0, 4))
    first, back, *rest = tried
    assert [first.accepted, back.accepted, rest[0].accepted] == [True, False, True]
    before, after = first.after.control, back.after.control
    assert (after.settings, after.rules.drives, after.rules.last, after.stop) == (
        before.settings, before.rules.drives, before.rules.last, "")
    assert after.rules.rules["r"].fired == (1 if kind == "retry" else 0)
    assert [f.rule for f in back.fired] == ["r" if kind == "retry" else "other"]
    fired = [w for w in rest if any(f.rule == "r" for f in w.fired)]
    if kind != "retry":
        # The first piece ends at 1.5 s, which is not yet after 1.5 s.
        assert fired[0].t == pytest.approx(1.5)
        now = fired[0].after.control
        assert (now.settings, now.stop) != (before.settings, "")
    assert bool(fired) == (kind != "retry")


def test_a_window_put_back_by_the_cycle_detector_takes_rules_with_it():
    """E4 above its stable window: when the detector cuts, a rule that fired in that window has not."""
    rule = Rule("count", When((Test("max_T", above=0.0),)), (TWICE,))
    dt, T0 = 1.2 * 2.0 / B_LAG, T_STAR + 1e-2
    plan = Plan(schedule(40 * dt, [WindowRange(40 * dt, dt, dt)], ()), Scheme.STAGGERED,
                {"thermal": 1, "mechanical": 1}, rules=(rule,), on_cycle=OnCycle.CUT)
    for w in windows(wanted_outputs(lumped(T0), shrinking(T0)), start(T0, gap_of(T0)), plan):
        control = w.after.control
        assert control.rules.rules["count"].fired == control.number
        assert control.settings.inputs["thermal"]["load.x"] == 2.0**control.number
        if w.solved.verdict is Verdict.CYCLE:
            return
    raise AssertionError("nothing was cut")


def test_scheme_method_substeps_reach_the_halves():
    thermal, mechanical = heating(), still()
    do = (Give("thermal", "control.method", Change(to=3.0)), Substeps("mechanical", Change(times=2.0, most=4)),
          UseScheme(Scheme.PARALLEL))
    tried = ruled([Rule("all", When((Test("body.T", above=305.0),)), do, once=True)], (thermal, mechanical), (3.0, 3))
    assert thermal.methods == [0, 3, 3]
    assert [w.solved.scheme for w in tried] == [Scheme.STAGGERED, Scheme.PARALLEL, Scheme.PARALLEL]
    assert len(mechanical.calls) == 1 + 2 + 2


def test_a_load_is_set_and_scaled():
    thermal = heating()
    lamp = Rule("dim", When((Test("body.T", Of.CHANGE, above=4.0),)), (
        Give("thermal", "load.lamp", Change(times=0.5), 1.0),))
    ruled([lamp], (thermal, still()), (4.0, 4))
    assert thermal.state[0] == pytest.approx(300.0 + 10.0 + 5.0 + 2.5 + 2.5)


def test_windows_are_scaled_and_capped():
    finer = Rule("finer", When((Test("number", above=1.5, below=2.5),)), (Window(Change(times=0.5)),))
    assert sizes(ruled([finer], (heating(), still()), (4.0, 4))) == [1.0, 1.0, 0.5, 0.5, 0.5, 0.5]
    cap = Rule("cap", When((Test("number", above=1.5),)), (Window(Change(to=0.25)),))
    assert sizes(ruled([cap], (heating(), still()), (4.0, 4))) == [1.0, 1.0] + [0.25] * 8


def test_stop_ends_the_run_and_says_why():
    enough = Rule("enough", When((Test("body.T", above=315.0),)), (Stop("hot"),))
    tried = ruled([enough], (heating(), still()), (8.0, 8))
    assert sizes(tried) == [1.0, 1.0]
    assert tried[-1].after.control.stop == "rule 'enough': hot"


def test_failures_are_heard_before_the_window_is_halved():
    """The thermal half takes .3 s at most: after the second failure its steps are split instead."""
    thermal = heating(h_max=0.3)
    rule = Rule("split", When((Test("failures", above=1.5),)), (Substeps("thermal", Change(to=4.0, most=64)),))
    tried = ruled([rule], (thermal, still()), (2.0, 2))
    assert [(round(w.H, 9), w.accepted) for w in tried] == [
        (1.0, False), (0.5, False), (0.25, True), (0.25, True), (0.5, True), (1.0, True)]
    assert [len(w.fired) for w in tried] == [0, 1, 0, 0, 0, 0]
    assert tried[1].fired[0].values == {"failures": 2.0}


def test_a_status_tells_which_half_failed_and_how_far_to_go_back():
    rule = Rule("far back", When((Test("mechanical.status", above=0.5),)), (Retry(0.1),))
    tried = ruled([rule], (heating(), still(h_max=0.1)), (1.0, 1))
    assert [round(w.H, 9) for w in tried[:2]] == [1.0, 0.1]
    other = replace(rule, when=When((Test("thermal.status", above=0.5),)))
    tried = ruled([other], (heating(), still(h_max=0.5)), (1.0, 1))
    assert [round(w.H, 9) for w in tried[:2]] == [1.0, 0.5]


def test_rules_that_do_not_ask_for_failures_do_not_see_them():
    rule = Rule("r", When((Test("t", above=-1.0),)), (Stop("x"),))
    assert not fire_failed([rule], Memory(), {"t": 0.0, "window": 1.0, "failures": 1.0}, PLAIN).log


def test_the_strain_rate_of_a_half_that_tells_increments_only():
    rule = Rule("r", When((Test("mechanical.max_strain_rate", above=0.0),)), (Stop("x"),))
    settings = replace(PLAIN, substeps={"thermal": 1, "mechanical": 4})
    fired = fire([rule], Memory(), {"t": 2.0, "window": 2.0, "mechanical.max_strain_increment": 1e-3}, settings)
    assert fired.log[0].values == {"mechanical.max_strain_rate": pytest.approx(2e-3)}
    assert rules.wanted([rule]) == ("mechanical.max_strain_increment", "mechanical.max_strain_rate")


def test_memory_crosses_a_checkpoint():
    memory = Memory({"r": Past(2, 1, (3, 0))}, {"t": 1.0, "a": math.inf},
                    {"d": Driven(1.5, 0.2, 0.1, (0.1,), (0.2,), (1.0,))})
    assert decode(encode(memory), kinds_of([Memory])) == memory


def test_without_rules_nothing_is_asked_for():
    assert rules.wanted([]) == ()
    assert np.isclose(sum(sizes(ruled([], (heating(), still()), (2.0, 2)))), 2.0)


def test_a_drive_goes_back_with_its_window():
    drive = Drive("thermal", "load.lamp", "thermal.max_dT", 1.0, 1.0, 1e-3, 1e3, log=True, gain=1.0)
    once = Rule("soft", When((Test("number", above=2.5),)), (Retry(0.5),), once=True)
    tried = ruled([Rule("hold", drive=drive), once], (heating(), still()), (4.0, 4))
    back = next(i for i, w in enumerate(tried) if not w.accepted)
    assert tried[back].after.control.rules.drives == tried[back - 1].after.control.rules.drives
    assert tried[back].after.control.settings == tried[back - 1].after.control.settings
    assert [f.driving for w in tried for f in w.fired if f.rule == "hold"]
