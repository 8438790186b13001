"""What fades with the gap between two surfaces, or is tabulated over it, as what nodes read when gaps change.

Films and radiation grow or fade between two gaps, and a law of conduction may be a table over the gap.  Where gaps
change fast each of these is like a field over place: it may begin, or end, within a window
(coupler.trust.surfaces.skipped).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.laws import gap_factor, open_conductance, parse_law
from coupler.schemes.levels import Level

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Faded:
    """Data over the gap.  where : in words.  nodes : (n,) the pair nodes that read them.

    of : of a gap [m], any shape.  far : where nothing is faced.  reach : from their least to their most.
    narrow [m]: their narrowest part.
    """

    where: str
    of: Callable[[Array], Array]
    nodes: NDArray[np.intp]
    narrow: float
    reach: float
    far: float

    def way(self, before: Level, now: Level) -> float:
        """Return by how much a gap changes at most, of what faces the other side all the time [m]."""
        a, b, faces = self._gaps(before, now)
        return float(np.abs(b - a)[faces].max(initial=0.0))

    def along(self, before: Level, now: Level, parts: Array) -> Array:
        """Return the data at these parts of the way from gap to gap; what ceases to face, or begins to, goes no way."""
        a, b, faces = self._gaps(before, now)
        values = self.of(a + parts[:, None] * (b - a))
        return np.where(faces, values, self.far)

    def range(self, t: float) -> float:
        """Return how far they reach."""
        return self.reach

    def _gaps(self, before: Level, now: Level) -> tuple[Array, Array, NDArray[np.bool_]]:
        a, b = before.gap[self.nodes], now.gap[self.nodes]
        faces = np.isfinite(a) & np.isfinite(b)
        for level in (before, now):
            covered = level.covered[self.nodes]
            # A half that does not tell the shares has 0 in all of `covered`.
            faces &= (covered > 0.0) | (not level.covered.any())
        return np.where(faces, np.maximum(a, 0.0), 0.0), np.where(faces, np.maximum(b, 0.0), 0.0), faces


def faded(interface: Interface, model: Mapping[str, Any]) -> Iterator[Faded]:
    """Return what fades with the gap of each pair.  model : of the thermal half (model.json)."""
    for pair in interface.pairs:
        if pair.tied:
            continue
        sides = {surface: interface.side_of(pair.name, surface).at for surface in (pair.slave, pair.master)}
        both = np.unique(np.concatenate([np.arange(at.start, at.stop) for at in sides.values()])).astype(np.intp)
        for condition in model.get("boundary", ()):
            for kind in ("convection", "radiation"):
                gap = condition.get(kind, {}).get("gap") if condition.get("on") in sides else None
                if gap:
                    side = sides[condition["on"]]
                    yield _fading(f"the {kind} on {condition['on']} changes with the gap", gap,
                                  np.arange(side.start, side.stop), rises=True)
        spec = model.get("pairs", {}).get(pair.name) or {}
        if (gap := (spec.get("radiation") or {}).get("gap")) is not None:
            yield _fading(f"the radiation of pair {pair.name} changes with the gap", gap, both, rises=False)
        for law in tables_of((spec.get("conduction") or {}).get("open")):
            yield _tabulated(f"the conductance of pair {pair.name} changes with the gap", law, both)


def _tabulated(where: str, law: Mapping[str, Any], nodes: NDArray[np.intp]) -> Faded:
    table, at, h = parse_law(law), np.array(law["x"], dtype=float), np.array(law["h"], dtype=float)

    def conductance(g: Array) -> Array:
        return open_conductance(table, g, 0.0)[0]

    narrow = float((at[2:] - at[:-2]).min() if at.size > 2 else at[1] - at[0])
    return Faded(where, conductance, nodes, narrow, float(np.ptp(h)), 0.0)


def _fading(where: str, gap: Mapping[str, float], nodes: NDArray[Any], *, rises: bool) -> Faded:
    begins, ends = sorted(float(value) for value in gap.values())

    def share(g: Array) -> Array:
        factor = gap_factor(g, begins, ends)
        return factor if rises else 1.0 - factor

    return Faded(where, share, nodes.astype(np.intp), ends - begins, 1.0, 1.0 if rises else 0.0)


def tables_of(law: Mapping[str, Any] | None) -> Iterator[Mapping[str, Any]]:
    """Return the tables over pressure or gap that a law of conductance is made of."""
    if law is None:
        return
    if law.get("law") == "table" and law.get("variable", "x") == "x":
        yield law
    for part in law.get("of", ()):
        yield from tables_of(part)
