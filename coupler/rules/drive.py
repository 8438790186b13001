"""Driving a load so that a monitor holds a target: a guarded secant with the drift carried on.

With v = ln load and m = ln monitor (or the two themselves) a window tells dm = b dv + d: what the load did, and the
drift d of a part that thins or hardens meanwhile.  The next load is that for which b dv + d makes up what is missing,

    v' = v + g (m* - m - d),  d = dm - dv/g,  g = 1/b.

So a steady drift leaves no lag behind, as it would with a gain on m* - m alone.  With g b = kappa the differences from
the target obey e' = (2 - 2 kappa) e - (1 - kappa) e_before: at rest at once for kappa = 1, stable for 0 < kappa < 4/3.
Where no gain is given g is taken from successive windows, b = (second difference of m)/(second difference of v), held
in bounds and only where v moved.

All this takes it that m answers to v at once, as a strain rate does.  A temperature does not: its rate does.  With a
lag tau the quantity that is driven to m* is m + tau dm/dt, which does, and m follows with that time constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.scenario.rule_model import Drive

# A gain not known yet: stable up to a slope of 6.6, more than the exponent of most creep laws and gentle enough for
# all.
CAUTIOUS = 0.2
# Bounds of a measured gain (strain rate ~ load^n, n from 1 to 20), and how much of a new measurement is believed.
GAINS, BELIEVED = (0.05, 100.0), 0.5
# The share by which a load must have turned, against its change before, to tell a slope.
TURNED = 1e-3
# A gain that is too large is worse than one that is too small: it grows by this factor a window at most.
GROWTH = 1.5
# The largest change of ln load in one window; a load that is far too small (nothing moves yet) grows by this.
STRIDE = math.log(2.0)


@dataclass(frozen=True)
class Driven:
    """What a drive remembers.  value : the load now.

    m, v : what the monitor was with which (ln) load, of the two windows before the next, the newest first; H [s]
    theirs.
    gain : in use.  left : of the last window, m less the part that `lag` adds.
    """

    value: float
    gain: float
    left: float = 0.0
    m: tuple[float, ...] = ()
    v: tuple[float, ...] = ()
    H: tuple[float, ...] = ()


def begun(drive: Drive) -> Driven:
    """Before the first window."""
    return Driven(drive.first, CAUTIOUS if math.isnan(drive.gain) else drive.gain)


def driven(drive: Drive, known: Driven, measured: float, H: float) -> Driven:
    """After a window of H [s] with the load known.value in which the monitor was measured."""
    v = math.log(known.value) if drive.log else known.value
    # fault: drive: no limit of its rate -> limit = STRIDE if drive.log else math.inf | coupler/test_drive
    limit = min(drive.rate * H, STRIDE if drive.log else math.inf)
    # A monitor of the wrong sign has no logarithm: nothing moves yet, so the load goes up as fast as it may.
    if drive.log and measured * drive.target <= 0.0:
        return replace(known, value=_bounded(drive, v + limit), m=(), v=(), H=())
    left = math.log(measured / drive.target) if drive.log else measured - drive.target
    # fault: drive: lag ignored -> m = left + (0.0 * (left - known.left) / H if known.H else 0.0) | coupler/test_drive
    m = left + (drive.lag * (left - known.left) / H if known.H else 0.0)
    ms, vs, Hs = (m, *known.m), (v, *known.v), (H, *known.H)
    gain = _gain(drive, known.gain, ms, vs)
    # fault: drive: the drift is not carried on -> step = gain * -m | coupler/test_drive
    step = gain * (-m - _drift(gain, ms, vs, Hs))
    new = _bounded(drive, v + min(max(step, -limit), limit))
    return Driven(new, gain, left, ms[:2], vs[:2], Hs[:2])


def _drift(gain: float, m: tuple[float, ...], v: tuple[float, ...], H: tuple[float, ...]) -> float:
    """By how much the monitor will move in the next window without a change of load; 0 where only one is known."""
    if len(m) < 2:
        return 0.0
    # Monitors stand for the middles of their windows; the next window is taken to be as long as the last.
    return (m[0] - m[1] - (v[0] - v[1]) / gain) * 2.0 * H[0] / (H[0] + H[1])


def _gain(drive: Drive, gain: float, m: tuple[float, ...], v: tuple[float, ...]) -> float:
    """The gain in use: the given one, or a measured one where three windows tell it."""
    if not math.isnan(drive.gain) or len(m) < 3:
        return gain
    turn = (v[0] - v[1]) - (v[1] - v[2])
    slope = ((m[0] - m[1]) - (m[1] - m[2])) / turn if abs(turn) > TURNED * max(abs(v[0] - v[1]), TURNED) else math.nan
    # fault: drive: the gain is never measured -> if True: | coupler/test_drive
    if not slope > 0.0:  # nan too
        return gain
    return min(gain + BELIEVED * (min(max(1.0 / slope, GAINS[0]), GAINS[1]) - gain), GROWTH * gain)


def _bounded(drive: Drive, v: float) -> float:
    """The load of v, within its bounds."""
    return min(max(math.exp(v) if drive.log else v, drive.least), drive.most)
