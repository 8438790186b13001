"""One material point: stress, tangent and heat of a step of strain, by kind of material.  numba.

    code, heat = update(kind, p, tables, E, dt, h_n, h, S, D)

(Whoever calls it from compiled code takes `kernel` of contact.compiled for a decorator, or numba's cache goes stale.)

E : (4,) logarithmic strain at the end of the step, tensor components (11, 22, 12, 33); only its deviator matters.
S : (4,) out, DEVIATORIC conjugate stress [Pa], tensor components; the pressure kappa (ln theta - e_th) is the cell's.
D : (4, 4) out, dS/dE with plain components on both sides: dS_i = sum_j D_ij dE_j.  With W = diag(1, 1, 2, 1), W D is
    symmetric unless has_skew_tangent(kind).  D carries the deviatoric projection on its right and its left.
dt : [s], 0 where nothing can flow yet (equilibrium at the start).  h_n, h : (n_h,) history at the start and at the end
    (laws/law.py), all 0 for a virgin point; h is written whole, h_n never.
p : record of POINT (laws/catalogue.py), the parameters of the point at its temperature and solid fraction.
tables : (n_t,) numbers of the hardening curves of all materials, one behind the other.
heat : [J/m3 of reference volume] made in the step, AFTER the fractions of plastic, creep and liquid work that become
    heat.
code : 0 well; else CODES says why not, and S, D, h are unusable: a smaller step may do.

Flow over the step is fully implicit, with the consistent tangent: von Mises, associated, backward Euler.  With e the
deviator of E and Ei the inelastic strain at the start
    s = 2 G (e - Ei) - 3 G (dp + dc) n,   n = (s - X)/q,   q = sqrt(3/2 (s - X):(s - X)),
    X = theta (X_n + C dp n),   theta = 1/(1 + gamma dp)     (kinematic hardening),
    dc = creep strain of a step that ends at q               (not together with a backstress),
    q <= R(e_p + dp) + K (dp/dt)^m,   dp >= 0                (K = 0 : rate-independent).
All flow is along n, so one scalar dp is left: with eta = s_trial - theta X_n, along n too, and Q = |eta|,
    Q(dp) - 3 G (dp + dc) - theta C dp - q = 0.
Where a power of a rate takes part it is solved for log dp: in logarithms it is nearly straight, whichever term rules.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner
from mechanical_fmu.laws.catalogue import creep_exponent, creep_relaxed, creep_strain, flow_stress
from mechanical_fmu.laws.hardening import overstress, overstress_strain
from mechanical_fmu.laws.law import (
    CREEP,
    H_BACK,
    H_CREEP,
    H_INELASTIC,
    H_PLASTIC,
    KINEMATIC,
    LIQUID,
    OVERSTRESS,
    PLASTIC,
    Point,
)
from mechanical_fmu.laws.liquid import mix, solidify

Floats = NDArray[np.float64]

CODES = {1: "the return to the yield surface did not converge", 2: "it softens faster than it unloads elastically",
         3: "its strain or a material value is not finite"}

# Iterations for dp, and after how many of them the bracket is halved for once.
MAX_RETURN_ITERATIONS, BISECT_EVERY = 60, 6
# The yield condition is met to this fraction of the trial stress: some units of its round-off.
YIELD_ROUND_OFF = 4e-15


class Increment(NamedTuple):
    """What flows in a step.  theta : what is left of the backstress.  dp, dc : plastic and creep strain made.

    q : equivalent stress at the end [Pa].  Q : |eta| [Pa].  slope : dq/d(dp) [Pa].
    working : q with R the mean of both ends of the step [Pa], what the plastic work is done at.
    """

    theta: float
    dp: float
    dc: float
    q: float
    Q: float
    slope: float
    working: float


class TrialState(NamedTuple):
    """The step before anything flows: R [Pa] and its slope at the start, and aa, ab, bb [Pa2] with

    Q(dp)^2 = aa - 2 theta ab + theta^2 bb.
    """

    R: float
    slope: float
    aa: float
    ab: float
    bb: float


@inner
def dot(a: Floats, b: Floats) -> float:
    """Compute a : b of two tensors, a, b : (4,) = (11, 22, 12, 33), in any unit."""
    return a[0] * b[0] + a[1] * b[1] + 2.0 * a[2] * b[2] + a[3] * b[3]


@inner
def flow(kind: int, p: Point, tables: Floats, dt: float, h: Floats, S: Floats, D: Floats) -> tuple[int, float]:
    """Compute one step of the solid; returns the code and the heat [J/m3].

    tables : (n_t,) as at the head of this file.  h : (n_h,) in the history at the start, out at the end.
    S : (4,) [Pa] in the trial stress 2 G (e - Ei), out s.  D : (4, 4) [Pa], out.
    """
    G, X = p.shear_modulus, h[H_BACK:H_BACK + 4]
    code, made = _increment(kind, p, tables, dt, h, S)
    theta, dp, dc, q, Q, slope = made.theta, made.dp, made.dc, made.q, made.Q, made.slope
    if code != 0:
        return code, 0.0
    if dp + dc <= 0.0:
        elastic(G, D)
        return 0, 0.0
    for i in range(4):
        S[i] = (S[i] - (theta * X[i] if kind & KINEMATIC else 0.0)) / Q
    # From here on S is n.
    n_X = dot(S, X) if kind & KINEMATIC else 0.0
    dc_dq = creep_exponent(p, q) * dc / q if dc > 0.0 else 0.0
    d_theta = -p.backstress_recall * theta * theta
    r, d_dp = 3.0 * G * (dp + dc) / Q, 0.0
    if dp > 0.0:
        stiff = 3.0 * G * (1.0 + dc_dq * slope) + p.backstress_modulus * theta * theta + slope + 1.5 * d_theta * n_X
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
    return 0, _close(kind, p, made, h, S)


@inner
def _increment(kind: int, p: Point, tables: Floats, dt: float, h: Floats,
               S: Floats) -> tuple[int, Increment]:
    """Find how much flows from the trial stress S; returns the code too."""
    X, ab, bb, dc = h[H_BACK:H_BACK + 4], 0.0, 0.0, 0.0
    aa = 1.5 * dot(S, S)
    if kind & KINEMATIC:
        ab, bb = 1.5 * dot(S, X), 1.5 * dot(X, X)
    Q = np.sqrt(max(aa - 2.0 * ab + bb, 0.0))
    if not np.isfinite(Q):
        return 3, Increment(1.0, 0.0, 0.0, Q, Q, 0.0, 0.0)
    q = Q
    if kind & CREEP and dt > 0.0 and Q > 0.0:
        q, dc = creep_relaxed(p, Q, dt)
    if not kind & PLASTIC or (kind & OVERSTRESS and dt <= 0.0):
        return 0, Increment(1.0, 0.0, dc, q, Q, 0.0, 0.0)
    R_n, R_slope = flow_stress(p, tables, h[H_PLASTIC])
    if q <= R_n:
        return 0, Increment(1.0, 0.0, dc, q, Q, 0.0, 0.0)
    if 3.0 * p.shear_modulus + p.backstress_modulus + R_slope <= 0.0:
        return 2, Increment(1.0, 0.0, dc, q, Q, 0.0, 0.0)
    dp = plastic_strain(kind, p, tables, dt, h[H_PLASTIC], TrialState(R_n, R_slope, aa, ab, bb))
    if dp <= 0.0:
        return (0 if dp == 0.0 else 1), Increment(1.0, 0.0, dc, q, Q, 0.0, 0.0)
    theta = 1.0 / (1.0 + p.backstress_recall * dp)
    Q = np.sqrt(max(aa - 2.0 * theta * ab + theta * theta * bb, 0.0))
    q, slope = resistance(kind, p, tables, dt, h[H_PLASTIC], dp)
    dc = creep_strain(p, q, dt) if kind & CREEP else 0.0
    R = flow_stress(p, tables, h[H_PLASTIC] + dp)[0]
    # fault: plastic heat at the stress of the end of the step -> return 0, Increment(theta, dp, dc, q, Q, slope, q) |
    #   mechanical_fmu/test_points_flow
    return 0, Increment(theta, dp, dc, q, Q, slope, q + 0.5 * (R_n - R))


@inner
def _close(kind: int, p: Point, made: Increment, h: Floats, S: Floats) -> float:
    """Write the history at the end and turn S from n to s; returns the heat [J/m3].

    Plastic heat is work less what the backstress stores, 3/(4 C) X:X, which comes back: dp (R + 3 gamma/(2 C) X:X).
    R is the mean of both ends, so with linear hardening it is exact in steps of any size; the rest, and the viscous
    work, is taken at the end.
    """
    theta, dp, dc, q, working = made.theta, made.dp, made.dc, made.q, made.working
    XX = 0.0
    for i in range(4):
        n = S[i]
        h[H_INELASTIC + i] += 1.5 * (dp + dc) * n
        S[i] = q * n
        if kind & KINEMATIC:
            # fault: backstress that does not forget -> h[H_BACK + i] = h[H_BACK + i] + p.backstress_modulus * dp * n |
            #   mechanical_fmu/test_points_flow
            h[H_BACK + i] = theta * (h[H_BACK + i] + p.backstress_modulus * dp * n)
            XX += h[H_BACK + i] * h[H_BACK + i] * (2.0 if i == 2 else 1.0)
            S[i] += h[H_BACK + i]
    h[H_PLASTIC] += dp
    h[H_CREEP] += dc
    C, gamma = p.backstress_modulus, p.backstress_recall
    # fault: energy stored in the backstress counted as heat -> lost = 1.5 * gamma / C * XX + 1e3 * gamma * XX / C if
    #   gamma > 0.0 else 0.0 | mechanical_fmu/test_points_flow
    lost = 1.5 * gamma / C * XX if gamma > 0.0 else 0.0
    # fault: plastic heat of half the work -> return 0.5 * p.plastic_heat * dp * (working + lost) + p.creep_heat * dc *
    #   q | scenarios/test_plastic_heating
    return p.plastic_heat * dp * (working + lost) + p.creep_heat * dc * q


@inner
def resistance(kind: int, p: Point, tables: Floats, dt: float, e_p: float, dp: float) -> tuple[float, float]:
    """Compute q [Pa] that flow by dp > 0 in dt takes, and its slope dq/d(dp) [Pa].

    tables : (n_t,) as at the head of this file.
    """
    q, slope = flow_stress(p, tables, e_p + dp)
    if kind & OVERSTRESS:
        over, steeper = overstress(p, dp, dt)
        q += over
        slope += steeper
    return q, slope


@inner
def plastic_strain(kind: int, p: Point, tables: Floats, dt: float, e_p: float,
                   start: TrialState) -> float:
    """Solve the scalar equation for dp > 0; returns -1 where it does not converge.

    Written as rise(dp) = excess with a rise that grows from 0, by Newton's method between brackets.
    tables : (n_t,) as at the head of this file.
    """
    R_n, R_slope, aa, ab, bb = start.R, start.slope, start.aa, start.ab, start.bb
    G, C, gamma, creeps = p.shear_modulus, p.backstress_modulus, p.backstress_recall, kind & CREEP
    powers = kind & (CREEP | OVERSTRESS)
    Q0 = np.sqrt(max(aa - 2.0 * ab + bb, 0.0))
    # A power by n multiplies the round-off of its base by n.
    close = YIELD_ROUND_OFF * Q0 * (1.0 + (creep_exponent(p, R_n) if creeps else 0.0))
    c_n = creep_strain(p, R_n, dt) if creeps else 0.0
    excess = Q0 - R_n - 3.0 * G * c_n
    low, high = 0.0, (np.sqrt(aa) + np.sqrt(bb)) / (3.0 * G)
    dp = excess / (3.0 * G + C + max(R_slope, 0.0))
    if kind & OVERSTRESS:
        dp = min(dp, overstress_strain(p, excess, dt))
    for i in range(MAX_RETURN_ITERATIONS):
        if dp <= 0.0:
            # Flow too slow to be a number: none.
            return 0.0
        q, slope = resistance(kind, p, tables, dt, e_p, dp)
        theta = 1.0 / (1.0 + gamma * dp)
        rise = 3.0 * G * dp + theta * C * dp + q - R_n
        grow = 3.0 * G + C * theta * theta + slope
        if creeps:
            dc = creep_strain(p, q, dt)
            rise += 3.0 * G * (dc - c_n)
            grow += 3.0 * G * creep_exponent(p, q) * dc / q * slope if q > 0.0 else 0.0
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
        if not low < new < high or i % BISECT_EVERY == BISECT_EVERY - 1:
            new = np.sqrt(max(low, 1e-6 * high)) * np.sqrt(high) if low < 1e-3 * high else 0.5 * (low + high)
        if abs(new - dp) <= 1e-15 * dp or high - low <= 1e-15 * high:
            return new
        dp = new
    return -1.0


@inner
def elastic(G: float, D: Floats) -> None:
    """Fill D : (4, 4) [Pa] with 2 G times the deviatoric projection."""
    D[:, :] = 0.0
    for i in (0, 1, 3):
        for j in (0, 1, 3):
            D[i, j] = -2.0 / 3.0 * G
        D[i, i] = 4.0 / 3.0 * G
    D[2, 2] = 2.0 * G


@inner
def deviator(E: Floats, e: Floats) -> None:
    """Fill e : (4,) with the deviator of E : (4,), strains [1]."""
    third = (E[0] + E[1] + E[3]) / 3.0
    e[0] = E[0] - third
    e[1] = E[1] - third
    e[2] = E[2]
    e[3] = E[3] - third


@inner
def update(kind: int, p: Point, tables: Floats, E: Floats, dt: float, h_n: Floats, h: Floats, S: Floats,
           D: Floats) -> tuple[int, float]:
    """Compute one step of a point, as written at the head of this file; returns the code and the heat [J/m3].

    tables : (n_t,) hardening curves.  E : (4,) [1] strain.  S : (4,) [Pa] and D : (4, 4) [Pa], out.
    h_n, h : (n_h,) history at the start and, out, at the end (laws/law.py): strains [1] and backstress [Pa].
    """
    deviator(E, S)
    if kind == 0:
        for i in range(4):
            S[i] *= 2.0 * p.shear_modulus
        elastic(p.shear_modulus, D)
        return 0, 0.0
    for i in range(h.shape[0]):
        h[i] = h_n[i]
    if not kind & LIQUID:
        for i in range(4):
            S[i] = 2.0 * p.shear_modulus * (S[i] - h[H_INELASTIC + i])
        return flow(kind, p, tables, dt, h, S, D)
    e = (S[0], S[1], S[2], S[3])
    solidify(p, h_n, h)
    code, heat = 0, 0.0
    if p.solid_fraction > 0.0:
        for i in range(4):
            S[i] = 2.0 * p.shear_modulus * (e[i] - h[H_INELASTIC + i])
        code, heat = flow(kind, p, tables, dt, h, S, D)
    else:
        elastic(0.0, D)
    return code, p.solid_fraction * heat + mix(p, e, dt, h_n, h, S, D)
