"""Control: window after window until the end; every try is told with its verdict and its reason."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

from coupler.control import auto, estimate, events
from coupler.control.attempt import Kept, Way, solve_once
from coupler.control.cutting import Facts
from coupler.control.doubling import doubled
from coupler.control.estimate import Estimate
from coupler.control.judge import judged
from coupler.control.monitors import monitors
from coupler.control.plan import Plan
from coupler.control.proposal import propose
from coupler.control.state import Committed, ControlState, first, opened
from coupler.rules.engine import Firing
from coupler.scenario.options import Scheme
from coupler.schemes.adiabatic import can_freeze
from coupler.schemes.window import CoupledState, Halves, Solved, Span

__all__ = ["Plan", "Tried", "finished", "step", "windows"]


@dataclass(frozen=True)
class Tried:
    """One window tried: its number (of those taken), its times [s], what came of it, what it cost, what was noticed.

    before : what control remembered at its start.  after : all the coupler remembers then, whether the window stands
    or not.  reason : why it had this size and scheme, in words; why it does not stand is the message of `solved`.
    error : where it is known.  event : what happens at its end, or inside where it was put back for it.
    fired : the rules that fired.
    """

    number: int
    t: float
    H: float
    solved: Solved
    seconds: float
    after: Committed
    before: ControlState
    span: Span
    notes: tuple[str, ...] = ()
    reason: str = ""
    error: Estimate | None = None
    event: str = ""
    fired: tuple[Firing, ...] = ()

    @property
    def accepted(self) -> bool:
        """Whether the run goes on from its end."""
        return self.solved.taken

    @property
    def monitors(self) -> dict[str, float]:
        """What rules look at, but for the probes (coupler.control.monitors)."""
        return monitors(self.before, self.span, self.solved, self.error)


def windows(halves: Halves, state: CoupledState, plan: Plan) -> Iterator[Tried]:
    """Solve window after window; both halves are put back before a window that failed is tried again.

    Raises CouplingError when a window cannot be solved however small, or a half keeps no states.
    """
    at = first(state, plan)
    while not finished(at, plan):
        tried = step(halves, at, plan)
        yield tried
        at = tried.after


def finished(at: Committed, plan: Plan) -> bool:
    """Whether there is nothing left to do."""
    return at.control.tick >= plan.last or bool(at.control.stop)


def step(halves: Halves, at: Committed, plan: Plan) -> Tried:
    """One try.  If the window does not stand both halves are as before it.  Raises CouplingError."""
    at = opened(at, plan)
    started = time.perf_counter()
    span, reason = _span(at, plan)
    t0 = span.clock.seconds(span.k0)
    way, why = _way(halves, at, span.end - t0)
    control = at.control
    with Kept(halves, t0, control.number + 1) as kept:
        solved = solve_once(halves, at.state, span, way, kept)
        if solved.taken and plan.adaptive is not None and estimate.wanted(
                control.estimate, at.state, span, way.scheme, solved.state.now):
            solved = doubled(halves, at.state, span, way, (kept, solved))
        if not solved.taken:
            kept.put_back(solved.message)
        verdict = judged(Facts(plan, at, span, solved))
        # fault: halves not put back where a window is judged not to stand -> if False: | coupler/test_control
        if solved.taken and not verdict.solved.taken:
            kept.put_back(verdict.solved.message)
    state = solved.state if verdict.solved.taken else at.state
    return Tried(control.number, t0, span.end - t0, verdict.solved, time.perf_counter() - started,
                 Committed(state, verdict.control), control, span, verdict.notes,
                 "; ".join(r for r in (reason, why) if r), verdict.error, verdict.event, verdict.fired)


def _span(at: Committed, plan: Plan) -> tuple[Span, str]:
    """The window to try, ended where an event is expected; and why it is so long."""
    control = at.control
    proposal = propose(plan, control)
    span = Span(plan.schedule.clock, control.tick, proposal.k1, control.settings.substeps)
    if not plan.locate.on or control.failures:
        return span, proposal.reason
    tick = events.expected(control.events, at.state, span, plan, control.settings.scheme)
    # fault: no try ends where an event is expected -> if True: | coupler/test_events
    if tick is None or not span.k0 < tick < span.k1:
        return span, proposal.reason
    return replace(span, k1=tick), "to end where an event is expected"


def _way(halves: Halves, at: Committed, H: float) -> tuple[Way, str]:
    """By which scheme, and why where that was chosen."""
    settings = at.control.settings
    if settings.scheme is not Scheme.AUTO:
        return Way(settings.scheme, settings), ""
    freezes = can_freeze(halves.thermal, halves.mechanical, settings.substeps)
    choice = auto.choose(at.control.choice, at.state, H, freezes)
    if choice.loose:
        settings = replace(settings, iteration=auto.loosened(settings.iteration, choice.loose))
    way = Way(choice.scheme, settings, choice.curve, may_run_away=True, may_freeze=freezes)
    return way, f"{choice.scheme.value}: {choice.reason}"
