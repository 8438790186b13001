"""Whether a window's iterates agree: one number a quantity, at most 1 where it does."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupler.scenario.options import Tolerance, Tolerances
from coupler.schemes.level import Level

Array = NDArray[np.float64]

# Quantity -> field of a level.
QUANTITIES = {"temperature": "T", "gap": "x", "pressure": "t_N", "solid_fraction": "f_s"}


@dataclass(frozen=True)
class Step:
    """What one iterate did.  guess : what was put in; found : what came out; former : x and t_N one iterate before.

    share : of the change of x and t_N since `former` that the residual still left stands for, |r|/|g - g_former|;
    inf where that is not known.
    """

    guess: Level
    found: Level
    former: Level
    share: float


def misfits(start: Level, step: Step, tolerance: Tolerances) -> Mapping[str, float]:
    """Differences in units of their tolerance; a quantity the scene does not have is left out.

    T and f_s were guessed, so outcome less guess is known.  x and t_N follow from the guess; what they would still
    change by is known only from the last change, times how much smaller the residual is than the step that made it.
    The iterate before the first is the start of the window.
    """
    # fault: gap not judged -> apart = {"temperature": (step.found.T, step.guess.T, 1.0), "gap": (step.found.x,
    #   step.found.x, 0.0), | coupler/test_iterated
    apart = {"temperature": (step.found.T, step.guess.T, 1.0), "gap": (step.found.x, step.former.x, step.share),
             # fault: pressure not judged -> "pressure": (step.found.t_N, step.found.t_N, 0.0)} | coupler/test_iterated
             "pressure": (step.found.t_N, step.former.t_N, step.share)}
    if step.found.f_s is not None and step.guess.f_s is not None:
        apart["solid_fraction"] = (step.found.f_s, step.guess.f_s, 1.0)
    return {name: share if math.isinf(share) else share * _misfit(
        new, old, getattr(start, QUANTITIES[name]), getattr(tolerance, name))
        for name, (new, old, share) in apart.items() if new.size}


def _misfit(new: Array, old: Array, start: Array, tolerance: Tolerance) -> float:
    change = float(np.abs(new - start).max())
    return float(np.abs(new - old).max()) / (tolerance.atol + tolerance.rtol * change)
