"""Prescribed displacements, the rigid motions they leave free, and the predictor that moves a driven body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Values
from contact.half.signal import Signal
from mechanical_fmu.boundary_spec import Displacement
from mechanical_fmu.loads import driven
from mechanical_fmu.rigid_bodies import RigidBodies

Floats = NDArray[np.float64]

# A node nearer to the axis than this share of the mesh's size is on it.
ON_AXIS = 1e-12
# Rank of the constraints on one body's three rigid motions, relative to the best constrained one.
RANK = 1e-10


@dataclass(frozen=True)
class Constraints:
    """Degrees of freedom (2 node + component) whose value is given.

    fixed : (n_fixed,) degrees of freedom, ascending.  source : (n_fixed,) index into signals, -1 for a plain 0.
    names : of the inputs of each signal, "" for none.  scale : (n_signals,) 1, or the length that turns an angle
    into a reference row's displacement.  free : (2 n_nodes,) 1.0 where free, else 0.0 (nodes of rigid bodies are
    neither free nor fixed: they follow).
    node_body : (n_nodes,), -1 where no cell is.  n_bodies.  axisymmetric : then a body can only move along y.
    """

    fixed: NDArray[np.intp]
    source: NDArray[np.intp]
    signals: tuple[Signal, ...]
    names: tuple[str, ...]
    free: Floats
    node_body: NDArray[np.int32]
    n_bodies: int
    axisymmetric: bool
    scale: tuple[float, ...]
    rigid: RigidBodies | None = None

    def values(self, t: float, side: int, inputs: Values) -> Floats:
        """(n_fixed,) displacements [m] at time t, from the given side of a jump."""
        numbers = [driven(s, n, t, side, inputs) * length
                   for s, n, length in zip(self.signals, self.names, self.scale, strict=True)]
        return np.array([*numbers, 0.0])[self.source]

    def moved(self, u: Floats, target: Floats) -> Floats:
        """u with every driven body moved rigidly, by its mean prescribed increment in each component.

        Without it a large sliding step would shear the driven row of cells flat before the first iteration.
        """
        increment = target - u.ravel()[self.fixed]
        body = self.node_body[self.fixed // 2]
        group = 2 * body + self.fixed % 2
        inside = body >= 0
        size = 2 * self.n_bodies
        n = np.bincount(group[inside], minlength=size)
        total = np.bincount(group[inside], weights=increment[inside], minlength=size)
        # fault: predictor leaves driven bodies behind -> mean = 0.0 * (total / np.maximum(n, 1)).reshape(-1, 2) |
        #   mechanical_fmu/test_elastic_patch
        mean = (total / np.maximum(n, 1)).reshape(-1, 2)
        moved = u + np.where(self.node_body[:, None] >= 0, mean[self.node_body], 0.0)
        if self.rigid is None:
            return moved
        moved.ravel()[self.fixed[~inside]] = target[~inside]
        return self.rigid.placed(moved)

    def loose_motions(self, x: Floats) -> tuple[tuple[int, Floats], ...]:
        """(body, Z) of bodies that could move rigidly: Z : (3, n_motions) combines moving along x, y and turning.

        x : (n_nodes, 2) [m].  Turning is about the body's middle, by an angle of 1/size.
        """
        loose = []
        for body in range(self.n_bodies):
            C = self.rigid_motions(x, body)[self.fixed[self.holder[self.fixed // 2] == body]]
            if self.axisymmetric:
                C = np.vstack([C, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
            values, vectors = np.linalg.eigh(C.T @ C)
            Z = vectors[:, values <= RANK * max(values[-1], 1.0)]
            if Z.shape[1]:
                loose.append((body, Z))
        return tuple(loose)

    def rigid_motions(self, x: Floats, body: int) -> Floats:
        """(2 n_nodes, 3): moving along x, along y, turning; 0 on other bodies."""
        here = self.node_body == body
        offset = x - 0.5 * (x[here].max(axis=0) + x[here].min(axis=0))
        size = max(float(np.abs(offset[here]).max()), np.finfo(float).tiny)
        motions = np.zeros((len(x), 2, 3))
        motions[here, 0, 0] = motions[here, 1, 1] = 1.0
        motions[here, 0, 2] = -offset[here, 1] / size
        motions[here, 1, 2] = offset[here, 0] / size
        if self.rigid is not None:
            for k in np.flatnonzero(self.rigid.body == body):
                point, turn = self.rigid.point_rows[k], self.rigid.turn_rows[k]
                motions[point] = [[1.0, 0.0, -offset[point, 1] / size], [0.0, 1.0, offset[point, 0] / size]]
                motions[turn, 0, 2] = self.rigid.size[k] / size
        return motions.reshape(-1, 3)

    @cached_property
    def holder(self) -> NDArray[np.int32]:
        """(n_nodes,) the body a row belongs to, reference rows of rigid bodies too; -1 where none."""
        if self.rigid is None:
            return self.node_body
        holder = self.node_body.copy()
        holder[self.rigid.point_rows] = holder[self.rigid.turn_rows] = self.rigid.body
        return holder


def constraints_of(interface: Interface, displacements: Sequence[Displacement],
                   rigid: RigidBodies | None = None) -> Constraints:
    """Collect the prescribed components.

    On the axis u_r = 0; a node no cell uses stays.  interface : with the reference rows of rigid bodies.
    Raises ValueError where two prescriptions disagree on a node, or one holds a node of a rigid body.
    """
    given: dict[int, int] = {}
    for i, d in enumerate(displacements):
        for dof in _dofs(d, rigid):
            first = given.setdefault(int(dof), i)
            # fault: disagreeing prescriptions taken -> if first != i and first < 0: | mechanical_fmu/test_elastic_spec
            if first != i and not _same(displacements[first], d):
                raise ValueError(f"model.json: boundary on {displacements[first].on} and on {d.on} both prescribe "
                                 f"component {d.component} of node {dof // 2 + 1}, differently")
    for dof in np.flatnonzero(_still(interface, rigid)):
        given.setdefault(int(dof), -1)
    fixed = np.array(sorted(given), dtype=np.intp)
    free = np.ones(2 * len(interface.nodes))
    free[fixed] = 0.0
    if rigid is not None:
        free[rigid.slaves] = 0.0
    scale = [1.0 if rigid is None or d.component < 2 else float(rigid.size[d.rigid]) for d in displacements]
    return Constraints(fixed, np.array([given[int(d)] for d in fixed], dtype=np.intp),
                       tuple(d.value for d in displacements), tuple(d.name for d in displacements), free,
                       interface.node_body, len(interface.bodies), interface.axisymmetric, tuple(scale), rigid)


def _dofs(d: Displacement, rigid: RigidBodies | None) -> NDArray[np.intp]:
    if d.rigid >= 0:
        assert rigid is not None
        return rigid.dofs[d.rigid, [d.component]]
    dofs = (2 * d.nodes + d.component).astype(np.intp)
    if rigid is not None and np.isin(dofs, rigid.slaves).any():
        raise ValueError(f"model.json: boundary on {d.on} holds nodes of a rigid body; "
                         "prescribe the motion of the body itself: on: BODY, component 0, 1 or 2 (angle)")
    return dofs


def _still(interface: Interface, rigid: RigidBodies | None) -> NDArray[np.bool_]:
    """(2 n_nodes,) what can never move: strays, the axis, and of rigid bodies what has no meaning."""
    still = np.repeat(interface.node_body < 0, 2)
    if interface.axisymmetric:
        still[::2] |= np.abs(interface.nodes[:, 0]) <= ON_AXIS * np.ptp(interface.nodes)
    if rigid is not None:
        still[2 * rigid.first :] = False
        still[2 * rigid.turn_rows + 1] = True
        if interface.axisymmetric:
            still[rigid.dofs[:, [0, 2]]] = True
        still[rigid.slaves] = False
    return still


def _same(a: Displacement, b: Displacement) -> bool:
    return a.name == b.name and np.array_equal(a.value.t, b.value.t) and np.array_equal(a.value.value, b.value.value)
