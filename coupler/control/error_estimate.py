"""The error of one window, quantity by quantity: measured now and then, carried on by second differences in between.

Measured: the window is solved again in two halves (coupler.control.solve_window); the difference of the two answers is
most of its error, whatever makes it.  In between, the error of a quantity v is taken to be

    error = ratio * max |H^2 v''|,   v'' the second divided difference of the last three levels,

with the ratio as it was last measured, times H/H_measured where the window has grown (a method of second order makes an
error of H^3): the miss of the line through the last two levels, which is what was extrapolated against what came out.
Second and not third differences: a third one is lost where a stiff cell follows its surroundings, and sees a wiggle of
an old window as its own.  Every scheme has ratios of its own.  Where a measured ratio is no more than what it was taken
for, the next measurement waits twice as long; where it is more, the next window is measured too: a front that freezes
node by node is no smooth function of time, and only solving again tells.  A ratio found smaller is no disagreement:
what was told was too much, which costs shorter windows and no accuracy.  Where a gap closes or opens in the window
nothing is carried on, and the halves' answer is taken to be as wrong as the whole's (below).  docs/coupling.md has what
that was found to be worth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.control.body_strain import NO_CELLS, BodyCells
from coupler.control.quantities import (
    apart,
    faced,
    heat_of,
    largest,
    quantity_of,
    scale,
    second_differences,
    third_difference,
)
from coupler.control.unannounced import (
    faces_otherwise,
    front_moves,
    gap_closes,
    open_gaps,
    other_gaps,
)
from coupler.control.window_size import AIM
from coupler.errors import in_words
from coupler.scenario.options import ErrorTolerances, Iteration, Scheme, Seen, Tolerance
from coupler.schemes.accounts import AHEAD
from coupler.schemes.levels import Level
from coupler.schemes.schemes import scheme_of
from coupler.schemes.state import ELASTIC_STRAIN, CoupledState, Solved, Span


@dataclass(frozen=True)
class Doubling:
    """Errors over the difference of the two answers.  whole : of the window in one.  halves : of its two halves."""

    whole: float
    halves: float


# By order p: 2^p/(2^p - 1) and 1/(2^p - 1), which is 4/3 and 1/3 of second order; an eighth is put on those, for to
# overstate is the smaller fault.  Of no order (0): nothing is known, so the halves count as as wrong as the whole.
# fault: errors understated: a fifth of the difference from two halves -> DOUBLING = {0: Doubling(2.0, 2.0), 1:
#   Doubling(0.4, 0.2), 2: Doubling(0.3, 0.075)} | coupler/test_estimate
DOUBLING = {0: Doubling(2.0, 2.0), 1: Doubling(2.0, 1.0), 2: Doubling(1.5, 0.375)}
# Of T and heat where mechanics see the T of the start: x at the start of a window then is that of a window before, an
# error that the two halves share.  With x late by l windows at the start (1/2 to 1 after a window that was solved in
# two or one) the factors are 2 (l + 1)/(l + 1/2) and (l + 3/2)/(l + 1/2) of `mechanical_first`, (2 l + 1)/l and
# (l + 1)/l of `parallel`: 2.7 to 4 and 1.7 to 3.  Of `adiabatic` without a gap that feeds back: 2 and 1.
LATE = Doubling(2.8, 1.75)
# A ratio up to so many times what it was taken for agrees with it.  Measured again after at most so many windows, and
# when the window has changed by a factor.
AGREE, MOST, CHANGED = 1.4, 16, 2.5
# A ratio found smaller than it was taken for is taken for this part of that at least: an error may pass through 0.
# What two measurements on end find is believed.
BELIEVED = 0.5
# Where what sizes windows was told as so much too large, it is measured again after so many windows at the latest.
SOON = 3
# An error of less than this share of its tolerance decides nothing, and is not measured again for its own sake.
IDLE = 0.25
MIDPOINT = 1.0 / 12.0  # the constant of the midpoint rule on linear equations, of the third difference
# A ratio was measured of a second difference, and holds of what bends up to so many times as much.  Of a scene at rest
# it is round-off over round-off: what comes next (a body that enters a heated zone) may be anything.
LIKE = 10.0
# An error above this share of its tolerance decides how long windows are.  Where it was so much (`LIKE`) smaller when
# its ratio was measured, that was of two nothings, and is measured again first.
DECIDES = AIM
# Where something bends so much more than before (`LIKE`) its third difference is about its second one, and a method of
# second order is off by a tenth of that.  Two answers that are closer than this share of it do not see what bends.
SEEN = 1e-3
# Those whose scale is their change in the window.  Where contact jumps (a body that slips over from one equilibrium to
# the next) their error is as large in the shortest window, and a scale that shrinks with it would let none pass.  What
# windows before changed counts, half as much with every window: so all errors add up to at most twice rtol.
CHANGES, FADES = ("gap", "heat", "displacement"), 0.5
# What mechanics make.  Bodies that remember take their past by backward Euler, whatever the order of the exchange.
OF_MECHANICS, OF_HISTORIES = ("gap", "displacement", ELASTIC_STRAIN), 1


@dataclass(frozen=True)
class Measured:
    """ratios : quantity -> error over second difference, in windows of one scheme, last measured in one of H [s].

    left : windows, of any scheme, until the next measurement.  pause : how many there were between the last two.
    bend : third difference of T over its second one in that window; nan: not known.
    bent : quantity -> its second difference in that window, over the square of the window.
    shares : quantity -> its error in that window in one, in tolerances.  found : ratios as that window alone told them.
    first : as ratios, over the second differences of that window in one, which has that error itself.
    gaps [1/m2] : sum of 1/gap^2 of open gaps at its end; nan: not known.
    """

    ratios: Mapping[str, float] = field(default_factory=dict)
    H: float = 0.0
    left: int = 0
    pause: int = 0
    bend: float = math.nan
    bent: Mapping[str, float] = field(default_factory=dict)
    shares: Mapping[str, float] = field(default_factory=dict)
    found: Mapping[str, float] = field(default_factory=dict)
    first: Mapping[str, float] = field(default_factory=dict)
    gaps: float = math.nan

    def unlike(self, second: Mapping[str, float], H: float, tolerances: Mapping[str, float]) -> tuple[str, ...]:
        """Return what bends in a window of H [s] far more than where the ratios were measured.

        second : second differences.  tolerances : of each, in its unit: what is below that cannot be an error.
        """
        return tuple(n for n, d in second.items() if n in self.bent and n in tolerances
                     and d > tolerances[n] and d > LIKE * H * H * self.bent[n])


@dataclass(frozen=True)
class Memory:
    """by : name of a scheme -> what was measured of it.  rate : heat through contact in the last window [W]; nan: not
    known.

    changed : quantity -> scale of its tolerance from windows before, which halves with every window.
    halved : the last window was kept in halves.
    """

    by: Mapping[str, Measured] = field(default_factory=dict)
    rate: float = math.nan
    changed: Mapping[str, float] = field(default_factory=dict)
    halved: bool = False

    def of(self, scheme: Scheme) -> Measured:
        """What was measured of windows of a scheme; without ratios where nothing was."""
        # fault: the ratio of one scheme used for another -> return next(iter(self.by.values()), Measured()) |
        #   coupler/test_estimate
        return self.by.get(scheme.value, Measured())

    def telling(self, scheme: Scheme) -> Measured:
        """What tells the error of a window: what was measured of its scheme, or, where that is old, of windows solved
        once, which are no better than those that are iterated.
        """
        known, once = self.of(scheme), self.of(Scheme.EXTRAPOLATED)
        # fault: a window that is iterated to measure rho is solved in halves, too -> borrows = False |
        #   coupler/test_estimate_ratios
        borrows = scheme is Scheme.ITERATED and known.ratios and known.left <= 0 < once.left
        return once if borrows else known


@dataclass(frozen=True)
class Estimate:
    """shares : quantity -> error in tolerances; splitting, own : its two parts, from the exchange and from the halves'
    own steps.  Elastic strain is one quantity a body, `elastic_strain.BODY`.  orders : quantity -> its error goes with
    H^(order + 1); order : of the one that sizes the next window.

    errors : the same in K, m, J, 1.  ratios : errors over second differences, where they were measured in this window.
    size : the share by which the next window is sized: that of a window solved in one, also where the answer of two
    halves is kept, because the next may be solved in one.  whole : quantity -> that of a window in one, where it was.
    begins : what bends in it so much more than where ratios were measured that something began in it; of a window that
    was measured.
    """

    shares: Mapping[str, float]
    splitting: Mapping[str, float]
    own: Mapping[str, float]
    order: int = 2
    orders: Mapping[str, int] = field(default_factory=dict)
    errors: Mapping[str, float] = field(default_factory=dict)
    ratios: Mapping[str, float] = field(default_factory=dict)
    size: float = 0.0
    whole: Mapping[str, float] = field(default_factory=dict)
    first: Mapping[str, float] = field(default_factory=dict)
    begins: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """The largest share: the window is good where this is at most 1."""
        return max(self.shares.values(), default=0.0)

    @property
    def worst(self) -> str:
        """The quantity of the largest share."""
        return max(self.shares, key=lambda n: self.shares[n])

    @property
    def unseen(self) -> str:
        """What began in the second half of the window, so that both answers of it agree however wrong they are; or "".

        A body that begins to yield there takes one step of flow in either.
        """
        return next((n for n in self.begins if self.ratios[n] < SEEN), "")

    @property
    def measured(self) -> bool:
        """Whether the window was solved in two halves too."""
        return bool(self.ratios)

    @property
    def words(self) -> str:
        """The quantity that is worst, and by how much."""
        quantity, _, body = self.worst.partition(".")
        of = quantity.replace("_", " ") + (f" of {body}" if body else "")
        return f"error of {of} is {in_words(self.error)} times its tolerance"

    def largest(self, values: Mapping[str, float], quantity: str) -> float | None:
        """Return the largest of a quantity, of all bodies; None where it has none.  values : one of the above."""
        return max((v for name, v in values.items() if quantity_of(name) == quantity), default=None)


def wanted(memory: Memory, start: CoupledState, span: Span, scheme: Scheme, end: Level,
           pairs: Sequence[NDArray[np.intp]] = ()) -> bool:
    """Whether a window should be solved in two halves too: nothing is known, what is known is old, a front moves, a
    gap closes or opens, or a pair faces otherwise than before.

    end : the level to which the window came in one.  pairs : the pair nodes of each pair.
    """
    H, known = span.end - start.now.t, memory.telling(scheme)
    return (not known.ratios or known.left <= 0 or not start.past
            # fault: errors carried on while a front moves -> or not 1.0 / CHANGED <= H / known.H <= CHANGED |
            #   coupler/test_estimate
            or not 1.0 / CHANGED <= H / known.H <= CHANGED or front_moves(start)
            # fault: a window in which a gap closes is not measured -> or False | coupler/test_estimate
            or gap_closes(start.now, end)
            # fault: a ratio of wide gaps holds of narrow ones -> or False | coupler/test_estimate_ratios
            or other_gaps(known.gaps, open_gaps(end))
            # fault: where a surface slides off another the error is carried on -> ) | coupler/test_sliding_off
            or faces_otherwise(pairs, start, end))


def estimate(memory: Memory, start: CoupledState, solved: Solved, tolerance: ErrorTolerances,
             iteration: Iteration, cells: BodyCells = NO_CELLS) -> Estimate | None:
    """The error of a window from its start and outcome; None where nothing is known, or it is unlike what is known.

    solved.whole : the outcome of the same window in one, where `solved` is that of its two halves.
    cells : of the bodies, whose elastic strain is looked at where the mechanical half tells it.
    """
    known = memory.telling(solved.scheme)
    if solved.whole is None and not known.ratios:
        return None
    levels = (solved.state.now, start.now, *start.past)
    H, second = levels[0].t - levels[1].t, second_differences(levels, memory.rate, solved, cells)
    orders = {n: _order_of(n, _order(start, solved, iteration.level), start) for n in second}
    left = _left_over(start.now, solved, iteration)
    if solved.whole is None:
        bend = _bend(levels, second)
        # What a window in one is off by against levels that are not adds to its second difference.
        # fault: errors are carried over windows that are kept in halves as if those were in one -> ratios =
        #   known.ratios | coupler/test_estimate_ratios
        ratios = (known.first if memory.halved else {}) or known.ratios
        errors = {n: ratios[n] * _grown(known, H, orders[n], bend) * d + left.get(n, 0.0)
                  for n, d in second.items() if n in ratios}
        own = _own(levels, errors["temperature"], left)
        scales = _scales(memory, errors, levels, solved, cells)
        allowed = {n: _allowed(scales[n], getattr(tolerance, quantity_of(n))) for n in errors}
        # fault: a ratio found where nothing happened holds where much happens -> if False: |
        #   coupler/test_estimate_ratios
        if known.unlike(second, H, allowed):
            return None
        found = _in_tolerances(errors, scales, tolerance, own)
        # fault: windows are sized by errors that were nothing when they were measured -> if False: |
        #   coupler/test_estimate_ratios
        if found.error > max(DECIDES, LIKE * known.shares.get(found.worst, math.inf)):
            return None
        return replace(found, order=orders[found.worst], orders=orders)
    distance = apart(levels, solved, solved.whole, second, cells)
    factors = {n: _doubling(n, orders[n], solved.scheme) for n in distance}
    ratios = {n: factors[n].whole * d / second[n] if second[n] > 0.0 else 0.0 for n, d in distance.items()}
    in_it = second_differences((solved.whole.state.now, *levels[1:]), memory.rate, solved.whole, cells)
    first = {n: factors[n].whole * d / in_it[n] if in_it.get(n, 0.0) > 0.0 else 0.0 for n, d in distance.items()}
    whole = {n: factors[n].whole * d + left.get(n, 0.0) for n, d in distance.items()}
    kept = {n: factors[n].halves * d + left.get(n, 0.0) for n, d in distance.items()}
    own = _own(levels, whole["temperature"], left)
    scales = _scales(memory, kept, levels, solved, cells)
    found, in_one = (_in_tolerances(e, scales, tolerance, own) for e in (kept, whole))
    allowed = {n: _allowed(scales[n], getattr(tolerance, quantity_of(n))) for n in kept}
    return replace(found, order=orders[in_one.worst], orders=orders, ratios=ratios, size=in_one.error,
                   whole=in_one.shares, first=first, begins=known.unlike(second, H, allowed))


def _order_of(name: str, order: int, start: CoupledState) -> int:
    """The order of a quantity, `order` being that of the exchange: no more than that of the histories of bodies."""
    remembers = start.now.elastic_strain is not None
    # fault: bodies that remember are taken for as exact as the exchange -> return order |
    #   coupler/test_estimate_strain::test_stress_that_relaxes_is_as_exact_as_its_tolerance
    return min(order, OF_HISTORIES) if remembers and quantity_of(name) in OF_MECHANICS else order


def _order(start: CoupledState, solved: Solved, level: Seen) -> int:
    """The order of the window's error: 0: none.  level : `coupling.iteration.level`."""
    # fault: the halves of a window in which a gap closes are taken to be as good as ever -> if False: |
    #   coupler/test_estimate
    if gap_closes(start.now, solved.state.now):
        return 0
    made = {n for n, account in solved.state.accounts.items() if account.made != start.accounts[n].made}
    return scheme_of(solved.scheme).exchange_at(level).order(heat=bool(made - AHEAD), friction=bool(made & AHEAD))


def doubling_of(start: CoupledState, solved: Solved, level: Seen, *, mechanical: bool = False) -> Doubling:
    """Return what to multiply the distance of two answers of a window by, of anything that follows T.

    start : before the window.  level : `coupling.iteration.level`.  mechanical : of what the mechanical half makes.
    """
    name = "displacement" if mechanical and start.now.elastic_strain is not None else "temperature"
    return _doubling(name, _order_of(name, _order(start, solved, level), start), solved.scheme)


def _doubling(quantity: str, order: int, scheme: Scheme) -> Doubling:
    # fault: x that is late at the start of a window is not thought of -> if False: | coupler/test_scheme_table
    if order > 0 and quantity in ("temperature", "heat") and scheme_of(scheme).sees_start_T:
        return LATE
    return DOUBLING[order]


def after(memory: Memory, start: CoupledState, solved: Solved, found: Estimate | None,
          cells: BodyCells = NO_CELLS) -> Memory:
    """The memory after a window that was taken.  cells : as of `estimate`."""
    H = solved.state.now.t - start.now.t
    heat = heat_of(solved)
    rate = math.nan if heat is None else heat / H
    name, known = solved.scheme.value, memory.of(solved.scheme)
    # All of them grow old, so that a scheme that is seldom used is measured when it is, which tells what it costs.
    by = {n: replace(m, left=m.left - 1) for n, m in memory.by.items()}
    levels = (solved.state.now, start.now, *start.past)
    changed = _scales(memory, CHANGES if faced(levels).any() else CHANGES[1:], levels, solved)
    if found is None or not found.measured:
        return Memory(by, rate, changed, solved.whole is not None)
    if not start.past:  # two levels have no second difference
        return Memory({n: m for n, m in by.items() if n != name}, rate, changed, True)
    second = second_differences(levels, memory.rate, solved, cells)
    bend = _bend(levels, second)
    # fault: a gap that faces nothing any more is looked for -> expected = {n: r * _grown(known, H, found.orders[n],
    #   bend) for n, r in known.ratios.items()} | coupler/test_demo
    expected = {n: r * _grown(known, H, found.orders[n], bend) for n, r in known.ratios.items() if n in found.orders}
    # fault: what begins in a window agrees with what was before -> agrees = _agree(expected, found) |
    #   coupler/test_estimate_ratios
    agrees = _agree(expected, found) and not found.begins
    pause = min(max(1, 2 * known.pause), MOST) if agrees else 0
    if found.ratios[found.worst] < BELIEVED * expected.get(found.worst, 0.0):
        pause = min(pause, SOON)
    least = {n: min(BELIEVED * r, known.found.get(n, math.inf)) for n, r in expected.items()}
    # fault: a ratio found smaller is believed at once -> ratios = dict(found.ratios) | coupler/test_estimate_ratios
    ratios = {n: max(r, least.get(n, 0.0)) for n, r in found.ratios.items()}
    bent = {n: d / (H * H) for n, d in second.items()}
    # Of mechanics that see the T of the start it is no error of the window in one alone that it comes late.
    # fault: what comes late is taken for an error of windows in one -> late = False |
    #   coupler/test_estimate_ratios
    late = scheme_of(solved.scheme).sees_start_T
    first = {n: r * (ratios[n] / found.ratios[n] if found.ratios[n] > 0.0 else 1.0) for n, r in found.first.items()
             if not late}
    now = Measured(ratios, H, pause, pause, bend, bent, found.whole, found.ratios, first,
                   open_gaps(solved.state.now))
    return Memory({**by, name: now}, rate, changed, True)


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return Memory(changed=memory.changed)


def _agree(expected: Mapping[str, float], found: Estimate) -> bool:
    """Whether no ratio of a quantity that decides is more than it would have been taken for."""
    for name, ratio in found.ratios.items():
        # fault: measured ratios always agree -> if found.shares[name] > IDLE * 0.5**found.orders[name] and not 0.0 <=
        #   ratio: | coupler/test_estimate
        if found.shares[name] > IDLE * 0.5**found.orders[name] and ratio > expected.get(name, 0.0) * AGREE:
            return False
    return bool(expected)


def _grown(known: Measured, H: float, order: int, bend: float) -> float:
    """What to multiply a ratio by: a second difference goes with H^2, the error of a window of second order with H^3.

    A longer window of what has become slower is no worse than the shorter one was: third differences over second ones
    tell, and no more than that of them.
    """
    # fault: a longer window has the error of a shorter one -> most = 1.0 | coupler/test_estimate
    most = max(H / known.H, 1.0)
    # fault: a window as long for what goes on as the one before is taken to be as much worse as it is longer ->
    #   slower = most | coupler/test_estimate
    slower = bend / known.bend if known.bend > 0.0 else most
    return min(max(slower, 1.0), most) ** (order - 1) if slower == slower else most ** (order - 1)


def _bend(levels: Sequence[Level], second: Mapping[str, float]) -> float:
    """Third difference of T over its second one; nan where there are too few levels."""
    known = len(levels) > 3 and second["temperature"] > 0.0
    return third_difference(levels) / second["temperature"] if known else math.nan


def _in_tolerances(errors: Mapping[str, float], scales: Mapping[str, float], tolerance: ErrorTolerances,
                   own: float) -> Estimate:
    """Errors in tolerances.  own : what part of them is the halves' own; x, gap and heat follow T, so it is one."""
    shares = {n: _share(e, scales[n], getattr(tolerance, quantity_of(n))) for n, e in errors.items()}
    return Estimate(shares, {n: (1.0 - own) * s for n, s in shares.items()}, {n: own * s for n, s in shares.items()},
                    errors=errors, size=max(shares.values()))


def _own(levels: Sequence[Level], total: float, left: Mapping[str, float]) -> float:
    """The halves' own part of an error of T [K]: what the midpoint rule would make if T were smooth as it went."""
    if total == 0.0:
        return 0.0
    return min(MIDPOINT * third_difference(levels), total - left.get("temperature", 0.0)) / total


def _share(error: float, scale: float, tolerance: Tolerance) -> float:
    return error / _allowed(scale, tolerance)


def _allowed(scale: float, tolerance: Tolerance) -> float:
    return tolerance.atol + tolerance.rtol * scale


def _scales(memory: Memory, names: Iterable[str], levels: Sequence[Level], solved: Solved,
            cells: BodyCells = NO_CELLS) -> dict[str, float]:
    """What the relative part of each tolerance is measured by, windows before included."""
    # fault: what jumps is asked of a scale that shrinks with the window -> before = dict.fromkeys(names, 0.0) |
    #   coupler/test_estimate
    before = {n: FADES * memory.changed.get(n, 0.0) for n in names}
    return {n: max(scale(n, levels, solved, cells), before[n]) for n in names}


def _left_over(start: Level, solved: Solved, iteration: Iteration) -> dict[str, float]:
    """What iterating may have left of T [K]: the tolerance, or the last difference where that is more.

    Not the last difference alone: of a window in two halves it is known of the second only, and where the first guess
    already agreed it says little of how wrong both are.
    """
    if solved.history is None:
        return {}
    tolerance = iteration.tolerance.temperature
    change = largest(solved.state.now.T - start.T)
    return {"temperature": max(solved.history.misfits[-1]["temperature"], 1.0)
            * (tolerance.atol + tolerance.rtol * change)}
