"""Whether the edges of round surfaces are fine enough for the heat that crosses the gap between them.

Heat sees a gap between arcs, and the arcs are known by their edges (contact.rounding): an arc rises above its chord by
so much, and the gap is that much less.  Where that is most of the gap, edges are no measure of it, and a gap is taken
to be no less than a quarter of that between chords (contact.arcs); of hollow surfaces, no more than four times it.
How much more or less would cross if the arcs were believed is the number: over what crosses the pair in the run, by
conductance and time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.arcs import MOST_RISE
from contact.facing import Cut
from contact.half.interface import Interface
from contact.laws import Law, closed_conductance, open_conductance, parse_law
from coupler.scenario.notes import NO_CONDUCTANCE
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured
from coupler.trust.surfaces.facets import Chords

Array = NDArray[np.float64]

SHARES = (0.02, 0.2)
NAME = "edges fine enough for heat across gaps"


@dataclass(frozen=True)
class RoundGapLog:
    """crossed, missed : pair -> conductance over time that its points have, and that they have too much or too little
    [J/K].  worst : pair -> the largest share of a window, and its end [s].
    """

    crossed: Mapping[str, float] = field(default_factory=dict)
    missed: Mapping[str, float] = field(default_factory=dict)
    worst: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class RoundGaps:
    """The pairs of a scene whose conductance goes with their gap, and of which a side is round."""

    def __init__(self, interface: Interface, thermal: Mapping[str, Any]) -> None:
        """thermal : model.json of the thermal half."""
        laws = {pair.name: thermal.get("pairs", {}).get(pair.name, {}).get("conduction") or {} for pair in
                interface.pairs if not pair.tied}
        laws = {name: spec for name, spec in laws.items() if spec.get("open") and spec["open"]["law"] != "constant"}
        self._chords = Chords(interface) if laws else None
        curved = frozenset[str]() if self._chords is None else self._chords.curved
        self._laws: dict[int, tuple[str, Law, Law]] = {
            k: (pair.name, parse_law(laws[pair.name].get("closed") or NO_CONDUCTANCE),
                parse_law(laws[pair.name]["open"]))
            for k, pair in enumerate(interface.pairs) if pair.name in laws and pair.name in curved}

    def watched(self, log: RoundGapLog, now: Level, H: float) -> RoundGapLog:
        """Return the log after a window of H [s]."""
        if not self._laws or self._chords is None:
            return log
        cut, above, pair = self._chords.above(now.x)
        crossed, missed, worst = dict(log.crossed), dict(log.missed), dict(log.worst)
        for k, (name, closed, opened) in self._laws.items():
            of, off = _conducted(cut, above, np.flatnonzero(pair == k), now, (closed, opened))
            crossed[name], missed[name] = crossed.get(name, 0.0) + H * of, missed.get(name, 0.0) + H * off
            if of > 0.0 and off / of > worst.get(name, (0.0, 0.0))[0]:
                worst[name] = (off / of, now.t)
        return replace(log, crossed=crossed, missed=missed, worst=worst)

    def checks(self, log: RoundGapLog) -> tuple[Check, ...]:
        """Return the row at the end; none where no pair is round."""
        shares = {name: log.missed[name] / of for name, of in log.crossed.items() if of > 0.0}
        if not shares:
            return ()
        name = max(shares, key=lambda one: shares[one])
        share, (most, t) = shares[name], log.worst.get(name, (0.0, 0.0))
        return (measured(
            NAME, share, SHARES, t=t,
            what=f"pair {name}: {100.0 * share:.3g} % of what crosses its gap hangs on places where the arcs of its "
                 f"surfaces rise above their edges by more than three quarters of the gap, {100.0 * most:.3g} % at "
                 f"t = {t:.6g} s: edges tell no such gap",
            remedy="Use shorter edges where the gap is narrowest"),)


def _conducted(cut: Cut, above: Array, at: NDArray[np.intp], now: Level, laws: tuple[Law, Law]) -> tuple[float, float]:
    """Return what the points of a pair conduct [W/K], and by how much that is more or less than between arcs.

    above : (n_p,) how far the arcs of both sides are above their edges [m].  laws : in touch, and apart.
    """
    closed, opened = laws
    xi, chords, area = cut.values[at, 0], np.maximum(cut.values[at, 2], 0.0), cut.values[at, 3]
    p = np.stack([1.0 - xi, xi], axis=1) * np.maximum(-now.t_N[cut.at[at, :2]], 0.0)
    p, T = p.sum(axis=1), np.full(at.size, float(now.T.mean()))
    apart = p <= 0.0
    # As the thermal half has it (contact.arcs).
    arcs = np.maximum(chords - above[at], 0.0)
    gap = np.clip(arcs, chords / MOST_RISE, chords * MOST_RISE)
    h = np.where(apart, open_conductance(opened, gap, T)[0], closed_conductance(closed, p, T)[0])
    # fault: gaps that edges do not tell count as known -> wrong = 0.0 * h | coupler/test_trust_round_gaps
    wrong = np.where(apart & (gap > 0.0), np.abs(open_conductance(opened, arcs, T)[0] - h), 0.0)
    return float(area @ h), float(area @ wrong)
