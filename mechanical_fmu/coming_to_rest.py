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

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from mechanical_fmu.dynamics import BodyMotion, Rubbing
from mechanical_fmu.rubbing_pairs import Answer, ContactStiffness, RubbingPairs, answer_of, pushed, rubbing_pairs
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
    if np.abs(after.push[system.masses.without]).max(initial=0.0) > 0.0:
        return after, np.empty(0)
    rubs = rubbing_pairs(system, found, loading)
    after = _seen(after, rubs)
    stopped = _stopped(after, rubs, loading.step.dt)
    contact, none = ContactStiffness(system, found, loading), np.zeros(tractions.t_N.size)
    across = contact.stiffness(none)
    lies = _lies(system, after, loading, across)
    if stopped is None and not lies:
        return after, np.empty(0)
    answer = answer_of(contact, stopped)
    rest, heat = _laid(after, found, answer) if lies else (after, np.empty(0))
    if stopped is None:
        return rest, heat
    rest, more = _held_up(rest, found, stopped, answer, csr_matrix(contact.stiffness(none, 1.0) - across))
    return rest, heat + more if heat.size and more.size else (heat if heat.size else more)


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


def _laid(after: BodyMotion, found: ForceBalance, answer: Answer) -> tuple[BodyMotion, Floats]:
    """The motion of what lies on a surface, and the heat (n_q,) [J] of its friction."""
    v, a = after.v.ravel(), after.a.ravel()
    dv, da = -answer.solve(answer.contact @ v), -answer.solve(answer.contact @ a)
    rest = pushed(after, dv, da, -(answer.contact @ (a + da)) / answer.scale)
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


def _held_up(after: BodyMotion, found: ForceBalance, stopped: RubbingPairs, answer: Answer,
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
    rest = pushed(after, slower, more, jump)
    lost = 0.5 * float(v @ (answer.M @ v) - rest.v.ravel() @ (answer.M @ rest.v.ravel()))
    here = stopped.nodes[pairs]
    return replace(rest, rubbing=_rubbing(after.rubbing, here, share)), _spread(found, here, push @ v, lost)


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
