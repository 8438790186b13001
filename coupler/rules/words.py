"""What rules look at and do, in words: for the console, the results and the report."""

from __future__ import annotations

import math
from collections.abc import Iterable

from coupler.rules.model import Action, Change, Give, Of, Retry, Stop, Substeps, Test, UseScheme, Window


def did(actions: Iterable[Action]) -> str:
    """Actions in words, one after the other."""
    return ", ".join(_one(a) for a in actions)


def looked_at(test: Test) -> str:
    """A monitor, or `rate of` it."""
    return test.monitor if test.of is Of.VALUE else f"{test.of.value} of {test.monitor}"


def _one(action: Action) -> str:
    match action:
        case Retry():
            return f"window put back, x{action.window:g}"
        case Substeps():
            return f"{action.half}.substeps {_to(action.count)}"
        case Give():
            return f"{action.half}.{action.name} {_to(action.value)}"
        case UseScheme():
            return f"scheme {action.scheme.value}"
        case Window():
            return f"window {_to(action.size)}" + ("" if math.isnan(action.size.to) else " s at most")
        case Stop():
            return f"stop: {action.reason}" if action.reason else "stop"


def _to(change: Change) -> str:
    return f"x{change.times:g}" if math.isnan(change.to) else f"{change.to:.6g}"
