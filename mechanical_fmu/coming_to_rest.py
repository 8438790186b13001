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
whose acceleration is no more than a few times as large as theirs.  What bounces is faster; swings that steps resolve
are of swings.py.

Nodes without mass need none of this: contact changes there as the body behind them is strained.  Bodies that touch are
looked at together: a group in which such nodes touch is left as it is, and so is one that bounces, across.  Nothing is
taken to lie where a pair is tied.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.dynamics import BodyMotion, Rubbing
from mechanical_fmu.groups import Groups, alone, groups_of
from mechanical_fmu.rubbing_pairs import (
    Answer,
    ContactStiffness,
    RubbingPairs,
    answer_of,
    force_with,
    pushed,
    rubbing_pairs,
)
from mechanical_fmu.swings import led_to_rest
from mechanical_fmu.system import ForceBalance, Loading, System

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

AT_REST = 1e-4  # of the speed that what acts makes in a step: slower is none
PRESSED = 10.0  # the square of an acceleration on contact to that without: of what lies, and rings there, 1
FREE = 1e-60  # of the stiffness by which surfaces stick: none


def brought_to_rest(system: System, after: BodyMotion, found: ForceBalance,
                    loading: Loading) -> tuple[BodyMotion, Floats]:
    """Return the motion at the end of a step, and the heat, (n_q,) [J], of slip that ends with it, (0,) of none.

    after : the motion there, with how it rubs.  found : the balance there, under loading.
    """
    tractions = found.tractions
    if tractions is None or loading.query is None or not tractions.n_touching or loading.inertia is None:
        return after, np.empty(0)
    groups = groups_of(system, tractions)
    here = groups.rigid_ones(after)
    if not (here & (groups.label >= 0)).any():
        return after, np.empty(0)
    found, loading = alone(groups, found, loading, here)
    rubs = rubbing_pairs(system, found, loading)
    after = _seen(after, rubs) if here.all() else after
    stopped = _stopped(after, rubs, loading.step.dt)
    contact = ContactStiffness(system, found, loading)
    after = led_to_rest(groups, after, contact, here)
    lying = _lying(groups, after, contact, here)
    if stopped is None and not lying.any():
        return after, np.empty(0)
    answer = answer_of(contact, stopped)
    rest, heat = after, np.empty(0)
    if lying.any():
        lie = lying | (groups.label < 0)
        as_before = np.array_equal(lie, here)
        only = contact if as_before else ContactStiffness(system, *alone(groups, found, loading, lie))
        rest, heat = _laid(after, only, answer if as_before else answer_of(only, stopped), groups.rows(lie))
    if stopped is None:
        return rest, heat
    rest, more = _held_up(rest, contact, stopped, answer)
    return rest, heat + more if heat.size and more.size else (heat if heat.size else more)


def _lying(groups: Groups, after: BodyMotion, contact: ContactStiffness, here: Flags) -> Flags:
    """Say, (n_bodies,), which lie on what they touch: they would be back within a step, if contact threw them.

    contact : of bodies that are here : (n_bodies,).
    """
    system, none = groups.system, np.zeros_like(here)
    # What is tied hangs on springs that no body lies on.
    # fault: a swing on ties is damped -> if False: | mechanical_fmu/test_stick_slip
    if system.contact.tied is not None:
        return none
    lying = none.copy()
    by = [contact.yields(x) for x in (after.v.ravel(), after.a.ravel(), contact.others(after))]
    for group in np.unique(groups.label[here & (groups.label >= 0)]):
        bodies = groups.label == group
        rows = groups.rows(bodies)
        v, a, without = (float(rows @ x) for x in by)
        # fault: what lies on a surface hops on it -> lies = False | mechanical_fmu/test_coming_to_rest
        # fault: what bounces loses its energy -> lies = True | mechanical_fmu/test_coming_to_rest
        lies = without > 0.0 and v <= (0.5 * contact.loading.step.dt)**2 * without and a <= PRESSED * without
        lying |= bodies & lies
    return lying


def _laid(after: BodyMotion, contact: ContactStiffness, answer: Answer, rows: Floats) -> tuple[BodyMotion, Floats]:
    """The motion with bodies that lie on a surface at rest across it, and the heat (n_q,) [J] of their friction.

    contact : of these alone, and answer to it.  rows : (n,) 1.0 for their components, and for what they lie on.
    """
    v, a = after.v.ravel() * rows, after.a.ravel() * rows
    dv, da = -answer.solve(answer.contact @ v), -answer.solve(answer.contact @ a)
    more = -(answer.contact @ (a + da)) / answer.scale
    rest = pushed(after, dv, da, more)
    if not answer.rubs.any():
        return rest, np.empty(0)
    # What power contact has is that of friction.
    tractions, found = contact.found.tractions, contact.found
    assert tractions is not None
    assert contact.loading.query is not None
    push = after.push
    if contact.loading.query.away.size:
        # fault: what other bodies rub counts as friction of these -> pass | mechanical_fmu/test_groups
        push = force_with(contact.system, found, contact.loading, tractions.mobilised)
    was, now = float(push.ravel() @ (v + dv)), float((push.ravel() + more) @ (v + dv))
    if was < 0.0:
        force = after.rubbing.force
        rest = replace(rest, rubbing=replace(after.rubbing, force=np.where(answer.rubs, force * (now / was), force)))
    # Friction grew and fell with the impulse that took the speed.
    # fault: friction of what lies down makes no heat -> lost = 0.0 | mechanical_fmu/test_friction_inertia
    lost = float((answer.contact @ (v + dv)) @ (v + 0.5 * dv)) / answer.scale
    return rest, _spread(found, answer.rubs[None], np.ones(1), lost)


def _held_up(after: BodyMotion, contact: ContactStiffness, stopped: RubbingPairs,
             answer: Answer) -> tuple[BodyMotion, Floats]:
    """The motion of what sticks, or slips back, and the heat (n_q,) [J] of the speed along its friction.

    Of pairs whose swing on the springs of sticking steps resolve nothing is taken.
    """
    ways = np.array([answer.solve(push) for push in stopped.push])
    gives = stopped.push @ ways.T
    pairs = np.flatnonzero(contact.unresolved(stopped.push, np.diag(gives)))
    if not pairs.size:
        return after, np.empty(0)
    push, ways, gives, held = stopped.push[pairs], ways[pairs], gives[np.ix_(pairs, pairs)], stopped.share[pairs]
    v, a, scale = after.v.ravel(), after.a.ravel(), answer.scale
    slip = push @ v
    # fault: what sticks keeps a speed -> slower = 0.0 * v | mechanical_fmu/test_coming_to_rest
    slower = -np.linalg.solve(gives, slip) @ ways
    # Friction along each pair that leaves no acceleration, as far as the bound allows.
    more = -np.linalg.solve(gives, push @ a) / scale
    # fault: friction after slip turned is beyond its bound -> share = held + more | mechanical_fmu/test_coming_to_rest
    share = np.clip(held + more, -1.0, 1.0)
    more = scale * (share - held) @ ways
    jump = (share - held) @ push - (answer.contact @ more) / scale
    rest = pushed(after, slower, more, jump)
    # Of an impulse by the speed along it, half of which is left on the mean: what a belt does is no heat.
    # fault: what comes to rest makes no heat -> lost = 0.0 | mechanical_fmu/test_groups
    lost = 0.5 * float(slip @ np.linalg.solve(gives, slip)) / scale
    here = stopped.nodes[pairs]
    return replace(rest, rubbing=_rubbing(after.rubbing, here, share)), _spread(contact.found, here, slip, lost)


def _seen(after: BodyMotion, rubs: RubbingPairs | None) -> BodyMotion:
    """The motion with the speed along its friction as it is, where that is known."""
    size = float(np.abs(after.rubbing.force).sum())
    if rubs is None or not size > 0.0:
        return after
    power = float((rubs.share * ~rubs.sticks) @ (rubs.push @ after.v.ravel()))
    return replace(after, rubbing=replace(after.rubbing, along=-power / size))


def _stopped(after: BodyMotion, rubs: RubbingPairs | None, dt: float) -> RubbingPairs | None:
    """Those that stick, have come to rest, or slip on the other way than they did: friction helps them on."""
    if rubs is None:
        return None
    along, turns = rubs.push @ after.v.ravel(), np.abs(rubs.push) @ np.abs(after.a.ravel()) * dt
    # fault: what has just come to rest slips on -> stop = rubs.sticks | (rubs.share * along > 0.0) |
    #   mechanical_fmu/test_kinks
    stop = rubs.sticks | (rubs.share * along > -AT_REST * turns)
    return rubs.only(np.flatnonzero(stop)) if stop.any() else None


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
