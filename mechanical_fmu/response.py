"""P and A = dP/dF of one material point from its F, whatever the material; plane stress included.  numba.

F, P : (5,), components (11, 12, 21, 22, 33).  kind 0 is neo-Hookean (kernels.py has its energy), every other kind lives
in logarithmic strain space (points.py, logstrain.py).  The pressure is kappa (ln J - e_th); a cell of mean
dilatation gives kappa = 0 here and adds its own.

Plane stress: the thickness stretch F33 follows from P33 = 0, point by point, and A is condensed,
    A_ij - A_i5 A_5j / A_55  for the four components in the plane.
The iteration is on ln F33 with the Kirchhoff stress P33 F33, which is linear where the law is linear in E.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from mechanical_fmu.logstrain import log_strain_gradient, piola, piola_tangent
from mechanical_fmu.points import update

Floats = NDArray[np.float64]

# The thickness is found when ln F33 moves by less than this; its iteration is quadratic, so few steps do.
THICKNESS_TOLERANCE = 1e-14
MOST_THICKNESS = 40
# ln F33 moves by no more than this at a time: a stretch by 2.7 is far from any Newton's model.
LONGEST_THICKNESS = 1.0
NO_THICKNESS = 100


class Law(NamedTuple):
    """The materials of a kind of cell.  mu, kappa : (n_e,) [Pa].  e_th : (n_e,).  p, tables : as points.update asks."""

    kind: int
    plane_stress: bool
    mean: bool
    mu: Floats
    kappa: Floats
    e_th: Floats
    p: Floats
    tables: Floats
    dt: float


class Work(NamedTuple):
    """Room for one point's logarithmic strain: E, S : (4,), L : (4, 5), D : (4, 4)."""

    E: Floats
    S: Floats
    L: Floats
    D: Floats


@kernel
def dilatation_gradient(F: Floats, dJ: Floats) -> float:
    """Fill dJ : (5,) = dJ/dF; returns J."""
    plane = F[0] * F[3] - F[1] * F[2]
    dJ[0] = F[3] * F[4]
    dJ[1] = -F[2] * F[4]
    dJ[2] = -F[1] * F[4]
    dJ[3] = F[0] * F[4]
    dJ[4] = plane
    return plane * F[4]


@kernel
def add_dilatation_curvature(p: float, F: Floats, A: Floats) -> None:
    """A += p d2J/dFdF, A : (5, 5)."""
    A[0, 3] += p * F[4]
    A[3, 0] += p * F[4]
    A[1, 2] -= p * F[4]
    A[2, 1] -= p * F[4]
    for i in range(4):
        along = p * (F[3 - i] if i == 0 or i == 3 else -F[3 - i])
        A[i, 4] += along
        A[4, i] += along


@kernel
def neo_hooke(mu: float, kappa: float, e_th: float, F: Floats, P: Floats, A: Floats) -> None:
    """Fill P and A of mu/2 (J^(-2/3) F:F - 3) + kappa/2 (ln J - e_th)^2."""
    h = np.empty(5)
    J = dilatation_gradient(F, h)
    c = mu * J ** (-2.0 / 3.0)
    squares = 0.0
    for i in range(5):
        h[i] /= J
        squares += F[i] * F[i]
    s = kappa * (np.log(J) - e_th) - c * squares / 3.0
    n = 2.0 / 9.0 * c * squares + kappa - s
    for i in range(5):
        P[i] = c * F[i] + s * h[i]
        for j in range(5):
            A[i, j] = n * h[i] * h[j] - 2.0 / 3.0 * c * (F[i] * h[j] + h[i] * F[j])
        A[i, i] += c
    add_dilatation_curvature(s / J, F, A)


@kernel
def strained(law: Law, e: int, F: Floats, h_n: Floats, h: Floats, P: Floats, A: Floats,
             work: Work) -> tuple[int, float]:
    """Fill P, A and the history of a point of cell e at the whole F; returns (code, heat) of points.update."""
    kappa = 0.0 if law.mean else law.kappa[e]
    if law.kind == 0:
        neo_hooke(law.mu[e], kappa, law.e_th[e], F, P, A)
        return 0, 0.0
    E, S, L, D = work.E, work.S, work.L, work.D
    log_strain_gradient(F, E, L)
    code, heat = update(law.kind, law.p[e], law.tables, E, law.dt, h_n, h, S, D)
    if code != 0:
        return code, heat
    pressure = kappa * (E[0] + E[1] + E[3] - law.e_th[e])
    for i in (0, 1, 3):
        S[i] += pressure
        for j in (0, 1, 3):
            D[i, j] += kappa
    piola(L, S, P)
    piola_tangent(F, L, S, D, A)
    return 0, heat


@kernel
def respond(law: Law, e: int, F: Floats, h_n: Floats, h: Floats, P: Floats, A: Floats,
            work: Work) -> tuple[int, float]:
    """As `strained`; in plane stress F33 is found first, from the ln F33 that ends h_n, and ends h and F."""
    if not law.plane_stress:
        return strained(law, e, F, h_n, h, P, A, work)
    last = h_n.shape[0] - 1
    thickness = h_n[last]
    for _ in range(MOST_THICKNESS):
        F[4] = np.exp(thickness)
        code, heat = strained(law, e, F, h_n[:last], h[:last], P, A, work)
        if code != 0:
            return code, heat
        slope = F[4] * (P[4] + F[4] * A[4, 4])
        if not slope > 0.0:
            return NO_THICKNESS, heat
        step = P[4] * F[4] / slope
        if abs(step) <= THICKNESS_TOLERANCE:
            h[last] = thickness
            for i in range(4):
                for j in range(4):
                    A[i, j] -= A[i, 4] * A[4, j] / A[4, 4]
            return 0, heat
        thickness -= min(max(step, -LONGEST_THICKNESS), LONGEST_THICKNESS)
    return NO_THICKNESS, 0.0
