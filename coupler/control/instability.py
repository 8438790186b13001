"""What a run does where windows make more of a disturbance that turns round: other windows, another scheme, or an end.

The gain of a window (coupler.control.gain) tells what it would be in shorter windows, and by iterating.  Of what ends
the ringing the way of the fewest solves is taken: `n` windows in the place of one, or about so many iterates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.control.accept import Attempt, cut, tried_again
from coupler.control.gain import Gain, multiplier
from coupler.control.state import ControlState
from coupler.control.two_cycle import Watch
from coupler.errors import CouplingError
from coupler.scenario.options import OnUnstable, Scheme, Seen
from coupler.schemes.schemes import scheme_of
from coupler.trust.in_time.stability import GROWS, RINGS

# What m is brought to: by so much short of ringing, because the laws of one mode are not those of many.
AIM = -0.9 * RINGS
# A window that would have to be cut into more is not mended by that: iterating ends it at a tenth of the price.
MOST_PIECES = 64.0


@dataclass(frozen=True)
class Way:
    """One way out.  share : of the window that is stable by it.  solves : pairs of solver calls for the old window.

    level : of iterated windows; None: the scheme stays.
    """

    share: float
    solves: float
    level: Seen | None = None


def way_out(known: Gain, scheme: Scheme, level: Seen, on: OnUnstable) -> Way | None:
    """Return the cheapest way out of a window that rings; None where there is none.

    scheme, level : by which it was solved.
    """
    ways = []
    if on is not OnUnstable.ITERATE:
        ways.append(_way(known, iterates(known) if scheme is Scheme.ITERATED else 1.0))
    if on is not OnUnstable.CUT:
        iterated = scheme_of(Scheme.ITERATED)
        for seen in Seen if scheme is not Scheme.ITERATED else (Seen.END,) if level is Seen.MIDDLE else ():
            by_it = known.by(iterated.exchange_at(seen))
            ways.append(_way(by_it, iterates(by_it), seen))
    ways = [w for w in ways if w.share * MOST_PIECES >= 1.0]
    # fault: the dearest way out is taken -> return max(ways, key=lambda w: w.solves, default=None) |
    #   coupler/test_instability
    return min(ways, key=lambda w: w.solves, default=None)


def _way(known: Gain, pairs: float, level: Seen | None = None) -> Way:
    share = known.up_to(AIM)
    return Way(share, pairs * math.ceil(1.0 / share) if share > 0.0 else math.inf, level)


def iterates(known: Gain) -> float:
    """Return about how many iterates a window takes with acceleration: 3 where the exchange is weak, 8 at rho = 100."""
    return 3.0 + 2.5 * math.log10(1.0 + abs(known.rho))


def contraction(known: Gain, level: Seen) -> float:
    """Return what plain iteration multiplies a difference by.  level : of which time it gives x and t_N."""
    return abs((2.0 if level is Seen.END else 1.0) * (known.rho - known.rho_h) + known.rho_h)


def holds_up_to(known: Gain, level: Seen) -> float:
    """Return the contraction of iterated windows up to which the scheme they took the place of does not ring."""
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        less = replace(known, rho=middle * known.rho, rho_h=middle * known.rho_h)
        low, high = (middle, high) if multiplier(less) > AIM else (low, middle)
    return low * contraction(known, level)


def sentence(known: Gain) -> str:
    """What was measured, with its numbers."""
    grows = known.m <= -GROWS
    limit = known.limit
    until = (": no window is stable" if limit == 0.0 else
             f": windows up to about {limit:.3g} s are stable" if math.isfinite(limit) else "")
    what = "unstable exchange: a disturbance alternates and grows" if grows else (
        "ringing: a disturbance alternates and decays slowly")
    return f"{what}, by {known.m:.3g} from one window of {known.H:.3g} s to the next{until}"


@dataclass(frozen=True)
class Answer:
    """What is done.  text : in a sentence.  control : of the next try, where the window is put back; None: it stays."""

    text: str
    control: ControlState | None = None


def answer(attempt: Attempt, known: Gain) -> Answer | None:
    """Return what follows from the gain of a window that stands; None: nothing, it does not ring.

    Raises CouplingError where `coupling.on_unstable` says to stop.
    """
    on, control = attempt.plan.on_unstable, attempt.at.control
    if not known.rings:
        return None
    text = f"window {control.number + 1} (to t = {attempt.span.end:.6g} s): {sentence(known)}"
    if on is OnUnstable.STOP:
        raise CouplingError(f"{sentence(known)}; coupling.on_unstable says to stop", t=attempt.t,
                            window=control.number + 1,
                            remedy="Give windows below that limit (coupling.windows), scheme: iterated, or "
                                   "on_unstable: auto")
    settings = control.settings
    level, scheme = settings.iteration.level, attempt.solved.scheme
    way = None if on is OnUnstable.WARN else way_out(known, scheme, level, on)
    if way is None:
        return Answer(text)
    watch, done = control.cycle, []
    if way.level is not None:
        calm = holds_up_to(known, way.level)
        watch = replace(Watch(cap=watch.cap, halved=watch.halved), home=watch.home or settings.scheme.value,
                        home_level=watch.home_level or level.value, calm_at=calm)
        settings = replace(settings, scheme=Scheme.ITERATED, iteration=settings.iteration.changed(level=way.level))
        done.append("windows are iterated from here on" + (
            ", given x and t_N of their end" if way.level is Seen.END else ""))
    if way.share < 1.0:
        cap = settings.window_cap
        settings = replace(settings, window_cap=min(cap, attempt.H / math.ceil(1.0 / way.share) * (1.0 + 1e-9)))
        watch = replace(watch, cap=watch.cap if watch.halved else cap, halved=watch.halved + 1)
        done.append(f"no window is longer than {settings.window_cap:.3g} s up to the next breakpoint")
    text = f"{text}; {', and '.join(done)}"
    again = (cut(attempt, settings.window_cap / attempt.H, text) if way.share < 1.0 and control.ends
             else tried_again(attempt, replace(control, aim=0), text))
    return Answer(text, replace(again, cycle=watch, settings=settings))
