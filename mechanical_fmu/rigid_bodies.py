"""Rigid bodies among deformable ones: their nodes follow a reference point and an angle, exactly.

x = x_ref + R(theta) (X - X_ref).  Two rows are added to the nodal arrays for each rigid body: (u_ref,x, u_ref,y) and
(theta L, 0), L its half size, so that all unknowns are lengths and all residuals forces.  The nodes are eliminated:
with G = dx/d(unknowns) the forces are G'f and the stiffness G'K G + f . d2x/dtheta2.  Nothing is penalised.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.interface import Interface
from mechanical_fmu.elements import Cells

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
        """(n_rigid,) row of each reference point's displacement."""
        return self.first + 2 * np.arange(len(self.body))

    @property
    def turn_rows(self) -> NDArray[np.intp]:
        """(n_rigid,) row of each angle."""
        return self.point_rows + 1

    @property
    def n_rows(self) -> int:
        """Rows of the nodal arrays, reference rows included."""
        return self.first + 2 * len(self.body)

    @cached_property
    def dofs(self) -> NDArray[np.intp]:
        """(n_rigid, 3) degrees of freedom of u_x, u_y and the angle."""
        return np.stack([2 * self.point_rows, 2 * self.point_rows + 1, 2 * self.turn_rows], axis=1)

    @cached_property
    def slaves(self) -> NDArray[np.intp]:
        """(2 n_s,) degrees of freedom of the nodes that follow."""
        return (2 * self.nodes[:, None] + np.arange(2)).ravel()

    def extended(self, interface: Interface) -> Interface:
        """The interface with the reference rows behind its nodes; the two rows of a body lie at its point."""
        return replace(interface, nodes=np.vstack([interface.nodes, np.repeat(self.reference, 2, axis=0)]))

    def turned(self, u: Floats) -> Floats:
        """(n_s, 2) R(theta) (X - X_ref) [m]."""
        theta = (u[self.turn_rows, 0] / self.size)[self.owner]
        c, s = np.cos(theta), np.sin(theta)
        return np.stack([c * self.arm[:, 0] - s * self.arm[:, 1], s * self.arm[:, 0] + c * self.arm[:, 1]], axis=1)

    def placed(self, u: Floats) -> Floats:
        """u : (n_rows, 2) [m] with the nodes of rigid bodies where their reference rows put them."""
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
        """G'f : (n_rows, 2) [N]: forces of rigid nodes gathered at their reference rows, 0 left behind."""
        arm, there = self.turned(u), f[self.nodes]
        out = f.copy()
        out[self.nodes] = 0.0
        np.add.at(out, self.point_rows[self.owner], there)
        moment = (arm[:, 0] * there[:, 1] - arm[:, 1] * there[:, 0]) / self.size[self.owner]
        # fault: moment of contact on a rigid body left out -> pass | mechanical_fmu/test_solution_loads
        np.add.at(out[:, 0], self.turn_rows[self.owner], moment)
        return out

    def turning_stiffness(self, f: Floats, u: Floats) -> Floats:
        """(n_rigid,) f . d2x/dtheta2 / L2 [N/m], of nodal forces f : (n_rows, 2) [N] before they are reduced."""
        work = -(self.turned(u) * f[self.nodes]).sum(axis=1)
        return np.bincount(self.owner, weights=work, minlength=len(self.body)) / self.size**2

    def follow(self, u: Floats) -> csr_matrix:
        """G : (2 n_rows, 2 n_rows), d(all displacements)/d(unknowns) at u; columns of rigid nodes are empty."""
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
        """G'K G plus the turning stiffness; every diagonal entry is in the pattern, as holding unknowns wants."""
        G = self.follow(u)
        product = G.T @ K @ G
        diagonal = np.zeros(K.shape[0])
        diagonal[2 * self.turn_rows] = turning
        return with_diagonal(csr_matrix(product + diags_array(diagonal, format="csr")))

    def spread(self, d: Floats, u: Floats) -> Floats:
        """G d : (2 n_rows,) [m]: a direction with the nodes of rigid bodies following, to first order."""
        return np.asarray(self.follow(u) @ d)


    def deformable(self, kinds: tuple[Cells, ...]) -> tuple[Cells, ...]:
        """The cells of the other bodies."""
        out = []
        for cells in kinds:
            keep = ~np.isin(cells.body, self.body)
            if keep.all():
                out.append(cells)
            elif keep.any():
                per_cell = {k: getattr(cells, k)[keep] for k in ("nodes", "body", "number", "B", "weight", "N_over_R",
                                                                 "volume", "mean")}
                out.append(replace(cells, **per_cell, modes=(cells.modes[0][keep], cells.modes[1][keep])))
        return tuple(out)


def with_diagonal(K: csr_matrix) -> csr_matrix:
    """K with every diagonal entry in its pattern (a sum of sparse matrices drops exact zeros)."""
    missing = np.where(K.diagonal() == 0.0, np.finfo(float).tiny, 0.0)
    return csr_matrix(K + diags_array(missing, format="csr"))


def rigid_bodies(interface: Interface, reference: Mapping[int, tuple[float, float] | None],
                 kinds: tuple[Cells, ...]) -> RigidBodies:
    """The rigid bodies of a scene.  reference : body -> its reference point [m], None for the centre of volume."""
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
