"""Compiled loops over cells: conduction, cell means and rotations; and over rows of a sparse matrix.

They work for any table of nn nodes and nq quadrature points; sums run in the order of the cells.
Arrays of all of them: cells (ne, nn) node numbers; N (nq, nn) and dN (nq, nn, 2) shape functions and their derivatives
[1]; w (nq,) weights [1]; G (ne, nq, nn, 2) gradients of shape functions [1/m]; *_q (ne, nq) values at quadrature
points; slots (ne, nn, nn) places in the matrix data.  An empty `data` skips the matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Slots = NDArray[np.int64]


@kernel
def at_points(T: Floats, cells: Ints, N: Floats) -> Floats:
    """Interpolate the nodal field T : (n,) to the quadrature points; return (ne, nq) in the unit of T.

    cells : (ne, nn).  N : (nq, nn).
    """
    ne, nn = cells.shape
    T_q = np.zeros((ne, N.shape[0]))
    for e in range(ne):
        for q in range(N.shape[0]):
            for i in range(nn):
                T_q[e, q] += N[q, i] * T[cells[e, i]]
    return T_q


@kernel
def add_conduction(U: Floats, cells: Ints, G: Floats, w_q: Floats, k: Floats, f: Floats, slots: Slots, scale: float,
                   data: Floats) -> None:
    """Add conduction: f -= sum_q w grad N_i . grad U [W] and data += scale * (its derivative by T) [W/K].

    U : (ne, nn) potential at the nodes of cells [W/m].  cells : (ne, nn).  G : (ne, nq, nn, 2) [1/m].  w_q : (ne, nq)
    dV [m3].  k : (ne, nn) dU/dT [W/mK].  Or U is T [K], w_q is k dV [W m2/K] and k is 1.  f : (n,) [W].
    slots : (ne, nn, nn).  data : (nnz,) [W/K] or empty.
    Differences to the cell's first node are taken before the gradient, so a uniform temperature conducts exactly
    nothing.
    """
    ne, nn = cells.shape
    for e in range(ne):
        for q in range(w_q.shape[1]):
            gx = 0.0
            gy = 0.0
            for i in range(1, nn):
                d = U[e, i] - U[e, 0]
                gx += G[e, q, i, 0] * d
                gy += G[e, q, i, 1] * d
            for i in range(nn):
                f[cells[e, i]] -= w_q[e, q] * (gx * G[e, q, i, 0] + gy * G[e, q, i, 1])
                if data.size > 0:
                    for j in range(nn):
                        dot = G[e, q, i, 0] * G[e, q, j, 0] + G[e, q, i, 1] * G[e, q, j, 1]
                        data[slots[e, i, j]] += scale * (w_q[e, q] * dot * k[e, j])


@kernel
def add_conduction_tensor(U: Floats, cells: Ints, N: Floats, G: Floats, K_q: Floats, K_f: Floats, by_s: Floats,
                          df: Floats, f: Floats, slots: Slots, scale: float, data: Floats) -> None:
    """Add conduction by a symmetric tensor, for nodal unknowns s: U and f_s change with s by by_s and df [1/K].

    U, by_s : (ne, nn) potential [W/m] and its derivative [W/mK], or T [K] and its derivative [1].  cells : (ne, nn).
    N : (nq, nn).  G : (ne, nq, nn, 2) [1/m].  K_q, K_f : (ne, nq, 3), the components xx, xy, yy of K dV and of its
    derivative by f_s [m3], with k in it [W m2/K] where U is T.  df, f : (n,).  slots : (ne, nn, nn).
    data : (nnz,) [W/K] or empty, to which scale times the derivative of -f by s is added.
    """
    ne, nn = cells.shape
    for e in range(ne):
        for q in range(N.shape[0]):
            gx = 0.0
            gy = 0.0
            for i in range(1, nn):
                d = U[e, i] - U[e, 0]
                gx += G[e, q, i, 0] * d
                gy += G[e, q, i, 1] * d
            xx, xy, yy = K_q[e, q]
            for i in range(nn):
                kx = xx * G[e, q, i, 0] + xy * G[e, q, i, 1]
                ky = xy * G[e, q, i, 0] + yy * G[e, q, i, 1]
                f[cells[e, i]] -= kx * gx + ky * gy
                if data.size > 0:
                    by_f = _form(K_f[e, q], G[e, q, i], gx, gy)
                    for j in range(nn):
                        dot = kx * G[e, q, j, 0] + ky * G[e, q, j, 1]
                        # fault: no word of f_s in the matrix -> change = dot * by_s[e, j] + 0.0 * by_f * N[q, j] *
                        #   df[cells[e, j]] |
                        #   thermal_fmu/test_thermal_anisotropy::test_the_jacobian_is_the_derivative
                        change = dot * by_s[e, j] + by_f * N[q, j] * df[cells[e, j]]
                        data[slots[e, i, j]] += scale * change


@kernel
def _form(K: Floats, a: Floats, bx: float, by: float) -> float:
    """a . K b for K = (xx, xy, yy)."""
    return float(a[0] * (K[0] * bx + K[1] * by) + a[1] * (K[1] * bx + K[2] * by))


@kernel
def mean_flux(U: Floats, G: Floats, K_q: Floats, dV: Floats) -> Floats:
    """Return (ne, 2) volume means of -K grad U [W/m2].

    U : (ne, nn) at the nodes of cells.  G : (ne, nq, nn, 2) gradients [1/m].  K_q : (ne, nq, 3) as xx, xy, yy, or
    (ne, nq, 1) where isotropic; K U in W/m.  dV : (ne, nq) [m3].
    """
    ne, nn = U.shape
    flux = np.zeros((ne, 2))
    for e in range(ne):
        volume = 0.0
        for q in range(dV.shape[1]):
            volume += dV[e, q]
            gx = 0.0
            gy = 0.0
            for i in range(1, nn):
                d = U[e, i] - U[e, 0]
                gx += G[e, q, i, 0] * d
                gy += G[e, q, i, 1] * d
            xx, xy, yy = (K_q[e, q, 0], 0.0, K_q[e, q, 0])
            if K_q.shape[2] == 3:
                xy, yy = K_q[e, q, 1], K_q[e, q, 2]
            # fault: heat flux up the gradient -> flux[e, 0] += dV[e, q] * (xx * gx + xy * gy) |
            #   thermal_fmu/test_thermal_anisotropy::test_a13_patch_with_skewed_axes
            flux[e, 0] -= dV[e, q] * (xx * gx + xy * gy)
            flux[e, 1] -= dV[e, q] * (xy * gx + yy * gy)
        flux[e, 0] /= volume
        flux[e, 1] /= volume
    return flux


@kernel
def times(indptr: Ints, indices: Ints, data: Floats, x: Floats) -> Floats:
    """Return A x : (n,) of a CSR matrix: indptr (n + 1,), indices and data (nnz,); x : (n,)."""
    out = np.empty(indptr.size - 1)
    for i in range(out.size):
        total = 0.0
        for at in range(indptr[i], indptr[i + 1]):
            total += data[at] * x[indices[at]]
        out[i] = total
    return out


@kernel
def surface_change(indptr: Ints, indices: Ints, data: Floats, old_indptr: Ints, old_indices: Ints, old_data: Floats,
                   place: Ints, n_s: int) -> tuple[Floats, float, float]:
    """Return how a matrix changed between surface nodes, (n_s, n_s), and most elsewhere, and the old largest size.

    Both in CSR, columns in order: indptr (n + 1,), indices and data (nnz,).  place : (n,) number of a surface node
    among them, -1 of any other.
    """
    E, elsewhere, largest = np.zeros((n_s, n_s)), 0.0, 0.0
    for i in range(indptr.size - 1):
        at, end = indptr[i], indptr[i + 1]
        old, old_end = old_indptr[i], old_indptr[i + 1]
        while at < end or old < old_end:
            column, change = indptr.size, 0.0
            if at < end:
                column = indices[at]
            if old < old_end:
                column = min(column, old_indices[old])
            if at < end and indices[at] == column:
                change += data[at]
                at += 1
            if old < old_end and old_indices[old] == column:
                change -= old_data[old]
                largest = max(largest, abs(old_data[old]))
                old += 1
            if place[i] >= 0 and place[column] >= 0:
                E[place[i], place[column]] = change
            else:
                # fault: a matrix that changed inside bodies is taken for the same -> elsewhere = 0.0 |
                #   thermal_fmu/test_thermal_solver
                elsewhere = max(elsewhere, abs(change))
    return E, elsewhere, largest


@kernel
def with_blocks(indptr: Ints, indices: Ints, data: Floats, nodes: Ints, values: Floats,
                fixed: NDArray[np.bool_]) -> tuple[Ints, Ints, Floats]:
    """Add blocks to a CSR matrix, but for rows and columns that are fixed : (n,); columns stay in order.

    indptr (n + 1,), indices and data (nnz,), as returned.  nodes : (m, k) rows and columns of each block.  values :
    (m, k, k).
    """
    n, (m, k) = indptr.size - 1, nodes.shape
    first = np.zeros(n + 1, np.int64)  # of the blocks' rows, sorted by row
    for p in range(m):
        for i in range(k):
            first[nodes[p, i] + 1] += 1
    for row in range(n):
        first[row + 1] += first[row]
    rows, filled = np.empty((m * k, 2), np.int64), first[:-1].copy()
    for p in range(m):
        for i in range(k):
            at = filled[nodes[p, i]]
            rows[at, 0], rows[at, 1] = p, i
            filled[nodes[p, i]] += 1
    new_indptr = np.zeros(n + 1, np.int32)
    new_indices = np.empty(indices.size + m * k * k, np.int32)
    new_data = np.empty(new_indices.size)
    end = 0
    for row in range(n):
        begin = end
        for at in range(indptr[row], indptr[row + 1]):
            new_indices[end], new_data[end] = indices[at], data[at]
            end += 1
        for at in range(first[row], first[row + 1] if not fixed[row] else first[row]):
            p, i = rows[at]
            for j in range(k):
                column = nodes[p, j]
                if fixed[column]:
                    continue
                place = begin
                while place < end and new_indices[place] < column:
                    place += 1
                if place == end or new_indices[place] != column:
                    for later in range(end, place, -1):
                        new_indices[later], new_data[later] = new_indices[later - 1], new_data[later - 1]
                    new_indices[place], new_data[place] = column, 0.0
                    end += 1
                # fault: a block's value replaces what was there -> new_data[place] = values[p, i, j] |
                #   thermal_fmu/test_thermal_solver::test_blocks_are_added_to_a_matrix
                new_data[place] += values[p, i, j]
        new_indptr[row + 1] = end
    return new_indptr, new_indices[:end].copy(), new_data[:end].copy()


@kernel
def turn_of(x: Floats, cells: Ints, G: Floats) -> Floats:
    """Return (ne, nq) the angle [rad] of the rotation R in F = dx/dX = R U (polar decomposition).

    x : (n, 2) current coordinates [m].  cells : (ne, nn).  G : (ne, nq, nn, 2) gradients in the reference [1/m].
    """
    ne, nq, nn, _ = G.shape
    turn = np.zeros((ne, nq))
    for e in range(ne):
        for q in range(nq):
            across = 0.0
            along = 0.0
            for i in range(nn):
                node = cells[e, i]
                across += x[node, 1] * G[e, q, i, 0] - x[node, 0] * G[e, q, i, 1]
                along += x[node, 0] * G[e, q, i, 0] + x[node, 1] * G[e, q, i, 1]
            # fault: the turn from one edge of F instead of its rotation -> turn[e, q] = np.arctan2(across, along) + 0.1
            #   * (along - 2.0) | thermal_fmu/test_thermal_anisotropy::test_the_turn_is_that_of_the_polar_decomposition
            turn[e, q] = np.arctan2(across, along)
    return turn


@kernel
def flux_at_points(x: Floats, U: Floats, cells: Ints, dN: Floats, K_q: Floats) -> Floats:
    """Return (ne, nq, 2) heat flux -K grad U [W/m2] at the Gauss points, whatever the points of conduction.

    x : (n, 2) [m].  cells : (ne, nn).  dN : (nq, nn, 2).  U, K_q : as of mean_flux.
    """
    ne, nn = cells.shape
    flux = np.zeros((ne, dN.shape[0], 2))
    for e in range(ne):
        x0, y0 = x[cells[e, 0], 0], x[cells[e, 0], 1]
        for q in range(dN.shape[0]):
            xr, xs, yr, ys, Ur, Us = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(1, nn):
                node = cells[e, i]
                dx, dy, dU = x[node, 0] - x0, x[node, 1] - y0, U[e, i] - U[e, 0]
                xr += dN[q, i, 0] * dx
                xs += dN[q, i, 1] * dx
                yr += dN[q, i, 0] * dy
                ys += dN[q, i, 1] * dy
                Ur += dN[q, i, 0] * dU
                Us += dN[q, i, 1] * dU
            det = xr * ys - xs * yr
            gx, gy = (Ur * ys - Us * yr) / det, (Us * xr - Ur * xs) / det
            xx, xy, yy = (K_q[e, q, 0], 0.0, K_q[e, q, 0])
            if K_q.shape[2] == 3:
                xy, yy = K_q[e, q, 1], K_q[e, q, 2]
            flux[e, q, 0] = -(xx * gx + xy * gy)
            flux[e, q, 1] = -(xy * gx + yy * gy)
    return flux


@kernel
def add_to_nodes(cells: Ints, flux: Floats, dV: Floats, total: Floats, volume: Floats) -> None:
    """Add to every node the integral of the flux over each cell around it, and the volume of the cell.

    cells : (ne, nn).  flux : (ne, nq, 2) [W/m2] at points of volumes dV : (ne, nq) [m3].  total : (n, 2) [W m].
    volume : (n,) [m3].
    """
    ne, nn = cells.shape
    for e in range(ne):
        V, qx, qy = 0.0, 0.0, 0.0
        for q in range(dV.shape[1]):
            V += dV[e, q]
            qx += dV[e, q] * flux[e, q, 0]
            qy += dV[e, q] * flux[e, q, 1]
        for i in range(nn):
            node = cells[e, i]
            volume[node] += V
            total[node, 0] += qx
            total[node, 1] += qy


@kernel
def between_fluxes(cells: Ints, N: Floats, flux: Floats, total: Floats, volume: Floats, K_q: Floats,
                   dV: Floats) -> float:
    """Return the integral of d . K^-1 d [W K], d what lies between a flux and one that nodes interpolate [W/m2].

    cells : (ne, nn).  N : (nq, nn).  flux : (ne, nq, 2) [W/m2].  total : (n, 2) [W m] and volume : (n,) [m3] of nodes
    (add_to_nodes), whose flux is one over the other.  K_q : as of mean_flux.  dV : (ne, nq) [m3].
    """
    ne, nn = cells.shape
    out = 0.0
    at = np.empty((nn, 2))
    for e in range(ne):
        for i in range(nn):
            # fault: fluxes are added up at nodes -> V = 1.0 |
            #   thermal_fmu/test_mesh_error::test_a_linear_field_misses_nothing
            V = volume[cells[e, i]]
            at[i, 0], at[i, 1] = total[cells[e, i], 0] / V, total[cells[e, i], 1] / V
        for q in range(dV.shape[1]):
            dx, dy = -flux[e, q, 0], -flux[e, q, 1]
            for i in range(nn):
                dx += N[q, i] * at[i, 0]
                dy += N[q, i] * at[i, 1]
            if K_q.shape[2] == 3:
                xx, xy, yy = K_q[e, q]
                # fault: a conductivity across is that along -> yy = xx |
                #   thermal_fmu/test_mesh_error::test_it_is_the_same_in_other_frames_and_units
                out += dV[e, q] * (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
            else:
                out += dV[e, q] * (dx * dx + dy * dy) / K_q[e, q, 0]
    return out


@kernel
def add_surface(x: Floats, cell: NDArray[np.intp], nodes: Ints, flux: Floats, K_q: Floats, dV: Floats,
                axisymmetric: bool, height: float, stays: Floats, area: Floats, facing: Floats,
                resistance: Floats) -> None:
    """Add what surfaces are to their nodes, each edge with the mean flux of the cell behind it.

    x : (n, 2) [m].  cell : (m,) of each edge.  nodes : (m, 2), the body on the left.  flux : (ne, nq, 2) [W/m2], K_q as
    of mean_flux and dV : (ne, nq) [m3] of cells of nn nodes.  stays : (n,) += heat that is conducted out there [W].
    height : of a cell, 1 of a quad and 2 of a triangle, over its volume by the area of its edge.
    area : (n,) += area [m2].  facing : (n, 2) += area times outward normal [m2].  resistance : (n,) += area times the
    cell's thickness over its conductivity, both along the normal [m4 K/W].
    """
    for m in range(cell.size):
        e, i, j = cell[m], nodes[m, 0], nodes[m, 1]
        nx, ny = x[j, 1] - x[i, 1], x[i, 0] - x[j, 0]
        length = np.sqrt(nx * nx + ny * ny)
        at_i, at_j = 0.5 * length, 0.5 * length
        if axisymmetric:
            # fault: surfaces around an axis are those of the plane -> around = 1.0 |
            #   thermal_fmu/test_mesh_error::test_a_linear_field_misses_nothing
            around = 2.0 * np.pi / 3.0
            at_i, at_j = around * at_i * (2.0 * x[i, 0] + x[j, 0]), around * at_j * (x[i, 0] + 2.0 * x[j, 0])
        if at_i + at_j <= 0.0:  # on the axis
            continue
        nx, ny = nx / length, ny / length
        V, out, k = 0.0, 0.0, 0.0
        for q in range(dV.shape[1]):
            xx, xy, yy = (K_q[e, q, 0], 0.0, K_q[e, q, 0])
            if K_q.shape[2] == 3:
                xy, yy = K_q[e, q, 1], K_q[e, q, 2]
            V += dV[e, q]
            out += dV[e, q] * (flux[e, q, 0] * nx + flux[e, q, 1] * ny)
            k += dV[e, q] * (xx * nx * nx + 2.0 * xy * nx * ny + yy * ny * ny)
        thick = height * V / (at_i + at_j)
        for node, part in ((i, at_i), (j, at_j)):
            stays[node] += part * out / V
            area[node] += part
            facing[node, 0] += part * nx
            facing[node, 1] += part * ny
            resistance[node] += part * thick * V / k


@kernel
def of_bodies(body: Ints, n_bodies: int, T_n: Floats, T: Floats, moved: Floats, through: Floats) -> tuple[Floats,
                                                                                                         Floats]:
    """Return (n_bodies,) the heat that moved, and the span of the temperatures T_n and T : (n,) [K] of their nodes.

    body : (n,) of each node, -1 in none.  moved, through : (n,) heat [J] into nodes, and the part of it that came
    through the surface.  What moved is the most that either adds up to with one sign.
    """
    sums, ends = np.zeros((n_bodies, 4)), np.zeros((n_bodies, 2))
    ends[:, 0], ends[:, 1] = np.inf, -np.inf
    for i in range(body.size):
        b = body[i]
        if b < 0:
            continue
        sums[b, 0 if moved[i] > 0.0 else 1] += abs(moved[i])
        sums[b, 2 if through[i] > 0.0 else 3] += abs(through[i])
        ends[b, 0] = min(ends[b, 0], T_n[i], T[i])
        ends[b, 1] = max(ends[b, 1], T_n[i], T[i])
    heat, span = np.zeros(n_bodies), np.zeros(n_bodies)
    for b in range(n_bodies):
        heat[b], span[b] = sums[b].max(), max(ends[b, 1] - ends[b, 0], 0.0)
    return heat, span


@kernel
def held_up(body: Ints, n_bodies: int, stays: Floats, area: Floats, facing: Floats, resistance: Floats, span: Floats,
            least_faced: float) -> Floats:
    """Return (n_bodies,) [W K] of heat that stays at surface nodes: each times the difference it needs to go on.

    body : (n,) of each node.  stays : (n,) [W].  area, facing, resistance : of each node, as of add_surface.  span :
    (n_bodies,) [K], the largest difference there is.  least_faced : of the area beside a node: what it faces, at least.
    """
    missed = np.zeros(n_bodies)
    for i in range(body.size):
        if area[i] > 0.0 and body[i] >= 0:
            # At a corner heat may come in on one side alone, so the area it faces counts.
            faced = max(np.hypot(facing[i, 0], facing[i, 1]), least_faced * area[i])
            drop = abs(stays[i]) * resistance[i] / (3.0 * area[i] * faced)
            # fault: heat that jumps in counts without bound -> most = np.inf |
            #   thermal_fmu/test_mesh_error::test_steps_do_not_matter_as_long_as_they_resolve_the_heat
            most = span[body[i]]
            missed[body[i]] += abs(stays[i]) * min(drop, most)
    return missed
