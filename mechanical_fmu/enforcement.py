"""How contact is enforced: each way to find equilibrium and pressures is a function here and a row of ENFORCEMENTS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.contact_client import History
from contact.half.linalg import SingularMatrixError, factorise
from contact.half.model import Link
from contact.messages import Couplings, Tractions
from contact.multipliers import ENDS
from mechanical_fmu.contact import MeshContact
from mechanical_fmu.newton import (
    MAX_POOR_ITERATIONS,
    POOR_REDUCTION,
    Equilibrium,
    Iterate,
    NoEquilibriumError,
    SolverSettings,
    jumps_text,
    line_search,
    solve,
    with_tangent,
)
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


# What one step asks the contact service: tractions, and how they answer to the multipliers of the moment.

@dataclass(frozen=True)
class ContactQuery:
    """Contact tractions at x : (n_nodes, 2) [m], from what contact remembers.  Raises ContactRefusedError.

    multipliers : (n_m,) [Pa] of the moment; those of the history are of the start of the step.
    """

    contact: MeshContact
    link: Link
    history: History
    multipliers: Floats

    def __call__(self, x: Floats) -> Tractions:
        """Ask for the contact tractions at x : (n_nodes, 2) [m].  Raises ContactRefusedError."""
        return self.contact.tractions(self.link, x, self.history, self.multipliers)

    def couplings(self, x: Floats) -> Couplings:
        """Ask how contact at x : (n_nodes, 2) [m] answers to its multipliers.  Raises ContactRefusedError."""
        return self.contact.couplings(self.link, x, self.history, self.multipliers)

    def with_multipliers(self, multipliers: Floats) -> ContactQuery:
        """Replace the multipliers of contact; multipliers : (n_m,) [Pa]."""
        return replace(self, multipliers=multipliers)


def contact_query(system: System, link: Link, history: History) -> Callable[[Floats], Tractions] | None:
    """Make the query of a step; None where nothing can touch."""
    return ContactQuery(system.contact, link, history, history.multipliers) if system.interface.pairs else None


# Changes (n_m,) [Pa] of the multipliers, and the largest of them all [Pa], not 0: of contact, then of ties.
Changes = tuple[tuple[Floats, float], ...]


def settled(changes: Changes, share: float) -> bool:
    """Say whether no multiplier changes by more than a share of the largest of its kind."""
    return all(bool(np.abs(change).max(initial=0.0) <= share * largest) for change, largest in changes)


def unsettled(system: System, changes: Changes) -> tuple[str, str]:
    """Say by how much pressures and tractions of ties still change, and where most."""
    change, largest = max(changes, key=lambda part: float(np.abs(part[0]).max(initial=0.0)) / part[1])
    of = system.contact.pair_nodes
    # fault: a node that does not settle misnamed -> worst = int(np.argmin(np.abs(change))) |
    #   mechanical_fmu/test_semi_smooth
    worst = int(np.argmax(np.abs(change)))
    q = worst if worst < of.size else int(of.tied[(worst - of.size) // 2])
    node, pair = int(system.interface.pair_nodes[q]), system.interface.pairs[of.pair[q]]
    x, y = system.interface.nodes[node]
    return (f"still change by {abs(change[worst]):.3g} Pa (of at most {largest:.3g})",
            f"pair {pair.name}, node {node + 1} of {pair.slave} (at the start at {x:.6g}, {y:.6g} m)")


def contact_history(system: System, balance: ForceBalance, before: History) -> History:
    """Make what contact remembers of an equilibrium, the multipliers of augmented pairs among it."""
    if balance.tractions is None:
        return before
    at = system.interface.contact_nodes
    augmented = system.contact.multiplied(system.spec.augmented)
    # fault: multipliers forgotten between steps -> return History(np.where(augmented, 0.0, 0.0),
    #   (system.interface.nodes + balance.u)[at], | mechanical_fmu/test_augment
    return History(np.where(augmented, balance.tractions.multipliers, 0.0), (system.interface.nodes + balance.u)[at],
                   balance.tractions.mobilised)


# Contact by its penalty alone: the pressure is eps_N times the depth, and nothing is left to settle.

def solve_by_penalty(system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
                     settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to start, with the multipliers of contact as they are.

    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """
    return solve(system, loading, start, anchor, settings)


# The augmented Lagrangian in rounds: equilibrium, and again with the pressures it found, until nothing penetrates.
#
# Uzawa's iteration; `solve_at_once` goes to the same solution at once, where Newton's own method is used.  Each round
# leaves 1/(1 + eps_N L/E) of the penetration of the round before, so with the default penalty E/h a body of twenty
# cells is done in three or four.  It ends where the pressures have settled to the tolerance asked for, or where the
# forces do not feel their change.

# fault: one round of augmentation, whatever is left -> MAX_ROUNDS = 1 | mechanical_fmu/test_augment
MAX_ROUNDS = 40


def solve_in_rounds(system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
                    settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to start whose multipliers have settled, in rounds around Newton's method.

    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """
    query, augmented = loading.query, system.contact.multiplied(system.spec.augmented)
    assert isinstance(query, ContactQuery)
    share = min(system.spec.augmented.values())
    found = solve(system, loading, start, anchor, settings)
    for _ in range(MAX_ROUNDS):
        assert found.balance.tractions is not None
        pressed = np.where(augmented, found.balance.tractions.multipliers, 0.0)
        changes = _by_kind(system, pressed - query.multipliers, pressed)
        # fault: pressures settle at once -> if settled(changes, 1e3): | mechanical_fmu/test_augment
        if settled(changes, share):
            return found
        query = query.with_multipliers(pressed)
        again = replace(loading, query=query)
        more = solve(system, again, system.balance(found.balance.u, again), anchor, settings)
        found = replace(more, history=found.history + more.history[1:], fresh=found.fresh or more.fresh)
        # fault: settling asked of round-off -> if more.iterations < 0: | mechanical_fmu/test_augment
        if more.iterations == 0:
            # The forces do not feel the change: where bodies just touch, pressures are round-off and never settle.
            return found
    how_much, where = unsettled(system, changes)
    raise NoEquilibriumError(f"the contact pressures do not settle: after {MAX_ROUNDS} rounds they {how_much}; a "
                             f"larger penalty settles sooner, or method: semi_smooth (most on {where})")


# The augmented Lagrangian, displacements and multipliers solved for at once: a semi-smooth Newton (Alart and
# Curnier).
#
# Unknowns are u and lambda at the slave's nodes, lambda = -p where p = max(-lambda - eps_N g_N, 0) averages to p:
#     r(u, lambda) = 0,   R(u, lambda) = W (lambda - t_N(u, lambda)) = 0,
# whose solution is the one Uzawa's rounds go to.  With B = df/dlambda, C = dR/du, D = dR/dlambda of
# contact.multipliers, and the stiffness K of the method's own direction, which has the penalty in it and so needs no
# multiplier to be regular,
#     K d - B dl = -r,  C d + D dl = -R:   d = d_0 + X dl,  X = K^-1 B,  (D + C X) dl = -R - C d_0.
# That is the system in u and lambda with u condensed out: lambda has a few surface nodes, so D + C X is small and
# dense. With an anchor's factor everything happens on the surface, as in tangent.py.  lambda takes its whole step; d
# then is a Newton direction of the penalty's energy at the new lambda, so the line search of newton.py holds for it.

@dataclass(frozen=True)
class MultiplierEquations:
    """Contact's answer to its multipliers, in units of eps : [Pa/m], so that all of it is of order 1.

    at : (k,) multipliers that are unknown here.  B : (2 n, k), free components only, reduced to
    reference rows; C : (k, 2 n), D : (k, k) and R : (k,) [m], each row divided by W eps.
    """

    at: NDArray[np.intp]
    B: csr_matrix
    C: csr_matrix
    D: Floats
    R: Floats
    eps: float


@dataclass(frozen=True)
class Direction:
    """d : (2 n,) [m].  multipliers : (n_m,) [Pa], the new ones.  pull : (n, 2) [N], B times their change."""

    d: Floats
    multipliers: Floats
    pull: Floats


def solve_at_once(system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
                  settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to start whose multipliers are its pressures, with both as unknowns.

    Its history holds the larger of both residuals.  Modified Newton and BFGS, which have no tangent to put multipliers
    into, take Uzawa's rounds.  Raises NoEquilibriumError, which names the node whose pressure does not settle,
    SingularMatrixError, CellInversionError, ContactRefusedError.
    """
    if settings.method != "newton":
        return solve_in_rounds(system, loading, start, anchor, settings)
    share = min(system.spec.augmented.values())
    floor, augmented = system.floor(loading, settings.tolerance), system.contact.multiplied(system.spec.augmented)
    balance, error, poor, fresh = start, system.error(start, floor), 0, False
    history: list[float] = []
    while True:
        query = _query(loading)
        changes = _changes(system, balance, query, augmented)
        history.append(max(float(error.max()), *(float(np.abs(c).max(initial=0.0)) / most for c, most in changes)))
        gap = loading.target - balance.u.ravel()[system.constraints.fixed]
        if float(error.max()) <= settings.tolerance and not gap.any():
            # fault: pressures taken as settled -> if True: | mechanical_fmu/test_semi_smooth
            if settled(changes, share):
                return Equilibrium(balance, float(error.max()), tuple(history), fresh)
            by_now = np.where(augmented, query.multipliers + sum(change for change, _ in changes), 0.0)
            unfelt = replace(loading, query=query.with_multipliers(by_now))
            again = system.balance(balance.u, unfelt)
            # fault: round-off asked to settle at once -> if False: | mechanical_fmu/test_semi_smooth
            if float(system.error(again, floor).max()) <= settings.tolerance:
                # The forces do not feel the change: where bodies just touch, pressures are round-off.
                return Equilibrium(again, float(system.error(again, floor).max()), tuple(history), fresh)
        if len(history) > settings.most:
            break
        old = anchor if poor < MAX_POOR_ITERATIONS else None
        fresh = fresh or old is None
        step = direction(system, loading, balance, gap, old, augmented)
        loading = replace(loading, query=query.with_multipliers(step.multipliers))
        from_here = replace(balance, r=balance.r - step.pull)
        before, touched = float(error.max()), _touched(balance)
        found = line_search(system, loading, Iterate(from_here, error), step.d, floor, settings.tolerance)
        balance, error = found.balance, found.error
        # While points open and close, that is what spoils an iteration, not the age of the factor.
        poor += float(error.max()) > POOR_REDUCTION * before and _touched(balance) == touched
    raise NoEquilibriumError(_text(system, settings, error, changes))


def direction(system: System, loading: Loading, balance: ForceBalance, gap: Floats, anchor: StiffnessAnchor | None,
              augmented: NDArray[np.bool_]) -> Direction:
    """Solve for the change of displacements and multipliers.

    gap : (n_fixed,) [m] still to go to the prescribed displacements.  anchor : whose factor to use, None for a fresh
    tangent.  augmented : (n_m,) whether a multiplier is of an augmented pair.
    Raises SingularMatrixError, ContactRefusedError.
    """
    query = _query(loading)
    old, a = query.multipliers, answer_of(system, query, balance, augmented)
    d, dl = _fresh(system, loading, balance, gap, a) if anchor is None else _anchored(anchor, balance, gap, a)
    multipliers = np.zeros(old.size)
    # fault: multipliers that pull -> multipliers[a.at] = np.minimum(old[a.at] + a.eps * dl, np.inf) |
    #   mechanical_fmu/test_semi_smooth
    multipliers[a.at] = np.minimum(old[a.at] + a.eps * dl, np.where(a.at < system.contact.pair_nodes.size, 0.0, np.inf))
    # Of what was cut off at 0 the forces know nothing.
    felt = (multipliers - old)[a.at] / a.eps
    return Direction(d, multipliers, (a.B @ felt).reshape(-1, 2))


def answer_of(system: System, query: ContactQuery, balance: ForceBalance,
              augmented: NDArray[np.bool_]) -> MultiplierEquations:
    """Assemble what the multipliers among augmented : (n_m,) do at balance.u.  Raises ContactRefusedError."""
    c = query.couplings(system.interface.nodes + balance.u)
    wanted = augmented & (c.weight > 0.0)
    at = np.intersect1d(np.flatnonzero(wanted), c.ends)
    place = np.full(wanted.size, -1)
    place[at] = np.arange(at.size)
    eps = max(pair.eps_N for pair in system.interface.pairs)
    n, k, weight = 2 * len(balance.u), at.size, c.weight[at]
    row = np.broadcast_to(c.nodes[:, :, None], c.values.shape[:3])
    column = np.broadcast_to(place[c.ends][:, None, :], c.values.shape[:3])
    equation = np.full(c.nodes.shape, -1)
    equation[:, ENDS] = place[c.ends]
    equation = np.broadcast_to(equation[:, :, None], c.values.shape[:3])
    # Most pieces are open: where nothing touches, nothing answers.
    use = (column >= 0) & c.values.any(axis=3)
    j, dofs = column[use], system.contact.dofs.reshape(-1, 2)[row[use]]
    both, twice = dofs.ravel(), np.repeat(j, 2)
    B = csr_matrix((eps * c.values[..., :2][use].ravel(), (both, twice)), shape=(n, k))
    C = csr_matrix((c.values[..., 2:4][use].ravel() / (eps * weight[twice]), (twice, both)), shape=(k, n))
    D, i = np.eye(k), equation[use]
    inside = i >= 0
    np.add.at(D, (i[inside], j[inside]), c.values[..., 4][use][inside] / weight[i[inside]])
    # fault: multipliers of a rigid body's nodes not gathered -> if False: | mechanical_fmu/test_semi_smooth
    if system.rigid is not None:
        B = csr_matrix(system.rigid.follow(balance.u).T @ B)
    B.data *= np.repeat(system.constraints.free, np.diff(B.indptr))
    B.eliminate_zeros()  # nodes that face something and touch nothing: no force of theirs is to be solved for
    return MultiplierEquations(at.astype(np.intp), B, C, D, c.residual[at] / (eps * weight), eps)


def _fresh(system: System, loading: Loading, balance: ForceBalance, gap: Floats,
           a: MultiplierEquations) -> tuple[Floats, Floats]:
    """d and the change of the multipliers over eps : (k,) [m], with today's tangent."""
    balance = with_tangent(system, balance, loading)
    if loading.inertia is None:
        refuse_loose(system, balance)
    K = stiffness(system, balance, loading)
    solve = factorise(constrained(system, K), symmetric(system, balance, loading))
    d = finish(system, balance, solve(right_side(system, balance, K, gap)), gap)
    X = np.zeros((d.size, a.at.size))
    felt = np.unique(a.B.indices)
    for first in range(0, felt.size, RIGHT_SIDES):
        some = felt[first : first + RIGHT_SIDES]
        columns = solve(a.B[:, some].toarray())
        X[:, some] = columns if system.rigid is None else system.rigid.spread(columns, balance.u)
    dl = _solved(a.D + a.C @ X, -a.R - a.C @ d)
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
    R = a.R + a.C @ moved
    E, B, C = anchor.surface_change(balance.tractions), a.B[dofs].toarray(), a.C[:, dofs].toarray()
    C = C * system.constraints.free[dofs]
    active = np.flatnonzero(E.any(axis=1) | B.any(axis=1) | C.any(axis=0))
    E, B, C, m = E[np.ix_(active, active)], B[active], C[:, active], active.size
    S = anchor.compliance[np.ix_(active, active)]
    d_0 = anchor.solve(b)[dofs[active]]
    solved = _solved(np.block([[np.eye(m) + S @ E, -S @ B], [C, a.D]]), np.concatenate([d_0, -R]))
    d_s, dl = solved[:m], solved[m:]
    # fault: anchored multipliers without their force -> b[dofs[active]] -= E @ d_s | mechanical_fmu/test_semi_smooth
    b[dofs[active]] -= E @ d_s - B @ dl
    return finish(system, balance, anchor.solve(b), gap), dl


def _solved(A: Floats, b: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.solve(A, b))
    except np.linalg.LinAlgError as exc:
        raise SingularMatrixError("the multipliers of contact are not determined: its equations are singular") from exc


def _query(loading: Loading) -> ContactQuery:
    assert isinstance(loading.query, ContactQuery)
    return loading.query


def _touched(balance: ForceBalance) -> tuple[int, int]:
    """How many points touch, and how many of them slip."""
    assert balance.tractions is not None
    return balance.tractions.n_touching, balance.tractions.n_slipping


def _changes(system: System, balance: ForceBalance, query: ContactQuery, augmented: NDArray[np.bool_]) -> Changes:
    """What multipliers would become less what they are."""
    assert balance.tractions is not None
    now = np.where(augmented, balance.tractions.multipliers, 0.0)
    before = np.where(augmented, query.multipliers, 0.0)
    return _by_kind(system, now - before, np.maximum(np.abs(now), np.abs(before)))


def _by_kind(system: System, change: Floats, size: Floats) -> Changes:
    """Part changes of multipliers, (n_m,) [Pa] like their size, into those of contact and those of ties."""
    tied = np.arange(change.size) >= system.contact.pair_nodes.size
    return tuple((np.where(kind, change, 0.0), max(float(np.abs(size[kind]).max(initial=0.0)), np.finfo(float).tiny))
                 for kind in (~tied, tied) if kind.any())


def _text(system: System, settings: SolverSettings, error: Floats, changes: Changes) -> str:
    if float(error.max()) > settings.tolerance:
        body = system.interface.bodies[int(np.argmax(error))]
        forces = (f"the forces on body {body} are out of balance by {float(error.max()):.3g} "
                  f"(tolerance {settings.tolerance:g})")
        # fault: pressures that stay are said to change -> if False: | mechanical_fmu/test_semi_smooth
        if not any(change.any() for change, _ in changes):
            return f"no equilibrium after {settings.most} iterations: {forces}{jumps_text(system)}"
        forces += " and "
    else:
        forces = ""
    how_much, where = unsettled(system, changes)
    return (f"no equilibrium after {settings.most} iterations: {forces}the contact pressures {how_much}, most on "
            f"{where}; method: uzawa settles them in rounds"
            f"{jumps_text(system)}")


# The enforcements by name.

class Enforcement(Protocol):
    """Finds the equilibrium nearest to start and the multipliers that belong to it.

    anchor : whose factor to use as long as it serves, None for a fresh tangent in every iteration.
    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """

    def __call__(self, system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
                 settings: SolverSettings) -> Equilibrium:
        """Solve one step."""
        ...


# By the name in model.json; "penalty" is that of pairs without `augmented`.
ENFORCEMENTS: dict[str, Enforcement] = {
    "penalty": solve_by_penalty,
    "uzawa": solve_in_rounds,
    "semi_smooth": solve_at_once,
}


def solve_step(system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
               settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to start by the enforcement of the scene; by penalty where nothing can touch.

    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """
    name = system.spec.enforcement if isinstance(loading.query, ContactQuery) else "penalty"
    return ENFORCEMENTS[name](system, loading, start, anchor, settings)
