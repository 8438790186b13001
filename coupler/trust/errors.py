"""The estimated error of each probe over a run, from the errors of its windows.

Now and then a window is solved again as two halves (coupler.control.spare), or always where windows find their own
size: the difference of the two answers is most of what that window did wrong.  In between, the error of a probe goes
with how much it bends, |H^2 v''|, by the ratio of the sums of both over the windows that were looked at and bent about
as much (the separate ratio estimator of survey sampling: Cochran, Sampling Techniques, chapter 6): the window in which
a body touches tells nothing of those in which it slides.  What is told is the sum over all windows, as if none of it
died out: a bound, where small disturbances do not grow by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]

NAME = "estimated error of the probes"
# Of the range of a probe.  The sum overstates, for conduction forgets: on the cases of docs/trust.md it is 1 to 16
# times the true error, 4 times in the middle.  So these are about 2 % and 12 % of true error.
NOTE_AT, LIMIT = 0.1, 0.5
# A probe that hardly moves is held against this part of the largest range of its unit.
SMALL = 0.01
ROUND_OFF = 1e-9  # of the largest value
# Bends of a class lie within a factor of 10^(1/2) of each other, the first from 1e-16 in SI on.
CLASSES, CLASS, LEAST = 64, 0.5, -16.0
# A probe that is off by more of its bend, four times what a parabola leaves its chord by, jumped within that window:
# that tells nothing of others.
MOST = 0.5


def _empty() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class Looked:
    """What was seen of the probes in one window, (n,) each in SI.

    values : at its end.  second : |H^2 v''|.  error : estimate of what the window did wrong; empty where it was not
    looked at.  solves : of either half that this cost beyond the run's own.
    m : what the window makes of a disturbance; nan: not measured.  limit [s] : the longest window that is stable.
    """

    values: Array
    second: Array
    error: Array = field(default_factory=_empty)
    solves: int = 0
    m: float = math.nan
    limit: float = math.inf


@dataclass(frozen=True)
class ErrorLog:
    """Sums over the windows so far, (n,) each in SI.

    low, high, most : of the probes, and of their sizes.  known : errors of windows that were looked at.
    errors, bends : (n, CLASSES) errors and second differences of those, by how much they bent.  rest : (n, CLASSES)
    second differences of the others.
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
    classes = np.zeros((len(values), CLASSES))
    return ErrorLog(values, values, np.abs(values), none, classes, classes, classes)


def watched(log: ErrorLog, seen: Looked, t: float) -> ErrorLog:
    """Return the log after a window to t [s]."""
    log = replace(log, windows=log.windows + 1, low=np.fmin(log.low, seen.values), high=np.fmax(log.high, seen.values),
                  most=np.fmax(log.most, np.abs(seen.values)), solves=log.solves + seen.solves)
    if not seen.error.size:
        return replace(log, rest=_added(log.rest, seen.second, seen.second))
    share = float((seen.error / np.maximum(log.high - log.low, ROUND_OFF * log.most + 1e-300)).max(initial=0.0))
    return replace(log, looked=log.looked + 1, known=log.known + seen.error, worst=max(share, log.worst),
                   t=t if share > log.worst else log.t, errors=_added(log.errors, seen.error, seen.second),
                   bends=_added(log.bends, seen.second, seen.second))


def _added(sums: Array, values: Array, second: Array) -> Array:
    """Return (n, CLASSES) sums with one more value each, in the class of its second difference."""
    place = np.floor((np.log10(np.maximum(second, 10.0**LEAST)) - LEAST) / CLASS).astype(int)
    added = sums.copy()
    added[np.arange(len(values)), np.minimum(place, CLASSES - 1)] += values
    return added


def estimated(log: ErrorLog) -> Array:
    """Return the estimated error of each probe at most, (n,) in SI."""
    # fault: only the windows that were looked at have errors -> return log.known | coupler/test_trust_errors
    return log.known + np.array([_carried_on(*rows) for rows in zip(log.errors, log.bends, log.rest, strict=True)])


def _carried_on(errors: Array, bends: Array, rest: Array) -> float:
    """The errors of windows not looked at, of one probe: by the ratio of their class.

    Where no window of it was looked at, by the smaller of that of the nearest class and that of all: the ratio is
    large where a probe hardly bends, for there it only passes from one way of bending to the other.
    """
    known, asked = np.flatnonzero(bends), np.flatnonzero(rest)
    if not known.size or not asked.size:
        return 0.0
    nearest = known[np.abs(asked[:, None] - known[None, :]).argmin(axis=1)]
    ratios, all_of_them = errors[nearest] / bends[nearest], errors.sum() / bends.sum()
    # fault: the ratio of all windows for each -> return float(all_of_them * rest.sum()) | coupler/test_trust_errors
    ratios = np.where(nearest == asked, ratios, np.minimum(ratios, all_of_them))
    return float(np.minimum(ratios, MOST) @ rest[asked])


def scales(log: ErrorLog, units: Sequence[str]) -> Array:
    """Return what each error is held against, (n,) in SI: its range, or a share of the largest of its unit.

    units : of the probes.
    """
    ranges = log.high - log.low
    largest = {u: max(r for v, r in zip(units, ranges, strict=True) if v == u) for u in set(units)}
    floor = np.array([SMALL * largest[u] for u in units]) if units else np.zeros(0)
    return np.maximum.reduce([ranges, floor, ROUND_OFF * log.most])


@dataclass(frozen=True)
class ProbeError:
    """error : a probe may be off by over the run.  range : how far it went.  Both in `unit`, which is SI."""

    error: float
    range: float
    unit: str


def table(log: ErrorLog, probes: Mapping[str, str]) -> dict[str, ProbeError]:
    """Return the probes with their errors.  probes : name -> unit."""
    if not log.looked:
        return {}
    return {name: ProbeError(float(e), float(high - low), unit)
            for (name, unit), e, low, high in zip(probes.items(), estimated(log), log.low, log.high, strict=True)}


def check(log: ErrorLog, probes: Mapping[str, str], adaptive: bool) -> Check:
    """Return the check at the end.  probes : name -> unit.  adaptive : whether windows find their own size."""
    if not log.looked:
        return Check(NAME, TrustVerdict.UNCHECKED,
                     what="no window could be solved twice: a half keeps no states")
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
