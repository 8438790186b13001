"""The search for one event in one window: what is known on either side of it, and where the next try is to end."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from coupler.control.crossing import Crossing, crossing
from coupler.control.sights import Sight
from coupler.scenario.options import Scheme
from coupler.schemes.window import Span

# Every so many tries the interval is halved, however well the curve through the tries looks.
HALVE = 4
# Where nothing tells how near an event is (friction), halving alone costs a solve a factor of two: this share of the
# window is enough.
BLIND = 1.0 / 16.0


@dataclass(frozen=True)
class Reach:
    """Of a window.  must_end : the tick of the next kink.  t0, t1 : its start and its farthest end tried [s].

    tolerance, least [s]: how nearly an event is located, and how short a window may be.  near [s]: before a kink at its
    end what is the kink's own.  scheme : by which it is solved; auto: not known yet.
    """

    span: Span
    must_end: int
    t0: float
    t1: float
    tolerance: float
    least: float
    near: float
    scheme: Scheme | None

    @property
    def behind(self) -> bool:
        """Whether the window is to end just behind its event, or just before."""
        # fault: a window ends before its event whatever the scheme -> return False | coupler/test_events
        return self.scheme not in (Scheme.ITERATED, Scheme.AUTO)

    @property
    def holds(self) -> bool:
        """Whether mechanics sees the T of the start."""
        return self.scheme in (Scheme.MECHANICAL_FIRST, Scheme.PARALLEL)

    @property
    def end(self) -> float:
        """The end of this try [s]."""
        return self.span.end


@dataclass(frozen=True)
class Search:
    """Of status i.  trail : at the ends of windows, the last at the start of this one.  tried : at ends tried since."""

    i: int
    trail: tuple[Sight, ...]
    tried: tuple[Sight, ...]
    reach: Reach

    @cached_property
    def behind(self) -> list[Sight]:
        """Ends tried that lie behind the event, the nearest first."""
        return sorted((s for s in self.tried if s.status[self.i] is not self._status), key=lambda s: s.t)

    @cached_property
    def before(self) -> list[Sight]:
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
            blind = not any(s.left[self.i] for s in (self.before[-1], self.behind[0]))
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

    def ahead(self) -> Crossing | None:
        """Where what is left of the status runs out; of several quantities the first.

        From all ends known before it, or from those tried in this window alone where that is surer: where a half rings
        from window to window the former lie on no one curve.
        """
        found = []
        for j in range(min((len(s.left[self.i]) for s in self.before), default=0)):
            all_ = [(s.t, s.left[self.i][j]) for s in self.before]
            own = [p for p in all_ if p[0] > self.reach.t0]
            known = [c for c in (_crossing(all_), _crossing(own)) if c is not None]
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
            return max(0.5 * (lo + hi), r.t0 + r.least)
        half = 0.5 * r.tolerance
        # While it is in doubt one more end before it, so near that the next is beside it; else on the side wanted.
        if found.doubt > half:
            end = found.t - 2.0 * found.doubt
            end = end if end > lo + half else found.t + found.doubt
        else:
            end = found.t + (half if r.behind else -half)
        if not lo + 0.25 * r.tolerance < end < hi - 0.25 * r.tolerance:
            end = 0.5 * (lo + min(hi, found.t if found.t > lo else hi))
        return max(end, r.t0 + r.least)

    def _back(self) -> Crossing | None:
        """Where the new status began, from what was left of it at two tries or more."""
        late = self.behind[::-1]
        if len(late) < 2 or not all(s.left[self.i] for s in late):
            return None
        c = crossing([-s.t for s in late], [s.left[self.i][0] for s in late])
        return None if c is None else Crossing(-c.t, c.doubt)

    @property
    def _status(self) -> object:
        return self.trail[-1].status[self.i]

    @property
    def _stands(self) -> bool:
        """Whether the end of the window does not matter, because mechanics sees only the T of its start."""
        late = [s.left[self.i] for s in self.behind[:2]]
        return self.reach.holds and len(late) == 2 and late[0] == late[1] != ()

    @property
    def _at_round_off(self) -> bool:
        """Whether nothing was left at the end of this try, where something was at the start of the window: it is here,
        on either side of the event as far as numbers tell."""
        return any(v <= 0.0 for v in self.before[-1].left[self.i]) and all(
            v > 0.0 for v in self.trail[-1].left[self.i])

    @property
    def _neighbours(self) -> bool:
        """Whether no tick is left between the ends on either side."""
        clock = self.reach.span.clock
        return clock.ticks(self.behind[0].t) - clock.ticks(self.before[-1].t) <= 1


def _crossing(points: list[tuple[float, float]]) -> Crossing | None:
    return crossing([t for t, _ in points], [v for _, v in points]) if len(points) > 1 else None
