"""A point between liquid and solid, mixed by the solid fraction f_s.  numba.

    s = f_s s_solid + (1 - f_s) 2 eta (e - e_n)/dt
The liquid remembers nothing.  The solid does, but what solidifies in a step does so stress-free in the shape it has: of
the solid at the end only the share w = f_n/f_s (at most 1) was there before, so its mean elastic strain, backstress and
plastic strain start the step at w times their value.  Then f_s s_solid does not jump when f_s grows, and what has
melted (f_s = 0) has forgotten.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner
from mechanical_fmu.point_layout import (
    H_BACK,
    H_CREEP,
    H_INELASTIC,
    H_PLASTIC,
    H_SOLID,
    H_STRAIN,
    P_CHI_LIQUID,
    P_ETA,
    P_G,
    P_SOLID,
)

Floats = NDArray[np.float64]


@inner
def solidify(p: Floats, h_n: Floats, h: Floats) -> None:
    """Turn h, a copy of h_n, into the history the solid at the end of the step begins it with."""
    f, f_n = p[P_SOLID], h_n[H_SOLID]
    # fault: what solidifies inherits the strain of the liquid -> w = 1.0 | mechanical_fmu/test_points_melting
    w = 0.0 if f <= 0.0 else min(1.0, f_n / f)
    for i in range(4):
        h[H_INELASTIC + i] = h_n[H_STRAIN + i] - w * (h_n[H_STRAIN + i] - h_n[H_INELASTIC + i])
        h[H_BACK + i] = w * h_n[H_BACK + i]
    h[H_PLASTIC] = w * h_n[H_PLASTIC]
    h[H_CREEP] = w * h_n[H_CREEP]


@inner
def mix(p: Floats, e: tuple[float, float, float, float], dt: float, h_n: Floats, h: Floats, S: Floats,
        D: Floats) -> float:
    """Mix the liquid into S and D of the solid and close h; returns the heat of the liquid [J/m3].

    e : deviator of E.  In no time (dt = 0) a liquid cannot flow: it answers as an elastic solid would.
    """
    f = p[P_SOLID]
    # fault: a liquid that resists by its strain -> twice = 2.0 * p[P_ETA] | mechanical_fmu/test_points_melting
    twice = 2.0 * (p[P_ETA] / dt if dt > 0.0 else p[P_G])
    work = 0.0
    for i in range(4):
        de = e[i] - h_n[H_STRAIN + i]
        work += twice * de * de * (2.0 if i == 2 else 1.0)
        S[i] = f * S[i] + (1.0 - f) * twice * de
        for j in range(4):
            unit = (1.0 if i == j else 0.0) - (1.0 / 3.0 if i != 2 and j != 2 else 0.0)
            D[i, j] = f * D[i, j] + (1.0 - f) * twice * unit
        h[H_STRAIN + i] = e[i]
        if f <= 0.0:
            h[H_INELASTIC + i] = e[i]
    h[H_SOLID] = f
    return (1.0 - f) * p[P_CHI_LIQUID] * work if dt > 0.0 else 0.0
