"""What smaller cells change because heat flowed otherwise before than it does now.

Errors of a mesh begin where heat strikes, and a film that gave too much for some seconds leaves a body too warm long
after all has become smooth.  The balance of extremes.py knows what drives errors now, at t:

    C e' + K e = r = f(T_h) - C T_h',

and takes r for what it was all the time.  But the half knows what it was: its nodes stored C_h D more than at their
present rate, which made C P D of C T_h', and by what they were warmed over all the time conduction brought K P y more
than at their present temperatures.  At the nodes of the half both are the same heat, but for what loads brought that
changed, and for nonlinearity: g = C_h D - P' K P y; of that smaller cells make what the half's would, in one step of
backward Euler, w = (C_h + t K_h)^-1 g.  So

    S = K P y + (C + t K) P w - C P D

is what r was more than it is now.  What is left of it is e = exp(-t C^-1 K) C^-1 S; with q = (1 + z)^-1, which the
factors of backward Euler have, 2 q^2 - q^3 is exp(-z) to second order, and a film that gave too much is in e in full
while that has not evened out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.linalg import Solve, factorise

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

@dataclass(frozen=True)
class Linear:
    """The halved cells about their temperatures.

    J : C + t K [J/K], rows and columns of fixed nodes those of the identity; solve : J x = b.  C : (n_halved,) the
    capacities in it [J/K].  fixed : (n_halved,) whether nodes are.
    """

    J: csr_matrix
    solve: Solve
    C: Floats
    fixed: Mask


@dataclass(frozen=True)
class MoreWarmth:
    """By how much more nodes of the half were warmed than they are now, (n,) each.

    D [K]: than at their present rate.  y [K]: than at their present temperatures, over the time t of `Linear`.
    known : nodes of which that is so; others are as fixed.
    """

    D: Floats
    y: Floats
    known: Mask


def surplus(halved: Linear, P: csr_matrix, sizes: Floats, more: MoreWarmth) -> Floats:
    """Return e : (n_halved,) [K], 0 at fixed nodes.

    P : (n_halved, n) as of Halved.  sizes : (n_halved,) capacities of nodes that D is over [J/K].
    Raises SingularMatrixError.
    """
    # A node between two that are not known is not, and where one of them is it goes half its way.
    free, C = more.known, halved.C
    free_h = ~halved.fixed & (np.asarray(P @ free) > 0.0)
    inner, J = P[free_h][:, free], halved.J[free_h][:, free_h]
    K = csr_matrix(J - diags_array(C[free_h]))
    conducted = K @ (inner @ more.y[free])
    g = (P.T @ sizes)[free] * more.D[free] - inner.T @ conducted
    # fault: what loads brought that changed is taken for what conduction did -> w = np.zeros(g.size) |
    #   thermal_fmu/test_surplus
    w = factorise(csr_matrix(inner.T @ J @ inner))(g)
    S = np.zeros(C.size)
    S[free_h] = conducted + J @ (inner @ w) - (sizes * (P @ more.D))[free_h]
    twice = halved.solve(C * halved.solve(S))
    # fault: what flowed otherwise before is left for longer than it was -> return np.asarray(halved.solve(S)) |
    #   thermal_fmu/test_surplus
    return np.asarray(2.0 * twice - halved.solve(C * twice))
