"""How far each probe of a displacement is off because cells are too large for what deforms.

A mechanical half may tell how much farther its nodes would be on a finer mesh (mesh.u_off: displaced.py of ours).  A
probe is off by what it would tell otherwise with that.  It is read with what is told of the equilibrium
(laws/equilibrium.py), at the start, about a dozen times, and at the end; it costs as much.

Errors are held against the range of the probe over the run, the drawing included (what a fit moves is there from the
start, and stays), but no less than LITTLE of the farthest that a node of its body went: where little moves, next to
nothing is much of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.half import Block
from coupler.scenario.probes import Probe
from coupler.schemes.levels import Level
from coupler.schemes.state import PLACES_OFF
from coupler.trust.checks import Check, TrustVerdict, amount, measured

Floats = NDArray[np.float64]

NAME = "cells fine enough for displacements"
LIMITS = (0.05, 0.2)  # of the range of a probe: noted, broken
LITTLE = 0.1  # of how far its body went
COMPONENTS = {"u_x": 0, "u_y": 1}


@dataclass(frozen=True)
class Seen:
    """What looks saw of a probe [m].  low, high : of what it told, and 0.  off : the largest; it then told
    `told`, at t [s].

    farthest : that a node of its body went.  looks : at which it was known how far.
    """

    # fault: what stays as it began is held against nothing -> low: float = math.inf | coupler/test_trust_displaced
    low: float = 0.0
    high: float = 0.0
    off: float = 0.0
    told: float = 0.0
    t: float = 0.0
    farthest: float = 0.0
    looks: int = 0


@dataclass(frozen=True)
class DisplacedLog:
    """of : probe -> what was seen.  looks : so many there were."""

    of: Mapping[str, Seen] = field(default_factory=dict)
    looks: int = 0


class Displaced:
    """Tells how far probes of displacements are off.  It remembers what follows from the scene alone."""

    def __init__(self, interface: Interface, probes: Mapping[str, Probe]) -> None:
        """probes : of the scenario, by name."""
        self._interface = interface
        self._probes = {n: p for n, p in probes.items() if p.quantity in COMPONENTS}
        body = interface.node_body
        self._of_body = {n: np.isin(body, body[p.nodes]) for n, p in self._probes.items()}

    def outputs(self, blocks: Mapping[str, Block]) -> list[str]:
        """Return the outputs that are wanted at a look; none where nothing is probed.  blocks : of mechanics."""
        # A half on a mesh of its own has other nodes.
        told = blocks.get(PLACES_OFF)
        return [PLACES_OFF] if self._probes and told is not None and told.shape == self._interface.nodes.shape else []

    def watched(self, log: DisplacedLog, du: Floats, now: Level) -> DisplacedLog:
        """Return the log after a look.  du : (n_nodes, 2) [m] as told, nan where it is not known."""
        u, of = now.x - self._interface.nodes, dict(log.of)
        for name, probe in self._probes.items():
            k, seen = COMPONENTS[probe.quantity], of.get(name, Seen())
            told, finer = float(probe.of(u[:, k])), float(probe.of(u[:, k] + du[:, k]))
            far = float(np.hypot(*u[self._of_body[name]].T).max())
            seen = replace(seen, low=min(seen.low, told), high=max(seen.high, told), farthest=max(seen.farthest, far))
            if math.isfinite(finer):
                seen = replace(seen, looks=seen.looks + 1)
                # fault: what the mesh does to a displacement is forgotten -> if False: | coupler/test_trust_displaced
                if abs(finer - told) > abs(seen.off):
                    seen = replace(seen, off=finer - told, told=told, t=now.t)
            of[name] = seen
        return DisplacedLog(of, log.looks + 1)


def off_of(log: DisplacedLog) -> dict[str, float]:
    """Return probe -> how far it may be off [m], where that is known."""
    return {name: abs(seen.off) for name, seen in log.of.items() if seen.looks}


def checks(log: DisplacedLog, ranges: Mapping[str, float], nothing: float) -> tuple[Check, ...]:
    """Return the check at the end, none where no displacement is probed.

    ranges : of probes over the run, as far as they are known [m].  nothing : what harms nobody [m].
    """
    if not log.of:
        return ()
    known = {n: seen for n, seen in log.of.items() if seen.looks}
    if not known:
        return (Check(NAME, TrustVerdict.UNCHECKED,
                      what="at each look surfaces slipped with friction, the bodies were in no equilibrium that lasts, "
                           "or are a single row of quads, of which nothing tells how stiff it is: use two rows or "
                           "more, or mechanical.elastic.element: enhanced"),)
    # fault: where little moves next to nothing is much -> little = 0.0 | coupler/test_trust_displaced
    little = LITTLE
    wide = {n: max(s.high - s.low, ranges.get(n, 0.0), little * s.farthest, np.finfo(float).tiny)
            for n, s in known.items()}
    # fault: a displacement that is 0 by symmetry is off by what rounding leaves -> harms = {n: True for n in known} |
    #   coupler/test_trust_displaced
    harms = {n: abs(s.off) > nothing for n, s in known.items()}
    shares = {n: abs(s.off) / wide[n] * harms[n] for n, s in known.items()}
    worst = max(shares, key=lambda n: shares[n])
    seen, share = known[worst], shares[worst]
    others = [f"{n} by {100.0 * shares[n]:.3g} %" for n in sorted(shares, key=lambda n: -shares[n])[1:4]
              if shares[n] > LIMITS[0]]
    of = "its range" if wide[worst] > LITTLE * seen.farthest else "a tenth of how far its body went"
    return (measured(
        NAME, share, LIMITS, t=seen.t,
        what=f"probe {worst} tells {amount(seen.told, 'm')} at t = {seen.t:.6g} s, and the mesh puts it off by about "
             f"{amount(abs(seen.off), 'm')}, {100.0 * share:.3g} % of {of}: with smaller cells it would be about "
             f"{amount(seen.told + seen.off, 'm')}" + (f"; {', '.join(others)}" if others else ""),
        remedy=f"Use {max(2, math.ceil(math.sqrt(share / LIMITS[0])))} times as many cells along each edge of the body "
               "that deforms, or mechanical.elastic.element: enhanced where it bends"),)
