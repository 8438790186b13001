"""Newton's method for one stage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from thermal_fmu.limits import demand_limits
from thermal_fmu.phase import temperature
from thermal_fmu.solver import Anchor, Factors, solve
from thermal_fmu.stage import Balance, StageProblem, balance

Floats = NDArray[np.float64]

MAX_ITERATIONS = 25  # quadratic convergence needs a handful, a peaked c(T) with halved steps some more
MAX_HALVINGS = 8  # a step worth less than 1/256 of Newton's is no step
DESCENT = 1e-4  # least relative decrease asked for, per share of the full step
# The heat balance of a long run must close to the tolerance: each stage is solved to a tenth of it.
SHARE = 0.1
LINEAR_SHARE = 0.3  # of what Newton asks for, so that a linear scene takes one solve
ROUND_OFF = 16.0 * np.finfo(float).eps  # of |J| |T|: what the residual cannot resolve


class NotConvergedError(ArithmeticError):
    """Newton's method did not reach the tolerance."""


@dataclass(frozen=True)
class Solved:
    """s : (n,) [K] of the stage, its balance, the number of linear solves, the relative residual, the next anchor."""

    s: Floats
    balance: Balance
    iterations: int
    residual: float
    anchor: Anchor | None


def solve_stage(problem: StageProblem, T: Floats, tolerance: float, factors: Factors,
                anchor: Anchor | None) -> Solved:
    """The stage's temperatures, from the guess T : (n,) [K] (prescribed values already in it).

    Converged where the sum of |R| is a tenth of `tolerance` of the sum of all |heats|, or is round-off.
    Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    now = balance(problem, T, jacobian=True)
    floor = ROUND_OFF * _size(now.jacobian, T)
    for iteration in range(MAX_ITERATIONS):
        if now.norm <= max(SHARE * tolerance * now.scale, floor):
            demand_limits(problem.held, problem.loads, temperature(problem.scene.melting, T))
            return Solved(T, now, iteration, now.share, anchor)
        if now.jacobian is None:
            now = balance(problem, T, jacobian=True)
        assert now.jacobian is not None
        target = LINEAR_SHARE * max(SHARE * tolerance * now.scale, floor)
        solution = solve(now.jacobian, np.where(problem.scene.fixed, 0.0, -now.R), target, anchor, factors)
        step, anchor = solution.x, solution.anchor
        if not np.isfinite(step).all():
            raise NotConvergedError(f"iteration {iteration + 1} gave temperatures that are not finite")
        T, now = _descend(problem, T, step, now, floor)
    raise NotConvergedError(f"{MAX_ITERATIONS} iterations left a residual of {now.share:.2e} of the heat that flows "
                            f"(tolerance {SHARE * tolerance:.1e})")


def _descend(problem: StageProblem, T: Floats, step: Floats, before: Balance,
             floor: float) -> tuple[Floats, Balance]:
    """The longest of the steps 1, 1/2, 1/4 ... that lowers the residual."""
    share = 1.0
    for _ in range(MAX_HALVINGS):
        trial = T + share * step
        after = balance(problem, trial, jacobian=False)
        if after.norm <= max((1.0 - DESCENT * share) * before.norm, floor):
            return trial, after
        share *= 0.5
    raise NotConvergedError(f"no step along Newton's direction lowers the residual of {before.share:.2e} "
                            "of the heat that flows")


def _size(A: csr_matrix | None, T: Floats) -> float:
    assert A is not None
    return float((abs(A) @ np.abs(T)).sum())
