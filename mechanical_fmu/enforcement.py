"""How contact is enforced: each way to find equilibrium and pressures is a function here and a row of ENFORCEMENTS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import History
from contact.half.model import Link
from mechanical_fmu.contact import ContactQuery
from mechanical_fmu.multiplier_equations import direction, equations_of
from mechanical_fmu.newton import (
    MAX_POOR_ITERATIONS,
    POOR_REDUCTION,
    Equilibrium,
    Iterate,
    NoEquilibriumError,
    SolverSettings,
    balances,
    goes_round,
    in_vain,
    line_search,
    solve,
    wants_tangent,
)
from mechanical_fmu.sliding_on import slid_on
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import LooseBodyError, StiffnessAnchor

Floats = NDArray[np.float64]


def contact_query(system: System, link: Link, history: History) -> ContactQuery | None:
    """Make the query of a step; None where nothing can touch."""
    return ContactQuery(system.contact, link, history, history.multipliers) if system.interface.pairs else None


def with_found_multipliers(system: System, loading: Loading, balance: ForceBalance) -> Loading:
    """Return the loading with the multipliers that a balance was found with, where pairs are augmented."""
    if loading.query is None or balance.tractions is None or not system.spec.augmented:
        return loading
    augmented = system.contact.multiplied(system.spec.augmented)
    return replace(loading, query=loading.query.with_multipliers(np.where(augmented, balance.tractions.multipliers,
                                                                          0.0)))


class Change(NamedTuple):
    """By how much multipliers of contact, or those of ties, change.

    by : (n_m,) [Pa], 0 of the other kind.  largest : of the multipliers [Pa], not 0.
    """

    by: Floats
    largest: float
    tied: bool

    @property
    def most(self) -> float:
        """Return the largest change [Pa]."""
        return float(np.abs(self.by).max(initial=0.0))


Changes = tuple[Change, ...]


def settled(changes: Changes, share: float, of_ties: float | None = None, ahead: float = 0.0) -> bool:
    """Say whether no multiplier changes by more than a share of the largest of its kind.

    of_ties : another share, for ties.  ahead : [Pa] by how much theirs would go on to change (Steps.ahead).
    """
    return all(change.most <= share * change.largest if of_ties is None or not change.tied else
               max(change.most, ahead) <= of_ties * change.largest for change in changes)


class Steps(NamedTuple):
    """By how much the multipliers of ties changed in Newton's last two steps [Pa]: last, and before, 0: no such step.

    What a tie comes apart by tells little of its tractions near nodes that conditions hold on both of its sides: hardly
    a force feels those.  What they still change by does.
    """

    last: float = 0.0
    before: float = 0.0

    def ahead(self, history: Sequence[float]) -> float:
        """Tell what the steps to come would add [Pa] if they fall as these, or a first one as residuals : history.

        0 where they hardly fall any more: that is round-off.
        """
        fell = self.last / self.before if self.before else history[-1] / history[-2] if self.last else 0.0
        # fault: ties are held for settled that go on to change -> return 0.0 | mechanical_fmu/test_tied
        return fell * self.last if fell <= POOR_REDUCTION else 0.0


def unsettled(system: System, changes: Changes) -> tuple[str, str]:
    """Say by how much pressures and tractions of ties still change, and where most."""
    change, largest, _ = max(changes, key=lambda change: change.most / change.largest)
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
                   balance.tractions.mobilised, balance.tractions.mobilised_at)


def _as_solved(found: Equilibrium, query: ContactQuery) -> Equilibrium:
    """Return an equilibrium that remembers the multipliers it was found with, not those a next correction would make.

    A step with the same inputs then begins in equilibrium and stays there.
    """
    assert found.balance.tractions is not None
    # fault: a half at rest goes on to correct its pressures -> used = found.balance.tractions.multipliers |
    #   mechanical_fmu/test_rest mechanical_fmu/test_augment
    used = query.multipliers
    balance = replace(found.balance, tractions=replace(found.balance.tractions, multipliers=used))
    return replace(found, balance=balance)


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
    assert query is not None
    share = min(system.spec.augmented.values())
    found = solve(system, loading, start, anchor, settings)
    for _ in range(MAX_ROUNDS):
        assert found.balance.tractions is not None
        pressed = np.where(augmented, found.balance.tractions.multipliers, 0.0)
        changes = _by_kind(system, pressed - query.multipliers, pressed)
        # fault: pressures settle at once -> if settled(changes, 1e3): | mechanical_fmu/test_augment
        if settled(changes, share):
            return _as_solved(found, query)
        query = query.with_multipliers(pressed)
        again = replace(loading, query=query)
        more = solve(system, again, system.balance(found.balance.u, again), anchor, settings)
        found = replace(more, history=found.history + more.history[1:], fresh=found.fresh or more.fresh)
        # fault: settling asked of round-off -> if more.iterations < 0: | mechanical_fmu/test_augment
        if more.iterations == 0:
            # The forces do not feel the change: where bodies just touch, pressures are round-off and never settle.
            return _as_solved(found, query)
    how_much, where = unsettled(system, changes)
    raise NoEquilibriumError(f"the contact pressures do not settle: after {MAX_ROUNDS} rounds they {how_much}; a "
                             f"larger penalty settles sooner, or method: semi_smooth (most on {where})")


# The augmented Lagrangian, displacements and multipliers solved for at once: a semi-smooth Newton (Alart and
# Curnier).
#
# The direction is that of multiplier_equations.py.  lambda takes its whole step; d then is a Newton direction of the
# penalty's energy at the new lambda, so the line search of newton.py holds for it.

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
    floor, augmented = settings.floor(system, loading), system.contact.multiplied(system.spec.augmented)
    balance, error, poor, fresh, whole = start, system.error(start, floor), 0, False, True
    history: list[float] = []
    steps, slides = Steps(), 0
    while True:
        query = _query(loading)
        changes = _changes(system, balance, query, augmented)
        history.append(max(float(error.max()), *(change.most / change.largest for change in changes)))
        gap = loading.target - balance.u.ravel()[system.constraints.fixed]
        if not gap.any() and balances(system, balance, error, floor, history):
            # What ties hold together neither opens nor slips: that is settled as far as forces balance.
            of_ties, to_come = min(share, settings.tolerance), steps.ahead(history)
            # fault: pressures taken as settled -> if True: | mechanical_fmu/test_semi_smooth
            # fault: ties settle no further than pressures -> if settled(changes, share): | mechanical_fmu/test_tied
            if settled(changes, share, of_ties, to_come):
                return _as_solved(Equilibrium(balance, float(error.max()), tuple(history), fresh), query)
            by_now = np.where(augmented, query.multipliers + sum(change.by for change in changes), 0.0)
            unfelt = replace(loading, query=query.with_multipliers(by_now))
            again = system.balance(balance.u, unfelt)
            told = floor if float(error.max()) <= settings.tolerance else floor.usually
            left = float(system.error(again, told).max())
            # fault: round-off asked to settle at once -> if False: | mechanical_fmu/test_semi_smooth
            if left <= settings.tolerance and to_come <= of_ties * changes[-1].largest:
                # The forces do not feel the change: where bodies just touch, pressures are round-off.
                return _as_solved(Equilibrium(again, left, tuple(history), fresh), _query(unfelt))
        around = goes_round(history)
        if around or len(history) > settings.most:
            break
        old = anchor if poor < MAX_POOR_ITERATIONS else None
        fresh = fresh or old is None
        answer = equations_of(system, query.couplings(system.interface.nodes + balance.u), balance.u, augmented)
        try:
            step = direction(system, loading, balance, gap, old, query.multipliers, answer)
        except LooseBodyError as exc:
            balance = slid_on(system, loading, balance, exc, slides)
            error, whole, slides = system.error(balance, floor), True, slides + 1
            continue
        loading = replace(loading, query=query.with_multipliers(step.multipliers))
        of_all = np.abs(step.multipliers - query.multipliers)
        steps = Steps(float(of_all[system.contact.pair_nodes.size:].max(initial=0.0)), steps.last)
        from_here = replace(balance, r=balance.r - step.pull)
        before, touched = float(error.max()), _touched(balance)
        ahead = old is None and whole and wants_tangent(history, settings.tolerance)
        found = line_search(system, loading, Iterate(from_here, error), step.d, floor, settings.tolerance, ahead)
        balance, error, whole = found.balance, found.error, found.whole
        # While points open and close, that is what spoils an iteration, not the age of the factor.
        poor += float(error.max()) > POOR_REDUCTION * before and _touched(balance) == touched
    raise NoEquilibriumError(_text(system, settings, error, changes, in_vain(history, around)))


def _query(loading: Loading) -> ContactQuery:
    assert loading.query is not None
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
    return tuple(Change(np.where(kind, change, 0.0),
                        max(float(np.abs(size[kind]).max(initial=0.0)), np.finfo(float).tiny), kind is tied)
                 for kind in (~tied, tied) if kind.any())


def _text(system: System, settings: SolverSettings, error: Floats, changes: Changes, vain: str) -> str:
    if float(error.max()) > settings.tolerance:
        body = system.interface.bodies[int(np.argmax(error))]
        forces = (f"the forces on body {body} are out of balance by {float(error.max()):.3g} "
                  f"(tolerance {settings.tolerance:g})")
        # fault: pressures that stay are said to change -> if False: | mechanical_fmu/test_semi_smooth
        if not any(change.by.any() for change in changes):
            return f"{vain}: {forces}"
        forces += " and "
    else:
        forces = ""
    how_much, where = unsettled(system, changes)
    return (f"{vain}: {forces}the contact pressures {how_much}, most on "
            f"{where}; method: uzawa settles them in rounds")


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
    name = system.spec.enforcement if loading.query is not None else "penalty"
    return ENFORCEMENTS[name](system, loading, start, anchor, settings)
