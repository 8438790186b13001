"""Stress at the nodes of a mesh, from the means of its cells: a field fitted around each node.

Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331 (patch recovery).  What a cell tells is the stress half a
cell away from the surface, and the highest stress is at the surface most times.  So around each node a polynomial is
fitted, by least squares, to the stress where a mesh of first order knows it best: in the middle of a quad, and in the
middle of an edge between two triangles, as the mean of both (of what they are off by, most cancels where they lie
point by point opposite each other).  Its value at the node is exact where the stress is of second order in place.

Fits stay within one part (a body, or one of its regions): where materials change stress may jump.  Two rows of cells
tell no curvature across them, so that is taken to be 0; a single row tells nothing: how stress changes across it is not
known.  What is fitted does not hang on the frame: offsets are taken in the axes and lengths of the patch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, vstack

from contact.half.interface import Interface

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

# (order, rings of cells around the node, least number of places, whether terms of the second order may be missing),
# the first that serves.
LINEAR = ((1, 1, 4, False), (1, 2, 4, False), (1, 3, 4, False))
QUADRATIC = ((2, 2, 9, False), (2, 3, 9, False), (2, 3, 6, True), *LINEAR)
TERMS = {1: 3, 2: 6}
SINGULAR = 1e-6  # of the eigenvalues of the normal equations: the places do not tell the polynomial
MISSING = 1e-6  # of their trace: holds terms at 0 that the places do not tell, and hardly any other
MOST = 10.0  # what places are off by comes to so many times as much at a node; 3.5 at an edge, 5 to 8 in a corner
NEAR = 0.05  # places count by 1/(NEAR + d^2), d their distance in the size of the patch
ROWS = 2000  # nodes at a time


@dataclass(frozen=True)
class NodalStress:
    """How the stress at nodes follows from that of cells.

    node, part : (n_rows,) a node, and the part whose cells were fitted: a node has a row for each part there.
    fit : (n_rows, n_cells) takes means of cells to them.  known : (n_rows,) whether a patch could be fitted.
    """

    node: Ints
    part: Ints
    fit: csr_matrix
    known: NDArray[np.bool_]


def von_mises(stress: Floats) -> Floats:
    """Return (n,) [Pa] of stress : (n, 4) [Pa], 11, 22, 12, 33."""
    a, b, shear, c = stress.T
    return np.asarray(np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3.0 * shear**2))


def nodal_stress(interface: Interface, fits: Iterable[tuple[int, int, int, bool]] = QUADRATIC) -> NodalStress:
    """Work out how stress at nodes follows from that of cells, which are quads first.  fits : LINEAR or QUADRATIC."""
    n, n_cells = len(interface.nodes), len(interface.quads) + len(interface.triangles)
    part = np.concatenate([interface.quad_part, interface.triangle_part]).astype(np.intp)
    corners = [(interface.quads, 0), (interface.triangles, len(interface.quads))]
    cell = np.concatenate([np.repeat(np.arange(len(of)) + first, of.shape[1]) for of, first in corners])
    keys, row = np.unique(part[cell] * n + np.concatenate([of.ravel() for of, _ in corners]), return_inverse=True)
    touches = csr_matrix((np.ones(cell.size), (row, cell)), shape=(keys.size, n_cells))
    places, X = _places(interface)
    node, at = keys % n, interface.nodes[keys % n]
    # The mean of what lies around stands in where nothing can be fitted.
    around = touches.multiply(1.0 / touches.sum(axis=1)).tocsr()
    done, known, blocks = np.zeros(keys.size, dtype=bool), np.zeros(keys.size, dtype=bool), []
    for order, rings, least, partly in fits:
        left = np.flatnonzero(~done)
        for first in range(0, left.size, ROWS):
            own = left[first:first + ROWS]
            patch = touches[own]
            for _ in range(rings - 1):
                patch = patch @ touches.T @ touches
            fit, good = _fitted(_inside(patch, places), X, at[own], order, least, partly)
            blocks.append((own[good], fit[np.flatnonzero(good)] @ places))
            done[own[good]] = known[own[good]] = True
    rest = np.flatnonzero(~done)
    blocks.append((rest, around[rest]))
    back = np.argsort(np.concatenate([own for own, _ in blocks]), kind="stable")
    return NodalStress(node, keys // n, csr_matrix(vstack([fit for _, fit in blocks]).tocsr()[back]), known)


def _places(interface: Interface) -> tuple[csr_matrix, Floats]:
    """Where stress is known best: (n_places, n_cells) that takes it from cells, and (n_places, 2) [m]."""
    nodes, quads, triangles = interface.nodes, interface.quads, interface.triangles
    n, first = len(nodes), len(quads)
    keys = [np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
            .astype(np.int64) @ (n, 1)][0]
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    one, other = order[same] // 3, order[same + 1] // 3
    meet = interface.triangle_part[one] == interface.triangle_part[other]
    one, other, edge = one[meet], other[meet], keys[order[same]][meet]
    alone = np.setdiff1d(np.arange(len(triangles)), np.concatenate([one, other]))
    X = np.concatenate([nodes[quads].mean(axis=1), 0.5 * (nodes[edge // n] + nodes[edge % n]),
                        nodes[triangles[alone]].mean(axis=1)])
    # fault: at an edge one triangle tells for both -> pairs = np.stack([one, one], axis=1).ravel() + first |
    #   contact/test_nodal_stress
    pairs = np.stack([one, other], axis=1).ravel() + first
    rows = np.concatenate([np.arange(first), first + np.repeat(np.arange(one.size), 2),
                           first + one.size + np.arange(alone.size)])
    share = np.concatenate([np.ones(first), np.full(2 * one.size, 0.5), np.ones(alone.size)])
    columns = np.concatenate([np.arange(first), pairs, first + alone])
    return csr_matrix((share, (rows, columns)), shape=(len(X), first + len(triangles))), X


def _inside(patch: csr_matrix, places: csr_matrix) -> csr_matrix:
    """(n_rows, n_places), entries where all cells of a place are in the patch (n_rows, n_cells) of a row."""
    has = patch.copy()
    has.data[:] = 1.0
    shared = csr_matrix(has @ places.T)
    shared.data = np.where(shared.data > 1.0 - 1e-9, 1.0, 0.0)
    shared.eliminate_zeros()
    return shared


def _fitted(inside: csr_matrix, X: Floats, at: Floats, order: int, least: int, partly: bool
            ) -> tuple[csr_matrix, NDArray[np.bool_]]:
    """What each place counts in the value at nodes, (n_rows, n_places), and (n_rows,) where it can be told.

    X : (n_places, 2), at : (n_rows, 2) [m].
    """
    n, count = inside.shape[0], np.diff(inside.indptr)
    row, place = np.repeat(np.arange(n), count), inside.indices

    def summed(values: Floats) -> Floats:
        shape = values.shape[1:]
        columns = values.reshape(len(row), math.prod(shape)).T
        return np.stack([np.bincount(row, column, n) for column in columns], axis=1).reshape(n, *shape)

    d = X[place] - at[row]
    many = np.maximum(count, 1)[:, None]
    off = d - (summed(d) / many)[row]
    size, axes = np.linalg.eigh(summed(off[:, :, None] * off[:, None, :]) / many[:, :, None])
    # A row of cells has no size across.
    size = np.sqrt(np.maximum(size, 1e-12 * size[:, -1:]))
    d = np.einsum("pi,pij->pj", d, axes[row]) / np.where(size > 0.0, size, 1.0)[row]
    far = np.zeros(n)
    np.maximum.at(far, row, (d**2).sum(axis=1))
    d = d / np.sqrt(np.where(far > 0.0, far, 1.0))[row, None]
    weight = 1.0 / (NEAR + (d**2).sum(axis=1))
    x, y = d.T
    terms = np.stack([np.ones(len(d)), x, y, x * x, x * y, y * y][:TERMS[order]], axis=1)
    M = summed(weight[:, None, None] * terms[:, :, None] * terms[:, None, :])
    spread = np.linalg.eigvalsh(M[:, :3, :3] if partly else M)
    if partly:
        M[:, range(3, 6), range(3, 6)] += MISSING * np.trace(M, axis1=1, axis2=2)[:, None]
    # fault: a polynomial is told from a row of cells -> good = count >= least | contact/test_nodal_stress
    good = (count >= least) & (spread[:, 0] > SINGULAR * spread[:, -1])
    value = np.zeros((n, TERMS[order]))
    value[good] = np.linalg.solve(M[good], np.eye(TERMS[order])[:, :1][None])[..., 0]
    counts = weight * (terms * value[row]).sum(axis=1)
    # fault: a fit that makes much of what places are off by is taken -> pass | contact/test_nodal_stress
    good &= np.bincount(row, np.abs(counts), n) < MOST
    return csr_matrix(coo_matrix((counts, (row, place)), shape=inside.shape)), good
