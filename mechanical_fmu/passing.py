"""No body goes through another within a step.

Contact looks as deep as half the thinner body.  A first guess that lies farther leaves nothing to push it back, and
equilibrium is found with nothing pressed: such a step is refused once it is solved, so that it is cut.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.outlines import depths
from contact.half.passing import Passage, passage
from mechanical_fmu.system import ForceBalance, System

Floats = NDArray[np.float64]


class PassingError(ArithmeticError):
    """A node, or the middle of an edge, goes through another body, unseen by contact."""


def refuse_passing(system: System, u: Floats, balance: ForceBalance) -> None:
    """Raise PassingError where a step from u : (n, 2) [m] to a balance takes a point of a surface into another body
    unseen.

    Only what contact finds neither pressed nor near is looked at: in most steps none of it meets a body.
    """
    if balance.tractions is None:
        return
    gap, nodes = balance.tractions.node_gap, system.interface.nodes
    unseen = [(side, flags) for side in system.contact.sides if (flags := side.unseen(gap)).any()]
    if not unseen:
        return
    before, after = nodes + u, nodes + balance.u
    for side, flags in unseen:
        # fault: a body goes through another and nobody sees it -> found = None | mechanical_fmu/test_passing
        found = passage(side, flags, before, after)
        if found is not None:
            raise PassingError(_text(system, found))


def _text(system: System, found: Passage) -> str:
    x, side = system.interface.nodes, found.side
    a, b = side.points[found.point] + 1
    node = f"node {a} of {side.surface}" if a == b else f"the edge of nodes {a} and {b} of {side.surface}"
    place = side.places(x)[found.point]
    drawn = float(depths(place[None], *(x[side.outline[:, k]] for k in range(2)))[0])
    if drawn > side.limit:
        return (f"pair {side.pair}: {node} is drawn {drawn:.3g} m ({drawn / side.edge:.3g} edges) inside {side.other}, "
                "where contact does not find it: it looks as deep as half the thinner body, or an edge's length; draw "
                "the bodies in touch and bring the interference on by a motion or by expansion")
    where = f"{node} (at the start at {place[0]:.6g}, {place[1]:.6g} m)"
    return (f"pair {side.pair}: {where} would {'go into' if found.stays else 'pass through'} {side.other} unseen by "
            f"contact, {found.depth:.3g} m deep ({found.depth / side.edge:.3g} edges): smaller windows, a larger "
            "elastic.cuts or a slower motion let contact find the touch; where none is small enough, the motion leaves "
            "the bodies no room, or they meet outside the surfaces of a pair")
