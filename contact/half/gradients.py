"""Compiled loop over cells that fills gradients of shape functions, at the points of conduction, and volumes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


LEAST_DET = 0.2  # of the cell's middle, at the points of conduction


def narrow_side(change: Any, depth: Any) -> Any:
    """Return int N_0^2 r over 1/3 int r across a quad's short side [1], N_0 that of the side nearer to the axis.

    It is 1 in the plane and 1/2 at the axis itself.  depth : mean of the depths of the Gauss points; change : mean of
    12 way depth, way their place across in [-1/2, 1/2].  Of one quad or of arrays of them.
    """
    return 1.0 - 0.25 * abs(change) / depth


def spread_of(xr: Any, xs: Any, yr: Any, ys: Any, least: Any, narrow: Any) -> Any:
    """Return how far out along its long axis the points of conduction of a quad lie: 1 at its Gauss points, or more.

    xr to ys : dx/dr, dx/ds, dy/dr, dy/ds at the middle.  least : least determinant of Gauss points.  narrow :
    narrow_side.  Of one quad or of arrays of them.
    On a rectangle of sides a > b the coupling along a is -(b/a)/3 + (a/b) (1 - z)/4, z the square of the points' place
    in [-1, 1] along a.  With Gauss points, z = 1/3, it has the wrong sign beyond a/b = sqrt 2, and a jump under- and
    overshoots along the surface (2 % at 2, 11 % at 10).  z = 1 - 4/3 (b/a)^2 makes it 0.  Where a runs along an axis of
    revolution, less conducts along the side nearer to it, and z = 1 - 4/3 narrow (b/a)^2 makes that 0.  Any z is exact
    for linear fields and of second order.  In a distorted cell determinants stay positive there.
    """
    a = xr * xr + yr * yr
    b = xs * xs + ys * ys
    # fault: cells at the axis couple as in the plane -> z = 1.0 - 4.0 / 3.0 * np.minimum(a, b) / np.maximum(a, b) |
    #   thermal_fmu/test_thermal_limits
    z = 1.0 - 4.0 / 3.0 * narrow * np.minimum(a, b) / np.maximum(a, b)
    # fault: conduction at Gauss points whatever the shape -> f = 0.0 * z + 1.0 | thermal_fmu/test_thermal_limits
    f = np.sqrt(np.maximum(3.0 * z, 1.0))
    middle = xr * ys - xs * yr
    # The least determinant falls with f from the middle's; no farther than LEAST_DET of that.
    drop = np.maximum(middle - least, 1e-300)
    return np.minimum(f, np.maximum(1.0, (1.0 - LEAST_DET) * middle / drop))


_narrow, _spread = inner(narrow_side), inner(spread_of)


@kernel
def shape_gradients(x: Floats, cells: Ints, N: Floats, dN: Floats, w: Floats, axisymmetric: bool,
                    G: Floats, dV: Floats, dC: Floats) -> int:
    """Fill G [1/m], dV and dC (ne, nq) [m3] on coordinates x : (n, 2) [m]; return the first inverted cell or -1.

    cells : (ne, nn).  N : (nq, nn).  dN : (nq, nn, 2).  w : (nq,).  G : (ne, nq, nn, 2).
    dV, of the quadrature points, carries the weight 2 pi r when axisymmetric, else it is per metre of depth.  G and dC
    are those of conduction, whose points lie farther out in stretched quads (spread_of).
    """
    ne, nn = cells.shape
    nq = w.size
    at, mean = np.empty((nq, 5)), np.empty(4)
    for e in range(ne):
        mean[:] = 0.0
        least = np.inf
        for q in range(nq):
            xr = 0.0
            xs = 0.0
            yr = 0.0
            ys = 0.0
            r = 0.0
            for i in range(nn):
                node = cells[e, i]
                xr += dN[q, i, 0] * x[node, 0]
                xs += dN[q, i, 1] * x[node, 0]
                yr += dN[q, i, 0] * x[node, 1]
                ys += dN[q, i, 1] * x[node, 1]
                r += N[q, i] * x[node, 0]
            det = xr * ys - xs * yr
            # fault: 2 pi r dropped in cells -> depth = 1.0 | thermal_fmu/test_thermal_space
            depth = 2.0 * np.pi * r if axisymmetric else 1.0
            if not det * depth > 0.0:
                return e
            for i in range(nn):
                G[e, q, i, 0] = (ys * dN[q, i, 0] - yr * dN[q, i, 1]) / det
                G[e, q, i, 1] = (xr * dN[q, i, 1] - xs * dN[q, i, 0]) / det
            dV[e, q] = w[q] * det * depth
            dC[e, q] = dV[e, q]
            at[q, 0], at[q, 1], at[q, 2], at[q, 3], at[q, 4] = xr, xs, yr, ys, depth
            for j in range(4):
                mean[j] += at[q, j] / nq
            least = min(least, det)
        if nn != 4:
            continue
        along_r = mean[0] * mean[0] + mean[2] * mean[2] > mean[1] * mean[1] + mean[3] * mean[3]
        narrow = 1.0
        if axisymmetric:
            depth = 0.0
            change = 0.0
            for q in range(nq):
                way = N[q, 2] + N[q, 3] - 0.5 if along_r else N[q, 1] + N[q, 2] - 0.5
                depth += at[q, 4] / nq
                change += 12.0 * way * at[q, 4] / nq
            narrow = _narrow(change, depth)
        f = _spread(mean[0], mean[1], mean[2], mean[3], least, narrow)
        if f > 1.0:
            for q in range(nq):
                # Derivatives across the long axis change along it, linearly; r at 1/f there keeps int N_i r.
                xr, xs, yr, ys, depth = at[q]
                if along_r:
                    xs, ys = mean[1] + f * (xs - mean[1]), mean[3] + f * (ys - mean[3])
                    way = (N[q, 1] + N[q, 2] - 0.5) * xr
                else:
                    xr, yr = mean[0] + f * (xr - mean[0]), mean[2] + f * (yr - mean[2])
                    way = (N[q, 2] + N[q, 3] - 0.5) * xs
                det = xr * ys - xs * yr
                if axisymmetric:
                    depth -= 2.0 * np.pi * way * (1.0 - 1.0 / f)
                dC[e, q] = w[q] * det * depth
                for i in range(nn):
                    dr, ds = dN[q, i, 0], dN[q, i, 1]
                    if along_r:
                        centre = 0.0
                        for p in range(nq):
                            centre += dN[p, i, 1] / nq
                        ds = centre + f * (ds - centre)
                    else:
                        centre = 0.0
                        for p in range(nq):
                            centre += dN[p, i, 0] / nq
                        dr = centre + f * (dr - centre)
                    G[e, q, i, 0] = (ys * dr - yr * ds) / det
                    G[e, q, i, 1] = (xr * ds - xs * dr) / det
    return -1
