"""Contact by its penalty alone: the pressure is eps_N times the depth, and nothing is left to settle."""

from __future__ import annotations

from mechanical_fmu.newton import Equilibrium, SolverSettings, solve
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import StiffnessAnchor


def solve_by_penalty(system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
                     settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to start, with the multipliers of contact as they are.

    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """
    return solve(system, loading, start, anchor, settings)
