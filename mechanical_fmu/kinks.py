"""Friction at the start of a step in which a prescribed motion has another velocity than before.

A motion given by a table has a kink at each time of it: a driven surface has another velocity from there on at once.
Where that is the other way along its friction, or a body stuck to it, friction is another one at once, too.  The
trapezoidal rule takes half of the friction of before all the same, and no halving of a window sees it: each of them
begins at the kink.  So a step begins with the friction behind its kink.  Where that stops the slip within the step, a
piece of the step ends there: from then on the bodies may stick.

Nodes without mass need none of this: their friction is that of the places found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.dynamics import BodyMotion, Rubbing
from mechanical_fmu.groups import alone, groups_of
from mechanical_fmu.rubbing_pairs import ContactStiffness, RubbingPairs, answer_of, force_with, pushed, rubbing_pairs
from mechanical_fmu.system import ForceBalance, Loading, System

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

BRIEF = 1e-6  # of a step: slip that friction stops before is none


@dataclass(frozen=True)
class Kink:
    """motion : at the start of a step, with the friction behind its kink.  stops : share of it in which slip ends."""

    motion: BodyMotion
    stops: float = 1.0


def behind_kink(system: System, motion: BodyMotion, dv: Floats, loading: Loading) -> Kink:
    """Return how the step under loading begins.

    motion : at its start.  dv : (n_fixed,) [m/s] by which the velocity of what is prescribed changes there.
    loading : of the step, with its inertia.
    """
    push, dt = motion.push, loading.step.dt
    if loading.query is None or not dv.any() or not push.any():
        return Kink(motion)
    found = system.balance(motion.u, loading)
    if found.tractions is None:
        return Kink(motion)
    groups = groups_of(system, found.tractions)
    found, loading = alone(groups, found, loading, groups.rigid_ones(motion))
    pairs = rubbing_pairs(system, found, loading)
    if pairs is None:
        return Kink(motion)
    change = _of_rigid(system, dv)
    contact = ContactStiffness(system, found, loading)
    answer = answer_of(contact, pairs)
    ways = np.array([answer.solve(p) for p in pairs.push]) * answer.scale
    gives = pairs.push @ ways.T
    turned = np.abs(pairs.push @ change) > BRIEF * dt * np.diag(gives)
    if not turned.any():
        return Kink(motion)
    held, a = _shares(system, motion, found, loading, pairs), motion.a.ravel().copy()
    a[system.constraints.fixed] = 0.0
    slip = pairs.push @ (motion.v.ravel() + change)
    # fault: friction behind a kink is that of before -> share = held | mechanical_fmu/test_kinks
    share = np.where(turned & contact.unresolved(pairs.push, np.diag(gives) / answer.scale), -np.sign(slip), held)
    brakes = -np.sign(slip) * (pairs.push @ a + gives @ (share - held))
    after = np.divide(np.abs(slip), brakes * dt, out=np.full(slip.size, np.inf), where=brakes > 0.0)
    share = np.where(after < BRIEF, held, share)
    new = share != held
    if not new.any():
        return Kink(motion)
    # fault: slip that a kink began goes on to the end of a step -> stops = 1.0 | mechanical_fmu/test_kinks
    stops = float(after[new].min(initial=1.0))
    da = (share - held) @ ways
    behind = pushed(motion, change, da, (share - held) @ pairs.push - (answer.contact @ da) / answer.scale)
    return Kink(replace(behind, rubbing=_rubbing(system, motion.rubbing, pairs.nodes[new].any(axis=0))), stops)


def _of_rigid(system: System, dv: Floats) -> Floats:
    """(n,) [m/s] of all components; of bodies that deform none: what is prescribed there has neighbours to push."""
    out = np.zeros(system.moving.size)
    if system.rigid is not None:
        rows = system.constraints.fixed
        out[rows] = np.where(np.isin(rows, system.rigid.dofs), dv, 0.0)
    return out


def _shares(system: System, motion: BodyMotion, found: ForceBalance, loading: Loading, pairs: RubbingPairs) -> Floats:
    """(k,) of friction at the bound that the pairs have, as the motion notes it."""
    friction = motion.push - force_with(system, found, loading, np.zeros(pairs.nodes.shape[1]))
    assert loading.query is not None
    # Other bodies push what is held, too.
    rows = system.moving if loading.query.away.size else np.ones(system.moving.size)
    share, *_ = np.linalg.lstsq((pairs.push * rows).T, friction.ravel() * rows, rcond=None)
    return np.clip(share, -1.0, 1.0)


def _rubbing(system: System, before: Rubbing, nodes: Flags) -> Rubbing:
    """How pairs rub whose friction is new.  nodes : (n_q,) of them that touch."""
    # Of all their nodes: some meet in the step, and as many part.
    of = system.contact.pair_nodes.pair
    new, known = np.isin(of, of[nodes]), before.force.size > 0
    return replace(before, force=np.where(new, np.nan, before.force if known else 0.0),
                   rate=np.where(new, 0.0, before.rate if known else 0.0),
                   slip=before.slip if known else np.zeros(new.size))
