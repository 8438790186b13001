"""Internal forces, tangent entries and stress of whole meshes: the loops of kernels.py over every kind of cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.elements import Cells
from mechanical_fmu.kernels import cell_forces, cell_stress
from mechanical_fmu.material import Moduli

Floats = NDArray[np.float64]


class InvertedCellError(ArithmeticError):
    """A cell has been turned inside out.  cell : its number in interface order, 0-based.  body : index."""

    def __init__(self, cell: int, body: int) -> None:
        super().__init__(f"cell {cell + 1} is turned inside out")
        self.cell, self.body = cell, body


@dataclass(frozen=True)
class Volume:
    """The deformable mesh.  n_nodes : nodes of the interface."""

    kinds: tuple[Cells, ...]
    n_nodes: int

    @property
    def n_cells(self) -> int:
        return sum(len(cells.nodes) for cells in self.kinds)

    def means(self, nodal: Floats) -> tuple[Floats, ...]:
        """Volume mean of a nodal field in every cell, one array a kind."""
        return tuple(np.einsum("ea,ea->e", cells.mean, nodal[cells.nodes]) for cells in self.kinds)

    def forces(self, u: Floats, moduli: tuple[Moduli, ...]) -> Floats:
        """f_int : (n_nodes, 2) [N] at u : (n_nodes, 2) [m].  Raises InvertedCellError."""
        f = np.zeros((self.n_nodes, 2))
        nothing = np.empty((0, 0, 0))
        for cells, m in zip(self.kinds, moduli, strict=True):
            _loop(cells, m, u, False, f, nothing)
        return f

    def tangent(self, u: Floats, moduli: tuple[Moduli, ...]) -> tuple[Floats, Floats]:
        """f_int and the entries of its derivative, flat, blocks in the order of cells.  Raises InvertedCellError."""
        f = np.zeros((self.n_nodes, 2))
        entries = np.empty(sum(len(c.nodes) * (2 * c.nodes.shape[1]) ** 2 for c in self.kinds))
        start = 0
        for cells, m in zip(self.kinds, moduli, strict=True):
            size = 2 * cells.nodes.shape[1]
            stop = start + len(cells.nodes) * size * size
            _loop(cells, m, u, True, f, entries[start:stop].reshape(-1, size, size))
            start = stop
        return f, entries

    def stress(self, u: Floats, moduli: tuple[Moduli, ...]) -> tuple[tuple[Floats, Floats], ...]:
        """(stress, strain) of every kind, each (n_e, nq, 4): Cauchy [Pa] and Green-Lagrange, (11, 22, 12, 33)."""
        out = []
        for cells, m in zip(self.kinds, moduli, strict=True):
            stress, strain = np.empty((*cells.weight.shape, 4)), np.empty((*cells.weight.shape, 4))
            cell_stress(cells.nodes, cells.B, cells.N_over_R, cells.weight, cells.volume, m.mu, m.kappa, m.e_th, u,
                        stress, strain)
            out.append((stress, strain))
        return tuple(out)


def _loop(cells: Cells, m: Moduli, u: Floats, tangent: bool, f: Floats, K: Floats) -> None:
    bad = cell_forces(cells.nodes, cells.B, cells.N_over_R, cells.weight, cells.volume, m.mu, m.kappa, m.e_th, u,
                      tangent, f, K)
    if bad >= 0:
        raise InvertedCellError(cells.first + bad, int(cells.body[bad]))


def von_mises(stress: Floats) -> Floats:
    """Von Mises stress [Pa] of stress : (..., 4) = (11, 22, 12, 33)."""
    s11, s22, s12, s33 = np.moveaxis(stress, -1, 0)
    squares = (s11 - s22) ** 2 + (s22 - s33) ** 2 + (s33 - s11) ** 2
    return np.sqrt(0.5 * squares + 3.0 * s12**2)
