"""No body passes through another: surfaces that may meet are held against each other at every window's end.

The halves and the contact service look for what faces what within a search depth; what leapt past it in one window
presses nothing and says nothing.  Here a node of one side of a pair, or the middle of an edge, that lies inside the
body of the other side, deeper than what the half tells, or that crossed the outline of that body on its straight way
through the window, is seen from the coordinates alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.outlines import depths
from contact.half.passing import ALLOWED, Passage, Side, nearing, passage, sides_of
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

DEPTHS = (0.01, 0.1)  # told penetration over the edge length: noted, broken
PASSES, SOFT = "no body passes through another", "penetration of pressed surfaces"


@dataclass(frozen=True)
class PassingLog:
    """depth : the deepest a point lay inside unseen, over its edge length, at t [s]; node, pair : which.

    end : the other end of the edge whose middle it is; a node itself.
    crossed : whether it went across, not in.  drawn : pair -> depth over edge length at the start, as drawn.
    soft : the largest told penetration over the edge length, at soft_t [s] in soft_pair.
    """

    depth: float = 0.0
    node: int = -1
    end: int = -1
    pair: str = ""
    t: float = 0.0
    crossed: bool = False
    drawn: Mapping[str, float] = field(default_factory=dict)
    soft: float = 0.0
    soft_pair: str = ""
    soft_t: float = 0.0


class Sides:
    """Both sides of every pair of a scene whose bodies are two.  A surface that folds onto itself is left out."""

    def __init__(self, interface: Interface) -> None:
        self._sides, self._offset = sides_of(interface), interface.gap_offset

    def begun(self, now: Level) -> PassingLog:
        """Return the log at the start: how bodies overlap as drawn."""
        drawn: dict[str, float] = {}
        for side in self._sides:
            _, deep = _inside(side, now)
            drawn[side.pair] = max(drawn.get(side.pair, 0.0), float(deep.max(initial=0.0)) / side.edge)
        return PassingLog(drawn=drawn)

    def watched(self, log: PassingLog, before: Level, now: Level) -> PassingLog:
        """Return the log after one more window."""
        for side in self._sides:
            told = -float(np.fmin.reduce(now.gap[side.at], initial=0.0))
            if told > log.soft * side.edge:
                log = replace(log, soft=told / side.edge, soft_pair=side.pair, soft_t=now.t)
            drawn = log.drawn.get(side.pair, 0.0)
            points, deep = _inside(side, now, (max(ALLOWED, log.depth) + drawn) * side.edge)
            if points.size:
                unseen = (deep - self._told(side, now, points)) / side.edge - drawn
                worst = int(unseen.argmax())
                # fault: what lies inside another body is not seen -> if False: | coupler/test_trust
                if unseen[worst] > max(ALLOWED, log.depth):
                    log = _deepest(log, side, int(points[worst]), float(unseen[worst]), now.t, crossed=False)
            # fault: what went across another body is not seen -> found = None | coupler/test_trust
            found = _across(side, before, now)
            if found is not None and found.depth > max(ALLOWED, log.depth) * side.edge:
                log = _deepest(log, side, found.point, found.depth / side.edge, now.t, crossed=True)
        return log

    def _told(self, side: Side, now: Level, points: Indices) -> Array:
        """Return the penetration (n,) [m] told at points (n,), or within two edges by any pair of the same bodies.
        """
        found, x = np.zeros(len(points)), side.places(now.x)[points]
        for other in self._sides:
            if other.bodies == side.bodies:
                told = np.nan_to_num(np.maximum(self._offset[other.at] - now.gap[other.at], 0.0))
                far = np.linalg.norm(x[:, None] - now.x[other.nodes][None], axis=2)
                found = np.maximum(found, np.where(far <= 2.0 * max(side.edge, other.edge), told, 0.0).max(axis=1))
        return found


def _deepest(log: PassingLog, side: Side, point: int, depth: float, t: float, *, crossed: bool) -> PassingLog:
    node, end = side.points[point]
    return replace(log, depth=depth, node=int(node), end=int(end), pair=side.pair, t=t, crossed=crossed)


def _inside(side: Side, now: Level, least: float = 0.0) -> tuple[Indices, Array]:
    """Return which points (n,) lie inside the other body deeper than `least` [m], and how deep (n,) [m]."""
    x, a = side.places(now.x), now.x[side.outline[:, 0]]
    # As deep as that below the outline is as deep below the sides of its box; most surfaces end the search here.
    near = ((x > a.min(axis=0) + least) & (x < a.max(axis=0) - least)).all(axis=1)
    if not near.any():
        return np.flatnonzero(near), np.empty(0)
    deep = depths(x[near], a, now.x[side.outline[:, 1]])
    return np.flatnonzero(near)[deep > least], deep[deep > least]


def _across(side: Side, before: Level, now: Level) -> Passage | None:
    """Find a point that went across the other body: outside at the start and at the end, and unseen there."""
    unseen = side.unseen(now.gap)
    if unseen.any():
        unseen = nearing(side, unseen, before.x, now.x)
    for x in (before.x, now.x) if unseen.any() else ():
        unseen[unseen] = depths(side.places(x)[unseen], *(x[side.outline[:, k]] for k in range(2))) == 0.0
    return passage(side, unseen, before.x, now.x) if unseen.any() else None


def checks(log: PassingLog, where: str, pairs: bool, prescribed: bool, remedy: str) -> tuple[Check, Check]:
    """Return the two checks at the end.

    where : of the deepest point, in words.  pairs : whether the scene has any.  prescribed : bodies move as the
    scenario says, whatever they press.  remedy : of the deepest told penetration.
    """
    if not pairs:
        none = "there are no pairs"
        return Check(PASSES, TrustVerdict.UNCHECKED, what=none), Check(SOFT, TrustVerdict.UNCHECKED, what=none)
    how = "went across the other body in one window" if log.crossed else (
        f"lies {log.depth:.3g} edges inside the other body, deeper than contact reports")
    passes = measured(PASSES, log.depth, (ALLOWED, ALLOWED), unit="edges", t=log.t,
                      what=f"pair {log.pair}: {where} {how}, at t = {log.t:.6g} s",
                      remedy="Smaller windows, or a smaller step of the motion; contact searches to the depth of an "
                             "edge's length or half the thinner body")
    soft = measured(SOFT, log.soft, DEPTHS, t=log.soft_t,
                    what=f"pair {log.soft_pair}: pressed surfaces overlap by {100 * log.soft:.3g} % of an edge at "
                         f"t = {log.soft_t:.6g} s",
                    remedy=remedy)
    if prescribed:
        soft = measured(SOFT, log.soft, (DEPTHS[1], np.inf), t=log.soft_t, unit="edges",
                        what=f"pair {log.soft_pair}: the prescribed motion goes through the surface, {log.soft:.3g} "
                             f"edges deep, at t = {log.soft_t:.6g} s",
                        remedy="Change the motion: the half rigid moves bodies as prescribed")
    return passes, soft
