"""Cells of one kind (4-node quads or 3-node triangles): shape functions, reference gradients, quadrature weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.elements import Table, table_of
from contact.half.interface import Interface

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Cells:
    """All cells of one kind, at the reference coordinates X.

    nodes : (n_e, nn).  body : (n_e,) index of the body.  first : number of the first cell in interface order.
    N : (nq, nn) shape functions.  B : (n_e, nq, nn, 2) gradients dN/dX [1/m].
    weight : (n_e, nq) reference volume of a point [m3], 2 pi R weighted when axisymmetric, else per metre depth.
    N_over_R : (n_e, nq, nn) [1/m], N_a/R when axisymmetric, else 0: what turns u_r into the hoop stretch.
    volume : (n_e,) [m3].  mean : (n_e, nn) takes nodal values to the volume mean of each cell.
    """

    nodes: Ints
    body: Ints
    first: int
    N: Floats
    B: Floats
    weight: Floats
    N_over_R: Floats
    volume: Floats
    mean: Floats

    @property
    def dofs(self) -> NDArray[np.int64]:
        """(n_e, 2 nn) degrees of freedom, 2 node + component."""
        dofs = 2 * self.nodes[:, :, None].astype(np.int64) + np.arange(2)
        return dofs.reshape(len(self.nodes), -1)


def cells_of(interface: Interface) -> tuple[Cells, ...]:
    """The quads, then the triangles, of a mesh; a kind without cells is left out.

    Raises ValueError naming the cell (1-based) and its body where the mesh itself is inverted or left of the axis.
    """
    kinds = (("quad", interface.quads, interface.quad_body, 0),
             ("triangle", interface.triangles, interface.triangle_body, len(interface.quads)))
    return tuple(_cells(interface, nodes, body, first, table_of(kind))
                 for kind, nodes, body, first in kinds if len(nodes))


def _cells(interface: Interface, nodes: Ints, body: Ints, first: int, table: Table) -> Cells:
    N, dN = table.N, table.dN
    X = interface.nodes[nodes]
    jacobian = np.einsum("eai,qaj->eqij", X, dN)
    det = np.linalg.det(jacobian)
    R = np.einsum("qa,ea->eq", N, X[:, :, 0])
    _refuse(interface, body, first, det <= 0.0, "has no volume or its nodes run clockwise")
    if interface.axisymmetric:
        _refuse(interface, body, first, R <= 0.0, "lies on the wrong side of the axis (x = r must be positive)")
    B = np.einsum("qaj,eqji->eqai", dN, np.linalg.inv(jacobian))
    weight = det * table.w * (2.0 * np.pi * R if interface.axisymmetric else 1.0)
    N_over_R = N / R[:, :, None] if interface.axisymmetric else np.zeros((*R.shape, N.shape[1]))
    volume = weight.sum(axis=1)
    mean = np.einsum("eq,qa->ea", weight, N) / volume[:, None]
    return Cells(np.ascontiguousarray(nodes), body, first, N, np.ascontiguousarray(B),
                 np.ascontiguousarray(weight), np.ascontiguousarray(N_over_R), volume, mean)


def _refuse(interface: Interface, body: Ints, first: int, bad: NDArray[np.bool_], why: str) -> None:
    if bad.any():
        e = int(np.argmax(bad.any(axis=1)))
        raise ValueError(f"mesh: cell {first + e + 1} of body {interface.bodies[body[e]]} {why}")
