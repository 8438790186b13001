"""Accepts or rejects a solved window: runs the checks in order and returns the next control state."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from coupler.control import auto, error_estimate, events, unannounced, window_size
from coupler.control.error_estimate import Estimate
from coupler.control.events import Found
from coupler.control.plan import Plan
from coupler.control.state import Committed, ControlState, Obstacle, failed_monitors, monitors
from coupler.control.two_cycle import CycleAction, WindowSummary, act
from coupler.errors import CouplingError
from coupler.rules import engine as rules
from coupler.rules.engine import Firing
from coupler.scenario.options import OnMax, Seen
from coupler.schemes.schemes import read_at
from coupler.schemes.state import Solved, Span, Verdict
from coupler.trust.surfaces.ways import AHEAD, SHARE

# A rejected window is tried again, shorter: by how much, and when the run stops instead.

# A window is halved at most this often before the run gives up: 2^-10 of a window a user chose is a sign of a
# problem that smaller windows do not cure.
MAX_CUTS = 10
# So many tries on end without one that stands are a loop, whoever asked for them.
MAX_TRIES = 60


@dataclass(frozen=True)
class Attempt:
    """A window that was tried.  at : before it.  error : where windows are adaptive, if it is known."""

    plan: Plan
    at: Committed
    span: Span
    solved: Solved
    error: Estimate | None = None

    @property
    def t(self) -> float:
        """Where it begins [s]."""
        return self.span.clock.seconds(self.span.k0)

    @property
    def H(self) -> float:
        """Its size [s]."""
        return self.span.end - self.t


def cut(attempt: Attempt, share: float, why: str) -> ControlState:
    """Control for the next try, `share` (< 1) of the window.  Raises CouplingError where it may not be cut again."""
    if attempt.plan.adaptive is not None:
        return shorter(attempt, share * attempt.H, why)
    control, span = attempt.at.control, attempt.span
    ends = control.ends or (span.k1,)
    if ends[-1] != span.k1:
        ends = (*ends, span.k1)
    middle = span.k0 + int((span.k1 - span.k0) * share)
    if len(ends) > MAX_CUTS or middle == span.k0:
        raise gave_up(attempt, why, f"the window was halved {len(ends) - 1} times to {attempt.H:.3g} s")
    return tried_again(attempt, replace(control, ends=(*ends, middle), aim=0), why)


def shorter(attempt: Attempt, size: float, why: str) -> ControlState:
    """Control for a next try of `size` [s].  Raises CouplingError where the window is at its least."""
    adaptive, control = attempt.plan.adaptive, attempt.at.control
    assert adaptive is not None
    if at_least(attempt):
        # fault: who may not go shorter is told to -> remedy = SMALLER | coupler/test_control
        remedy = unsolvable(attempt, attempt.solved.verdict)
        raise gave_up(attempt, why, f"the window of {attempt.H:.3g} s is at its least", remedy)
    return tried_again(attempt, replace(control, size=max(size, adaptive.least), reason=f"tried again after: {why}",
                                      below=attempt.span.k1, aim=0), why)


def at_least(attempt: Attempt) -> bool:
    """Whether an adaptive window may not be shorter."""
    adaptive = attempt.plan.adaptive
    return adaptive is not None and adaptive.least * (1.0 + 1e-6) >= attempt.H


def tried_again(attempt: Attempt, control: ControlState, why: str) -> ControlState:
    """With one more failure counted.  Raises CouplingError after too many on end."""
    if control.failures >= MAX_TRIES:
        raise gave_up(attempt, why, f"{control.failures} tries in a row were rejected")
    return replace(control, failures=control.failures + 1)


SMALLER = ("Everything up to here is in the results file. Give smaller windows (coupling.windows) "
           "or more substeps around this time, or look at the data that change here")
# Where iterates do not agree in time; without heat that is stored smaller windows are no easier.
MORE_ITERATIONS = ("Everything up to here is in the results file. Give more iterations "
                   "(coupling.iteration.max_iterations) or, where bodies store heat, smaller windows "
                   "(coupling.windows); or look at the data that change here")
# What the halves may not be able to solve in any window, by which of them gave up.
AT_LEAST = {
    Verdict.THERMAL_DISCARD: "Everything up to here is in the results file. Shorter windows do not help: look at the "
                             "heat that enters at this time. A source or friction may make heat faster than it can "
                             "leave (thermal runaway)",
    Verdict.MECHANICAL_DISCARD: "Everything up to here is in the results file. Shorter windows do not help: look at "
                                "the loads at this time. They may be more than the bodies can carry (limit load, "
                                "buckling): prescribe displacements in place of forces, or follow the motion with "
                                "inertia (mechanical.elastic.dynamics)",
}
# What moves with inertia bears any load, so where its balance is not found contact or the law of a material is why.
WITH_INERTIA = ("Everything up to here is in the results file. Shorter windows do not help: look at what happens at "
                "this time. Where a stiff body turns, `dynamics: {rho_inf: 0.8}` damps what makes it ring, and `rigid` "
                "has nothing to ring. Where a body strikes or sticks, `augmented: {}` of that pair, a smaller "
                "`penalty` or smaller cells may; or a material is strained beyond what it can bear")


def unsolvable(attempt: Attempt, verdict: Verdict) -> str | None:
    """What helps where a half can solve no window, however short; None: smaller windows may."""
    # fault: who follows a motion is told to follow it -> if False: | coupler/test_control
    if verdict is Verdict.MECHANICAL_DISCARD and attempt.plan.inertia:
        return WITH_INERTIA
    return AT_LEAST.get(verdict)


def gave_up(attempt: Attempt, why: str, how: str, remedy: str | None = None) -> CouplingError:
    """The error of a window that cannot be solved.  remedy : None: more iterations or smaller windows."""
    history = attempt.solved.history
    return CouplingError(
        f"{why}; {how}", t=attempt.t, window=attempt.at.control.number + 1,
        iteration=len(history.misfits) if history else 0,
        residuals=tuple(history.misfits[-1].values()) if history else (),
        remedy=remedy or (MORE_ITERATIONS if attempt.solved.verdict is Verdict.MAX_ITERATIONS else SMALLER))


# An adaptive window that a half gave up on is made no shorter at once than this, and shorter by at least as much.
LEAST_SHARE = 1.0 / 16.0
# What mechanics cannot get past is known once so many windows were given up on the way there, and what is left of the
# way is no more than this part of what it was at the first.
SURE, NEAR = 4, 1e-3
# A window is put back so often because a surface passed another in it; what jumps does so in windows of any size.
MAX_OUTRAN = 8
# So many windows on end in which hardly anything changes are a steady state.
SLOW = 2


@dataclass(frozen=True)
class Decision:
    """solved : with its verdict.  control : of the next try.  error, event, fired : what the checks found."""

    solved: Solved
    control: ControlState
    notes: tuple[str, ...] = ()
    error: Estimate | None = None
    event: str = ""
    fired: tuple[Firing, ...] = ()


def accept(attempt: Attempt) -> Decision:
    """Accepts or rejects a window.  Raises CouplingError where it must be tried again and may not."""
    if not attempt.solved.taken:
        return _failed(attempt)
    if (outran := _outran(attempt) or _skips(attempt)) is not None:
        return outran
    found, events_memory = _event(attempt)
    if found is not None and not found.located:
        control = replace(attempt.at.control, aim=found.tick, events=events_memory)
        return Decision(rejected(attempt.solved, Verdict.EVENT, found.text), tried_again(attempt, control, found.text),
                      event=found.text)
    solved, adaptive = attempt.solved, attempt.plan.adaptive
    if adaptive is None:
        return _ruled(attempt, _Found(None, found, events_memory))
    error = attempt.error
    if error is not None and error.error > 1.0:
        if not at_least(attempt):
            size = window_size.rejected(attempt.H, error.size, error.order)
            again = replace(shorter(attempt, size, error.words),
                            controller=window_size.failed(attempt.at.control.controller),
                            choice=auto.rejected(attempt.at.control.choice))
            return Decision(rejected(solved, Verdict.ERROR, error.words), again, error=error)
        solved = replace(solved, verdict=Verdict.ERROR, message=f"{error.words}; the window is at its least",
                         anyway=True)
        attempt = replace(attempt, solved=solved)
    # fault: a window is taken that sees nothing of what begins in it -> elif False: | coupler/test_estimate_strain
    elif error is not None and error.unseen and adaptive.first < attempt.H and not at_least(attempt):
        why = f"{error.unseen.replace('_', ' ')} bends in the second half of the window, where nothing tells its error"
        return Decision(rejected(solved, Verdict.ERROR, why), shorter(attempt, 0.5 * attempt.H, why), error=error)
    return _ruled(attempt, _Found(error, found, events_memory))


def _outran(attempt: Attempt) -> Decision | None:
    """The decision on an adaptive window in which forces carried one surface past another; None: none was.

    What a force sets off, or a blow, goes faster than it went in the window before.
    """
    plan, control = attempt.plan, attempt.at.control
    if not plan.adaptive or not plan.ways or control.failures >= MAX_OUTRAN or at_least(attempt):
        return None
    gone = plan.ways.outran(attempt.at.state.now, attempt.solved.state.now)
    if gone is None:
        return None
    why = f"pair {gone.pair}: one surface passed the other by {gone.share:.3g} times its length"
    size = attempt.H * max(SHARE * AHEAD / gone.share, LEAST_SHARE)
    return Decision(rejected(attempt.solved, Verdict.ERROR, why), shorter(attempt, size, why))


def skipped(attempt: Attempt, halves: int) -> tuple[float, str]:
    """Up to which share of an adaptive window data over place or gap are read as they are passed, and what is not.

    halves : the number of windows that it is solved as.  1.0 and "": all of it, or it is as short as a first one.
    """
    plan, solved = attempt.plan, attempt.solved
    # fault: windows skip what data over place or gap begin or end -> if True: | coupler/test_trust_skipped
    if plan.adaptive is None or plan.placed is None or plan.adaptive.first >= attempt.H or at_least(attempt):
        return 1.0, ""
    reads = reads_of(solved, attempt.span, attempt.at.control.settings.iteration.level, halves)
    return plan.placed.unmet(attempt.at.state.now, solved.state.now, reads)


def reads_of(solved: Solved, span: Span, level: Seen, halves: int = 0) -> tuple[float, ...]:
    """Return the parts of a window at which the thermal half reads places and gaps.

    level : `coupling.iteration.level`.  halves : it is solved as so many windows; 0: as it was.
    """
    return read_at(solved.scheme, level, span.substeps["thermal"], halves or (1 if solved.whole is None else 2))


def _skips(attempt: Attempt) -> Decision | None:
    """The decision on an adaptive window that skips data over place or gap; None: it does not."""
    share, what = skipped(attempt, 1 if attempt.solved.whole is None else 2)
    if share >= 1.0:
        return None
    assert attempt.plan.adaptive is not None
    why = f"{what} by more than a window of this size reads"
    size = max(attempt.H * share, attempt.plan.adaptive.first)
    return Decision(rejected(attempt.solved, Verdict.ERROR, why), shorter(attempt, size, why))


@dataclass(frozen=True)
class _Found:
    """What the checks before the rules found."""

    error: Estimate | None
    event: Found | None
    events: events.Memory


def _failed(attempt: Attempt) -> Decision:
    """A half gave up, or the iteration did: rules that look at failures are heard, then the window is cut."""
    solved, control, plan = attempt.solved, attempt.at.control, attempt.plan
    history = solved.history
    if solved.verdict is Verdict.MAX_ITERATIONS and control.settings.iteration.on_max is OnMax.STOP:
        assert history is not None
        raise CouplingError(f"{solved.message}; coupling.iteration.on_max says to stop", t=attempt.t,
                            window=control.number + 1, iteration=len(history.misfits),
                            residuals=tuple(history.misfits[-1].values()),
                            remedy="Give smaller windows, another acceleration or more iterations")
    # fault: a try that no half can solve makes the search for an event shorter still -> if False: |
    #   coupler/test_events
    if control.aim == attempt.span.k1 and solved.verdict in (Verdict.MECHANICAL_DISCARD, Verdict.THERMAL_DISCARD):
        other = events.refused(control.events, attempt.span)
        if other is not None:
            tick, memory = other
            return Decision(solved, tried_again(attempt, replace(control, aim=tick, events=memory), solved.message))
    # A rule may change what the half depends on; without one the same would be asked again.
    # fault: what no shorter window helps is asked of shorter ones -> if False: | coupler/test_steady_unsolved
    if solved.final and not plan.rules:
        raise gave_up(attempt, solved.message, "it is the same in a window of any length",
                      "Everything up to here is in the results file. Look at the data: what is steady needs a solution "
                      "with them; from a start that is nearer, or by thermal.increments, Newton's method may find it")
    if solved.verdict is Verdict.MAX_ITERATIONS:
        control = replace(control, unconverged=True)
        attempt = replace(attempt, at=replace(attempt.at, control=control))
    if not plan.rules:
        attempt = _met(attempt)
        return Decision(solved, cut(attempt, _shorter_by(attempt), solved.message))
    monitored = failed_monitors(control, attempt.span, solved)
    fired = rules.fire_failed(plan.rules, control.rules, monitored, control.settings)
    if fired.stop:
        return Decision(solved, replace(control, stop=fired.stop, settings=fired.settings, rules=fired.memory),
                      fired=fired.log)
    again = cut(attempt, fired.retry or 0.5, solved.message)
    return Decision(solved, replace(again, settings=fired.settings, rules=fired.memory), fired=fired.log)


def _shorter_by(attempt: Attempt) -> float:
    """The share of an adaptive window to try next: as far as the half says that it came, else half of it."""
    # fault: how far a half came is not heeded -> share = 0.0 | coupler/test_obstacle
    share = attempt.solved.share
    if attempt.plan.adaptive is None or not 0.0 < share < 1.0:
        return 0.5
    return min(max(share, LEAST_SHARE), 1.0 - LEAST_SHARE)


def _met(attempt: Attempt) -> Attempt:
    """The attempt with one more try counted that mechanics gave up on the way to the same time.

    Raises CouplingError where it is known well enough that none gets there.
    """
    control, solved = attempt.at.control, attempt.solved
    if attempt.plan.adaptive is None or solved.verdict is not Verdict.MECHANICAL_DISCARD:
        return attempt
    known = control.obstacle
    found = (Obstacle(attempt.t, attempt.span.end, 1) if known is None else
             Obstacle(known.first, min(known.end, attempt.span.end), known.tries + 1))
    # fault: what no window gets past is approached to the least of them -> if False: | coupler/test_obstacle
    if found.tries >= SURE and found.end - attempt.t <= NEAR * (found.end - found.first):
        raise gave_up(attempt, solved.message,
                      f"{found.tries} windows that came nearer and nearer did not get past t = {found.end:.9g} s",
                      unsolvable(attempt, Verdict.MECHANICAL_DISCARD))
    return replace(attempt, at=replace(attempt.at, control=replace(control, obstacle=found)))


def _event(attempt: Attempt) -> tuple[Found | None, events.Memory]:
    control = attempt.at.control
    if not attempt.plan.locate.on:
        return None, control.events
    # What rules look at, where they do: probes cost a look at the halves.
    seen = _seen(attempt, attempt.error) if attempt.plan.instants else {}
    return events.met(control.events, attempt.at.state.now, attempt.solved, attempt.span, attempt.plan,
                      events.Seen(seen, control.rules))


def _seen(attempt: Attempt, error: Estimate | None) -> dict[str, float]:
    """All that rules look at, at the end of a window."""
    return {**monitors(attempt.at.control, attempt.span, attempt.solved, error),
            **attempt.plan.probed(attempt.solved.state.now)}


def _ruled(attempt: Attempt, found: _Found) -> Decision:
    """The rules, then the cycle; a window that passes both is taken."""
    plan, control, solved = attempt.plan, attempt.at.control, attempt.solved
    fired = rules.Fired(control.settings, control.rules)
    if plan.rules:
        fired = rules.fire(plan.rules, control.rules, _seen(attempt, found.error), control.settings)
    if fired.retry:
        why = "; ".join(f"rule {f.rule!r}: {f.text}" for f in fired.log)
        again = replace(cut(attempt, fired.retry, why), settings=fired.settings,
                        rules=rules.retried(control.rules, fired), stop=fired.stop)
        return Decision(rejected(solved, Verdict.RULE, why), again, error=found.error, fired=fired.log)
    contraction = math.nan if solved.history is None else solved.history.contraction
    watch = control.cycle.plus(attempt.at.state.now, solved.state.now)
    if not (watch.home or watch.cycling):
        return _stands(attempt, found, fired, CycleAction(watch, fired.settings))
    summary = WindowSummary(control.number + 1, solved.state.now.t, attempt.H, not at_least(attempt), contraction)
    done = act(watch, fired.settings, plan.on_cycle, summary)
    if done.cut:
        # With the window goes what rules changed in it.
        # fault: rules: a two-cycle's cut keeps what rules changed in the window -> settings = done.settings |
        #   coupler/test_rules
        settings = act(watch, control.settings, plan.on_cycle, summary).settings
        again = replace(cut(attempt, 0.5, done.notes[0]), cycle=done.watch, settings=settings)
        return Decision(rejected(solved, Verdict.CYCLE, done.notes[0]), again, done.notes, found.error)
    return _stands(attempt, found, fired, done)


def _stands(attempt: Attempt, found: _Found, fired: rules.Fired, done: CycleAction) -> Decision:
    """The window is taken."""
    control = _sized(attempt, _taken(attempt, found, fired, done), found.error)
    return Decision(attempt.solved, control, done.notes, found.error,
                  found.event.text if found.event else "", fired.log)


def _taken(attempt: Attempt, found: _Found, fired: rules.Fired, done: CycleAction) -> ControlState:
    """Control after a window that stands."""
    plan, control, span, solved = attempt.plan, attempt.at.control, attempt.span, attempt.solved
    start = attempt.at.state
    slow = control.slow + 1 if _is_slow(attempt) else 0
    steady = f"steady: T changes by less than {plan.steady:g} K/s" if slow >= SLOW else ""
    return replace(
        control, tick=span.k1, number=control.number + 1, failures=0, aim=0, below=0, slow=slow,
        # What was iterated to no end here may be so in the next window.
        unconverged=solved.verdict is Verdict.MAX_ITERATIONS,
        obstacle=None if control.obstacle is not None and span.end >= control.obstacle.end else control.obstacle,
        # fault: histories go on over an event -> ends=tuple([e for e in control.ends if e > span.k1]),
        #   event=control.event, | coupler/test_events
        ends=tuple([e for e in control.ends if e > span.k1]), event=span.k1 if found.event else control.event,
        stop=fired.stop or steady, settings=done.settings, rules=fired.memory,
        cycle=done.watch,
        course=(plan.ways.after(control.course, start.now, solved.state.now) if plan.adaptive and plan.ways
                else control.course),
        estimate=(error_estimate.after(control.estimate, start, solved, found.error, plan.cells) if plan.adaptive
                  else control.estimate),
        choice=_learned(attempt, found.error),
        events=events.settled(found.events, start.now, solved) if plan.locate.on else found.events)


def _learned(attempt: Attempt, error: Estimate | None) -> auto.Memory:
    """What `auto` knows after a window that stands; other schemes pay nothing for it."""
    control = attempt.at.control
    if not auto.chooses(control.settings.scheme):
        return control.choice
    return auto.learn(control.choice, attempt.at.state, attempt.solved, attempt.H, control.settings.iteration.level,
                      error)


def _sized(attempt: Attempt, control: ControlState, error: Estimate | None) -> ControlState:
    """With the size of the next window."""
    adaptive = attempt.plan.adaptive
    if adaptive is None:
        return control
    limits = window_size.StepLimits(adaptive.least, adaptive.most)
    told, end = None if error is None else error.size, attempt.solved.state
    # While a front moves every window is kept in halves, which have a quarter of its error.
    if told is not None and end.past and unannounced.front_moves(end):
        # fault: windows kept in halves are as short as those kept whole -> pass | scenarios/test_casting_1d
        told *= window_size.AIM / window_size.AIM_IN_HALVES
    size, memory = window_size.proposed(control.controller, attempt.H, told, 2 if error is None else error.order,
                                        limits)
    # fault: a crumb before a kink sets the size after it -> size = max(size, 0.0) | coupler/test_control
    size = max(size, _as_planned(attempt, error))
    reason = "no error is known yet" if error is None else error.words
    return replace(control, size=size, reason=reason, controller=memory)


def _as_planned(attempt: Attempt, error: Estimate | None) -> float:
    """The size that was planned for a window made shorter to end at a kink or an event, unless its error is large; 0.

    A rest of a microsecond before a kink is no reason to begin with microseconds after it, and its error, mostly that
    of the iteration, tells nothing of longer ones.
    """
    planned = attempt.at.control.size
    return planned if planned > attempt.H and (error is None or error.size <= window_size.AIM) else 0.0


def _is_slow(attempt: Attempt) -> bool:
    """Whether hardly anything changed, and no kink lies ahead that could change that.

    What melts or freezes takes up heat at one temperature: its solid fraction counts as what that heat would warm it.
    """
    plan = attempt.plan
    # fault: a run stops as steady before a kink -> if plan.steady == 0.0 or plan.last < 0: | coupler/test_control
    if plan.steady == 0.0 or plan.must_end(attempt.span.k0) != plan.last:
        return False
    now, before = attempt.solved.state.now, attempt.at.state.now
    change = float(np.abs(now.T - before.T).max())
    if now.f_s is not None and before.f_s is not None:
        change = max(change, plan.latent * float(np.abs(now.f_s - before.f_s).max(initial=0.0)))
    return change < plan.steady * attempt.H


def rejected(solved: Solved, verdict: Verdict, message: str) -> Solved:
    """Return a window that does not stand, with the verdict and why."""
    return replace(solved, verdict=verdict, message=message, anyway=False)
