"""Whether windows resolve the motion of bodies through data that change over place or gap: what of these they skip.

A half reads a field over place (a source of heat, a film, a flux) where nodes are at single times of a window, and what
fades with a gap, or is tabulated over it, at the gap then.  A node that moves past a narrow part of it within one
window may never see that part: a strip that runs through an induction coil stays cold, its heat balance is perfect,
and a window of half the size skips the coil as well.  A film that is uncovered in the first eighth of a window is read
as if it had been uncovered before, by the window and by both of its halves, so that no comparison of the two tells.
Along the straight way of each node, or from gap to gap, the mean of the data is compared with what the half read
(coupler.schemes.schemes.read_at).  These errors are summed with their signs over the run, as heat is (the row of the
trust table); an adaptive window in which what is read strays by more than MET is made shorter
(coupler.control.accept).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, Profile, field_from
from contact.half.interface import Interface
from coupler.scenario.thermal_data import stated_data
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured
from coupler.trust.surfaces.faded import Faded, faded

Array = NDArray[np.float64]

NAME = "data over place met in time"
# Of what a node is given along its way, beyond the least anywhere: what is seen in a curve, and what no sketch may be
# off by.
NOTE_AT, LIMIT = 0.02, 0.2
# Of the range of the data, what all nodes together, and what each, a mean over them, may read too much or too little in
# an adaptive window.  What one reads too much where a narrow part begins it mostly reads too little where that ends.
MET, MET_BY_EACH = 0.003, 0.03
# Of these, where a window that is too long is to end: before something begins, not a little after.  What begins in the
# last window of a run is given next to nothing of there, and most of that may be missed.
STRICT = 0.03
# Of the way of a node: a part of the data that is narrower than the way has four of them, down to 1/256 of the way;
# what is narrower still is a jump, or nothing.
PIECES, JUMP, MOST_PIECES = 64, 256, 1024
ROOM = 2**22  # numbers that are held of a datum at once, where there are many nodes
AT_ONCE = 2**14  # numbers of a datum that are worked out at once
TRIED = 64  # shares of a window, of which the longest is looked for that skips nothing
NODES = 400  # of those that read a datum, so many are followed to size windows
STILL = 1e-3  # of the narrowest part of a field: who moves less in a window reads it as if at rest
MIDDLE = (0.5,)  # where a half reads in a window of one step


@dataclass(frozen=True)
class SkippedLog:
    """What nodes met of each field, so far; empty arrays before the first window.

    met : (n_fields, n) the sum of the data's mean along each way times the window's size, in their unit times s, and
    missed : (n_fields, n) of what the half read, less that.  least : (n_fields,) the least they were anywhere.
    time : [s] the sum of the windows, to t [s].
    """

    met: Array = field(default_factory=lambda: np.empty((0, 0)))
    missed: Array = field(default_factory=lambda: np.empty((0, 0)))
    least: Array = field(default_factory=lambda: np.empty(0))
    time: float = 0.0
    t: float = 0.0


@dataclass(frozen=True)
class _Placed:
    """A field over place, with words for it, the nodes : (n,) that read it, and its narrowest part [m]."""

    where: str
    data: Field
    nodes: NDArray[np.intp]
    narrow: float

    def way(self, before: Level, now: Level) -> float:
        """Return the longest way of a node along an axis [m]."""
        return float(np.abs(now.x[self.nodes] - before.x[self.nodes]).max(initial=0.0))

    def along(self, before: Level, now: Level, parts: Array) -> Array:
        """Return the field at these parts of the straight way of each node."""
        x0, x1 = before.x[self.nodes], now.x[self.nodes]
        # Signals do not bend within a window; at its ends they may jump.
        a, b = (np.array([s.at(t, side) for s in self.data.signals]) for t, side in ((before.t, 1), (now.t, -1)))
        # Many parts at once where nodes are few: one by one, parts take their time, and all at once, room.
        several = max(AT_ONCE // max(self.nodes.size, 1), 1)
        return np.concatenate([self._values(x0, x1, a, b, parts[k:k + several])
                               for k in range(0, parts.size, several)])

    def _values(self, x0: Array, x1: Array, a: Array, b: Array, parts: Array) -> Array:
        x = (x0 + parts[:, None, None] * (x1 - x0)).reshape(-1, 2)
        shapes = self._shapes(x).reshape(a.size, parts.size, len(x0))
        return np.asarray(np.einsum("pk,kpn->pn", a + parts[:, None] * (b - a), shapes))

    def _shapes(self, x: Array) -> Array:
        shapes = self.data.shapes(x)
        assert shapes is not None, "a field over place"
        return shapes

    def range(self, t: float) -> float:
        """Return how far its tables reach."""
        return sum(abs(term.t.at(t)) * math.prod(_most(p) for p in (term.x, term.y)) for term in self.data.terms
                   if any(p is not None and p.at is not None for p in (term.x, term.y)))


def _most(profile: Profile | None) -> float:
    return 1.0 if profile is None or profile.at is None else float(np.abs(profile.value).max())


class PlacedData:
    """The data over place or gap of the thermal half."""

    def __init__(self, interface: Interface, model: Mapping[str, Any]) -> None:
        size = float(np.ptp(interface.nodes, axis=0).max(initial=0.0))
        placed = [_Placed(where, data, nodes, min(data.narrowest, size))
                  for where, spec, nodes in _specs(interface, model) if not (data := field_from(spec)).is_uniform]
        # fault: what fades with a gap is not followed -> over_gaps = () | coupler/test_trust_skipped
        over_gaps = tuple(faded(interface, model))
        self._fields: tuple[_Placed | Faded, ...] = (*placed, *over_gaps)
        self._few = tuple(replace(f, nodes=_some(f.nodes)) for f in self._fields)
        self._n = max(len(interface.node_body), interface.pair_nodes.size)

    def watched(self, log: SkippedLog, before: Level, now: Level, reads: Sequence[float] = MIDDLE) -> SkippedLog:
        """Return the log after a window.  reads : the parts of it at which the thermal half read places and gaps."""
        if not self._fields:
            return log
        n = len(self._fields)
        if not log.least.size:
            log = SkippedLog(np.zeros((n, self._n)), np.zeros((n, self._n)), np.full(n, np.inf))
        met, missed, least = log.met.copy(), log.missed.copy(), log.least.copy()
        H = now.t - before.t
        for k, data in enumerate(self._fields):
            parts, values = _on_the_way(data, before, now)
            mean = np.trapezoid(values, parts, axis=0) if parts.size > 1 else values[0]
            met[k, data.nodes] += H * mean
            if parts.size > 1:
                # fault: what a way passes is taken as met -> read = mean | coupler/test_trust_skipped
                read = _read(parts, values, np.asarray(reads)).mean(axis=0)
                missed[k, data.nodes] += H * (read - mean)
            least[k] = min(least[k], float(values.min(initial=np.inf)))
        return replace(log, met=met, missed=missed, least=least, time=log.time + H, t=now.t)

    def unmet(self, before: Level, now: Level, reads: Sequence[float]) -> tuple[float, str]:
        """Return up to which share of a window what nodes read is what they pass; and what they skip beyond.

        reads : the parts of it at which the thermal half read places and gaps.  1.0 and "": all of it.
        """
        least, where = 1.0, ""
        for data in self._few:
            parts, values = _on_the_way(data, before, now)
            if parts.size == 1:
                continue
            reach = max(float(np.ptp(values)), data.range(before.t))
            share = _met_up_to(_Way(parts, values, reach), reads)
            if share < least:
                least, where = share, data.where
        return least, where

    def checks(self, log: SkippedLog) -> tuple[Check, ...]:
        """Return the row at the end, where something moved through data over place."""
        if not log.missed.any():
            return ()
        given = (log.met - log.least[:, None] * log.time).max(axis=1)
        missed = np.abs(log.missed).max(axis=1)
        shares = np.divide(missed, given, out=np.zeros_like(missed), where=given > 0.0)
        k = int(shares.argmax())
        share = float(shares[k])
        return (measured(NAME, share, (NOTE_AT, LIMIT), t=log.t,
                         what=f"{self._fields[k].where}, and bodies move far in a window: a node "
                              f"got up to {100.0 * share:.3g} % more or less of it than the largest amount that one "
                              "passed through",
                         # What a node misses of an edge goes with the size of the window.
                         remedy=f"Use windows {max(2, math.ceil(share / NOTE_AT))} times as short while bodies move "
                                "through it, or ones in which they move by no more than "
                                f"{self._fields[k].narrow:.3g} m, the narrowest part of its profile"),)


def _some(nodes: NDArray[np.intp]) -> NDArray[np.intp]:
    return nodes[::max(math.ceil(nodes.size / NODES), 1)]


def _on_the_way(data: _Placed | Faded, before: Level, now: Level) -> tuple[Array, Array]:
    """Return parts of a window and the data at them; the middle alone where nobody moves."""
    way = data.way(before, now)
    if way <= STILL * data.narrow:
        parts = np.array([0.5])
    else:
        wanted = 4.0 * way / data.narrow
        # fault: a narrow part falls between two points of a long way -> pieces = PIECES |
        #   coupler/test_trust_skipped
        pieces = JUMP if wanted > MOST_PIECES else max(math.ceil(wanted), PIECES)
        pieces = max(min(pieces, ROOM // max(data.nodes.size, 1)), PIECES)
        parts = np.linspace(0.0, 1.0, pieces + 1)
    return parts, data.along(before, now, parts)


def _read(parts: Array, values: Array, at: Array) -> Array:
    """Return the values (n_at, n) at these parts of a window, linear between those that are known."""
    k = np.clip(np.searchsorted(parts, at), 1, parts.size - 1)
    w = ((at - parts[k - 1]) / (parts[k] - parts[k - 1]))[:, None]
    return np.asarray((1.0 - w) * values[k - 1] + w * values[k])


@dataclass(frozen=True)
class _Way:
    """values : (n_parts, n) of data at parts of a window.  reach : how far the data reach."""

    parts: Array
    values: Array
    reach: float


def _met_up_to(way: _Way, reads: Sequence[float]) -> float:
    """The share of a window in which what is read is what is passed: all of it, or up to where that begins to fail."""
    if _met(way, 1.0, reads):
        return 1.0
    # fault: a window goes on a little past where something begins -> strict = 1.0 | coupler/test_trust_skipped
    strict = STRICT
    return float(next((s for s in np.arange(TRIED - 1, 1, -1) / TRIED if _met(way, s, reads, strict)), 1.0 / TRIED))


def _met(on: _Way, share: float, reads: Sequence[float], strict: float = 1.0) -> bool:
    """Whether what is read in a share of a window is what is passed there, to a part of what is allowed."""
    parts, values = on.parts, on.values
    inside = parts < share
    s = np.append(parts[inside], share)
    way = np.concatenate([values[inside], _read(parts, values, np.array([share]))])
    off = _read(parts, values, share * np.asarray(reads)).mean(axis=0) - np.trapezoid(way, s, axis=0) / share
    allowed = strict * on.reach
    return bool(abs(off.mean()) <= MET * allowed and np.abs(off).mean() <= MET_BY_EACH * allowed)


def _specs(interface: Interface, model: Mapping[str, Any]) -> Iterator[tuple[str, Any, NDArray[np.intp]]]:
    for name, body in model.get("bodies", {}).items():
        nodes = np.flatnonzero(interface.node_body == list(interface.bodies).index(name))
        for part in (body, *body.get("regions", {}).values()):
            if part.get("Q_T") is not None:
                yield f"the source in {name} changes over place", part["Q_T"], nodes
    for stated in stated_data(model):
        if stated.on not in interface.surfaces:
            continue
        given, nodes = stated.given, np.unique(interface.surfaces[stated.on]).astype(np.intp)
        if stated.kind == "flux":
            yield f"the flux on {stated.on} changes over place", given, nodes
        elif stated.kind != "temperature":
            for key in ("h", "T") if stated.kind == "convection" else ("T",):
                yield f"{key} of the {stated.kind} on {stated.on} changes over place", given[key], nodes
        elif isinstance(given, Mapping) and "terms" in given:
            yield f"the temperature of {stated.on} changes over place", given, nodes
