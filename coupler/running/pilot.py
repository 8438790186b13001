"""A pilot run: the scenario in a few long windows, iterated, and how long a window may be at the start of each.

What limits a window changes along a run: a melt has no gap to feed back, the gas beside a skin that just froze has the
steepest law, a touching pair is stiffer still.  So a look at the start alone would tell nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from coupler.control.loop import windows
from coupler.control.plan import Plan
from coupler.control.window_limits import TURNS, Feedback, Limits, feedback, limits
from coupler.fmu.launch import launch
from coupler.running.setup import first_state, halves_of, plan_of
from coupler.scenario import Scenario
from coupler.scenario.options import Scheme, Tolerance, Tolerances, WindowRange
from coupler.schemes.state import CoupledState, Halves, Span, schedule
from coupler.schemes.sweep import DiscardError

# First and last window of the pilot as parts of the run: 19 windows and those that kinks cut.
FIRST, LAST = 1 / 200, 1 / 5
# The feedback is looked at in this part of the pilot's window.
LOOK, LOOK_PAIRS = 1 / 16, 4 * TURNS
# Iterates of the pilot agree to a hundredth of what changes: it is only to pass through the states of the run.
ROUGHLY = 0.01
# The thermal half of which a pilot takes no time: one unknown a body.  A rod that melts takes a minute.
QUICK = "lumped"


@dataclass(frozen=True)
class Prediction:
    """seen : the feedback along the pilot.  method : of the thermal half.  pairs : solves of each half it cost."""

    seen: tuple[Feedback, ...]
    method: str
    pairs: int

    @property
    def strictest(self) -> tuple[Feedback, Limits] | None:
        """Where the shortest window is needed; None where no window is too long."""
        told = [(f, limits(f, self.method)) for f in self.seen]
        least = min(told, key=lambda pair: pair[1].extrapolated, default=None)
        return least if least is not None and math.isfinite(least[1].extrapolated) else None

    @property
    def words(self) -> str:
        """A sentence."""
        if self.strictest is None:
            return "no window is too long for a scheme that solves each half once"
        worst, most = self.strictest
        last = limits(self.seen[-1], self.method)
        return (f"shortest at t = {worst.t:.3g} s: staggered {_size(most.staggered)}, "
                f"extrapolated {_size(most.extrapolated)}; at t = {self.seen[-1].t:.3g} s: "
                f"staggered {_size(last.staggered)}, extrapolated {_size(last.extrapolated)}")


def _size(seconds: float) -> str:
    return f"up to {seconds:.2g} s" if math.isfinite(seconds) else "any"


def is_quick(scenario: Scenario) -> bool:
    """Whether a pilot of the scenario takes hardly any time."""
    return scenario.thermal_half.endswith(QUICK)


def pilot(scenario: Scenario) -> Prediction:
    """Run the pilot.  Raises CouplingError where it cannot be solved, HalfError where a half cannot be built."""
    plan = plan_of(scenario)
    end, c = scenario.coupling.end, scenario.coupling
    coarse = schedule(end, [WindowRange(end, end * FIRST, end * LAST)], c.kinks, c.bends)
    t = plan.iteration.tolerance
    how = replace(plan.iteration, tolerance=Tolerances(*(
        Tolerance(q.atol, ROUGHLY) for q in (t.temperature, t.gap, t.pressure, t.solid_fraction))))
    plan = Plan(coarse, Scheme.ITERATED, plan.substeps, how)
    with launch(scenario, processes=False) as launched:
        halves = halves_of(launched.thermal, launched.mechanical, plan, scenario.interface)
        state = first_state(launched, halves, scenario.interface, end)
        return along(halves, state, plan, _method(scenario))


def along(halves: Halves, state: CoupledState, plan: Plan, method: str) -> Prediction:
    """The pilot of two halves.  plan : of its windows.  method : of the thermal half."""
    seen: list[Feedback] = []
    pairs = 0
    for tried in windows(halves, state, plan):
        pairs += tried.solved.work.thermal_solves
        if tried.accepted:
            k1 = tried.span.k1
            look = k1, k1 + max(int((k1 - tried.span.k0) * LOOK), 1)
            found = _looked(halves, tried.solved.state, Span(plan.schedule.clock, *look, plan.substeps))
            pairs += LOOK_PAIRS * len(found)
            seen += found
    return Prediction(tuple(seen), method, pairs)


def _looked(halves: Halves, state: CoupledState, span: Span) -> tuple[Feedback, ...]:
    """What is seen of a window; nothing where a half cannot do it: the next look may."""
    try:
        return (feedback(halves, replace(state, past=()), span),)
    except DiscardError:
        return ()


def _method(scenario: Scenario) -> str:
    resolved = scenario.resolved.get("thermal", {})
    return str(resolved.get("method", "midpoint")) if isinstance(resolved, Mapping) else "midpoint"
