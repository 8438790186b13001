"""Inner steps of one substep, as long as the local error and the change of T allow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isinf

import numpy as np

from contact.half.linalg import SingularMatrixError
from thermal_fmu import phase_change
from thermal_fmu.cells import BadPropertyError
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHODS, Method
from thermal_fmu.newton import Anchor, NotConvergedError, Solved, solve_stage
from thermal_fmu.problem import Adaptive, Stepping
from thermal_fmu.sources import SNAP_STEP, SNAP_TIME, Calendar, loads_at
from thermal_fmu.stage import StageProblem, balance
from thermal_fmu.step import Course, Floats, Stepped, damped_step, flow_at, local_error, take_step, with_prescribed

# How long the next inner step may be: a controller with memory.

SAFETY = 0.9
# The proportional and the integral share: a pure integral one swings where the bound changes from step to step.
OF_ERROR, OF_LAST_ERROR = 0.7, 0.4
MOST_GROWTH, MOST_CUT = 4.0, 0.1
FAILED_CUT = 0.5  # of a step that was not solved
SMALLEST = 1e-6  # share of a bound: one that is not felt at all must not be divided by
SHORTENED = 1.0 - 1e-9  # of a length: what is left beyond it is round-off, not a step


@dataclass(frozen=True)
class Pace:
    """What inner steps hand on.  h : length to try next [s], 0: not known yet.

    error : of the last inner step, as a share of the tolerance; 1 where its method or its data were others.
    """

    h: float = 0.0
    error: float = 1.0


NO_PACE = Pace()


@dataclass(frozen=True)
class Measure:
    """A step that was solved.  error, change : estimated local error and largest change of T, as shares of what is
    allowed.  order : the error falls like h^(order + 1).
    """

    error: float
    change: float
    order: int

    @property
    def passes(self) -> bool:
        """Whether it keeps to both bounds; a measure that is no number does not."""
        # fault: max_dT not kept to -> return self.error <= 1.0 | thermal_fmu/test_thermal_adaptive
        return self.error <= 1.0 and self.change <= 1.0


def length(h: float, left: float) -> float:
    """The step to try where h [s] is wished (0: no wish) and `left` [s] remain: never a sliver for the last one."""
    if h == 0.0 or h >= SHORTENED * left:
        return left
    # fault: a sliver for the last inner step -> return h | thermal_fmu/test_thermal_adaptive
    return 0.5 * left if 2.0 * h > left else h


def shorter(h: float, found: Measure | None) -> float:
    """The next try after a step h [s] that did not pass; found : None where it was not solved."""
    if found is None:
        return FAILED_CUT * h
    by_error = SAFETY * max(found.error, SMALLEST) ** (-1.0 / (found.order + 1))
    return h * max(MOST_CUT, min(SAFETY, by_error, SAFETY / max(found.change, SMALLEST)))


def after(pace: Pace, h: float, found: Measure, retried: bool) -> Pace:
    """The pace after a step h [s] that passed; retried : a longer one did not."""
    power = found.order + 1
    error = max(found.error, SMALLEST)
    growth = SAFETY * error ** (-OF_ERROR / power) * pace.error ** (OF_LAST_ERROR / power)
    growth = min(growth, SAFETY / max(found.change, SMALLEST), 1.0 if retried else MOST_GROWTH)
    if not retried and h < SHORTENED * pace.h:
        return Pace(max(pace.h, growth * h), pace.error)  # cut short by a kink, which says nothing against the pace
    return Pace(growth * h, error)


LEAST_SHARE = 1e-9  # of the substep: the shortest inner step where none is given


class LeastStepError(ArithmeticError):
    """The shortest inner step allowed is still too long.  least : its length [s]."""

    def __init__(self, message: str, least: float) -> None:
        super().__init__(message)
        self.least = least


@dataclass(frozen=True)
class Progress:
    """A substep on its way.  s : (n,) [K].  damped : inner steps still to be damped.  done : all steps so far as one.

    substeps, rejected : inner steps that passed, and that did not.
    """

    s: Floats
    anchor: Anchor | None
    pace: Pace
    damped: int
    done: Stepped | None = None
    substeps: int = 0
    rejected: int = 0


@dataclass(frozen=True)
class Walk:
    """What every inner step of a substep needs.  least : [s]."""

    course: Course
    method: Method
    adaptive: Adaptive
    least: float


@dataclass(frozen=True)
class Place:
    """A point on the way.  t [s], s : (n,) [K] with the prescribed values of t after a jump, f : (n,) flow there [W].

    s and f only where an error is estimated.
    """

    t: float
    s: Floats | None = None
    f: Floats | None = None


@dataclass(frozen=True)
class Tried:
    """An inner step that was solved, its measure, and where it led."""

    done: Stepped
    found: Measure
    there: Place


def walk(course: Course, method: Method, adaptive: Adaptive, progress: Progress, t: float, h: float) -> Progress:
    """The substep [t, t + h].  Inner steps end at every kink of the half's own signals; after a jump one is damped.

    Raises LeastStepError.
    """
    least = min(adaptive.least or LEAST_SHARE * h, h)
    plan = Walk(course, method, adaptive, least)
    begin = t
    for end in ends_within(course.calendar, t, h):
        if course.calendar.jump_within(begin, end - begin):
            progress = replace(progress, damped=DAMPED_SUBSTEPS)
        place = _place(plan, progress.s, begin, end - begin)
        while place.t < end:
            progress, place = _inner_step(plan, progress, place, end)
        begin = end
    return progress


def ends_within(calendar: Calendar, t: float, h: float) -> tuple[float, ...]:
    """The kinks inside [t, t + h] and its end; kinks closer together than a clock can tell are one."""
    near = SNAP_STEP * h + SNAP_TIME * abs(t)
    ends: list[float] = []
    for kink in calendar.kinks:
        # fault: inner steps across kinks -> if (ends[-1] if ends else t) + near < kink < t - h: |
        #   thermal_fmu/test_thermal_adaptive
        if (ends[-1] if ends else t) + near < kink < t + h - near:
            ends.append(float(kink))
    return (*ends, t + h)


def _place(plan: Walk, s: Floats, t: float, h: float) -> Place:
    return Place(t) if isinf(plan.adaptive.tolerance) else Place(t, *flow_at(plan.course, s, t, h, 1))


def _inner_step(plan: Walk, progress: Progress, place: Place, end: float) -> tuple[Progress, Place]:
    """One step that passes, and where it led."""
    left = end - place.t
    size, rejected, anchor = length(progress.pace.h, left), 0, progress.anchor
    while True:
        tried = _attempt(plan, progress, anchor, place, end if size == left else place.t + size)
        if isinstance(tried, Tried) and tried.found.passes:
            pace = after(progress.pace, size, tried.found, rejected > 0)
            return _gone(progress, tried.done, pace, rejected), tried.there
        if size <= plan.least:
            raise LeastStepError(f"an inner step of {size:.3g} s at {place.t:.9g} s {_why(tried)}; "
                                 f"adaptive.least allows none shorter", plan.least)
        found, anchor = (tried.found, tried.done.anchor) if isinstance(tried, Tried) else (None, anchor)
        size, rejected = length(max(plan.least, shorter(size, found)), left), rejected + 1


def _attempt(plan: Walk, progress: Progress, anchor: Anchor | None, place: Place, stop: float) -> Tried | str:
    """The step from `place` to stop [s] with its measure, or why there is none."""
    method, course, h = plan.method, plan.course, stop - place.t
    # fault: inner steps not damped after a jump -> take = take_step | thermal_fmu/test_thermal_adaptive
    take = damped_step if progress.damped > 0 else take_step
    try:
        done = take(course, method, progress.s, anchor, place.t, h)
        error, there = _error(plan, place, done, stop, h)
    except (NotConvergedError, BadPropertyError, SingularMatrixError) as exc:
        return str(exc)
    free, melting = ~course.scene.fixed, course.scene.melting
    dT = phase_change.temperature(melting, done.s) - phase_change.temperature(melting, progress.s)
    change = float(np.abs(dT[free]).max(initial=0.0)) / plan.adaptive.max_dT
    used = METHODS[method.damped[0]] if progress.damped > 0 and method.damped is not None else method
    return Tried(done, Measure(error, change, used.order), there)


def _error(plan: Walk, place: Place, done: Stepped, stop: float, h: float) -> tuple[float, Place]:
    if place.s is None or place.f is None:
        return 0.0, Place(stop)
    error, there = local_error(plan.course, (place.s, place.f), done, place.t, h)
    return error / plan.adaptive.tolerance, Place(stop, *there)


def _gone(progress: Progress, done: Stepped, pace: Pace, rejected: int) -> Progress:
    # After a damped step another method goes on: what its error was says nothing about the next one's.
    pace = replace(pace, error=1.0) if progress.damped > 0 else pace
    total = done if progress.done is None else progress.done.then(done)
    return Progress(done.s, done.anchor, pace, max(progress.damped - 1, 0), total, progress.substeps + 1,
                    progress.rejected + rejected)


def _why(tried: Tried | str) -> str:
    if isinstance(tried, str):
        return f"was not solved: {tried}"
    return f"has {tried.found.error:.3g} of adaptive.tolerance and {tried.found.change:.3g} of adaptive.max_dT"


# Steady states by load increments: R(T) = (1 - lambda) R(T_start), lambda from 0 to 1.

STEADY = METHODS["steady"]
MAX_HALVINGS = 10  # of an increment; a path that needs steps of a thousandth of one is no path


def walk_to_steady(course: Course, increments: int, s_start: Floats, anchor: Anchor | None, t: float,
                   dt: float) -> Stepped:
    """From s_start : (n,) [K] to the steady state under the loads of t + dt, prescribed values moving along.

    The path starts where the residual is zero by construction.  An increment that fails is halved, and grows again as
    the next ones succeed.  Raises NotConvergedError, SingularMatrixError.
    """
    whole = 2**MAX_HALVINGS
    done, size, last = 0, whole, increments * whole  # lambda = done/last, exactly
    s, iterations = s_start, 0
    path: _Path | None = None
    while True:
        size = min(size, last - done)
        try:
            if done + size == last:
                stepped = take_step(course, STEADY, s, anchor, t, dt)
                return replace(stepped, iterations=iterations + stepped.iterations)
            path = path or _path(course, s_start, t, dt)
            solved = _increment(path, (done + size) / last, s, anchor)
        except (NotConvergedError, BadPropertyError) as exc:
            if size == 1:
                return _all_at_once(course, s_start, anchor, (t, dt), f"at {done / last:.3g} of the load no "
                                    f"increment helps: {exc}")
            size //= 2
            continue
        s, anchor, iterations = solved.s, solved.anchor, iterations + solved.iterations
        done, size = done + size, min(2 * size, whole)


def _all_at_once(course: Course, s_start: Floats, anchor: Anchor | None, when: tuple[float, float],
                 why: str) -> Stepped:
    """Where the path turns back before its end, its end may still be in reach of Newton's method from the start."""
    try:
        return take_step(course, STEADY, s_start, anchor, *when)
    except (NotConvergedError, BadPropertyError) as exc:
        raise NotConvergedError(why) from exc


@dataclass(frozen=True)
class _Path:
    """problem : of lambda = 1.  f : (n,) [W] at the start.  s_start, s_end : (n,) [K], right at fixed nodes."""

    course: Course
    problem: StageProblem
    f: Floats
    s_start: Floats
    s_end: Floats


def _path(course: Course, s_start: Floats, t: float, dt: float) -> _Path:
    model = course.scene.model
    loads = loads_at(model, course.load, course.calendar.snap(t + dt, dt), -1)
    problem = StageProblem(course.scene, course.held, loads, STEADY.stages[0], dt, s_start, course.power_M,
                           np.zeros(s_start.size), False)
    f = -balance(problem, s_start, jacobian=False).R / dt
    return _Path(course, problem, np.where(course.scene.fixed, 0.0, f), s_start,
                 with_prescribed(course, loads, s_start))


def _increment(path: _Path, share: float, s: Floats, anchor: Anchor | None) -> Solved:
    """share : lambda."""
    course, problem = path.course, path.problem
    fixed = course.scene.fixed
    # fault: prescribed values do not move along -> guess = np.where(fixed, path.s_end, s) |
    #   thermal_fmu/test_thermal_steady
    guess = np.where(fixed, (1.0 - share) * path.s_start + share * path.s_end, s)
    # fault: increments without a path -> partial = replace(problem, earlier=0.0 * path.f) |
    #   thermal_fmu/test_thermal_steady
    partial = replace(problem, earlier=-(1.0 - share) * problem.dt * path.f)
    return solve_stage(partial, guess, course.scene.model.stepping.tolerance, course.factors, anchor)


# The way of one communication substep: by increments, by inner steps, damped, or in one.

@dataclass(frozen=True)
class Begin:
    """Where a substep begins: s : (n,) [K], anchor of its first solve, (inner) steps still to be damped, pace."""

    s: Floats
    anchor: Anchor | None
    damped: int
    pace: Pace


@dataclass(frozen=True)
class Advanced:
    """The substep as one step, what is left to be damped, the pace; inner steps that passed, and that did not."""

    done: Stepped
    damped: int
    pace: Pace
    substeps: int = 1
    rejected: int = 0


def advance(course: Course, stepping: Stepping, method: Method, begin: Begin, t: float, h: float) -> Advanced:
    """From t to t + h [s].

    Raises NotConvergedError, SingularMatrixError, BadPropertyError; LeastStepError with adaptive inner steps.
    """
    left = max(begin.damped - 1, 0)
    if not method.stores:
        done = walk_to_steady(course, stepping.increments, begin.s, begin.anchor, t, h)
        return Advanced(done, left, begin.pace)
    if stepping.adaptive is not None:
        start = Progress(begin.s, begin.anchor, begin.pace, begin.damped)
        end = walk(course, method, stepping.adaptive, start, t, h)
        assert end.done is not None
        return Advanced(end.done, end.damped, end.pace, end.substeps, end.rejected)
    # fault: jumps of own signals not seen -> damped = begin.damped | thermal_fmu/test_thermal_time
    damped = DAMPED_SUBSTEPS if course.calendar.jump_within(t, h) else begin.damped
    done = (damped_step if damped > 0 else take_step)(course, method, begin.s, begin.anchor, t, h)
    return Advanced(done, max(damped - 1, 0), begin.pace)
