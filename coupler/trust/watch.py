"""Watches a run window by window, and judges it at its end: the trust table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from contact.half.interface import Interface
from coupler.schemes.levels import Level
from coupler.schemes.state import imbalance
from coupler.trust import passing, rhythm, temperatures
from coupler.trust.checks import Check, measured

BALANCE = (1e-9, 1e-6)  # of the heat moved: noted, broken


@dataclass(frozen=True)
class TrustLog:
    """What was measured so far.

    forced : windows taken though they did not converge or their error was too large, of `windows`; the last ended at
    forced_t [s].
    """

    temperatures: temperatures.TemperatureLog = field(default_factory=temperatures.TemperatureLog)
    rhythm: rhythm.RhythmLog = field(default_factory=rhythm.RhythmLog)
    passing: passing.PassingLog = field(default_factory=passing.PassingLog)
    windows: int = 0
    forced: int = 0
    forced_t: float = 0.0


class TrustWatch:
    """Measures what can be wrong.  It remembers nothing between windows but what its log holds."""

    def __init__(self, interface: Interface, models: Mapping[str, Mapping[str, Any]]) -> None:
        self._interface = interface
        self._data = temperatures.TemperatureData(models["thermal"])
        self._sides = passing.Sides(interface)
        self._prescribed = models["mechanical"].get("half") == "rigid"
        self._bodies = [np.flatnonzero(interface.node_body == k) for k in range(len(interface.bodies))]

    def begun(self, now: Level) -> TrustLog:
        """Return the log before the first window."""
        return TrustLog(temperatures.begun(now), passing=self._sides.begun(now))

    def after(self, log: TrustLog, levels: tuple[Level, Level], terms: Mapping[str, float], *, fresh: bool,
              forced: bool) -> TrustLog:
        """Return the log after a window that was taken.

        levels : at its start and its end.  terms : its heat, mechanism -> [J].  fresh : it begins at a kink of the
        data.  forced : it was taken though it did not converge, or its error is too large.
        """
        before, now = levels
        warmth = temperatures.watched(log.temperatures, self._data, before, now, terms)
        return replace(
            log, windows=log.windows + 1, forced=log.forced + forced, forced_t=now.t if forced else log.forced_t,
            temperatures=warmth,
            rhythm=rhythm.watched(log.rhythm, levels, warmth.most - warmth.least, self._bodies, fresh),
            passing=self._sides.watched(log.passing, before, now))

    def judged(self, log: TrustLog, totals: Mapping[str, float]) -> tuple[Check, ...]:
        """Return the table.  totals : the ledger's terms over the run [J]."""
        off = imbalance(totals)
        return (
            temperatures.check(log.temperatures, self._place(log.temperatures.node)),
            *rhythm.checks(log.rhythm, self._place(log.rhythm.node), self._interface.bodies),
            *passing.checks(log.passing, self._place(log.passing.node), bool(self._interface.pairs), self._prescribed),
            measured("heat balance", off, BALANCE, what=f"{off:.2g} of the heat moved is not accounted for",
                     remedy="A smaller thermal.tolerance closes it"),
            measured("windows solved to their tolerance", log.forced, (0, 0), unit="windows", t=log.forced_t,
                     what=f"{log.forced} of {log.windows} windows were taken though they did not converge or their "
                          f"error was too large, the last to t = {log.forced_t:.6g} s",
                     remedy="Smaller windows; a smaller coupling.adaptive.least; iteration.on_max: retry_smaller"))

    def _place(self, node: int) -> str:
        """A node in words."""
        if node < 0:
            return "a node"
        x, y = self._interface.nodes[node]
        body = int(self._interface.node_body[node])
        name = self._interface.bodies[body] if body >= 0 else "no body"
        return f"{name} at ({x:.6g}, {y:.6g}) m"
