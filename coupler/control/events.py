"""Events: where in a window contact opens, closes, sticks or slips, or a rule acts; the window is made to end there.

A window ends just behind its event, in the new status: a scheme that holds pressure and geometry of its start, or of
the windows before, then sees the new side of the laws from the first window after it.  An iterated one sees them on the
way to its end: behind an event where a law jumps it would hold the new side all the way, which then may keep the event
from happening, and no iterate agrees with itself.  So an iterated window ends just before.  What was found once is not
found again.  A rule that changes a load or ends the run acts where what it looks at passes its bound: the window ends
just behind that, whatever the scheme, for a rule sees only ends of windows (coupler.rules.instant).

Few tries are needed because what is left of a status (a gap, a pressure) is known at the ends of the windows before:
where it is about to run out a try ends a little before that, and the next one, from a point so near, just behind it.
Where nothing is known of it the interval between the last end before and the first end behind is halved.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from coupler.control.auto import schemes_under
from coupler.control.contact_status import MOST, ContactState, ContactStatus, Root, changed, root
from coupler.control.plan import Plan
from coupler.rules import engine as rules
from coupler.scenario.options import Scheme
from coupler.schemes.levels import Level
from coupler.schemes.scheme import CouplingScheme
from coupler.schemes.state import CoupledState, Solved, Span

# The search for one event in one window: what is known on either side of it, and where the next try is to end.

OF_RULES = (ContactState.WAITS, ContactState.ACTS)
# Every so many tries the interval is halved, however well the curve through the tries looks.
HALVE = 4
# Where nothing tells how near an event is (friction), halving alone costs a solve a factor of two: this share of the
# window is enough.
BLIND = 1.0 / 16.0


@dataclass(frozen=True)
class Reach:
    """Of a window.  must_end : the tick of the next breakpoint.  t0, t1 : its start and its farthest end tried [s].

    tolerance, least [s]: how nearly an event is located, and how short a window may be.  near [s]: before a kink at its
    end what is the kink's own.  schemes : by which it is solved, or may be.  of_rule : a rule is looked for.
    """

    span: Span
    must_end: int
    t0: float
    t1: float
    tolerance: float
    least: float
    near: float
    schemes: tuple[CouplingScheme, ...]
    of_rule: bool = False

    @property
    def behind(self) -> bool:
        """Whether the window is to end just behind its event, or just before."""
        # fault: a window ends before its event whatever the scheme -> return False | coupler/test_events
        return self.of_rule or all(scheme.ends_behind_event for scheme in self.schemes)

    def of(self, status: ContactState) -> Reach:
        """Return the same for what has this status now: a rule sees ends of windows, so they lie behind its bound."""
        # fault: an iterated window ends before the bound of a rule -> return self | coupler/test_rules_instant
        return replace(self, of_rule=True, near=0.0) if status in OF_RULES else self

    @property
    def holds(self) -> bool:
        """Whether mechanics sees the T of the start."""
        return all(scheme.sees_start_T for scheme in self.schemes)

    @property
    def end(self) -> float:
        """The end of this try [s]."""
        return self.span.end


@dataclass(frozen=True)
class Search:
    """Of status i.  trail : at the ends of windows, the last at the start of this one.  tried : at ends tried since."""

    i: int
    trail: tuple[ContactStatus, ...]
    tried: tuple[ContactStatus, ...]
    reach: Reach

    @cached_property
    def behind(self) -> list[ContactStatus]:
        """Ends tried that lie behind the event, the nearest first."""
        return sorted((s for s in self.tried if s.status[self.i] is not self._status), key=lambda s: s.t)

    @cached_property
    def before(self) -> list[ContactStatus]:
        """Ends known before it, in order of time."""
        first = self.behind[0].t if self.behind else float("inf")
        own = [s for s in self.tried if s.status[self.i] is self._status and s.t < first]
        at = next((k for k, s in enumerate(reversed(self.trail)) if s.status[self.i] is not self._status),
                  len(self.trail))
        return [*self.trail[len(self.trail) - at:], *sorted(own, key=lambda s: s.t)]

    @property
    def done(self) -> bool:
        """Whether this try ends beside the event, on the side that is wanted, as nearly as is asked for."""
        r, lo = self.reach, self.before[-1].t
        if self.behind:
            hi = self.behind[0].t
            if r.end == hi and hi - r.t0 <= 1.01 * r.least:
                return True
            blind = not any(s.margins[self.i] for s in (self.before[-1], self.behind[0]))
            enough = max(r.tolerance, BLIND * (r.t1 - r.t0)) if blind else r.tolerance
            if r.end == (hi if r.behind else lo) and (hi - lo <= enough or self._neighbours):
                return True
            if r.end == hi and self._stands:
                return True
        # fault: an event met within round-off is not told -> if False: | coupler/test_events
        if r.end == lo and self._at_round_off:
            return True
        found = self.ahead()
        if found is None:
            return False
        if r.behind and self.behind and r.end == self.behind[0].t:
            past = r.end - found.t
            return bool(r.near and past <= r.near) or (found.doubt <= r.tolerance and abs(past) <= r.tolerance)
        if not r.behind and r.end == lo:
            return found.doubt <= r.tolerance and found.t - lo <= r.tolerance
        return False

    def ahead(self) -> Root | None:
        """Where what is left of the status runs out; of several quantities the first.

        From all ends known before it, or from those tried in this window alone where that is surer: where a half rings
        from window to window the former lie on no one curve.
        """
        found = []
        for j in range(min((len(s.margins[self.i]) for s in self.before), default=0)):
            all_ = [(s.t, s.margins[self.i][j]) for s in self.before]
            own = [p for p in all_ if p[0] > self.reach.t0]
            known = [c for c in (_root(all_), _root(own)) if c is not None]
            found += [min(known, key=lambda c: c.doubt)] if known else []
        return min(found, key=lambda c: c.t) if found else None

    def nears(self, longer: float) -> bool:
        """Whether the event is known to lie behind the last end before it, at most so much [s] later."""
        if self.behind:
            return True
        found = self.ahead()
        return found is not None and found.t - self.before[-1].t <= longer

    def next_end(self) -> float:
        """The time the next try is to end [s]."""
        r, lo = self.reach, self.before[-1].t
        # fault: an event is located by halving alone -> found = None | coupler/test_events
        found = self.ahead() or self._back()
        hi = self.behind[0].t if self.behind else float("inf")
        if found is None or (self.behind and len(self.tried) % HALVE == 0):
            assert self.behind, "without a try behind the event only what nears is searched for"
            return min(max(0.5 * (lo + hi), r.t0 + r.least), hi)
        half = 0.5 * r.tolerance
        # While it is in doubt one more end before it, so near that the next is beside it; else on the side wanted.
        if found.doubt > half:
            end = found.t - 2.0 * found.doubt
            end = end if end > lo + half else found.t + found.doubt
        else:
            end = found.t + (half if r.behind else -half)
        if not lo + 0.25 * r.tolerance < end < hi - 0.25 * r.tolerance:
            end = 0.5 * (lo + min(hi, found.t if found.t > lo else hi))
        return min(max(end, r.t0 + r.least), hi)

    def _back(self) -> Root | None:
        """Where the new status began, from what was left of it at two tries or more."""
        late = self.behind[::-1]
        if len(late) < 2 or not all(s.margins[self.i] for s in late):
            return None
        c = root([-s.t for s in late], [s.margins[self.i][0] for s in late])
        return None if c is None else Root(-c.t, c.doubt)

    @property
    def _status(self) -> object:
        return self.trail[-1].status[self.i]

    @property
    def _stands(self) -> bool:
        """Whether the end of the window does not matter, because mechanics sees only the T of its start."""
        late = [s.margins[self.i] for s in self.behind[:2]]
        return self.reach.holds and len(late) == 2 and late[0] == late[1] != ()

    @property
    def _at_round_off(self) -> bool:
        """Whether nothing was left at the end of this try, where something was at the start of the window: it is here,
        on either side of the event as far as numbers tell."""
        return any(v <= 0.0 for v in self.before[-1].margins[self.i]) and all(
            v > 0.0 for v in self.trail[-1].margins[self.i])

    @property
    def _neighbours(self) -> bool:
        """Whether no tick is left between the ends on either side."""
        clock = self.reach.span.clock
        return clock.ticks(self.behind[0].t) - clock.ticks(self.before[-1].t) <= 1


def _root(points: list[tuple[float, float]]) -> Root | None:
    return root([t for t, _ in points], [v for _, v in points]) if len(points) > 1 else None


# An event is located to this share of its window where the scenario does not say: of what the most exact scheme leaves
# over in a window as a whole, 1e-3 of its change and less, nothing is lost, and copies of a scene agree to 1e-6.
TOLERANCE = 1e-6
# A window is not cut shorter than this share of itself: what happens sooner belongs to where it began.
LEAST = 1e-4
# An event so near to a kink (shares of a window) is the kink's: halves restart there, and a user put it there.
NEAR = 0.02
# A first try of which more than this share is in doubt would be lost as often as not: the whole window is solved.
TRUST = 0.2
# After a try that ends a little before its event the next one is at most so much longer.
LONGER = 0.25
# Two reckonings of where a try was to end, before it and after it, agree to this share of the window.
CLOSE = 1e-3
# What has turned back so often in the window after it turned flutters: it is no longer looked for until it has stayed
# as it is for so many windows.
FLUTTERS, STAYS = 3, 10
# Halving needs 20 tries for 1e-6.
MAX_TRIES = 40
# Where a half cannot solve a try the next one is so many times as long.
PAST = 10.0


@dataclass(frozen=True)
class Memory:
    """What is remembered from window to window, and from try to try while an event is being located.

    trail : at the ends of windows since the last kink or event, newest last, itself the first.  rates : how fast what
    was left fell before that [unit/s].  tried : at the ends tried since the last of the trail.
    turned : when each status changed last [s]; -1: never.  aim : the tick at which a try was asked to end; 0: none.
    due : which are to change at once in this window; coming : in the one after this try.
    flutters : how often each turned back in the window after it turned; stayed : for how many windows it did not turn.
    refused [s]: the end of the last try that a half could not solve, in this search; -1: none.
    """

    trail: tuple[ContactStatus, ...] = ()
    rates: tuple[tuple[float, ...], ...] = ()
    tried: tuple[ContactStatus, ...] = ()
    turned: tuple[float, ...] = ()
    aim: int = 0
    due: tuple[int, ...] = ()
    coming: tuple[int, ...] = ()
    flutters: tuple[int, ...] = ()
    stayed: tuple[int, ...] = ()
    refused: float = -1.0

    def looked_for(self, i: int, t0: float) -> bool:
        """Whether a change of status i is located in a window that begins at t0 [s]."""
        # fault: a flutter is located every time -> return True | coupler/test_events
        return self.turned[i] != t0 and i not in self.due and self.flutters[i] < FLUTTERS


@dataclass(frozen=True)
class Found:
    """tick : where the window is to end.  located : it does so already.  text : what happens there, in words."""

    tick: int
    located: bool
    text: str


@dataclass(frozen=True)
class Seen:
    """What rules look at: monitors at the end of a window that was solved; memory : of the rules, before it."""

    monitors: Mapping[str, float]
    memory: rules.Memory = field(default_factory=rules.Memory)


def met(memory: Memory, start: Level, solved: Solved, span: Span, plan: Plan,
        seen: Seen) -> tuple[Found | None, Memory]:
    """Whether an event lies in a window that was solved.

    solved.state.now : the level at its end; solved.monitors : touching, mechanical.contact.slipping.
    Of the two outcomes: None, the window may be taken; located, it may be taken and ends at an event; else both halves
    are put back and the next try ends at `tick`.  The memory is kept whatever is done with the window.
    """
    before = _at(memory, start, plan, seen.memory)
    contact = plan.status(solved.state.now, solved.monitors, seen.monitors, seen.memory)
    memory = replace(before, tried=(*before.tried, contact), aim=0, coming=())
    flipped = changed(memory.trail[-1], contact)
    reach = _reach(before, span, plan, solved.scheme)
    if not flipped:
        return _before(before, memory, reach, plan)
    # What turns back in the first window after it turned is a flutter of the window's size: not cut, only told.
    fresh = [i for i in flipped if memory.looked_for(i, reach.t0) and not _of_the_kink(memory, i, reach)]
    if not fresh:
        back = any(memory.turned[i] == reach.t0 for i in flipped)
        turned = back or any(memory.flutters[i] >= FLUTTERS for i in flipped)
        text = f"{_told(contact.status, flipped, plan)} again{' within one window' if back else ', and flutters'}"
        return (Found(span.k1, True, text) if turned else None), memory
    text = _told(contact.status, fresh, plan)
    searches = [s for s in (_search(i, memory, reach) for i in fresh) if not s.done]
    if not searches or len(memory.tried) >= MAX_TRIES:
        return Found(span.k1, True, text), memory
    return _again(min(s.next_end() for s in searches), memory, reach, text)


def refused(memory: Memory, span: Span) -> tuple[int, Memory] | None:
    """The tick at which to end the next try where a half could not solve one that was to end beside an event.

    What a load brings about however small it is happens where that begins: a body that falls as soon as it has weight
    is on its support at any time after.  Nearer and nearer to there what holds it is lost in rounding.  None: no end
    behind the event is known that a half could solve.
    """
    behind = [s.t for s in memory.tried if memory.trail and changed(memory.trail[-1], s)]
    if not behind or memory.aim != span.k1:
        return None
    t0 = span.clock.seconds(span.k0)
    # fault: a search goes on towards where a half cannot solve -> past = 1.0 | coupler/test_events
    past = PAST
    tick = _inside(min(t0 + past * (span.end - t0), *behind), span)
    return tick, replace(memory, aim=tick, refused=span.end)


def expected(memory: Memory, state: CoupledState, span: Span, plan: Plan, scheme: Scheme) -> int | None:
    """Where an event is expected inside a window that is about to be solved: the tick at which to end it.

    scheme : by which it is to be solved; `auto`: not known yet.
    """
    if not memory.trail or memory.trail[-1].t != state.now.t:
        return None
    end = _aim(memory, _reach(memory, span, plan, scheme))
    return None if end is None else _inside(end, span)


def settled(memory: Memory, start: Level, solved: Solved) -> Memory:
    """The memory after a window was taken."""
    contact = next((s for s in memory.tried if s.t == solved.state.now.t), None)
    if contact is None or not memory.trail:
        return Memory()
    flipped, n = changed(memory.trail[-1], contact), range(len(memory.turned))
    back = [i for i in flipped if memory.turned[i] == start.t]
    turned = tuple(contact.t if i in flipped else memory.turned[i] for i in n)
    stayed = tuple(0 if i in flipped else memory.stayed[i] + 1 for i in n)
    flutters = tuple(0 if stayed[i] >= STAYS else memory.flutters[i] + (i in back) for i in n)
    return Memory((*memory.trail, contact)[-MOST:], memory.rates, (), turned, due=memory.coming, flutters=flutters,
                  stayed=stayed)


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event: of the way there only the rates are left."""
    rates: tuple[tuple[float, ...], ...] = ()
    if len(memory.trail) > 1:
        a, b = memory.trail[-2:]
        rates = tuple(tuple((u - v) / (b.t - a.t) for u, v in zip(a.margins[i], b.margins[i], strict=False))
                      if a.status[i] is b.status[i] else () for i in range(len(b.status)))
    return replace(memory, trail=memory.trail[-1:], rates=rates, refused=-1.0)


def _at(memory: Memory, start: Level, plan: Plan, of_rules: rules.Memory) -> Memory:
    """The memory with the start of the window at the end of its trail."""
    if memory.trail and memory.trail[-1].t == start.t:
        return memory
    first = plan.status(start, {}, of_rules.last, of_rules)
    n = len(first.status)
    return Memory((first,), turned=(-1.0,) * n, flutters=(0,) * n, stayed=(0,) * n)


def _reach(memory: Memory, span: Span, plan: Plan, scheme: Scheme) -> Reach:
    t0 = span.clock.seconds(span.k0)
    t1 = max([span.end, *(s.t for s in memory.tried)])
    tolerance = plan.locate.tolerance or TOLERANCE * (t1 - t0)
    near = NEAR * (t1 - t0) if span.k1 in plan.schedule.kinks else 0.0
    least = max(LEAST * (t1 - t0), tolerance, PAST * (memory.refused - t0) if memory.refused > t0 else 0.0)
    return Reach(span, plan.must_end(span.k0), t0, t1, tolerance, least, near,
                 schemes_under(scheme))


def _aim(memory: Memory, reach: Reach) -> float | None:
    """The time a first try should end [s]: a little before the next event where that lies inside; None: anywhere."""
    ends = []
    for i in range(len(memory.turned)):
        search = _search(i, memory, reach)
        found = search.ahead()
        if found is None or not memory.looked_for(i, reach.t0) or found.doubt > TRUST * (found.t - reach.t0):
            continue
        # So near to a kink, or to the start, there is nothing to cut.
        if found.t - reach.t0 <= reach.least or found.t >= reach.t1 - reach.near:
            continue
        half = 0.5 * reach.tolerance
        end = found.t + half if search.reach.behind and found.doubt <= half else found.t - max(2.0 * found.doubt, half)
        ends.append(max(end, reach.t0 + reach.least))
    return min(ends) if ends and min(ends) < reach.t1 else None


def _before(before: Memory, memory: Memory, reach: Reach, plan: Plan) -> tuple[Found | None, Memory]:
    """After a try in which nothing changed: whether it was to end at or before an event, and has to be longer.

    One that was made short for another reason is taken.
    """
    if reach.span.k1 >= reach.must_end:
        return None, memory
    if before.aim != reach.span.k1:
        aim = _aim(before, replace(reach, t1=math.inf))
        if aim is None or abs(aim - reach.end) > CLOSE * (reach.end - reach.t0):
            return None, memory
    searches = [_search(i, memory, reach) for i in range(len(memory.turned)) if memory.looked_for(i, reach.t0)]
    due = [s.i for s in searches if s.done]
    if due:
        text = _told([NEXT[s] for s in memory.trail[-1].status], due, plan)
        return Found(reach.span.k1, True, text), replace(memory, coming=tuple(due))
    ends = [s.next_end() for s in searches if s.nears(LONGER * (reach.end - reach.t0))]
    if not ends or len(memory.tried) >= MAX_TRIES:
        return None, memory
    return _again(min(ends), memory, reach, "just before an event")


def _search(i: int, memory: Memory, reach: Reach) -> Search:
    return Search(i, memory.trail, memory.tried, reach.of(memory.trail[-1].status[i]))


def _again(end: float, memory: Memory, reach: Reach, text: str) -> tuple[Found, Memory]:
    tick = min(_inside(end, reach.span), reach.must_end)
    return Found(tick, False, text), replace(memory, aim=tick)


def _inside(end: float, span: Span) -> int:
    """The tick of a time, after the start of the window."""
    return max(span.clock.ticks(end), span.k0 + 1)


def _of_the_kink(memory: Memory, i: int, reach: Reach) -> bool:
    """Whether a status changed where its window began: nothing was left of it, or would have been a little later.

    A little later: at a kink, as fast as it went before.  Friction tells nothing; what drives it changes at kinks.
    """
    # What a rule waits for has no kink of its own: nobody put it there.
    if memory.trail[-1].status[i] in OF_RULES:
        return False
    left = memory.trail[-1].margins[i]
    if any(v <= 0.0 for v in left):
        return True
    if len(memory.trail) > 1 or not memory.rates:
        return False
    if not left:
        return i == len(memory.turned) - 1
    # fault: what touches at a kink is looked for again -> return False and any(v <= rate * NEAR * (reach.t1 - reach.t0)
    #   for v, rate in zip(left, memory.rates[i], strict=False) | coupler/test_events
    return any(v <= rate * NEAR * (reach.t1 - reach.t0) for v, rate in zip(left, memory.rates[i], strict=False)
               if rate > 0.0)


WORDS = {ContactState.OPEN: "opens", ContactState.CLOSED: "closes", ContactState.STICKS: "sticks",
         ContactState.SLIPS: "slips", ContactState.SLIPS_IN_PART: "slips in part",
         ContactState.TURNS: "turns round",
         ContactState.BELOW: "is passed downwards", ContactState.ABOVE: "is passed upwards",
         ContactState.WAITS: "waits", ContactState.ACTS: "acts",
         ContactState.APART: "changes as its surfaces part or meet"}


NEXT = {ContactState.OPEN: ContactState.CLOSED, ContactState.CLOSED: ContactState.OPEN,
        ContactState.STICKS: ContactState.SLIPS_IN_PART, ContactState.SLIPS: ContactState.STICKS,
        ContactState.SLIPS_IN_PART: ContactState.SLIPS, ContactState.TURNS: ContactState.STICKS,
        ContactState.BELOW: ContactState.ABOVE, ContactState.ABOVE: ContactState.BELOW,
        ContactState.WAITS: ContactState.ACTS, ContactState.ACTS: ContactState.WAITS,
        ContactState.APART: ContactState.APART}


def _told(status: Sequence[ContactState], which: Sequence[int], plan: Plan) -> str:
    """What changes, in words.  status : the new one of each."""
    names = plan.names
    return " and ".join(f"{names[i]} {WORDS[status[i]]}" for i in which)
