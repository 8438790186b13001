"""What goes up and down from window to window though nothing drives it: ringing, and cycles of the exchange.

A midpoint rule multiplies what is stiff by nearly -1 a step, and an explicit exchange beyond its limit ends in a cycle
of 2, 3 or more windows; both keep the heat balance.  Either is seen without knowing the answer: a physical oscillation
that windows resolve takes more than MOST_PERIOD of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]

# A node rings if its change has turned its sign in so many windows on end, each time by more than LIMIT of the span.
TURNS = 4
NOTE_AT, LIMIT = 1e-3, 1e-2
# Periods looked for [windows], how nearly a cycle comes back, as a share of its height, and how often it must.
LEAST_PERIOD, MOST_PERIOD, RETURNS, ROUNDS = 3, 7, 0.1, 3
RINGS, CYCLES = "no ringing in time", "no cycle of the exchange"
FAINT = 1e-5  # of the span of all temperatures: changes below are round-off and iteration error


@dataclass(frozen=True)
class RhythmLog:
    """What is remembered.

    change : (n_nodes,) [K] of the last window.  turns : (n_nodes,) signs turned on end.  least : (n_nodes,) [K] the
    smallest change among those.  share : the largest ringing over the span of all temperatures, of a node at t [s].
    history : (n, n_bodies) [K] mean temperatures of the last windows, a row each: gaps and pressures of what slides go
    up and down with every edge it passes.  ranges : (2, n_bodies) [K] their least and largest.
    period [windows], cycle_share (of the range), column : of the largest cycle seen, at cycle_t [s].
    """

    change: Array = field(default_factory=lambda: np.empty(0))
    turns: Array = field(default_factory=lambda: np.empty(0))
    least: Array = field(default_factory=lambda: np.empty(0))
    share: float = 0.0
    node: int = -1
    t: float = 0.0
    history: Array = field(default_factory=lambda: np.empty((0, 0)))
    ranges: Array = field(default_factory=lambda: np.empty((2, 0)))
    period: int = 0
    cycle_share: float = 0.0
    column: int = -1
    cycle_t: float = 0.0


def watched(log: RhythmLog, levels: tuple[Level, Level], span: float, means: Array, fresh: bool) -> RhythmLog:
    """Return the log after one more window.

    levels : at its start and its end.  span : [K] of all temperatures so far, above 0.  means : (n_bodies,) [K] of the
    bodies at its end.  fresh : the window begins at a breakpoint or a jump of the data.
    """
    # fault: small scenes may ring and cycle -> span = max(span, 1e3) |
    #   coupler/test_trust::test_small_differences_of_temperature_ring_and_cycle_like_large_ones
    return _cycles(_ringing(log, levels, span, fresh), levels[1].t, means, FAINT * span, fresh)


def _ringing(log: RhythmLog, levels: tuple[Level, Level], span: float, fresh: bool) -> RhythmLog:
    before, now = levels
    change = now.T - before.T
    if not log.change.size or fresh:
        return replace(log, change=change, turns=np.zeros(len(change)), least=np.abs(change))
    turned = change * log.change < 0.0
    turns = np.where(turned, log.turns + 1.0, 0.0)
    least = np.where(turned, np.minimum(log.least, np.abs(change)), np.abs(change))
    log = replace(log, change=change, turns=turns, least=least)
    rings = np.where(turns >= TURNS, least, 0.0)
    worst = int(rings.argmax())
    share = float(rings[worst]) / span
    # fault: ringing is not seen -> return log | coupler/test_trust
    return replace(log, share=share, node=worst, t=now.t) if share > max(log.share, FAINT) else log


def _cycles(log: RhythmLog, t: float, row: Array, floor: float, fresh: bool) -> RhythmLog:
    ranges = np.array([row, row]) if not log.ranges.size else np.array([np.minimum(log.ranges[0], row),
                                                                        np.maximum(log.ranges[1], row)])
    kept = np.empty((0, len(row))) if fresh or not log.history.size else log.history
    history = np.vstack([kept, row])[-(ROUNDS * MOST_PERIOD + 1):]
    log = replace(log, history=history, ranges=ranges)
    if len(history) <= ROUNDS * LEAST_PERIOD:
        return log
    # What does not come back at all, as most courses do not, ends the search here.
    highest, now_and_then = np.ptp(history[-MOST_PERIOD - 1:], axis=0), history[-MOST_PERIOD - 1:-LEAST_PERIOD]
    if not ((np.abs(now_and_then - row) <= RETURNS * highest) & (highest > floor)).any():
        return log
    # fault: cycles are not seen -> for period in (): | coupler/test_trust
    for period in range(LEAST_PERIOD, MOST_PERIOD + 1):
        n = ROUNDS * period
        if len(history) <= n:
            break
        last = history[-n - 1:]
        height = np.ptp(last[-period - 1:], axis=0)
        back = np.abs(last[period:] - last[:-period]).max(axis=0)
        # Each round goes up and down: a slow drift comes back to nothing.
        share = np.where((back <= RETURNS * height) & (height > floor),
                         height / np.maximum(np.ptp(ranges, axis=0), floor), 0.0)
        column = int(share.argmax())
        if share[column] > log.cycle_share:
            log = replace(log, period=period, cycle_share=float(share[column]), column=column, cycle_t=t)
    return log


def checks(log: RhythmLog, where: str, bodies: Sequence[str]) -> tuple[Check, Check]:
    """Return the two checks at the end.  where : of the node that rings most, in words.  bodies : their names."""
    ringing = measured(
        RINGS, log.share, (NOTE_AT, LIMIT), t=log.t,
        what=f"the temperature of {where} alternates up and down in {TURNS} or more windows in a row, by "
             f"{100 * log.share:.3g} % of the span of all temperatures, until t = {log.t:.6g} s",
        remedy="Use thermal.method: sdirk2 or backward_euler; if the exchange is the cause, scheme: iterated or "
               "smaller windows. An oscillation that windows of half the size do not change is physical")
    if not log.history.size:
        return ringing, Check(CYCLES, TrustVerdict.UNCHECKED, what="there was no window")
    cycle = measured(
        CYCLES, log.cycle_share, (NOTE_AT, LIMIT), t=log.cycle_t,
        what=f"the mean temperature of {bodies[log.column]} repeats itself every {log.period} windows, a cycle of "
             f"{100 * log.cycle_share:.3g} % of its range, until t = {log.cycle_t:.6g} s: typical of an explicit "
             "exchange beyond its stability limit",
        remedy="Use scheme: iterated or smaller windows. A cycle that windows of half the size do not change is "
               "physical")
    return ringing, cycle
