"""One material point: stress, tangent and heat of a step of strain, by kind of material.  numba.

    code, heat = update(kind, p, tables, E, dt, h_n, h, S, D)

(Whoever calls it from compiled code takes `kernel` of contact.compiled for a decorator, or numba's cache goes stale.)

E : (4,) logarithmic strain at the end of the step, tensor components (11, 22, 12, 33); only its deviator matters.
S : (4,) out, DEVIATORIC conjugate stress [Pa], tensor components; the pressure kappa (ln theta - e_th) is the cell's.
D : (4, 4) out, dS/dE with plain components on both sides: dS_i = sum_j D_ij dE_j.  With W = diag(1, 1, 2, 1), W D is
    symmetric unless has_skew_tangent(kind).  D carries the deviatoric projection on its right and its left.
dt : [s], 0 where nothing can flow yet (equilibrium at the start).
h_n, h : (n_h,) history at the start and at the end, all 0 for a virgin point; h is written whole, h_n never.
p : (N_P,) parameters of the point at its temperature and solid fraction (point_layout.py).
tables : (n_t,) the hardening curves of all materials, one behind the other (hardening.py).
heat : [J/m3 of reference volume] made in the step, AFTER the shares of plastic, creep and liquid work that become heat.
code : 0 well; else CODES says why not, and S, D, h are unusable: a smaller step may do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner
from mechanical_fmu.liquid import mix, solidify
from mechanical_fmu.plasticity import elastic, flow
from mechanical_fmu.point_layout import (
    CODES,
    CREEP,
    H_INELASTIC,
    KINEMATIC,
    LIQUID,
    N_P,
    OVERSTRESS,
    P_G,
    P_SOLID,
    PLASTIC,
    has_skew_tangent,
    history_size,
)

__all__ = ["CODES", "CREEP", "KINEMATIC", "LIQUID", "N_P", "OVERSTRESS", "PLASTIC", "deviator", "has_skew_tangent",
           "history_size", "update"]

Floats = NDArray[np.float64]


@inner
def deviator(E: Floats, e: Floats) -> None:
    """Fill e : (4,) with the deviator of E : (4,)."""
    third = (E[0] + E[1] + E[3]) / 3.0
    e[0] = E[0] - third
    e[1] = E[1] - third
    e[2] = E[2]
    e[3] = E[3] - third


@inner
def update(kind: int, p: Floats, tables: Floats, E: Floats, dt: float, h_n: Floats, h: Floats, S: Floats,
           D: Floats) -> tuple[int, float]:
    """One step of a point, as said above."""
    deviator(E, S)
    if kind == 0:
        for i in range(4):
            S[i] *= 2.0 * p[P_G]
        elastic(p[P_G], D)
        return 0, 0.0
    for i in range(h.shape[0]):
        h[i] = h_n[i]
    if not kind & LIQUID:
        for i in range(4):
            S[i] = 2.0 * p[P_G] * (S[i] - h[H_INELASTIC + i])
        return flow(kind, p, tables, dt, h, S, D)
    e = (S[0], S[1], S[2], S[3])
    solidify(p, h_n, h)
    code, heat = 0, 0.0
    if p[P_SOLID] > 0.0:
        for i in range(4):
            S[i] = 2.0 * p[P_G] * (e[i] - h[H_INELASTIC + i])
        code, heat = flow(kind, p, tables, dt, h, S, D)
    else:
        elastic(0.0, D)
    return code, p[P_SOLID] * heat + mix(p, e, dt, h_n, h, S, D)
