"""What became of a case under a scheme: right, iterates, cycles, wrong or failed, held against small windows.

Cases that come to rest are compared where they are at rest, the others where 60 windows end.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from enum import Enum
from functools import cache
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupler.errors import CouplingError
from coupler.scenario.options import Acceleration, Iteration, OnMax, Scheme

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from cases import CASES, DISTURBANCES, Case
from coupled_run import couple

Array = NDArray[np.float64]
ENOUGH = 0.02  # of the first distance: nearer is right
MANY = 15  # iterations in a window: more is told apart
LEAST_WINDOWS = 60
SMALL = 0.05  # windows of the reference, in units of the case


class Outcome(Enum):
    """The verdicts, from best to worst."""

    RIGHT = "right"
    ITERATES = "iterates"  # right, but some window took more than MANY iterations
    CYCLES = "cycles"  # goes up and down from window to window
    WRONG = "wrong"  # at rest elsewhere, still on its way, or growing without turning
    FAILED = "failed"  # iterations did not end, or numbers were none


@dataclass(frozen=True)
class Way:
    """A scheme, and how it iterates."""

    name: str
    scheme: Scheme
    acceleration: Acceleration = Acceleration.IQN_ILS
    relaxation: float = 1.0
    on_max: OnMax = OnMax.STOP

    def how(self, case: Case) -> Iteration:
        return case.how.changed(acceleration=self.acceleration, relaxation=self.relaxation, on_max=self.on_max)


FIXED = (
    Way("staggered", Scheme.STAGGERED), Way("mechanical first", Scheme.MECHANICAL_FIRST),
    Way("parallel", Scheme.PARALLEL), Way("extrapolated", Scheme.EXTRAPOLATED),
    Way("iterated, none", Scheme.ITERATED, Acceleration.NONE),
    Way("iterated, constant .5", Scheme.ITERATED, Acceleration.CONSTANT, 0.5),
    Way("iterated, aitken", Scheme.ITERATED, Acceleration.AITKEN),
    Way("iterated, iqn-ils", Scheme.ITERATED, Acceleration.IQN_ILS))
ADIABATIC = Way("adiabatic", Scheme.ADIABATIC)
ALONG_HEAT = Way("along heat", Scheme.ALONG_HEAT)
AUTO = Way("auto", Scheme.AUTO, on_max=OnMax.RETRY_SMALLER)


@dataclass(frozen=True)
class Cell:
    """One run.  error : distance from the reference at the end over that at the start.  most : iterations of a window.

    pairs : half-solves of the costlier half a window asked for, those of windows put back among them.
    swing : the largest of the last increments over the first distance.
    """

    case: str
    way: str
    factor: float
    disturbance: str
    outcome: Outcome
    error: float
    most: int
    pairs: float
    swing: float


@cache
def reference(name: str, d: float, end: float) -> tuple[float, ...]:
    """What is watched at `end` [s] in the limit of small windows: exact where the case knows, else by small windows."""
    case = CASES[name]
    if case.exact is not None:
        return tuple(case.exact(d, end))
    n = ceil(end / (SMALL * case.unit))
    halves, state = case.make(d)
    state, _ = couple(halves, state, (end, n), Scheme.ITERATED, how=case.how.changed(on_max=OnMax.RETRY_SMALLER))
    return tuple(case.watch(state.now))


def trial(case: Case, way: Way, factor: float, disturbance: str) -> Cell:
    """Run a case in windows of `factor` units and judge it."""
    d, size = DISTURBANCES[disturbance], factor * case.unit
    n = max(LEAST_WINDOWS, ceil(case.settled / size))
    found = (case.name, way.name, factor, disturbance)
    halves, state = case.make(d)
    begin = case.watch(state.now)
    try:
        with np.errstate(all="ignore"):
            _, tried = couple(halves, state, (n * size, n), way.scheme, how=way.how(case))
    except (CouplingError, ValueError, np.linalg.LinAlgError, OverflowError):
        return Cell(*found, Outcome.FAILED, float("inf"), way.how(case).max_iterations, float("nan"), float("nan"))
    taken = [w for w in tried if w.accepted]
    path = np.array([begin, *(case.watch(w.solved.state.now) for w in taken)])
    solves = sum(max(w.solved.work.thermal_solves, w.solved.work.mechanical_solves) for w in tried)
    most = max((len(w.solved.history.misfits) for w in tried if w.solved.history), default=1)
    there = np.array(reference(case.name, d, case.settled or n * size))
    distance = float(np.abs(begin - there).max())
    outcome, error, swing = judged(path, there, distance, most)
    return Cell(*found, outcome, error, most, solves / n, swing)


def judged(path: Array, there: Array, distance: float, most: int) -> tuple[Outcome, float, float]:
    """path : (n + 1, m) watched.  there : (m,) where it should be.  distance : of the start from there."""
    if not np.isfinite(path).all():
        return Outcome.FAILED, float("inf"), float("nan")
    error = float(np.abs(path[-2:] - there).max()) / distance
    steps = np.diff(path[-len(path) // 4:], axis=0)
    swing = float(np.abs(steps).max()) / distance
    if error <= ENOUGH:
        return (Outcome.ITERATES if most > MANY else Outcome.RIGHT), error, swing
    widest = steps[:, int(np.argmax(np.abs(steps).max(axis=0)))]
    turns = float(np.mean(widest[1:] * widest[:-1] < 0.0)) if len(widest) > 1 else 0.0
    return (Outcome.CYCLES if swing > ENOUGH / 10.0 and turns > 0.2 else Outcome.WRONG), error, swing


def dies_at(case: Case, way: Way, factor: float, disturbance: str, halvings: int = 8) -> float | None:
    """The factor at which what cycles is right, found by halving: the cycle is numerical.  None: it is physical."""
    for i in range(1, halvings + 1):
        if trial(case, way, factor / 2**i, disturbance).outcome in (Outcome.RIGHT, Outcome.ITERATES):
            return factor / 2**i
    return None
