"""How late rules act that change a load or end the run: what they look at passes its bound inside a window.

A rule is asked at the ends of windows.  Where windows do not end at its bound (`coupling.events.locate`) it acts late,
and by how far the quantity had gone past the bound by then the scene is another than the one that was meant.  Halves
of the same window do not see this error, for they know nothing of the rule.  A quantity that jumps (a pressure at
touch) tells nothing of how late that is: there it is the time that counts, beside the time that the run has taken.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from coupler.scenario.rule_model import Passed
from coupler.trust.checks import Check, measured

NAME = "rules act in time"
# Of the range of what the rule looks at: what is seen in a curve, and what no sketch may be off by (errors.LIMIT).
NOTE_AT, LIMIT = 0.02, 0.2
# A quantity that changes by so many times as much as in the window before jumps.
JUMP = 10.0


@dataclass(frozen=True)
class InstantLog:
    """low, high, change : of each monitor, over the run, and by how much it changed in the last window.

    worst : the largest share so far, of a rule in the window to t [s], `late` [s] and `over` past its bound.
    """

    low: Mapping[str, float] = field(default_factory=dict)
    high: Mapping[str, float] = field(default_factory=dict)
    change: Mapping[str, float] = field(default_factory=dict)
    worst: float = 0.0
    rule: str = ""
    monitor: str = ""
    late: float = 0.0
    over: float = 0.0
    t: float = 0.0


@dataclass(frozen=True)
class Acted:
    """What rules did in a window of H to t [s].

    before, monitors : at its start and its end.  late : rule -> how far its bound was passed.  located : the window
    ends at an event.
    """

    t: float
    H: float
    before: Mapping[str, float]
    monitors: Mapping[str, float]
    late: Mapping[str, Passed]
    located: bool = False


def watched(log: InstantLog, acted: Acted) -> InstantLog:
    """Return the log after a window."""
    low, high = dict(log.low), dict(log.high)
    # fault: where a monitor began is no part of its range -> for values in (acted.monitors,): |
    #   coupler/test_rules_instant
    for values in (acted.before, acted.monitors):
        for name, value in values.items():
            if not math.isnan(value):
                low[name], high[name] = min(low.get(name, value), value), max(high.get(name, value), value)
    change = {n: abs(v - acted.before[n]) for n, v in acted.monitors.items() if n in acted.before}
    before, log = log.change, replace(log, low=low, high=high, change=change)
    # fault: a rule that is located is told as late -> if False: | coupler/test_rules_instant
    if acted.located:
        return log
    for rule, passed in acted.late.items():
        name, late = passed.monitor, passed.part * acted.H
        jumps = change.get(name, 0.0) > JUMP * before[name] if name in before else False
        share = late / acted.t if jumps else passed.over / (high[name] - low[name])
        if share > log.worst:
            log = replace(log, worst=share, rule=rule, monitor=name, late=late, over=passed.over, t=acted.t)
    return log


def checks(log: InstantLog, has_instants: bool) -> tuple[Check, ...]:
    """Return the check at the end, none where no rule acts on the scene."""
    # fault: late rules are not told -> if True: | coupler/test_rules_instant
    if not has_instants:
        return ()
    what = (f"rule {log.rule} acted up to {log.late:.3g} s late, at t = {log.t:.6g} s: {log.monitor} had gone "
            f"{log.over:.3g} past its bound")
    return (measured(NAME, log.worst, (NOTE_AT, LIMIT), what=what, t=log.t,
                     remedy="Use coupling.events.locate (adaptive windows have it), or shorter windows"),)
