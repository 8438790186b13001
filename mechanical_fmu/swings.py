"""A small swing of rigid bodies on the springs of their contact: it dies away, as such bodies have none.

A rigid body that lies on a surface sinks into it by as much as its penalty asks for.  Put there without load, or under
a load that jumps, it swings about that depth for ever, and its pressure goes from nothing to twice what it bears.
Friction is then too weak in every swing, and what should stick slips.  Of a rigid body on a stiffer and stiffer
surface nothing is left of the swing; what is thrown up and bounces keeps its height.  So a swing that no drop makes is
led to the depth at which the body lies: one no larger than that of a body that fell by about this depth, or as high as
surfaces are exact.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contact.half.diagnostics import edge_lengths
from contact.half.linalg import factorise
from mechanical_fmu.dynamics import BodyMotion
from mechanical_fmu.groups import Groups
from mechanical_fmu.rubbing_pairs import ContactStiffness
from mechanical_fmu.tangent import constrained

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# The square of a swing to that of a body put on its surface without load, which is 1: larger ones bounce.  One that
# falls by its depth has 3.
SMALL = 4.0
# Of the shortest edge, how high what bounces goes that nobody drew: surfaces are no more exact.
HOP = 1e-4
# The square of what contact bears too much or too little, of what it has to: near its rest a swing tells its size.
NEAR = 0.25
# The square of a step, in radians of the swing: in longer ones what lies is laid at once (coming_to_rest.py).
RESOLVED = 4.0
# Of the stiffness of contact, that of the mass by which directions without contact are told from those with it.
SLIGHT = 1e-2


def led_to_rest(groups: Groups, after: BodyMotion, contact: ContactStiffness, here: Flags) -> BodyMotion:
    """Return the motion at the end of a step, without small swings across what bodies lie on.

    here : (n_bodies,) of which.  contact : as it is then.
    """
    system = groups.system
    if system.contact.tied is not None:
        return after
    others = contact.others(after)
    by = [contact.yields(x) for x in (after.v.ravel(), after.a.ravel(), others)]
    stiffness = others * (contact.across @ others)
    for group in np.unique(groups.label[here & (groups.label >= 0)]):
        rows = groups.rows(groups.label == group)
        of_v, of_a, without = (float(rows @ x) for x in by)
        stiff, pressed = float(rows @ stiffness), float(rows @ (after.push.ravel() * others)) < 0.0
        if not pressed or not stiff > 0.0 or not without > 0.0:
            continue
        rate, dt = without / stiff, contact.loading.step.dt
        height = 0.5 * float((np.abs(others) * rows).max()) * of_v / without
        # fault: what bounces is led to rest -> bounces = False | mechanical_fmu/test_swings
        bounces = rate * of_v > SMALL * without and height > HOP * _shortest_edge(groups)
        # fault: a small swing lasts for ever -> if True: | mechanical_fmu/test_swings
        if dt**2 * rate > RESOLVED or of_a > NEAR * without or bounces:
            continue
        after = _slowed(after, contact, rate, rows)
    return after


def _slowed(after: BodyMotion, contact: ContactStiffness, rate: float, rows: Floats) -> BodyMotion:
    """The motion of bodies that go to their rest no faster than by a half in some two thirds of a radian of the swing.

    rate : the square of the swing [1/s2].  rows : (n,) 1.0 for their components.
    """
    system, K, M = contact.system, contact.across, contact.mass
    free, moving = system.constraints.free, system.moving * rows
    solve = factorise(constrained(system, contact.with_mass(SLIGHT * rate) + K))

    def across(x: Floats) -> Floats:
        """The part of a motion that contact opposes."""
        return np.asarray(solve(K @ x * free)) * moving

    left = across(np.asarray(solve(M @ after.a.ravel() * free)) * moving)
    goal, now = left / max(contact.loading.step.dt, rate**-0.5), across(after.v.ravel() * rows)
    # In the measure of the mass, as energy is.
    share, whole = float(goal @ (M @ now)), float(goal @ (M @ goal))
    if 0.0 <= share <= whole:
        return after
    # What goes away from its rest stops.
    # fault: what goes away from its rest goes faster towards it -> pass | mechanical_fmu/test_swings
    goal = goal if share > 0.0 else np.zeros_like(goal)
    return replace(after, v=after.v + (goal - now).reshape(after.v.shape))


def _shortest_edge(groups: Groups) -> float:
    """Length [m] of the shortest edge of all surfaces of pairs, as drawn."""
    interface = groups.system.interface
    return float(min(edge_lengths(interface, side).min() for pair in interface.pairs
                     for side in (pair.slave, pair.master)))
