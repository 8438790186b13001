"""Tables of conductance over pressure: how far beyond their ends surfaces were pressed.

A table keeps its last value beyond its end (docs/scenario.md), which may be what its author meant, and no conductance
grows without bound.  But pressures in MPa where Pa are read are all beyond it.  So it is told where the table still
rises or falls at its end, and breaks nothing.  Pressure has no bound at sharp corners, so what is held against the
table is the mean of the nodes in touch.
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
NAME = "pressures within the tables of conductance"


@dataclass(frozen=True)
class PressureTable:
    """A table of a pair over pressure that does not end flat.  first, last [Pa]: of it.  at : the pair's nodes."""

    pair: str
    first: float
    last: float
    at: tuple[slice, ...]


@dataclass(frozen=True)
class PressureLog:
    """most : (n_tables,) the largest mean pressure [Pa] of nodes in touch so far, at t : (n_tables,) [s]."""

    most: Array = field(default_factory=lambda: np.empty(0))
    t: Array = field(default_factory=lambda: np.empty(0))


class PressureTables:
    """The tables of a scene.  thermal : model.json of the thermal half, SI."""

    def __init__(self, interface: Interface, thermal: Mapping[str, Any]) -> None:
        found = []
        for pair in interface.pairs:
            spec = thermal.get("pairs", {}).get(pair.name) or {}
            at = tuple(side.at for side in interface.pair_sides if side.pair == pair.name)
            for law in tables_of((spec.get("conduction") or {}).get("closed")):
                # fault: what stays as it is is told to end -> flat = False | coupler/test_trust_pressures
                flat = law["h"][-1] == law["h"][-2]
                if not flat:
                    found.append(PressureTable(pair.name, float(law["x"][0]), float(law["x"][-1]), at))
        self.tables = tuple(found)

    def watched(self, log: PressureLog, now: Level) -> PressureLog:
        """Return the log after a level."""
        if not self.tables:
            return log
        mean = np.array([_mean(np.concatenate([-now.t_N[at] for at in table.at])) for table in self.tables])
        if not log.most.size:
            return PressureLog(mean, np.full(len(mean), now.t))
        more = mean > log.most
        return PressureLog(np.where(more, mean, log.most), np.where(more, now.t, log.t))

    def checks(self, log: PressureLog) -> tuple[Check, ...]:
        """Return the check at the end, none where no conductance is a table over pressure that ends on the way."""
        if not self.tables or not log.most.size:
            return ()
        # fault: tables over pressure end nowhere -> beyond = [0.0] | coupler/test_trust_pressures
        beyond = [max(p - of.last, 0.0) / (of.last - of.first) for p, of in zip(log.most, self.tables, strict=True)]
        k = int(np.argmax(beyond))
        of = self.tables[k]
        first, last, most = (amount(float(p), "Pa") for p in (of.first, of.last, log.most[k]))
        return (measured(
            NAME, beyond[k], (NOTE_AT, math.inf), t=float(log.t[k]),
            what=f"the conductance of pair {of.pair} is given from {first} to {last}, but its surfaces are pressed by "
                 f"{most} at t = {log.t[k]:.6g} s: beyond its end the table keeps its last value",
            remedy="Extend the table, which is in Pa; if the last value is meant, repeat it at a higher pressure"),)


def _mean(pressure: Array) -> float:
    """The mean of those that are pressed; 0 where none is."""
    pressed = pressure[pressure > 0.0]
    return float(pressed.mean()) if pressed.size else 0.0
