"""What contact does in a step with inertia: neither gains nor loses energy beyond its springs and its friction.

The trapezoidal rule takes half of a pressure at either end of a step, however far apart the surfaces were at one of
them: a step in which they meet loses, a step in which they part gains, an eighth and more of all energy where a step is
as long as a wave takes through a body.  The places found stay as they are; velocities at the end get an impulse along
the mean of the step's contact forces, of the size that makes the energy right (Laursen and Love, IJNME 53, 2002), and
spread over the bodies as the step itself spreads a force.  Such an impulse is equal and opposite on the two bodies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.linalg import factorise
from mechanical_fmu.dynamics import BodyMotion, of_contact
from mechanical_fmu.groups import Groups, groups_of
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import constrained, stiffness

Floats = NDArray[np.float64]

# Of all kinetic energy: less is not worth a factor, and is kept for the next step.
WORTH = 1e-5


class CoarseImpactError(ArithmeticError):
    """A step too long for the contact in it."""


def with_its_energy(system: System, before: BodyMotion, after: BodyMotion, found: ForceBalance,
                    loading: Loading, owes: bool, heat: float) -> BodyMotion:
    """Return the motion at the end of a step with the energy that contact left it.

    before, after : the motion at both ends.  found : the balance at the end, under loading.  owes : whether what the
    velocities along the contact forces cannot give up is kept in `stored` for the next step.  heat : [J] by friction.
    Raises CoarseImpactError where they cannot and it may not be owed.
    """
    if found.tractions is None or not len(before.push) or loading.inertia is None:
        return after
    # fault: contact gains energy where surfaces part -> excess = 0.0 | mechanical_fmu/test_impact
    excess = of_contact(before, after, heat)
    how, dt = system.spec.dynamics, loading.step.dt
    assert how is not None
    M = system.masses.matrix(how.lumped)
    momentum = M @ after.v.ravel()
    as_it_is = replace(after, stored=after.stored - excess, owed=excess)
    if abs(excess) <= WORTH * 0.5 * float(momentum @ after.v.ravel()):
        return as_it_is
    mean = _in_doubt(groups_of(system, found.tractions, before.push), before, after)
    if not mean.any():
        return as_it_is
    alone = replace(loading, query=None)
    K = stiffness(system, system.balance(found.u, alone, tangent=True), alone)
    # K holds M/(beta dt2): velocity over s [s] of the mean force.
    dv = factorise(constrained(system, K))(mean.ravel() * system.constraints.free) * system.moving / (how.beta * dt**2)
    change = Change(float(momentum @ dv), float(dv @ (M @ dv)), dt)
    share = change.share(excess)
    if share is None:
        # Shorter steps help with what this one makes, and not with what is owed of others.
        # fault: steps are cut for what others made -> made = excess | mechanical_fmu/test_groups
        made = excess - before.owed
        if change.share(made) is None and not owes:
            raise CoarseImpactError(f"contact would gain {made:.3g} J in this step, which the bodies cannot give "
                                    "back: they part too far within it")
        share = change.most
    v = system.masses.followed(after.v + share * dv.reshape(after.v.shape))
    left = excess + change.energy(share)
    return replace(after, v=v, stored=after.stored - left, owed=left)


def _in_doubt(groups: Groups, before: BodyMotion, after: BodyMotion) -> Floats:
    """(n, 2) [N] what is in doubt of the mean of the contact forces of a step, group by group of what touches.

    That is the share |their change| over |their sum|: where nothing opens or closes, nothing is in doubt.  Without this
    bound a surface at rest, whose velocity gives no power, would be struck for every round-off of energy.
    """
    mean, doubt = 0.5 * (before.push + after.push), np.zeros(len(before.push))
    change, both = (np.abs(f).sum(axis=1) for f in (after.push - before.push, after.push + before.push))
    for group in np.unique(groups.label):
        # fault: what lies still is struck for what bounces -> rows = np.ones_like(doubt) | mechanical_fmu/test_groups
        rows = groups.rows(groups.label == group)[::2]
        if (most := float(rows @ both)) > 0.0:
            doubt += rows * min(1.0, float(rows @ change) / most)
    return mean * doubt[:, None]


@dataclass(frozen=True)
class Change:
    """Energy over s [s], an impulse in units of the mean contact force: s power + s2 doubled/2.

    power : [W].  doubled : [J/s2].  longest : the largest |s| allowed.
    """

    power: float
    doubled: float
    longest: float

    def energy(self, s: float) -> float:
        """Compute the change of energy [J] by s [s]."""
        return s * self.power + 0.5 * s * s * self.doubled

    @property
    def most(self) -> float:
        """Return the s that takes most energy."""
        return self._bounded(-self.power / self.doubled) if self.doubled > 0.0 else 0.0

    def share(self, excess: float) -> float | None:
        """Return the least s that takes an excess [J], as far as allowed; None where none can take it."""
        root = self.power * self.power - 2.0 * self.doubled * excess
        if root < 0.0:
            return None
        divisor = self.power + math.copysign(math.sqrt(root), self.power)
        return self._bounded(-2.0 * excess / divisor) if divisor else 0.0

    def _bounded(self, s: float) -> float:
        return min(max(s, -self.longest), self.longest)
