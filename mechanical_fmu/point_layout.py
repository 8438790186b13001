"""What stands where in a point's parameters and history, and the parts its kind is a sum of.

p : (N_P,) by the names P_..., all at the point's temperature:
    G shear modulus [Pa]; CHI, CHI_VISCOUS, CHI_LIQUID : shares of plastic, creep and liquid work that become heat;
    YIELD, Q, B, H : R = YIELD + Q (1 - exp(-B e)) + H e [Pa] (with a table: YIELD multiplies it);
    C [Pa], GAMMA of the backstress; LOG_A, N : creep rate = exp(LOG_A) q^N [1/s]; K [Pa s^M], M of the overstress;
    SOLID fraction, ETA viscosity of the liquid [Pa s];
    TABLE where the strains of the table begin in `tables`, KNOTS how many (0: no table), ROW where the row of stresses
    below the temperature begins, SHARE of the next row, FORM : sum of CUBIC and SLOPED.
h : inelastic strain (4 components 11, 22, 12, 33), plastic and creep equivalent strain; with KINEMATIC or LIQUID the
    backstress (4); with LIQUID the deviator of E (4) and the solid fraction.
"""

from __future__ import annotations

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
