"""The estimated error of each probe over a run, from the errors of its windows.

Now and then a window is solved again as two halves (coupler.control.spare), or always where windows find their own
size: the difference of the two answers is most of what that window did wrong.  In between, the error of a probe goes
with how much it bends, |H^2 v''|, or a tenth of its change where that is more (what is held over a window errs by its
change), by the ratio of the sums of both over the windows that were looked at and bent about as much (the separate
ratio estimator of survey sampling: Cochran, Sampling Techniques, chapter 6): the window in which a body touches tells
nothing of those in which it slides.

Where contact closes or opens, in a window or the one before, a probe errs by how far off that instant is, at most about
half a window, times the jump in its slope, which is half of what it bends more than before.  Those windows are a class
of their own, whatever they bend by: what is measured in them is taken for no smooth one.  So is a window in which
a probe bends by several times as much as in the one before and no datum has a kink (a front that passes a node); what
that leaves is local in time, and dies out by a factor of e a window.

What a window did wrong is carried on to later ones.  Where data stay as they are a small difference of two courses
obeys the same linear equation as the velocity of the probes itself (differentiate y' = f(y) by t: the variational
equation; Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, chapter I.14), so it dies out as that
does: by the ratio of the velocities at the end and at the start of a window, all probes together, and by no more than
`PATIENCE` windows allow, for a velocity also turns round.  Past a kink of the data nothing is forgotten, and nothing is
taken to grow but what is a shift of time, which stays (coupler.trust.in_time.time_shift).  What is told is the
largest error at a time, by either.  Errors of what moves with inertia do not die out (coupler.trust.in_time.phases).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from coupler.trust.checks import Check, TrustVerdict, amount, measured
from coupler.trust.in_time import phases, time_shift
from coupler.trust.in_time.phases import Mask, PhaseLog
from coupler.trust.in_time.time_shift import Shift, ShiftLog, Turning

Array = NDArray[np.float64]

NAME = "estimated error of the probes"
# Of the range of a probe.  What is told is 1.4 times the true error in the middle, and up to 10 times too much or too
# little where looks are few or meet a switch of contact (docs/trust.md): these are about 4 %, which is seen in a curve,
# and 20 %, which no sketch may be off by.
NOTE_AT, LIMIT = 0.05, 0.3
# The velocity that errors die out with is the largest of late, which falls by a factor of e in so many windows.
PATIENCE = 4.0
# A probe that hardly moves is held against this part of the largest range of its unit.
SMALL = 0.01
# One that stays as it is moves by what solvers leave, some 1e-8 of its value: it is held against this part of that.
# fault: what solvers leave is taken for an error of windows -> SOLVED = 1e-9 | coupler/test_trust_errors
SOLVED = 1e-6
# Of a temperature that is its distance from absolute zero, which small differences have nothing to do with; solvers
# leave some 1e-12 of it.
# fault: small differences of temperature are held against absolute zero -> SOLVED_T = SOLVED |
#   coupler/test_trust_errors
SOLVED_T = 1e-9
# A contact pressure settles to 1e-3 of the largest (augmented.tolerance), and mostly to a tenth of that.
# fault: what is left where pressures settle is taken for an error of windows -> SETTLED = SOLVED |
#   coupler/test_trust_errors::test_a_pressure_that_stays_is_held_against_what_it_settles_to
SETTLED = 1e-4
NO_FLOORS: Mapping[str, float] = MappingProxyType({})
# Of a probe that is 0 all the time but in a look, such as a pressure before the touch, the share is without bound.
TINY = 1e-300
# Bends of a class lie within a factor of 10^(1/2) of each other, the first from 1e-16 in SI on.
CLASSES, CLASS, LEAST = 64, 0.5, -16.0
# A probe that was once off by more of its bend, four times what a parabola leaves its chord by, jumped within that
# window: that tells nothing of others.
MOST = 0.5
# By how many windows contact that closes or opens inside one may be early or late, so what part of its bend is an
# error: at most, and at least where some were looked at, which may have been other switches.
AT_SWITCH, AT_LEAST = 0.5, 0.15
# A probe jumps inside a window where it bends so many times as much as it would have, going on as in the one before,
# and by this part of its range.
JUMP, VISIBLE = 4.0, 0.01
# A probe that hardly bends errs by this share of its change as by a bend: x that is held, heat that is late.
CHANGE = 0.1


def _empty() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class Looked:
    """What was seen of the probes in one window, (n,) each in SI.

    values : at its end.  second : |H^2 v''|.  error : estimate of what the window did wrong; empty where it was not
    looked at.  in_one : what it did wrong solved in one, as windows are that are not looked at; the same as error
    where that is what was kept.  solves : of either half that this cost beyond the run's own.
    switch : whether contact closes or opens in it, or did in the one before.  by_itself : whether its end depends on
    nothing inside it, so that what jumps there makes it no more wrong.
    turning, shift : of the temperatures, and by how much the window shifts the run (coupler.trust.in_time.time_shift);
    None: they shift nothing.
    m : what the window makes of a disturbance; nan: not measured.  limit [s] : the longest window that is stable.
    growth : of a disturbance of a steady state (coupler.control.own_growth); nan: not measured.
    """

    values: Array
    second: Array
    error: Array = field(default_factory=_empty)
    in_one: Array = field(default_factory=_empty)
    solves: int = 0
    switch: bool = False
    by_itself: bool = False
    turning: Turning | None = None
    shift: Shift | None = None
    m: float = math.nan
    limit: float = math.inf
    growth: float = math.nan


@dataclass(frozen=True)
class ErrorLog:
    """Sums over the windows so far, (n,) each in SI.

    low, high, most : of the probes, and of their sizes.  values, at [s] : of the last window's end.  pace [1/s]: how
    fast they went of late.  told : of each its largest error so far.
    known : what is left of the errors of windows that were looked at.  errors, bends, counts : (n, CLASSES) errors and
    bends of those, by how much they bent, and how many.  rest : (n, CLASSES) what is left of the bends of the others.
    switches : what is left of the bends that windows at a switch of contact that were not looked at have beyond those
    of before.  jumps : what is left of the errors of such in which a probe jumped.
    at_switch : (n, 2) errors and bends of either that were looked at, milder : of those that erred by no more than MOST
    of what they bent.
    curve [1/s2]: |v''| of the last window that is at no switch.  shifts : what shifts the run in time.
    phases : of probes whose errors do not die out.
    windows : of which `looked` were looked at, for `solves` solver calls; worst : the largest error, of a probe's range
    then, in the window to t [s].
    """

    low: Array = field(default_factory=_empty)
    high: Array = field(default_factory=_empty)
    most: Array = field(default_factory=_empty)
    values: Array = field(default_factory=_empty)
    at: float = 0.0
    pace: Array = field(default_factory=_empty)
    told: Array = field(default_factory=_empty)
    known: Array = field(default_factory=_empty)
    errors: Array = field(default_factory=_empty)
    bends: Array = field(default_factory=_empty)
    counts: Array = field(default_factory=_empty)
    rest: Array = field(default_factory=_empty)
    switches: Array = field(default_factory=_empty)
    at_switch: Array = field(default_factory=_empty)
    milder: Array = field(default_factory=_empty)
    jumps: Array = field(default_factory=_empty)
    curve: Array = field(default_factory=_empty)
    shifts: ShiftLog = field(default_factory=ShiftLog)
    phases: PhaseLog = field(default_factory=PhaseLog)
    windows: int = 0
    looked: int = 0
    solves: int = 0
    worst: float = 0.0
    t: float = 0.0


def begun(values: Array, t: float = 0.0, lasts: Mask | None = None) -> ErrorLog:
    """Return the log at the start.

    values : (n,) of the probes in SI, at t [s].  lasts : (n,) whose errors do not die out; None: nobody's.
    """
    values, none = np.where(np.isfinite(values), values, 0.0), np.zeros(len(values))
    classes = np.zeros((len(values), CLASSES))
    return ErrorLog(values, values, np.abs(values), values, t, none, none, none, classes, classes, classes, classes,
                    none, np.zeros((len(values), 2)), np.zeros((len(values), 2)), none,
                    shifts=time_shift.begun(values, t), phases=PhaseLog() if lasts is None else phases.begun(lasts))


def watched(log: ErrorLog, seen: Looked, t: float, *, fresh: bool = False) -> ErrorLog:
    """Return the log after a window to t [s].  fresh : it begins at a kink of the data."""
    before, H, log = log.values, t - log.at, _moved(log, seen, t, fresh)
    # fault: a probe that goes straight has no error -> bend = seen.second | coupler/test_trust_errors
    bend = np.maximum(seen.second, CHANGE * np.abs(log.values - before))
    # fault: a look at a switch of contact is taken for the rest -> apart = np.zeros(len(bend), dtype=bool) |
    #   coupler/test_trust_errors
    apart = _jumps(log, seen.second, H, fresh or seen.by_itself) | seen.switch
    log = _looked_at(log, seen, t, bend, apart) if seen.error.size else _to_carry_on(log, seen, H, bend, apart)
    curve = log.curve if seen.switch and log.curve.size else seen.second / H**2
    shifts = time_shift.watched(log.shifts, t, log.values, seen.turning, seen.shift, seen.switch)
    log = replace(log, curve=curve, shifts=shifts,
                  phases=phases.watched(log.phases, log.values - before, H, bend, fresh))
    return replace(log, told=np.maximum(log.told, _now(log)))


def _looked_at(log: ErrorLog, seen: Looked, t: float, bend: Array, apart: NDArray[np.bool_]) -> ErrorLog:
    """The log with the errors of a window that was looked at; of probes that are `apart`, (n,), they tell of no other.

    bend : (n,) of the probes in it.
    """
    scale = np.maximum(log.high - log.low, SOLVED * log.most)
    # fault: of a probe that was nothing so far any error overflows -> known = np.ones_like(scale, dtype=bool) |
    #   coupler/test_trust_errors
    known = scale > TINY * seen.error
    unbounded = np.where(seen.error > 0.0, np.inf, 0.0)
    share = float(np.divide(seen.error, scale, out=unbounded, where=known).max(initial=0.0))
    # Where the answer of two halves is kept, one in one would have been twice to four times as wrong.
    # fault: windows solved in one are taken for as exact as those kept in halves -> in_one = seen.error |
    #   coupler/test_trust_errors
    in_one = seen.in_one if seen.in_one.size else seen.error
    both = np.where(apart[:, None], np.column_stack([in_one, seen.second]), 0.0)
    smooth = np.where(apart, 0.0, 1.0)
    # fault: what jumped at a switch is carried on to smooth windows -> mild = both |
    #   coupler/test_spare::test_what_switches_inside_a_window_is_told_as_wrong_as_it_is
    mild = np.where((in_one <= MOST * seen.second)[:, None], both, 0.0)
    return replace(log, looked=log.looked + 1, known=log.known + seen.error, worst=max(share, log.worst),
                   t=t if share > log.worst else log.t, at_switch=log.at_switch + both, milder=log.milder + mild,
                   errors=_added(log.errors, smooth * in_one, bend), bends=_added(log.bends, smooth * bend, bend),
                   counts=_added(log.counts, smooth, bend))


def _to_carry_on(log: ErrorLog, seen: Looked, H: float, bend: Array, apart: NDArray[np.bool_]) -> ErrorLog:
    """The log with the bends of a window of H [s] that was not looked at; of probes that are `apart` with its error."""
    # fault: all that bends at a switch of contact bends for it -> going_on = 0.0 * bend | coupler/test_trust_errors
    going_on = np.minimum(H**2 * log.curve, seen.second) if log.curve.size else np.zeros(len(bend))
    more = np.where(apart, seen.second - going_on, 0.0)
    bend = np.where(apart, going_on, bend)
    log = replace(log, rest=_added(log.rest, bend, bend))
    if seen.switch:
        return replace(log, switches=log.switches + more)
    return replace(log, jumps=log.jumps + AT_SWITCH * more)


def _jumps(log: ErrorLog, second: Array, H: float, fresh: bool) -> NDArray[np.bool_]:
    """Return which probes jumped inside a window of H [s], (n,).  second : their bends in it."""
    if fresh or not log.curve.size:
        return np.zeros(len(second), dtype=bool)
    # fault: what jumps inside a window errs as what is smooth -> return np.zeros(len(second), dtype=bool) |
    #   coupler/test_trust_errors
    return (second > JUMP * H**2 * log.curve) & (second > VISIBLE * (log.high - log.low))


def _moved(log: ErrorLog, seen: Looked, t: float, fresh: bool) -> ErrorLog:
    """The log with the probes of a window's end, and what is left there of errors made before it."""
    values = np.where(np.isfinite(seen.values), seen.values, log.values)
    low, high, most = np.fmin(log.low, values), np.fmax(log.high, values), np.fmax(log.most, np.abs(values))
    went = np.abs(values - log.values) / (t - log.at)
    pace = went if fresh else np.maximum(went, math.exp(-1.0 / PATIENCE) * log.pace)
    scale = np.maximum(high - low, SOLVED * most + 1e-300)
    before, now = (float(np.linalg.norm(v / scale)) for v in (log.pace, pace))
    # fault: what dies out by itself is told as if it stayed -> falls = 1.0 | coupler/test_trust_errors
    falls = min(now / before, 1.0) if before > 0.0 and not fresh else 1.0
    # fault: what moves with inertia forgets its errors as its speed falls -> left = np.full(len(values), falls) |
    #   coupler/test_trust_phases
    left = np.where(log.phases.lasts, 1.0, falls) if log.phases.lasts.size else np.full(len(values), falls)
    return replace(log, windows=log.windows + 1, low=low, high=high, most=most, values=values, at=t, pace=pace,
                   known=left * log.known, rest=left[:, None] * log.rest, switches=left * log.switches,
                   # fault: what a jump leaves is carried on as what is smooth -> jumps=left * log.jumps, |
                   #   coupler/test_trust_errors
                   jumps=math.exp(-1.0) * log.jumps,
                   solves=log.solves + seen.solves)


def _added(sums: Array, values: Array, second: Array) -> Array:
    """Return (n, CLASSES) sums with one more value each, in the class of its second difference."""
    place = np.floor((np.log10(np.maximum(second, 10.0**LEAST)) - LEAST) / CLASS).astype(int)
    added = sums.copy()
    added[np.arange(len(values)), np.minimum(place, CLASSES - 1)] += values
    return added


def estimated(log: ErrorLog) -> Array:
    """Return the estimated error of each probe, the largest over the run, (n,) in SI."""
    # fault: what does not die out is told as if it did -> return log.told | coupler/test_time_shift
    return np.maximum(log.told, time_shift.estimated(log.shifts)) if log.shifts.t.size else log.told


def _now(log: ErrorLog) -> Array:
    """The error of each probe at the end of the last window, (n,) in SI."""
    # fault: only the windows that were looked at have errors -> smooth = np.zeros(len(log.known)) |
    #   coupler/test_trust_errors
    smooth = _carried_on(log)
    error, bend = log.at_switch.T
    ratios = np.divide(error, bend, out=np.full(len(bend), AT_SWITCH), where=bend > 0.0)
    # fault: what is measured at a switch of contact tells of no other -> apart = AT_SWITCH * log.switches + log.jumps |
    #   coupler/test_trust_errors
    apart = np.clip(ratios, AT_LEAST, AT_SWITCH) * log.switches + log.jumps
    # Where every look met a switch they are all there is to go by, those first in which no probe jumped.
    mild, bent = log.milder.T
    ratios = np.where(bent > 0.0, np.divide(mild, bent, out=np.zeros(len(bend)), where=bent > 0.0), ratios)
    alone = np.where(bend > 0.0, np.minimum(ratios, MOST), 0.0) * log.rest.sum(axis=1)
    # fault: smooth windows have no error where every look met a switch -> total = log.known + apart + smooth |
    #   coupler/test_trust_errors
    total = log.known + apart + np.where(log.bends.any(axis=1), smooth, alone)
    errors, bends = log.errors.sum(axis=1) + error, log.bends.sum(axis=1) + bend
    return total * phases.in_step(log.phases, errors, bends)


def _carried_on(log: ErrorLog) -> Array:
    """The errors of windows not looked at, (n,) of the probes in SI: by the ratio of their class.

    Where no window of it was looked at, by the larger of that of the nearest class and that of all; 0 where none was.
    """
    bent = log.bends > 0.0
    known, asked = np.flatnonzero(bent.any(axis=0)), np.flatnonzero(log.rest.any(axis=0))
    if not known.size or not asked.size:
        return np.zeros(len(log.rest))
    far = np.where(bent[:, None, known], np.abs(asked[:, None] - known), CLASSES)
    nearest = known[far.argmin(axis=2)]
    errors, bends, counts = (np.take_along_axis(of, nearest, axis=1) for of in (log.errors, log.bends, log.counts))
    ratios, of_all, total = np.zeros_like(bends), np.zeros((len(bends), 1)), log.bends.sum(axis=1, keepdims=True)
    np.divide(errors, bends, out=ratios, where=bends > 0.0)
    np.divide(log.errors.sum(axis=1, keepdims=True), total, out=of_all, where=total > 0.0)
    rest = log.rest[:, asked]
    # fault: the ratio of all windows for each -> return np.asarray(of_all[:, 0] * rest.sum(axis=1)) |
    #   coupler/test_trust_errors
    ratios = np.where(nearest == asked, ratios, np.maximum(ratios, of_all))
    # fault: a jump inside a window is carried on to all -> once = np.zeros_like(ratios, dtype=bool) |
    #   coupler/test_trust_errors
    once = (nearest != asked) | (counts < 2.0)
    return np.asarray((np.where(once, np.minimum(ratios, MOST), ratios) * rest).sum(axis=1))


def scales(log: ErrorLog, units: Sequence[str], nothing: Mapping[str, float] = NO_FLOORS) -> Array:
    """Return what each error is held against, (n,) in SI: its range, or a share of the largest of its unit.

    units : of the probes.  nothing : unit -> what solvers may leave of a quantity that is 0.
    """
    ranges = log.high - log.low
    largest = {u: max(r for v, r in zip(units, ranges, strict=True) if v == u) for u in set(units)}
    floor = np.array([SMALL * largest[u] for u in units]) if units else np.zeros(0)
    left = np.array([{"Pa": SETTLED, "K": SOLVED_T}.get(u, SOLVED) for u in units])
    # fault: what solvers leave of a force that is 0 is an error of its windows -> least = np.zeros(len(units)) |
    #   coupler/test_trust_nothing
    least = np.array([nothing.get(u, 0.0) for u in units])
    return np.maximum.reduce([ranges, floor, left * log.most, least])


@dataclass(frozen=True)
class ProbeError:
    """error : a probe may be off by over the run, by its windows.  range : how far it went.  mesh : it may be off by
    for its cells, where something melts or a contact presses (in_space.fronts, contact_pressure).  All in `unit`, SI.
    """

    error: float
    range: float
    unit: str
    mesh: float = 0.0


def table(log: ErrorLog, probes: Mapping[str, str]) -> dict[str, ProbeError]:
    """Return the probes with their errors.  probes : name -> unit."""
    if not log.looked:
        return {}
    return {name: ProbeError(float(e), float(high - low), unit)
            for (name, unit), e, low, high in zip(probes.items(), estimated(log), log.low, log.high, strict=True)}


def check(log: ErrorLog, probes: Mapping[str, str], adaptive: bool, iterated: bool = False,
          nothing: Mapping[str, float] = NO_FLOORS) -> Check:
    """Return the check at the end.

    probes : name -> unit.  adaptive : whether windows are adaptive.  iterated : whether every window is iterated.
    nothing : as of `scales`.
    """
    if not log.looked:
        return Check(NAME, TrustVerdict.UNCHECKED,
                     what="no window could be solved twice: a half cannot save its state")
    names, scale = list(probes), scales(log, list(probes.values()), nothing)
    shares = np.divide(estimated(log), scale, out=np.zeros(len(names)), where=scale > 0.0)
    k = int(shares.argmax())
    unit = probes[names[k]]
    worst = [f"{names[i]} by {100 * shares[i]:.3g} %" for i in np.argsort(-shares)[1:4] if shares[i] > NOTE_AT]
    share, off = f"{100 * shares[k]:.3g} %", amount(shares[k] * scale[k], unit)
    of = f"{share} of its range ({off})"
    # fault: a share of what errors are held against is told as one of a range -> if False: |
    #   coupler/test_trust_nothing
    if scale[k] > log.high[k] - log.low[k]:
        of = f"{off}, {share} of {amount(scale[k], unit)}, the least that its errors are held against"
    return measured(
        NAME, float(shares[k]), (NOTE_AT, LIMIT), t=log.t,
        what=f"probe {names[k]} may be off by {of}"
             + (f", {', '.join(worst)}" if worst else "")
             + f", as estimated from {log.looked} of {log.windows} windows, each solved again as two of half the size",
        remedy="Use a smaller coupling.adaptive.tolerance" if adaptive else
               "Use smaller windows, or coupling.adaptive"
               + ("" if iterated else "; scheme: iterated removes the error of the exchange"))
