"""What drives a step: prescribed motions, loads and temperatures, at its end and on the way there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Values
from mechanical_fmu.loads import driven
from mechanical_fmu.system import System

Floats = NDArray[np.float64]

# Start value of the input f_s: no share of anything, so that a master that does not connect it gets f_s from T.
NOT_GIVEN = -1.0


@dataclass(frozen=True)
class Drive:
    """target : (n_fixed,) [m].  pressure : (n_pressures,) [Pa].  dead : (n_dead,) size of each dead load.

    T : (n_nodes,) [K].  f_s : (n_nodes,) solid fraction; (0,) where nobody gave it, and T says it.
    """

    target: Floats
    pressure: Floats
    dead: Floats
    T: Floats
    f_s: Floats


def drive_of(system: System, inputs: Values, t: float, side: int) -> Drive:
    """The drive at time t [s], from the given side of a jump (-1 before it, 1 after it)."""
    spec = system.spec
    pressure = [driven(p.value, p.name, t, side, inputs) for p in spec.pressures]
    dead = [driven(d.value, d.name, t, side, inputs) for d in spec.dead]
    T = np.array(inputs["T"], dtype=np.float64, order="C")
    return Drive(system.constraints.values(t, side, inputs), np.array(pressure), np.array(dead), T, _given(inputs))


def between(a: Drive, b: Drive, share: float) -> Drive:
    """The drive after a share of the way from a to b; b itself at its end."""
    if share == 1.0:
        return b
    return Drive(*(x + share * (y - x) for x, y in
                   ((a.target, b.target), (a.pressure, b.pressure), (a.dead, b.dead), (a.T, b.T),
                    (a.f_s if a.f_s.size == b.f_s.size else b.f_s, b.f_s))))


def _given(inputs: Values) -> Floats:
    """f_s as it was given, or nothing while all of it is at its start value."""
    f_s = np.array(inputs.get("f_s", ()), dtype=np.float64, order="C")
    return np.empty(0) if (f_s == NOT_GIVEN).all() else f_s
