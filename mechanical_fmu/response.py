"""P and A = dP/dF of one material point from its F, whatever the material; plane stress included.  numba.

F, P : (5,), components (11, 12, 21, 22, 33).  kind 0 is neo-Hookean (kernels.py has its energy), every other kind lives
in logarithmic strain space (points.py, logstrain.py).  The pressure is kappa (ln J - e_th); a cell of mean
dilatation gives kappa = 0 here and adds its own.

Plane stress: the thickness stretch F33 follows from P33 = 0, point by point, and A is condensed,
    A_ij - A_i5 A_5j / A_55  for the four components in the plane.
The iteration is on ln F33 with the Kirchhoff stress P33 F33, which is linear where the law is linear in E; by
logarithmic strain the stress is S33 and its slope D_3333.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner
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
    """Room for one point's logarithmic strain: E, S : (4,), L : (4, 5), D : (4, 4).  tangent : whether A is wanted."""

    E: Floats
    S: Floats
    L: Floats
    D: Floats
    tangent: bool


@inner
def dilatation_gradient(F: Floats, dJ: Floats) -> float:
    """Fill dJ : (5,) = dJ/dF; returns J."""
    plane = F[0] * F[3] - F[1] * F[2]
    dJ[0] = F[3] * F[4]
    dJ[1] = -F[2] * F[4]
    dJ[2] = -F[1] * F[4]
    dJ[3] = F[0] * F[4]
    dJ[4] = plane
    return plane * F[4]


@inner
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


@inner
def neo_hooke(mu: float, kappa: float, e_th: float, F: Floats, P: Floats, A: Floats) -> None:
    """Fill P and A of mu/2 (J^(-2/3) F:F - 3) + kappa/2 (ln J - e_th)^2."""
    # P holds h = F^-T until it is filled.
    h = P
    J = dilatation_gradient(F, h)
    c = mu * J ** (-2.0 / 3.0)
    squares = 0.0
    for i in range(5):
        h[i] /= J
        squares += F[i] * F[i]
    # fault: pressure forgets what heat takes from it -> s = kappa * np.log(J) - c * squares / 3.0 |
    #   mechanical_fmu/test_elements_patch
    s = kappa * (np.log(J) - e_th) - c * squares / 3.0
    n = 2.0 / 9.0 * c * squares + kappa - s
    for i in range(5):
        for j in range(5):
            A[i, j] = n * h[i] * h[j] - 2.0 / 3.0 * c * (F[i] * h[j] + h[i] * F[j])
        A[i, i] += c
    for i in range(5):
        P[i] = c * F[i] + s * h[i]
    add_dilatation_curvature(s / J, F, A)


@inner
def respond(law: Law, e: int, F: Floats, h_n: Floats, h: Floats, P: Floats, A: Floats,
            work: Work) -> tuple[int, float]:
    """Fill P, A and the history of a point of cell e at F; returns (code, heat) of points.update.

    In plane stress F33 is found first, from the ln F33 that ends h_n, and ends h and F.
    """
    if law.kind == 0:
        return hyperelastic(law, e, F, h_n, h, P, A), 0.0
    E, S, L, D, thin = work.E, work.S, work.L, work.D, law.plane_stress
    kappa, last = 0.0 if law.mean else law.kappa[e], h.shape[0] - (1 if thin else 0)
    thickness = h_n[last] if thin else 0.0
    if thin:
        F[4] = np.exp(thickness)
    log_strain_gradient(F, E, L)
    found, heat = False, 0.0
    for _ in range(MOST_THICKNESS):
        code, heat = update(law.kind, law.p[e], law.tables, E, law.dt, h_n[:last], h[:last], S, D)
        if code != 0:
            return code, heat
        pressure = kappa * (E[0] + E[1] + E[3] - law.e_th[e])
        for i in (0, 1, 3):
            S[i] += pressure
            for j in (0, 1, 3):
                D[i, j] += kappa
        if not thin:
            found = True
            break
        if not D[3, 3] > 0.0:
            return NO_THICKNESS, heat
        step = S[3] / D[3, 3]
        if abs(step) <= THICKNESS_TOLERANCE:
            h[last], L[3, 4], found = thickness, 1.0 / F[4], True
            break
        thickness -= min(max(step, -LONGEST_THICKNESS), LONGEST_THICKNESS)
        F[4] = np.exp(thickness)
        E[3] = np.log(F[4])
    if not found:
        return NO_THICKNESS, heat
    piola(L, S, P)
    if work.tangent:
        piola_tangent(F, L, S, D, A)
        if thin:
            condense(A)
    return 0, heat


@inner
def hyperelastic(law: Law, e: int, F: Floats, h_n: Floats, h: Floats, P: Floats, A: Floats) -> int:
    """`respond` of kind 0; returns the code."""
    kappa = 0.0 if law.mean else law.kappa[e]
    if not law.plane_stress:
        neo_hooke(law.mu[e], kappa, law.e_th[e], F, P, A)
        return 0
    thickness = h_n[0]
    for _ in range(MOST_THICKNESS):
        F[4] = np.exp(thickness)
        neo_hooke(law.mu[e], kappa, law.e_th[e], F, P, A)
        slope = F[4] * (P[4] + F[4] * A[4, 4])
        if not slope > 0.0:
            return NO_THICKNESS
        step = P[4] * F[4] / slope
        if abs(step) <= THICKNESS_TOLERANCE:
            h[0] = thickness
            condense(A)
            return 0
        thickness -= min(max(step, -LONGEST_THICKNESS), LONGEST_THICKNESS)
    return NO_THICKNESS


@inner
def condense(A: Floats) -> None:
    """A of P33 = 0 in the plane."""
    for i in range(4):
        for j in range(4):
            # fault: thickness not condensed from the tangent -> A[i, j] -= 0.0 * A[4, 4] |
            #   mechanical_fmu/test_elements_points
            A[i, j] -= A[i, 4] * A[4, j] / A[4, 4]
