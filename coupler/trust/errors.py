"""The estimated error of each probe over a run, from the errors of its windows.

Now and then a window is solved again as two halves (coupler.control.spare), or always where windows find their own
size: the difference of the two answers is most of what that window did wrong.  In between, the error of a probe goes
with how much it bends, |H^2 v''|, by the ratio of the sums of both over the windows that were looked at (the ratio
estimator of survey sampling: Cochran, Sampling Techniques, chapter 6).  What is told is the sum over all windows, as if
none of it died out: a bound, where small disturbances do not grow by themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]

NAME = "estimated error of the probes"
# Of the range of a probe.  The sum overstates, for conduction forgets: on the cases of docs/trust.md it is 1 to 16
# times the true error, 4 times in the middle.  So these are about 2 % and 10 % of true error.
NOTE_AT, LIMIT = 0.1, 0.3
# A probe that hardly moves is held against this part of the largest range of its unit.
SMALL = 0.01
ROUND_OFF = 1e-9  # of the largest value


def _empty() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class Looked:
    """What was seen of the probes in one window, (n,) each in SI.

    values : at its end.  second : |H^2 v''|.  error : estimate of what the window did wrong; empty where it was not
    looked at.  solves : of either half that this cost beyond the run's own.
    """

    values: Array
    second: Array
    error: Array = field(default_factory=_empty)
    solves: int = 0


@dataclass(frozen=True)
class ErrorLog:
    """Sums over the windows so far, (n,) each in SI.

    low, high, most : of the probes, and of their sizes.  known : errors of windows that were looked at.
    errors, bends : errors and second differences of those of them that tell the ratio: all but a first window, which
    has no history.  rest : second differences of the others.
    windows : of which `looked` were looked at, for `solves` half-solves; worst : the largest error, of a probe's range
    then, in the window to t [s].
    """

    low: Array = field(default_factory=_empty)
    high: Array = field(default_factory=_empty)
    most: Array = field(default_factory=_empty)
    known: Array = field(default_factory=_empty)
    errors: Array = field(default_factory=_empty)
    bends: Array = field(default_factory=_empty)
    rest: Array = field(default_factory=_empty)
    windows: int = 0
    looked: int = 0
    solves: int = 0
    worst: float = 0.0
    t: float = 0.0


def begun(values: Array) -> ErrorLog:
    """Return the log at the start.  values : (n,) of the probes in SI."""
    values, none = np.where(np.isfinite(values), values, 0.0), np.zeros(len(values))
    return ErrorLog(values, values, np.abs(values), none, none, none, none)


def watched(log: ErrorLog, seen: Looked, t: float) -> ErrorLog:
    """Return the log after a window to t [s]."""
    first = log.windows == 0
    log = replace(log, windows=log.windows + 1, low=np.fmin(log.low, seen.values), high=np.fmax(log.high, seen.values),
                  most=np.fmax(log.most, np.abs(seen.values)), solves=log.solves + seen.solves)
    if not seen.error.size:
        return replace(log, rest=log.rest + seen.second)
    share = float((seen.error / np.maximum(log.high - log.low, ROUND_OFF * log.most + 1e-300)).max(initial=0.0))
    log = replace(log, looked=log.looked + 1, known=log.known + seen.error, worst=max(share, log.worst),
                  t=t if share > log.worst else log.t)
    if first:
        return log
    return replace(log, errors=log.errors + seen.error, bends=log.bends + seen.second)


def estimated(log: ErrorLog) -> Array:
    """Return the estimated error of each probe at most, (n,) in SI."""
    told = log.errors.any() or not log.known.any()
    ratio = np.divide(log.errors if told else log.known, log.bends, out=np.zeros_like(log.bends), where=log.bends > 0.0)
    # fault: only the windows that were looked at have errors -> return log.known | coupler/test_trust_errors
    return log.known + ratio * log.rest


def scales(log: ErrorLog, units: Sequence[str]) -> Array:
    """Return what each error is held against, (n,) in SI: its range, or a share of the largest of its unit.

    units : of the probes.
    """
    ranges = log.high - log.low
    largest = {u: max(r for v, r in zip(units, ranges, strict=True) if v == u) for u in set(units)}
    floor = np.array([SMALL * largest[u] for u in units]) if units else np.zeros(0)
    return np.maximum.reduce([ranges, floor, ROUND_OFF * log.most])


def table(log: ErrorLog, probes: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Return probe -> error, range and unit, SI, for a results file.  probes : name -> unit."""
    if not log.looked:
        return {}
    return {name: {"error": float(e), "range": float(high - low), "unit": unit}
            for (name, unit), e, low, high in zip(probes.items(), estimated(log), log.low, log.high, strict=True)}


def check(log: ErrorLog, probes: Mapping[str, str], adaptive: bool) -> Check:
    """Return the check at the end.  probes : name -> unit.  adaptive : whether windows find their own size."""
    if not log.looked:
        return Check(NAME, TrustVerdict.UNCHECKED,
                     what="no window could be solved twice: a half keeps no states, or there were fewer than three")
    names, scale = list(probes), scales(log, list(probes.values()))
    shares = np.divide(estimated(log), scale, out=np.zeros(len(names)), where=scale > 0.0)
    k = int(shares.argmax())
    unit = probes[names[k]]
    worst = [f"{names[i]} {100 * shares[i]:.3g} %" for i in np.argsort(-shares)[1:4] if shares[i] > NOTE_AT]
    return measured(
        NAME, float(shares[k]), (NOTE_AT, LIMIT), t=log.t,
        what=f"{names[k]} may be off by {100 * shares[k]:.3g} % of its range ({shares[k] * scale[k]:.3g} {unit})"
             + (f"; {', '.join(worst)}" if worst else "")
             + f": what {log.looked} of {log.windows} windows are off from two of half the size, added up over all as "
               "if nothing of it died out",
        remedy="A smaller coupling.adaptive.tolerance" if adaptive else
               "Windows of half the size, or coupling.adaptive, which finds them, show whether it is so; "
               "scheme: iterated takes what the exchange adds")
