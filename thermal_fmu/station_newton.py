"""Newton's method for a stage at the stations, with the detour of thermal_fmu/newton.py where much freezes at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.limits import demand_limits
from thermal_fmu.newton import (
    LEAST_BLUR,
    MAX_CLIMBS,
    MAX_ITERATIONS,
    MAX_RETREATS,
    ROUGH,
    ROUND_OFF,
    SHARE,
    SHARPER,
    NotConvergedError,
    descend,
)
from thermal_fmu.phase import temperature
from thermal_fmu.station_balance import StationBalance, StationProblem, station_balance
from thermal_fmu.volume import BadPropertyError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Effort:
    """How many iterations, and whether each must lower the residual."""

    iterations: int
    followed: bool


WHOLE = Effort(10, False)  # they converge in about five, or go round in circles
FOLLOWED = Effort(MAX_ITERATIONS, True)


@dataclass(frozen=True)
class StationSolved:
    """s : (n,) [K] of the stage, its balance, the number of linear solves."""

    s: Floats
    balance: StationBalance
    iterations: int


def solve_stations(problem: StationProblem, s: Floats, tolerance: float) -> StationSolved:
    """The stage's unknowns, from the guess s : (n,) [K] (prescribed values already in it).

    Converged as in thermal_fmu/newton.py.  Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    melting = problem.ground.scene.melting
    solved = _in_turns(problem, s, tolerance) if melting else _newton(problem, s, tolerance, FOLLOWED)
    demand_limits(problem.ground.held, problem.loads, temperature(melting, solved.s))
    return solved


def _in_turns(problem: StationProblem, s: Floats, tolerance: float) -> StationSolved:
    """Whole steps, then steps that must lower the residual, then the detour by the one and by the other.

    A line search creeps from edge to edge of the phases, where whole steps are mostly over them at once.
    """
    for effort, way in ((WHOLE, _newton), (FOLLOWED, _newton), (WHOLE, _detour)):
        try:
            return way(problem, s, tolerance, effort)
        except (NotConvergedError, BadPropertyError):
            pass
    return _detour(problem, s, tolerance, FOLLOWED)


def _detour(problem: StationProblem, s: Floats, tolerance: float, effort: Effort) -> StationSolved:
    blur, sharper, done, spent, retreats = 1.0, SHARPER, 1.0, 0, 0
    while True:
        try:
            solved = _newton(replace(problem, blur=blur), s, tolerance if blur == 0.0 else ROUGH, effort)
        except NotConvergedError:
            if blur == 1.0 or retreats == MAX_RETREATS:
                raise
            sharper, retreats = sharper**0.5, retreats + 1
            blur = max(done, LEAST_BLUR) * sharper
            continue
        spent += solved.iterations
        if blur == 0.0:
            return replace(solved, iterations=spent)
        s, done = solved.s, blur
        blur = blur * sharper if blur * sharper >= LEAST_BLUR else 0.0


def _newton(problem: StationProblem, s: Floats, tolerance: float, effort: Effort) -> StationSolved:
    scene = problem.ground.scene
    now = station_balance(problem, s)
    floor = ROUND_OFF * float(np.abs(now.band).sum(axis=0) @ np.abs(s))
    climbs = MAX_CLIMBS if scene.melting else 0
    for iteration in range(effort.iterations):
        if now.norm <= max(SHARE * tolerance * now.scale, floor):
            return StationSolved(s, now, iteration)
        step = scene.stations.solve(now.band, np.where(scene.fixed, 0.0, -now.R))
        if not np.isfinite(step).all():
            raise NotConvergedError(f"the temperature of iteration {iteration + 1} is not finite")
        if not effort.followed:
            s = s + step
            now = station_balance(problem, s)
            continue
        before = now.norm
        s, now = descend(partial(station_balance, problem), s, step, now, (floor, climbs > 0))
        climbs -= int(now.norm >= before and now.norm > floor)
    raise NotConvergedError(f"{effort.iterations} iterations left a residual of {now.share:.2e} of the heat that flows "
                            f"(tolerance {SHARE * tolerance:.1e})")
