"""How contact is enforced: one file and one row of ENFORCEMENTS for each way to find equilibrium and pressures."""

from __future__ import annotations

from typing import Protocol

from mechanical_fmu.contact_query import ContactQuery
from mechanical_fmu.newton import Equilibrium, SolverSettings
from mechanical_fmu.penalty import solve_by_penalty
from mechanical_fmu.semi_smooth import solve_at_once
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import StiffnessAnchor
from mechanical_fmu.uzawa import solve_in_rounds


class Enforcement(Protocol):
    """Finds the equilibrium nearest to start and the multipliers that belong to it.

    anchor : whose factor to use as long as it serves, None for a fresh tangent in every iteration.
    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """

    def __call__(self, system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
                 settings: SolverSettings) -> Equilibrium:
        """Solve one step."""
        ...


# By the name in model.json; "penalty" is that of pairs without `augmented`.
ENFORCEMENTS: dict[str, Enforcement] = {
    "penalty": solve_by_penalty,
    "uzawa": solve_in_rounds,
    "semi_smooth": solve_at_once,
}


def solve_step(system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
               settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to start by the enforcement of the scene; by penalty where nothing can touch.

    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """
    name = system.spec.enforcement if isinstance(loading.query, ContactQuery) else "penalty"
    return ENFORCEMENTS[name](system, loading, start, anchor, settings)
