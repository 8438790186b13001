"""The local error of a step, from the heat that flows along it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.step import Course, Stepped, flow_at

Floats = NDArray[np.float64]


def local_error(course: Course, start: tuple[Floats, Floats], done: Stepped, t: float,
                h: float) -> tuple[float, tuple[Floats, Floats]]:
    """Largest error at a free node [K] of the step `done` from t to t + h [s].

    start : s_0 (n,) [K] and the flow f_0 (n,) [W] where it began; the same of its end is returned too.  What it moved
    is compared with Simpson's rule along the cubic through both ends,

        d = h/6 (f_0 + 4 f(s_m) + f_1) - (E_1 - E_0),   s_m = (s_0 + s_1)/2 + h/8 (ds_0/dt - ds_1/dt),

    which is right to h^4 for any one-step method of order two or less; differences of temperatures alone see only one
    of the several products of derivatives an error is made of.  Rates and error come from dR/ds of the step, whose
    factors are at hand: A^-1 f and A^-1 d, so that the stiff modes the step did not resolve do not drown the rest.
    Raises BadPropertyError, SingularMatrixError.
    """
    free = ~course.scene.fixed
    s_0, f_0 = start
    s_1, f_1 = flow_at(course, done.s, t + h, h, -1)
    if done.anchor is None:
        return 0.0, (s_1, f_1)  # nothing was solved: nothing flows
    factors = course.factors.of(done.anchor)
    bend = factors(np.where(free, f_0 - f_1, 0.0))
    # fault: middle of a chord for the middle of the path -> middle = 0.5 * (s_0 + s_1) + 0.0 * bend |
    #   thermal_fmu/test_thermal_adaptive
    middle = 0.5 * (s_0 + s_1) + np.where(free, 0.125 * h * bend, 0.0)
    _, f_m = flow_at(course, middle, t + 0.5 * h, h, 1)
    # fault: local error by the trapezoidal rule -> missing = h / 2.0 * (f_0 + f_1) - done.moved |
    #   thermal_fmu/test_thermal_adaptive
    missing = h / 6.0 * (f_0 + 4.0 * f_m + f_1) - done.moved
    error = factors(np.where(free, missing, 0.0))
    return float(np.abs(error[free]).max(initial=0.0)), (s_1, f_1)
