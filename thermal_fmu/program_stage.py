"""A stage whose inside of bodies is a program's: it takes heat or temperature at nodes and gives the other.

Nothing is known of a program but its answers.  A stage is solved by the cells of this half with a heat `defect` added
at the nodes, which is what the program needs at its temperatures less what the cells need there:

    solve the cells with the defect  ->  heat into the nodes, temperatures there
    run the program with the one     ->  the other
    defect = heat into the nodes - what the cells need at the program's temperatures

Where both have the same temperatures the answer is the program's, whatever the cells are: they only say where to look
next.  The fixed point is found by IQN-ILS, for where storage is shared among nodes in another way plain iteration
diverges.  Contact, films, fluxes and prescribed temperatures stay with the half, at their exact derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.program import ProgramError
from contact.half.quasi_newton import Column, Trail, quasi_newton_guess
from thermal_fmu.boundary import boundary_flow
from thermal_fmu.cells import MatrixEntries
from thermal_fmu.linear import AnchorMatrix, Factors, Learnt
from thermal_fmu.newton import NotConvergedError, SolvedStage, StageProblem, solve_stage
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.program import HeatTask, ThermalProgram

Floats = NDArray[np.float64]

MOST_RUNS = 40  # of the program, for one stage
MOST_COLUMNS = 12  # of differences that the next stage begins with
# Of the range of temperatures, and of the heat at nodes: a third of what two halves of one scene may differ by
# (coupler.report.verdict.UNSEEN), and what seven printed digits can tell.
AGREED = 3e-6
LEAST = 1e-9  # of the largest temperature: where all is even there is no range
# The part of a step towards the outcome, where nothing is known of the slope.  Where storage is shared among nodes,
# ours at the nodes takes up to three times the heat for what changes from node to node: a whole step diverges.
FIRST = 0.5


def solve_by_program(problem: StageProblem, s: Floats, program: ThermalProgram, factors: Factors,
                     anchor: AnchorMatrix | None) -> SolvedStage:
    """Solve a stage from the guess s : (n,) [K] (prescribed values already in it) so that program and surface agree.

    Raises ProgramError, and what solve_stage raises.
    """
    start, tolerance, nodes = start_of(problem), problem.scene.model.stated.tolerance, problem.scene.surface_nodes
    # fault: what was learnt of a program is forgotten -> learnt = None | thermal_fmu/test_thermal_program
    learnt = None if anchor is None else anchor.learnt
    older = () if learnt is None else tuple(zip(learnt.residuals, learnt.outcomes, strict=True))
    defect = np.zeros(s.size) if learnt is None else np.array(learnt.defect)
    trail, iterations, off = Trail(), 0, np.inf
    for runs in range(1, MOST_RUNS + 1):
        solved = solve_stage(replace(problem, defect=defect), s, tolerance, factors, anchor)
        s, anchor, iterations = solved.s, solved.anchor, iterations + solved.iterations
        told = _asked(problem, program, nodes, start, solved, defect)
        # fault: a program is asked once, and believed -> if runs > 0: | thermal_fmu/test_thermal_program
        if told.off <= 1.0:
            known = _with(anchor, defect, (*trail.columns, *older))
            return replace(solved, iterations=iterations, runs=runs, anchor=known)
        off = min(off, told.off)
        # fault: what the cells need is added -> outcome = told.given + needed(problem, told.s) |
        #   thermal_fmu/test_thermal_program
        outcome = told.given - needed(problem, told.s)
        trail = trail.plus(defect, defect + FIRST * (outcome - defect))
        guess = quasi_newton_guess(trail, older)
        defect = trail.outcomes[-1] if guess is None else guess
    raise NotConvergedError(f"{type(program).__name__} and the surface do not agree after {MOST_RUNS} runs: they are "
                            f"off by {off * AGREED:.2g} of the range of temperatures (bound {AGREED:g})")


def _with(anchor: AnchorMatrix | None, defect: Floats, columns: tuple[Column, ...]) -> AnchorMatrix | None:
    """The anchor with what was learnt; None where nothing was factored, so nothing changed."""
    n, kept = defect.size, columns[:MOST_COLUMNS]
    residuals, outcomes = (np.array([column[k] for column in kept]).reshape(-1, n) for k in (0, 1))
    return None if anchor is None else replace(anchor, learnt=Learnt(defect, residuals, outcomes))


@dataclass(frozen=True)
class _Told:
    """What a program said.  s : (n,) by its temperatures [K].  given : (n,) heat into the nodes [W].

    off : how far program and surface are apart, as a part of what they may be.
    """

    s: Floats
    given: Floats
    off: float


def _asked(problem: StageProblem, program: ThermalProgram, nodes: NDArray[np.intp], start: Floats,
           solved: SolvedStage, defect: Floats) -> _Told:
    stage, substep = problem.stage, problem.substep
    place = substep.place
    assert place is not None, "the half says where its nodes are"
    T = problem.s_n + stage.theta * (solved.s - problem.s_n) if stage.theta != 1.0 else solved.s
    # What holds a prescribed temperature is heat as well: the program is given it at those nodes.
    heat = np.where(problem.scene.fixed, needed(problem, solved.s) + defect,
                    boundary_flow(substep, problem.loads, problem.power_M, T).f)
    task = HeatTask(place.x, place.X, stage.theta * stage.a * problem.dt, start, heat, nodes, T[nodes])
    answer = program.step(task)
    if answer.T.shape != T.shape or not np.isfinite(answer.T).all():
        raise ProgramError(f"{type(program).__name__}.step: T must be {T.size} finite numbers")
    span = max(float(np.ptp(np.concatenate([start, T, answer.T]))), LEAST * float(np.abs(T).max()))
    # fault: program and surface agree at any distance -> off = 0.0 | thermal_fmu/test_thermal_program
    off = float(np.abs(answer.T - T).max()) / (AGREED * span)
    if program.takes == "temperature":
        if answer.heat is None or answer.heat.shape != nodes.shape or not np.isfinite(answer.heat).all():
            raise ProgramError(f"{type(program).__name__}.step: heat must be {nodes.size} finite numbers")
        size = max(float(np.abs(heat).max()), float(np.abs(answer.heat).max()))
        apart = float(np.abs(answer.heat - heat[nodes]).max())
        off = max(off, apart / (AGREED * size) if size > 0.0 else 0.0)
        heat = heat.copy()
        heat[nodes] = answer.heat
    s = problem.s_n + (answer.T - problem.s_n) / stage.theta
    return _Told(s, heat, off)


def needed(problem: StageProblem, s: Floats) -> Floats:
    """Return the heat (n,) [W] that the cells of this half need at the nodes for the stage to end at s : (n,) [K]."""
    scene, substep, stage = problem.scene, problem.substep, problem.stage
    S, f, nothing = np.zeros(s.size), np.zeros(s.size), MatrixEntries(np.zeros(0), 0.0)
    scene.bulk.store(substep, problem.s_n, s, S, nothing)
    T = problem.s_n + stage.theta * (s - problem.s_n) if stage.theta != 1.0 else s
    scene.bulk.conduct(substep, NodalFields(T), f, nothing)
    return np.asarray((S - problem.earlier) / (stage.a * problem.dt) - f)


STARTS = 30  # Newton's iterations for a start; one where the heat capacity is constant


def start_of(problem: StageProblem) -> Floats:
    """Return the temperatures (n,) [K] from which a step of implicit Euler is the stage.

    The flows of earlier stages are in the enthalpy already: E(T) - E(s_n) = sum of them.
    """
    T, bulk, substep = problem.s_n.copy(), problem.scene.bulk, problem.substep
    if not problem.earlier.any():
        return T
    for _ in range(STARTS):
        S = np.zeros(T.size)
        bulk.store(substep, problem.s_n, T, S, MatrixEntries(np.zeros(0), 0.0))
        C = bulk.capacities(substep, T)
        # fault: the second stage starts where the first did -> step = np.zeros(T.size) |
        #   thermal_fmu/test_thermal_program
        step = np.divide(problem.earlier - S, C, out=np.zeros(T.size), where=C > 0.0)
        T = T + step
        if np.abs(step).max() <= 4.0 * np.finfo(float).eps * np.abs(T).max():
            break
    return T
