"""Norton creep over one step, fully implicit, at any length of step.  numba.

The creep equivalent strain grows at A q^n, A = exp(log_a).  Over a step from the trial stress Q, with q at its end:
    q + 3 G dt A q^n = Q.
With q = Q exp(v) and c = 3 G dt A Q^(n-1): log(exp(v) + c exp(n v)) = 0, convex and of a slope between 1 and n, so
Newton's method from the right converges from any start; c may be 1e-300 or 1e300.
"""

from __future__ import annotations

import numpy as np

from contact.compiled import inner

MOST = 100
# exp() of more overflows.
LARGEST = 700.0


@inner
def relaxed(Q: float, G: float, dt: float, log_a: float, n: float) -> tuple[float, float]:
    """q [Pa] at the end of the step and the creep strain made in it, from the trial stress Q > 0 [Pa]."""
    # fault: creep strain of a whole step at twice the rate -> lc = np.log(6.0 * G) + np.log(dt) + log_a + (n - 1.0) *
    #   np.log(Q) | mechanical_fmu/test_points_flow mechanical_fmu/test_points_verification
    lc = np.log(3.0 * G) + np.log(dt) + log_a + (n - 1.0) * np.log(Q)
    v = -max(lc, 0.0) / n
    for _ in range(MOST):
        other = lc + n * v
        top = max(v, other)
        here, there = np.exp(v - top), np.exp(other - top)
        step = (top + np.log(here + there)) * (here + there) / (here + n * there)
        v -= step
        if not abs(step) > 1e-15 * max(1.0, abs(v)):
            break
    return Q * np.exp(v), Q / (3.0 * G) * np.exp(min(lc + n * v, LARGEST))


@inner
def crept(q: float, dt: float, log_a: float, n: float) -> float:
    """Creep strain of a step that ends at q [Pa]."""
    if q <= 0.0 or dt <= 0.0:
        return 0.0
    return np.exp(min(np.log(dt) + log_a + n * np.log(q), LARGEST))
