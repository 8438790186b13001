"""Plastic flow and creep over one step, fully implicit, with the consistent tangent.  numba.

Von Mises, associated, backward Euler.  With e the deviator of E and Ei the inelastic strain at the start
    s = 2 G (e - Ei) - 3 G (dp + dc) n,   n = (s - X)/q,   q = sqrt(3/2 (s - X):(s - X)),
    X = theta (X_n + C dp n),   theta = 1/(1 + gamma dp)     (Prager; with gamma Armstrong and Frederick),
    dc = dt A q^N                                             (Norton; not together with a backstress),
    q <= R(e_p + dp) + K (dp/dt)^M,   dp >= 0                 (K = 0 : rate-independent).
All flow is along n, so one scalar dp is left: with eta = s_trial - theta X_n, along n too, and Q = |eta|,
    Q(dp) - 3 G (dp + dc) - theta C dp - q = 0.
Where a power of a rate takes part it is solved for log dp: in logarithms it is nearly straight, whichever term rules.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner
from mechanical_fmu.creep import crept, relaxed
from mechanical_fmu.hardening import flow_stress
from mechanical_fmu.point_layout import (
    CREEP,
    H_BACK,
    H_CREEP,
    H_INELASTIC,
    H_PLASTIC,
    KINEMATIC,
    OVERSTRESS,
    P_C,
    P_CHI,
    P_CHI_VISCOUS,
    P_G,
    P_GAMMA,
    P_K,
    P_LOG_A,
    P_M,
    P_N,
    PLASTIC,
)

Floats = NDArray[np.float64]

MOST, PATIENCE = 60, 6
# The yield condition is met to this share of the trial stress: some units of its round-off.
CLOSE = 4e-15


@inner
def dot(a: Floats, b: Floats) -> float:
    """a : b of two tensors (11, 22, 12, 33)."""
    return a[0] * b[0] + a[1] * b[1] + 2.0 * a[2] * b[2] + a[3] * b[3]


@inner
def flow(kind: int, p: Floats, tables: Floats, dt: float, h: Floats, S: Floats, D: Floats) -> tuple[int, float]:
    """One step of the solid: code and heat [J/m3].

    S : in the trial stress 2 G (e - Ei), out s.  h : in the history at the start, out at the end.  D : out.
    """
    G, X = p[P_G], h[H_BACK:H_BACK + 4]
    code, amounts = _amounts(kind, p, tables, dt, h, S)
    theta, dp, dc, q, Q, slope, _ = amounts
    if code != 0:
        return code, 0.0
    if dp + dc <= 0.0:
        elastic(G, D)
        return 0, 0.0
    for i in range(4):
        S[i] = (S[i] - (theta * X[i] if kind & KINEMATIC else 0.0)) / Q
    # From here on S is n.
    n_X = dot(S, X) if kind & KINEMATIC else 0.0
    dc_dq = p[P_N] * dc / q if dc > 0.0 else 0.0
    d_theta = -p[P_GAMMA] * theta * theta
    r, d_dp = 3.0 * G * (dp + dc) / Q, 0.0
    if dp > 0.0:
        stiff = 3.0 * G * (1.0 + dc_dq * slope) + p[P_C] * theta * theta + slope + 1.5 * d_theta * n_X
        if stiff <= 0.0:
            return 2, 0.0
        d_dp = 3.0 * G / stiff
        rate = (1.0 + dc_dq * slope) * d_dp
    else:
        rate = 3.0 * G * dc_dq / (1.0 + 3.0 * G * dc_dq)
    turn = r * d_theta * d_dp
    elastic(G * (1.0 - r), D)
    # fault: tangent of plastic flow without the turn of the flow direction -> along = 3.0 * G * (0.0 - rate) - 1.5 *
    #   turn * n_X | mechanical_fmu/test_points_flow
    along = 3.0 * G * (r - rate) - 1.5 * turn * n_X
    for i in range(4):
        first = along * S[i] + (turn * X[i] if kind & KINEMATIC else 0.0)
        for j in range(4):
            D[i, j] += first * S[j] * (2.0 if j == 2 else 1.0)
    return 0, _close(kind, p, amounts, h, S)


@inner
def _amounts(kind: int, p: Floats, tables: Floats, dt: float, h: Floats,
             S: Floats) -> tuple[int, tuple[float, float, float, float, float, float, float]]:
    """How much flows from the trial stress S: code and (theta, dp, dc, q, Q, dq/d(dp), mean of q over the step)."""
    X, ab, bb, dc = h[H_BACK:H_BACK + 4], 0.0, 0.0, 0.0
    aa = 1.5 * dot(S, S)
    if kind & KINEMATIC:
        ab, bb = 1.5 * dot(S, X), 1.5 * dot(X, X)
    Q = np.sqrt(max(aa - 2.0 * ab + bb, 0.0))
    if not np.isfinite(Q):
        return 3, (1.0, 0.0, 0.0, Q, Q, 0.0, 0.0)
    q = Q
    if kind & CREEP and dt > 0.0 and Q > 0.0:
        q, dc = relaxed(Q, p[P_G], dt, p[P_LOG_A], p[P_N])
    if not kind & PLASTIC or (kind & OVERSTRESS and dt <= 0.0):
        return 0, (1.0, 0.0, dc, q, Q, 0.0, 0.0)
    R_n, R_slope = flow_stress(p, tables, h[H_PLASTIC])
    if q <= R_n:
        return 0, (1.0, 0.0, dc, q, Q, 0.0, 0.0)
    if 3.0 * p[P_G] + p[P_C] + R_slope <= 0.0:
        return 2, (1.0, 0.0, dc, q, Q, 0.0, 0.0)
    dp = plastic_strain(kind, p, tables, dt, h[H_PLASTIC], (R_n, R_slope, aa, ab, bb))
    if dp <= 0.0:
        return (0 if dp == 0.0 else 1), (1.0, 0.0, dc, q, Q, 0.0, 0.0)
    theta = 1.0 / (1.0 + p[P_GAMMA] * dp)
    Q = np.sqrt(max(aa - 2.0 * theta * ab + theta * theta * bb, 0.0))
    q, slope = resistance(kind, p, tables, dt, h[H_PLASTIC], dp)
    dc = crept(q, dt, p[P_LOG_A], p[P_N]) if kind & CREEP else 0.0
    R = flow_stress(p, tables, h[H_PLASTIC] + dp)[0]
    # fault: plastic heat at the stress of the end of the step -> return 0, (theta, dp, dc, q, Q, slope, q) |
    #   mechanical_fmu/test_points_flow
    return 0, (theta, dp, dc, q, Q, slope, q + 0.5 * (R_n - R))


@inner
def _close(kind: int, p: Floats, amounts: tuple[float, float, float, float, float, float, float], h: Floats,
           S: Floats) -> float:
    """Write the history at the end and turn S from n to s; returns the heat [J/m3].

    Plastic heat is work less what the backstress stores, 3/(4 C) X:X, which comes back: dp (R + 3 gamma/(2 C) X:X).
    R is the mean of both ends, so with linear hardening it is exact in steps of any size; the rest, and the viscous
    work, is taken at the end.
    """
    theta, dp, dc, q, _, _, R_mean = amounts
    XX = 0.0
    for i in range(4):
        n = S[i]
        h[H_INELASTIC + i] += 1.5 * (dp + dc) * n
        S[i] = q * n
        if kind & KINEMATIC:
            # fault: backstress that does not forget -> h[H_BACK + i] = h[H_BACK + i] + p[P_C] * dp * n |
            #   mechanical_fmu/test_points_flow
            h[H_BACK + i] = theta * (h[H_BACK + i] + p[P_C] * dp * n)
            XX += h[H_BACK + i] * h[H_BACK + i] * (2.0 if i == 2 else 1.0)
            S[i] += h[H_BACK + i]
    h[H_PLASTIC] += dp
    h[H_CREEP] += dc
    # fault: energy stored in the backstress counted as heat -> lost = 1.5 * p[P_GAMMA] / p[P_C] * XX + 1e3 * p[P_GAMMA]
    #   * XX / p[P_C] if p[P_GAMMA] > 0.0 else 0.0 | mechanical_fmu/test_points_flow
    lost = 1.5 * p[P_GAMMA] / p[P_C] * XX if p[P_GAMMA] > 0.0 else 0.0
    # fault: plastic heat of half the work -> return 0.5 * p[P_CHI] * dp * (R_mean + lost) + p[P_CHI_VISCOUS] * dc * q |
    #   scenarios/test_plastic_heating
    return p[P_CHI] * dp * (R_mean + lost) + p[P_CHI_VISCOUS] * dc * q


@inner
def resistance(kind: int, p: Floats, tables: Floats, dt: float, e_p: float, dp: float) -> tuple[float, float]:
    """q [Pa] that flow by dp > 0 in dt takes, and its slope."""
    q, slope = flow_stress(p, tables, e_p + dp)
    if kind & OVERSTRESS:
        over = p[P_K] * (dp / dt) ** p[P_M]
        q += over
        slope += p[P_M] * over / dp
    return q, slope


@inner
def plastic_strain(kind: int, p: Floats, tables: Floats, dt: float, e_p: float,
                   start: tuple[float, float, float, float, float]) -> float:
    """dp > 0 of the scalar equation, or -1.  start : R at e_p [Pa], its slope, and aa, ab, bb [Pa2] with

    Q(dp)^2 = aa - 2 theta ab + theta^2 bb.

    Written as rise(dp) = excess with a rise that grows from 0, by Newton's method between brackets.
    """
    R_n, R_slope, aa, ab, bb = start
    G, C, gamma, creeps = p[P_G], p[P_C], p[P_GAMMA], kind & CREEP
    powers = kind & (CREEP | OVERSTRESS)
    Q0 = np.sqrt(max(aa - 2.0 * ab + bb, 0.0))
    # A power by n multiplies the round-off of its base by n.
    close = CLOSE * Q0 * (1.0 + (p[P_N] if creeps else 0.0))
    c_n = crept(R_n, dt, p[P_LOG_A], p[P_N]) if creeps else 0.0
    excess = Q0 - R_n - 3.0 * G * c_n
    low, high = 0.0, (np.sqrt(aa) + np.sqrt(bb)) / (3.0 * G)
    dp = excess / (3.0 * G + C + max(R_slope, 0.0))
    if kind & OVERSTRESS:
        dp = min(dp, dt * np.exp(np.log(excess / p[P_K]) / p[P_M])) if p[P_K] > 0.0 else dp
    for i in range(MOST):
        if dp <= 0.0:
            # Flow too slow to be a number: none.
            return 0.0
        q, slope = resistance(kind, p, tables, dt, e_p, dp)
        theta = 1.0 / (1.0 + gamma * dp)
        rise = 3.0 * G * dp + theta * C * dp + q - R_n
        grow = 3.0 * G + C * theta * theta + slope
        if creeps:
            dc = crept(q, dt, p[P_LOG_A], p[P_N])
            rise += 3.0 * G * (dc - c_n)
            grow += 3.0 * G * p[P_N] * dc / q * slope if q > 0.0 else 0.0
        if bb > 0.0:
            Q = np.sqrt(max(aa - 2.0 * theta * ab + theta * theta * bb, 0.0))
            rise += Q0 - Q
            grow += gamma * theta * theta * (theta * bb - ab) / Q if Q > 0.0 else 0.0
        if abs(rise - excess) <= close:
            return dp
        if rise > excess:
            high = dp
        else:
            low = dp
        new = -1.0
        if grow > 0.0 and powers and rise > 0.0:
            new = dp * np.exp(-np.log(rise / excess) * rise / (grow * dp))
        elif grow > 0.0:
            new = dp + (excess - rise) / grow
        # Newton's method may hop between two sides of a bend: from time to time the bracket is halved.
        # fault: Newton's method that hops -> if not low < new < high or i < 0: | mechanical_fmu/test_points_flow
        if not low < new < high or i % PATIENCE == PATIENCE - 1:
            new = np.sqrt(max(low, 1e-6 * high)) * np.sqrt(high) if low < 1e-3 * high else 0.5 * (low + high)
        if abs(new - dp) <= 1e-15 * dp or high - low <= 1e-15 * high:
            return new
        dp = new
    return -1.0


@inner
def elastic(G: float, D: Floats) -> None:
    """Fill D with 2 G times the deviatoric projection."""
    D[:, :] = 0.0
    for i in (0, 1, 3):
        for j in (0, 1, 3):
            D[i, j] = -2.0 / 3.0 * G
        D[i, i] = 4.0 / 3.0 * G
    D[2, 2] = 2.0 * G
