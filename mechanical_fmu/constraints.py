"""Prescribed displacements, the rigid motions they leave free, and the predictor that moves a driven body."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.interface import Interface
from contact.half.turns import rotated, turn_between
from mechanical_fmu.cells import Cells
from mechanical_fmu.motions import Motions, motions_of
from mechanical_fmu.problem import Displacement
from mechanical_fmu.strain import Modes

# Rigid bodies among deformable ones: their nodes follow a reference point and an angle, exactly.
#
# x = x_ref + R(theta) (X - X_ref).  Two rows are added to the nodal arrays for each rigid body: (u_ref,x, u_ref,y) and
# (theta L, 0), L its half size, so that all unknowns are lengths and all residuals forces.  The nodes are eliminated:
# with G = dx/d(unknowns) the forces are G'f and the stiffness G'K G + f . d2x/dtheta2.  Nothing is penalised.

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RigidBodies:
    """body : (n_rigid,) index into the interface's bodies.  reference : (n_rigid, 2) [m].  size : (n_rigid,) [m].

    first : row of the first reference row, the number of nodes of the mesh.  nodes : (n_s,) nodes of rigid bodies.
    owner : (n_s,) index into body.  arm : (n_s, 2) X - X_ref [m].
    """

    body: NDArray[np.intp]
    reference: Floats
    size: Floats
    first: int
    nodes: NDArray[np.intp]
    owner: NDArray[np.intp]
    arm: Floats

    @property
    def point_rows(self) -> NDArray[np.intp]:
        """Return (n_rigid,) row of each reference point's displacement."""
        return self.first + 2 * np.arange(len(self.body))

    @property
    def turn_rows(self) -> NDArray[np.intp]:
        """Return (n_rigid,) row of each angle."""
        return self.point_rows + 1

    @property
    def n_rows(self) -> int:
        """Count the rows of the nodal arrays, reference rows included."""
        return self.first + 2 * len(self.body)

    @cached_property
    def dofs(self) -> NDArray[np.intp]:
        """Return (n_rigid, 3) degrees of freedom of u_x, u_y and the angle."""
        return np.stack([2 * self.point_rows, 2 * self.point_rows + 1, 2 * self.turn_rows], axis=1)

    @cached_property
    def slaves(self) -> NDArray[np.intp]:
        """Return (2 n_s,) degrees of freedom of the nodes that follow."""
        return (2 * self.nodes[:, None] + np.arange(2)).ravel()

    def extended(self, interface: Interface) -> Interface:
        """Put the reference rows behind the nodes of the interface; the two rows of a body lie at its point."""
        return replace(interface, nodes=np.vstack([interface.nodes, np.repeat(self.reference, 2, axis=0)]))

    def turned(self, u: Floats) -> Floats:
        """Turn the arms: (n_s, 2) R(theta) (X - X_ref) [m] at u : (n_rows, 2) [m]."""
        theta = (u[self.turn_rows, 0] / self.size)[self.owner]
        c, s = np.cos(theta), np.sin(theta)
        return np.stack([c * self.arm[:, 0] - s * self.arm[:, 1], s * self.arm[:, 0] + c * self.arm[:, 1]], axis=1)

    def placed(self, u: Floats) -> Floats:
        """Copy u : (n_rows, 2) [m] with the nodes of rigid bodies where their reference rows put them."""
        theta = (u[self.turn_rows, 0] / self.size)[self.owner]
        # cos - 1 by half angles: small turns keep their digits.
        c1, s = -2.0 * np.sin(0.5 * theta) ** 2, np.sin(theta)
        x, y = self.arm.T
        placed = u.copy()
        # fault: lever of a rigid body not turned with it -> placed[self.nodes] = u[self.point_rows][self.owner] +
        #   np.stack([-s * y, s * x], axis=1) | mechanical_fmu/test_solution_loads
        placed[self.nodes] = u[self.point_rows][self.owner] + np.stack([c1 * x - s * y, s * x + c1 * y], axis=1)
        return placed

    def reduced(self, f: Floats, u: Floats) -> Floats:
        """Gather forces of rigid nodes at their reference rows: G'f : (n_rows, 2) [N], 0 left behind.

        f : (n_rows, 2) [N].  u : (n_rows, 2) [m].
        """
        arm, there = self.turned(u), f[self.nodes]
        out = f.copy()
        out[self.nodes] = 0.0
        np.add.at(out, self.point_rows[self.owner], there)
        moment = (arm[:, 0] * there[:, 1] - arm[:, 1] * there[:, 0]) / self.size[self.owner]
        # fault: moment of contact on a rigid body left out -> pass | mechanical_fmu/test_solution_loads
        np.add.at(out[:, 0], self.turn_rows[self.owner], moment)
        return out

    def turning_stiffness(self, f: Floats, u: Floats) -> Floats:
        """Compute (n_rigid,) f . d2x/dtheta2 / L2 [N/m], of nodal forces f : (n_rows, 2) [N] before they are reduced.

        u : (n_rows, 2) [m].
        """
        work = -(self.turned(u) * f[self.nodes]).sum(axis=1)
        return np.bincount(self.owner, weights=work, minlength=len(self.body)) / self.size**2

    def follow(self, u: Floats) -> csr_matrix:
        """Assemble G : (2 n_rows, 2 n_rows) [1], d(all displacements)/d(unknowns) at u : (n_rows, 2) [m].

        Columns of rigid nodes are empty.
        """
        n, arm, owner = self.n_rows, self.turned(u), self.owner
        own = np.setdiff1d(np.arange(2 * n), self.slaves)
        point, turn = 2 * self.point_rows[owner], 2 * self.turn_rows[owner]
        rows = [own, self.slaves, self.slaves]
        columns = [own, (point[:, None] + np.arange(2)).ravel(), np.repeat(turn, 2)]
        lever = np.stack([-arm[:, 1], arm[:, 0]], axis=1) / self.size[owner][:, None]
        values = [np.ones(own.size), np.ones(self.slaves.size), lever.ravel()]
        return csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
                          shape=(2 * n, 2 * n))

    def condensed(self, K: csr_matrix, u: Floats, turning: Floats) -> csr_matrix:
        """Compute G'K G plus the turning stiffness; every diagonal entry is in the pattern, as holding unknowns wants.

        K : (2 n_rows, 2 n_rows) [N/m], the result too.  u : (n_rows, 2) [m].  turning : (n_rigid,) [N/m].
        """
        G = self.follow(u)
        product = G.T @ K @ G
        diagonal = np.zeros(K.shape[0])
        diagonal[2 * self.turn_rows] = turning
        return with_diagonal(csr_matrix(product + diags_array(diagonal, format="csr")))

    def spread(self, d: Floats, u: Floats) -> Floats:
        """Compute G d, same shape as d: a direction with the nodes of rigid bodies following, to first order.

        d : (2 n_rows,) or (2 n_rows, k) [m].  u : (n_rows, 2) [m].
        """
        return np.asarray(self.follow(u) @ d)


    def deformable(self, kinds: tuple[Cells, ...]) -> tuple[Cells, ...]:
        """Return the cells of the other bodies."""
        out = []
        for cells in kinds:
            keep = ~np.isin(cells.body, self.body)
            if keep.all():
                out.append(cells)
            elif keep.any():
                per_cell = {k: getattr(cells, k)[keep] for k in ("nodes", "body", "part", "number", "B", "weight",
                                                                 "N_over_R", "volume", "mean")}
                out.append(replace(cells, **per_cell, modes=Modes(cells.modes.gradients[keep], cells.modes.hoop[keep])))
        return tuple(out)


def with_diagonal(K: csr_matrix) -> csr_matrix:
    """Return K : (n, n) with every diagonal entry in its pattern (a sum of sparse matrices drops exact zeros)."""
    missing = np.where(K.diagonal() == 0.0, np.finfo(float).tiny, 0.0)
    return csr_matrix(K + diags_array(missing, format="csr"))


def rigid_bodies(interface: Interface, reference: Mapping[int, tuple[float, float] | None],
                 kinds: tuple[Cells, ...]) -> RigidBodies:
    """Make the rigid bodies of a scene.

    reference : body -> its reference point [m], None for the centre of volume.
    """
    points, sizes, nodes, owner = [], [], [], []
    for k, (body, given) in enumerate(reference.items()):
        here = np.flatnonzero(interface.node_body == body)
        points.append(_centre(interface, kinds, body) if given is None else np.array(given))
        sizes.append(0.5 * float(np.ptp(interface.nodes[here], axis=0).max()))
        nodes.append(here)
        owner.append(np.full(here.size, k))
    at, who = np.concatenate(nodes), np.concatenate(owner)
    where = np.array(points)
    return RigidBodies(np.array(list(reference), dtype=np.intp), where, np.array(sizes), len(interface.nodes), at, who,
                       interface.nodes[at] - where[who])


def _centre(interface: Interface, kinds: tuple[Cells, ...], body: int) -> Floats:
    volume, moment = 0.0, np.zeros(2)
    for cells in kinds:
        here = cells.body == body
        at = np.einsum("qa,eai->eqi", cells.N, interface.nodes[cells.nodes[here]])
        volume += float(cells.weight[here].sum())
        moment += np.einsum("eq,eqi->i", cells.weight[here], at)
    return moment / volume


# A node nearer to the axis than this share of the mesh's size is on it.
ON_AXIS = 1e-12
# Rank of the constraints on one body's three rigid motions, relative to the best constrained one.
RANK = 1e-10


@dataclass(frozen=True)
class Constraints:
    """Degrees of freedom (2 node + component) whose value is given.

    fixed : (n_fixed,) degrees of freedom, ascending.  source : (n_fixed,) index into the displacements of the spec, -1
    for a plain 0.  motions : how they move.  turned : (n_fixed,) whether a rotation or a
    field over place has them.
    free : (2 n_nodes,) 1.0 where free, else 0.0 (nodes of rigid bodies are neither free nor fixed: they
    follow).
    node_body : (n_nodes,), -1 where no cell is.  n_bodies.  axisymmetric : then a body can only move along y.
    """

    fixed: NDArray[np.intp]
    source: NDArray[np.intp]
    motions: Motions
    turned: NDArray[np.bool_]
    free: Floats
    node_body: NDArray[np.int32]
    n_bodies: int
    axisymmetric: bool
    rigid: RigidBodies | None = None

    def moved(self, u: Floats, target: Floats, X: Floats) -> Floats:
        """Move every driven body rigidly, by its mean prescribed increment in each component; with a rotation it turns.

        X : (n_nodes, 2) [m] of the reference.

        u : (n_nodes, 2) [m], the result too.  target : (n_fixed,) [m] of the prescribed components.
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
        if self.turned_bodies.size:
            self._turn(moved, u, target, X)
        if self.rigid is None:
            return moved
        moved.ravel()[self.fixed[~inside]] = target[~inside]
        return self.rigid.placed(moved)

    def _turn(self, moved: Floats, u: Floats, target: Floats, X: Floats) -> None:
        """Move bodies with a rotation by the rigid motion that best fits all of their nodes held in x and y."""
        whole = np.zeros(u.shape, dtype=bool)
        whole.ravel()[self.fixed] = True
        goal = u.copy()
        goal.ravel()[self.fixed] = target
        for body in self.turned_bodies:
            here = self.node_body == body
            held = here & whole.all(axis=1)
            if np.count_nonzero(held) < 2:
                continue
            x, to = (X + u)[held], (X + goal)[held]
            middle, middle_to = x.mean(axis=0), to.mean(axis=0)
            turn = turn_between(x - middle, to - middle_to)
            # fault: driven bodies do not turn before the first iteration -> turn = 0.0 | mechanical_fmu/test_motions
            moved[here] = u[here] + rotated(X[here] + u[here] - middle, turn) + (middle_to - middle)

    @cached_property
    def turned_bodies(self) -> NDArray[np.int32]:
        """Return the deformable bodies that a rotation, or a field over place, has nodes of."""
        bodies = np.unique(self.node_body[self.fixed[self.turned] // 2])
        return bodies[bodies >= 0]

    def loose_motions(self, x: Floats) -> tuple[tuple[int, Floats], ...]:
        """Find bodies that could move rigidly; returns (body, Z) of each.

        x : (n_nodes, 2) [m].  Z : (3, n_motions) [1] combines moving along x, y and turning.
        Turning is about the body's middle, by an angle of 1/size.
        """
        loose = []
        for body in range(self.n_bodies):
            C = self.rigid_motions(x, body, self._held[body])
            if self.axisymmetric:
                C = np.vstack([C, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
            values, vectors = np.linalg.eigh(C.T @ C)
            Z = vectors[:, values <= RANK * max(values[-1], 1.0)]
            if Z.shape[1]:
                loose.append((body, Z))
        return tuple(loose)

    def rigid_motions(self, x: Floats, body: int, dofs: NDArray[np.intp] | None = None) -> Floats:
        """Compute (n_dofs, 3) [1]: moving along x, along y, turning by 1/size; 0 on other bodies.

        x : (n_nodes, 2) [m].  dofs : (n_dofs,) degrees of freedom, None for all of them.
        """
        dofs = np.arange(x.size) if dofs is None else dofs
        own = x[self._nodes[body]]
        low, high = own.min(axis=0), own.max(axis=0)
        size = max(float((0.5 * (high - low)).max()), np.finfo(float).tiny)
        node, along_y = dofs // 2, dofs % 2
        arm = (x[node] - 0.5 * (low + high)) / size
        motions = np.zeros((dofs.size, 3))
        motions[:, 0], motions[:, 1] = 1 - along_y, along_y
        motions[:, 2] = np.where(along_y, arm[:, 0], -arm[:, 1])
        motions[self.holder[node] != body] = 0.0
        if self.rigid is not None:
            for k in np.flatnonzero(self.rigid.body == body):
                motions[node == self.rigid.turn_rows[k]] = 0.0
                motions[dofs == 2 * self.rigid.turn_rows[k], 2] = self.rigid.size[k] / size
        return motions

    @cached_property
    def _nodes(self) -> tuple[NDArray[np.intp], ...]:
        return tuple(np.flatnonzero(self.node_body == body) for body in range(self.n_bodies))

    @cached_property
    def _held(self) -> tuple[NDArray[np.intp], ...]:
        return tuple(self.fixed[self.holder[self.fixed // 2] == body] for body in range(self.n_bodies))

    @cached_property
    def holder(self) -> NDArray[np.int32]:
        """Return (n_nodes,) the body a row belongs to, reference rows of rigid bodies too; -1 where none."""
        if self.rigid is None:
            return self.node_body
        holder = self.node_body.copy()
        holder[self.rigid.point_rows] = holder[self.rigid.turn_rows] = self.rigid.body
        return holder


def constraints_of(interface: Interface, displacements: Sequence[Displacement],
                   rigid: RigidBodies | None = None, released: Collection[int] = ()) -> Constraints:
    """Collect the prescribed components, but those of `released` displacements, by number.

    On the axis u_r = 0; a node no cell uses stays.  interface : with the reference rows of rigid bodies.
    Two prescriptions of one component are the same (contact.half.prescribed).
    Raises ValueError where one holds a node of a rigid body.
    """
    given: dict[int, int] = {}
    for i, d in enumerate(displacements):
        if i in released:
            continue
        for dof in _dofs(d, rigid):
            given.setdefault(int(dof), i)
    for dof in np.flatnonzero(_still(interface, rigid)):
        given.setdefault(int(dof), -1)
    fixed = np.array(sorted(given), dtype=np.intp)
    free = np.ones(2 * len(interface.nodes))
    free[fixed] = 0.0
    if rigid is not None:
        free[rigid.slaves] = 0.0
    scale = [1.0 if rigid is None or d.component < 2 else float(rigid.size[d.rigid]) for d in displacements]
    source = np.array([given[int(d)] for d in fixed], dtype=np.intp)
    turned = np.array([i >= 0 and (displacements[i].turn is not None or not displacements[i].value.is_uniform)
                       for i in source], dtype=bool)
    return Constraints(fixed, source, motions_of(displacements, source, fixed, scale, interface.nodes), turned, free,
                       interface.node_body, len(interface.bodies), interface.axisymmetric, rigid)


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
