"""Equilibrium by Newton's method, with a line search on the work of the out-of-balance force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.methods import directions
from mechanical_fmu.system import Balance, Loading, System
from mechanical_fmu.tangent import Anchor
from mechanical_fmu.volume import InvertedCellError

Floats = NDArray[np.float64]

# A step is shortened while the work d . r left at its end exceeds this share of that at its start (Crisfield's .8).
SLACK = 0.8
MOST_CUTS = 8
# Iterations of a method that lives on old tangents may be many: each costs little.
PATIENCE = 4


class NoEquilibriumError(ArithmeticError):
    """Newton's method gave up."""


@dataclass(frozen=True)
class Settings:
    """tolerance : of the residual of each body, relative to the forces on it.  max_iterations : of one step.

    adopt : drift of the stiffness over a step up to which its factor is kept for the next steps; negative: never.
        Well below what would still converge, because beginning costs a factor and a solve per surface unknown.
    method : newton, modified_newton or bfgs (methods.py).
    """

    tolerance: float
    max_iterations: int = 25
    adopt: float = 0.002
    method: str = "newton"

    @property
    def most(self) -> int:
        """Iterations a step may take."""
        return self.max_iterations if self.method == "newton" else PATIENCE * self.max_iterations


@dataclass(frozen=True)
class Equilibrium:
    """balance : at the solution.  residual : largest relative residual of a body.  history : of every iterate.

    iterations : directions computed.  fresh : whether a tangent had to be taken anew.
    """

    balance: Balance
    residual: float
    history: tuple[float, ...]
    fresh: bool

    @property
    def iterations(self) -> int:
        return len(self.history) - 1


def solve(system: System, loading: Loading, start: Balance, anchor: Anchor | None, settings: Settings) -> Equilibrium:
    """The equilibrium nearest to start.

    anchor : whose factor to use as long as it serves, None for a fresh tangent in every iteration.
    Raises NoEquilibriumError, SingularMatrixError, InvertedCellError, ContactRefusedError.
    """
    floor = system.floor(loading, settings.tolerance)
    balance, error = start, system.error(start, floor)
    history, search = [float(error.max())], directions(settings.method, system, loading, anchor)
    while True:
        gap = loading.target - balance.u.ravel()[system.constraints.fixed]
        if history[-1] <= settings.tolerance and not gap.any():
            return Equilibrium(balance, history[-1], tuple(history), search.fresh)
        if len(history) > settings.most:
            break
        d, before = search.direction(balance, gap), balance
        balance, error = line_search(system, loading, (balance, error), d, floor, settings.tolerance)
        history.append(float(error.max()))
        search.learn(before, balance, (history[-2], history[-1]))
    body = system.interface.bodies[int(np.argmax(error))]
    raise NoEquilibriumError(f"no equilibrium after {settings.most} iterations: the forces on body {body} "
                             f"are out of balance by {history[-1]:.3g} (tolerance {settings.tolerance:g})"
                             f"{jumps_text(system)}")


def jumps_text(system: System) -> str:
    """What may be why, where pairs have one point a node: there may be no equilibrium where a node's force ends."""
    # fault: a failure does not name one point a node -> pairs = [pair.name for pair in system.interface.pairs if False]
    #   | mechanical_fmu/test_semi_smooth
    pairs = [pair.name for pair in system.interface.pairs if pair.by_node]
    return (f"; in pair {' and '.join(pairs)}, of form: nodes, force jumps where a node slides off an end, and no "
            "equilibrium may lie between: form: edges has no jump") if pairs else ""


def line_search(system: System, loading: Loading, start: tuple[Balance, Floats], d: Floats, floor: Floats,
            tolerance: float) -> tuple[Balance, Floats]:
    """Balance and error at u + s d; s = 1 unless that turns a cell inside out or overshoots.

    The gap of prescribed components closes in full steps only; while it is open the work has no sign to search by.
    """
    balance, before = start
    pull = d * system.constraints.free
    driven = bool(d[system.constraints.fixed].any())
    work = float(np.dot(pull, balance.r.ravel()))
    s, best, inverted = 1.0, None, None
    for _ in range(MOST_CUTS):
        try:
            trial = system.balance(_moved(system, loading, balance.u, d, s), loading)
        except InvertedCellError as exc:
            inverted, s = exc, 0.5 * s
            continue
        after = system.error(trial, floor)
        left = float(np.dot(pull, trial.r.ravel()))
        smaller = after.max() <= max(tolerance, 0.5 * before.max())
        if driven or smaller or work >= 0.0 or left <= SLACK * abs(work):
            return trial, after
        if best is None or after.max() < best[1].max():
            best = trial, after
        s *= float(np.clip(work / (work - left), 0.1, 0.5))
    if best is None:
        raise inverted or AssertionError("a search tries at least once")
    return best


def _moved(system: System, loading: Loading, u: Floats, d: Floats, s: float) -> Floats:
    moved = u.ravel() + s * d
    if s == 1.0:
        moved[system.constraints.fixed] = loading.target
    placed = moved.reshape(-1, 2)
    return placed if system.rigid is None else system.rigid.placed(placed)
