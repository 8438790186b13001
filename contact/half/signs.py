"""Couplings of conduction with the wrong sign: where a mesh lets temperatures leave their data.

Nodes of a mesh exchange heat by the off-diagonal entries of its conduction matrix.  Where all of them are <= 0 (with
heat stored at nodes an M-matrix) no node leaves what pulls it, in steps of any length by backward Euler.  A triangle
couples the two nodes across an angle beyond 90 degrees with the wrong sign, a quad where it is skewed (Thomee, Galerkin
Finite Element Methods for Parabolic Problems, ch. 15).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import CellQuadrature, table_of
from contact.half.gradients import narrow_side, spread_of
from contact.half.interface import Interface

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class WrongSign:
    """The worst coupling of a body.

    share : of the lesser of the two nodes' own entries [1].  edges : how many are wrong, of how many `of`.  at : (2,)
    the middle between the two nodes [m].  angle : largest of the cells that have both [degrees], triangle : whether the
    cell with it is one.
    """

    share: float
    edges: int
    of: int
    at: Floats
    angle: float
    triangle: bool


def wrong_signs(interface: Interface, k: Mapping[str, Floats], least: float) -> dict[str, WrongSign]:
    """Return the worst coupling of each body that has one beyond `least`, as a share.

    k : of parts (bodies and regions), (2, 2) the tensor of conductivity [W/mK].  Raises nothing: cells turned inside
    out have no say.
    """
    x, n = interface.nodes, len(interface.nodes)
    diagonal = np.zeros(n)
    keys, values, angles = [], [], []
    for kind, cells, part in (("quad", interface.quads, interface.quad_part),
                              ("triangle", interface.triangles, interface.triangle_part)):
        if not len(cells):
            continue
        table, cells = table_of(kind), np.ascontiguousarray(cells)
        G, dC = conduction_gradients(x, cells, table, interface.axisymmetric)
        tensor = np.array([k[name] for name in interface.parts])[part]
        flux = (G * dC[..., None, None]).reshape(len(cells), -1, 2) @ tensor
        K = _rows(flux.reshape(G.shape)) @ _rows(G).swapaxes(1, 2)
        diagonal += np.bincount(cells.ravel(), np.einsum("eii->ei", K).ravel(), n)
        widest = _widest_angle(x[cells])
        for i, j in combinations(range(cells.shape[1]), 2):
            low, high = np.sort(cells[:, (i, j)].astype(np.int64), axis=1).T
            keys.append(low * n + high)
            values.append(K[:, i, j])
            angles.append(widest if kind == "quad" else -widest)
    found, of = np.unique(np.concatenate(keys), return_inverse=True)
    coupling = np.bincount(of, np.concatenate(values), found.size)
    ends = np.stack(np.divmod(found, n), axis=1)
    share = coupling / diagonal[ends].min(axis=1)
    out = {}
    for b, name in enumerate(interface.bodies):
        own = np.flatnonzero(interface.node_body[ends[:, 0]] == b)
        wrong = own[share[own] > least]
        if wrong.size:
            worst = wrong[np.argmax(share[wrong])]
            around = np.concatenate(angles)[of == worst]
            angle = float(around[np.argmax(np.abs(around))])
            out[name] = WrongSign(float(share[worst]), wrong.size, own.size, x[ends[worst]].mean(axis=0), abs(angle),
                                  angle < 0.0)
    return out


def conduction_gradients(x: Floats, cells: NDArray[np.integer], table: CellQuadrature, axisymmetric: bool,
                         ) -> tuple[Floats, Floats]:
    """Return gradients (ne, nq, nn, 2) [1/m] and volumes (ne, nq) [m3] at the points of conduction; 0 of cells turned
    inside out.

    What shape_gradients fills, of all cells at once: a look at a scene does not wait for that to be compiled.
    x : (n, 2) [m].  cells : (ne, nn).
    """
    N, dN = table.N, table.dN
    J = np.einsum("ena,qnb->eqab", x[cells], dN)  # dx_a / dr_b
    depth = 2.0 * np.pi * (x[cells, 0] @ N.T) if axisymmetric else np.ones(J.shape[:2])
    right = (np.linalg.det(J) * depth > 0.0).all(axis=1)
    J[~right], depth[~right] = np.eye(2), 1.0
    slopes = np.broadcast_to(dN, (len(cells), *dN.shape)).copy()
    if cells.shape[1] == 4:
        mean = J.mean(axis=1)
        long_r = (mean[..., 0] ** 2).sum(axis=1) > (mean[..., 1] ** 2).sum(axis=1)
        r, s = N[:, 1] + N[:, 2] - 0.5, N[:, 2] + N[:, 3] - 0.5
        change = 12.0 * (np.where(long_r[:, None], s, r) * depth).mean(axis=1)
        narrow = narrow_side(change, depth.mean(axis=1)) if axisymmetric else 1.0
        f = spread_of(mean[:, 0, 0], mean[:, 0, 1], mean[:, 1, 0], mean[:, 1, 1], np.linalg.det(J).min(axis=1), narrow)
        # Derivatives across the long axis change along it.
        for across in (0, 1):
            own = np.flatnonzero((f > 1.0) & (long_r == (across == 1)))
            out = f[own, None, None]
            J[own, :, :, across] = (1.0 - out) * mean[own, None, :, across] + out * J[own, :, :, across]
            slopes[own, ..., across] = (1.0 - out) * dN[..., across].mean(axis=0) + out * dN[..., across]
            if axisymmetric:
                way = (r if across else s) * J[own, :, 0, 1 - across]
                depth[own] -= 2.0 * np.pi * way * (1.0 - 1.0 / out[:, :, 0])
    G = slopes @ np.linalg.inv(J)
    G[~right] = 0.0
    return G, np.where(right[:, None], table.w * np.linalg.det(J) * depth, 0.0)


def _rows(G: Floats) -> Floats:
    """Arrange vectors at the points of cells (ne, nq, nn, 2) as a row a node, (ne, nn, nq * 2)."""
    return G.swapaxes(1, 2).reshape(len(G), G.shape[2], -1)


def _widest_angle(corners: Floats) -> Floats:
    """Return (ne,) the largest inner angle [degrees] of cells with corners : (ne, nn, 2), anticlockwise."""
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = ahead[..., 0] * back[..., 1] - ahead[..., 1] * back[..., 0]
    return np.asarray(np.degrees(np.arctan2(cross, (ahead * back).sum(axis=2)) % (2.0 * np.pi)).max(axis=1))
