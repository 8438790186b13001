"""Whether windows resolve the motion of bodies through data that change over place: what of these they skip.

A half reads a field over place (a source of heat, a film, a flux) where nodes are at single times of a window.  A node
that moves past a narrow part of it within one window may never see that part: a strip that runs through an induction
coil stays cold, its heat balance is perfect, and a window of half the size skips the coil as well.  Along the straight
way of each node the mean of the field is compared with its value in the middle of the window, and with the mean of its
ends, which is what halves read.  Both errors are summed with their signs over the run, as heat is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, field_from
from contact.half.interface import Interface
from coupler.scenario.thermal_data import stated_data
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured

Array = NDArray[np.float64]

NAME = "data over place met in time"
# Of what a node is given along its way, beyond the least anywhere: what is seen in a curve, and what no sketch may be
# off by.
NOTE_AT, LIMIT = 0.02, 0.2
POINTS = 65  # on the way of a node; a part of a field that is narrower than a way is seen down to some 1/30 of it
STILL = 1e-3  # of the narrowest part of a field: who moves less in a window reads it as if at rest


@dataclass(frozen=True)
class SkippedLog:
    """What nodes met of each field, so far; empty arrays before the first window.

    met : (n_fields, n) the sum of the field's mean along each way times the window's size, in its unit times s, and
    missed : (n_fields, 2, n) of what halves read in the middle and at the ends, less that.  least : (n_fields,) the
    least it was anywhere.  time : [s] the sum of the windows, to t [s].
    """

    met: Array = field(default_factory=lambda: np.empty((0, 0)))
    missed: Array = field(default_factory=lambda: np.empty((0, 2, 0)))
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


class PlacedData:
    """The fields over place of the thermal half's data."""

    def __init__(self, interface: Interface, model: Mapping[str, Any]) -> None:
        size = float(np.ptp(interface.nodes, axis=0).max(initial=0.0))
        self._fields = [_Placed(where, data, nodes, min(data.narrowest, size))
                        for where, spec, nodes in _specs(interface, model) if not (data := field_from(spec)).is_uniform]
        self._n = len(interface.node_body)

    def watched(self, log: SkippedLog, before: Level, now: Level) -> SkippedLog:
        """Return the log after a window."""
        if not self._fields:
            return log
        n = len(self._fields)
        if not log.least.size:
            log = SkippedLog(np.zeros((n, self._n)), np.zeros((n, 2, self._n)), np.full(n, np.inf))
        met, missed, least = log.met.copy(), log.missed.copy(), log.least.copy()
        H = now.t - before.t
        for k, placed in enumerate(self._fields):
            x0, x1 = before.x[placed.nodes], now.x[placed.nodes]
            moves = bool(np.abs(x1 - x0).max(initial=0.0) > STILL * placed.narrow)
            parts = np.linspace(0.0, 1.0, POINTS) if moves else np.array([0.5])
            # Signals do not bend within a window; at its ends they may jump.
            values = np.array([placed.data.at(x0 + s * (x1 - x0), before.t + s * H, -1 if s == 1.0 else 1)
                               for s in parts])
            mean = np.trapezoid(values, parts, axis=0) if moves else values[0]
            met[k, placed.nodes] += H * mean
            if moves:
                # fault: what a way passes is taken as met -> read = np.array([mean, mean]) | coupler/test_trust_skipped
                read = np.array([values[POINTS // 2], 0.5 * (values[0] + values[-1])])
                missed[k][:, placed.nodes] += H * (read - mean)
            least[k] = min(least[k], float(values.min(initial=np.inf)))
        return replace(log, met=met, missed=missed, least=least, time=log.time + H, t=now.t)

    def checks(self, log: SkippedLog) -> tuple[Check, ...]:
        """Return the row at the end, where something moved through data over place."""
        if not log.missed.any():
            return ()
        given = (log.met - log.least[:, None] * log.time).max(axis=1)
        missed = np.abs(log.missed).max(axis=(1, 2))
        shares = np.divide(missed, given, out=np.zeros_like(missed), where=given > 0.0)
        k = int(shares.argmax())
        share = float(shares[k])
        return (measured(NAME, share, (NOTE_AT, LIMIT), t=log.t,
                         what=f"{self._fields[k].where} changes over place, and bodies move far in a window: a node "
                              f"got up to {100.0 * share:.3g} % more or less of it than the largest amount that one "
                              "passed through",
                         # What a node misses of an edge goes with the size of the window.
                         remedy=f"Use windows {max(2, math.ceil(share / NOTE_AT))} times as short while bodies move "
                                "through it, or ones in which they move by no more than "
                                f"{self._fields[k].narrow:.3g} m, the narrowest part of its profile"),)


def _specs(interface: Interface, model: Mapping[str, Any]) -> Iterator[tuple[str, Any, NDArray[np.intp]]]:
    for name, body in model.get("bodies", {}).items():
        nodes = np.flatnonzero(interface.node_body == list(interface.bodies).index(name))
        for part in (body, *body.get("regions", {}).values()):
            if part.get("Q_T") is not None:
                yield f"the source in {name}", part["Q_T"], nodes
    for stated in stated_data(model):
        if stated.on not in interface.surfaces:
            continue
        given, nodes = stated.given, np.unique(interface.surfaces[stated.on]).astype(np.intp)
        if stated.kind == "flux":
            yield f"the flux on {stated.on}", given, nodes
        elif stated.kind != "temperature":
            for key in ("h", "T") if stated.kind == "convection" else ("T",):
                yield f"{key} of the {stated.kind} on {stated.on}", given[key], nodes
        elif isinstance(given, Mapping) and "terms" in given:
            yield f"the temperature of {stated.on}", given, nodes
