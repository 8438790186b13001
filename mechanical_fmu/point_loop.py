"""The loop over cells of any material, point by point: mean dilatation, enhanced strain, plane stress.  numba.

Mean dilatation: deviators are the points', the pressure part is of the cell's theta = v/V,
    W = sum_q w psi_dev(F_q) + V kappa/2 (ln theta - e_th)^2;
without it the pressure is each point's own.  Modes of enhanced strain come behind the nodes as if they were nodes.
A cell's numbers that evolve lie in one row of history: [modes | of each point: history, ln F33 in plane stress].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner, kernel
from mechanical_fmu.elastic_loop import dilatation
from mechanical_fmu.strain import (
    MAX_MODE_ITERATIONS,
    MAX_MODE_STRAIN,
    MIN_MODE_DAMPING,
    MODE_ROUND_OFF,
    MODE_TOLERANCE,
    CellMaterials,
    PointScratch,
    add_dilatation_curvature,
    back,
    dilatation_gradient,
    eliminate,
    respond,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

INVERTED, NO_MODES = -1, 101


class CellShapes(NamedTuple):
    """Where the cells are.  B : (n_e, nq, nn + n_x, 2), N_over_R : (n_e, nq, nn + n_x) [1/m], modes behind the nodes.

    nodes : (n_e, nn) node numbers.  weight : (n_e, nq) [m3] of each point.  volume : (n_e,) [m3].
    n_modes : numbers the modes have (n_x of them are vectors, but the last about an axis has one component).
    """

    nodes: Ints
    B: Floats
    N_over_R: Floats
    weight: Floats
    volume: Floats
    n_modes: int


class Out(NamedTuple):
    """What the loop fills, empty arrays where it is not wanted.

    f : (n_nodes, 2) [N], added to.  K : (n_e, 2 nn, 2 nn) [N/m].  history : (n_e, n_row).  heat : (n_e,) [J].
    stress, strain : (n_e, nq, 4) Cauchy [Pa] and Green-Lagrange, (11, 22, 12, 33).
    """

    f: Floats
    K: Floats
    history: Floats
    heat: Floats
    stress: Floats
    strain: Floats


class CellScratch(NamedTuple):
    """Room for one cell of n_m numbers of its modes.

    u : (nn + n_x, 2) [m], nodes, then modes.  F : (nq, 5) [1].  J : (nq,) [1].  P : (nq, 5) [Pa].  A : (nq, 5, 5) [Pa].
    K : (2 nn + n_m, 2 nn + n_m) [N/m] and r : (2 nn + n_m,) [N], nodes, then modes.  H : (n_m, n_m) [N/m] and
    a : (n_m,) of the modes alone, [N] and once solved for [m].  d : (2 nn,) [m2] change of the cell's volume by its
    displacements.  dJ : (5,) [1].
    """

    u: Floats
    F: Floats
    J: Floats
    P: Floats
    A: Floats
    K: Floats
    r: Floats
    H: Floats
    a: Floats
    d: Floats
    dJ: Floats


@kernel
def cell_points(shape: CellShapes, law: CellMaterials, u: Floats, history_n: Floats, out: Out) -> tuple[int, int]:
    """Fill out at u : (n_nodes, 2) [m].  Returns (cell, code) of the first cell that fails, or (-1, 0).

    history_n : (n_e, n_row) at the start of the step: modes [m], then of each point its history and ln F33 [1].
    code : INVERTED, NO_MODES where the modes are not found, NO_THICKNESS or one of points.CODES.
    """
    n_e, nq, n_all = shape.B.shape[0], shape.B.shape[1], shape.B.shape[2]
    nn, nm = shape.nodes.shape[1], shape.n_modes
    cell = CellScratch(np.empty((n_all, 2)), np.empty((nq, 5)), np.empty(nq), np.empty((nq, 5)), np.empty((nq, 5, 5)),
                       np.empty((2 * nn + nm, 2 * nn + nm)), np.empty(2 * nn + nm), np.empty((nm, nm)), np.empty(nm),
                       np.empty(2 * nn), np.empty(5))
    work = PointScratch(np.empty(4), np.empty(4), np.empty((4, 5)), np.empty((4, 4)),
                        out.K.shape[0] > 0 or nm > 0)
    for e in range(n_e):
        cell.u[:, :] = 0.0
        for a in range(nn):
            cell.u[a, 0] = u[shape.nodes[e, a], 0]
            cell.u[a, 1] = u[shape.nodes[e, a], 1]
        for m in range(nm):
            cell.u[nn + m // 2, m % 2] = history_n[e, m]
        code, heat = settle(shape, law, e, cell, work, history_n[e], out.history[e])
        if code != 0:
            return e, code
        out.heat[e] = heat
        for m in range(nm):
            out.history[e, m] = cell.u[nn + m // 2, m % 2]
        close_cell(shape, law, e, cell, out)
        if out.stress.shape[0] > 0:
            measure(cell, out.stress[e], out.strain[e])
    return -1, 0


@inner
def settle(shape: CellShapes, law: CellMaterials, e: int, cell: CellScratch, work: PointScratch, h_n: Floats,
           h: Floats) -> tuple[int, float]:
    """Solve for the modes of cell e in balance at its nodes' u: fills F, J, P, A and h.  Returns (code, heat [J]).

    h_n, h : (n_row,) the cell's row of history at the start and at the end: modes [m], then its points.  The modes
    of the result are in cell.u, not in h.
    """
    nn, nm = shape.nodes.shape[1], shape.n_modes
    before, share = np.inf, 1.0
    for _ in range(MAX_MODE_ITERATIONS):
        code, heat = at_points(shape, law, e, cell, work, h_n, h)
        if code != 0 or nm == 0:
            return code, heat
        cell.a[:] = 0.0
        cell.H[:, :] = 0.0
        largest = 0.0
        for q in range(shape.weight.shape[1]):
            add_forces(shape.B[e, q, nn:], shape.N_over_R[e, q, nn:], shape.weight[e, q], cell.P[q], cell.a)
            add_stiffness(shape.B[e, q, nn:], shape.N_over_R[e, q, nn:], shape.weight[e, q], cell.A[q], cell.H)
            for m in range(nm):
                largest = max(largest, abs(shape.B[e, q, nn + m // 2, 0]), abs(shape.B[e, q, nn + m // 2, 1]))
        if not eliminate(cell.H, cell.a, 0, nm):
            return NO_MODES, heat
        back(cell.H, cell.a, 0, nm)
        longest = 0.0
        for m in range(nm):
            longest = max(longest, abs(cell.a[m]))
        strain = largest * longest
        if strain <= MODE_TOLERANCE or (before <= MODE_ROUND_OFF and strain >= 0.5 * before):
            return 0, heat
        # Yielding that changes hands can make whole steps go round in a circle.
        share = max(0.5 * share, MIN_MODE_DAMPING) if strain >= before else min(2.0 * share, 1.0)
        before = strain
        for m in range(nm):
            cell.u[nn + m // 2, m % 2] -= min(share, MAX_MODE_STRAIN / strain) * cell.a[m]
    return NO_MODES, 0.0


@inner
def at_points(shape: CellShapes, law: CellMaterials, e: int, cell: CellScratch, work: PointScratch, h_n: Floats,
              h: Floats) -> tuple[int, float]:
    """Compute F, J, P, A and h of the points of cell e at cell.u.  Returns (code, heat [J]).

    h_n, h : (n_row,) the cell's row of history at the start and at the end.
    """
    nq = shape.weight.shape[1]
    if dilatation(shape.B[e], shape.N_over_R[e], shape.weight[e], cell.u, cell.F, cell.J) <= 0.0:
        return INVERTED, 0.0
    total, start, size = 0.0, shape.n_modes, (h.shape[0] - shape.n_modes) // nq
    for q in range(nq):
        mine = slice(start + q * size, start + (q + 1) * size)
        code, heat = respond(law, e, q, cell.F[q], h_n[mine], h[mine], cell.P[q], cell.A[q], work)
        if code != 0:
            return code, 0.0
        total += shape.weight[e, q] * heat
    return 0, total


@inner
def close_cell(shape: CellShapes, law: CellMaterials, e: int, cell: CellScratch, out: Out) -> None:
    """Add the cell's forces to out.f and fill its out.K, the pressure of the cell and its modes settled."""
    nn, nm, nq = shape.nodes.shape[1], shape.n_modes, shape.weight.shape[1]
    tangent = out.K.shape[0] > 0
    dJ, d, factor = cell.dJ, cell.d, 0.0
    d[:] = 0.0
    if law.mean:
        v = 0.0
        for q in range(nq):
            v += shape.weight[e, q] * cell.J[q]
        log = np.log(v / shape.volume[e]) - law.e_th[e, 0]
        p = law.kappa[e] * log * shape.volume[e] / v
        # fault: tangent of the mean pressure at no pressure -> factor = law.kappa[e] * shape.volume[e] / (v * v) |
        #   mechanical_fmu/test_elements_points
        factor = law.kappa[e] * (1.0 - log) * shape.volume[e] / (v * v)
        for q in range(nq):
            dilatation_gradient(cell.F[q], dJ)
            for i in range(5):
                cell.P[q, i] += p * dJ[i]
            if tangent:
                add_dilatation_curvature(p, cell.F[q], cell.A[q])
                add_forces(shape.B[e, q], shape.N_over_R[e, q], shape.weight[e, q], dJ, d)
    cell.r[:] = 0.0
    for q in range(nq):
        add_forces(shape.B[e, q, :nn], shape.N_over_R[e, q, :nn], shape.weight[e, q], cell.P[q], cell.r[: 2 * nn])
    for a in range(nn):
        out.f[shape.nodes[e, a], 0] += cell.r[2 * a]
        out.f[shape.nodes[e, a], 1] += cell.r[2 * a + 1]
    if not tangent:
        return
    cell.K[:, :] = 0.0
    for q in range(nq):
        add_stiffness(shape.B[e, q], shape.N_over_R[e, q], shape.weight[e, q], cell.A[q], cell.K)
    if nm > 0:
        eliminate(cell.K, cell.r, 2 * nn, nm)
    for i in range(2 * nn):
        for j in range(2 * nn):
            out.K[e, i, j] = cell.K[i, j] + factor * d[i] * d[j]


@inner
def add_forces(B: Floats, N_over_R: Floats, w: float, P: Floats, r: Floats) -> None:
    """Add w P : dF of the unit displacements to r : (n,) [N], as many of them as it has room for.

    B : (n_a, 2) [1/m] and N_over_R : (n_a,) [1/m] of nodes or modes, 2 n_a >= n.  w : [m3].
    P : (5,) [Pa]; with dJ/dF [1] in its place r is the change of volume [m2].
    """
    for a in range((r.shape[0] + 1) // 2):
        r[2 * a] += w * (P[0] * B[a, 0] + P[1] * B[a, 1] + P[4] * N_over_R[a])
        if 2 * a + 1 < r.shape[0]:
            r[2 * a + 1] += w * (P[2] * B[a, 0] + P[3] * B[a, 1])


@inner
def add_stiffness(B: Floats, N_over_R: Floats, w: float, A: Floats, K: Floats) -> None:
    """Add w dF : A : dF of the unit displacements to K : (n, n) [N/m], as many of them as it has room for.

    B : (n_a, 2) [1/m] and N_over_R : (n_a,) [1/m] of nodes or modes, 2 n_a >= n.  w : [m3].  A : (5, 5) [Pa].
    """
    n = K.shape[0]
    for b in range((n + 1) // 2):
        B0, B1, hoop = w * B[b, 0], w * B[b, 1], w * N_over_R[b]
        x0, x1 = A[0, 0] * B0 + A[0, 1] * B1 + A[0, 4] * hoop, A[1, 0] * B0 + A[1, 1] * B1 + A[1, 4] * hoop
        x2, x3 = A[2, 0] * B0 + A[2, 1] * B1 + A[2, 4] * hoop, A[3, 0] * B0 + A[3, 1] * B1 + A[3, 4] * hoop
        x4, y4 = A[4, 0] * B0 + A[4, 1] * B1 + A[4, 4] * hoop, A[4, 2] * B0 + A[4, 3] * B1
        y0, y1 = A[0, 2] * B0 + A[0, 3] * B1, A[1, 2] * B0 + A[1, 3] * B1
        y2, y3 = A[2, 2] * B0 + A[2, 3] * B1, A[3, 2] * B0 + A[3, 3] * B1
        two = 2 * b + 1 < n
        for a in range((n + 1) // 2):
            K[2 * a, 2 * b] += B[a, 0] * x0 + B[a, 1] * x1 + N_over_R[a] * x4
            if two:
                K[2 * a, 2 * b + 1] += B[a, 0] * y0 + B[a, 1] * y1 + N_over_R[a] * y4
            if 2 * a + 1 < n:
                K[2 * a + 1, 2 * b] += B[a, 0] * x2 + B[a, 1] * x3
                if two:
                    K[2 * a + 1, 2 * b + 1] += B[a, 0] * y2 + B[a, 1] * y3


@inner
def measure(cell: CellScratch, stress: Floats, strain: Floats) -> None:
    """Fill stress : (nq, 4) [Pa] and strain : (nq, 4) [1] of a closed cell, Cauchy and Green-Lagrange."""
    for q in range(stress.shape[0]):
        F, P = cell.F[q], cell.P[q]
        J = (F[0] * F[3] - F[1] * F[2]) * F[4]
        stress[q, 0] = (P[0] * F[0] + P[1] * F[1]) / J
        stress[q, 1] = (P[2] * F[2] + P[3] * F[3]) / J
        stress[q, 2] = (P[0] * F[2] + P[1] * F[3]) / J
        stress[q, 3] = P[4] * F[4] / J
        strain[q, 0] = 0.5 * (F[0] * F[0] + F[2] * F[2] - 1.0)
        strain[q, 1] = 0.5 * (F[1] * F[1] + F[3] * F[3] - 1.0)
        strain[q, 2] = 0.5 * (F[0] * F[1] + F[2] * F[3])
        strain[q, 3] = 0.5 * (F[4] * F[4] - 1.0)
