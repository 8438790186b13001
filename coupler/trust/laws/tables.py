"""Tables over temperature, of materials and of conductance: how far beyond their ends the temperatures of a run went.

A table keeps its last value beyond its ends (docs/scenario.md).  That may be what its author meant, so it is told and
breaks nothing.  A property of the solid is not asked for above the solidus, one of the liquid not below the liquidus.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured

Array = NDArray[np.float64]
Span = tuple[float, float]

NOTE_AT = 0.01  # of the span of the table
NAME = "temperatures within the tables of materials"
EVERYWHERE: Span = (-math.inf, math.inf)


@dataclass(frozen=True)
class Table:
    """A property that is given over temperature.

    what : in words.  first, last [K]: of the table.  asked : where it is asked for [K].  place : number of its nodes
    in MaterialTables.nodes.
    """

    what: str
    first: float
    last: float
    asked: Span
    place: int


def _empty() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class TableLog:
    """low, high : (n_places,) the least and the largest temperature [K] so far."""

    low: Array = field(default_factory=_empty)
    high: Array = field(default_factory=_empty)


class MaterialTables:
    """The tables of a scene, and the nodes whose temperatures they are asked for.

    nodes : of each place, a body, a region or a surface; of a pair both sides, whose mean is asked for.
    models : of the halves (model.json), SI and kelvin.
    """

    def __init__(self, interface: Interface, models: Mapping[str, Mapping[str, Any]]) -> None:
        self.nodes: list[tuple[NDArray[np.int32], ...]] = []
        found: list[Table] = []
        for model in models.values():
            bodies = model.get("bodies", {})
            for number, part in enumerate(interface.parts):
                body, _, region = part.partition(".")
                stated = bodies.get(body, {})
                own = stated | stated.get("regions", {}).get(region, {})
                material = own.get("material", "")
                tables = [*_of_material(material, model.get("materials", {}).get(material, {})),
                          *_tables(own.get("Q_T_factor"), f"Q_T_factor of {part}", EVERYWHERE)]
                found += self._placed(tables, interface.part_nodes(number))
            for condition in model.get("boundary", ()):
                surface = str(condition.get("on", ""))
                if surface in interface.surfaces:
                    tables = [t for kind, key in (("convection", "h_factor"), ("radiation", "emissivity"))
                              for t in _tables((condition.get(kind) or {}).get(key), f"{key} on {surface}", EVERYWHERE)]
                    found += self._placed(tables, np.unique(interface.surfaces[surface]).astype(np.int32))
            for pair in interface.pairs:
                laws = (model.get("pairs", {}).get(pair.name) or {}).get("conduction") or {}
                # fault: conductances over temperature end nowhere -> law_tables: list[Any] = [] |
                #   coupler/test_trust_tables
                law_tables = [t for key in ("closed", "open") for t in _of_law(laws.get(key), pair.name)]
                found += self._placed(law_tables, *(np.unique(interface.surfaces[of]).astype(np.int32)
                                                    for of in (pair.slave, pair.master)))
                radiation = (model.get("pairs", {}).get(pair.name) or {}).get("radiation") or {}
                # fault: emissivities of pairs end nowhere -> for side, surface in (): | coupler/test_trust_tables
                for side, surface in (("slave", pair.slave), ("master", pair.master)):
                    key = f"emissivity_{side}"
                    own_tables = list(_tables(radiation.get(key), f"{key} of pair {pair.name}", EVERYWHERE))
                    found += self._placed(own_tables, np.unique(interface.surfaces[surface]).astype(np.int32))
        self.tables = tuple(found)

    def _placed(self, tables: list[tuple[str, Span, Span]], *nodes: NDArray[np.int32]) -> Iterator[Table]:
        if tables and all(map(len, nodes)):
            self.nodes.append(nodes)
            for what, (first, last), asked in tables:
                yield Table(what, first, last, asked, len(self.nodes) - 1)

    def watched(self, log: TableLog, now: Level) -> TableLog:
        """Return the log after a level."""
        if not self.nodes:
            return log
        low, high = (np.array([np.mean([f(now.T[n]) for n in sides]) for sides in self.nodes])
                     for f in (np.min, np.max))
        if log.low.size:
            low, high = np.minimum(low, log.low), np.maximum(high, log.high)
        return TableLog(low, high)

    def checks(self, log: TableLog) -> tuple[Check, ...]:
        """Return the check at the end, none where no property has a table over temperature."""
        if not self.tables or not log.low.size:
            return ()
        beyond = [self._beyond(table, log) for table in self.tables]
        worst = int(np.argmax([share for share, _, _ in beyond]))
        share, low, high = beyond[worst]
        table = self.tables[worst]
        over = {t.what for t, (part, _, _) in zip(self.tables, beyond, strict=True) if part > NOTE_AT}
        others = sorted(over - {table.what})
        more = f"; so does {', '.join(others[:4])}" + (" and others" if len(others) > 4 else "") if others else ""
        return (measured(
            NAME, share, (NOTE_AT, math.inf),
            what=f"the table {table.what} goes from {table.first:.6g} to {table.last:.6g} K, but was read from "
                 f"{low:.6g} to {high:.6g} K: beyond its ends it keeps its last value{more}",
            remedy="Extend the table; if the last value is meant, repeat it at the temperature that was reached"),)

    @staticmethod
    def _beyond(table: Table, log: TableLog) -> tuple[float, float, float]:
        """How far it was asked for beyond its ends, as a share of its span, and from where to where [K]."""
        low = min(max(float(log.low[table.place]), table.asked[0]), table.asked[1])
        high = max(min(float(log.high[table.place]), table.asked[1]), table.asked[0])
        # fault: tables end nowhere -> beyond = 0.0 | coupler/test_trust_tables
        beyond = max(table.first - low, high - table.last, 0.0)
        return beyond / (table.last - table.first), low, high


def _of_material(name: str, material: Mapping[str, Any]) -> Iterator[tuple[str, Span, Span]]:
    """Every table of a material, `what` it is of, from where to where it goes, and where it is asked for."""
    latent, liquid = material.get("latent") or {}, material.get("liquid") or {}
    melting = [of[key] for of in (latent, liquid) for key in ("T_m", "T_s", "T_l") if of.get(key) is not None]
    # Between solidus and liquidus both are asked for, but of each there is only a part.
    solid: Span = (-math.inf, min(melting, default=math.inf))
    molten: Span = (max(melting, default=-math.inf), math.inf)
    for key, value in material.items():
        # A half that knows a liquid asks for nothing else where all is molten.
        asked = molten if key == "liquid" else solid if liquid else EVERYWHERE
        yield from _walk(value, f"{key} of {name}", asked, solid, molten)


def _walk(value: Any, what: str, asked: Span, solid: Span, molten: Span) -> Iterator[tuple[str, Span, Span]]:
    yield from _tables(value, what, asked)
    if isinstance(value, Mapping) and "T" not in value:
        for key, inner in value.items():
            of = solid if key == "solid" else molten if key == "liquid" else asked
            yield from _walk(inner, f"{what} ({key})", of, solid, molten)


def _of_law(law: Mapping[str, Any] | None, pair: str) -> Iterator[tuple[str, Span, Span]]:
    """The tables over temperature that a law of conductance is made of."""
    if law is None:
        return
    if law.get("law") == "table" and law.get("variable") == "T":
        yield f"conductance of pair {pair}", (float(law["x"][0]), float(law["x"][-1])), EVERYWHERE
    for part in law.get("of", ()):
        yield from _of_law(part, pair)


def _tables(value: Any, what: str, asked: Span) -> Iterator[tuple[str, Span, Span]]:
    """The table over temperature that a value is, if it is one of more than one point."""
    if isinstance(value, Mapping) and isinstance(value.get("T"), list | tuple) and len(value["T"]) > 1:
        yield what, (float(value["T"][0]), float(value["T"][-1])), asked
