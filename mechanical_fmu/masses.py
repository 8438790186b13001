"""Mass of the bodies at the reference: rho0 dV0 moves along, so nothing here changes while a scene runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, eye_array, kron

from contact.half.interface import Interface
from mechanical_fmu.cells import Cells
from mechanical_fmu.constraints import RigidBodies
from mechanical_fmu.contact_mass import taken_along
from mechanical_fmu.loads import DeadForces, NodalShares, RigidRows, dead_forces, nodal_shares
from mechanical_fmu.problem import ElasticSpec

Floats = NDArray[np.float64]
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Masses:
    """interface : of the mesh alone.  kinds : all cells, those of rigid bodies too.  rigid : None where there are none.

    Everything is worked out when first asked for.
    """

    interface: Interface
    spec: ElasticSpec
    kinds: tuple[Cells, ...]
    rigid: RigidBodies | None

    @property
    def n(self) -> int:
        """Count the rows of the nodal arrays."""
        return len(self.interface.nodes) if self.rigid is None else self.rigid.n_rows

    @property
    def density(self) -> Floats:
        """Return (n_parts,) rho0 [kg/m3], 0 where not said."""
        return np.nan_to_num(self.spec.rho)[self.spec.part_material]

    @cached_property
    def volume(self) -> Floats:
        """Compute (n_parts, n) [m3], the share of every node in every part."""
        return nodal_shares(self.interface, self.kinds, self.n)

    def of_bodies(self, per_part: Floats) -> Floats:
        """Add (n_parts, n) shares of parts up to those of bodies, (n_bodies, n), in their unit."""
        n = len(self.interface.bodies)
        out = per_part[:n].copy()
        np.add.at(out, self.interface.part_body[n:], per_part[n:])
        return out

    @cached_property
    def dead(self) -> DeadForces:
        """Make the patterns of the dead loads.

        Weight acts where the mass is: of what falls freely nothing is under stress.
        """
        rows = np.empty((0, 3), np.intp) if self.rigid is None else self.rigid.dofs
        per_moment = np.empty(0) if self.rigid is None else 1.0 / self.rigid.size
        mass = self.of_bodies(self.density[:, None] * self.volume)
        # fault: nodes that have no mass have weight -> pass | mechanical_fmu/test_free_fall
        mass = np.asarray(self._taken_along[0].T @ mass.T).T
        shares = NodalShares(mass, self.of_bodies(self.volume))
        return dead_forces(self.interface, self.spec.dead, shares, RigidRows(rows, per_moment))

    @cached_property
    def lumped(self) -> Floats:
        """Sum the rows of the mass matrix: (2 n,) [kg]; a rigid body's at its reference rows."""
        m = np.repeat((self.density[:, None] * self.volume).sum(axis=0), 2)
        return m if self.rigid is None else self._gathered(m)

    def matrix(self, lumped: bool) -> csr_matrix:
        """Return M : (2 n, 2 n) [kg], consistent or lumped; the nodes `without` have none where that is asked for."""
        return self._matrices[lumped]

    @cached_property
    def _matrices(self) -> _Matrices:
        return _Matrices(self)

    @cached_property
    def _taken_along(self) -> tuple[csr_matrix, NDArray[np.bool_]]:
        """T : (n, n) and (n,) of contact_mass.py, where the scene has the mass of its contact surfaces moved."""
        how = self.spec.dynamics
        if how is None or not how.contact_mass_behind or not self.interface.pairs:
            return csr_matrix(eye_array(self.n)), np.zeros(self.n, dtype=np.bool_)
        massless = np.zeros(len(self.interface.nodes), dtype=np.bool_)
        surfaces = {name for pair in self.interface.pairs if not pair.tied for name in (pair.slave, pair.master)}
        for name in surfaces:
            massless[self.interface.surfaces[name]] = True
        deformable = self.kinds
        if self.rigid is not None:
            massless[self.rigid.nodes] = False
            deformable = self.rigid.deformable(self.kinds)
        return taken_along(self.interface.nodes, [cells.nodes for cells in deformable], massless, self.n)

    @property
    def without(self) -> NDArray[np.bool_]:
        """Say, (n,), which nodes have no mass: those of contact surfaces, as far as there are others to move them."""
        return self._taken_along[1]

    def followed(self, v: Floats) -> Floats:
        """Return v : (n, 2) with what the nodes without mass have taken from those that move them."""
        return np.asarray(self._taken_along[0] @ v) if self.without.any() else v

    @cached_property
    def consistent(self) -> csr_matrix:
        """Assemble (2 n, 2 n) [kg] int rho0 N_a N_b dV0; a rigid body's at its reference rows."""
        rows, columns, values = [], [], []
        for cells in self.kinds:
            rho = self.density[cells.part]
            # fault: inertia of half the mass -> block = 0.5 * np.einsum("e,eq,qa,qb->eab", rho, cells.weight, cells.N,
            #   cells.N) | stability/test_wave
            block = np.einsum("e,eq,qa,qb->eab", rho, cells.weight, cells.N, cells.N)
            for i in range(2):
                dofs = 2 * cells.nodes.astype(np.intp) + i
                rows.append(np.repeat(dofs, dofs.shape[1], axis=1).ravel())
                columns.append(np.tile(dofs, (1, dofs.shape[1])).ravel())
                values.append(block.ravel())
        where = (np.concatenate(rows), np.concatenate(columns))
        M = csr_matrix((np.concatenate(values), where), shape=(2 * self.n, 2 * self.n))
        if self.rigid is None:
            return M
        keep = np.ones(2 * self.n)
        keep[self.rigid.slaves] = 0.0
        at_points = np.zeros(2 * self.n)
        dofs = self.rigid.dofs.ravel()
        at_points[dofs] = self.lumped[dofs]
        return csr_matrix(diags_array(keep) @ M @ diags_array(keep) + diags_array(at_points))

    def _gathered(self, m: Floats) -> Floats:
        """Masses of rigid bodies at their reference rows: m, m and the moment of inertia over L2."""
        assert self.rigid is not None
        out = m.copy()
        out[self.rigid.slaves] = 0.0
        for k, body in enumerate(self.rigid.body):
            total, inertia = 0.0, 0.0
            for cells in self.kinds:
                here = cells.body == body
                at = np.einsum("qa,eai->eqi", cells.N, self.interface.nodes[cells.nodes[here]])
                arm = at - self.rigid.reference[k]
                total += float(cells.weight[here].sum())
                inertia += float((cells.weight[here] * (arm**2).sum(axis=2)).sum())
            rho = self.density[body]  # one for all of it: elastic_wrongs refuses others
            out[self.rigid.dofs[k]] = rho * np.array([total, total, inertia / self.rigid.size[k] ** 2])
        return out


class _Matrices(dict[bool, csr_matrix]):
    """lumped -> M, made when first asked for."""

    def __init__(self, masses: Masses) -> None:
        super().__init__()
        self.masses = masses

    def __missing__(self, lumped: bool) -> csr_matrix:
        m = self.masses
        M = csr_matrix(diags_array(m.lumped, format="csr")) if lumped else m.consistent
        if m.without.any():
            T = kron(m._taken_along[0], eye_array(2), format="csr")
            # fault: nodes of contact surfaces keep their mass -> M = csr_matrix(M) | mechanical_fmu/test_impact
            M = csr_matrix(T.T @ M @ T)
        self[lumped] = M
        return M


# Inertia forces of a step, linear in the displacement at its end.  Eq. (23).

@dataclass(frozen=True)
class Inertia:
    """force(u) = matrix (u - origin) + constant, [N].

    matrix : (2 n, 2 n) [N/m].  origin : (n, 2) [m].  constant : (n, 2) [N], what the step's start contributes.
    """

    matrix: csr_matrix
    origin: Floats
    constant: Floats

    @property
    def round_off(self) -> Floats:
        """(n, 2) [N] by which forces are open where u is rounded: as much the more as the step is short."""
        return np.asarray(abs(self.matrix) @ (EPS * np.abs(self.origin)).ravel()).reshape(self.origin.shape)

    def force(self, u: Floats) -> Floats:
        """Compute the inertia forces (n, 2) [N] at u : (n, 2) [m]."""
        return np.asarray(self.matrix @ (u - self.origin).ravel()).reshape(u.shape) + self.constant
