"""The equilibrium that a scene begins in: from the drawing, at once, or by way of ever more of what acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.advance import solved
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, SolverSettings
from mechanical_fmu.predicting import predicted
from mechanical_fmu.system import Loading, System
from mechanical_fmu.volume import CellError

Floats = NDArray[np.float64]

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
        return solved(system, u, loading, predicted(system, u, loading, True), None, patient)
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
