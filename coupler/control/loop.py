"""Control: window after window until the end; every try is told with its verdict and its reason."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from coupler.control import auto, error_estimate, events, flutter, own_growth, spare, unannounced
from coupler.control.accept import Attempt, Decision, accept, reads_of, rejected, skipped
from coupler.control.error_estimate import Estimate
from coupler.control.gain import Gain
from coupler.control.instability import answer
from coupler.control.plan import Plan
from coupler.control.solve_window import SavedStates, SolveOptions, can_halve, doubled, keep, solve_once
from coupler.control.state import Committed, ControlState, first, monitors, opened
from coupler.rules.engine import Firing
from coupler.scenario.options import Adaptive, OnMax, Scheme, Seen
from coupler.schemes.state import CoupledState, Halves, Settings, Solved, Span, Verdict
from coupler.trust.in_time.errors import Looked
from coupler.trust.in_time.instants import Acted
from coupler.trust.in_time.stability import Mended
from coupler.trust.in_time.time_shift import Turning, turning

# Where the next window ends, before it has been solved, and why there.

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


def _in_one(halves: Halves, state: CoupledState, span: Span, options: SolveOptions, saved: SavedStates,
            solved: Solved) -> Solved:
    """A window that was solved in one, as it is to be held against its two halves (spare.as_whole)."""
    late = spare.as_whole(state, solved.scheme, span.clock.seconds(span.k1) - span.clock.seconds(span.k0))
    if late is None:
        return solved
    saved.roll_back("a window is to be solved with the heat that its halves deliver")
    again = solve_once(halves, late, span, replace(options, scheme=solved.scheme, instead=keep), saved)
    # fault: the solve it takes to know an error is not told -> return again if again.taken else solved |
    #   coupler/test_estimate::test_heat_that_comes_late_is_no_error_of_every_window
    return replace(again if again.taken else solved, work=solved.work.plus(again.work))


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
        k1, reason = must, f"{control.reason}; ends at {t:.9g} s"
    elif rest < 2.0 * wanted:
        k1, reason = k0 + (rest + 1) // 2, f"{control.reason}; two equal windows to meet {t:.9g} s"
    # fault: a window put back is stretched to its old size again -> if False: | coupler/test_control
    if control.below and k1 >= control.below:
        k1 = max(k0 + int(min(wanted, (control.below - k0) / 2.0)), k0 + 1)
    return Proposal(k1, reason)


def _followed(plan: Plan, at: Committed, proposal: Proposal) -> Proposal:
    """The window, ended before one surface passes another unseen (coupler.trust.surfaces.ways)."""
    if plan.adaptive is None or plan.ways is None:
        return proposal
    clock, k0 = plan.schedule.clock, at.control.tick
    t0, t1 = clock.seconds(k0), clock.seconds(proposal.k1)
    # fault: windows outrun the motion of bodies -> end = t1 | coupler/test_trust_ways
    end = plan.ways.longest(at.state.now.x, t0, t1, at.control.course)
    if end >= t1:
        return proposal
    k1 = k0 + max(int(_ticks(plan, max(end - t0, plan.adaptive.least))), 1)
    return Proposal(min(k1, proposal.k1), "no surface is to pass another unseen")


def _ticks(plan: Plan, seconds: float) -> float:
    """Ticks of a time, not rounded; inf stays."""
    return seconds / plan.schedule.clock.seconds(plan.last) * plan.last


__all__ = ["Plan", "Tried", "finished", "step", "windows"]


@dataclass(frozen=True)
class Tried:
    """One window tried: its number (of those taken), its times [s], what came of it, what it cost, what was noticed.

    before : what control remembered at its start.  after : all the coupler remembers then, whether the window stands
    or not.  reason : why it had this size and scheme, in words; why it does not stand is the message of `solved`.
    error : where it is known.  event : what happens at its end, or inside where it was put back for it.
    fired : the rules that fired.  looked : what was seen of the probes, of a window that stands.
    mended : what is done about an exchange that rings in it, for which it was put back.
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
    looked: Looked | None = None
    mended: Mended | None = None

    @property
    def accepted(self) -> bool:
        """Whether the run goes on from its end."""
        return self.solved.taken

    @property
    def forced(self) -> float:
        """Its error in tolerances, of a window taken although that is too large; inf: although it did not converge."""
        if not self.solved.anyway:
            return 0.0
        # fault: a window that did not converge counts as one a little off -> return 1.0 | coupler/test_trust
        return self.error.error if self.error is not None and self.solved.verdict is Verdict.ERROR else math.inf

    @property
    def reads(self) -> tuple[float, ...]:
        """The parts of it at which the thermal half read places and gaps, as it was kept."""
        return reads_of(self.solved, self.span, self.before.settings.iteration.level)

    @property
    def acted(self) -> Acted:
        """What rules did at its end, of a window that stands."""
        late = {f.rule: f.passed for f in self.fired if f.passed is not None}
        return Acted(self.t + self.H, self.H, self.before.rules.last, self.after.control.rules.last, late,
                     bool(self.event))

    @property
    def monitors(self) -> dict[str, float]:
        """What rules look at, but for the probes (coupler.control.state)."""
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


# What is asked of a window that stands, as long as it can be solved again: of it, of what was seen of its probes, and
# whether the run ends with it.
AskedAgain = Callable[[spare.Window, Looked, bool], None]


def step(halves: Halves, at: Committed, plan: Plan, ask: AskedAgain | None = None) -> Tried:
    """One try.  If the window does not stand both halves are as before it.  Raises CouplingError.

    ask : leaves both halves as they are.
    """
    at = opened(at, plan)
    started = time.perf_counter()
    span, reason = _span(at, plan)
    t0 = span.clock.seconds(span.k0)
    options, why = _options(halves, plan, at, span)
    control = at.control
    with SavedStates(halves, t0, control.number + 1) as saved:
        solved = solve_once(halves, at.state, span, options, saved)
        error, in_one = _carried(at, plan, span, solved), np.empty(0)
        skips = solved.taken and skipped(Attempt(plan, at, span, solved), 1)[0] < 1.0
        # fault: windows are put back for errors that nobody measured -> measured = error is None |
        #   coupler/test_defaults
        measured = error is None or error.error > 1.0 or skips
        # fault: a window of one tick is halved -> measured = measured and plan.adaptive is not None and solved.taken |
        #   coupler/test_control
        measured = measured and plan.adaptive is not None and solved.taken and can_halve(span)
        # Two halves that skip as much are not worth their solves.
        if measured and skipped(Attempt(plan, at, span, solved), 2)[0] >= 1.0:
            solved = _in_one(halves, at.state, span, options, saved, solved)
            in_one = plan.watched(solved.state.now)
            solved = doubled(halves, at.state, span, options, saved, solved)
            error = _estimated(at, plan, solved)
        if not solved.taken:
            saved.roll_back(solved.message)
        verdict = accept(Attempt(plan, at, span, solved, error))
        # fault: halves not put back where a window is judged not to stand -> if False: | coupler/test_control
        if solved.taken and not verdict.solved.taken:
            saved.roll_back(verdict.solved.message)
        after, looked, mended = verdict.control, None, None
        if verdict.solved.taken:
            after, looked, known = _looked(_Taken(halves, at, plan, span, options, saved), verdict, in_one)
            follows = None if known is None else answer(Attempt(plan, at, span, solved, error), known)
            if known is not None and follows is not None and follows.control is not None:
                saved.roll_back(follows.text)
                # What the window told of the probes goes with it: it is looked at again where its turn was.
                memory = replace(control.spare, for_gain=after.spare.for_gain, spent=after.spare.spent, turned=True,
                                 gains=after.spare.gains)
                verdict = Decision(rejected(solved, Verdict.UNSTABLE, follows.text), follows.control,
                                   error=verdict.error)
                mended = Mended(follows.text, known.m, after.spare.rough - spare.ON_END, looked.solves)
                after, looked = replace(follows.control, spare=memory), None
            if follows is not None:
                verdict = replace(verdict, notes=(*verdict.notes, follows.text))
        if ask is not None and looked is not None:
            ask(spare.Window(at.state, span, options, saved, solved), looked,
                finished(Committed(solved.state, after), plan))
    after = _joined(after, at, plan, halves, verdict.solved)
    state = solved.state if verdict.solved.taken else at.state
    return Tried(control.number, t0, span.end - t0, verdict.solved, time.perf_counter() - started,
                 Committed(state, after), control, span,
                 (*verdict.notes, *after.flutter.notes[len(control.flutter.notes):]),
                 "; ".join(r for r in (reason, why) if r), verdict.error, verdict.event, verdict.fired,
                 looked, mended)


def _joined(control: ControlState, at: Committed, plan: Plan, halves: Halves, solved: Solved) -> ControlState:
    """Control after a try: laws of pairs that flutter are joined from here on, as at an event.

    at : before it.
    """
    t, joins = plan.schedule.clock.seconds(control.tick), flutter.JOIN in halves.thermal.blocks
    memory, settings = control.flutter, control.settings
    if solved.taken:
        turned = flutter.turned_by(t, at.control.events.due, control.events.turned)
        memory, settings = flutter.after(memory, settings, plan.torn, plan.names, turned, joins)
    elif solved.verdict is Verdict.MAX_ITERATIONS:
        # fault: listed windows are halved for ever at a law that jumps -> blind = False | coupler/test_flutter
        blind = not plan.locate.on and control.failures >= flutter.HALVED
        near = plan.torn.near(at.state.now) if blind else ()
        memory, settings = flutter.stuck(memory, settings, plan.torn, t, joins, near)
    if settings is not control.settings:
        control = replace(control, settings=settings, event=control.tick)
    return replace(control, flutter=memory)


def _carried(at: Committed, plan: Plan, span: Span, solved: Solved) -> Estimate | None:
    """The error of a window solved in one, carried on from windows before; None where it has to be measured.

    One above its tolerance is measured, too, before it puts the window back: it may be a kink that only the change of
    solving in one and in two makes.
    """
    if plan.adaptive is None or not solved.taken or error_estimate.wanted(
            at.control.estimate, at.state, span, solved.scheme, solved.state.now, plan.pairs):
        return None
    return _estimated(at, plan, solved)


def _estimated(at: Committed, plan: Plan, solved: Solved) -> Estimate | None:
    """The error of a window, as far as it is known."""
    if plan.adaptive is None or not solved.taken:
        return None
    return error_estimate.estimate(at.control.estimate, at.state, solved, plan.adaptive.tolerance,
                                   at.control.settings.iteration, plan.cells)


@dataclass(frozen=True)
class _Taken:
    """A window that stands, before it is left.  saved : the states of both halves at its start."""

    halves: Halves
    at: Committed
    plan: Plan
    span: Span
    options: SolveOptions
    saved: SavedStates


def _looked(window: _Taken, verdict: Decision, in_one: NDArray[np.float64]) -> tuple[ControlState, Looked, Gain | None]:
    """Control after a window with what was seen of the probes, which may take a spare solve.

    in_one : (n,) the probes at the end of the window solved in one, where its two halves are kept; else empty.
    The gain of the window, where it was measured.
    """
    plan, control, solved = window.plan, verdict.control, verdict.solved
    work = solved.work
    by_itself = _ends_by_itself(plan, window.options.settings.iteration.level, solved)
    memory, seen = spare.after(control.spare, solved.state.now.t, plan.watched(solved.state.now),
                               work.thermal_solves + work.mechanical_solves,
                               unannounced.gap_closes(window.at.state.now, solved.state.now) and not by_itself)
    seen = replace(seen, by_itself=by_itself)
    # fault: no window is followed for how it shifts the run -> pass | coupler/test_time_shift
    seen = replace(seen, turning=_turning(window, solved))
    taken = spare.Window(window.at.state, window.span, window.options, window.saved, solved)
    number, level = window.at.control.number, window.options.settings.iteration.level
    at_end = finished(Committed(solved.state, control), plan)
    if solved.whole is not None and in_one.size:
        kept, whole = (spare.factors(window.at.state, solved, level, plan, kept_in_halves=h) for h in (True, False))
        seen = replace(seen, error=spare.difference(seen.values, in_one, kept),
                       in_one=spare.difference(seen.values, in_one, whole),
                       shift=spare.shift_of(window.at.state, solved.whole, solved, level, kept_in_halves=True))
    elif spare.can_look(window.halves, window.span) and spare.wanted(
            memory, seen, number, plan, last=at_end):
        seen = spare.look(window.halves, taken, plan, seen)
        memory = spare.spent(memory, seen, number)
    # fault: steady states are taken for ones that last -> if False: | coupler/test_own_growth
    if plan.steady_T and at_end and spare.can_look(window.halves, window.span):
        grows = own_growth.growth(window.halves, window.at.state, window.span, window.saved, solved)
        seen = replace(seen, growth=grows, solves=seen.solves + own_growth.SOLVES)
    known = None
    if spare.asks_gain(memory, seen, number, taken, plan) and spare.can_look(window.halves, window.span):
        known = spare.gain_of(window.halves, taken)
        memory = spare.after_gain(memory, known)
    if known is not None:
        seen = replace(seen, m=known.m, limit=known.limit, solves=seen.solves + known.solves)
    return replace(control, spare=memory), seen, known


def _ends_by_itself(plan: Plan, level: Seen, solved: Solved) -> bool:
    """Whether what a window came to depends on nothing that was inside it: nothing remembers, and it was iterated.

    level : of the thermal half's input.  Heat that mechanics make, and strain of bodies that remember, are of the way.
    """
    remembers = (solved.state.now.elastic_strain is not None
                 or any(account.made != 0.0 for account in solved.state.accounts.values()))
    # fault: contact that closes within a window of steady temperatures makes it wrong -> return False |
    #   coupler/test_steady_level
    return plan.steady_T and solved.scheme is Scheme.ITERATED and level is Seen.END and not remembers


def _turning(window: _Taken, solved: Solved) -> Turning | None:
    """How a window turns the velocity of the temperatures; None where data change, which no shift of time obeys."""
    if not window.plan.steady_data:
        return None
    return turning((solved.state.now, window.at.state.now, *window.at.state.past), solved.scheme.value)


def _span(at: Committed, plan: Plan) -> tuple[Span, str]:
    """The window to try, ended where an event is expected; and why it is so long."""
    control = at.control
    proposal = _followed(plan, at, propose(plan, control))
    span = Span(plan.schedule.clock, control.tick, proposal.k1, control.settings.substeps)
    if not plan.locate.on or control.failures:
        return span, proposal.reason
    tick = events.expected(control.events, at.state, span, plan, control.settings.scheme)
    # fault: no try ends where an event is expected -> if True: | coupler/test_events
    if tick is None or not span.k0 < tick < span.k1:
        return span, proposal.reason
    return replace(span, k1=tick), "to end where an event is expected"


def _lenient(plan: Plan, control: ControlState) -> Settings:
    """The settings of a try.

    Where half the window does not make the iterates agree either (two equilibria with friction, by turns) the estimate
    of the error judges it, what the iterates leave included.
    """
    settings = control.settings
    if plan.adaptive is None or not control.unconverged or settings.iteration.on_max is not OnMax.RETRY_SMALLER:
        return settings
    # fault: what no window makes agree is cut to the least -> return settings | coupler/test_two_equilibria
    return replace(settings, iteration=settings.iteration.model_copy(update={"on_max": OnMax.ACCEPT}))


def _options(halves: Halves, plan: Plan, at: Committed, span: Span) -> tuple[SolveOptions, str]:
    """By which scheme and how, and why where that was chosen."""
    settings = _lenient(plan, at.control)
    if not auto.chooses(settings.scheme):
        return SolveOptions(settings.scheme, settings), ""
    freezes = auto.can_freeze(halves, settings.substeps)
    H = span.end - span.clock.seconds(span.k0)
    choice = auto.choose(at.control.choice, at.state, H, freezes, weighs=plan.adaptive is not None,
                         breaks=span.k1 == plan.must_end(span.k0))
    if choice.loose:
        settings = replace(settings, iteration=auto.loosened(settings.iteration, choice.loose))
    instead = partial(auto.instead, freezes=freezes, seen=settings.iteration.level)
    return (SolveOptions(choice.scheme, settings, choice.extrapolation, instead),
            f"{choice.scheme.value}: {choice.reason}")
