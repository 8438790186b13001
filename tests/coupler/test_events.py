"""Contact events on small halves: found where they are, at little cost, and each of them once."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from coupler.control.contact_status import (
    SLIPPING,
    ContactState,
    PairNodes,
    changed,
    contact_status,
    pair_nodes_of,
    root,
)
from coupler.control.events import NEXT, WORDS
from coupler.control.loop import Plan, Tried, windows
from coupler.control.plan import Locate
from coupler.fmu.half import Advance, Block, Status
from coupler.scenario.options import Scheme, WindowRange
from coupler.schemes.levels import Level
from coupler.schemes.schedule import schedule
from coupler.schemes.state import wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
from closing_rod import closing_rod
from coupled_run import start
from fake_halves import T_IN, T_OUT, X_IN, X_OUT, FakeHalf, blocks_of

D13 = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))["D13"]
TIP = PairNodes("tip", np.array([0]), np.inf)
OUTPUTS = blocks_of(T_IN, X_OUT, *(Block(f"contact.{n}", (1,), u, "output", "Real") for n, u in (
    ("t_N", "Pa"), ("gap", "m"))))


def solved(halves, state, plan: Plan) -> list[Tried]:
    return list(windows(wanted_outputs(*halves), state, plan))


def plan(end: float, size: float, scheme: Scheme = Scheme.EXTRAPOLATED, kinks: tuple[float, ...] = (),
         tolerance: float = 0.0) -> Plan:
    return Plan(schedule(end, [WindowRange(end, size, size)], kinks), scheme, {"thermal": 1, "mechanical": 1},
                locate=Locate(True, tolerance, (TIP,)))


def events(tried: list[Tried]) -> list[tuple[str, float]]:
    return [(w.event, w.t + w.H) for w in tried if w.accepted and w.event]


@pytest.mark.few("Scheme.EXTRAPOLATED")
@pytest.mark.parametrize("scheme", [Scheme.STAGGERED, Scheme.EXTRAPOLATED, Scheme.ITERATED])
def test_a_rod_that_grows_into_a_wall_touches_it_when_it_must(scheme):
    """D13, windows of 1 s."""
    halves, state = closing_rod()
    tried = solved(halves, state, plan(60.0, 1.0, scheme))
    (text, t), = events(tried)
    assert text == "pair tip closes"
    assert t == pytest.approx(D13["t_touch"], abs=D13["event_tolerance"])
    assert sum(not w.accepted for w in tried) <= D13["extra_solve_pairs"]
    assert sum(w.accepted for w in tried) == 61
    assert tried[-1].solved.state.events == 1
    first = next(w for w in tried if w.t == t and w.accepted)
    assert not first.after.state.past[1:], "histories begin anew at the event"


def moving(gap) -> tuple[tuple[FakeHalf, FakeHalf], object]:
    """Halves of a gap that is a function of time; what overlaps presses with 1e9 Pa/m; T stands still."""

    def told(t: float) -> dict[str, np.ndarray]:
        g = gap(t)
        return {"x": np.array([[0.0, g]]), "contact.t_N": np.array([min(1e9 * g, 0.0)]),
                "contact.gap": np.array([max(g, 0.0)])}

    still = FakeHalf("still", blocks_of(T_OUT, X_IN), lambda s, i, t, h: (s, {"T": s}), np.array([300.0]))
    moves = FakeHalf("moves", OUTPUTS, lambda s, i, t, h: (s, told(t + h)), np.zeros(1))
    first = start(300.0, 0.0, 0.0)
    out = told(0.0)
    return (still, moves), replace(first, now=replace(first.now, x=out["x"], t_N=out["contact.t_N"],
                                                      gap=out["contact.gap"]))


MOTIONS = {  # gap [m], when it closes and opens [s], tries put back at most
    "even": (lambda t: 1e-3 - 1e-4 * t, [10.0], 0),
    "ever faster": (lambda t: 1e-3 - 5e-7 * t**3, [2000.0 ** (1.0 / 3.0)], 3),
    "ever slower": (lambda t: 1e-3 * (np.exp(-t / 9.0) - 0.3), [-9.0 * np.log(0.3)], 2),
    "to and fro": (lambda t: 1e-3 * np.cos(2.0 * np.pi * t / 30.0), [7.5, 22.5, 37.5], 7),
    "with a bend nobody knows of": (lambda t: 1e-3 - 1e-4 * t if t < 12.5 else 2e-4 * (t - 12.5) - 2.5e-4,
                                    [10.0, 13.75], 3),
    "with a jump nobody knows of": (lambda t: 1e-3 if t < 8.123 else -1e-6, [8.123], 20),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_events_of_a_motion_are_found_once_each(name: str):
    gap, times, most = MOTIONS[name]
    tried = solved(*moving(gap), plan(40.0, 1.3))
    found = events(tried)
    assert [text for text, _ in found] == [f"pair tip {w}" for w, _ in zip(
        ("closes", "opens", "closes"), times, strict=False)]
    assert np.array([t for _, t in found]) == pytest.approx(np.array(times), abs=2e-6)
    assert all(t > at for (_, t), at in zip(found, times, strict=True)), "windows end behind their events"
    assert sum(not w.accepted for w in tried) <= most
    assert tried[-1].solved.state.events == len(times)


@dataclass
class Faint(FakeHalf):
    """What holds a body up to 1 ms after the start is lost in rounding: it can solve no step that ends before."""

    def advance(self, t, h, inputs, outputs):
        if t + h < 1e-3:
            return Advance(Status.DISCARD, "nothing holds the body", {}, 0.0)
        return super().advance(t, h, inputs, outputs)


@pytest.mark.parametrize("scheme", [Scheme.EXTRAPOLATED, Scheme.ITERATED])
def test_what_a_load_brings_about_however_small_it_is_happens_soon(scheme):
    """A body has no weight at the start, and lies on its support at any time after: the search ends where a half can
    solve, and the run goes on.
    """
    (still, moves), state = moving(lambda t: 1e-3 if t == 0.0 else -1e-6 * t)
    faint = Faint(moves.name, moves.blocks, moves.rule, moves.state)
    tried = solved((still, faint), state, plan(40.0, 1.3, scheme))
    found = events(tried)
    assert found[0][0] == "pair tip closes"
    assert 1e-3 <= found[0][1] <= 0.02
    assert len(found) == 1
    assert sum(not w.accepted for w in tried) <= 10
    assert tried[-1].t + tried[-1].H == pytest.approx(40.0)


def test_a_tolerance_that_is_asked_for_is_all_that_is_found():
    tried = solved(*moving(MOTIONS["with a jump nobody knows of"][0]), plan(40.0, 1.3, tolerance=0.1))
    (_, t), = events(tried)
    assert 0.0 < t - 8.123 <= 0.1
    assert sum(not w.accepted for w in tried) <= 5


def test_an_event_that_is_met_within_round_off_is_told():
    """Gaps up to 1e-9 m are round-off here, 1e-5 s before the touch: nothing is left, and nothing presses yet."""
    place = replace(TIP, touch=1e-9)
    coarse = replace(plan(20.0, 1.3), locate=Locate(True, 0.0, (place,)))
    tried = solved(*moving(lambda t: 1e-4 * (10.0 - t) - 1e-10 * (t - 10.0) ** 2), coarse)
    (text, t), = events(tried)
    assert text == "pair tip closes"
    assert t == pytest.approx(10.0, abs=2e-5)
    assert tried[-1].solved.state.events == 1


@pytest.mark.parametrize("late", [0.0, -1e-13, 0.01, -0.01])
def test_what_happens_at_a_kink_is_not_cut_again(late: float):
    """A kink at 10 s in the schedule; the touch is there, or a hundredth of a window beside it."""
    tried = solved(*moving(lambda t: 1e-4 * (10.0 + late - t)), plan(20.0, 1.0, kinks=(10.0,)))
    assert all(w.accepted for w in tried)
    assert [w.t + w.H for w in tried] == pytest.approx(np.arange(1.0, 21.0))


def test_a_touch_well_before_a_kink_is_found():
    tried = solved(*moving(lambda t: 1e-4 * (9.9 - t)), plan(20.0, 1.0, kinks=(10.0,)))
    assert events(tried)[0][1] == pytest.approx(9.9, abs=1e-6)


def test_what_flutters_from_window_to_window_is_told_and_not_cut():
    """A half that closes and opens by turns, however short its steps: only its first turn is looked for."""

    def rule(s, i, t, h):
        p = 1000.0 - s
        return p, {"x": np.zeros((1, 2)), "contact.t_N": -p, "contact.gap": np.where(p > 0.0, 0.0, 1e-6)}

    (still, _), state = moving(lambda t: 1e-6)
    flutters = FakeHalf("flutters", OUTPUTS, rule, np.zeros(1))
    tried = solved((still, flutters), state, plan(40.0, 1.0))
    assert sum(not w.accepted for w in tried) <= 14
    assert sum(w.accepted for w in tried) == 41
    assert {w.event for w in tried[-2:]} == {"pair tip closes again within one window",
                                             "pair tip opens again within one window"}


def test_without_pairs_and_without_events_windows_are_the_schedules():
    (halves, state), off = moving(MOTIONS["to and fro"][0]), plan(40.0, 2.0)
    tried = solved(halves, state, replace(off, locate=Locate()))
    assert [w.H for w in tried] == pytest.approx([2.0] * 20)
    assert tried[-1].solved.state.events == 0


def rubbing(slips) -> tuple[tuple[FakeHalf, FakeHalf], object]:
    """Halves in touch from the start, of four points of which `slips(t)` slip."""
    (still, moves), state = moving(lambda t: -1e-6)
    rule = moves.rule
    moves.rule = lambda s, i, t, h: (s, {**rule(s, i, t, h)[1], "contact.touching": np.array(4.0),
                                         "contact.slipping": np.array(float(slips(t + h)))})
    moves.blocks = {**moves.blocks, **blocks_of(Block("contact.touching", (), "1", "output", "Real"),
                                                Block("contact.slipping", (), "1", "output", "Real"))}
    return (still, moves), state


def test_slipping_begins_and_ends_and_nothing_tells_when():
    halves, state = rubbing(lambda t: 4 if 8.123 < t < 20.77 else 0)
    tried = list(windows(wanted_outputs(*halves, (SLIPPING,)), state, plan(40.0, 1.3)))
    (slips, t_1), (sticks, t_2) = events(tried)
    assert (slips, sticks) == ("contact slips", "contact sticks")
    assert 0.0 < t_1 - 8.123 <= 1.3 / 16
    assert 0.0 < t_2 - 20.77 <= 1.3 / 16
    assert sum(not w.accepted for w in tried) <= 10


def test_slipping_that_begins_with_a_kink_is_not_cut():
    halves, state = rubbing(lambda t: 4 if t > 10.0 else 0)
    tried = list(windows(wanted_outputs(*halves, (SLIPPING,)), state, plan(20.0, 1.0, kinks=(10.0,))))
    assert all(w.accepted for w in tried)


def test_what_touches_from_the_start_closes_there():
    tried = solved(*moving(lambda t: -1e-4 * t), replace(plan(20.0, 1.0), locate=Locate(True, 0.0, (
        replace(TIP, touch=1e-14),))))
    assert all(w.accepted for w in tried)


def level(t_N: list[float], gap: list[float], covered: list[float]) -> Level:
    n = len(t_N)
    return Level(1.0, np.zeros(1), np.zeros((n, 2)), np.array(t_N), np.array(gap), np.array(covered))


def test_what_is_seen_of_pairs():
    nodes = (PairNodes("a", np.array([0, 1]), 0.1), PairNodes("b", np.array([2, 3]), 0.1, floor=5.0))
    now = contact_status(nodes, level([0.0, -3.0, -4.0, 0.0], [0.0, 0.0, 0.02, 0.1], [1.0, 0.5, 1.0, 0.0]), {})
    assert now.status == (ContactState.CLOSED, ContactState.OPEN, ContactState.APART)
    # A pressure at the floor is none, a node that faces nothing has no gap.
    assert now.margins == ((3.0, 1.5), (0.02,), ())
    slips = contact_status(nodes, level([0.0] * 4, [0.1] * 4, [0.0] * 4),
                           {"touching": 4.0, "mechanical.contact.slipping": 4.0})
    assert slips.status == (ContactState.OPEN, ContactState.OPEN, ContactState.SLIPS)
    assert slips.margins[:2] == ((), ())
    assert changed(now, slips) == [0], "friction that begins with touch is no event of its own"
    part = contact_status(nodes, level([0.0] * 4, [0.1] * 4, [0.0] * 4),
                           {"touching": 4.0, "mechanical.contact.slipping": 1.0})
    assert changed(slips, part) == [2]


def test_a_node_of_two_pairs_tells_of_each_by_itself():
    nodes = np.arange(18, dtype=float).reshape(9, 2)
    edges = {n: np.array(e, dtype=np.int32) for n, e in (
        ("wall", [[0, 1]]), ("base", [[1, 2]]), ("can wall", [[3, 4]]), ("can base", [[5, 6]]))}
    none = np.empty((0, 4), dtype=np.int32)
    pairs = (Pair("wall", "wall", "can wall", 0.1, 1e9), Pair("base", "base", "can base", 0.1, 0.0))
    wall, base = pair_nodes_of(Interface("plane", nodes, none, none[:, :3], none[:, 0], none[:, 0], (), (), edges,
                                     pairs=pairs))
    assert wall.nodes.tolist() == [0, 1, 2, 3]
    assert base.nodes.tolist() == [4, 5, 6, 7]
    assert (wall.floor, base.floor) == (pytest.approx(1e9 * 1e-13 * 16.0), 0.0)


def test_where_something_will_reach_zero():
    t = np.array([0.0, 1.0, 2.0, 3.0])
    line = root(t[:2], 5.0 - t[:2])
    assert line is not None
    assert (line.t, line.doubt) == (pytest.approx(5.0), pytest.approx(0.4))
    # t = 5 - 2 v - .1 v^2 + .002 v^3: a cubic in what is left, so four values give its zero.
    left = np.array([3.0, 2.0, 1.0, 0.5])
    cubic = root(5.0 - 2.0 * left - 0.1 * left**2 + 0.002 * left**3, left)
    assert cubic is not None
    assert cubic.t == pytest.approx(5.0, abs=1e-12)
    assert 0.0 < cubic.doubt < 0.1
    assert root(t, [1.0, 2.0, 3.0, 4.0]) is None
    assert root(t, [3.0, 2.0, 1.0, 0.0]) is None
    rose = root(t, [9.0, 1.0, 4.0, 3.0])
    assert rose is not None
    assert rose.t == pytest.approx(6.0), "what was before it rose does not count"


@pytest.mark.parametrize("state", list(ContactState))
def test_whatever_changes_next_has_words(state):
    """A pair with friction that is apart may be due to change too."""
    assert WORDS[NEXT[state]]
