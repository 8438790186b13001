"""Branches of the laws of contact: gaps and pressures at which a law bends, and on which side of them a pair is.

    power             p_max          no more conductance beyond
    convection        d_cut, d_full  nothing below, all of it above
    radiation         d_near, d_far  between near ones below, the surroundings above

Conduction knows pressure where a pair touches and gap where it does not, so its own jump is at touch, an event of the
pair.  Knots of a table are none: the curve through them is smooth.  What is looked at is a pair as a whole: its least
gap, its largest pressure; between the first point and the last one all windows have points on both sides.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from contact.half.interface import Pair
from coupler.control.sights import Place, Status
from coupler.schemes.level import Level

GAPS = ("d_cut", "d_full", "d_near", "d_far")


@dataclass(frozen=True)
class Branch:
    """place : the pair.  at : where a law bends; a pressure [Pa] where `pressure`, else a gap [m]."""

    place: Place
    at: float
    pressure: bool = False

    @property
    def name(self) -> str:
        """In words."""
        what, unit = ("pressure", "Pa") if self.pressure else ("gap", "m")
        return f"{what} {self.at:g} {unit} of pair {self.place.name}"


def branches_of(thermal: Mapping[str, Any], pairs: tuple[Pair, ...], places: tuple[Place, ...]) -> tuple[Branch, ...]:
    """Those of the model of a thermal half, each once.  places : of the pairs, in their order."""
    found: list[Branch] = []
    for pair, place in zip(pairs, places, strict=True):
        model = thermal.get("pairs", {}).get(pair.name, {})
        films = [b for b in thermal.get("boundary", ()) if b.get("on") in (pair.slave, pair.master)]
        gaps = {float(law[n]) for law in (*films, model.get("radiation") or {}) for n in GAPS if law.get(n) is not None}
        # A gap of zero is the touch.
        for at in sorted(gaps - {0.0}):
            found.append(Branch(place, at))
        for at in sorted(set(_pressures(model.get("closed")))):
            found.append(Branch(place, at, pressure=True))
    return tuple(found)


def _pressures(law: Mapping[str, Any] | None) -> Iterator[float]:
    if law is None:
        return
    # fault: bends of the pressure are no events -> if False: | coupler/test_branches
    if "p_max" in law:
        yield float(law["p_max"])
    for part in law.get("of", ()):
        yield from _pressures(part)


def side(branch: Branch, level: Level) -> tuple[Status, tuple[float, ...]]:
    """On which side of a branch its pair is, and how far from it [Pa or m]; APART where a gap faces nothing."""
    nodes = branch.place.nodes
    if branch.pressure:
        value = -float(level.t_N[nodes].min(initial=0.0))
    else:
        gap, covered = level.gap[nodes], level.covered[nodes]
        facing = gap[np.isfinite(gap) & (gap < branch.place.gap_max) & ((covered > 0.0) | (not covered.any()))]
        if not facing.size:
            return Status.APART, ()
        value = float(facing.min())
    # fault: how far a gap is from a bend is not told -> return (Status.ABOVE, (value - branch.at,)) if value >
    #   branch.at else (Status.BELOW, ()) | coupler/test_branches
    return (Status.ABOVE, (value - branch.at,)) if value > branch.at else (Status.BELOW, (branch.at - value,))
