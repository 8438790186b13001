"""Shape functions and quadrature of the kinds of cells, as tables that compiled loops can use."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from skfem import Element, ElementQuad1, ElementTriP1
from skfem.quadrature import get_quadrature

Floats = NDArray[np.float64]

# 2 x 2 Gauss points on quads, 3 points inside triangles: both integrate products of two shape functions, or of two of
# their gradients, exactly on a straight-sided plane cell, and all weights are positive (a negative one could make the
# storage at a point negative).
_KINDS: dict[str, tuple[type[Element], int]] = {"quad": (ElementQuad1, 3), "triangle": (ElementTriP1, 2)}

@dataclass(frozen=True)
class CellQuadrature:
    """Shape functions of one kind of cell at its quadrature points.

    N : (nq, nn) [1].  dN : (nq, nn, 2) [1], derivatives by reference coordinates.  w : (nq,) weights [1].
    """

    N: Floats
    dN: Floats
    w: Floats


@cache
def table_of(kind: str) -> CellQuadrature:
    """Return the table of "quad" (4 nodes) or "triangle" (3 nodes), nodes anticlockwise."""
    element_type, order = _KINDS[kind]
    element = element_type()
    X, w = get_quadrature(element.refdom, order)
    basis = [element.lbasis(X, i) for i in range(element.refdom.nnodes)]
    N = np.array([np.broadcast_to(phi, w.shape) for phi, _ in basis]).T
    dN = np.array([np.broadcast_to(dphi, X.shape) for _, dphi in basis]).transpose(2, 0, 1)
    return CellQuadrature(np.ascontiguousarray(N, dtype=float), np.ascontiguousarray(dN, dtype=float), np.array(w))
