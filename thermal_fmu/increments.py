"""Steady states by load increments: R(T) = (1 - lambda) R(T_start), lambda from 0 to 1."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.loads import loads_at
from thermal_fmu.methods import METHODS
from thermal_fmu.newton import NotConvergedError, Solved, solve_stage
from thermal_fmu.solver import Anchor
from thermal_fmu.stage import StageProblem, balance
from thermal_fmu.step import Course, Stepped, take_step, with_prescribed
from thermal_fmu.volume import BadPropertyError

Floats = NDArray[np.float64]

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
