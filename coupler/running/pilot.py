"""Runs a pilot: the scenario in a few long windows, iterated, to predict how long a stable window may be.

What limits a window changes along a run: a melt has no gap to feed back, the gas beside a skin that just froze has the
steepest law, a touching pair is stiffer still.  So the start alone tells nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from coupler.control.loop import windows
from coupler.control.plan import Plan
from coupler.control.window_size import TURNS, Feedback, WindowLimits, feedback, limits
from coupler.fmu.launch import launch
from coupler.running.setup import first_state, halves_of, plan_of
from coupler.scenario import Scenario
from coupler.scenario.options import Scheme, WindowRange
from coupler.schemes.mapped import joined
from coupler.schemes.schedule import schedule
from coupler.schemes.state import CoupledState, Halves, Span
from coupler.schemes.sweep import DiscardError

# First and last window of the pilot as parts of the run: 19 windows and those cut at breakpoints.
FIRST, LAST = 1 / 200, 1 / 5
# The feedback is measured in this part of the pilot's window; so many solves of each half.
PROBED, PROBE_PAIRS = 1 / 16, 4 * TURNS
# Relative tolerance of the pilot's iterates: it only has to pass through the states of the run.
ROUGHLY = 0.01
# The thermal half whose pilot takes next to no time: one unknown a body.  A rod that melts takes a minute.
QUICK = "lumped"


@dataclass(frozen=True)
class StrictestLimit:
    """t : time [s].  limits : of windows there."""

    t: float
    limits: WindowLimits


@dataclass(frozen=True)
class Prediction:
    """The prediction of a pilot.

    feedbacks : of the mechanical on the thermal half, along the pilot.  method : of the thermal half.
    pairs : solves of each half that it cost.
    """

    feedbacks: tuple[Feedback, ...]
    method: str
    pairs: int

    @property
    def strictest(self) -> StrictestLimit | None:
        """Where the shortest window is needed; None where no window is too long."""
        along_run = [StrictestLimit(f.t, limits(f, self.method)) for f in self.feedbacks]
        least = min(along_run, key=lambda at: at.limits.extrapolated, default=None)
        return least if least is not None and math.isfinite(least.limits.extrapolated) else None

    @property
    def summary(self) -> str:
        """A sentence."""
        strictest = self.strictest
        if strictest is None:
            return "no window is too long for a scheme that solves each half once"
        last = limits(self.feedbacks[-1], self.method)
        return (f"shortest at t = {strictest.t:.3g} s: staggered {_size(strictest.limits.staggered)}, "
                f"extrapolated {_size(strictest.limits.extrapolated)}; at t = {self.feedbacks[-1].t:.3g} s: "
                f"staggered {_size(last.staggered)}, extrapolated {_size(last.extrapolated)}")


def _size(seconds: float) -> str:
    return f"up to {seconds:.2g} s" if math.isfinite(seconds) else "any"


def is_quick(scenario: Scenario) -> bool:
    """Return whether a pilot of the scenario takes next to no time."""
    return scenario.thermal_half.endswith(QUICK)


def pilot(scenario: Scenario) -> Prediction:
    """Run the pilot.  Raises CouplingError where it cannot be solved, HalfError where a half cannot be built."""
    plan = plan_of(scenario)
    end, c = scenario.coupling.end, scenario.coupling
    coarse = schedule(end, [WindowRange(end, end * FIRST, end * LAST)], c.kinks, c.bends)
    tolerance = plan.iteration.tolerance
    rough = {name: q.changed(rtol=ROUGHLY) for name, q in tolerance}
    how = plan.iteration.changed(tolerance=tolerance.changed(**rough))
    plan = Plan(coarse, Scheme.ITERATED, plan.substeps, how)
    with launch(scenario, processes=False, join=joined) as launched:
        halves = halves_of(launched.thermal, launched.mechanical, plan, scenario.interface)
        state = first_state(launched, halves, scenario.interface, end)
        return along(halves, state, plan, _method(scenario))


def along(halves: Halves, state: CoupledState, plan: Plan, method: str) -> Prediction:
    """Run the pilot of two halves.  plan : of its windows.  method : of the thermal half."""
    feedbacks: list[Feedback] = []
    pairs = 0
    for tried in windows(halves, state, plan):
        pairs += tried.solved.work.thermal_solves
        if tried.accepted:
            k1 = tried.span.k1
            end = k1 + max(int((k1 - tried.span.k0) * PROBED), 1)
            here = _feedback_at(halves, tried.solved.state, Span(plan.schedule.clock, k1, end, plan.substeps))
            pairs += PROBE_PAIRS * len(here)
            feedbacks += here
    return Prediction(tuple(feedbacks), method, pairs)


def _feedback_at(halves: Halves, state: CoupledState, span: Span) -> tuple[Feedback, ...]:
    """Measure the feedback in a window; nothing where a half discards it: the next one may do."""
    try:
        return (feedback(halves, replace(state, past=()), span),)
    except DiscardError:
        return ()


def _method(scenario: Scenario) -> str:
    resolved = scenario.resolved.get("thermal", {})
    return str(resolved.get("method", "midpoint")) if isinstance(resolved, Mapping) else "midpoint"
