"""Pairs whose bodies start inside each other, too deep for contact to see."""

from __future__ import annotations

import numpy as np

from contact.half.interface import Interface, Pair
from coupler.scenario.locate import locate

# Nodes of a surface looked at: a body in the wrong place shows on a few of them as well as on all.
SAMPLES = 40


def overlap_notes(interface: Interface) -> list[str]:
    """One sentence a pair of which a side lies inside the other's body, deeper than the longest edge of the two.

    Contact sees a penetration down to about an edge's length; what lies deeper faces nothing, and the run would go on
    as if the bodies did not meet.
    """
    notes = []
    for pair in interface.pairs:
        for own, other in ((pair.slave, pair.master), (pair.master, pair.slave)):
            body = other.split(".")[0]
            if n := _too_deep(interface, pair, own, other, body):
                notes.append(f"pair {pair.name}: {n} of the nodes looked at on {own} start inside {body}, deeper than "
                             "a cell, where contact sees nothing; is a body in the wrong place?")
                break
    return notes


def _too_deep(interface: Interface, pair: Pair, own: str, other: str, body: str) -> int:
    ends = [interface.nodes[interface.surfaces[name]] for name in (pair.slave, pair.master)]
    longest = max(float(np.linalg.norm(e[:, 1] - e[:, 0], axis=1).max()) for e in ends)
    nodes = np.unique(interface.surfaces[own])
    face = interface.nodes[np.unique(interface.surfaces[other])]
    found = 0
    for x in interface.nodes[nodes[:: max(1, len(nodes) // SAMPLES)]]:
        # The nearest node of the other face is at most half an edge farther than the face itself.
        if np.linalg.norm(face - x, axis=1).min() > 1.5 * longest and locate(interface, body, x) is not None:
            found += 1
    return found
