"""Flow stress R(e) of isotropic hardening, e the plastic equivalent strain.  numba.

    Voce:  R = s0 + Q (1 - exp(-b e)) + H e        (Q = 0 : linear; Q = H = 0 : perfectly plastic)
    table: R = factor times the curve at the point's temperature, linear between two curves of a material.
A table in `tables`: strains (n), then for every temperature stresses (n) and slopes (n).
R does not fall below 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner
from mechanical_fmu.point_layout import CUBIC, P_B, P_FORM, P_H, P_KNOTS, P_Q, P_ROW, P_SHARE, P_TABLE, P_YIELD, SLOPED

Floats = NDArray[np.float64]


@inner
def flow_stress(p: Floats, tables: Floats, e: float) -> tuple[float, float]:
    """R [Pa] and dR/de at e >= 0."""
    n = int(p[P_KNOTS])
    if n > 0:
        row, form = int(p[P_ROW]), int(p[P_FORM])
        R, slope = curve(tables, int(p[P_TABLE]), row, n, form, e)
        if p[P_SHARE] > 0.0:
            R1, slope1 = curve(tables, int(p[P_TABLE]), row + 2 * n, n, form, e)
            R += p[P_SHARE] * (R1 - R)
            slope += p[P_SHARE] * (slope1 - slope)
        R *= p[P_YIELD]
        slope *= p[P_YIELD]
    else:
        fade = p[P_Q] * np.exp(-p[P_B] * e) if p[P_Q] != 0.0 else 0.0
        R = p[P_YIELD] + p[P_Q] - fade + p[P_H] * e
        slope = p[P_B] * fade + p[P_H]
    if R < 0.0:
        return 0.0, 0.0
    return R, slope


@inner
def curve(tables: Floats, strains: int, row: int, n: int, form: int, e: float) -> tuple[float, float]:
    """Stress and slope of one row of a table at e."""
    if e >= tables[strains + n - 1]:
        slope = tables[row + 2 * n - 1] if form & SLOPED else 0.0
        return tables[row + n - 1] + slope * (e - tables[strains + n - 1]), slope
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        # fault: hardening forgotten past the first knot -> if tables[strains + middle] < 0.0: |
        #   mechanical_fmu/test_points_material
        if tables[strains + middle] <= e:
            low = middle
        else:
            high = middle
    width = tables[strains + low + 1] - tables[strains + low]
    x = e - tables[strains + low]
    y0, y1 = tables[row + low], tables[row + low + 1]
    if form & CUBIC:
        t = x / width
        a, b = tables[row + n + low] * width, tables[row + n + low + 1] * width
        c2, c3 = 3.0 * (y1 - y0) - 2.0 * a - b, a + b - 2.0 * (y1 - y0)
        return y0 + t * (a + t * (c2 + t * c3)), (a + t * (2.0 * c2 + t * 3.0 * c3)) / width
    slope = (y1 - y0) / width
    return y0 + slope * x, slope
