"""The entropy part of the adiabatic split: a temperature jump at the start of a substep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.boundary import TERMS
from thermal_fmu.heat import Heat, both_ways
from thermal_fmu.loads import loads_at
from thermal_fmu.methods import Stage
from thermal_fmu.newton import solve_stage
from thermal_fmu.solver import Anchor, Factors
from thermal_fmu.stage import StageProblem
from thermal_fmu.step import Course, Stepped
from thermal_fmu.volume import spread_energies

Floats = NDArray[np.float64]


def entropy_jump(course: Course, E_S: Floats, s_n: Floats, anchor: Anchor | None, factors: Factors,
                 t: float) -> Stepped:
    """Find s with E(s) - E(s_n) = E_S spread over the nodes; prescribed nodes stay, and what they hold back counts.

    E_S : (n_cells,) [J].  factors, anchor : the jump's own, for its matrix is that of storage alone.
    Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    scene = course.scene
    given = spread_energies(scene.volume, course.held.shapes, E_S)
    loads = loads_at(scene.model, course.load, course.calendar.snap(t, 0.0), 1)
    problem = StageProblem(scene, course.held, loads, Stage(0.0, 1.0, 1.0), 0.0, s_n, course.power_M, given, True)
    solved = solve_stage(problem, s_n, scene.model.stepping.tolerance, factors, anchor)
    terms = np.zeros(len(TERMS))
    terms[TERMS.index("entropy")] = E_S.sum()
    held_back = np.where(scene.fixed, solved.balance.R, 0.0)
    # fault: entropy part at held nodes lost -> heat = Heat(solved.balance.stored, both_ways(0.0 * held_back), terms) |
    #   thermal_fmu/test_thermal_entropy
    heat = Heat(solved.balance.stored, both_ways(held_back), terms)
    return Stepped(solved.s, heat, solved.iterations, solved.residual, solved.anchor, given + held_back, given)
