"""What a step with inertia makes of the energy of bodies: nothing, if it is resolved.

The work of all forces but those of the cells, by the trapezoidal rule, is what kinetic energy, the cells and contact
take up.  A method that damps loses some of it, on purpose where something rings too fast for the step.  Where a body
turns by much in a step the trapezoidal rule itself is wrong on what the cells take up: between two places on an arc
they are squeezed on the chord.  Their energy is a function of place, whatever the way, and on the straight way between
both ends their force is all but a cubic in the share of it, for strains are quadratic: Simpson's rule has it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from mechanical_fmu.dynamics import BodyMotion, of_contact
from mechanical_fmu.material import Moduli
from mechanical_fmu.system import ForceBalance, System
from mechanical_fmu.volume import CellError, PointStep

Floats = NDArray[np.float64]


def kinetic(system: System, motion: BodyMotion) -> float:
    """Compute the kinetic energy [J]."""
    return 0.5 * float(motion.v.ravel() @ (_mass(system) @ motion.v.ravel()))


def made(system: System, before: BodyMotion, after: BodyMotion, found: ForceBalance,
         moduli: Callable[[float], tuple[Moduli, ...]], history: Floats, dt: float, heat: float) -> float:
    """Compute the energy [J] that a step makes from nothing; below 0 where it loses some.

    before, after : the motion at both ends.  found : the balance at the end.  moduli : at a share of the step.
    history : (n_history,) at its start.  dt : its length [s].  heat : [J] of friction.
    """
    du, free = (after.u - before.u).ravel(), system.constraints.free
    # What is held bears what balances its inertia; the others are only as much in balance at the ends as the method is.
    push = 0.5 * free * (before.f + after.f).ravel()
    driven = 0.5 * (1.0 - free) * (_mass(system) @ (before.a + after.a).ravel())
    # fault: what sets off at once loses half of its energy -> way = du | mechanical_fmu/test_energy
    way = 0.5 * dt * (before.v + after.v).ravel()
    of_motion = kinetic(system, after) - kinetic(system, before) + float(du @ push - way @ driven)
    touched = found.tractions is not None and len(before.push)
    more = of_contact(before, after, heat) if touched else 0.0
    # fault: energy that turning makes is not seen -> return of_motion + more | mechanical_fmu/test_energy
    return of_motion + more + _of_cells(system, before.u, after.u, moduli, history)


def _of_cells(system: System, u0: Floats, u1: Floats, moduli: Callable[[float], tuple[Moduli, ...]],
              history: Floats) -> float:
    """What cells take up, less the trapezoidal rule of their forces [J].  Of points with a past it is not known: 0.

    The way between is not gone: what flows would flow on it.
    """
    if system.volume.makes_heat or not system.volume.kinds:
        return 0.0
    try:
        f0, f, f1 = (system.volume.evaluate(u0 + s * (u1 - u0), moduli(s), PointStep(0.0, history)).f
                     for s in (0.0, 0.5, 1.0))
    except CellError:
        # Turned so far that the chord turns cells inside out.
        return 0.0
    n = len(f)
    return float(((u1 - u0)[:n] * (f - 0.5 * (f0 + f1))).sum()) * 2.0 / 3.0


def _mass(system: System) -> csr_matrix:
    how = system.spec.dynamics
    assert how is not None
    return system.masses.matrix(how.lumped)
