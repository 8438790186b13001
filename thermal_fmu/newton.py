"""One stage of a method: its heat balance, and Newton's method for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import Field, dataclass, replace
from functools import partial
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from thermal_fmu import phase_change
from thermal_fmu.boundary import BoundaryHeat, boundary_flow, demand_limits, with_source
from thermal_fmu.cells import BadPropertyError, MatrixEntries
from thermal_fmu.kernels import with_blocks
from thermal_fmu.linear import AnchorMatrix, Factors, solve
from thermal_fmu.methods import Stage
from thermal_fmu.phase_change import temperature
from thermal_fmu.scene import SubstepData, ThermalScene
from thermal_fmu.settled import STAGE_TOLERANCE, STALLED, is_solved, left_over
from thermal_fmu.sources import ThermalLoads
from thermal_fmu.surface_terms import at_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


# One stage of a method: its residual, in joules, and the exact derivative of it.

@dataclass(frozen=True)
class StageProblem:
    """Find s with  E(s) - E(s_n) = dt (sum_j a_j F_j + a f(T_n + theta (T(s) - T_n))).

    s_n : (n,) start of the step [K], T itself in bodies that do not melt.  power_M : (n,) [W].
    earlier : (n,) dt sum_j a_j F_j [J].  stores : False drops the left side (steady).  blur : 0 is the problem itself,
    up to 1 a smoothed one in which melting shows less and less in T(s) (phase_change.blurred).
    defect : (n,) [W] that the program which solves for the inside of bodies needs beyond the cells; None: no program.
    """

    scene: ThermalScene
    substep: SubstepData
    loads: ThermalLoads
    stage: Stage
    dt: float
    s_n: Floats
    power_M: Floats
    earlier: Floats
    stores: bool
    blur: float = 0.0
    defect: Floats | None = None


@dataclass(frozen=True)
class StageBalance:
    """The heat balance of a stage at one T.

    R : (n,) residual at each node [J]; at fixed nodes it is the heat that came through them.
    flow : (n,) [W] into the nodes, all but storage, fixed nodes' reactions included.  inside : (n,) [W] the part of
    it that does not come through the surface: flow - inside does, by consistent recovery.  given : (n,) [W] the part of
    it that comes whatever the surroundings are, as sources do.
    terms : (n_terms,) boundary terms [W], each : as BoundaryHeat has it.  stored : (n_bodies,) [J].
    norm : sum of |R| at free nodes [J].  missing : |sum of R| there [J].  scale : sum of the sizes of all heats at all
    nodes [J].
    pull : (n,) [J] what the change of prescribed values since s_n does to the residual of their neighbours: their
    columns are not in the jacobian; None where nothing changed, or without one.
    moved : sum over the nodes of what each took up or gave off [J].
    """

    R: Floats
    flow: Floats
    inside: Floats
    given: Floats
    terms: Floats
    each: Floats
    stored: Floats
    norm: float
    missing: float
    scale: float
    jacobian: csr_matrix | None
    pull: Floats | None = None
    moved: float = 0.0

    @property
    def relative_residual(self) -> float:
        """norm as a part of scale [1]."""
        return self.norm / self.scale if self.scale > 0 else 0.0


def balance(problem: StageProblem, s: Floats, jacobian: bool) -> StageBalance:
    """Evaluate the residual at s : (n,) [K], and its derivative by s where asked for.

    Rows and columns of fixed nodes are replaced by the identity.  Raises BadPropertyError.
    """
    scene, substep, stage = problem.scene, problem.substep, problem.stage
    volume, model = scene.volume, scene.model
    weight = stage.a * problem.dt
    data = np.zeros(volume.pattern.indices.size if jacobian else 0)
    S, f = np.zeros(volume.n), np.zeros(volume.n)
    at = phase_change.fields(scene.melting, s)
    if problem.blur > 0.0:
        at = phase_change.blurred(scene.melting, at, s, problem.blur, scene.fixed)
    if stage.theta != 1.0:
        at = phase_change.between(phase_change.fields(scene.melting, problem.s_n), at, stage.theta)
    if not problem.stores:
        at = phase_change.sloped(at)
    # The matrix is M + theta a dt K: half steps of backward Euler share it, to the bit, with the midpoint rule.
    slope = stage.theta * weight
    into = MatrixEntries(data, slope)
    if jacobian:
        into = scene.bulk.fill(substep, into, problem.stores)
    stored = np.zeros(len(model.bodies))
    if problem.stores:
        stored = scene.bulk.store(substep, problem.s_n, s, S, into)
    # fault: conductivity of the start of the step -> import thermal_fmu.cells as lagging; right = lagging.potential;
    #   lagging.potential = lambda k, block, T: right(k, block, problem.s_n); scene.bulk.conduct(substep, at, f, into);
    #   lagging.potential = right | thermal_fmu/test_thermal_order
    scene.bulk.conduct(substep, at, f, into)
    if substep.added is not None:
        substep.added.conduct(at.T, at.dT, f, MatrixEntries(data, slope))
    # fault: boundary terms at the start of the step -> boundary = boundary_flow(substep, problem.loads,
    #   problem.power_M, problem.s_n) | thermal_fmu/test_thermal_time
    boundary = boundary_flow(substep, problem.loads, problem.power_M, at.T)
    if (made := scene.bulk.made(substep, at)) is not None:
        boundary = with_source(boundary, made)
    if problem.defect is not None:
        f -= problem.defect
    inside = f + boundary.inside
    f += boundary.f
    R = S - problem.earlier - weight * f
    reaction = np.where(scene.fixed, R, 0.0)
    free = R - reaction
    norm, missing = float(np.abs(free).sum()), abs(float(free.sum()))
    moved = float(np.abs(S).sum())
    of_own = moved if substep.solved is None else float(np.abs(S[substep.solved]).sum())
    scale = moved + float(np.abs(reaction).sum()) + weight * boundary.magnitude
    matrix, pull = None, None
    if jacobian:
        lifted = np.where(scene.fixed, s - problem.s_n, 0.0)
        matrix, pull = matrix_of(scene, boundary, slope, at.dT, data, lifted)
    flow = f + reaction / weight if weight else f
    return StageBalance(R, flow, inside, boundary.given, boundary.terms, boundary.each, stored, norm, missing, scale,
                        matrix, pull, of_own)


def matrix_of(scene: ThermalScene, boundary: BoundaryHeat, slope: float, dT: Floats | None, data: Floats,
            lifted: Floats) -> tuple[csr_matrix, Floats | None]:
    """Return the matrix, rows and columns of fixed nodes those of the identity, and those columns times lifted : (n,).
    """
    pattern = scene.volume.pattern
    for slots, values in boundary.places:
        change = slope * values.ravel()
        # fault: boundary terms of a melting node unscaled -> np.add.at(data, slots.ravel(), change) |
        #   thermal_fmu/test_thermal_anisotropy::test_the_jacobian_is_the_derivative
        np.add.at(data, slots.ravel(), change if dT is None else change * dT[pattern.indices[slots.ravel()]])
    pull = pattern.of(data) @ lifted if lifted.any() else None
    touched, diagonal = scene.fixed_entries
    data[touched] = 0.0
    data[diagonal] = 1.0
    A = pattern.of(data)
    if not boundary.across:
        return A, pull
    for nodes, values in _by_size(boundary.across):
        values *= slope
        if dT is not None:
            # fault: contact of a melting node unscaled -> values *= 1.0 |
            #   thermal_fmu/test_thermal_anisotropy::test_the_jacobian_is_the_derivative
            values *= dT[nodes][:, None, :]
        if pull is not None:
            pull += at_nodes(nodes, (values * lifted[nodes][:, None, :]).sum(axis=2), lifted.size)
        # In place of a sum of matrices, which sorts and checks all places again: a third of the time of all of this.
        A.indptr, A.indices, A.data = with_blocks(A.indptr, A.indices, A.data, nodes, values, scene.fixed)
    return A, pull


def _by_size(blocks: Sequence[tuple[Ints, Floats]]) -> Iterator[tuple[Ints, Floats]]:
    """Yield nodes : (m, k) and values : (m, k, k) of all blocks of each size."""
    for k in sorted({nodes.shape[1] for nodes, _ in blocks}):
        same = [block for block in blocks if block[0].shape[1] == k]
        yield np.concatenate([nodes for nodes, _ in same]), np.concatenate([values for _, values in same])


# Newton's method for one stage: line search, linear solves about an anchor matrix, and phase continuation.

MAX_ITERATIONS = 25  # quadratic convergence needs a handful, a peaked c(T) with halved steps some more
MAX_HALVINGS = 8  # a step worth less than 1/256 of Newton's is no step
SUFFICIENT_DECREASE = 1e-4  # Armijo's constant: least relative decrease, times the part of the full step
# Where a node is at the edge of a phase no step may lower the residual, yet a short one beyond it has the other side's
# slopes.  A scene that melts may take so many that raise it.
MAX_CLIMBS = 8
LINEAR_TOLERANCE = 0.3  # of the stage's tolerance, so that a linear scene takes one solve
ROUND_OFF = 16.0 * np.finfo(float).eps  # of |J| |T|: what the residual cannot resolve
MOST_ROUND_OFF = 10.0  # of the model's tolerance: where a step goes, T may be of no sense

# Phase continuation: blur from 1 down by BLUR_FACTOR to LEAST_BLUR, then none.  Slabs of 40 cells that freeze or melt
# in one step took 16 solves in the median, one in twenty more than 110, at worst 2 200 (docs/design.md).  Newton's
# method alone goes from cell to cell and stops where a node is between two phases.
BLUR_FACTOR = 0.3
LEAST_BLUR = 1e-4
BLURRED_TOLERANCE = 0.1  # relative residual to which a blurred problem is solved
MAX_RETREATS = 20  # each goes back half of the step (in the logarithm) to the last blur that was solved


class NotConvergedError(ArithmeticError):
    """Newton's method did not reach the tolerance."""


@dataclass(frozen=True)
class Linearisation:
    """The last matrix of a stage.

    s : (n,) [K] where it is the derivative.  jacobian, pull : as in StageBalance.
    """

    s: Floats
    jacobian: csr_matrix
    pull: Floats | None


@dataclass(frozen=True)
class SolvedStage:
    """A stage that was solved.

    s : (n,) [K].  iterations : linear solves.  residual : norm beyond round-off over scale [1].
    anchor : of the next solve.
    linear : its last matrix.  runs : of a program that solves for the inside of bodies.
    """

    s: Floats
    balance: StageBalance
    iterations: int
    residual: float
    anchor: AnchorMatrix | None
    linear: Linearisation
    runs: int = 0


def solve_stage(problem: StageProblem, s: Floats, tolerance: float, factors: Factors,
                anchor: AnchorMatrix | None) -> SolvedStage:
    """Solve a stage from the guess s : (n,) [K] (prescribed values already in it).

    Converged where the sum of |R| is a tenth of `tolerance` times the sum of all |heats|, or is round-off.
    Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    try:
        solved = newton(problem, s, tolerance, factors, anchor)
    except NotConvergedError:
        if not problem.scene.melting:
            raise

        def blurred(blur: float, last: SolvedStage | None, goal: float) -> SolvedStage:
            guess, known = (s, anchor) if last is None else (last.s, last.anchor)
            return newton(replace(problem, blur=blur), guess, goal, factors, known)

        # fault: no detour through blurred laws -> raise |
        #   thermal_fmu/test_thermal_phase::test_a_slab_that_changes_phase_in_one_step_converges
        solved = phase_continuation(blurred, tolerance)
    demand_limits(problem.substep, problem.loads, temperature(problem.scene.melting, solved.s))
    return solved


class Solution(Protocol):
    """A dataclass that says what a solution cost.  iterations : linear solves."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def iterations(self) -> int: ...


Solved = TypeVar("Solved", bound=Solution)


def phase_continuation(solve: Callable[[float, Solved | None, float], Solved], tolerance: float) -> Solved:
    """Solve a stage along problems whose melting is blurred less and less, each from the solution of the one before.

    solve : (blur, that solution or None, tolerance) -> solution.  Raises NotConvergedError, and what solve raises.
    """
    blur, sharper, done, spent, retreats = 1.0, BLUR_FACTOR, 1.0, 0, 0
    last: Solved | None = None
    while True:
        try:
            solved = solve(blur, last, tolerance if blur == 0.0 else BLURRED_TOLERANCE)
        except NotConvergedError:
            if blur == 1.0 or retreats == MAX_RETREATS:
                raise
            sharper, retreats = sharper**0.5, retreats + 1
            blur = max(done, LEAST_BLUR) * sharper
            continue
        spent += solved.iterations
        # fault: a solution of the blurred law taken for the true one -> if blur < 0.01: |
        #   thermal_fmu/test_thermal_phase::test_a9_no_step_loses_latent_heat
        #   thermal_fmu/test_thermal_phase::test_a_slab_that_changes_phase_in_one_step_converges
        if blur == 0.0:
            return replace(solved, iterations=spent)
        last, done = solved, blur
        blur = blur * sharper if blur * sharper >= LEAST_BLUR else 0.0


def newton(problem: StageProblem, s: Floats, tolerance: float, factors: Factors,
           anchor: AnchorMatrix | None) -> SolvedStage:
    """Solve as solve_stage does from s : (n,) [K], without phase continuation."""
    now = balance(problem, s, jacobian=True)
    linear = _linearised(s, now)
    weight = _column_sums(now.jacobian)
    floor = float(ROUND_OFF * (weight @ np.abs(s)))
    climbs = MAX_CLIMBS if problem.scene.melting else 0
    # fault: infinite heat taken for convergence -> pass |
    #   thermal_fmu/test_thermal_newton::test_heat_that_is_not_finite_names_body_and_node
    _demand_finite(problem, now.R, "the heat")
    last: StageBalance | None = None
    for iteration in range(MAX_ITERATIONS):
        if is_solved(now, last, tolerance, floor):
            return SolvedStage(s, now, iteration, left_over(now, floor), anchor, linear)
        last = now
        if now.jacobian is None:
            now = balance(problem, s, jacobian=True)
            linear = _linearised(s, now)
            weight = _column_sums(now.jacobian)
        assert now.jacobian is not None
        target = LINEAR_TOLERANCE * max(STAGE_TOLERANCE * tolerance * now.scale, min(floor, STALLED * now.norm))
        solution = solve(now.jacobian, np.where(problem.scene.fixed, 0.0, -now.R), target, anchor, factors,
                         floor)
        step, anchor = solution.x, solution.anchor
        _demand_finite(problem, step, f"the temperature of iteration {iteration + 1}")
        size = float(weight @ np.abs(s + step))
        # fault: round-off by the guess alone -> floor += 0.0 | thermal_fmu/test_thermal_exchange
        floor = max(floor, float(min(ROUND_OFF * size, MOST_ROUND_OFF * tolerance * now.scale)))
        s, now = descend(partial(balance, problem, jacobian=False), s, step, now, floor, climbs > 0)
        climbs -= int(now.norm >= last.norm and now.norm > floor)
    raise NotConvergedError(f"{MAX_ITERATIONS} iterations left a residual of {now.relative_residual:.2e} of the heat "
                            f"that flows (tolerance {STAGE_TOLERANCE * tolerance:.1e})")


def _linearised(s: Floats, now: StageBalance) -> Linearisation:
    assert now.jacobian is not None
    return Linearisation(s, now.jacobian, now.pull)


class LineSearchBalance(Protocol):
    """A balance as a line search sees it: the sum of |R| [J], and it as a part of the heat that flows [1]."""

    @property
    def norm(self) -> float: ...
    @property
    def relative_residual(self) -> float: ...


B = TypeVar("B", bound=LineSearchBalance)


def descend(balance_at: Callable[[Floats], B], s: Floats, step: Floats, before: B, floor: float,
            may_climb: bool) -> tuple[Floats, B]:
    """Find the longest of the steps 1, 1/2, 1/4 ... that lowers the residual and meets no bad property.

    balance_at : evaluates the balance at an s : (n,) [K].  s : (n,) [K].  step : (n,) Newton's step [K].  floor : the
    residual that is round-off [J].  may_climb : whether the best of the steps will do where none lowers the residual.
    Returns the new s and its balance.  Raises NotConvergedError, BadPropertyError.
    """
    scale = 1.0
    refused: BadPropertyError | None = None
    best: tuple[Floats, B] | None = None
    for _ in range(MAX_HALVINGS):
        trial = s + scale * step
        try:
            after = balance_at(trial)
        except BadPropertyError as exc:
            refused = exc
        else:
            if after.norm <= max((1.0 - SUFFICIENT_DECREASE * scale) * before.norm, floor):
                return trial, after
            if best is None or after.norm < best[1].norm:
                best = trial, after
        scale *= 0.5
    if may_climb and best is not None:
        return best
    if refused is not None:
        raise refused
    raise NotConvergedError(f"no step along Newton's direction lowers the residual of {before.relative_residual:.2e} "
                            "of the heat that flows")


def _demand_finite(problem: StageProblem, values: Floats, what: str) -> None:
    """Raise NotConvergedError naming the first node at which values : (n,) are not finite."""
    if np.isfinite(values).all():
        return
    interface = problem.scene.interface
    node = int(np.flatnonzero(~np.isfinite(values))[0])
    of = interface.node_body[node]
    raise NotConvergedError(f"{what} is not finite at node {node + 1} of "
                            f"{f'body {interface.bodies[of]}' if of >= 0 else 'no body'}")


def _column_sums(A: csr_matrix | None) -> Floats:
    """Return (n,) the sums of the sizes of a matrix's columns: times |s|, the sum of |A| |s|."""
    assert A is not None
    return np.asarray(np.bincount(A.indices, np.abs(A.data), A.shape[1]), dtype=np.float64)
