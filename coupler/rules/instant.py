"""The instant at which a rule acts: where what it looks at passes a bound, and how far a window went past that.

A rule is asked at the ends of windows.  One that changes a load or ends the run acts on the scene itself, and windows
of any size should find the same instant: coupler.control.events ends a window there, as where contact opens or closes,
and a run says how late a rule was where it does not.  Rules that change how the run is solved, that count windows, that
look at a change or at what depends on the size of a window have no such instant.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence

from coupler.scenario.rule_model import COUPLER, Give, Of, Passed, Retry, Rule, Stop, Test
from coupler.schemes.sweep import OF_A_SUBSTEP

# Of the coupler's own monitors these are of the scene; the others are of how it is solved, or count points.
OF_THE_SCENE = frozenset({"t", "max_T", "max_p"})
# An input of a half that changes the scene.
LOADS = ("load.", "bc.")
HALVES = ("thermal", "mechanical")
LEAST = sys.float_info.min


def has_instant(rule: Rule) -> bool:
    """Whether a rule acts on the scene as soon as quantities of the scene pass bounds."""
    acts = any(isinstance(a, Stop) or (isinstance(a, Give) and a.name.startswith(LOADS)) for a in rule.do)
    back = any(isinstance(a, Retry) for a in rule.do)
    tests = tuple(rule.when)
    return acts and not back and bool(tests) and all(
        test.of is Of.VALUE and test.windows == 1 and _of_the_scene(test.monitor) for test in tests)


def _of_the_scene(monitor: str) -> bool:
    if monitor in COUPLER:
        return monitor in OF_THE_SCENE
    half, _, name = monitor.partition(".")
    return half not in HALVES or not name.startswith(OF_A_SUBSTEP)


def standing(rule: Rule, spent: bool, monitors: Mapping[str, float]) -> tuple[bool | None, tuple[float, ...]]:
    """Whether a rule acts at a level, and how far each quantity is from its bound that alone keeps it from that.

    rule : one that has an instant.  spent : it fires at most once, and has.  monitors : of the level, with "t".
    None: a monitor is not known.
    """
    if any(math.isnan(monitors.get(test.monitor, math.nan)) for test in rule.when):
        return None, ()
    # fault: a rule that is spent is looked for -> if monitors["t"] > rule.until: | coupler/test_rules_instant
    if spent or monitors["t"] > rule.until:
        return False, ()
    missing = [_missing((Test("t", above=rule.after), *rule.when.all), monitors)]
    groups = [_missing(group, monitors) for group in rule.when.any]
    if groups and any(not group for group in groups):
        groups = []
    if not missing[0] and not groups:
        return True, ()
    if not groups:
        return False, tuple(missing[0]) if len(missing[0]) == 1 else ()
    return False, () if missing[0] else tuple(group[0] for group in groups if len(group) == 1)


def _missing(tests: Sequence[Test], monitors: Mapping[str, float]) -> list[float]:
    """How far the quantities of tests that do not hold are from their bounds; never 0, for bounds do not count."""
    return [max(_distance(test, monitors[test.monitor]), LEAST) for test in tests
            if not test.holds(monitors[test.monitor])]


def _distance(test: Test, value: float) -> float:
    """How far a value is from the nearer bound that it has to pass."""
    return max(test.above - value, value - test.below)


def passed(rule: Rule, spent: bool, last: Mapping[str, float], monitors: Mapping[str, float]) -> Passed | None:
    """Return how far past its bound a quantity was at the end of the window in which a rule began to hold.

    last, monitors : at the start and the end of it.  None: it has no instant in this window.  Of several quantities
    that passed a bound the last one tells, for the rule acts then.
    """
    if not has_instant(rule) or standing(rule, spent, last)[0] is not False or not standing(rule, spent, monitors)[0]:
        return None
    found = []
    for test in (Test("t", above=rule.after), *rule.when):
        before, now = last[test.monitor], monitors[test.monitor]
        if test.holds(now) and not test.holds(before):
            over = abs(now - (test.above if before <= test.above else test.below))
            found.append(Passed(test.monitor, over, over / abs(now - before)))
    return min(found, key=lambda p: p.part, default=None)
