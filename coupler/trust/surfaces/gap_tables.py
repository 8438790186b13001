"""Tables of conductance over the gap: how far beyond their ends surfaces went apart.

A table keeps its last value beyond its end (docs/scenario.md), and a layer of gas conducts less the wider it is: where
a table that ends at 1 mm still falls there, gaps of 5 mm conduct several times too well.  It may be what its author
meant, so it is told and breaks nothing.  What ends at 0, or stays as it is, ends on purpose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, amount, measured
from coupler.trust.surfaces.faded import tables_of

Array = NDArray[np.float64]

NOTE_AT = 0.01  # of the span of the table
NAME = "gaps within the tables of conductance"


@dataclass(frozen=True)
class GapTable:
    """A table of a pair over its gap that does not end flat.  first, last [m]: of it.  at : the pair's nodes.

    reach [m]: how far the pair looks.
    """

    pair: str
    first: float
    last: float
    reach: float
    at: tuple[slice, ...]


@dataclass(frozen=True)
class GapLog:
    """most : (n_tables,) the widest gap [m] of nodes that face something so far, at t : (n_tables,) [s]."""

    most: Array = field(default_factory=lambda: np.empty(0))
    t: Array = field(default_factory=lambda: np.empty(0))


class GapTables:
    """The tables of a scene.  thermal : model.json of the thermal half, SI."""

    def __init__(self, interface: Interface, thermal: Mapping[str, Any]) -> None:
        found = []
        for pair in interface.pairs:
            spec = thermal.get("pairs", {}).get(pair.name) or {}
            at = tuple(side.at for side in interface.pair_sides if side.pair == pair.name)
            for law in tables_of((spec.get("conduction") or {}).get("open")):
                h, x = law["h"], law["x"]
                # fault: a conductance that has faded is told to end -> ends = False | coupler/test_trust_gap_tables
                ends = h[-1] == 0.0 or h[-1] == h[-2]
                if not ends:
                    found.append(GapTable(pair.name, float(x[0]), float(x[-1]), pair.gap_max, at))
        self.tables = tuple(found)

    def watched(self, log: GapLog, now: Level) -> GapLog:
        """Return the log after a level."""
        if not self.tables:
            return log
        widest = np.array([_widest(now, table) for table in self.tables])
        if not log.most.size:
            return GapLog(widest, np.full(len(widest), now.t))
        more = widest > log.most
        return GapLog(np.where(more, widest, log.most), np.where(more, now.t, log.t))

    def checks(self, log: GapLog) -> tuple[Check, ...]:
        """Return the check at the end, none where no conductance is a table over the gap that ends on the way."""
        if not self.tables or not log.most.size:
            return ()
        # fault: tables over gaps end nowhere -> beyond = [0.0] | coupler/test_trust_gap_tables
        beyond = [max(gap - of.last, 0.0) / (of.last - of.first) for gap, of in zip(log.most, self.tables, strict=True)]
        k = int(np.argmax(beyond))
        of = self.tables[k]
        first, last, most = (amount(float(gap), "m") for gap in (of.first, of.last, log.most[k]))
        return (measured(
            NAME, beyond[k], (NOTE_AT, math.inf), t=float(log.t[k]),
            what=f"the conductance of pair {of.pair} is given from {first} to {last}, but its surfaces are {most} "
                 f"apart at t = {log.t[k]:.6g} s: beyond its end the table keeps its last value",
            remedy="Extend the table, which is in m; if the last value is meant, repeat it at a wider gap"),)


def _widest(now: Level, table: GapTable) -> float:
    """The widest gap of a pair's nodes that face something within its reach; 0 where none does."""
    gap, covered = (np.concatenate([of[at] for at in table.at]) for of in (now.gap, now.covered))
    faces = (covered > 0.0) & np.isfinite(gap) & (gap <= table.reach)
    return float(gap[faces].max(initial=0.0))
