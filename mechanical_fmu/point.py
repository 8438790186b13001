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

# What stands where in a point's parameters and history, and the parts its kind is a sum of.
#
# p : (N_P,) by the names P_..., all at the point's temperature:
#     G shear modulus [Pa]; CHI, CHI_VISCOUS, CHI_LIQUID : shares of plastic, creep and liquid work that become heat;
#     YIELD, Q, B, H : R = YIELD + Q (1 - exp(-B e)) + H e [Pa] (with a table: YIELD multiplies it);
#     C [Pa], GAMMA of the backstress; LOG_A, N : creep rate = exp(LOG_A) q^N [1/s]; K [Pa s^M], M of the overstress;
#     SOLID fraction, ETA viscosity of the liquid [Pa s];
#     TABLE where the strains of the table begin in `tables`, KNOTS how many (0: no table), ROW where the row of
#     stresses below the temperature begins, SHARE of the next row, FORM : sum of CUBIC and SLOPED.
# h : inelastic strain (4 components 11, 22, 12, 33), plastic and creep equivalent strain; with KINEMATIC or LIQUID the
#     backstress (4); with LIQUID the deviator of E (4) and the solid fraction.

# kind is a sum of these; 0 is elastic.
PLASTIC, CREEP, KINEMATIC, OVERSTRESS, LIQUID = 1, 2, 4, 8, 16

H_INELASTIC, H_PLASTIC, H_CREEP, H_BACK, H_STRAIN, H_SOLID = 0, 4, 5, 6, 10, 14

(P_G, P_CHI, P_CHI_VISCOUS, P_YIELD, P_Q, P_B, P_H, P_C, P_GAMMA, P_LOG_A, P_N, P_K, P_M, P_SOLID, P_ETA,
 P_TABLE, P_KNOTS, P_ROW, P_SHARE, P_FORM, P_CHI_LIQUID) = range(21)
N_P = 21

# A table is cubic between its knots (else straight), and goes on with its last slope (else flat).
CUBIC, SLOPED = 1, 2

CODES = {1: "the return to the yield surface did not converge", 2: "it softens faster than it unloads elastically",
         3: "its strain or a material value is not finite"}


def history_size(kind: int) -> int:
    """n_h of a kind."""
    return 15 if kind & LIQUID else 10 if kind & KINEMATIC else 6 if kind else 0


def has_skew_tangent(kind: int) -> bool:
    """Whether W D is unsymmetric: a backstress that forgets (gamma > 0) turns the direction of flow."""
    return bool(kind & KINEMATIC)


# Norton creep over one step, fully implicit, at any length of step.  numba.
#
# The creep equivalent strain grows at A q^n, A = exp(log_a).  Over a step from the trial stress Q, with q at its end:
#     q + 3 G dt A q^n = Q.
# With q = Q exp(v) and c = 3 G dt A Q^(n-1): log(exp(v) + c exp(n v)) = 0, convex and of a slope between 1 and n, so
# Newton's method from the right converges from any start; c may be 1e-300 or 1e300.

MOST_CREEP = 100
# exp() of more overflows.
LARGEST = 700.0


@inner
def relaxed(Q: float, G: float, dt: float, log_a: float, n: float) -> tuple[float, float]:
    """q [Pa] at the end of the step and the creep strain made in it, from the trial stress Q > 0 [Pa]."""
    # fault: creep strain of a whole step at twice the rate -> lc = np.log(6.0 * G) + np.log(dt) + log_a + (n - 1.0) *
    #   np.log(Q) | mechanical_fmu/test_points_flow mechanical_fmu/test_points_verification
    lc = np.log(3.0 * G) + np.log(dt) + log_a + (n - 1.0) * np.log(Q)
    v = -max(lc, 0.0) / n
    for _ in range(MOST_CREEP):
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


# Flow stress R(e) of isotropic hardening, e the plastic equivalent strain.  numba.
#
#     Voce:  R = s0 + Q (1 - exp(-b e)) + H e        (Q = 0 : linear; Q = H = 0 : perfectly plastic)
#     table: R = factor times the curve at the point's temperature, linear between two curves of a material.
# A table in `tables`: strains (n), then for every temperature stresses (n) and slopes (n).
# R does not fall below 0.

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


# A point between liquid and solid, mixed by the solid fraction f_s.  numba.
#
#     s = f_s s_solid + (1 - f_s) 2 eta (e - e_n)/dt
# The liquid remembers nothing.  The solid does, but what solidifies in a step does so stress-free in the shape it has:
# of the solid at the end only the share w = f_n/f_s (at most 1) was there before, so its mean elastic strain,
# backstress and plastic strain start the step at w times their value.  Then f_s s_solid does not jump when f_s grows,
# and what has melted (f_s = 0) has forgotten.

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


# One material point: stress, tangent and heat of a step of strain, by kind of material.  numba.
#
#     code, heat = update(kind, p, tables, E, dt, h_n, h, S, D)
#
# (Whoever calls it from compiled code takes `kernel` of contact.compiled for a decorator, or numba's cache goes stale.)
#
# E : (4,) logarithmic strain at the end of the step, tensor components (11, 22, 12, 33); only its deviator matters.
# S : (4,) out, DEVIATORIC conjugate stress [Pa], tensor components; the pressure kappa (ln theta - e_th) is the cell's.
# D : (4, 4) out, dS/dE with plain components on both sides: dS_i = sum_j D_ij dE_j.  With W = diag(1, 1, 2, 1), W D is
#     symmetric unless has_skew_tangent(kind).  D carries the deviatoric projection on its right and its left.
# dt : [s], 0 where nothing can flow yet (equilibrium at the start). h_n, h : (n_h,) history at the start and at the
# end, all 0 for a virgin point; h is written whole, h_n never. p : (N_P,) parameters of the point at its temperature
# and solid fraction (point_layout.py). tables : (n_t,) the hardening curves of all materials, one behind the other
# (hardening.py). heat : [J/m3 of reference volume] made in the step, AFTER the shares of plastic, creep and liquid work
# that become heat. code : 0 well; else CODES says why not, and S, D, h are unusable: a smaller step may do.

__all__ = ["CODES", "CREEP", "KINEMATIC", "LIQUID", "N_P", "OVERSTRESS", "PLASTIC", "deviator", "has_skew_tangent",
           "history_size", "update"]



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
