"""Quadrature points of a field in the cells in which its profiles kink: what it gives is the same wherever nodes are.

At the points of a cell a part of a field that is narrower than the cell is read too often or missed.  Each such cell is
cut along the kinks into triangles, with points of their own that integrate polynomials up to the fifth degree exactly:
the product of two straight profiles, a shape function and the radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import SLIVER, Field

Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]

# Dunavant, "High degree efficient symmetrical Gaussian quadrature rules for the triangle", Int. J. Numer. Methods Eng.
# 21 (1985) 1129-1148: 7 points, degree 5, in closed form (Radon 1948).
_A, _B = (6.0 - np.sqrt(15.0)) / 21.0, (6.0 + np.sqrt(15.0)) / 21.0
BARYCENTRIC: Floats = np.array([[1.0, 1.0, 1.0]] + [
    [a if j != i else 3.0 - 2.0 * a for j in range(3)] for a in (3.0 * _A, 3.0 * _B) for i in range(3)]) / 3.0
WEIGHT: Floats = np.array([9.0 / 40.0] + [(155.0 - np.sqrt(15.0)) / 1200.0] * 3
                          + [(155.0 + np.sqrt(15.0)) / 1200.0] * 3)
# Places in a quad are found by Newton's method, from its middle; in one that is nearly a parallelogram by two steps.
STEPS, CLOSE = 12, 1e-13


@dataclass(frozen=True)
class PartedCells:
    """Points in cells that kinks cross.  cells : (m,) rows of the cells, each once.

    cell : (n,) row of each point's.  N : (n, nn) shape functions there [1].  volume : (n,) [m3], per metre of depth
    when plane.  x : (n, 2) [m].
    """

    cells: Numbers
    cell: Numbers
    N: Floats
    volume: Floats
    x: Floats


def parted_cells(field: Field, corners: Floats, axisymmetric: bool) -> PartedCells | None:
    """Place points in the cells that a kink of the field crosses; None where none does.

    corners : (ne, 3 or 4, 2) [m] of the cells, anticlockwise.
    """
    crossed = field.bends_within(corners)
    # fault: cells are not parted where a source kinks -> rows = np.flatnonzero(crossed & False) |
    #   thermal_fmu/test_source_strip
    rows = np.flatnonzero(crossed & _convex(corners))
    if not rows.size:
        return None
    low, high = corners.min(axis=1), corners.max(axis=1)
    margin = SLIVER * (high - low)
    # A quad that is no parallelogram has shape functions that no degree integrates exactly: parted along both of its
    # diagonals, half of each, it gives the same whichever corner comes first.
    # fault: what a quad is given depends on which corner comes first -> fans = [(0, 1, 2)] if corners.shape[1] == 3
    #   else [(0, 1, 2), (0, 2, 3)] * 2 | thermal_fmu/test_source_strip
    fans = [(0, 1, 2)] if corners.shape[1] == 3 else [(0, 1, 2), (0, 2, 3), (1, 2, 3), (1, 3, 0)]
    of = np.tile(rows, len(fans))
    triangles = np.concatenate([corners[rows][:, list(fan)] for fan in fans])
    for axis, kinks in enumerate(field.kinks):
        inside = kinks[(kinks > low[rows, axis].min()) & (kinks < high[rows, axis].max())]
        for at in inside:
            of, triangles = _cut(of, triangles, axis, float(at), margin[:, axis])
    points = np.einsum("pk,tkd->tpd", BARYCENTRIC, triangles).reshape(-1, 2)
    volume = (_areas(triangles)[:, None] * WEIGHT).ravel() * (1.0 if len(fans) == 1 else 0.5)
    cell = np.repeat(of, WEIGHT.size)
    return PartedCells(rows, cell, _shape_functions(corners[cell], points),
                       volume * (2.0 * np.pi * points[:, 0] if axisymmetric else 1.0), points)


def _cut(of: Numbers, triangles: Floats, axis: int, at: float, margin: Floats) -> tuple[Numbers, Floats]:
    """Cut the triangles (n, 3, 2) that a line across an axis passes; `of` : (n,) whose they are."""
    s = triangles[:, :, axis] - at
    passed = (s.min(axis=1) < -margin[of]) & (s.max(axis=1) > margin[of])
    if not passed.any():
        return of, triangles
    mine, s = of[passed], s[passed]
    order = np.argsort(s, axis=1)
    s = np.take_along_axis(s, order, axis=1)
    a, b, c = np.moveaxis(np.take_along_axis(triangles[passed], order[:, :, None], axis=1), 1, 0)
    # The corner that is alone on its side first: a, or c.
    alone = s[:, 1] > 0.0
    first, last = np.where(alone[:, None], a, c), np.where(alone[:, None], c, a)
    s_first, s_last = np.where(alone, s[:, 0], s[:, 2]), np.where(alone, s[:, 2], s[:, 0])
    to_middle = first + (s_first / (s_first - s[:, 1]))[:, None] * (b - first)
    to_last = first + (s_first / (s_first - s_last))[:, None] * (last - first)
    parts = [np.stack(corners, axis=1) for corners in ((first, to_middle, to_last), (to_middle, b, last),
                                                       (to_middle, last, to_last))]
    return np.concatenate([of[~passed], mine, mine, mine]), np.concatenate([triangles[~passed], *parts])


def _areas(triangles: Floats) -> Floats:
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def _convex(corners: Floats) -> NDArray[np.bool_]:
    """(ne,) which cells turn left at every corner."""
    ahead = np.roll(corners, -1, axis=1) - corners
    back = np.roll(ahead, 1, axis=1)
    left = back[..., 0] * ahead[..., 1] > back[..., 1] * ahead[..., 0]
    return np.asarray(left.all(axis=1))


def _shape_functions(corners: Floats, x: Floats) -> Floats:
    """(n, 3 or 4) shape functions [1] at points x : (n, 2) [m] of cells with corners : (n, 3 or 4, 2) [m]."""
    (ax, ay), (bx, by), (cx, cy) = (corners[:, k].T for k in (0, 1, -1))
    ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
    px, py = x[:, 0] - ax, x[:, 1] - ay
    if corners.shape[1] == 3:
        D = ux * vy - uy * vx
        p, q = (px * vy - py * vx) / D, (ux * py - uy * px) / D
        return np.stack([1.0 - p - q, p, q], axis=1)
    wx, wy = corners[:, 2, 0] - bx - vx, corners[:, 2, 1] - by - vy
    p = q = np.full(len(x), 0.5)
    for _ in range(STEPS):
        # Derivatives of the place by p and by q, and what is left of the way.
        gx, gy, hx, hy = ux + q * wx, uy + q * wy, vx + p * wx, vy + p * wy
        rx, ry = px - p * gx - q * vx, py - p * gy - q * vy
        D = gx * hy - gy * hx
        dp, dq = (rx * hy - ry * hx) / D, (gx * ry - gy * rx) / D
        p, q = p + dp, q + dq
        if max(np.abs(dp).max(), np.abs(dq).max()) < CLOSE:
            break
    return np.stack([(1.0 - p) * (1.0 - q), p * (1.0 - q), p * q, (1.0 - p) * q], axis=1)
