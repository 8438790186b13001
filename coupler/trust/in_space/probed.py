"""How far each probe of temperatures, solid fractions and heat is off because cells are too large.

A half that can solve its scene with halved cells tells what those change of its outputs (mesh.halved.NAME).  A probe is
off by what it would tell otherwise with that.  A look costs as much as some steps, so a run takes it where most is to
be seen: one, two, four, ... windows after a breakpoint of the data, before the next one, at the end, and where a probe
moves faster than at any look before; in all in no more than a share of its windows.

The largest of all looks is told (Results.probe_errors), but for those in the first moment after one: a surface that
a shock has just met is off by a share of it on any mesh, with smaller cells at an earlier moment.  What is gone soon
breaks no run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Block
from coupler.fmu.outputs import component_of
from coupler.scenario.probes import Probe
from coupler.schemes.levels import Level
from coupler.schemes.state import HALVED
from coupler.trust.checks import Check, amount, measured
from coupler.trust.in_space.extremes import BRIEF

Floats = NDArray[np.float64]

LIMITS = (0.05, 0.2)  # of the range of a probe: noted, broken
NO_FLOORS: Mapping[str, float] = MappingProxyType({})
NAME = "cells fine enough for probes of heat"
FIELDS, MEAN_T = ("T", "f_s"), "T_mean"
ON_CREDIT = 2.0  # looks: how far below 0 it may go before a kink of the data and for probes that move fast
# What was looked at before all began was of little worth: where a probe has gone through so many times as much as at
# the last look, that one is given back.
WIDER = 2.0
# What a look costs: the factors of four times as many unknowns grow faster than what else a window takes.
OF_NODES, MOST = 1000.0, 3.0  # one for every so many nodes of the mesh, at least one
FASTER, VISIBLE = 1.5, 0.005  # than at any look before, times; in a window in which it moves by this share of its range
MOMENT = 0.001  # of the run, after a breakpoint: what is off then is so on any mesh


@dataclass(frozen=True)
class Rhythm:
    """How many looks there are: at first, evenly over the run, for each window, and how many are given back at most."""

    at_first: float
    over_the_run: float
    earned: float
    given_back: int


OFTEN = Rhythm(6.0, 12.0, 0.02, 8)


def lasting(times: Floats, off: Floats, brief: float) -> float:
    """By how much it is off for longer than brief [s], or at the last look.  times [s], off : (n,) of looks."""
    if not off.size:
        return 0.0
    after = np.append(np.maximum.accumulate(off[::-1])[::-1], 0.0)
    both = np.minimum(off, after[np.searchsorted(times, times + brief, side="right")])
    return float(max(both.max(), off[-1]))


@dataclass(frozen=True)
class Seen:
    """Of a probe: value, low, high : now, and so far.  fastest : at which it moved at a look, per s.

    wide : high - low at the last look; 0: there was none.
    off : (t [s], by how much it is off) of each look.
    """

    value: float
    low: float
    high: float
    fastest: float = 0.0
    wide: float = 0.0
    off: tuple[tuple[float, float], ...] = ()

    @property
    def most(self) -> float:
        """By how much it is off at most."""
        return max((by for _, by in self.off), default=0.0)

    def lasting(self, t: float) -> float:
        """By how much it is off for longer than t [s], or at the last look."""
        times, off = np.array(self.off, dtype=float).reshape(-1, 2).T
        return lasting(times, off, t)


@dataclass(frozen=True)
class ProbedLog:
    """of : probe -> what was seen of it.  credit : what looks may cost.  price : of one.

    kink [s]: of the data, the last.  since : windows behind its first moment.  next : of them, when to look.
    t [s]: now.  given_back : so many looks were.
    """

    of: Mapping[str, Seen] = field(default_factory=dict)
    credit: float = 0.0
    price: float = 1.0
    kink: float = 0.0
    since: int = 0
    next: int = 1
    t: float = 0.0
    given_back: int = 0


class Probed:
    """The probes of which halved cells tell something."""

    def __init__(self, probes: Mapping[str, Probe], blocks: Mapping[str, Block], node_body: NDArray[np.integer]
                 ) -> None:
        """probes : of the scenario.  blocks : of the thermal half.  node_body : (n,) of each node."""
        sizes = np.bincount(node_body[node_body >= 0])
        columns = {name.removeprefix(HALVED): max(int(np.prod(block.shape)), 1) for name, block in blocks.items()
                   if name.startswith(HALVED)}
        self._probes = probes
        self._found: dict[str, tuple[str, int]] = {}
        for name, probe in probes.items():
            if probe.quantity in FIELDS:
                whole = probe.reduction == "mean" and probe.nodes.size == sizes[node_body[probe.nodes[0]]]
                told = MEAN_T if whole and probe.quantity == "T" else probe.quantity
                self._found |= {name: (told, -1)} if told in columns else {}
            elif probe.half == "thermal" and probe.placeless and (of := component_of(probe.output, columns)):
                self._found[name] = of
        self.outputs = sorted({HALVED + output for output, _ in self._found.values()})
        self.read = sorted({output for output, column in self._found.values() if column >= 0})

    def values(self, now: Level, read: Mapping[str, Floats]) -> dict[str, float]:
        """Probe -> its value in SI.  read : the outputs of `self.read` now."""
        return {name: (self._probes[name].of(_field(now, output)) if column < 0 else
                       float(np.ravel(read[output])[column])) for name, (output, column) in self._found.items()}

    def off(self, now: Level, told: Mapping[str, Floats]) -> dict[str, float]:
        """Probe -> by how much it is off, in SI; those of which nothing is known are left out.  told : the outputs."""
        found = {}
        for name, (output, column) in self._found.items():
            change = told[HALVED + output]
            if column >= 0:
                found[name] = abs(float(np.ravel(change)[column]))
            else:
                at = _field(now, output)
                found[name] = abs(self._probes[name].of(at + change) - self._probes[name].of(at))
        return {name: by for name, by in found.items() if math.isfinite(by)}


def _field(now: Level, output: str) -> Floats:
    if output in ("T", MEAN_T):
        return now.T
    assert now.f_s is not None, "a half that tells of f_s gives it out"
    return now.f_s


def begun(values: Mapping[str, float], n: int = 0, rhythm: Rhythm = OFTEN) -> ProbedLog:
    """Return the log at the start.  values : of the probes.  n : nodes of the mesh."""
    # fault: looks at a large mesh are taken to be cheap -> price = 1.0 | coupler/test_trust_probed
    price = min(max(n / OF_NODES, 1.0), MOST)
    return ProbedLog({name: Seen(value, value, value) for name, value in values.items()}, rhythm.at_first, price)


def after(log: ProbedLog, values: Mapping[str, float], t: float, end: float, rhythm: Rhythm = OFTEN
          ) -> tuple[ProbedLog, Mapping[str, float]]:
    """Return the log after a window to t [s], and how fast probes move in it, per s.  end [s]: of the run.

    values : of the probes, of those that have one now.
    """
    h, seen = t - log.t, dict(log.of)
    for name, value in values.items():
        one = seen.get(name, Seen(value, value, value))
        seen[name] = replace(one, value=value, low=min(one.low, value), high=max(one.high, value))
    speeds = {name: abs(value - log.of[name].value) / h for name, value in values.items() if name in log.of and h > 0.0}
    # fault: looks are spent on the first moment of a shock -> began = True | coupler/test_trust_probed
    began = t - log.kink > MOMENT * end
    credit = log.credit + rhythm.earned + rhythm.over_the_run * h / end
    more = any(one.high - one.low > WIDER * one.wide > 0.0 for one in seen.values())
    # fault: looks at what came before are not given back -> wider = False | coupler/test_trust_probed
    wider = more and log.given_back < rhythm.given_back
    if wider:
        credit += log.price
        seen = {name: replace(one, wide=one.high - one.low if one.wide else 0.0) for name, one in seen.items()}
    return replace(log, of=seen, credit=credit, since=log.since + began, t=t,
                   given_back=log.given_back + wider), speeds


def due(log: ProbedLog, speeds: Mapping[str, float], h: float, *, kink: bool, at_end: bool) -> bool:
    """Whether to look after a window of h [s].  speeds : as `after` tells them.  kink : the data have one at its end.
    """
    if at_end or not log.of:
        return bool(log.of)
    if not log.since:
        return False
    # fault: what begins late is looked at no more than what goes on -> soon = False | coupler/test_trust_probed
    soon = log.since >= log.next
    fast = any(speed > FASTER * log.of[name].fastest and speed * h > VISIBLE * (log.of[name].high - log.of[name].low)
               for name, speed in speeds.items())
    # fault: where probes move fastest nobody looks -> return soon and log.credit >= log.price |
    #   coupler/test_trust_probed
    return (soon and log.credit >= log.price) or ((fast or kink) and log.credit >= log.price - ON_CREDIT)


def looked(log: ProbedLog, speeds: Mapping[str, float], off: Mapping[str, float], times: int = 1) -> ProbedLog:
    """Return the log after a look.  off : as Probed.off tells it, of those of which it is known.

    times : how many times its price it took.
    """
    seen = {name: replace(one, fastest=max(one.fastest, speeds.get(name, 0.0)), wide=one.high - one.low,
                          off=(*one.off, (log.t, off[name])) if name in off else one.off)
            for name, one in log.of.items()}
    return replace(log, of=seen, credit=log.credit - times * log.price, next=max(2 * log.since, 1))


def kinked(log: ProbedLog) -> ProbedLog:
    """Return the log at a kink of the data."""
    return replace(log, kink=log.t, since=0, next=1)


def off_of(log: ProbedLog) -> dict[str, float]:
    """Return probe -> how far it may be off, in SI."""
    return {name: one.most for name, one in log.of.items()}


def checks(log: ProbedLog, units: Mapping[str, str], slight: Mapping[str, float] = NO_FLOORS, name: str = NAME
           ) -> tuple[Check, ...]:
    """Return the check at the end, none where nothing is known.

    units : of the probes.  slight : unit -> an error that harms nobody, and is not noted [SI].  name : of the check.
    """
    known = {probe: one for probe, one in log.of.items() if one.off}
    if not known:
        return ()

    def share(probe: str, by: float) -> float:
        least = slight.get(units.get(probe, ""), 0.0) / LIMITS[0]
        # fault: a probe that cells are too large for is trusted -> return 0.0 | coupler/test_trust_probed
        return by / max(known[probe].high - known[probe].low, by, least) if by > 0.0 else 0.0

    lasting = {probe: share(probe, one.lasting(BRIEF * log.t)) for probe, one in known.items()}
    most = {probe: share(probe, one.most) for probe, one in known.items()}
    # fault: what is soon gone breaks a run -> breaks = max(most.values()) > LIMITS[1] | coupler/test_trust_probed
    breaks = max(lasting.values()) > LIMITS[1]
    of, limits = (lasting, LIMITS) if breaks else (most, (LIMITS[0], math.inf))
    worst = max(of, key=lambda probe: of[probe])
    one = known[worst]
    by = one.lasting(BRIEF * log.t) if breaks else one.most
    t = next(at for at, off in one.off if off >= by)
    more = max(2, math.ceil(math.sqrt(of[worst] / LIMITS[0])))
    return (measured(
        name, of[worst], limits, t=t,
        what=f"probe {worst} may be off by {amount(by, units.get(worst, '1'))}, {100 * of[worst]:.3g} % of its range, "
             f"because cells are too large at t = {t:.6g} s, as a solution with halved cells says",
        remedy=f"Use {more} times as many cells along each edge there, or smaller cells where heat enters and leaves"),)
