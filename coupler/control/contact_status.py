"""Contact status of each pair (open, closed, stick, slip), and the margins whose zeros change it.

A pair is open while no node of it is under pressure, else closed.  Where there is friction all pairs together stick,
slip in part, or slip.  Single nodes are not looked at: the edge of a pair that slides changes nodes all the time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair
from coupler.schemes.levels import Level

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Positions are good to about this share of the size of the scene; a pressure of the penalty times that is round-off.
ROUND_OFF = 1e-13
SLIPPING = "mechanical.contact.slipping"
SPEED = "mechanical.contact.slip_speed"  # of halves with inertia


class ContactState(Enum):
    """Of a pair, of all friction, or of a rule."""

    OPEN = "open"
    CLOSED = "closed"
    STICKS = "sticks"
    SLIPS_IN_PART = "slips in part"
    SLIPS = "slips"
    TURNS = "turns round"  # it slipped one way, and goes the other now
    APART = "apart"  # nothing touches, so nothing sticks or slips; or nobody told
    BELOW = "below"  # a branch of a law
    ABOVE = "above"
    WAITS = "waits"  # a rule whose conditions do not hold
    ACTS = "acts"  # or do; APART: it is not known


@dataclass(frozen=True)
class PairNodes:
    """A pair: nodes : its pair nodes.  gap_max [m].

    floor [Pa], touch [m] : pressures and gaps up to them are round-off.  tied : bonded, so it is closed for good.
    """

    name: str
    nodes: Indices
    gap_max: float
    floor: float = 0.0
    touch: float = 0.0
    tied: bool = False


@dataclass(frozen=True)
class ContactStatus:
    """At t [s]: status of every pair, then of friction, and the margins of each until that changes.

    margins : for each status several quantities > 0 of any unit, the first of which to reach 0 changes it; empty:
    unknown.
    OPEN: least gap [m], 0 where that is round-off.  CLOSED: largest pressure [Pa], share of the surface that faces
    something.  STICKS: 1 - largest |t_T|/(mu p_N).  SLIPS, TURNS: speed along its friction [m/s], with inertia.
    """

    t: float
    status: tuple[ContactState, ...]
    margins: tuple[tuple[float, ...], ...]


def pair_nodes_of(interface: Interface) -> tuple[PairNodes, ...]:
    """The pairs of a scene."""
    size = float(np.ptp(interface.nodes, axis=0).max())
    return tuple(PairNodes(pair.name, np.concatenate([np.arange(side.at.start, side.at.stop) for side in
                                                      interface.pair_sides if side.pair == pair.name]), pair.gap_max,
                           pair.eps_N * ROUND_OFF * size, ROUND_OFF * size, pair.tied) for pair in interface.pairs)


def pressed(level: Level) -> int:
    """The number of pair nodes under pressure.

    Not of quadrature points: of those there are twice as many where an edge lies across a node of the other side.
    """
    # fault: nodes that touch are not counted -> return 1 | coupler/test_friction_trend
    return int((level.t_N < 0.0).sum())


def status_monitors(interface: Interface) -> tuple[str, ...]:
    """Monitors to ask for besides what is exchanged."""
    return (SLIPPING, SPEED) if any(pair.mu > 0.0 for pair in interface.pairs) else ()


def contact_status(nodes: tuple[PairNodes, ...], level: Level, monitors: Mapping[str, float]) -> ContactStatus:
    """Returns the status of the pairs, then of friction, at a level.

    monitors : touching, mechanical.contact.slipping (points), grip (1 - largest |t_T|/(mu p_N)), where told.
    """
    pairs = [_pair(pair, level) for pair in nodes]
    friction = _friction(monitors)
    return ContactStatus(level.t, (*(s for s, _ in pairs), friction[0]),
                         (*(margins for _, margins in pairs), friction[1]))


def _pair(pair: PairNodes, level: Level) -> tuple[ContactState, tuple[float, ...]]:
    # fault: a tied pair that is pulled has opened -> if False: |
    #   coupler/test_ties::test_its_status_is_closed_whatever_it_carries
    if pair.tied:
        return ContactState.CLOSED, ()
    covered = level.covered[pair.nodes]
    told = bool(covered.any())  # a half that does not tell gives zeros
    p = -level.t_N[pair.nodes].min(initial=0.0)
    if p > pair.floor:
        return ContactState.CLOSED, (float(p), float(covered.sum())) if told else (float(p),)
    gap = level.gap[pair.nodes]
    facing = gap[np.isfinite(gap) & (gap < pair.gap_max) & ((covered > 0.0) | (not told))]
    least = float(facing.min(initial=np.inf))
    return ContactState.OPEN, (least if least > pair.touch else 0.0,) if facing.size else ()


def _friction(monitors: Mapping[str, float]) -> tuple[ContactState, tuple[float, ...]]:
    slipping, touching = monitors.get(SLIPPING, np.nan), monitors.get("touching", 0.0)
    if not touching > 0.0 or np.isnan(slipping):
        return ContactState.APART, ()
    if slipping >= touching:
        speed = monitors.get(SPEED, np.nan)
        # fault: slip that turns round within a window is no event -> if True: | coupler/test_slip_turns
        if np.isnan(speed):
            return ContactState.SLIPS, ()
        return (ContactState.SLIPS, (float(speed),)) if speed > 0.0 else (ContactState.TURNS, (-float(speed),))
    if slipping > 0.0:
        return ContactState.SLIPS_IN_PART, ()
    grip = monitors.get("grip", np.nan)
    return ContactState.STICKS, () if np.isnan(grip) else (float(grip),)


def changed(before: ContactStatus, now: ContactStatus) -> list[int]:
    """Which statuses differ.  Friction that begins or ends with touch is the pair's event, not one of its own; and
    nothing happens where a rule no longer acts.
    """
    return [i for i, (a, b) in enumerate(zip(before.status, now.status, strict=True))
            if a is not b and ContactState.APART not in (a, b) and b is not ContactState.WAITS]


# Branches of the laws of contact: gaps and pressures at which a law bends, and on which side of them a pair is.
#
#     power             p_max          no more conductance beyond
#     convection        d_cut, d_full  nothing below, all of it above
#     radiation         d_near, d_far  between near ones below, the surroundings above
#
# Where a law still lets heat cross at gap_max, that ends there at once.
# Conduction knows pressure where a pair touches and gap where it does not, so its own jump is at touch, an event of the
# pair.  Knots of a table are none: each bends the law a little.  What is looked at is a pair as a whole: its least
# gap, its largest pressure; between the first point and the last one all windows have points on both sides.


@dataclass(frozen=True)
class Branch:
    """pair : whose.  at : where a law bends; a pressure [Pa] where `pressure`, else a gap [m].

    sides : nodes of both surfaces, where nothing is faced beyond that gap; else empty.
    """

    pair: PairNodes
    at: float
    pressure: bool = False
    sides: tuple[Indices, ...] = ()

    @property
    def name(self) -> str:
        """In words."""
        what, unit = ("pressure", "Pa") if self.pressure else ("gap", "m")
        return f"{what} {self.at:g} {unit} of pair {self.pair.name}"


def branches_of(thermal: Mapping[str, Any], pairs: tuple[Pair, ...],
                nodes: tuple[PairNodes, ...]) -> tuple[Branch, ...]:
    """Those of the model of a thermal half, each once.  nodes : of the pairs, in their order."""
    found: list[Branch] = []
    for pair, own in zip(pairs, nodes, strict=True):
        model = thermal.get("pairs", {}).get(pair.name, {})
        films = [b for b in thermal.get("boundary", ()) if b.get("on") in (pair.slave, pair.master)]
        fading = (*(b.get(kind, {}) for b in films for kind in ("convection", "radiation")), model.get("radiation", {}))
        gaps = {float(gap) for law in fading for gap in law.get("gap", {}).values()}
        # A gap of zero is the touch.
        for at in sorted(gaps - {0.0}):
            found.append(Branch(own, at))
        for at in sorted(set(_pressures(model.get("conduction", {}).get("closed")))):
            found.append(Branch(own, at, pressure=True))
    return tuple(found)


def reaches_of(ends: Collection[str], interface: Interface, nodes: tuple[PairNodes, ...]) -> tuple[Branch, ...]:
    """Where pairs leave each other's reach.  ends : names of those whose heat ends there at once."""
    return tuple(Branch(own, pair.gap_max, sides=tuple(np.unique(interface.surfaces[side])
                                                       for side in (pair.slave, pair.master)))
                 for pair, own in zip(interface.pairs, nodes, strict=True) if pair.name in ends)


def _pressures(law: Mapping[str, Any] | None) -> Iterator[float]:
    if law is None:
        return
    # fault: bends of the pressure are no events -> if False: | coupler/test_branches
    if "p_max" in law:
        yield float(law["p_max"])
    for part in law.get("of", ()):
        yield from _pressures(part)


def side(branch: Branch, level: Level) -> tuple[ContactState, tuple[float, ...]]:
    """On which side of a branch its pair is, and how far from it [Pa or m]; APART where a gap faces nothing.

    Beyond the reach of a pair nobody tells how far.
    """
    nodes = branch.pair.nodes
    if branch.pressure:
        value = -float(level.t_N[nodes].min(initial=0.0))
    else:
        gap, covered = level.gap[nodes], level.covered[nodes]
        facing = gap[np.isfinite(gap) & (gap < branch.pair.gap_max) & ((covered > 0.0) | (not covered.any()))]
        if not facing.size:
            # fault: what ends at gap_max is no event -> return ContactState.APART, () | coupler/test_branches
            return (ContactState.ABOVE if _out_of_reach(branch, level) else ContactState.APART), ()
        value = float(facing.min())
    if value > branch.at:
        return ContactState.ABOVE, (value - branch.at,)
    # fault: how far a gap is from a bend is not told -> return ContactState.BELOW, () | coupler/test_branches
    return ContactState.BELOW, (branch.at - value,)


def _out_of_reach(branch: Branch, level: Level) -> bool:
    """Whether the boxes of both surfaces, along the first one, lie opposite each other, farther apart than the reach.

    Those that slid off each other, or come from the side, do not: they cease to face, or begin to, little by little.
    """
    if not branch.sides:
        return False
    a, b = (level.x[nodes] for nodes in branch.sides)
    # fault: whether surfaces are in reach depends on how the scene is turned -> along = np.eye(2) |
    #   coupler/test_branches
    along = np.linalg.eigh(np.cov(a.T))[1]
    a, b = a @ along, b @ along
    apart = np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0))
    return bool(apart.max() >= branch.at and apart.min() <= 0.0)


# Where a quantity that falls towards zero will reach it, from a few of its values, and how sure that is.

# So many values are used: the fourth tells how far the curve through three is to be trusted, a fifth is history.
MOST = 4
# With two values nothing tells how the slope changes: so much of the way ahead is in doubt.
DOUBT = 0.1


@dataclass(frozen=True)
class Root:
    """t : where zero is reached.  doubt >= 0 : how far off that may be, in the same unit."""

    t: float
    doubt: float


def root(t: Sequence[float], left: Sequence[float]) -> Root | None:
    """Zero of a quantity by inverse interpolation (Neville's scheme for t as a function of what is left, at 0).

    t, left : times ascending and what was left then.  None where it is not falling or not above zero at the last one.
    Only the last values that fall throughout count.  Of the orders the one is taken that changed the answer least.
    """
    first = len(left) - 1
    # fault: extrapolated from values on both sides of a rise -> while first > 0 and len(left) - first < MOST: |
    #   coupler/test_events
    while first > 0 and len(left) - first < MOST and left[first - 1] > left[first]:
        first -= 1
    t, left = t[first:], left[first:]
    if len(t) < 2 or not left[-1] > 0.0 or not all(map(math.isfinite, left)):
        return None
    # The last value goes first, so that each order adds an older one.
    times, values = list(reversed(t)), list(reversed(left))
    column, answers = list(times), [times[0]]
    for order in range(1, len(times)):
        column = [(values[i + order] * column[i] - values[i] * column[i + 1]) / (values[i + order] - values[i])
                  for i in range(len(column) - 1)]
        answers.append(column[0])
    last = times[0]
    linear = answers[1]
    best = Root(linear, DOUBT * (linear - last))
    for older, newer in pairwise(answers[1:]):
        if abs(newer - older) < best.doubt and newer > last:
            best = Root(newer, abs(newer - older))
    return best
