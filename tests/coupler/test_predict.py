"""How long a window may be: b and the damping from short windows, the limits from them, a pilot along a run."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import pytest

from coupler.control.plan import Plan
from coupler.control.window_size import Feedback, feedback, limits
from coupler.running.pilot import Prediction, along
from coupler.scenario.options import Scheme, WindowRange
from coupler.schemes.schedule import schedule
from coupler.schemes.state import Span, wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "stability"))
from cases import CASES, chatter, e3c_limit, nudged
from coupled_run import start
from fake_halves import A_LAG, B_LAG, gap_of, lumped, shrinking

EXPECTED = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))
E4 = EXPECTED["E4"]
# Within 2 % where a closed form exists.
CLOSE = 0.02


def seen(halves, state, H: float) -> Feedback:
    plan = schedule(H, [WindowRange(H, H, H)], [])
    return feedback(wanted_outputs(*halves), state, Span(plan.clock, *plan.bounds[:2], {"thermal": 1, "mechanical": 1}))


@pytest.mark.parametrize(("method", "theta"), [("midpoint", 0.5), ("backward_euler", 1.0)])
@pytest.mark.parametrize("H", [0.5, 20.0])
def test_b_and_damping_of_the_lumped_gap_at_rest(method, theta, H):
    thermal, mechanical = lumped(E4["T"], method), shrinking(E4["T"])
    found = seen((thermal, mechanical), start(E4["T"], gap_of(E4["T"])), H)
    assert found.b == pytest.approx(B_LAG, rel=1e-4)
    assert found.damping == pytest.approx(theta * A_LAG, rel=1e-3)
    assert limits(found, method).staggered == pytest.approx(E4["dt_c"][method], rel=CLOSE)
    # Nothing of the looks is left in the halves.
    assert (thermal.state[0], mechanical.state[0, 1]) == (E4["T"], gap_of(E4["T"]))


def test_limits_from_closed_forms():
    found = limits(Feedback(0.0, B_LAG, A_LAG / 2), "midpoint")
    assert (found.staggered, found.extrapolated) == (pytest.approx(2 / B_LAG), pytest.approx(1 / B_LAG))
    assert found.plain == pytest.approx(2 / (B_LAG - A_LAG))
    found = limits(Feedback(0.0, B_LAG, A_LAG), "backward_euler")
    assert found.staggered == pytest.approx(2 / (B_LAG - A_LAG))
    assert found.extrapolated == pytest.approx(2 / (2 * B_LAG - A_LAG))
    assert found.plain == pytest.approx(2 / (B_LAG - 2 * A_LAG))
    assert limits(Feedback(0.0, 0.1, 0.2), "backward_euler").staggered == float("inf")
    assert limits(Feedback(0.0, -1.0, 0.2), "midpoint").staggered == float("inf")


def test_of_a_rod_the_midpoint_limit_is_met_and_that_of_backward_euler_is_not_passed():
    unit = CASES["E3c"].unit
    middle = limits(seen(*chatter(0.0, "midpoint"), 0.1 * unit), "midpoint").staggered
    assert middle == pytest.approx(e3c_limit("midpoint"), rel=CLOSE)
    end = limits(seen(*chatter(0.0), unit), "backward_euler").staggered
    assert 0.8 < end / e3c_limit("backward_euler") < 1.0


def test_what_drives_itself_on_has_a_negative_b():
    assert seen(*nudged(1e-6), 0.1).b < -5.0


def test_a_pilot_tells_where_windows_must_be_shortest():
    """E4 from 840 K: the gap is narrowest there, so b is largest."""
    bounds = schedule(200.0, [WindowRange(200.0, 1.0, 40.0)], [])
    plan = Plan(bounds, Scheme.ITERATED, {"thermal": 1, "mechanical": 1})
    found = along(wanted_outputs(lumped(840.0), shrinking(840.0)), start(840.0, gap_of(840.0)), plan, "midpoint")
    b = [f.b for f in found.feedbacks]
    assert found.strictest is not None
    assert found.strictest.t == found.feedbacks[0].t == pytest.approx(1.0, rel=0.2)
    assert b[0] > 1.2 * b[-1]
    assert b[-1] == pytest.approx(B_LAG, rel=1e-3)
    assert f"at t = 200 s: staggered up to {2 / B_LAG:.2g} s, extrapolated up to {1 / B_LAG:.2g} s" in found.summary
    assert found.pairs > 12 * len(b)
    assert Prediction((Feedback(0.0, 0.0, 0.0),), "midpoint", 0).summary.startswith("no window is too long")
