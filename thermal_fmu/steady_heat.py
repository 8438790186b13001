"""Heat of a step between two steady states: by the trapezoidal rule, for what flows is known at both ends.

By what flows at its end alone it would be of first order, while temperatures, which remember nothing, are exact at any
length of step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.boundary import Heat
from thermal_fmu.step import ThermalStep

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SteadyFlow:
    """What flowed at the end of a step.

    heat : its parts [W].  moved, inside : (n,) [W], as ThermalStep has them.  loads : factor of each load [1] then.
    """

    heat: Heat
    moved: Floats
    inside: Floats
    loads: Mapping[str, float]


def flow_of(done: ThermalStep, h: float, loads: Mapping[str, float]) -> SteadyFlow:
    """Return what flowed at the end of a step of h [s], of which the heat is h times that."""
    return SteadyFlow(_times(done.heat, 1.0 / h), done.moved / h, done.inside / h, loads)


def between(before: SteadyFlow, done: ThermalStep, h: float) -> ThermalStep:
    """Return the step with the heat of the mean of what flowed at its start and at its end."""
    return replace(done, heat=_times(before.heat, 0.5 * h) + _times(done.heat, 0.5),
                   moved=0.5 * (h * before.moved + done.moved), inside=0.5 * (h * before.inside + done.inside))


def _times(heat: Heat, factor: float) -> Heat:
    return Heat(factor * heat.stored, factor * heat.temperature, factor * heat.terms, factor * heat.each,
                factor * heat.moved)
