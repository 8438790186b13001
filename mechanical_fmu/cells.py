"""Cells of one kind (shape and treatment): shape functions, reference gradients, quadrature weights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import CellQuadrature, table_of
from contact.half.interface import Interface
from mechanical_fmu.laws.law import history_size
from mechanical_fmu.point_loop import CellShapes
from mechanical_fmu.strain import Modes, mode_count, mode_gradients

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

QUAD = 4  # corners


@dataclass(frozen=True)
class Treatment:
    """How the cells of a body are computed.  kind : of their points (laws/law.py), 0 : neo-Hookean.

    enhanced : with modes that let a quad bend; a triangle has none and keeps its mean dilatation.
    plane_stress : no stress through the thickness.
    """

    kind: int = 0
    enhanced: bool = False
    plane_stress: bool = False


ELASTIC = Treatment()


@dataclass(frozen=True)
class Cells:
    """All cells of one kind, at the reference coordinates X.

    nodes : (n_e, nn).  body : (n_e,) index of the body.  part : (n_e,) of the body or its region.
    number : (n_e,) of the cell in interface order, 0-based.
    N : (nq, nn) shape functions.  B : (n_e, nq, nn, 2) gradients dN/dX [1/m].
    weight : (n_e, nq) reference volume of a point [m3], 2 pi R weighted when axisymmetric, else per metre depth.
    N_over_R : (n_e, nq, nn) [1/m], N_a/R when axisymmetric, else 0: what turns u_r into the hoop stretch.
    volume : (n_e,) [m3].  mean : (n_e, nn) takes nodal values to the volume mean of each cell.
    modes : of enhanced strain, of none where it has none.
    """

    nodes: Ints
    body: Ints
    part: Ints
    number: Ints
    N: Floats
    B: Floats
    weight: Floats
    N_over_R: Floats
    volume: Floats
    mean: Floats
    treatment: Treatment
    modes: Modes

    @property
    def dofs(self) -> NDArray[np.int64]:
        """Return (n_e, 2 nn) degrees of freedom, 2 node + component."""
        dofs = 2 * self.nodes[:, :, None].astype(np.int64) + np.arange(2)
        return dofs.reshape(len(self.nodes), -1)

    @property
    def fast(self) -> bool:
        """Say whether the loop of elastic_loop.py does: elastic, of mean dilatation."""
        return self.treatment == ELASTIC

    @property
    def n_modes(self) -> int:
        """Count the numbers the modes of a cell have, 0 without modes."""
        n = self.modes.hoop.shape[2]
        return mode_count(n == 3) if n else 0

    @property
    def n_row(self) -> int:
        """Count numbers that evolve in a cell: modes, then each point's history and, in plane stress, its ln F33."""
        point = history_size(self.treatment.kind) + self.treatment.plane_stress
        return 0 if self.fast else self.n_modes + point * self.weight.shape[1]

    @cached_property
    def shape(self) -> CellShapes:
        """Put what the loop of point_loop.py reads together, the modes behind the nodes in B and N_over_R."""
        B, N_over_R = (np.concatenate(parts, axis=2) for parts in zip((self.B, self.N_over_R), self.modes, strict=True))
        return CellShapes(self.nodes, B, N_over_R, self.weight, self.volume, self.n_modes)


def at_points(cells: Cells, nodal: Floats) -> Floats:
    """Interpolate nodal : (n_nodes,), any unit, to the points of the cells: (n_e, nq)."""
    return np.asarray(nodal[cells.nodes] @ cells.N.T)


def cells_of(interface: Interface, treatments: tuple[Treatment, ...] | None = None) -> tuple[Cells, ...]:
    """Make the quads, then the triangles, of a mesh, each by treatment; a kind without cells is left out.

    treatments : one a part, None for elastic bodies only.
    Raises ValueError naming the cell (1-based) and its body where the mesh itself is inverted or left of the axis.
    """
    shapes = (("quad", interface.quads, interface.quad_part, 0),
              ("triangle", interface.triangles, interface.triangle_part, len(interface.quads)))
    chosen = treatments or (ELASTIC,) * len(interface.parts)
    out = []
    for name, nodes, part, first in shapes:
        of_part = chosen if name == "quad" else tuple(replace(t, enhanced=False) for t in chosen)
        number = np.arange(first, first + len(nodes), dtype=np.int32)
        for treatment in dict.fromkeys(of_part):
            here = np.isin(part, [i for i, t in enumerate(of_part) if t == treatment])
            if here.any():
                out.append(_cells(interface, nodes[here], part[here], number[here], table_of(name), treatment))
    return tuple(out)


def moved(cells: Cells, interface: Interface) -> Cells:
    """Return cells where the nodes of another interface put them.  Raises ValueError as cells_of does."""
    table = table_of("quad" if cells.nodes.shape[1] == QUAD else "triangle")
    return _cells(interface, cells.nodes, cells.part, cells.number, table, cells.treatment)


def _cells(interface: Interface, nodes: Ints, part: Ints, number: Ints, table: CellQuadrature,
           treatment: Treatment) -> Cells:
    body = interface.part_body[part]
    N, dN = table.N, table.dN
    X = interface.nodes[nodes]
    jacobian = np.einsum("eai,qaj->eqij", X, dN)
    det = np.linalg.det(jacobian)
    R = np.einsum("qa,ea->eq", N, X[:, :, 0])
    _refuse(interface, body, number, det <= 0.0, "has no volume or its nodes run clockwise")
    if interface.axisymmetric:
        _refuse(interface, body, number, R <= 0.0, "lies on the wrong side of the axis (x = r must be positive)")
    B = np.einsum("qaj,eqji->eqai", dN, np.linalg.inv(jacobian))
    # fault: 2 pi R dropped from the cells -> weight = det * table.w * (R if interface.axisymmetric else 1.0) |
    #   mechanical_fmu/test_elastic_cylinder
    weight = det * table.w * (2.0 * np.pi * R if interface.axisymmetric else 1.0)
    N_over_R = N / R[:, :, None] if interface.axisymmetric else np.zeros((*R.shape, N.shape[1]))
    volume = weight.sum(axis=1)
    mean = np.einsum("eq,qa->ea", weight, N) / volume[:, None]
    modes = Modes(np.empty((*det.shape, 0, 2)), np.empty((*det.shape, 0)))
    # fault: quads without their modes -> if False: | mechanical_fmu/test_elements_bending
    if treatment.enhanced:
        modes = mode_gradients(X, N, det, interface.axisymmetric)
    return Cells(np.ascontiguousarray(nodes), body, part, number, N, np.ascontiguousarray(B),
                 np.ascontiguousarray(weight), np.ascontiguousarray(N_over_R), volume, mean, treatment, modes)


def _refuse(interface: Interface, body: Ints, number: Ints, bad: NDArray[np.bool_], why: str) -> None:
    if bad.any():
        e = int(np.argmax(bad.any(axis=1)))
        raise ValueError(f"mesh: cell {number[e] + 1} of body {interface.bodies[body[e]]} {why}")
