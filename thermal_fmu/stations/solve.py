"""A stage at the stations solved: Newton's method, with the phase continuation of thermal_fmu/newton.py."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from thermal_fmu.boundary import demand_limits
from thermal_fmu.cells import BadPropertyError
from thermal_fmu.newton import MAX_CLIMBS, MAX_ITERATIONS, ROUND_OFF, NotConvergedError, descend, phase_continuation
from thermal_fmu.phase_change import temperature
from thermal_fmu.settled import STAGE_TOLERANCE, is_solved, left_over
from thermal_fmu.stations.balance import Floats, StationBalance, StationProblem, station_balance


@dataclass(frozen=True)
class NewtonLimits:
    """How many iterations, and whether a line search must lower the residual in each."""

    iterations: int
    line_search: bool


FULL_STEPS = NewtonLimits(10, False)  # they converge in about five, or go round in circles
LINE_SEARCH = NewtonLimits(MAX_ITERATIONS, True)


@dataclass(frozen=True)
class SolvedStations:
    """A stage that was solved.

    s : (n,) [K], its balance, the number of linear solves.  residual : norm beyond round-off over scale [1].
    """

    s: Floats
    balance: StationBalance
    iterations: int
    residual: float


def solve_stations(problem: StationProblem, s: Floats, tolerance: float) -> SolvedStations:
    """Solve a stage from the guess s : (n,) [K] (prescribed values already in it).

    Converged as in thermal_fmu/newton.py.  Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    melting = problem.substep.scene.melting
    solved = _melting_strategies(problem, s, tolerance) if melting else _newton(problem, s, tolerance, LINE_SEARCH)
    demand_limits(problem.substep.data, problem.loads, temperature(melting, solved.s))
    return solved


def _melting_strategies(problem: StationProblem, s: Floats, tolerance: float) -> SolvedStations:
    """Try full steps, then a line search, then phase continuation by the one and by the other.

    A line search creeps from edge to edge of the phases, where full steps are mostly past them at once.
    """
    for limits, solve in ((FULL_STEPS, _newton), (LINE_SEARCH, _newton), (FULL_STEPS, _phase_continuation)):
        try:
            return solve(problem, s, tolerance, limits)
        except (NotConvergedError, BadPropertyError):
            pass
    return _phase_continuation(problem, s, tolerance, LINE_SEARCH)


def _phase_continuation(problem: StationProblem, s: Floats, tolerance: float, limits: NewtonLimits) -> SolvedStations:
    return phase_continuation(lambda blur, last, goal: _newton(
        replace(problem, blur=blur), s if last is None else last.s, goal, limits), tolerance)


def _newton(problem: StationProblem, s: Floats, tolerance: float, limits: NewtonLimits) -> SolvedStations:
    scene = problem.substep.scene
    now = station_balance(problem, s)
    floor = ROUND_OFF * float(np.abs(now.band).sum(axis=0) @ np.abs(s))
    climbs = MAX_CLIMBS if scene.melting else 0
    last: StationBalance | None = None
    for iteration in range(limits.iterations):
        if is_solved(now, last, tolerance, floor):
            return SolvedStations(s, now, iteration, left_over(now, floor))
        last = now
        step = scene.stations.solve(now.band, np.where(scene.fixed, 0.0, -now.R))
        if not np.isfinite(step).all():
            raise NotConvergedError(f"the temperature of iteration {iteration + 1} is not finite")
        if not limits.line_search:
            s = s + step
            now = station_balance(problem, s)
            continue
        s, now = descend(partial(station_balance, problem), s, step, now, floor, climbs > 0)
        climbs -= int(now.norm >= last.norm and now.norm > floor)
    raise NotConvergedError(f"{limits.iterations} iterations left a residual of {now.relative_residual:.2e} of the "
                            f"heat that flows (tolerance {STAGE_TOLERANCE * tolerance:.1e})")
