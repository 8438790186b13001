"""Contact as the mechanical halves see it: forces and stiffness of the surface nodes, put on the mesh."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.model import Variable
from contact.half.surfaces import ContactSurfaces
from contact.wire import Tractions

Floats = NDArray[np.float64]


class Contact(ContactSurfaces):
    """The contact surfaces of a scene, and their forces and stiffness on the mesh."""

    @cached_property
    def dofs(self) -> NDArray[np.intp]:
        """(2 n_s,) degrees of freedom of the surface nodes, 2 node + component."""
        return (2 * self.interface.contact_nodes[:, None] + np.arange(2)).ravel().astype(np.intp)

    def force(self, tractions: Tractions) -> Floats:
        """(n_nodes, 2) [N] on the nodes of the mesh."""
        f = np.zeros((len(self.interface.nodes), 2))
        f[self.interface.contact_nodes] = tractions.force
        return f

    def dense(self, tractions: Tractions) -> Floats:
        """(2 n_s, 2 n_s) stiffness [N/m] of the touching points on the surface nodes."""
        size = self.dofs.size
        rows, columns = _places(tractions)
        K = np.zeros(size * size)
        K += np.bincount((rows * size + columns).ravel(), weights=tractions.blocks.ravel(), minlength=K.size)
        return K.reshape(size, size)

    def matrix(self, tractions: Tractions) -> csr_matrix:
        """The same on all degrees of freedom of the mesh."""
        rows, columns = _places(tractions)
        n = 2 * len(self.interface.nodes)
        where = (self.dofs[rows.ravel()], self.dofs[columns.ravel()])
        return csr_matrix((tractions.blocks.ravel(), where), shape=(n, n))


def _places(tractions: Tractions) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    dofs = (2 * tractions.block_nodes[:, :, None].astype(np.int64) + np.arange(2)).reshape(-1, 8)
    return np.repeat(dofs, 8, axis=1), np.tile(dofs, (1, 8))


def contact_variables(n_s: int) -> tuple[Variable, ...]:
    """What both mechanical halves say of contact; n_s : surface nodes."""
    return (Variable("contact.t_N", (n_s,), unit="Pa", description="normal traction, <= 0"),
            Variable("contact.gap", (n_s,), unit="m", description="normal gap"),
            Variable("contact.covered", (n_s,), unit="1", description="share of a node's surface that is faced"),
            Variable("contact.touching", description="facing points that touch"))
