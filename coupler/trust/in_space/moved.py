"""How far each probe of gaps, displacements, pressures and forces is off because cells are too large for the heat.

Bodies expand by their temperatures, and what a mesh leaves out of those it leaves out of gaps.  So mechanics are asked
what they would make of the temperatures of halved cells (coupler.control.warmed), and a probe is off by what it would
tell otherwise.  When to look is as for probes of heat (probed.py), with fewer looks, for each takes one or two
solves of mechanics.

What the cells of mechanics put a probe off by is not in it: that is told by the rows on stress and pressure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.in_space import probed
from coupler.trust.in_space.probed import ProbedLog, Rhythm

NAME = "cells fine enough for gaps and displacements"
# A look takes as much as half a window, or more than one.
RHYTHM = Rhythm(at_first=2.0, over_the_run=4.0, earned=0.01, given_back=3)


@dataclass(frozen=True)
class MovedLog:
    """probed : what was seen of the probes, and when.  solves : of the mechanical half, for looks.

    looks : so many there were, of which `failed` told nothing, the last for the reason `why`.
    why_not : why there are none at all.
    """

    probed: ProbedLog = field(default_factory=ProbedLog)
    solves: int = 0
    looks: int = 0
    failed: int = 0
    why: str = ""
    why_not: str = ""


def begun(values: Mapping[str, float], n: int) -> MovedLog:
    """Return the log at the start.  values : of the probes.  n : nodes of the mesh."""
    return MovedLog(probed.begun(values, n, RHYTHM))


def after(log: MovedLog, values: Mapping[str, float], t: float, end: float) -> tuple[MovedLog, Mapping[str, float]]:
    """Return the log after a window to t [s], and how fast probes move in it, as probed.after does."""
    now, speeds = probed.after(log.probed, values, t, end, RHYTHM)
    return replace(log, probed=now), speeds


def looked(log: MovedLog, speeds: Mapping[str, float], off: Mapping[str, float], times: int, solves: int, why: str = ""
           ) -> MovedLog:
    """Return the log after a look.  off : probe -> by how much it is off, where it is known.

    times : so often the window was solved, with so many solves.  why : nothing was told, else empty.
    """
    # fault: a look that failed is forgotten -> failed = 0 | coupler/test_trust_moved
    failed = int(bool(why))
    return replace(log, probed=probed.looked(log.probed, speeds, off, max(times, 1)), solves=log.solves + solves,
                   looks=log.looks + 1, failed=log.failed + failed, why=why or log.why)


def kinked(log: MovedLog) -> MovedLog:
    """Return the log at a kink of the data."""
    return replace(log, probed=probed.kinked(log.probed))


def checks(log: MovedLog, units: Mapping[str, str], slight: Mapping[str, float]) -> tuple[Check, ...]:
    """Return the check at the end, none where nothing is known.

    units : of the probes.  slight : unit -> an error that harms nobody, and is not noted [SI].
    """
    found = probed.checks(log.probed, units, slight, NAME)
    if not found:
        why = log.why_not or (f"no look told anything: {log.why}" if log.failed else "")
        return (Check(NAME, TrustVerdict.UNCHECKED, what=why),) if why else ()
    if not log.failed:
        return found
    untold = f"{log.failed} of {log.looks} looks told nothing, the last because {log.why}"
    return tuple(replace(check, what=f"{check.what}; {untold}" if check.what else untold) for check in found)
