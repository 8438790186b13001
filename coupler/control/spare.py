"""Spare solves: now and then a window of a run in fixed windows is solved again as two halves, to see how wrong it is.

The run goes on from the window as it was solved, bit for bit as if nobody had looked.  When to look is counted in
windows and solves and not in seconds, so that a run that is resumed looks at the same ones.

What looks and gains may cost together is bounded by a share of the solves of the run (`allowance`), which is spent
first where errors are expected to be largest: at the start, and where probes bend more than at any look before.  Only
gains of what turns round by much are beyond it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.control import error_estimate, gain
from coupler.control.plan import Plan
from coupler.control.solve_window import SavedStates, SolveOptions, can_halve, doubled, keep
from coupler.scenario.options import Scheme, Seen
from coupler.schemes.accounts import AHEAD, EnergyAccount
from coupler.schemes.scheme import Sees
from coupler.schemes.schemes import scheme_of
from coupler.schemes.state import CoupledState, Halves, Solved, Span
from coupler.trust.in_time import course, time_shift
from coupler.trust.in_time.course import Course
from coupler.trust.in_time.errors import Looked
from coupler.trust.in_time.rhythm import MOST_PERIOD
from coupler.trust.in_time.time_shift import Shift

Array = NDArray[np.float64]

# What one look costs [windows], what is earned for it in every window, more in one in which a probe bends by more than
# `VISIBLE` of its range, and most by more than `ROUGH`: what is not resolved is to be seen.  And what a run begins
# with: two looks.  What begins to bend may be looked at on credit.
LOOK, EARNED, EARNED_ROUGH, EARNED_ROUGHEST = 2.0, 0.006, 0.025, 0.2
AT_FIRST = 2.0 * LOOK
# What all of it may cost, of the solves of the run, two looks at least; half of it is there at the start, and the rest
# comes with the windows.  Windows that are not resolved bring this part of their own solves: an answer that is wrong is
# to be told so, whatever that costs.
SHARE, AT_START, UNRESOLVED = 0.05, 0.5, 0.1
# The first two windows are looked at: nothing is known yet by which the exchange could be extrapolated, and what begins
# changes most.  With those two 81 % of 165 told errors were within a factor of 3 of the true ones and 10 % understated
# by more, with the third alone 47 and 43 %, with the first and the third 75 and 14 %.
HISTORY = 2
# A probe that bends more than so many times as much as at any look before, and by this share of its range, is looked at
# as soon as this part of the usual pause is over: what grows doubles often.
BENDS_MORE, VISIBLE, PART = 2.0, 0.01, 0.25
# Where contact closes or opens, one that bends by this share of its range, and by so many times as much, is looked at
# at once and whatever that costs: contact that opens under load, in a window that nobody looked at, may be off by half
# of what it carried.  Each time it is twice as much, so it is seldom.  Adaptive windows are measured as they find their
# size; those that were not are looked at where a probe bends by as much.
LARGE = 0.2
# Probes that bend by more of their range in two windows on end are not resolved: then it is measured, too, whether the
# exchange is stable (coupler.control.gain), for two windows where it answers weakly, five or six where it does not.
# For that there is a share of all windows, at least enough for one, and more of every rough one and of one in which a
# probe turns round by so much: what a window does to a disturbance changes where something opens and closes, and a
# cycle of the exchange turns more often than anything that its windows resolve.
ROUGH, ON_END = 0.05, 2
GAIN, GAIN_SHARE, MOST_GAINS, EARNED_TURN = 2.0, 0.02, 4.0, 0.5
# Turns pay for most of it, so that what is paid for falls on the same place of a cycle again and again, where the gap
# is shut or wide and little is fed back.  Every two measurements that find nothing put the next off by a window more,
# up to the longest cycle that is looked for.


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class Memory:
    """course : of the probes.  credit [windows]: what may be spent.  since : windows since the last look.

    rough : windows on end in which a probe bent by much.  highest : (n,) in SI, of each its largest bend at a look.
    for_gain [windows]: what may be spent on gains.  rings : whether the last one measured rings; quiet : how many on
    end did not.  due : windows on end in which one could be measured.
    turns : whether a probe turned round in the last window, by much.
    windows : so far, of `own` solver calls, of which `unresolved` those that probes bend by much in, on end.
    spent : solver calls of looks, and of gains but for those that turns paid for.  gains : so many were measured.
    turned : whether a probe turned round by much since the last of them.
    switched : whether contact closed or opened in the last window.
    again : whether something began in the window that was looked at last, of which the next tells how it goes on.
    """

    course: Course = field(default_factory=Course)
    credit: float = 0.0
    since: int = 0
    rough: int = 0
    highest: Array = field(default_factory=_none)
    for_gain: float = 0.0
    rings: bool = False
    quiet: int = 0
    due: int = 0
    turns: bool = False
    windows: int = 0
    own: int = 0
    unresolved: int = 0
    spent: int = 0
    gains: int = 0
    turned: bool = False
    switched: bool = False
    again: bool = False


def first(plan: Plan, state: CoupledState) -> Memory:
    """Return the memory before the first window."""
    values = plan.watched(state.now)
    return Memory(course.begun(state.now.t, values), AT_FIRST, highest=np.zeros(len(values)),
                  for_gain=min(max(GAIN_SHARE * _windows(plan), GAIN), MOST_GAINS))


def after(memory: Memory, t: float, values: Array, solves: int, switches: bool = False) -> tuple[Memory, Looked]:
    """Return the memory after a window to t [s] that was taken, and what its end tells.

    values : of the probes.  solves : of either half that it took.  switches : whether contact closes or opens in it.
    """
    now, second = course.after(memory.course, t, values)
    by_much = second > ROUGH * now.range
    rough = memory.rough + 1 if by_much.any() else 0
    turns = bool((by_much & (now.slope * memory.course.slope < 0.0)).any())
    for_gain = memory.for_gain + (EARNED_ROUGH if rough else 0.0) + (EARNED_TURN if turns else 0.0)
    memory = replace(memory, course=now, credit=memory.credit + _earned(now, second), since=memory.since + 1,
                     rough=rough, turns=turns, turned=memory.turned or turns,
                     for_gain=for_gain, windows=memory.windows + 1, own=memory.own + solves,
                     unresolved=memory.unresolved + (solves if rough >= ON_END else 0),
                     due=memory.due + 1 if rough >= ON_END and for_gain >= GAIN else 0)
    # fault: what bends for a switch in the window before is taken for smooth -> return replace(memory,
    #   switched=switches), Looked(values, second, switch=switches) | coupler/test_spare
    return replace(memory, switched=switches), Looked(values, second, switch=switches or memory.switched)


def _earned(now: Course, second: Array) -> float:
    # fault: what is not resolved at all is looked at as seldom as what bends -> if False: | coupler/test_spare
    if (second > ROUGH * now.range).any():
        return EARNED_ROUGHEST
    return EARNED_ROUGH if (second > VISIBLE * now.range).any() else EARNED


def allowance(memory: Memory, plan: Plan) -> float:
    """Return how many solver calls looks and gains may have taken by now.  memory : after at least one window."""
    a_window = memory.own / memory.windows
    share = SHARE * (AT_START * a_window * _windows(plan) + (1.0 - AT_START) * memory.own)
    return max(AT_FIRST * a_window, share) + UNRESOLVED * memory.unresolved


def _can_afford(memory: Memory, windows: float, plan: Plan) -> bool:
    """Whether what costs as much as so many windows may be spent."""
    # fault: looks cost what they cost -> return True | coupler/test_spare
    return memory.spent + windows * memory.own / memory.windows <= allowance(memory, plan)


def wanted(memory: Memory, seen: Looked, number: int, plan: Plan, *, last: bool = False) -> bool:
    """Whether to look at a window.  memory : after it.  number : of it, from 0.  last : the run ends with it."""
    if not seen.values.size:
        return False
    if plan.adaptive is not None:
        # What was carried on from windows before knows nothing of what sets in here, such as yield.
        # fault: what sets in within an adaptive window is taken for an error of it -> return False | coupler/test_spare
        return number >= HISTORY and bool((seen.second > LARGE * memory.course.range).any())
    windows = _windows(plan)
    if number < HISTORY:
        # fault: the first windows are not looked at -> return False | coupler/test_spare
        return number == 0 or windows > HISTORY
    more = _bends_more(memory, seen)
    # What was seen before something began tells nothing of how it goes on, nor does the window that it began in.
    # fault: what goes on after something began is as wrong as what was before -> if False: |
    #   coupler/test_estimate_strain
    if memory.again:
        return True
    # fault: what bends most waits for its turn -> if False: | coupler/test_spare
    if _at_any_cost(memory, seen) or (last and _tells_more(memory, seen)):
        return True
    pause = windows * LOOK / (AT_FIRST + _earned(memory.course, seen.second) * windows)
    # fault: what begins to bend is not looked at before its turn -> if False: | coupler/test_spare
    if more and memory.since >= PART * pause:
        return memory.credit >= -AT_FIRST and _can_afford(memory, 0.0, plan)
    return memory.credit >= LOOK and memory.since >= pause and _can_afford(memory, LOOK, plan)


def _bends_more(memory: Memory, seen: Looked) -> bool:
    """Whether a probe bends more than at any look before, by what is seen."""
    visible = seen.second > VISIBLE * memory.course.range
    return bool((visible & (seen.second > BENDS_MORE * memory.highest)).any())


def _at_any_cost(memory: Memory, seen: Looked) -> bool:
    bends = seen.second > np.maximum(BENDS_MORE * memory.highest, LARGE * memory.course.range)
    return seen.switch and bool(bends.any())


def _tells_more(memory: Memory, seen: Looked) -> bool:
    """Whether a probe bends more than at any look before, by what adds up to a visible part of its range.

    What grows to the end errs most there, and nothing that was seen before tells by how much.
    """
    adds_up = memory.windows * seen.second > VISIBLE * memory.course.range
    # fault: what grows until the run ends is never looked at -> return bool((adds_up & False).any()) |
    #   coupler/test_spare::test_what_grows_until_the_run_ends_is_looked_at_in_its_last_window
    return bool((adds_up & (seen.second > memory.highest)).any())


def _windows(plan: Plan) -> int:
    return len(plan.schedule.bounds) - 1


def spent(memory: Memory, seen: Looked, number: int) -> Memory:
    """Return the memory after a look at a window.  number : of it, from 0; its bend is the whole of a change."""
    highest = np.maximum(memory.highest, seen.second) if number else memory.highest
    # What smooth windows err by is to be seen, too, wherever contact switched before.
    # fault: looks at switches leave nothing for the rest -> if False: | coupler/test_spare
    if number >= HISTORY and _at_any_cost(memory, seen):
        return replace(memory, highest=highest)
    return replace(memory, credit=memory.credit - LOOK, since=0, highest=highest, spent=memory.spent + seen.solves,
                   again=number >= HISTORY and not memory.again and _bends_more(memory, seen))


@dataclass(frozen=True)
class Window:
    """A window that was taken.  before : the state at its start.  saved : the states of both halves then.

    solved : its outcome, where the halves are.
    """

    before: CoupledState
    span: Span
    options: SolveOptions
    saved: SavedStates
    solved: Solved


def look(halves: Halves, window: Window, plan: Plan, seen: Looked) -> Looked:
    """Return what was seen of a window with the errors of the probes, if they can be known, and what that cost.

    The halves are as before, afterwards.
    """
    solved, span = window.solved, window.span
    options = replace(window.options, scheme=solved.scheme, extrapolation=solved.extrapolation, instead=keep)
    with SavedStates(halves, solved.state.now.t, window.saved.number) as end:
        found = doubled(halves, _as_halved(window.before, solved.scheme), span, options, window.saved, solved)
        other = plan.watched(found.state.now) if found.taken else seen.values
        # fault: a look leaves the halves where it ended -> pass | coupler/test_spare
        end.roll_back("a window was only looked at")
    work, own = found.work, solved.work
    solves = work.thermal_solves + work.mechanical_solves - own.thermal_solves - own.mechanical_solves
    seen = replace(seen, solves=solves)
    if not found.taken:
        return seen
    factor = factors(window.before, solved, options.settings.iteration.level, plan)
    seen = replace(seen, shift=shift_of(window.before, solved, found, options.settings.iteration.level))
    return replace(seen, error=difference(seen.values, other, factor))


def shift_of(before: CoupledState, whole: Solved, halves: Solved, level: Seen, *,
             kept_in_halves: bool = False) -> Shift:
    """Return by how much a window shifts the run, from its two answers.

    before, level, kept_in_halves : as of `factors`.
    """
    doubling = error_estimate.doubling_of(before, whole, level)
    end = (halves if kept_in_halves else whole).state.now
    apart = halves.state.now.T - whole.state.now.T
    one, two = (time_shift.shift(before.now, end, f * apart) for f in (doubling.whole, doubling.halves))
    return Shift(two if kept_in_halves else one, one, 2 if doubling == error_estimate.DOUBLING[2] else 1)


def asks_gain(memory: Memory, seen: Looked, number: int, window: Window, plan: Plan) -> bool:
    """Whether the gain of a window is measured.  memory, seen : after it.  number : of it, from 0."""
    span = window.span
    if plan.adaptive is not None or not seen.values.size or number < HISTORY or 2 * span.k1 - span.k0 > plan.last:
        return False
    # What grows unseen is worth nothing: the first is always there, and turns pay for their own.
    if memory.gains and not (memory.rings or memory.turned or _can_afford(memory, GAIN, plan)):
        return False
    # What rings is looked at again, whatever that costs.
    # fault: gains are measured at one place of a cycle -> return memory.rough >= ON_END and (memory.due > 0 or
    #   memory.rings) | coupler/test_instability
    return memory.rough >= ON_END and (memory.due > (memory.quiet // 2) % MOST_PERIOD or memory.rings)


def gain_of(halves: Halves, window: Window) -> gain.Gain | None:
    """Return the gain of a window; None where it cannot be known.  The halves are as before, afterwards."""
    solved = window.solved
    with SavedStates(halves, solved.state.now.t, window.saved.number) as end:
        found = gain.measured(halves, window.before, window.span, window.options, window.saved, solved)
        # fault: measuring a gain leaves the halves where it ended -> pass | coupler/test_spare
        end.roll_back("a window was only looked at")
    return found


def after_gain(memory: Memory, found: gain.Gain | None) -> Memory:
    """Return the memory after a gain was measured."""
    rings = found is not None and found.rings
    return replace(memory, for_gain=memory.for_gain - GAIN, rings=rings, quiet=0 if rings else memory.quiet + 1, due=0,
                   spent=memory.spent + (0 if found is None or memory.turned else found.solves),
                   gains=memory.gains + 1, turned=False)


def factors(before: CoupledState, solved: Solved, level: Seen, plan: Plan, *, kept_in_halves: bool = False) -> Array:
    """Return what to multiply the distance of two answers of a window by, (n,) of the probes.

    before : at its start.  level : `coupling.iteration.level`.  kept_in_halves : the answer of its halves is kept.
    """
    thermal, mechanical = (error_estimate.doubling_of(before, solved, level, mechanical=one) for one in (False, True))
    # fault: probes of stress that relaxes are taken for as exact as the exchange -> both = [d.halves if kept_in_halves
    #   else d.whole for d in (thermal, thermal)] |
    #   coupler/test_estimate_strain::test_fixed_windows_are_told_as_wrong_as_they_are
    both = [d.halves if kept_in_halves else d.whole for d in (mechanical, thermal)]
    return np.where(plan.mechanical, *both) if plan.mechanical.size else np.array(both[1])


def difference(values: Array, other: Array, factor: Array) -> Array:
    """Return factor, of each, times the distance of two answers, (n,) in SI; 0 where one of them is no number."""
    return np.nan_to_num(factor * np.abs(values - other), nan=0.0, posinf=0.0)


def _as_halved(state: CoupledState, scheme: Scheme) -> CoupledState:
    """The state from which two halves are solved: with half of the heat that comes a window late.

    That is what windows of half the size would carry, and a quarter of what was delivered ahead.  All of it, delivered
    in the first half, would be told as an error in every window, while what is late is late once.
    """
    ahead = scheme_of(scheme).exchange_at(Seen.MIDDLE).friction is not None
    # fault: late heat is told as an error of every window -> return state | coupler/test_spare
    return replace(state, accounts={n: _halved(a, ahead and n in AHEAD) for n, a in state.accounts.items()})


def _halved(account: EnergyAccount, ahead: bool) -> EnergyAccount:
    late = None if account.late is None else 0.5 * account.late
    if not ahead or late is None:
        return replace(account, carry=(0.25 if ahead else 0.5) * account.carry, late=late)
    return replace(account, carry=late + 0.25 * (account.carry - 2.0 * late), late=late)


def as_whole(state: CoupledState, scheme: Scheme, H: float) -> CoupledState | None:
    """Return the state from which a window of H [s] is solved in one to be held against its two halves; None: as it is.

    Of heat that comes a window late, its halves deliver what the first of them makes, too; the window in one is given
    as much, at the power of before.  Else that would be told as an error of every window, while what is late is late
    once.
    """
    exchange = scheme_of(scheme).exchange_at(Seen.MIDDLE)
    # What is carried past a window that delivers its own heat belongs to later times (EnergyAccount.late).
    # fault: friction heat that is kept back is taken for heat that comes late -> if False: | coupler/test_spare
    if exchange.heat.sees is not Sees.START:
        return None
    ahead = AHEAD if exchange.friction is not None else frozenset()
    # fault: heat that halves deliver is held against nothing -> carried: dict[str, EnergyAccount] = {} |
    #   coupler/test_estimate::test_heat_that_comes_late_is_no_error_of_every_window
    carried = {n: a for n, a in state.accounts.items() if n not in ahead and a.carry.any()}
    late = {n: replace(a, carry=a.carry + 0.5 * H * a.power) for n, a in carried.items() if a.power is not None}
    return replace(state, accounts={**state.accounts, **late}) if late else None


def can_look(halves: Halves, span: Span) -> bool:
    """Whether a window can be solved again, and as two."""
    return halves.thermal.can_save and halves.mechanical.can_save and can_halve(span)

