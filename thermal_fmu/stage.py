"""One stage of a method: its residual, in joules, and the exact derivative of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from thermal_fmu import phase_change
from thermal_fmu.boundary import BoundaryHeat, boundary_flow
from thermal_fmu.cells import MatrixEntries, conduct, store
from thermal_fmu.methods import Stage
from thermal_fmu.scene import SubstepData, ThermalScene
from thermal_fmu.sources import ThermalLoads

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StageProblem:
    """Find s with  E(s) - E(s_n) = dt (sum_j a_j F_j + a f(T_n + theta (T(s) - T_n))).

    s_n : (n,) start of the step [K], T itself in bodies that do not melt.  power_M : (n,) [W].
    earlier : (n,) dt sum_j a_j F_j [J].  stores : False drops the left side (steady).  blur : 0 is the problem itself,
    up to 1 a smoothed one in which melting shows less and less in T(s) (phase_change.blurred).
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


@dataclass(frozen=True)
class StageBalance:
    """The heat balance of a stage at one T.

    R : (n,) residual at each node [J]; at fixed nodes it is the heat that came through them.
    flow : (n,) [W] into the nodes, all but storage, fixed nodes' reactions included.  inside : (n,) [W] the part of
    it that does not come through the surface: flow - inside does, by consistent recovery.
    terms : (n_terms,) boundary terms [W].  stored : (n_bodies,) [J].  norm : sum of |R| at free nodes [J].  scale : sum
    of
    the sizes of all heats at all nodes [J].
    """

    R: Floats
    flow: Floats
    inside: Floats
    terms: Floats
    stored: Floats
    norm: float
    scale: float
    jacobian: csr_matrix | None

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
        into = scene.matrix_cache.fill(volume, model.bodies, substep.masses, substep.shapes, into, problem.stores)
    stored = np.zeros(len(model.bodies))
    if problem.stores:
        stored = store(volume, substep.masses, model.bodies, problem.s_n, s, S, into)
    # fault: conductivity of the start of the step -> import thermal_fmu.cells as lagging; right = lagging.at_points;
    #   lagging.at_points = lambda T, cells, N: right(problem.s_n, cells, N); conduct(volume, substep.shapes,
    #   model.bodies, at, f, into); lagging.at_points = right | thermal_fmu/test_thermal_order
    conduct(volume, substep.shapes, model.bodies, at, f, into)
    # fault: boundary terms at the start of the step -> boundary = boundary_flow(substep, problem.loads,
    #   problem.power_M, problem.s_n) | thermal_fmu/test_thermal_time
    boundary = boundary_flow(substep, problem.loads, problem.power_M, at.T)
    inside = f + boundary.inside
    f += boundary.f
    R = S - problem.earlier - weight * f
    reaction = np.where(scene.fixed, R, 0.0)
    norm = float(np.abs(R - reaction).sum())
    scale = float(np.abs(S).sum() + np.abs(reaction).sum()) + weight * boundary.magnitude
    matrix = _matrix(scene, boundary, slope, at.dT, data) if jacobian else None
    return StageBalance(R, f + reaction / weight if weight else f, inside, boundary.terms, stored, norm, scale, matrix)


def _matrix(scene: ThermalScene, boundary: BoundaryHeat, slope: float, dT: Floats | None, data: Floats) -> csr_matrix:
    pattern = scene.volume.pattern
    for slots, values in boundary.places:
        change = slope * values.ravel()
        # fault: boundary terms of a melting node unscaled -> np.add.at(data, slots.ravel(), change) |
        #   thermal_fmu/test_thermal_anisotropy::test_the_jacobian_is_the_derivative
        np.add.at(data, slots.ravel(), change if dT is None else change * dT[pattern.indices[slots.ravel()]])
    touched, diagonal = scene.fixed_entries
    data[touched] = 0.0
    data[diagonal] = 1.0
    A = csr_matrix((data, pattern.indices, pattern.indptr), shape=(pattern.n, pattern.n))
    if not boundary.across:
        return A
    nodes = np.concatenate([nodes for nodes, _ in boundary.across])
    rows, cols = np.repeat(nodes, 4, axis=1).ravel(), np.tile(nodes, (1, 4)).ravel()
    values = slope * np.concatenate([values.ravel() for _, values in boundary.across])
    if dT is not None:
        # fault: contact of a melting node unscaled -> values *= 1.0 |
        #   thermal_fmu/test_thermal_anisotropy::test_the_jacobian_is_the_derivative
        values *= dT[cols]
    free = ~(scene.fixed[rows] | scene.fixed[cols])
    return A + csr_matrix((values[free], (rows[free], cols[free])), shape=A.shape)
