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
from coupler.errors import in_words
from coupler.scenario.options import ErrorTolerances, Iteration, Scheme, Seen, Tolerance
from coupler.schemes.accounts import AHEAD
from coupler.schemes.levels import Level
from coupler.schemes.schemes import scheme_of
from coupler.schemes.state import ELASTIC_STRAIN, CoupledState, Solved, Span

# Gaps that close or open within one window: there its error has no order yet, and nothing before it announces it.
#
# Heat across a gap that falls steadily to zero goes with 1/(layer + gap).  Until windows are as short as the last layer
# takes to close, a window and its two halves both miss most of what crosses just before touch: their difference hardly
# falls with the window, so a quarter of it is not the error of the halves' answer.

# A gap that falls to, or rises from, less than this share of itself: over that 1/gap is no parabola.
SHARE = 0.1
# [m] A hundredth of a gas layer of 10 um: a gap that was never wider changes no law of conductance by more than 1 %.
THIN = 1e-7
# A node is wholly faced from this share on.
WHOLLY = 0.999


def gap_closes(start: Level, end: Level) -> bool:
    """Whether some gap, wholly faced at both ends of a window, all but closes in it, or opens.

    One that is faced in part is at the end of a surface that slides: what is told of it goes to and fro there.
    """
    faced = np.isfinite(start.gap) & np.isfinite(end.gap)
    # fault: nodes at the end of a surface that slides close gaps in every window -> faced &= (start.covered > 0.0) &
    #   (end.covered > 0.0) | coupler/test_estimate
    faced &= (start.covered > WHOLLY) & (end.covered > WHOLLY)
    a, b = (np.maximum(level.gap[faced], 0.0) for level in (start, end))
    wider = np.maximum(a, b)
    return bool(((wider > THIN) & (np.minimum(a, b) < SHARE * wider)).any())


Array = NDArray[np.float64]


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
# A ratio found smaller than it was taken for is taken for this part of that at least.
BELIEVED = 0.5
# Where what sizes windows was told as so much too large, it is measured again after so many windows at the latest.
SOON = 3
# An error of less than this share of its tolerance decides nothing, and is not measured again for its own sake.
IDLE = 0.25
# A solid fraction that changes by more moves a front; less is what Newton leaves.
FRONT = 1e-6
MIDPOINT = 1.0 / 12.0  # the constant of the midpoint rule on linear equations, of the third difference
HEAT = ("heat.contact.slave", "heat.gap.slave")
FRICTION = ("heat.friction.slave", "heat.friction.master")
# Those whose scale is their change in the window.  Where contact jumps (a body that slips over from one equilibrium to
# the next) their error is as large in the shortest window, and a scale that shrinks with it would let none pass.  What
# windows before changed counts, half as much with every window: so all errors add up to at most twice rtol.
CHANGES, FADES = ("gap", "heat", "displacement"), 0.5
QUANTITIES = ("temperature", "gap", "heat", "displacement", ELASTIC_STRAIN)
# What mechanics make.  Bodies that remember take their past by backward Euler, whatever the order of the exchange.
OF_MECHANICS, OF_HISTORIES = ("gap", "displacement", ELASTIC_STRAIN), 1


@dataclass(frozen=True)
class Measured:
    """ratios : quantity -> error over second difference, in windows of one scheme, last measured in one of H [s].

    left : windows, of any scheme, until the next measurement.  pause : how many there were between the last two.
    bend : third difference of T over its second one in that window; nan: not known.
    """

    ratios: Mapping[str, float] = field(default_factory=dict)
    H: float = 0.0
    left: int = 0
    pause: int = 0
    bend: float = math.nan


@dataclass(frozen=True)
class Memory:
    """by : name of a scheme -> what was measured of it.  rate : heat through contact in the last window [W]; nan: not
    known.

    changed : quantity -> scale of its tolerance from windows before, which halves with every window.
    """

    by: Mapping[str, Measured] = field(default_factory=dict)
    rate: float = math.nan
    changed: Mapping[str, float] = field(default_factory=dict)

    def of(self, scheme: Scheme) -> Measured:
        """What was measured of windows of a scheme; without ratios where nothing was."""
        # fault: the ratio of one scheme used for another -> return next(iter(self.by.values()), Measured()) |
        #   coupler/test_estimate
        return self.by.get(scheme.value, Measured())


@dataclass(frozen=True)
class Estimate:
    """shares : quantity -> error in tolerances; splitting, own : its two parts, from the exchange and from the halves'
    own steps.  Elastic strain is one quantity a body, `elastic_strain.BODY`.  orders : quantity -> its error goes with
    H^(order + 1); order : of the one that sizes the next window.

    errors : the same in K, m, J, 1.  ratios : errors over second differences, where they were measured in this window.
    size : the share by which the next window is sized: that of a window solved in one, also where the answer of two
    halves is kept, because the next may be solved in one.
    """

    shares: Mapping[str, float]
    splitting: Mapping[str, float]
    own: Mapping[str, float]
    order: int = 2
    orders: Mapping[str, int] = field(default_factory=dict)
    errors: Mapping[str, float] = field(default_factory=dict)
    ratios: Mapping[str, float] = field(default_factory=dict)
    size: float = 0.0

    @property
    def error(self) -> float:
        """The largest share: the window is good where this is at most 1."""
        return max(self.shares.values(), default=0.0)

    @property
    def worst(self) -> str:
        """The quantity of the largest share."""
        return max(self.shares, key=lambda n: self.shares[n])

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


def quantity_of(name: str) -> str:
    """Return the quantity of a name in an estimate: elastic_strain of elastic_strain.BODY."""
    return name.partition(".")[0]


def wanted(memory: Memory, start: CoupledState, span: Span, scheme: Scheme, end: Level) -> bool:
    """Whether a window should be solved in two halves too: nothing is known, what is known is old, a front moves, or a
    gap closes or opens.

    end : the level to which the window came in one.
    """
    H, known = span.end - start.now.t, memory.of(scheme)
    return (not known.ratios or known.left <= 0 or not start.past
            # fault: errors carried on while a front moves -> or not 1.0 / CHANGED <= H / known.H <= CHANGED |
            #   coupler/test_estimate
            or not 1.0 / CHANGED <= H / known.H <= CHANGED or front_moves(start)
            # fault: a window in which a gap closes is not measured -> ) | coupler/test_estimate
            or gap_closes(start.now, end))


def estimate(memory: Memory, start: CoupledState, solved: Solved, tolerance: ErrorTolerances,
             iteration: Iteration, cells: BodyCells = NO_CELLS) -> Estimate | None:
    """The error of a window from its start and outcome; None where nothing is known.

    solved.whole : the outcome of the same window in one, where `solved` is that of its two halves.
    cells : of the bodies, whose elastic strain is looked at where the mechanical half tells it.
    """
    known = memory.of(solved.scheme)
    if solved.whole is None and not known.ratios:
        return None
    levels = (solved.state.now, start.now, *start.past)
    H, second = levels[0].t - levels[1].t, _second(levels, memory, solved, cells)
    orders = {n: _order_of(n, _order(start, solved, iteration.level), start) for n in second}
    left = _left_over(start.now, solved, iteration)
    if solved.whole is None:
        bend = _bend(levels, second)
        errors = {n: known.ratios[n] * _grown(known, H, orders[n], bend) * d + left.get(n, 0.0)
                  for n, d in second.items() if n in known.ratios}
        own = _own(levels, errors["temperature"], left)
        found = _in_tolerances(errors, _scales(memory, errors, levels, solved, cells), tolerance, own)
        return replace(found, order=orders[found.worst], orders=orders)
    apart = _apart(levels, solved, solved.whole, second, cells)
    factors = {n: _doubling(n, orders[n], solved.scheme) for n in apart}
    ratios = {n: factors[n].whole * d / second[n] if second[n] > 0.0 else 0.0 for n, d in apart.items()}
    whole = {n: factors[n].whole * d + left.get(n, 0.0) for n, d in apart.items()}
    kept = {n: factors[n].halves * d + left.get(n, 0.0) for n, d in apart.items()}
    own = _own(levels, whole["temperature"], left)
    scales = _scales(memory, kept, levels, solved, cells)
    found, in_one = (_in_tolerances(e, scales, tolerance, own) for e in (kept, whole))
    return replace(found, order=orders[in_one.worst], orders=orders, ratios=ratios, size=in_one.error)


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


def front_moves(start: CoupledState) -> bool:
    """Whether anything froze or melted in the window before.

    A node that begins or ends to freeze is a kink of T in time that no window before it announced, however well ratios
    agreed between two of them.
    """
    now, before = start.now.f_s, start.past[0].f_s
    return now is not None and before is not None and float(np.abs(now - before).max(initial=0.0)) > FRONT


def after(memory: Memory, start: CoupledState, solved: Solved, found: Estimate | None) -> Memory:
    """The memory after a window that was taken."""
    H = solved.state.now.t - start.now.t
    heat = _heat(solved)
    rate = math.nan if heat is None else heat / H
    name, known = solved.scheme.value, memory.of(solved.scheme)
    # All of them grow old, so that a scheme that is seldom used is measured when it is, which tells what it costs.
    by = {n: replace(m, left=m.left - 1) for n, m in memory.by.items()}
    levels = (solved.state.now, start.now, *start.past)
    changed = _scales(memory, CHANGES if _faced(levels).any() else CHANGES[1:], levels, solved)
    if found is None or not found.measured:
        return Memory(by, rate, changed)
    if not start.past:  # two levels have no second difference
        return Memory({n: m for n, m in by.items() if n != name}, rate, changed)
    bend = _bend(levels, _second(levels, memory, solved))
    # fault: a gap that faces nothing any more is looked for -> expected = {n: r * _grown(known, H, found.orders[n],
    #   bend) for n, r in known.ratios.items()} | coupler/test_demo
    expected = {n: r * _grown(known, H, found.orders[n], bend) for n, r in known.ratios.items() if n in found.orders}
    pause = min(max(1, 2 * known.pause), MOST) if _agree(expected, found) else 0
    if found.ratios[found.worst] < BELIEVED * expected.get(found.worst, 0.0):
        pause = min(pause, SOON)
    # fault: a ratio found smaller is believed at once -> ratios = dict(found.ratios) | coupler/test_estimate
    ratios = {n: max(r, BELIEVED * expected.get(n, 0.0)) for n, r in found.ratios.items()}
    return Memory({**by, name: Measured(ratios, H, pause, pause, bend)}, rate, changed)


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
    return _third(levels) / second["temperature"] if len(levels) > 3 and second["temperature"] > 0.0 else math.nan


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
    return min(MIDPOINT * _third(levels), total - left.get("temperature", 0.0)) / total


def _share(error: float, scale: float, tolerance: Tolerance) -> float:
    return error / (tolerance.atol + tolerance.rtol * scale)


def _scales(memory: Memory, names: Iterable[str], levels: Sequence[Level], solved: Solved,
            cells: BodyCells = NO_CELLS) -> dict[str, float]:
    """What the relative part of each tolerance is measured by, windows before included."""
    # fault: what jumps is asked of a scale that shrinks with the window -> before = dict.fromkeys(names, 0.0) |
    #   coupler/test_estimate
    before = {n: FADES * memory.changed.get(n, 0.0) for n in names}
    return {n: max(_scale(n, levels, solved, cells), before[n]) for n in names}


def _scale(name: str, levels: Sequence[Level], solved: Solved, cells: BodyCells) -> float:
    """What the relative part of a tolerance is measured by (coupler.scenario.options)."""
    now, start = levels[0], levels[1]
    if name == "temperature":
        return max(float(now.T.max()), float(start.T.max())) - min(float(now.T.min()), float(start.T.min()))
    if name == "heat":
        # What rubs warms both bodies, and little of that crosses from one to the other.
        # fault: heat that crosses is held against itself alone where surfaces rub -> return abs(_heat(solved) or 0.0) |
        #   coupler/test_estimate
        return abs(_heat(solved) or 0.0) + abs(_sum_of(FRICTION, solved) or 0.0)
    if name in cells.names:
        return max(_size(name, _values(name, level, levels, cells)) for level in (now, start))
    return _largest(_values(name, now, levels, cells) - _values(name, start, levels, cells))


def _second(levels: Sequence[Level], memory: Memory, solved: Solved,
            cells: BodyCells = NO_CELLS) -> dict[str, float]:
    """Quantity -> max |H^2 v''|; 0 where there are two levels; quantities that the scene does not have are left out."""
    t = [level.t for level in levels]
    H, heat = t[0] - t[1], _heat(solved)
    found = {n: 0.0 for n in ("temperature", "gap", "displacement") if n != "gap" or _faced(levels).any()}
    if heat is not None:
        found["heat"] = 0.0
    if levels[0].elastic_strain is not None:
        # fault: no window tolerance sees stress -> pass |
        #   coupler/test_estimate_strain::test_stress_that_relaxes_is_as_exact_as_its_tolerance
        found |= dict.fromkeys(cells.names, 0.0)
    if len(levels) < 3:
        return found
    # fault: second differences as if all windows were alike -> weight = H | coupler/test_estimate
    weight = 2.0 * H * H / (t[0] - t[2])
    for name in found:
        if name == "heat":
            found[name] = 0.0 if heat is None or math.isnan(memory.rate) else weight * abs(heat / H - memory.rate)
            continue
        a, b, c = (_values(name, level, levels, cells) for level in levels[:3])
        found[name] = weight * _size(name, (a - b) / H - (b - c) / (t[1] - t[2]))
    return found


def _third(levels: Sequence[Level]) -> float:
    """max |H^3 T'''|; where there are three levels the second difference stands for it; 0 of two."""
    t, T = [level.t for level in levels[:4]], [level.T for level in levels[:4]]
    n = len(t)
    if n < 3:
        return 0.0
    for k in range(1, n):
        T = [(T[i] - T[i + 1]) / (t[i] - t[i + k]) for i in range(n - k)]
    return math.factorial(n - 1) * (t[0] - t[1]) ** (n - 1) * _largest(T[0])


def _apart(levels: Sequence[Level], solved: Solved, whole: Solved, names: Mapping[str, float], cells: BodyCells
           ) -> dict[str, float]:
    """Quantity -> how far the answers of the whole window and of its two halves are apart.

    Where mechanics see the T of the start, x is late by the window, and that of the halves by half of it.  That would
    be told as an error of every window, while what is late is late once: the window in one is taken as late as its
    halves, at the rate of the window before.
    """
    a, b = solved.state.now, whole.state.now
    both, told = (a, b), {}
    late = scheme_of(solved.scheme).sees_start_T and len(levels) > 2
    for n in names:
        if n == "heat":
            continue
        apart = _values(n, a, both, cells) - _values(n, b, both, cells)
        # fault: x that comes a window late is an error of every window -> if False: | coupler/test_estimate
        if late and n in ("gap", "displacement"):
            now, start, before = levels[:3]
            apart -= 0.5 * (now.t - start.t) / (start.t - before.t) * (_values(n, start, both, cells)
                                                                      - _values(n, before, both, cells))
        told[n] = _size(n, apart)
    heat, other = _heat(solved), _heat(whole)
    if heat is not None and other is not None:
        told["heat"] = abs(heat - other)
    return told


def _left_over(start: Level, solved: Solved, iteration: Iteration) -> dict[str, float]:
    """What iterating may have left of T [K]: the tolerance, or the last difference where that is more.

    Not the last difference alone: of a window in two halves it is known of the second only, and where the first guess
    already agreed it says little of how wrong both are.
    """
    if solved.history is None:
        return {}
    tolerance = iteration.tolerance.temperature
    change = _largest(solved.state.now.T - start.T)
    return {"temperature": max(solved.history.misfits[-1]["temperature"], 1.0)
            * (tolerance.atol + tolerance.rtol * change)}


def _values(name: str, level: Level, levels: Sequence[Level], cells: BodyCells) -> Array:
    if name == "temperature":
        return level.T
    if name in cells.names:
        assert level.elastic_strain is not None, "a half that tells it tells it at every level"
        return cells.weighted(name, level.elastic_strain)
    return level.x if name == "displacement" else level.gap[_faced(levels)]


def _faced(levels: Sequence[Level]) -> NDArray[np.bool_]:
    """Surface nodes wholly faced at the last three levels: a gap that begins or ends is no error of it."""
    known = np.isfinite(levels[0].gap)
    for level in levels[:3]:
        # fault: a gap that begins counts as an error of it -> known &= level.covered > -1.0 | coupler/test_estimate
        known &= level.covered > WHOLLY
    return known


def _heat(solved: Solved) -> float | None:
    """Energy through contact in the window [J]; None where the scene has none."""
    return _sum_of(HEAT, solved)


def _sum_of(terms: Sequence[str], solved: Solved) -> float | None:
    """Energy of some heat terms in the window [J]; None where the scene has none of them."""
    names = [n for n in terms if solved.terms and n in solved.terms[0]]
    return sum(told[n] for told in solved.terms for n in names) if names else None


def _size(name: str, values: Array) -> float:
    """Of elastic strain the root mean square over a body, of anything else the largest."""
    return float(np.linalg.norm(values)) if quantity_of(name) == ELASTIC_STRAIN else _largest(values)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
