"""Inner steps of one substep, as long as the local error and the change of T allow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isinf

import numpy as np
from numpy.typing import NDArray

from contact.half.sparse import SingularMatrixError
from thermal_fmu import phase
from thermal_fmu.loads import SNAP_STEP, SNAP_TIME, Calendar
from thermal_fmu.local_error import local_error
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHODS, Method
from thermal_fmu.newton import NotConvergedError
from thermal_fmu.pace import Measure, Pace, after, length, shorter
from thermal_fmu.solver import Anchor
from thermal_fmu.step import Course, Stepped, damped_step, flow_at, take_step
from thermal_fmu.stepping import Adaptive
from thermal_fmu.volume import BadPropertyError

Floats = NDArray[np.float64]

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
    dT = phase.temperature(melting, done.s) - phase.temperature(melting, progress.s)
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
