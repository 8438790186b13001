"""Where the next window ends, before it has been solved, and why there."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

from coupler.control.plan import Plan
from coupler.control.state import ControlState
from coupler.scenario.options import Adaptive

# A rest shorter than this share of a window is joined to it; a longer one makes two equal windows of both.
REST = 1.0 / 3.0


@dataclass(frozen=True)
class Proposal:
    """k1 : the tick at which the window ends.  reason : in words; "" where it is the window of the schedule."""

    k1: int
    reason: str = ""


def propose(plan: Plan, control: ControlState) -> Proposal:
    """The next window.  It never passes a kink nor the end of the run."""
    if control.aim > control.tick:
        return Proposal(min(control.aim, plan.must_end(control.tick)), "to end at the event")
    return _scheduled(plan, control) if plan.adaptive is None else _adaptive(plan, plan.adaptive, control)


def _scheduled(plan: Plan, control: ControlState) -> Proposal:
    """The window of the schedule; a piece of it where that was cut; longer or shorter where settings say so."""
    if control.ends:
        return Proposal(control.ends[-1], "a piece of a window that was cut")
    bounds, k0, must = plan.schedule.bounds, control.tick, plan.must_end(control.tick)
    i = bisect_right(bounds, k0)
    k1, planned, reason = bounds[i], bounds[i] - bounds[i - 1], ""
    if bounds[i - 1] != k0:
        reason = "on to the schedule"
        if k1 < must and k1 - k0 < REST * planned:
            k1 = bounds[i + 1]
    settings = control.settings
    if settings.window_factor == 1.0 and settings.window_cap == math.inf:
        return Proposal(k1, reason)
    limit = min(planned * settings.window_factor, _ticks(plan, settings.window_cap))
    longest = bounds[bisect_right(bounds, int(min(k0 + limit, must))) - 1]
    k1 = max(k1, longest)
    pieces = math.ceil((k1 - k0) / max(limit, 1.0) * (1.0 - 1e-9))
    return Proposal(max(k0 + (k1 - k0) // max(pieces, 1), k0 + 1), "as settings of the run say")


def _adaptive(plan: Plan, limits: Adaptive, control: ControlState) -> Proposal:
    """The size that was found; stretched by less than a third, or two equal ones, to meet a time that must be met."""
    k0, must = control.tick, plan.must_end(control.tick)
    most = min(limits.most, control.settings.window_cap)
    size = min(max(control.size * control.settings.window_factor, limits.least), most)
    wanted, rest, t = max(_ticks(plan, size), 1.0), must - k0, plan.schedule.clock.seconds(must)
    k1, reason = k0 + int(wanted), control.reason
    # fault: a rest longer than the window makes two short ones -> if rest <= wanted and rest <= _ticks(plan, most) *
    #   (1.0 + 1e-9): | coupler/test_control
    if rest <= wanted * (1.0 + REST) and rest <= _ticks(plan, most) * (1.0 + 1e-9):
        k1, reason = must, f"{control.reason}; to end at {t:.9g} s"
    elif rest < 2.0 * wanted:
        k1, reason = k0 + (rest + 1) // 2, f"{control.reason}; two equal ones to {t:.9g} s"
    # fault: a window put back is stretched to its old size again -> if False: | coupler/test_control
    if control.below and k1 >= control.below:
        k1 = max(k0 + int(min(wanted, (control.below - k0) / 2.0)), k0 + 1)
    return Proposal(k1, reason)


def _ticks(plan: Plan, seconds: float) -> float:
    """Ticks of a time, not rounded; inf stays."""
    return seconds / plan.schedule.clock.seconds(plan.last) * plan.last
