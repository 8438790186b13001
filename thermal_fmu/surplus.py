"""What smaller cells change because heat flowed otherwise before than it does now.

Errors of a mesh begin where heat strikes, and a film that gave too much for some seconds leaves a body too warm long
after all has become smooth.  The balance of extremes.py knows what drives errors now, at t:

    C e' + K e = r = f(T_h) - C T_h',

and takes r for what it was all the time.  But of C T_h' the whole is known, from what nodes stored since errors began
to grow; g = C_h D more than at the present rate, and at the nodes of the half f(T_h) added up to that as well, for it
obeyed its own balance.  On its way through the half's cells it flowed on straight lines, as the half's own steady
fields do: K P y, with P' K P y = g.  So the impulse S = K P y - C P D is what r was more than it is now, and
backward Euler has (C + t K) e = S of it.  What heats the scene drops out of r; what lasts, which no conduction
evens out, is in e in full.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.linalg import Solve, factorise

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Of the capacities, beside t K, so that heat that nothing carries away has a place where it stays.
SLIGHT = 0.01


def surplus(J: csr_matrix, solve: Solve, C: Floats, P: csr_matrix, D: Floats, fixed: tuple[Mask, Mask]) -> Floats:
    """Return e : (n_halved,) [K], 0 at fixed nodes.

    J : C + t K of halved cells [J/K], rows and columns of fixed nodes those of the identity; solve : J x = b.
    C : (n_halved,) capacities of their nodes [J/K].  P : (n_halved, n) as of Halved.  D : (n,) [K] by how much more the
    half's nodes were warmed than at their present rate.  fixed : whether nodes are, of the half and of halved cells.
    Raises SingularMatrixError.
    """
    free, free_h = (~of for of in fixed)
    inner = P[free_h][:, free]
    K = csr_matrix(J[free_h][:, free_h] - diags_array((1.0 - SLIGHT) * C[free_h]))
    g = (P.T @ C)[free] * D[free]
    y = factorise(csr_matrix(inner.T @ K @ inner))(g)
    S = np.zeros(C.size)
    S[free_h] = K @ (inner @ y) - (C * (P @ D))[free_h]
    # fault: what flowed otherwise before is left for longer than it was -> return np.asarray(solve(S)) |
    #   thermal_fmu/test_surplus
    twice = solve(C * solve(S))
    return np.asarray(2.0 * twice - solve(C * twice))
