"""Whether surfaces press along one normal, or a corner presses askew.

Contact pushes along the slave's normals.  Where surfaces fit each other those of the master are the same.  Where a
corner, or the node of a coarse curve, digs into a face that does not come to fit it, they differ by the tilt of the
corner's edges, and the force has a part along the face that no friction makes: the sine of that angle.  A steel block
that fell onto its corner, at 10 degrees, went aside by 13 % of its way, on 4 and on 16 cells a side.
Corners of pairs that press by their penalty alone lean to faces that do not deform (contact.leaning); there is no such
part.  Multipliers make faces fit each other where a corner digs in over several edges; over less than one they find no
face that fits, and it is the same.

The number is the largest sum of that part over a pair, over the pair's largest load.  On a round surface the parts of
both sides are the same, and cancel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.facing import Cut, cut_surfaces
from contact.half.interface import Interface
from contact.half.register import register_message
from contact.leaning import LEAN_COS, corners
from contact.penalty import penalties
from contact.surfaces import surfaces_of
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured

Array = NDArray[np.float64]

SHARES = (0.01, 0.05)
HERE = 1e-9  # of an edge: pieces that end so near to a node end there
NAME = "corners push along the faces they meet"


@dataclass(frozen=True)
class AskewLog:
    """most : pair -> its largest load [N].  along : pair -> the largest part of a load along the face [N], at t [s]."""

    most: Mapping[str, float] = field(default_factory=dict)
    along: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class Askew:
    """The pairs of a scene that press."""

    def __init__(self, interface: Interface, mechanical: Mapping[str, Any]) -> None:
        """mechanical : model.json of the half."""
        pairs = mechanical.get("pairs", {})
        self._pairs = {i: pair.name for i, pair in enumerate(interface.pairs)
                       if mechanical.get("half") == "elastic" and not pair.tied}
        if not self._pairs:
            return
        self._augmented = np.array([pairs.get(pair.name, {}).get("augmented") is not None for pair in interface.pairs])
        rigid = [body for body, of in mechanical.get("bodies", {}).items() if of.get("rigid")]
        self._nodes = interface.contact_nodes
        self._surfaces = surfaces_of(register_message(
            interface, [n for i, n in self._pairs.items() if not self._augmented[i]],
            [s for s in interface.surfaces if s.partition(".")[0] in rigid]))

    def watched(self, log: AskewLog, now: Level) -> AskewLog:
        """Return the log after one more window."""
        if not self._pairs or not now.t_N.any():
            return log
        surfaces = self._surfaces
        cut = cut_surfaces(surfaces, now.x[self._nodes])
        eps = penalties(surfaces.passes.eps_N[cut.number], surfaces.stiffness, cut.met)
        pair, xi = surfaces.passes.pair[cut.number], cut.values[:, 0]
        t_N = now.t_N[cut.at[:, :2]]
        # fault: of pairs that are augmented their overlap counts for their pressure -> held = np.zeros_like(xi) > 0.0 |
        #   coupler/test_trust_askew
        held = self._augmented[pair]
        pressure = np.where(held, -((1.0 - xi) * t_N[:, 0] + xi * t_N[:, 1]), -eps * cut.values[:, 2])
        load = np.maximum(pressure, 0.0) * cut.values[:, 3]
        aside = np.where(self._at_corners(cut, t_N[::2], held[::2]), load * _between(cut), 0.0)
        for i, name in self._pairs.items():
            here = pair == i
            whole, part = float(load[here].sum()), abs(float(aside[here].sum()))
            if whole > log.most.get(name, 0.0):
                log = replace(log, most={**log.most, name: whole})
            if part > log.along.get(name, (0.0, 0.0))[0]:
                log = replace(log, along={**log.along, name: (part, now.t)})
        return log

    def _at_corners(self, cut: Cut, t_N: Array, held: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return (n_p,) whether a point is on a slave edge of which an end presses that is a corner of its body.

        t_N : (n_p/2, 2) [Pa] of the slave's nodes of a piece, which tell whether they press where it is held by them.
        Where the master has the corner the normals of the slave's face are those of the force.
        """
        # fault: all edges that press count as corners -> at_corner = np.ones((len(cut.normals[0]), 2), np.bool_) |
        #   coupler/test_trust_askew
        at_corner = corners(self._surfaces.previous, self._surfaces.following, cut.normals[0], LEAN_COS)
        first, last = cut.values[::2], cut.values[1::2]
        beyond = np.where(self._surfaces.passes.by_node[cut.number[::2]] == 1, 0.0, 0.5 * (np.sqrt(3.0) - 1.0))
        found = np.zeros((len(self._surfaces.passes.slave), len(at_corner)), dtype=np.bool_)
        for end, near, far in ((0, first, last), (1, last, first)):
            # On from the two points, (1 -+ 1/sqrt 3)/2 of the piece, to where it ends.
            xi, gap = ((near + beyond[:, None] * (near - far))[:, k] for k in (0, 2))
            presses = np.where(held, t_N[:, end], gap) < 0.0
            pressed = (np.abs(xi - end) < HERE) & presses & at_corner[cut.met[::2, 0], end]
            found[cut.number[::2][pressed], cut.met[::2, 0][pressed]] = True
        chosen: NDArray[np.bool_] = found[cut.number, cut.met[:, 0]]
        return chosen

    def checks(self, log: AskewLog) -> tuple[Check, ...]:
        """Return the row at the end, where a pair pressed so."""
        if not log.most:
            return ()
        shares = {name: part / log.most[name] for name, (part, _) in log.along.items()}
        name = max(shares, key=lambda one: shares[one], default="")
        share, t = shares.get(name, 0.0), log.along.get(name, (0.0, 0.0))[1]
        what = (f"pair {name}: where it presses the normals of its sides differ, and {100.0 * share:.3g} % of its "
                f"largest load acts along the surfaces without friction, at t = {t:.6g} s: a corner of the slave "
                "stands askew on a face")
        return (measured(NAME, share, SHARES, t=t, what=what,
                         remedy="Exchange slave and master, so that what has the corner is the master, or use shorter "
                                "edges there"),)


def _between(cut: Cut) -> Array:
    """Return (n_p,) [1], the sine of the angle between the slave's normal and what opposes the master's."""
    edge, other, xi = cut.met[:, 0], cut.met[:, 1], cut.values[:, :1]
    ends = cut.normals[cut.shape, edge, 1:]
    n = (1.0 - xi) * ends[:, 0] + xi * ends[:, 1]
    m = cut.normals[cut.shape, other, 0]
    # fault: normals that differ are not told -> sine: Array = 0.0 * n[:, 0] | coupler/test_trust_askew
    sine: Array = (n[:, 1] * m[:, 0] - n[:, 0] * m[:, 1]) / np.hypot(n[:, 0], n[:, 1])
    return sine
