"""One Newton direction of displacements and contact multipliers together.

Unknowns are u and lambda at the slave's nodes, lambda = -p where p = max(-lambda - eps_N g_N, 0) averages to p:
    r(u, lambda) = 0,   R(u, lambda) = W (lambda - t_N(u, lambda)) = 0,
whose solution is the one Uzawa's rounds go to (semi-smooth Newton, Alart and Curnier).  With B = df/dlambda,
C = dR/du, D = dR/dlambda of contact.multipliers, and the stiffness K of the method's own direction, which has the
penalty in it and so needs no multiplier to be regular,
    K d - B dl = -r,  C d + D dl = -R:   d = d_0 + X dl,  X = K^-1 B,  (D + C X) dl = -R - C d_0.
That is the system in u and lambda with u condensed out: lambda has a few surface nodes, so D + C X is small and
dense.  B and C are of surface nodes only, and full enough there: they are dense too, which costs a fifth of sparse
ones.  With an anchor's factor everything happens on the surface, as in tangent.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.linalg import SingularMatrixError, factorise
from contact.messages import Couplings
from contact.multipliers import assembled
from mechanical_fmu.newton import with_tangent
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import (
    RIGHT_SIDES,
    StiffnessAnchor,
    constrained,
    finish,
    refuse_loose,
    right_side,
    stiffness,
    symmetric,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MultiplierEquations:
    """Contact's answer to its multipliers, in units of eps : [Pa/m], so that all of it is of order 1.

    at : (k,) multipliers that are unknown here.  rows : (m,) degrees of freedom of the rows of B : (m, k), free
    components only, of rigid bodies reduced to reference rows.  C : (k, 2 n_s) by the surface's degrees of freedom,
    D : (k, k) and R : (k,) [m], each row divided by W eps.
    """

    at: NDArray[np.intp]
    rows: NDArray[np.intp]
    B: Floats
    C: Floats
    D: Floats
    R: Floats
    eps: float


@dataclass(frozen=True)
class Direction:
    """d : (2 n,) [m].  multipliers : (n_m,) [Pa], the new ones.  pull : (n, 2) [N], B times their change."""

    d: Floats
    multipliers: Floats
    pull: Floats


def direction(system: System, loading: Loading, balance: ForceBalance, gap: Floats, anchor: StiffnessAnchor | None,
              multipliers: Floats, answer: MultiplierEquations) -> Direction:
    """Solve for the change of displacements and multipliers.

    gap : (n_fixed,) [m] still to go to the prescribed displacements.  anchor : whose factor to use, None for a fresh
    tangent.  multipliers : (n_m,) [Pa] of the moment.  answer : contact's at balance.u.
    Raises SingularMatrixError, ContactRefusedError.
    """
    a = answer
    d, dl = _fresh(system, loading, balance, gap, a) if anchor is None else _anchored(anchor, balance, gap, a)
    new = np.zeros(multipliers.size)
    # fault: multipliers that pull -> new[a.at] = np.minimum(multipliers[a.at] + a.eps * dl, np.inf) |
    #   mechanical_fmu/test_semi_smooth
    new[a.at] = np.minimum(multipliers[a.at] + a.eps * dl, np.where(a.at < system.contact.pair_nodes.size, 0.0, np.inf))
    # Of what was cut off at 0 the forces know nothing.
    pull = np.zeros(d.size)
    pull[a.rows] = a.B @ ((new - multipliers)[a.at] / a.eps)
    return Direction(d, new, pull.reshape(-1, 2))


def equations_of(system: System, c: Couplings, u: Floats, augmented: NDArray[np.bool_]) -> MultiplierEquations:
    """Assemble what the multipliers among augmented : (n_m,) do; c : contact's answer at u : (n, 2) [m]."""
    at = np.intersect1d(np.flatnonzero(augmented & (c.weight > 0.0)), c.ends)
    place = np.full(augmented.size, -1)
    place[at] = np.arange(at.size)
    eps = max(pair.eps_N for pair in system.interface.pairs)
    rows, size = system.contact.dofs, eps * c.weight
    B, C, D = assembled(c.nodes, c.ends, c.values, place, size, eps, rows.size, at.size)
    # fault: multipliers of a rigid body's nodes not gathered -> if False: | mechanical_fmu/test_semi_smooth
    if system.rigid is not None:
        B = np.asarray(system.rigid.follow(u).T[:, rows] @ B)
        rows = np.arange(len(B), dtype=np.intp)
    B *= system.constraints.free[rows, None]
    return MultiplierEquations(at.astype(np.intp), rows, B, C, D, c.residual[at] / size[at], eps)


def _fresh(system: System, loading: Loading, balance: ForceBalance, gap: Floats,
           a: MultiplierEquations) -> tuple[Floats, Floats]:
    """d and the change of the multipliers over eps : (k,) [m], with today's tangent."""
    balance = with_tangent(system, balance, loading)
    if loading.inertia is None:
        refuse_loose(system, balance, loading.sticking)
    K = stiffness(system, balance, loading)
    solve = factorise(constrained(system, K), symmetric(system, balance, loading))
    surface, b = system.contact.dofs, right_side(system, balance, K, gap)
    # Nodes that face something and touch nothing have no force of theirs to be solved for.
    felt = np.flatnonzero(a.B.any(axis=0))
    d, X = np.empty(0), np.zeros((b.size, a.at.size))
    for first in range(0, max(felt.size, 1), RIGHT_SIDES):
        some = felt[first : first + RIGHT_SIDES]
        sides = np.zeros((b.size, some.size + 1), order="F")
        sides[a.rows, :-1], sides[:, -1] = a.B[:, some], b
        found = solve(sides)
        if not d.size:
            d = finish(system, balance, found[:, -1].copy(), gap)
        X[:, some] = found[:, :-1] if system.rigid is None else system.rigid.spread(found[:, :-1], balance.u)
    dl = _solved(a.D + a.C @ X[surface], -a.R - a.C @ d[surface])
    # fault: multipliers that answer for half -> return d + X @ dl, 0.5 * dl | mechanical_fmu/test_semi_smooth
    return d + X @ dl, dl


def _anchored(anchor: StiffnessAnchor, balance: ForceBalance, gap: Floats,
              a: MultiplierEquations) -> tuple[Floats, Floats]:
    """The same with the factor of an anchor: d_s + S (E d_s - B dl) = d_0s and C d_s + D dl = -R on the surface."""
    system = anchor.system
    refuse_loose(system, balance)
    b = right_side(system, balance, anchor.matrix, gap, balance.tractions)
    dofs, moved = system.contact.dofs, np.zeros(b.size)
    moved[system.constraints.fixed] = gap
    R = a.R + a.C @ moved[dofs]
    E, B, C = anchor.surface_change(balance.tractions), a.B, a.C * system.constraints.free[dofs]
    active = np.flatnonzero(E.any(axis=1) | B.any(axis=1) | C.any(axis=0))
    E, B, C, m = E[np.ix_(active, active)], B[active], C[:, active], active.size
    S = anchor.compliance[np.ix_(active, active)]
    d_0 = anchor.solve(b)
    solved = _solved(np.block([[np.eye(m) + S @ E, -S @ B], [C, a.D]]), np.concatenate([d_0[dofs[active]], -R]))
    d_s, dl = solved[:m], solved[m:]
    # fault: anchored multipliers without their force -> f = E @ d_s | mechanical_fmu/test_semi_smooth
    f = E @ d_s - B @ dl
    return finish(system, balance, anchor.pushed(d_0, b, active, f), gap), dl


def _solved(A: Floats, b: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.solve(A, b))
    except np.linalg.LinAlgError as exc:
        raise SingularMatrixError("the multipliers of contact are not determined: its equations are singular") from exc
