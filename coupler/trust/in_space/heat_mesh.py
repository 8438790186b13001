"""How far a mesh is from one that resolves the heat flowing into its bodies and through them.

A half that knows its mesh estimates, body by body, the temperature difference that cells too large leave out of those
that drive heat (outputs mesh.T_missed.BODY [K], a mean over all heat moved so far).  Divided by the span of
temperatures it is about the relative error of that heat or, where the heat is given, of the temperatures that it makes.
What was told last counts: an early error is made good by later heat.  Heat that goes from one body to another needs the
differences of both, so what they miss is added.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from coupler.schemes.state import T_MISSED
from coupler.trust.checks import Check, amount, measured

LIMITS = (0.05, 0.2)  # of the span of temperatures: noted, broken
NAME = "cells fine enough for heat"


def heat_mesh_outputs(blocks: Iterable[str]) -> list[str]:
    """Return the outputs of a half that tell of its mesh.  blocks : names of all it has."""
    return sorted(n for n in blocks if n.startswith(T_MISSED))


@dataclass(frozen=True)
class HeatMeshLog:
    """T_missed : body -> as told last [K], at t [s]."""

    T_missed: Mapping[str, float] = field(default_factory=dict)
    t: float = 0.0


def watched(log: HeatMeshLog, told: Mapping[str, float], t: float) -> HeatMeshLog:
    """Return the log after a look at t [s].  told : outputs by name [K]."""
    return HeatMeshLog({name.removeprefix(T_MISSED): value for name, value in told.items()}, t) if told else log


def checks(log: HeatMeshLog, span: float, meeting: Iterable[tuple[str, str]], slight: float = 0.0
           ) -> tuple[Check, ...]:
    """Return the check at the end, none where no half told.

    span [K]: of all temperatures, those of the data too.  meeting : names of two bodies that exchange heat.
    slight [K]: an error that harms nobody, and is only noted.
    """
    if not log.T_missed:
        return ()
    # fault: of two bodies that exchange heat one alone counts -> both = () |
    #   coupler/test_trust_heat_mesh::test_what_bodies_that_meet_miss_is_added
    both = ({a, b} for a, b in meeting if a in log.T_missed and b in log.T_missed)
    found = [(sum(log.T_missed[b] for b in of), sorted(of)) for of in (*({b} for b in log.T_missed), *both)]
    off, worst = max(found, key=lambda one: one[0])
    # Bodies that rub a little warm by a billionth of a kelvin: nothing depends on a heat that moves so little, and a
    # span is no less than a share of the temperatures.
    # fault: heat that cells are too large for is trusted -> share = 0.0 |
    #   coupler/test_trust_heat_mesh::test_what_bodies_that_meet_miss_is_added
    share = off / max(span, off) if off > 0.0 else 0.0
    more = max(2, math.ceil(math.sqrt(share / LIMITS[0])))
    # fault: cells that miss what windows may err by break a run -> limits = LIMITS |
    #   coupler/test_trust_heat_mesh
    limits = (LIMITS[0], math.inf) if off <= slight else LIMITS
    return (measured(
        NAME, share, limits, t=log.t,
        what=f"the cells of {' and '.join(worst)} are too large for the heat: they miss about {amount(off, 'K')} of "
             f"the temperature differences that drive it, {100 * share:.3g} % of the span of temperatures up to "
             f"t = {log.t:.6g} s, and the heat, or the temperatures it makes, are off by about as much",
        remedy=f"Use {more} times as many cells along each edge there, or smaller cells where heat enters and leaves"),)
