"""The trust table: what each check measures, on levels made by hand, and what a user sees of it."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from coupler import Results
from coupler.control.loop import Tried
from coupler.schemes.levels import Level
from coupler.schemes.state import Verdict
from coupler.trust.checks import Check, TrustVerdict, broken, measured
from coupler.trust.in_time.errors import NAME as ESTIMATED
from coupler.trust.in_time.errors import Looked
from coupler.trust.surfaces.passing import Sides
from coupler.trust.table.log import TrustLog
from coupler.trust.table.watch import TrustWatch

ROOT = Path(__file__).resolve().parents[2]


def boxes(gap: float = 0.1) -> Interface:
    """A square of 1 m, and above its middle one of 0.5 m."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    nodes = np.vstack([square, 0.5 * square + [0.25, 1.0 + gap]])
    return Interface(geometry="plane", nodes=nodes, quads=np.array([[0, 1, 2, 3], [4, 5, 6, 7]]),
                     triangles=np.empty((0, 3), dtype=int), quad_body=np.array([0, 1]),
                     triangle_body=np.empty(0, dtype=int), bodies=("low", "high"), materials=("m", "m"),
                     surfaces={"low.top": np.array([[2, 3]]), "high.bottom": np.array([[4, 5]])},
                     pairs=(Pair("face", "high.bottom", "low.top", 0.5, 1e9),))


def level(t: float, T: float | list[float] = 300.0, *, x: np.ndarray | None = None, gap: float = 0.1) -> Level:
    nodes = boxes().nodes
    return Level(t, np.broadcast_to(np.asarray(T, dtype=float), (8,)).copy(), nodes if x is None else x, np.zeros(4),
                 np.full(4, gap), np.zeros(4))


def judged(levels: list[Level], boundary: tuple[dict, ...] = (), terms: dict | None = None, fresh: tuple[int, ...] = (),
           half: str = "elastic", inputs: dict | None = None, pairs: dict | None = None) -> dict[str, Check]:
    """The table of a run by its levels, check by name.  terms : heat of each window [J]; None: some is stored.

    inputs : of the thermal half.  pairs : of the mechanical half's model.
    """
    terms = {"heat.stored.low": 1.0, "heat.convection": 1.0} if terms is None else terms
    watch = TrustWatch(boxes(), {"thermal": {"boundary": boundary},
                                 "mechanical": {"half": half, "pairs": pairs or {}}})
    log = watch.begun(levels[0])
    for k in range(1, len(levels)):
        log = watch.after(log, (levels[k - 1], levels[k]), terms, fresh=k in fresh,
                          inputs=inputs or {})
    return {c.name: c for c in watch.judged(log, terms)}


WITHIN, RINGS, CYCLES = "temperatures within their data", "no ringing in time", "no cycle of the exchange"
PASSES, SOFT = "no body passes through another", "penetration of pressed surfaces"
WAYS = "surfaces pass each other in time"


@pytest.mark.parametrize(("slight", "verdict"), [(0.0, "broken"), (1e-5, "broken"), (2.4e-5, "noted"), (0.02, "holds")])
def test_errors_that_harm_nobody_break_no_run(slight: float, verdict: str) -> None:
    """A run that went on from the end of another stood still but for 34 uK, of which 23 might be wrong: exit 4."""
    watch = TrustWatch(boxes(), {"thermal": {"boundary": ()}, "mechanical": {"half": "elastic"}}, {"T": "K"},
                       slight={"K": slight})
    log, T = watch.begun(level(0.0), np.array([400.0])), np.array([400.0 + 3.4e-5])
    seen = Looked(T, np.array([3.4e-5]), np.array([2.3e-5]))
    log = watch.after(log, (level(0.0), level(1.0)), {}, fresh=False, looked=seen)
    check = next(c for c in watch.judged(log, {}) if c.name == ESTIMATED)
    assert check.verdict == verdict


# Temperatures

@pytest.mark.parametrize(("lowest", "verdict"), [(300.0, "holds"), (299.99, "noted"), (290.0, "broken")])
def test_undershoot_is_measured_in_the_span_of_the_data(lowest, verdict):
    wall = ({"on": "low.bottom", "temperature": 800.0},)
    check = judged([level(0.0), level(1.0, [lowest, *[400.0] * 7])], wall)[WITHIN]
    assert check.verdict == verdict
    if verdict != "holds":
        assert check.number == pytest.approx((300.0 - lowest) / 500.0)
        assert "low at (0, 0) m" in check.sentence
        assert "below" in check.sentence


@pytest.mark.parametrize("of", [1.0, 1e-4, 1e-6])
def test_small_differences_are_held_against_their_own_span(of):
    """800 K and 300 K, or 300.0005 K and 300 K."""
    wall = ({"on": "low.bottom", "temperature": 300.0 + of * 500.0},)
    check = judged([level(0.0), level(1.0, [300.0 - of, *[300.0 + of * 100.0] * 7])], wall)[WITHIN]
    assert (check.verdict, check.number) == ("broken", pytest.approx(2e-3, rel=1e-4))


def test_what_numbers_leave_is_not_out_of_bounds():
    check = judged([level(0.0), level(1.0, [300.0 - 2e-11, *[300.0] * 7])])[WITHIN]
    assert (check.verdict, check.number) == ("holds", 0.0)


def test_data_count_up_to_now_and_on_both_sides_of_a_jump():
    jump = ({"on": "low.bottom", "temperature": {"t": [5.0, 5.0], "value": [300.0, 800.0]}},)
    early = judged([level(0.0), level(1.0, 310.0)], jump)[WITHIN]
    assert early.verdict == "broken"
    assert judged([level(0.0), level(5.0, 310.0)], jump)[WITHIN].verdict == "holds"
    film = ({"on": "low.bottom", "convection": {"h": 1.0, "T": {"terms": [{"t": 300.0}, {"x": {
        "at": [0.0, 1.0], "value": [0.0, 50.0]}}]}}},)
    assert judged([level(0.0), level(1.0, 349.0)], film)[WITHIN].verdict == "holds"
    assert judged([level(0.0), level(1.0, 351.0)], film)[WITHIN].verdict == "broken"


def test_a_temperature_that_a_rule_scales_is_a_datum():
    wall = ({"on": "low.bottom", "temperature": 400.0, "name": "wall"},)
    hot = [level(0.0), level(1.0, 500.0)]
    assert judged(hot, wall)[WITHIN].verdict == "broken"
    assert judged(hot, wall, inputs={"load.wall": 1.25})[WITHIN].verdict == "holds"
    assert judged([level(0.0), level(1.0, 260.0)], wall, inputs={"load.wall": 0.625})[WITHIN].verdict == "holds"
    assert judged([level(0.0), level(1.0, 240.0)], wall, inputs={"load.wall": 0.625})[WITHIN].verdict == "broken"


def test_a_polynomial_over_place_is_bounded_inside_too():
    # 300 + 400 x (1 - x) is 300 at both ends and 400 in the middle of the square.
    hump = ({"on": "low.top", "temperature": {"terms": [{"x": {"polynomial": [300.0, 400.0, -400.0]}}]}},)
    assert judged([level(0.0), level(1.0, 399.9)], hump)[WITHIN].verdict == "holds"
    assert judged([level(0.0), level(1.0, 401.0)], hump)[WITHIN].verdict == "broken"


def test_the_bound_that_was_left_is_told_as_it_was_then():
    rise = ({"on": "low.bottom", "temperature": {"t": [0.0, 10.0], "value": [300.0, 800.0]}},)
    check = judged([level(0.0), level(1.0, 400.0), level(10.0, 700.0)], rise)[WITHIN]
    assert check.t == 1.0
    assert "50 K above the highest of its data so far, 350 K" in check.sentence


def test_nothing_is_colder_than_0_kelvin():
    check = judged([level(0.0), level(1.0, -5.0)], terms={"heat.entropy": 1.0})[WITHIN]
    assert check.verdict == "broken"


# Rhythm

def test_a_node_that_rings_is_told_and_one_that_settles_is_not():
    ringing = [level(float(k), [300.0 + 20.0 * (-1) ** k, 400.0, *[350.0] * 6]) for k in range(8)]
    check = judged(ringing)[RINGS]
    assert check.verdict == "broken"
    assert check.number == pytest.approx(40.0 / 120.0)
    dying = [level(float(k), [300.0 + 50.0 * (-0.2) ** k, 400.0, *[350.0] * 6]) for k in range(8)]
    assert judged(dying)[RINGS].verdict == "holds"
    # A kink of the data begins anew: what the data drive is no ringing.
    assert judged(ringing, fresh=(3, 6))[RINGS].verdict == "holds"


@pytest.mark.parametrize("period", [3, 4, 7])
def test_a_cycle_of_a_few_windows_is_told(period):
    courses = [level(float(k), 350.0 + 30.0 * np.sin(2 * np.pi * k / period)) for k in range(3 * period + 4)]
    check = judged(courses)[CYCLES]
    assert check.verdict == "broken"
    assert f"every {period} windows" in check.sentence


@pytest.mark.parametrize("of", [1.0, 1e-4, 1e-6])
def test_small_differences_of_temperature_ring_and_cycle_like_large_ones(of):
    ringing = [level(float(k), [350.0 + of * 20.0 * (-1) ** k, 350.0 + of * 100.0, *[350.0] * 6]) for k in range(8)]
    check = judged(ringing)[RINGS]
    assert (check.verdict, check.number) == ("broken", pytest.approx(40.0 / 120.0, rel=1e-5))
    cycle = [level(float(k), 350.0 + of * 30.0 * np.sin(2 * np.pi * k / 4)) for k in range(16)]
    assert judged(cycle)[CYCLES].verdict == "broken"


def test_an_oscillation_that_windows_resolve_is_physics():
    slow = [level(float(k), 350.0 + 30.0 * np.sin(2 * np.pi * k / 16)) for k in range(60)]
    found = judged(slow)
    assert found[CYCLES].verdict == "holds"
    assert found[RINGS].verdict == "holds"


# Passing

def lowered(by: float) -> np.ndarray:
    x = boxes().nodes.copy()
    x[4:, 1] -= by
    return x


def test_a_body_inside_another_or_across_it_is_told():
    inside = judged([level(0.0), level(1.0, x=lowered(0.5), gap=0.5)])[PASSES]
    assert inside.verdict == "broken"
    assert inside.number == pytest.approx(0.8)  # the middle of its bottom, 0.4 m below the top; edges of 0.5 m
    assert judged([level(0.0), level(1.0, x=lowered(0.5), gap=-0.4)])[PASSES].verdict == "holds"  # told as penetration
    across = judged([level(0.0), level(1.0, x=lowered(2.5), gap=0.5)])[PASSES]
    assert across.verdict == "broken"
    assert "across" in across.sentence


def test_a_body_inside_another_along_its_edges_is_told():
    """As wide as the other: its nodes run down the other's sides, and the middle of its bottom goes in."""
    wide = lowered(0.0)
    wide[4:, 0] = 2.0 * (wide[4:, 0] - 0.25)
    for by, how in ((0.6, "inside"), (2.5, "across")):
        x = wide.copy()
        x[4:, 1] -= by
        found = judged([level(0.0, x=wide, gap=0.5), level(1.0, x=x, gap=0.5)])[PASSES]
        assert found.verdict == "broken"
        assert how in found.sentence
    assert "high at (0.5, 1.1) m" in found.sentence
    flush = wide.copy()
    flush[4:, 0] += 1.0
    aside = flush.copy()
    aside[4:, 1] -= 2.5
    assert judged([level(0.0, x=flush, gap=0.5), level(1.0, x=aside, gap=0.5)])[PASSES].verdict == "holds"
    pressed = wide.copy()
    pressed[4:, 1] -= 0.101
    assert judged([level(0.0, x=wide, gap=0.5), level(1.0, x=pressed, gap=-0.001)])[PASSES].verdict == "holds"


def test_a_node_that_goes_across_is_seen_beside_one_that_is_pressed():
    turned = lowered(2.5)
    turned[[4, 7], 1] = boxes().nodes[[4, 7], 1] - 0.101  # its left side is pressed in by 1 mm, its right goes across
    log = [level(0.0), level(1.0, x=turned)]
    gaps = np.full(4, 0.5)
    gaps[list(boxes().contact_nodes).index(4)] = -0.001
    found = judged([log[0], replace(log[1], gap=gaps)])[PASSES]
    assert found.verdict == "broken"
    assert "across" in found.sentence
    assert found.limit == 0.1


def test_bodies_that_move_together_or_pass_by_do_not_pass_through():
    together = boxes().nodes + [3.0, 3.0]
    assert judged([level(0.0), level(1.0, x=together)])[PASSES].verdict == "holds"
    beside = boxes().nodes.copy()
    beside[4:] += [1.5, 0.0]
    aside = beside.copy()
    aside[4:, 1] -= 2.5
    assert judged([level(0.0), level(1.0, x=beside), level(2.0, x=aside)])[PASSES].verdict == "holds"


def test_what_overlaps_as_drawn_is_no_news():
    drawn = level(0.0, x=lowered(0.3), gap=0.5)
    log = Sides(boxes()).begun(drawn)
    assert log.drawn["face"] == pytest.approx(0.4)
    assert judged([drawn, replace(drawn, t=1.0)])[PASSES].verdict == "holds"


def test_a_soft_penalty_is_told():
    found = judged([level(0.0), level(1.0, x=lowered(0.12), gap=-0.02)])[SOFT]
    assert found.verdict == "noted"
    assert found.number == pytest.approx(0.04)
    assert judged([level(0.0), level(1.0, x=lowered(0.3), gap=-0.2)])[SOFT].verdict == "broken"


def test_nobody_is_told_to_set_what_is_set():
    levels = [level(0.0), level(1.0, x=lowered(0.12), gap=-0.02)]
    assert "augmented: {}" in judged(levels)[SOFT].remedy
    assert judged(levels, pairs={"face": {"augmented": {}}})[SOFT].remedy == judged(levels)[SOFT].remedy
    assert "augmented: {}" not in judged(levels, pairs={"face": {"augmented": {"tolerance": 1e-3}}})[SOFT].remedy


# The table

def test_broken_checks_are_told_first_and_survive_a_file():
    rows = [measured("a", 0.5, (0.1, 1.0), what="half", remedy="less"),
            measured("b", 0.0, (0.1, 1.0), what="", remedy=""),
            measured("c", 2.0, (0.1, 1.0), what="too much", remedy="less", t=3.0)]
    assert [c.verdict for c in rows] == ["noted", "holds", "broken"]
    assert [c.name for c in broken(rows)] == ["c"]
    assert [Check.of(c.as_dict()) for c in rows] == rows
    assert Check.of({**rows[0].as_dict(), "new": 1}).verdict is TrustVerdict.NOTED


def test_the_log_goes_into_a_checkpoint():
    from contact.codec import decode, encode, kinds_of

    watch = TrustWatch(boxes(), {"thermal": {}, "mechanical": {"half": "elastic"}})
    log = watch.begun(level(0.0))
    for k in range(1, 6):
        log = watch.after(log, (level(k - 1.0, 300.0 + k), level(float(k), 301.0 + k)), {}, fresh=False, forced=1.5)
    again = decode(encode(log), kinds_of((TrustLog,)))
    assert encode(again) == encode(log)
    assert again.forced == 5


TO_TOLERANCE = "windows solved to their tolerance"


@pytest.mark.parametrize(("forced", "verdict"), [
    ({}, "holds"), ({3: 1.5}, "noted"), ({3: 1.5, 9: 1.6}, "broken"), ({3: math.inf}, "broken")])
def test_errors_of_windows_add_up(forced, verdict):
    """Of thirty windows, each of which may be off by one tolerance."""
    watch = TrustWatch(boxes(), {"thermal": {}, "mechanical": {"half": "elastic"}})
    log = watch.begun(level(0.0))
    for k in range(1, 31):
        log = watch.after(log, (level(k - 1.0, 300.0 + k), level(float(k), 301.0 + k)), {}, fresh=False,
                          forced=forced.get(k, 0.0))
    check = {c.name: c for c in watch.judged(log, {})}[TO_TOLERANCE]
    assert check.verdict.value == verdict
    assert f"{len(forced)} of 30 windows" in check.what or not forced


@pytest.mark.parametrize(("solved", "error", "told"), [
    (Verdict.ERROR, 1.5, 1.5), (Verdict.ACCEPTED, 0.5, 0.0), (Verdict.MAX_ITERATIONS, None, math.inf),
    (Verdict.MAX_ITERATIONS, 0.1, math.inf)])
def test_what_a_window_was_taken_in_spite_of(solved, error, told):
    window = SimpleNamespace(
        solved=SimpleNamespace(anyway=solved is not Verdict.ACCEPTED, verdict=solved),
        error=None if error is None else SimpleNamespace(error=error))
    assert Tried.forced.fget(window) == told


# What a user sees

LEAP = """\
slideline: 2
title: A leap
units: {temperature: K}
geometry: plane
materials: {m: {rho: 1000, c: 1000, k: 10}}
bodies:
  low: {mesh: {rectangle: {origin: [0, 0], size: [1, 1], cells: [2, 2]}}, material: m, T0: 300}
  high: {mesh: {rectangle: {origin: [0, 1.1], size: [1, 1], cells: [2, 2]}}, material: m, T0: 300}
contact:
  face: {slave: high.bottom, master: low.top, gap_max: 0.5}
thermal: {half: thermal}
mechanical:
  half: rigid
  rigid: {motion: {high: {u_y: {t: [0, 10], value: [0, -3]}}}}
coupling: {scheme: staggered, end: 10, windows: [{until: 10, size: 10}]}
probes: {T: {T: {mean: low}}}
"""


def test_a_run_that_is_not_to_be_trusted_ends_with_4(tmp_path):
    (tmp_path / "leap.yaml").write_text(LEAP, encoding="utf-8")
    done = subprocess.run([sys.executable, "-m", "coupler.cli", "run", "leap.yaml", "--report"], cwd=tmp_path,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 4, done.stderr
    assert "do not trust this run: 2 of 18 checks failed" in done.stdout
    assert "no body passes through another: pair face" in done.stdout
    results = Results(tmp_path / "run.h5")
    assert results.outcome == "completed"
    assert [c.name for c in results.broken] == [PASSES, WAYS]
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "Do not trust this run." in page
    assert "Can this run be trusted?" in page
