"""How far each probe of a temperature is off because cells are too large for a front at which something melts.

A front of melting or freezing goes from node to node, so temperatures beside it go in steps, by up to half of what they
differ by across a cell.  A half that tells by how much each of its nodes is off at the end of a window (output
mesh.T_front_off [K]) is asked in every window: the steps are over when the front has passed.  A probe is off by what it
would tell otherwise of temperatures that these numbers are added to.  The largest counts, over the range of the probe
over the run.  What nobody probes is not told: beside a front that has just come in cells are always too large.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.half import Block
from coupler.scenario.probes import Probe
from coupler.schemes.state import FRONT_OFF
from coupler.trust.checks import Check, amount, measured

Floats = NDArray[np.float64]

LIMITS = (0.05, 0.2)  # of the range of a probe: noted, broken
NAME = "cells fine enough where something melts"


def front_outputs(blocks: Mapping[str, Block], interface: Interface, own_meshes: Collection[str]) -> list[str]:
    """Return the output of a thermal half that tells of fronts, if it has it and no mesh of its own."""
    there = FRONT_OFF in blocks and blocks[FRONT_OFF].shape == (len(interface.nodes),)
    return [FRONT_OFF] if there and "thermal" not in own_meshes else []


@dataclass(frozen=True)
class Off:
    """How far a probe was off at most, by [K] at t [s], and the least and the largest that it told [K]."""

    by: float = 0.0
    t: float = 0.0
    low: float = math.inf
    high: float = -math.inf


@dataclass(frozen=True)
class FrontLog:
    """of : probe -> what was seen of it."""

    of: Mapping[str, Off] = field(default_factory=dict)


def watched(log: FrontLog, probes: Mapping[str, Probe], T: Floats, off: Floats | None, t: float) -> FrontLog:
    """Return the log after a look at t [s].

    probes : of the scenario, by name.  T : (n,) [K].  off : (n,) [K] what has to be added to that, nan where it is not
    known; None: nothing is told yet.
    """
    found = {}
    for name, probe in probes.items():
        if probe.quantity != "T":
            continue
        before, value = log.of.get(name, Off()), probe.of(T)
        by = 0.0 if off is None else abs(probe.of(T + off) - value)
        low, high = min(before.low, value), max(before.high, value)
        # fault: what a front did to a probe is forgotten -> more = True | coupler/test_trust_fronts
        more = by > before.by
        found[name] = Off(by, t, low, high) if more else Off(before.by, before.t, low, high)
    return FrontLog(found)


def off_of(log: FrontLog) -> dict[str, float]:
    """Return probe -> how far it may be off [K]."""
    return {name: one.by for name, one in log.of.items()}


def checks(log: FrontLog, slight: float = 0.0) -> tuple[Check, ...]:
    """Return the check at the end, none where nothing melts or no temperature is probed.

    slight [K]: an error that harms nobody, and is not noted.
    """
    if not log.of:
        return ()

    def share(one: Off) -> float:
        # fault: a probe that a front passes is trusted -> return 0.0 | coupler/test_trust_fronts
        return one.by / max(one.high - one.low, one.by, slight / LIMITS[0]) if one.by > 0.0 else 0.0

    worst, one = max(log.of.items(), key=lambda row: share(row[1]))
    more = max(2, math.ceil(share(one) / LIMITS[0]))
    return (measured(
        NAME, share(one), LIMITS, t=one.t,
        what=f"probe {worst} may be off by {amount(one.by, 'K')}, {100 * share(one):.3g} % of its range, because cells "
             f"are too large for the front that melts or freezes near it at t = {one.t:.6g} s: temperatures beside it "
             "go in steps from node to node",
        remedy=f"Use {more} times as many cells along each edge there, or take a mean over some of the probe's steps"),)
