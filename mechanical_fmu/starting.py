"""The equilibrium that a scene begins in: from the drawing, at once, or by way of ever more of what acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contact.half.linalg import SingularMatrixError
from mechanical_fmu.advance import predicted, solved
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, SolverSettings
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import refuse_loose
from mechanical_fmu.volume import CellError

Floats = NDArray[np.float64]

# The first guess of a scene in which a body rests on another, their gap 0: nothing presses yet, so nothing holds.

# Surfaces nearer than this share of a body's size touch as drawn: the round-off of coordinates in a file.
TOUCHING_AS_DRAWN = 1e-9


def resting(system: System, u: Floats, loading: Loading) -> ForceBalance:
    """Compute the balance to begin with at u : (n_nodes, 2) [m], with its tangent.

    Where a body is loose, surfaces that touch as drawn count as closed, under a pressure that lasts for this one
    guess: it says where contact can hold, and the equilibrium found from it knows nothing of it.
    """
    first = predicted(system, u, loading, True)
    if loading.query is None:
        return first
    try:
        refuse_loose(system, first)
    except SingularMatrixError:
        pressure = TOUCHING_AS_DRAWN * float(system.size.min()) * max(pair.eps_N for pair in system.interface.pairs)
        slaves = system.contact.multiplied([pair.name for pair in system.interface.pairs if not pair.tied])
        # fault: bodies that touch as drawn fall -> query = loading.query.with_multipliers(np.where(slaves, 0.0, 0.0)) |
        #   mechanical_fmu/test_solution_loads
        query = loading.query.with_multipliers(np.where(slaves, -pressure, 0.0))
        return predicted(system, u, replace(loading, query=query), True)
    return first


# A start cannot be cut: it may take so many times the iterations of a step.  A slender body that lies along another,
# with no load yet, peels off it node by node: 40 edges of a belt on a drum took 183, and came no nearer in 92 of them.
# fault: a start gives up as soon as a step that can be cut -> START_PATIENCE = 1 | mechanical_fmu/test_start_along
START_PATIENCE = 10
# The least part of what acts by which more is tried.
# fault: a start far from its drawing is given up -> LEAST_PART = 2.0 | mechanical_fmu/test_start_far
LEAST_PART = 1.0 / 64.0


def started(system: System, u: Floats, loading: Loading, settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium that a scene begins in, u : (n_nodes, 2) [m] where it is drawn.

    Where cells are far from it (rubber that keeps its volume, 50 K from where it was drawn without stress) Newton's
    method turns them inside out.  Then parts of what acts are borne one after another, for a first guess alone: each
    is of what the scene begins with, so that nothing flows or slips on the way.
    Raises what advance.solved does.
    """
    patient = replace(settings, max_iterations=START_PATIENCE * settings.max_iterations)
    try:
        return solved(system, u, loading, resting(system, u, loading), None, patient)
    except (NoEquilibriumError, CellError) as exc:
        failed = exc
    at, share, step = u, 0.0, 0.5
    while True:
        goal = min(share + step, 1.0)
        part = loading if goal == 1.0 else _part(system, loading, goal)
        try:
            found = solved(system, at, part, system.balance(at, part, True), None, settings)
        except (NoEquilibriumError, CellError):
            step *= 0.5
            if step < LEAST_PART:
                raise failed from None
            continue
        if goal == 1.0:
            return found
        at, share = found.balance.u, goal


def _part(system: System, loading: Loading, share: float) -> Loading:
    """A share of what acts: thermal strain, loads and prescribed displacements."""
    moduli = tuple(replace(m, e_th=share * m.e_th) for m in loading.moduli)
    return replace(loading, moduli=moduli, target=share * loading.target, pressure=share * loading.pressure,
                   dead=None if loading.dead is None else share * loading.dead)
