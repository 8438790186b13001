"""Pairs with friction that touch: which way it acts on bodies with inertia, and how stiff contact is there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.linalg import factorise
from mechanical_fmu.contact import ContactQuery
from mechanical_fmu.dynamics import BodyMotion
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import constrained, stiffness

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

FREE = 1e-60  # of the stiffness by which surfaces stick: none


@dataclass(frozen=True)
class RubbingPairs:
    """Pairs with friction that touch at an end of a step.

    nodes : (k, n_q) pair nodes of each that touch.  push : (k, n) [N] friction of each at Coulomb's bound, all one way.
    share : (k,) [1] of that it has.  sticks : (k,) whether no point of it slips.
    """

    nodes: Flags
    push: Floats
    share: Floats
    sticks: Flags

    def only(self, which: NDArray[np.intp]) -> RubbingPairs:
        """Return some of them."""
        return RubbingPairs(self.nodes[which], self.push[which], self.share[which], self.sticks[which])


@dataclass(frozen=True)
class ContactStiffness:
    """Contact at an end of a step, found : the balance there, under loading."""

    system: System
    found: ForceBalance
    loading: Loading

    @cached_property
    def alone(self) -> csr_matrix:
        """All stiffness (n, n) [N/m] but that of contact."""
        free = replace(self.loading, query=None)
        return stiffness(self.system, self.system.balance(self.found.u, free, tangent=True), free)

    @cached_property
    def across(self) -> csr_matrix:
        """That of contact without friction, (n, n) [N/m]."""
        return self.stiffness(self._none)

    @cached_property
    def springs(self) -> csr_matrix:
        """That by which surfaces stick, (n, n) [N/m]."""
        return csr_matrix(self.stiffness(self._none, 1.0) - self.across)

    def others(self, motion: BodyMotion) -> Floats:
        """Return (n,) [m/s2] the acceleration by all but contact.  motion : with what acts then."""
        free = self.system.constraints.free
        return np.asarray(self.system.accelerations(-(motion.f + motion.push).ravel() * free)) * self.system.moving

    def yields(self, x: Floats) -> Floats:
        """Return (n,) by component, how much what contact does by a motion x moves; its sums of a group are >= 0."""
        force = self.across @ x
        return np.asarray(force * self.system.accelerations(force * self.system.constraints.free) * self.system.moving)

    @property
    def scale(self) -> float:
        """What the mass is multiplied by in the stiffness of the step [1/s2]."""
        how, dt = self.system.spec.dynamics, self.loading.step.dt
        assert how is not None
        return (1.0 - how.alpha_m) / ((1.0 - how.alpha_f) * how.beta * dt**2)

    @property
    def mass(self) -> csr_matrix:
        """The mass, (n, n) [kg]."""
        how = self.system.spec.dynamics
        return self.system.masses.matrix(how is None or how.lumped)

    def with_mass(self, scale: float) -> csr_matrix:
        """Return all stiffness but that of contact, (n, n) [N/m], with scale [1/s2] times the mass."""
        return csr_matrix(self.alone + (scale - self.scale) * self.mass)

    @property
    def _none(self) -> Floats:
        assert self.found.tractions is not None
        return np.zeros(self.found.tractions.t_N.size)

    def unresolved(self, push: Floats, gives: Floats) -> Flags:
        """Say, (k,), whether a step resolves no swing of pairs on the springs by which they stick.

        push : (k, n) [N] of each at the bound.  gives : (k,) [N m] what each does along it in the step.
        """
        stiff = np.array([p @ (self.springs @ p) / (p @ p) ** 2 for p in push])
        # fault: what swings on the spring of sticking is stopped -> return np.asarray(gives * stiff > 1e-9) |
        #   mechanical_fmu/test_stick_slip
        return np.asarray(gives * stiff >= 1.0)

    def stiffness(self, mobilised: Floats, sticking: float = FREE) -> csr_matrix:
        """Return that of contact, (n, n) [N/m].

        mobilised : as of with_friction.  sticking : share of the stiffness by which surfaces stick.
        """
        query = replace(with_friction(self.system, self.found, self.loading, mobilised), sticking=sticking)
        with_it = replace(self.loading, query=query)
        K = stiffness(self.system, self.system.balance(self.found.u, with_it, tangent=True), with_it)
        return csr_matrix(K - self.alone)


def rubbing_pairs(system: System, found: ForceBalance, loading: Loading) -> RubbingPairs | None:
    """Find the pairs with friction that touch; None without any."""
    tractions = found.tractions
    assert tractions is not None
    touches = tractions.t_N < 0.0
    named = [(pair.mu, nodes) for pair in system.interface.pairs if pair.mu > 0.0 and not pair.tied
             and (nodes := system.contact.on_slaves([pair.name]) & touches).any()]
    if not named:
        return None
    none = force_with(system, found, loading, np.zeros(touches.size))
    push = np.array([force_with(system, found, loading, np.where(nodes, mu, 0.0)) - none for mu, nodes in named])
    share = [float((tractions.mobilised * tractions.t_N)[nodes].sum() / (mu * tractions.t_N[nodes].sum()))
             for mu, nodes in named]
    return RubbingPairs(np.array([nodes for _, nodes in named]), push.reshape(len(named), -1), np.array(share),
                  np.array([not tractions.slipping[nodes].any() for _, nodes in named]))


def with_friction(system: System, found: ForceBalance, loading: Loading, mobilised: Floats) -> ContactQuery:
    """Make the query of contact as it is at the end of a step; mobilised : (n_q,) [1] friction over pressure."""
    assert loading.query is not None
    query, x = loading.query, system.interface.nodes + found.u[: len(system.interface.nodes)]
    x = x + query.away if query.away.size else x
    history = replace(query.history, multipliers=query.multipliers, mobilised=mobilised, mobilised_at=np.empty((0, 3)),
                      x=np.ascontiguousarray(x[system.interface.contact_nodes]))
    return replace(query, history=history)


def force_with(system: System, found: ForceBalance, loading: Loading, mobilised: Floats) -> Floats:
    """Compute contact forces (n, 2) [N] with that friction, as of a motion."""
    x = system.interface.nodes + found.u[: len(system.interface.nodes)]
    force = system.contact.force(with_friction(system, found, loading, mobilised)(x))
    return force if system.rigid is None else system.rigid.reduced(force, found.u)


@dataclass(frozen=True)
class Answer:
    """How bodies answer in a step to an impulse, with contact that neither sticks nor lets go, and slips where it does.

    K, contact : (n, n) [N/m] of inertia and contact, and contact's part.  scale [1/s2] : of the mass in K.
    rubs : (n_q,) pair nodes that slip on.
    """

    system: System
    K: csr_matrix
    contact: csr_matrix
    scale: float
    rubs: Flags

    def solve(self, f: Floats) -> Floats:
        """Return K^-1 f, (n,), of forces (n,) [N] on what is free."""
        return np.asarray(self._factor(f * self.system.constraints.free)) * self.system.moving

    @cached_property
    def _factor(self) -> Callable[[Floats], Floats]:
        return factorise(constrained(self.system, self.K))


def answer_of(contact: ContactStiffness, stopped: RubbingPairs | None) -> Answer:
    """Make the answer to impulses in a step whose friction was `stopped` at these pairs, None: at none."""
    system, tractions = contact.system, contact.found.tractions
    assert tractions is not None
    # Friction that slips grows with the pressure; what was stopped, or sticks, is left to coming_to_rest.
    rubs = tractions.slipping > 0.5
    if stopped is not None:
        rubs &= ~stopped.nodes.any(axis=0)
    # fault: friction does not follow the pressure that a body lies with -> beyond = 0.0 * tractions.mobilised |
    #   mechanical_fmu/test_friction_inertia
    beyond = np.where(rubs, 2.0 * tractions.mobilised, 0.0)
    own = contact.stiffness(beyond)
    return Answer(system, csr_matrix(contact.alone + own), own, contact.scale, rubs)


def pushed(motion: BodyMotion, dv: Floats, da: Floats, push: Floats) -> BodyMotion:
    """Return the motion with more velocity dv [m/s], acceleration da [m/s2] and contact force push [N], (n,) each."""
    shape = motion.v.shape
    return replace(motion, v=motion.v + dv.reshape(shape), a=motion.a + da.reshape(shape),
                   push=motion.push + push.reshape(shape), f=motion.f - push.reshape(shape))
