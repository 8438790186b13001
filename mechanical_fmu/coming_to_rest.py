"""What comes to rest on a surface in a step with inertia: no speed along its friction, and none into the surface.

The trapezoidal rule forgets nothing.  Slip that turns round within a step leaves a small speed backwards at its
end, and a friction of the old way.  In the next step the body sticks, so that it goes nowhere, and the rule gives it
the opposite speed and the opposite friction, and so on for ever; where that is beyond Coulomb's bound it slips for no
reason and makes heat.  A body that lies on a surface does the same with its weight in steps that are long beside its
swing on the contact, and begins to hop.  Schemes for rigid bodies in contact let neither happen (Moreau 1988): what
sticks is at rest, and what lies on a surface goes along with it.

Here the end of such a step gets impulses of its contact.  Along the friction of a pair that sticks, or slipped and
turns round, one that leaves no speed along it: its energy is of the way that friction still had to brake, and becomes
heat.  Of the friction at the bound that much is kept which leaves no acceleration along it either; where that is more
than the bound, slip goes on backwards.  A swing on the spring of sticking that steps resolve is left alone.

Across a surface the impulse is that by which contact answers in the step itself, of a body that would be back on it
within a step: whose speed away from it, or into it, is less than what all other forces make of it in half of one, and
whose acceleration is no more than a few times as large as theirs.  What bounces, or swings on its contact in steps that
resolve that, is faster.

Nodes without mass need none of this: contact changes there as the body behind them is strained.  A scene is looked at
as a whole: where such nodes touch, where one body bounces, or where a pair is tied, the others are left as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.linalg import factorise
from mechanical_fmu.contact import ContactQuery
from mechanical_fmu.dynamics import BodyMotion, Rubbing
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import constrained, stiffness

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

PRESSED = 10.0  # the square of an acceleration on contact to that without: of what lies, and rings there, 1
FREE = 1e-60  # of the stiffness by which surfaces stick: none


@dataclass(frozen=True)
class _Answer:
    """How bodies answer in a step to an impulse, with contact that neither sticks nor lets go, and slips where it does.

    K, contact : (n, n) [N/m] of inertia and contact, and contact's part.  M : (n, n) [kg], scale [1/s2] of it in K.
    rubs : (n_q,) pair nodes that slip on.
    """

    system: System
    K: csr_matrix
    contact: csr_matrix
    M: csr_matrix
    scale: float
    rubs: Flags

    def solve(self, f: Floats) -> Floats:
        """Return K^-1 f, (n,), of forces (n,) [N] on what is free."""
        return np.asarray(self._factor(f * self.system.constraints.free)) * self.system.moving

    @cached_property
    def _factor(self) -> Callable[[Floats], Floats]:
        return factorise(constrained(self.system, self.K))


@dataclass(frozen=True)
class _Pairs:
    """Pairs with friction that touch at the end of a step.

    nodes : (k, n_q) pair nodes of each that touch.  push : (k, n) [N] friction of each at Coulomb's bound, all one way.
    share : (k,) [1] of that it has.  sticks : (k,) whether no point of it slips.
    """

    nodes: Flags
    push: Floats
    share: Floats
    sticks: Flags

    def only(self, which: NDArray[np.intp]) -> _Pairs:
        """Return some of them."""
        return _Pairs(self.nodes[which], self.push[which], self.share[which], self.sticks[which])


def brought_to_rest(system: System, after: BodyMotion, found: ForceBalance,
                    loading: Loading) -> tuple[BodyMotion, Floats]:
    """Return the motion at the end of a step, and the heat, (n_q,) [J], of slip that ends with it, (0,) of none.

    after : the motion there, with how it rubs.  found : the balance there, under loading.
    """
    tractions = found.tractions
    if tractions is None or loading.query is None or not tractions.n_touching or loading.inertia is None:
        return after, np.empty(0)
    if np.abs(after.push[system.masses.without]).max(initial=0.0) > 0.0:
        return after, np.empty(0)
    rubs = _rubs(system, found, loading)
    after = _seen(after, rubs)
    stopped = _stopped(after, rubs)
    contact, none = _Contact(system, found, loading), np.zeros(tractions.t_N.size)
    across = contact.stiffness(none)
    lies = _lies(system, after, loading, across)
    if stopped is None and not lies:
        return after, np.empty(0)
    answer = _answer(contact, stopped)
    rest, heat = _laid(after, found, answer) if lies else (after, np.empty(0))
    if stopped is None:
        return rest, heat
    rest, more = _held_up(rest, found, stopped, answer, csr_matrix(contact.stiffness(none, 1.0) - across))
    return rest, heat + more if heat.size and more.size else (heat if heat.size else more)


@dataclass(frozen=True)
class _Contact:
    """Contact at the end of a step, found : the balance there, under loading."""

    system: System
    found: ForceBalance
    loading: Loading

    @cached_property
    def alone(self) -> csr_matrix:
        """All stiffness (n, n) [N/m] but that of contact."""
        free = replace(self.loading, query=None)
        return stiffness(self.system, self.system.balance(self.found.u, free, tangent=True), free)

    def stiffness(self, mobilised: Floats, sticking: float = FREE) -> csr_matrix:
        """Return that of contact, (n, n) [N/m].

        mobilised : as of _query.  sticking : share of the stiffness by which surfaces stick.
        """
        query = replace(_query(self.system, self.found, self.loading, mobilised), sticking=sticking)
        with_it = replace(self.loading, query=query)
        K = stiffness(self.system, self.system.balance(self.found.u, with_it, tangent=True), with_it)
        return csr_matrix(K - self.alone)


def _answer(contact: _Contact, stopped: _Pairs | None) -> _Answer:
    system, how, tractions = contact.system, contact.system.spec.dynamics, contact.found.tractions
    assert how is not None
    assert tractions is not None
    # Friction that slips grows with the pressure; what was stopped, or sticks, is left to `_held_up`.
    rubs = tractions.slipping > 0.5
    if stopped is not None:
        rubs &= ~stopped.nodes.any(axis=0)
    # fault: friction does not follow the pressure that a body lies with -> beyond = 0.0 * tractions.mobilised |
    #   mechanical_fmu/test_friction_inertia
    beyond = np.where(rubs, 2.0 * tractions.mobilised, 0.0)
    own, dt = contact.stiffness(beyond), contact.loading.step.dt
    scale = (1.0 - how.alpha_m) / ((1.0 - how.alpha_f) * how.beta * dt**2)
    return _Answer(system, csr_matrix(contact.alone + own), own, system.masses.matrix(how.lumped), scale, rubs)


def _lies(system: System, after: BodyMotion, loading: Loading, across: csr_matrix) -> bool:
    """Whether bodies that touch would be back within a step, if contact threw them.

    across : (n, n) [N/m] stiffness of contact without friction.
    """
    # What is tied hangs on springs that no body lies on.
    # fault: a swing on ties is damped -> if False: | mechanical_fmu/test_stick_slip
    if system.contact.tied is not None:
        return False
    others = system.accelerations(-(after.f + after.push).ravel() * system.constraints.free) * system.moving
    v, a, without = (float(x @ (across @ x)) for x in (after.v.ravel(), after.a.ravel(), others))
    # fault: what lies on a surface hops on it -> return False | mechanical_fmu/test_coming_to_rest
    # fault: what bounces loses its energy -> return True | mechanical_fmu/test_coming_to_rest
    return without > 0.0 and v <= (0.5 * loading.step.dt)**2 * without and a <= PRESSED * without


def _laid(after: BodyMotion, found: ForceBalance, answer: _Answer) -> tuple[BodyMotion, Floats]:
    """The motion of what lies on a surface, and the heat (n_q,) [J] of its friction."""
    v, a = after.v.ravel(), after.a.ravel()
    dv, da = -answer.solve(answer.contact @ v), -answer.solve(answer.contact @ a)
    rest = _pushed(after, dv, da, -(answer.contact @ (a + da)) / answer.scale)
    if not answer.rubs.any():
        return rest, np.empty(0)
    # What power contact has is that of friction.
    was, now = (float(push.ravel() @ rest.v.ravel()) for push in (after.push, rest.push))
    if was < 0.0:
        rest = replace(rest, rubbing=replace(after.rubbing, force=after.rubbing.force * (now / was)))
    # Friction grew and fell with the impulse that took the speed.
    # fault: friction of what lies down makes no heat -> lost = 0.0 | mechanical_fmu/test_friction_inertia
    lost = float((answer.contact @ (v + dv)) @ (v + 0.5 * dv)) / answer.scale
    return rest, _spread(found, answer.rubs[None], np.ones(1), lost)


def _held_up(after: BodyMotion, found: ForceBalance, stopped: _Pairs, answer: _Answer,
             springs: csr_matrix) -> tuple[BodyMotion, Floats]:
    """The motion of what sticks, or slips back, and the heat (n_q,) [J] of the speed along its friction.

    springs : (n, n) [N/m] of sticking.  Of pairs whose swing on them steps resolve nothing is taken.
    """
    ways = np.array([answer.solve(push) for push in stopped.push])
    gives = stopped.push @ ways.T
    stiff = np.array([p @ (springs @ p) / (p @ p) ** 2 for p in stopped.push])
    # fault: what swings on the spring of sticking is stopped -> pairs = np.flatnonzero(np.diag(gives) * stiff > 1e-9) |
    #   mechanical_fmu/test_stick_slip
    pairs = np.flatnonzero(np.diag(gives) * stiff >= 1.0)
    if not pairs.size:
        return after, np.empty(0)
    push, ways, gives, held = stopped.push[pairs], ways[pairs], gives[np.ix_(pairs, pairs)], stopped.share[pairs]
    v, a, scale = after.v.ravel(), after.a.ravel(), answer.scale
    # fault: what sticks keeps a speed -> slower = 0.0 * v | mechanical_fmu/test_coming_to_rest
    slower = -np.linalg.solve(gives, push @ v) @ ways
    # Friction along each pair that leaves no acceleration, as far as the bound allows.
    more = -np.linalg.solve(gives, push @ a) / scale
    # fault: friction after slip turned is beyond its bound -> share = held + more | mechanical_fmu/test_coming_to_rest
    share = np.clip(held + more, -1.0, 1.0)
    more = scale * (share - held) @ ways
    jump = (share - held) @ push - (answer.contact @ more) / scale
    rest = _pushed(after, slower, more, jump)
    lost = 0.5 * float(v @ (answer.M @ v) - rest.v.ravel() @ (answer.M @ rest.v.ravel()))
    here = stopped.nodes[pairs]
    return replace(rest, rubbing=_rubbing(after.rubbing, here, share)), _spread(found, here, push @ v, lost)


def _pushed(motion: BodyMotion, dv: Floats, da: Floats, push: Floats) -> BodyMotion:
    shape = motion.v.shape
    return replace(motion, v=motion.v + dv.reshape(shape), a=motion.a + da.reshape(shape),
                   push=motion.push + push.reshape(shape), f=motion.f - push.reshape(shape))


def _rubs(system: System, found: ForceBalance, loading: Loading) -> _Pairs | None:
    """The pairs with friction that touch; None without any."""
    tractions = found.tractions
    assert tractions is not None
    touches = tractions.t_N < 0.0
    named = [(pair.mu, nodes) for pair in system.interface.pairs if pair.mu > 0.0 and not pair.tied
             and (nodes := system.contact.on_slaves([pair.name]) & touches).any()]
    if not named:
        return None
    none = _force(system, found, loading, np.zeros(touches.size))
    push = np.array([_force(system, found, loading, np.where(nodes, mu, 0.0)) - none for mu, nodes in named])
    share = [float((tractions.mobilised * tractions.t_N)[nodes].sum() / (mu * tractions.t_N[nodes].sum()))
             for mu, nodes in named]
    return _Pairs(np.array([nodes for _, nodes in named]), push.reshape(len(named), -1), np.array(share),
                  np.array([not tractions.slipping[nodes].any() for _, nodes in named]))


def _seen(after: BodyMotion, rubs: _Pairs | None) -> BodyMotion:
    """The motion with the speed along its friction as it is, where that is known."""
    size = float(np.abs(after.rubbing.force).sum())
    if rubs is None or not size > 0.0:
        return after
    power = float((rubs.share * ~rubs.sticks) @ (rubs.push @ after.v.ravel()))
    return replace(after, rubbing=replace(after.rubbing, along=-power / size))


def _stopped(after: BodyMotion, rubs: _Pairs | None) -> _Pairs | None:
    """Those that stick, or slip on the other way than they did: friction helps them on."""
    if rubs is None:
        return None
    stop = rubs.sticks | (rubs.share * (rubs.push @ after.v.ravel()) > 0.0)
    return rubs.only(np.flatnonzero(stop)) if stop.any() else None


def _query(system: System, found: ForceBalance, loading: Loading, mobilised: Floats) -> ContactQuery:
    """Contact as it is at the end of a step, with friction : (n_q,) [1] of the pressure at pair nodes."""
    assert loading.query is not None
    query, x = loading.query, system.interface.nodes + found.u[: len(system.interface.nodes)]
    history = replace(query.history, multipliers=query.multipliers, mobilised=mobilised, mobilised_at=np.empty((0, 3)),
                      x=np.ascontiguousarray(x[system.interface.contact_nodes]))
    return replace(query, history=history)


def _force(system: System, found: ForceBalance, loading: Loading, mobilised: Floats) -> Floats:
    """Contact forces (n, 2) [N] with that friction, as of a motion."""
    x = system.interface.nodes + found.u[: len(system.interface.nodes)]
    force = system.contact.force(_query(system, found, loading, mobilised)(x))
    return force if system.rigid is None else system.rigid.reduced(force, found.u)


def _rubbing(before: Rubbing, nodes: Flags, share: Floats) -> Rubbing:
    """How they rub on: not at all, or backwards at Coulomb's bound.  share : (k,) of that."""
    force, rate = before.force.copy(), before.rate.copy()
    for here, s in zip(nodes, share, strict=True):
        # Friction that is positive acts on what slips backwards.
        force[here] = -np.sign(s) * np.abs(force[here]) if abs(s) == 1.0 else 0.0
        rate[here] = 0.0
    return replace(before, force=force, rate=rate)


def _spread(found: ForceBalance, nodes: Flags, power: Floats, lost: float) -> Floats:
    """Heat (n_q,) [J] of energy that was lost, by the pairs' part of it and the pressure at their nodes."""
    assert found.tractions is not None
    pressure = np.abs(found.tractions.t_N) * nodes
    by = np.abs(power) / max(float(np.abs(power).sum()), float(np.finfo(float).tiny))
    return np.asarray(lost * by @ (pressure / pressure.sum(axis=1, keepdims=True)))
