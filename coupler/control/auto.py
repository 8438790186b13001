"""`auto`: the cheapest scheme that is safe, window by window, from what iterates already computed tell.

With rho, what plain iteration multiplies a difference by in one window, and R, what is left of a temperature after
one window with the geometry held, an alternation from window to window is multiplied by R - 2 rho f in windows solved
once, where f is how often the thermal half sees it (coupler.schemes.levels, alternating_gain).  So it dies where

    2 rho f < 1 + R          (docs/theory.md, limits of stability).

rho is measured: by every window that is iterated.  R is not: it is at least 0 for backward Euler, and then rho f < 1/2
is enough.  The most accurate extrapolation of x and t_N that keeps this is taken; where none does, the window is
iterated.  In windows beyond 1/a R may be below 0 (-0.2 with sdirk2, -1 with the midpoint rule): then an alternation
that does not die is seen by the misses of the prediction, and windows are iterated from there on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.control.contact_status import pressed
from coupler.control.cost import SchemeCosts, learned
from coupler.control.error_estimate import Estimate
from coupler.control.gain import ROUND_OFF
from coupler.control.unannounced import front_moves, open_gaps, other_gaps
from coupler.scenario.options import Iteration, MeasuredIteration, Scheme, Seen
from coupler.schemes.accounts import AHEAD
from coupler.schemes.ledger import MOVED
from coupler.schemes.levels import DAMPED, alternating_gain, closest, largest_trend, predicted
from coupler.schemes.scheme import CouplingScheme
from coupler.schemes.schemes import scheme_of
from coupler.schemes.state import CoupledState, Halves, IterationHistory, Solved

Array = NDArray[np.float64]

# The schemes it chooses from.
CANDIDATES = (Scheme.ITERATED, Scheme.EXTRAPOLATED, Scheme.STAGGERED, Scheme.ADIABATIC)


def chooses(name: Scheme) -> bool:
    """Whether the scheme of each window is chosen."""
    return name is Scheme.AUTO


def schemes_under(name: Scheme) -> tuple[CouplingScheme, ...]:
    """The schemes by which windows may be solved where the settings name this one: itself, or all that are chosen from.
    """
    return tuple(scheme_of(each) for each in (CANDIDATES if chooses(name) else (name,)))


# Limits of rho f (docs/theory.md), chosen on the cases of tests/stability and looked at again on others
# (docs/coupling.md, where `auto` was not tuned; benchmarks/auto_unseen.py).
#
# The largest rho f at which a window is solved once at all, by the damped extrapolation: the 1/2 of R = 0 and a tenth
# of it, for where the exchange moves much R is well above 0.
MAX_GAIN = 0.55
# By a more accurate extrapolation an alternation must be damped in every window to this part at most, whatever R >= 0
# is: 2 rho f < 0.8.
MAX_GAIN_DAMPED = 0.8
# Of the adiabatic split rho is at most 0.4: it takes care of what heat of squeezing feeds back, delta/2 at most, and
# mechanics go first in it, so an alternation of anything else is seen once at most: 2 rho < 0.8.  With 0.25 case E1 at
# 3 limits was not solved by it and missed its rest by 0.026; with 0.4 by 0.0067.
# fault: auto freezes entropy only where little is fed back -> MAX_GAIN_SPLIT = 0.25 | stability/test_atlas
MAX_GAIN_SPLIT = 0.5 * MAX_GAIN_DAMPED
# Below this three iterates agree, of second order: what the split spares is not worth its first.
# fault: auto freezes entropy where iterates agree at once -> MIN_GAIN_SPLIT = 0.0 | coupler/test_auto
MIN_GAIN_SPLIT = 0.1
# Windows solved once hand heat of mechanics over a window late, of first order; below MIN_GAIN_SPLIT that is what is
# wrong with them.  Where it is more than this share of the heat that nodes took up or gave off, two iterates pay.
MIN_SQUEEZED = 0.02
# Where what comes out of an iterate goes with what was put in, by more than this share, implicit steps are too long to
# follow what drives itself on: they end on the other side of its unstable rest, or stay there.  One solve follows it.
# A ratio below 0 by less than this share of the largest is none that turns round.
DRIVEN, ALONG = 0.8, 0.1
# rho is measured again when T, x or t_N have gone so many of the longest steps they took in a window, twice as many
# each time, for rho drifts with them.  What hardly moves any more needs no measuring.
FIRST_REST, LONGEST_REST = 1, 64
# Where it lets x only be held or damped it is measured again after so many at the latest: one that has become smaller
# lets x be extrapolated.  (Two rods that oscillate: measured where their gap is least it stayed so for ten periods.)
HELD_REST = 8
# Ratios of iterates of one window that differ by more were taken far from its solution: the measure is rough.
ROUGH, ROUGH_REST = 1.5, 2
# Two successive ratios that differ by less than this share agree.
SETTLED = 0.05
# A single ratio may be of a miss that the exchange does not multiply: it lowers rho to this share at most.
LOWERS = 0.5
# rho was found to grow with H, by at most H.  In a window longer by more than this it is taken to grow with H^2, and is
# measured anew where that is too much.
LONGER = 2.0
# Part of the nodes that touch may change before rho is measured anew: blocks that slide change a few in every window.
OTHER_TOUCH = 0.25
# Misses of the prediction that turn round so many times on end and are at least MAX_GAIN_DAMPED times as long each
# time, above LEAST_MISS of the differences of temperature, or what solvers leave where all is even, are an alternation
# that hardly dies: rho is measured at once.
TURNS, OPPOSITE, LEAST_MISS = 3, 0.5, 1e-6
# Below this part of what a window changes they are not counted: an alternation of z is missed by 4 z, so what is less
# than an eighth of the change is left alone.
# fault: auto counts misses far smaller than the change -> MIN_VISIBLE = 0.0 | coupler/test_auto
MIN_VISIBLE = 0.5
# If rho had not been too large, the model does not hold in windows of this size, nor in those longer than this share.
WARY_FROM = 0.5
# Where rho f is below this an alternation does not come from the exchange but from one half, or from a front that goes
# from node to node: iterating would not end it.  Twice as many turns are waited for then, in case rho has drifted.  So
# much, and no more, may rho f be where windows were found not to follow the model.
MIN_COUPLING_GAIN = 0.05
# Iterates of a window that only measures need not agree better than windows solved once do.
LOOSE = 0.3
# The first window of a run is as long as those solved once after it, and they miss more than this share of a change.
BEGINS = 0.01


@dataclass(frozen=True)
class Steps:
    """How far a window went, at most over all nodes.  T [K], x [m], t_N [Pa]."""

    T: float = 0.0
    x: float = 0.0
    t_N: float = 0.0


@dataclass(frozen=True)
class Memory:
    """What was measured of the exchange since the last event.

    rho : contraction of plain iteration in windows of H seconds, nan: not known.  driven : what changes drives itself
    on, instead of turning round.  growth : of ln rho, a window.
    rest : windows until it is measured again, `since` of them over, each counted as far as it moved.  longest : steps
    in a window.  touching : pair nodes under pressure, gaps [1/m2] : sum of 1/gap^2 of those without, when it was
    measured.
    miss : (n_nodes,) [K] outcome less prediction of the last window solved once.  turns : of it, on end.
    alternating_gain : f of that window.  wary [s] : windows so long did what rho does not foretell; 0: none did.
    squeezed : what mechanics made of heat in the last window, but for that of friction, over what nodes took up and
    gave off in it, where that is told.
    costs : of windows solved once and iterated, where their errors are known.
    """

    rho: float = math.nan
    H: float = 0.0
    driven: bool = False
    growth: float = 0.0
    rest: int = FIRST_REST
    since: float = 0.0
    longest: Steps = Steps()
    touching: int = 0
    gaps: float = 0.0
    miss: Array = field(default_factory=lambda: np.zeros(0))
    turns: int = 0
    alternating_gain: float = 0.0
    wary: float = 0.0
    squeezed: float = 0.0
    costs: SchemeCosts = field(default_factory=SchemeCosts)


@dataclass(frozen=True)
class SchemeChoice:
    """scheme : of the next window.  reason : in words.  extrapolation : of x and t_N (coupler.schemes.levels).

    loose : the share of a change in which iterates need only agree; 0: as the user said.
    """

    scheme: Scheme
    reason: str
    extrapolation: float = 0.0
    loose: float = 0.0


def choose(memory: Memory, state: CoupledState, H: float, freezes: bool = False, weighs: bool = False,
           breaks: bool = False) -> SchemeChoice:
    """The scheme of a window of H seconds.  freezes : the halves can be run by the scheme `adiabatic`.

    weighs : errors are known, so that what iterating costs is; windows that measure are then iterated to the end.
    breaks : a drive has a kink at its end, or the run is over.
    """
    loose = 0.0 if weighs else LOOSE
    if not state.past or math.isnan(memory.rho):
        return SchemeChoice(Scheme.ITERATED, "the contraction is not known yet", loose=BEGINS)
    rho = rho_at(memory, H)
    wary = 0.0 < WARY_FROM * memory.wary < H
    if memory.costs.waits and not (memory.driven and rho > MAX_GAIN):
        return SchemeChoice(Scheme.ITERATED, f"contraction {rho:.2g}, and iterating costs less for the error wanted")
    # fault: what was handed ahead of the last window that makes heat is never settled -> if False: |
    #   coupler/test_auto
    if breaks and _hands_ahead(state) and not (memory.driven and rho > MAX_GAIN):
        return SchemeChoice(Scheme.ITERATED, "friction may end with this window: it hands over the heat it makes")
    # fault: heat of squeezing is handed over a window late where two iterates would agree -> if False: |
    #   coupler/test_auto
    if weighs and memory.squeezed > MIN_SQUEEZED and not wary and rho < MIN_GAIN_SPLIT:
        return SchemeChoice(Scheme.ITERATED, f"contraction {rho:.2g}, and heat of squeezing would come a window late")
    if freezes and _makes_heat(state) and MIN_GAIN_SPLIT <= rho < MAX_GAIN_SPLIT:
        return SchemeChoice(Scheme.ADIABATIC, f"contraction {rho:.2g}, and the heat of squeezing acts back")
    # What is only reckoned for longer windows is measured first.
    # fault: windows of first order for what was never measured to drive itself on so much -> if memory.driven and rho >
    #   MAX_GAIN and memory.since < memory.rest: | coupler/test_auto
    if memory.driven and rho > MAX_GAIN and memory.since < memory.rest and H <= LONGER * memory.H:
        return SchemeChoice(Scheme.STAGGERED, f"contraction {rho:.2g}, of what drives itself on")
    extrapolation = _extrapolation(memory, state, state.now.t + H, wary)
    if extrapolation is None and wary:
        return SchemeChoice(Scheme.ITERATED, "windows solved once went up and down, though the contraction is small")
    if extrapolation is None and H > LONGER * memory.H:
        return SchemeChoice(Scheme.ITERATED, f"the contraction is known in windows of {memory.H:.3g} s only")
    if extrapolation is None:
        return SchemeChoice(Scheme.ITERATED, f"contraction {rho:.2g}, too much for windows solved once")
    if memory.turns >= (TURNS if memory.rho * memory.alternating_gain > MIN_COUPLING_GAIN else 2 * TURNS):
        return SchemeChoice(Scheme.ITERATED, "windows solved once go up and down: the contraction is measured again")
    # fault: a contraction that was large once is believed for long -> if memory.since >= memory.rest: |
    #   coupler/test_auto
    if memory.since >= (min(memory.rest, HELD_REST) if extrapolation < 0.0 else memory.rest):
        return SchemeChoice(Scheme.ITERATED, f"contraction {rho:.2g} is measured again", loose=loose)
    # fault: auto holds a front that has just begun -> if extrapolation < 0.0 and False: | coupler/test_auto
    if extrapolation < 0.0 and len(state.past) == 1 and front_moves(state):
        # A front is fastest at first, and what is steady enough with one level behind holds where it has gone.
        return SchemeChoice(Scheme.ITERATED, f"a front moves, and contraction {rho:.2g} lets x only be held",
                            loose=loose)
    limit = stable_window(memory)
    stable = "stable in windows of any size" if math.isinf(limit) else f"stable up to {limit:.2g} s"
    return SchemeChoice(Scheme.EXTRAPOLATED, f"contraction {rho:.2g}, {stable}", extrapolation)


def _extrapolation(memory: Memory, state: CoupledState, end: float, wary: bool) -> float | None:
    """How x, t_N and the power of friction are extrapolated to `end` [s]; None where no way is damped enough."""
    times = _times(state)
    rho = rho_at(memory, end - times[0])
    if rho == 0.0:
        return closest(times, end, math.inf)
    # fault: a wary auto extrapolates as far as ever -> most = 0.5 * MAX_GAIN_DAMPED / rho | coupler/test_auto
    most = (MIN_COUPLING_GAIN if wary else 0.5 * MAX_GAIN_DAMPED) / rho
    extrapolation = closest(times, end, most)
    if extrapolation is None:
        # fault: auto believes twice the contraction -> damped = alternating_gain(times, end, DAMPED) * rho <=
        #   2.0 * MAX_GAIN | coupler/test_auto
        damped = alternating_gain(times, end, DAMPED) * rho <= MAX_GAIN
        return DAMPED if damped and not wary else None
    # fault: auto does not think of friction -> return extrapolation | coupler/test_friction_trend
    return min(extrapolation, largest_trend(times, end, most)) if _hands_ahead(state) else extrapolation


def _times(state: CoupledState) -> list[float]:
    return [state.now.t, *(level.t for level in state.past[:2])]


def rho_at(memory: Memory, H: float) -> float:
    """The most that rho can be in windows of H seconds: it grows, by at most H as far as was seen; nan: unknown."""
    if math.isnan(memory.rho):
        return math.nan
    longer = max(H / memory.H, 1.0)
    # fault: auto trusts a contraction of much shorter windows -> return memory.rho * (longer) | coupler/test_auto
    return memory.rho * (longer if longer <= LONGER else longer**2)


def stable_window(memory: Memory) -> float:
    """The largest window [s] that can be solved once, as far as is known; nan: unknown.  rho grows by at most H."""
    return memory.H * MAX_GAIN / memory.rho if memory.rho > 0.0 else math.nan if math.isnan(memory.rho) else math.inf


def runs_away(history: IterationHistory | None) -> bool:
    """Whether an iterated window lies past where implicit steps follow what drives itself on."""
    # fault: auto iterates past the unstable rest -> return history is not None and _drives_on(history) and
    #   history.contraction > 1e9 | coupler/test_auto
    return history is not None and _drives_on(history) and history.contraction > DRIVEN


def can_freeze(halves: Halves, substeps: Mapping[str, int]) -> bool:
    """Whether the halves can be run by the scheme `adiabatic`."""
    return scheme_of(Scheme.ADIABATIC).lacking(halves.thermal, halves.mechanical, substeps) is None


def instead(solved: Solved, freezes: bool, seen: Seen) -> Scheme | None:
    """The scheme by which an iterated window is to be solved once more; None: it stays.

    Where its iterates show that what changes drives itself on: `staggered`; where they show that heat of squeezing is
    all that acts back: `adiabatic`.  freezes : the halves can be run by that.  seen : as of `learn`.
    """
    if runs_away(solved.history):
        return Scheme.STAGGERED
    return Scheme.ADIABATIC if freezes and squeezes(solved, seen) else None


def squeezes(solved: Solved, seen: Seen) -> bool:
    """Whether an iterated window says that the adiabatic split does as well.  seen : as of `learn`."""
    if solved.history is None or not _makes_heat(solved.state):
        return False
    return MIN_GAIN_SPLIT <= Measure.of(solved.history, seen, math.nan).rho < MAX_GAIN_SPLIT


def _makes_heat(state: CoupledState) -> bool:
    """Whether the mechanical half has: at frozen entropy all of it is E_S."""
    # fault: entropy that moved is no heat of squeezing -> return state.accounts["E_M"].made != 0.0 | coupler/test_auto
    return any(account.made != 0.0 for account in state.accounts.values())


def _hands_ahead(state: CoupledState) -> bool:
    """Whether windows solved once are given heat before it is made: none would be left to make up for too much."""
    return any(a.power is not None and a.power.any() for n, a in state.accounts.items() if n in AHEAD)


def _squeezed(solved: Solved) -> float:
    """What mechanics made of heat in a window, but for that of friction, over what nodes took up and gave off in it."""
    accounts = solved.state.accounts
    made = sum(float(np.abs(a.power).sum()) for n, a in accounts.items() if n not in AHEAD and a.power is not None)
    # `power` is that of the last of the solves that make up the window.
    length = solved.state.now.t - (solved.state.past[0].t if solved.state.past else solved.state.now.t)
    moved = sum(told.get(MOVED, 0.0) for told in solved.terms)
    return made * length / moved if moved > 0.0 else 0.0


def _drives_on(history: IterationHistory) -> bool:
    """Whether no iterate turned round.  Where fronts move some do and some do not: nothing is to be learnt there."""
    return min(history.ratios, default=-1.0) > -ALONG * history.contraction


def loosened(how: Iteration, share: float) -> Iteration:
    """How a window is iterated that only measures: twice at least, and then to this share of a change."""
    looser = {name: q.changed(rtol=max(q.rtol, share)) for name, q in how.tolerance}
    return MeasuredIteration.model_construct(**{**how.__dict__, "tolerance": how.tolerance.changed(**looser)})


def learn(memory: Memory, start: CoupledState, solved: Solved, H: float, seen: Seen = Seen.MIDDLE,
          error: Estimate | None = None) -> Memory:
    """The memory after a window was taken.  solved.scheme, solved.history : how it was solved.  error : where known.

    seen : of which time iterates gave x to the thermal half.  At the end of the window it feels twice as much of it.
    """
    if error is not None:
        # The first iterated window after a kink is loose.
        exact = bool(start.past) and not math.isnan(memory.rho)
        memory = replace(memory, costs=learned(memory.costs, solved, H, error, exact))
    # In halves rho is measured of those, and grows by H at most: twice as much is its most in the whole.
    # fault: rho of halves is taken for that of the window -> longer = 1.0 | coupler/test_friction_trend
    longer = 2.0 if solved.whole is not None else 1.0
    touching, gaps = pressed(solved.state.now), open_gaps(solved.state.now)
    known = rho_at(memory, H / longer)
    memory, moved = _moved(replace(memory, squeezed=_squeezed(solved)), start, solved)
    if solved.history is not None:
        measure = Measure.of(solved.history, seen, known)
        measure = replace(measure, rho=longer * measure.rho)
        return _measured(memory, measure, H, WindowChange(moved, touching, gaps))
    memory = _watched(memory, start, solved)
    other = abs(touching - memory.touching) > OTHER_TOUCH * max(touching, memory.touching)
    # fault: auto trusts a contraction of wide gaps in narrow ones -> if other: | coupler/test_auto
    if other or other_gaps(memory.gaps, gaps):
        return replace(memory, rho=math.nan, rest=FIRST_REST)
    # fault: a window at rest counts towards the next measurement -> return replace(memory, since=memory.since + 1.0) |
    #   coupler/test_auto
    return replace(memory, since=memory.since + moved)


def _moved(memory: Memory, start: CoupledState, solved: Solved) -> tuple[Memory, float]:
    """What the window moved: the largest share of the longest step, of T, x or t_N."""
    a, b, known = start.now, solved.state.now, memory.longest
    step = Steps(*(float(np.abs(new - old).max(initial=0.0)) for new, old in ((b.T, a.T), (b.x, a.x), (b.t_N, a.t_N))))
    longest = Steps(max(step.T, known.T), max(step.x, known.x), max(step.t_N, known.t_N))
    shares = [one / most for one, most in ((step.T, longest.T), (step.x, longest.x), (step.t_N, longest.t_N))
              if most > 0.0]
    return replace(memory, longest=longest), max(shares, default=0.0)


def rejected(memory: Memory) -> Memory:
    """The memory after a window whose error was too large: it may come of a contraction that is not what it was."""
    # fault: auto trusts its contraction where windows are put back -> return memory | coupler/test_auto
    return replace(memory, since=math.inf)


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return Memory()


@dataclass(frozen=True)
class Measure:
    """What a window that was iterated tells.  rho : nan: nothing.  driven : as in the memory.

    The first ratios are of whatever was missed, the later ones of what the exchange multiplies most: where two agree,
    or the last with what was known, it is that one, else the largest.  rough : its iterates do not agree on rho.
    single : there was one ratio only.
    """

    rho: float = math.nan
    driven: bool = False
    rough: bool = False
    single: bool = False

    @staticmethod
    def of(history: IterationHistory, seen: Seen, known: float) -> Measure:
        """history : of the window.  seen : as of `learn`.  known : rho of windows so long, as far as was known."""
        if math.isnan(history.contraction):
            return Measure()
        felt = 0.5 if seen is Seen.END else 1.0
        told = [abs(ratio) for ratio in history.ratios] or [history.contraction]
        settled = any(abs(told[-1] - other) <= SETTLED * told[-1] for other in (*told[-2:-1], known / felt))
        rho = told[-1] if settled else history.contraction
        return Measure(rho * felt, _drives_on(history), rho > ROUGH * told[-1], len(told) == 1)


@dataclass(frozen=True)
class WindowChange:
    """What a window did.  moved : share of the longest step.  touching, gaps : at its end, as in the memory."""

    moved: float
    touching: int
    gaps: float


def _measured(memory: Memory, measure: Measure, H: float, change: WindowChange) -> Memory:
    """The memory after a window that was iterated; one whose first iterate agrees measures nothing."""
    rho, moved = measure.rho, change.moved
    told = replace(memory, since=0.0, turns=0, miss=np.zeros(0), touching=change.touching, gaps=change.gaps)
    if math.isnan(rho):
        return told
    known, apart = memory.rho, memory.since + moved
    driven = measure.driven
    if measure.single and known > 0.0:
        # A small ratio may be of a miss that has nothing to do with the exchange, so its sign tells nothing, either.
        # fault: one small ratio tells what drives itself on -> driven = measure.driven | coupler/test_auto
        driven = measure.driven if rho >= LOWERS * rho_at(memory, H) else memory.driven
        rho = max(rho, LOWERS * rho_at(memory, H))
    same = apart > 0.0 and math.isclose(H, memory.H)
    growth = math.log(rho / known) / apart if known > 0.0 and rho > 0.0 and same else 0.0
    rest = ROUGH_REST if measure.rough else FIRST_REST if math.isnan(known) else min(2 * memory.rest, LONGEST_REST)
    if growth > 0.0 and rho < MAX_GAIN:
        # Half of the windows until rho is too large, if it goes on so.
        rest = max(1, min(rest, int(0.5 * math.log(MAX_GAIN / rho) / growth)))
    # fault: auto wary of what the exchange does not feed -> wary = H if memory.turns >= TURNS and rho *
    #   memory.alternating_gain < MAX_GAIN else memory.wary | coupler/test_auto
    wary = H if memory.turns >= TURNS and MIN_COUPLING_GAIN < rho * memory.alternating_gain < MAX_GAIN else memory.wary
    return replace(told, rho=rho, H=H, driven=driven, growth=growth, rest=rest, wary=wary)


def _watched(memory: Memory, start: CoupledState, solved: Solved) -> Memory:
    """The memory with the miss of a window solved once: T less T on the line of the last two levels."""
    if start.before is None or solved.scheme is not Scheme.EXTRAPOLATED:
        return memory
    now = solved.state.now
    memory = replace(memory, alternating_gain=alternating_gain(_times(start), now.t, solved.extrapolation))
    miss, last = now.T - predicted(start.now, start.before, now.t).T, memory.miss
    if last.size != miss.size:
        return replace(memory, miss=miss)
    a2, b2, along = float(last @ last), float(miss @ miss), float(last @ miss)
    turned = along < -OPPOSITE * math.sqrt(a2 * b2) and b2 >= MAX_GAIN_DAMPED**2 * a2
    # fault: misses of small differences of temperature are not seen -> floor = 1e-4 | coupler/test_auto
    floor = max(LEAST_MISS * float(np.ptp(now.T)), ROUND_OFF * float(np.abs(now.T).max()))
    least = max(floor, MIN_VISIBLE * float(np.abs(now.T - start.now.T).max()))
    # fault: auto never sees misses turn round -> turns = 0 if turned and float(np.abs(miss).max()) > least else 0 |
    #   coupler/test_auto
    turns = memory.turns + 1 if turned and float(np.abs(miss).max()) > least else 0
    return replace(memory, miss=miss, turns=turns)
