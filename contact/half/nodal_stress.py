"""Stress at the nodes of a mesh, from the means of its cells: a field fitted around each node.

Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331 (patch recovery).  What a cell tells is the stress half a
cell away from the surface, and the highest stress is at the surface most times.  So around each node a polynomial is
fitted, by least squares, to the stress where a mesh of first order knows it best: in the middle of a quad, and in the
middle of an edge between two triangles, as the mean of both (of what they are off by, most cancels where they lie
point by point opposite each other).  Its value at the node is exact where the stress is of second order in place.

Fits stay within one part (a body, or one of its regions): where materials change stress may jump.  Two rows of cells
tell no curvature across them, so that is taken to be 0; a single row, straight or bent, tells nothing: how stress
changes across it is not known.  Along a straight one it is: what it is off by there is the least that it is off by.
What is fitted does not hang on the frame: offsets are taken in the axes and lengths of the patch.

At a curve that goes into a body (a hole, a groove, a fillet) stress falls within its radius, and no polynomial over
place does.  Where the centre of such a curve is given, place is the way along it and (1 - (radius/r)^2)/2 radii of
depth, and stress turns with the curve: that of a thick tube (Lame) is of first order in this and that of a round hole
(Kirsch) of second, however large the cells are.
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
# Rings of cells around a node of a single row: at its end they are as many cells.
ROW_RINGS = 3
STRAIGHT = 1e-3  # of the length of a patch: a row whose places stray no more from a line
SINGULAR = 1e-6  # of the eigenvalues of the normal equations: the places do not tell the polynomial
MISSING = 1e-6  # of their trace: holds terms at 0 that the places do not tell, and hardly any other
MOST = 12.0  # what places are off by comes to so many times as much at a node; 3.5 at an edge, 5 to 8 in a corner,
# 10 at a hole of four quads a quarter
NEAR = 0.05  # places count by 1/(NEAR + d^2), d their distance in the size of the patch
ROWS = 2000  # nodes at a time


@dataclass(frozen=True)
class NodalStress:
    """How the stress at nodes follows from that of cells.

    node, part : (n_rows,) a node, and the part whose cells were fitted: a node has a row for each part there.
    fit : (n_rows, n_cells) takes means of cells to them.  known : (n_rows,) whether a patch could be fitted.
    along : (n_rows,) whether it could be fitted along a single row of cells, nothing being known across it.
    turned : (n_rows, n_cells), complex, the same of (11 - 22)/2 + i 12 where stress turns with a curve; None: fit.
    """

    node: Ints
    part: Ints
    fit: csr_matrix
    known: NDArray[np.bool_]
    along: NDArray[np.bool_]
    turned: csr_matrix | None = None

    def of(self, stress: Floats) -> Floats:
        """Return (n_rows, 4) [Pa] of stress : (n_cells, 4) [Pa], 11, 22, 12, 33."""
        at_nodes = self.fit @ stress
        # fault: stress does not turn with the curve -> turned = None | contact/test_nodal_stress
        turned = self.turned
        if turned is not None:
            half = turned @ (0.5 * (stress[:, 0] - stress[:, 1]) + 1j * stress[:, 2])
            mean = 0.5 * (at_nodes[:, 0] + at_nodes[:, 1])
            at_nodes[:, :3] = np.stack([mean + half.real, mean - half.real, half.imag], axis=1)
        return np.asarray(at_nodes)


def von_mises(stress: Floats) -> Floats:
    """Return (n,) [Pa] of stress : (n, 4) [Pa], 11, 22, 12, 33."""
    a, b, shear, c = stress.T
    return np.asarray(np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3.0 * shear**2))


def nodal_stress(interface: Interface, fits: Iterable[tuple[int, int, int, bool]] = QUADRATIC,
                 centres: Floats | None = None, rows: int = 0) -> NodalStress:
    """Work out how stress at nodes follows from that of cells, which are quads first.

    fits : LINEAR or QUADRATIC.  centres : (n_nodes, 2) [m] of curves that go into a body, nan of other nodes.
    rows : the order along single rows of cells; 0: they are not fitted.
    """
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
    done, known = np.zeros(keys.size, dtype=bool), np.zeros(keys.size, dtype=bool)
    blocks: list[tuple[Ints, csr_matrix, csr_matrix]] = []
    inner = _inner(interface, part, keys)
    centre = np.full_like(at, np.nan) if centres is None else centres[node]
    # fault: a hole is fitted as what is straight -> bent = np.zeros(keys.size, dtype=bool) | contact/test_nodal_stress
    bent = np.isfinite(centre).all(axis=1)
    for curved, (order, rings, least, partly) in [(c, of) for c in (True, False) for of in fits]:
        left = np.flatnonzero(~done & (bent if curved else True))
        for first in range(0, left.size, ROWS):
            own = left[first:first + ROWS]
            patch = touches[own]
            for _ in range(rings - 1):
                patch = patch @ touches.T @ touches
            *both, good = _fitted(_inside(patch, places), X, at[own], order, least, partly,
                                  centre[own] if curved else None)
            # fault: what a row that bends tells of its middle is taken for what is across -> pass |
            #   contact/test_nodal_stress
            good &= _across(patch, touches, inner)
            blocks.append((own[good], *(of[np.flatnonzero(good)] @ places for of in both)))
            done[own[good]] = known[own[good]] = True
    along, left = np.zeros(keys.size, dtype=bool), np.flatnonzero(~done) if rows else np.empty(0, dtype=np.intp)
    for first in range(0, left.size, ROWS):
        own = left[first:first + ROWS]
        patch = touches[own]
        for _ in range(ROW_RINGS - 1):
            patch = patch @ touches.T @ touches
        fit, good = _fitted_along(_inside(patch, places), X, at[own], rows)
        of_cells = fit[np.flatnonzero(good)] @ places
        blocks.append((own[good], of_cells, of_cells))
        done[own[good]] = along[own[good]] = True
    rest = np.flatnonzero(~done)
    blocks.append((rest, around[rest], around[rest]))
    back = np.argsort(np.concatenate([own for own, *_ in blocks]), kind="stable")
    fit, turned = (csr_matrix(vstack([block[k] for block in blocks]).tocsr()[back]) for k in (1, 2))
    return NodalStress(node, keys // n, fit, known, along, turned if bent.any() else None)


def _inner(interface: Interface, part: Ints, keys: Ints) -> NDArray[np.bool_]:
    """(n_rows,) whether cells of its part are all around a node.  keys : (n_rows,) part * n_nodes + node."""
    n, first, outer = len(interface.nodes), len(interface.quads), []
    many = n * (int(part.max()) + 1)
    for of, owner in ((interface.quads, part[:first]), (interface.triangles, part[first:])):
        ends = owner[:, None, None] * n + np.stack([of, np.roll(of, -1, axis=1)], axis=2).astype(np.int64)
        outer.append((ends.min(axis=2) * many + ends.max(axis=2)).ravel())
    edges, count = np.unique(np.concatenate(outer), return_counts=True)
    once = edges[count == 1]
    return ~np.isin(keys, np.concatenate([once // many, once % many]))


def _across(patch: csr_matrix, touches: csr_matrix, inner: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(n_rows,) whether a patch has more than one row of cells: all that are around some node inside.

    Middles of a single row that bends do not lie on a line; how stress changes across it they do not tell either.
    """
    has, at = patch.copy(), touches[np.flatnonzero(inner)]
    has.data[:] = 1.0
    around = csr_matrix(has @ at.T)
    whole = np.asarray(at.sum(axis=1)).ravel()[around.indices]
    row = np.repeat(np.arange(patch.shape[0]), np.diff(around.indptr))
    return np.bincount(row[around.data > whole - 0.5], minlength=patch.shape[0]) > 0


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


def _along(X: Floats, at: Floats, centre: Floats) -> tuple[Floats, Floats]:
    """(n, 2) [m] the way along a curve of this centre, and depth as it counts there, of X : (n, 2) seen from `at`; and
    (n,) the angle [rad] between them."""
    out, d = at - centre, X - centre
    radius = np.hypot(*out.T)
    angle = np.arctan2(out[:, 0] * d[:, 1] - out[:, 1] * d[:, 0], (out * d).sum(axis=1))
    squares = np.maximum((d**2).sum(axis=1), np.finfo(float).tiny)
    return np.stack([radius * angle, 0.5 * radius * (1.0 - radius**2 / squares)], axis=1), angle


def _fitted(inside: csr_matrix, X: Floats, at: Floats, order: int, least: int, partly: bool,
            centre: Floats | None = None) -> tuple[csr_matrix, csr_matrix, NDArray[np.bool_]]:
    """What each place counts in the value at nodes, (n_rows, n_places), the same of what turns with a curve, complex,
    and (n_rows,) where it can be told.

    X : (n_places, 2), at : (n_rows, 2) [m].  centre : (n_rows, 2) [m] of the curves that they are on.
    """
    n, count = inside.shape[0], np.diff(inside.indptr)
    row, place = np.repeat(np.arange(n), count), inside.indices

    def summed(values: Floats) -> Floats:
        shape = values.shape[1:]
        columns = values.reshape(len(row), math.prod(shape)).T
        return np.stack([np.bincount(row, column, n) for column in columns], axis=1).reshape(n, *shape)

    d, turn = X[place] - at[row], np.ones(len(row))
    if centre is not None:
        d, angle = _along(X[place], at[row], centre[row])
        turn = np.exp(-2j * angle)
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
    both = [csr_matrix(coo_matrix((of, (row, place)), shape=inside.shape)) for of in (counts, counts * turn)]
    return both[0], both[1], good


def _fitted_along(inside: csr_matrix, X: Floats, at: Floats, order: int) -> tuple[csr_matrix, NDArray[np.bool_]]:
    """As _fitted, by a polynomial of the place along a straight row of cells."""
    counts, good = csr_matrix(inside.shape).tolil(), np.zeros(inside.shape[0], dtype=bool)
    for i in range(inside.shape[0]):
        place = inside.indices[inside.indptr[i]:inside.indptr[i + 1]]
        if place.size <= order:
            continue
        off = X[place] - X[place].mean(axis=0)
        _, (long, across), axes = np.linalg.svd(off, full_matrices=False)
        s = (X[place] - at[i]) @ axes[0] / long
        weight = 1.0 / np.sqrt(NEAR + s**2)
        values = np.linalg.pinv(weight[:, None] * np.vander(s, order + 1, increasing=True))[0] * weight
        # fault: a row that bends is taken for a straight one -> good[i] = True | contact/test_nodal_stress
        good[i] = across <= STRAIGHT * long and np.abs(values).sum() < MOST
        counts[i, place] = values
    return csr_matrix(counts), good
