"""How near drives of rules hold their monitors to their targets.

A drive that answers too fast for what it drives (a `lag` or a gain that is not that of the scene) swings about its
target for ever, one at a bound of its load never gets there.  The run solves what it was told to, so that is noted and
breaks nothing.  What counts is the mean distance, each time weighted by how long the drive has been on: the way to the
target counts little once it is held.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from coupler.scenario.rule_model import Rule, When
from coupler.trust.checks import Check, measured
from coupler.trust.in_time.instants import Acted

NAME = "drives hold their targets"
NOTE_AT = 0.1  # of the range of the monitor, or of its logarithm: what is seen in a curve as a miss
MOST = 1.0  # of a logarithm: a monitor that is more than 2.7 times its target is not held at all


@dataclass(frozen=True)
class Held:
    """Of one drive.  since [s]: when it began.  low, high : of its monitor, and its target.

    missed, time [s2]: sums of distance [unit of the monitor, or 1 of its logarithm] and of 1, over time, each by how
    long the drive had been on.  crossed : how often the monitor passed the target.  above : where it is now.
    """

    since: float
    low: float
    high: float
    missed: float = 0.0
    time: float = 0.0
    crossed: int = 0
    above: bool = False


@dataclass(frozen=True)
class DriveLog:
    """held : of each rule with a drive."""

    held: Mapping[str, Held] = field(default_factory=dict)


def always_on(rules: Sequence[Rule]) -> tuple[Rule, ...]:
    """Return the rules whose drives are on at known times: those without conditions."""
    return tuple(rule for rule in rules if rule.drive is not None and rule.when == When())


def watched(log: DriveLog, acted: Acted, rules: Sequence[Rule]) -> DriveLog:
    """Return the log after a window.  rules : as of `always_on`."""
    held = dict(log.held)
    for rule in rules:
        drive = rule.drive
        value = math.nan if drive is None else acted.monitors.get(drive.monitor, math.nan)
        # fault: a drive is held to its target before it is on -> if drive is None or math.isnan(value): |
        #   coupler/test_trust_drives
        if drive is None or math.isnan(value) or not rule.after < acted.t <= rule.until:
            continue
        start = acted.t - acted.H
        known = held.get(rule.name, Held(start, drive.target, drive.target, above=value > drive.target))
        off = _off(value, drive.target) if drive.log else abs(value - drive.target)
        # fault: the way to a target counts as much as what is held there -> weight = acted.H |
        #   coupler/test_trust_drives
        weight = acted.H * (acted.t - known.since)
        before = acted.before.get(drive.monitor, math.nan)
        values = [v for v in (known.low, known.high, value, before) if not math.isnan(v)]
        held[rule.name] = replace(
            known, low=min(values), high=max(values), missed=known.missed + weight * off,
            time=known.time + weight, crossed=known.crossed + ((value > drive.target) != known.above),
            above=value > drive.target)
    return DriveLog(held)


def _off(value: float, target: float) -> float:
    """Return how far the logarithms are apart, at most MOST."""
    return min(abs(math.log(value / target)), MOST) if value * target > 0.0 else MOST


def checks(log: DriveLog, rules: Sequence[Rule]) -> tuple[Check, ...]:
    """Return the check at the end; none without drives that were on."""
    shares: dict[str, float] = {}
    for rule in rules:
        if rule.drive is not None and (of := log.held.get(rule.name)) is not None and of.time > 0.0:
            mean, span = of.missed / of.time, of.high - of.low
            span = _off(of.high, of.low) if rule.drive.log else span
            shares[rule.name] = mean / span if span > 0.0 else 0.0
    if not shares:
        return ()
    name = max(shares, key=lambda n: shares[n])
    drive, of = next(r.drive for r in rules if r.name == name), log.held[name]
    assert drive is not None
    swings = of.crossed > 1
    how = "it passed it once" if of.crossed else "it never got there"
    how = f"it passed it {of.crossed} times" if swings else how
    remedy = ("Give a `lag`, the time in which what is driven answers to the load, a smaller `gain` or a `rate`"
              if swings else
              f"Give the load wider bounds than {drive.least:g} to {drive.most:g}, or the drive more time or a "
              "smaller `lag`")
    return (measured(NAME, shares[name], (NOTE_AT, math.inf), remedy=remedy,
                     what=f"rule {name} misses its target for {drive.monitor} by "
                          f"{100.0 * shares[name]:.3g} % of the range of that in the mean, what came late counting "
                          f"most; {how}"),)
