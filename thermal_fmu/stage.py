"""One stage of a method: its residual, in joules, and the exact derivative of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from thermal_fmu.boundary import Boundary, boundary_flow
from thermal_fmu.held import Held, Scene
from thermal_fmu.loads import Loads
from thermal_fmu.methods import Stage
from thermal_fmu.volume import conduct, store

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StageProblem:
    """Find T_s with  E(T_s) - E(T_n) = dt (sum_j a_j F_j + a f(T_n + theta (T_s - T_n))).

    T_n : (n,) start of the step [K].  power_M : (n,) [W].  earlier : (n,) dt sum_j a_j F_j [J].
    stores : False drops the left side (steady).
    """

    scene: Scene
    held: Held
    loads: Loads
    stage: Stage
    dt: float
    T_n: Floats
    power_M: Floats
    earlier: Floats
    stores: bool


@dataclass(frozen=True)
class Balance:
    """A stage at one T.

    R : (n,) what is missing at each node [J]; at fixed nodes it is the heat that came through them.
    flow : (n,) [W] into the nodes, all but storage, held nodes' reactions included.
    terms : boundary terms [W].  stored : (n_bodies,) [J].  norm : sum of |R| at free nodes [J].  scale : sum of the
    sizes of all heats at all nodes [J].
    """

    R: Floats
    flow: Floats
    terms: Floats
    stored: Floats
    norm: float
    scale: float
    jacobian: csr_matrix | None

    @property
    def share(self) -> float:
        """norm as a share of scale."""
        return self.norm / self.scale if self.scale > 0 else 0.0


def balance(problem: StageProblem, T: Floats, jacobian: bool) -> Balance:
    """Residual (and Jacobian, rows and columns of fixed nodes replaced by the identity) at T_s = T : (n,) [K].

    Raises BadPropertyError.
    """
    scene, held, stage = problem.scene, problem.held, problem.stage
    volume, model = scene.volume, scene.model
    weight = stage.a * problem.dt
    data = np.zeros(volume.pattern.indices.size if jacobian else 0)
    S, f = np.zeros(volume.n), np.zeros(volume.n)
    T_f = T if stage.theta == 1.0 else (1.0 - stage.theta) * problem.T_n + stage.theta * T
    stored = np.zeros(len(model.bodies))
    if problem.stores:
        stored = store(volume, held.masses, model.bodies, problem.T_n, T, S, data)
    # The matrix is M + theta a dt K: half steps of backward Euler share it, to the bit, with the midpoint rule.
    slope = stage.theta * weight
    conduct(volume, held.shapes, model.bodies, T_f, f, slope, data)
    boundary = boundary_flow(model.films, held, problem.loads, problem.power_M, T_f)
    f += boundary.f
    R = S - problem.earlier - weight * f
    reaction = np.where(scene.fixed, R, 0.0)
    norm = float(np.abs(R - reaction).sum())
    scale = float(np.abs(S).sum() + np.abs(reaction).sum()) + weight * boundary.magnitude
    matrix = _matrix(scene, boundary, slope, data) if jacobian else None
    return Balance(R, f + reaction / weight, boundary.terms, stored, norm, scale, matrix)


def _matrix(scene: Scene, boundary: Boundary, slope: float, data: Floats) -> csr_matrix:
    pattern = scene.volume.pattern
    for slots, values in boundary.places:
        np.add.at(data, slots.ravel(), slope * values.ravel())
    touched, diagonal = scene.held_rows
    data[touched] = 0.0
    data[diagonal] = 1.0
    A = csr_matrix((data, pattern.indices, pattern.indptr), shape=(pattern.n, pattern.n))
    if not boundary.across:
        return A
    nodes = np.concatenate([nodes for nodes, _ in boundary.across])
    rows, cols = np.repeat(nodes, 4, axis=1).ravel(), np.tile(nodes, (1, 4)).ravel()
    values = slope * np.concatenate([values.ravel() for _, values in boundary.across])
    free = ~(scene.fixed[rows] | scene.fixed[cols])
    return A + csr_matrix((values[free], (rows[free], cols[free])), shape=A.shape)
