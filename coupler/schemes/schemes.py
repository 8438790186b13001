"""Schemes: in which order the halves go over a window, and what each sees of the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.scenario.options import Scheme
from coupler.schemes.account import EnergyAccount, delivered, with_made
from coupler.schemes.curve import drawn_on
from coupler.schemes.level import Level, Slope, exchanged
from coupler.schemes.sweep import STORED, Leading, Pass, Sent, mechanical_pass, thermal_pass
from coupler.schemes.window import NO_WORK, CoupledState, Course, Halves, Solved, Span, Verdict, Work

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Swept:
    """Both halves taken over a window once.  level : at its end.  accounts : after it."""

    level: Level
    accounts: Mapping[str, EnergyAccount]
    sent: Sent
    terms: tuple[Mapping[str, float], ...]
    work: Work
    monitors: Mapping[str, float]

    def solved(self, state: CoupledState, scheme: Scheme, course: Course | None = None, curve: float = 0.0) -> Solved:
        """The accepted window.  state : before it.  scheme, curve : by which it was solved."""
        past = (state.now, *state.past)[:3]
        new = CoupledState(self.level, past, state.events, self.accounts, self.sent, state.memory)
        return Solved(Verdict.ACCEPTED, "", new, self.terms, self.work, self.monitors, course, scheme=scheme,
                      curve=curve)


def thermal_first(halves: Halves, state: CoupledState, span: Span, slope: Slope | Leading | None) -> Swept:
    """Thermal, then mechanics with the new T.  Heat made in the window is due in the next."""
    thermal = thermal_pass(halves, state, span.times("thermal"), slope, NO_WORK)
    mechanical = mechanical_pass(halves, replace(state, sent=thermal.sent), span.times("mechanical"),
                                 thermal.outputs, thermal.work)
    accounts = with_made(delivered(state.accounts, halves.thermal.blocks), mechanical.made)
    return _swept(state, span, thermal, mechanical, (accounts, mechanical))


def extrapolated(halves: Halves, state: CoupledState, span: Span, curve: float) -> Swept:
    """Thermal first, x and t_N drawn on past the last levels.  curve : see curve.py; 0 is the straight line."""
    return thermal_first(halves, state, span, drawn_on(state.now, state.past, span.end, curve))


def parallel(halves: Halves, state: CoupledState, span: Span) -> Swept:
    """Both from the start of the window: x, t_N and T held.  Heat made in the window is due in the next."""
    thermal = thermal_pass(halves, state, span.times("thermal"), None, NO_WORK)
    mechanical = mechanical_pass(halves, replace(state, sent=thermal.sent), span.times("mechanical"),
                                 # fault: parallel mechanics given the new T -> thermal.outputs, thermal.work) |
                                 #   coupler/test_schemes
                                 exchanged(state.now), thermal.work)
    accounts = with_made(delivered(state.accounts, halves.thermal.blocks), mechanical.made)
    return _swept(state, span, thermal, mechanical, (accounts, mechanical))


def mechanical_first(halves: Halves, state: CoupledState, span: Span, end: Mapping[str, Array],
                     done: Work = NO_WORK, at_end: bool = False) -> Swept:
    """Mechanics with a T given at the end, then thermal on the way x and t_N went.  Heat is delivered at once.

    at_end : thermal substeps are given x and t_N of their end, not of their middle.
    """
    mechanical = mechanical_pass(halves, state, span.times("mechanical"), end, done)
    # fault: heat of the last iterate forgotten -> made = replace(state, sent=mechanical.sent, accounts=state.accounts)
    #   | coupler/test_iterated
    made = replace(state, sent=mechanical.sent, accounts=with_made(state.accounts, mechanical.made))
    # fault: an iterated window holds x and t_N as they were at its start -> slope = None |
    #   scenarios/test_casting_order::test_order_of_the_exchange_between_two_cells[Scheme.ITERATED-2.0-2.5e-13]
    slope = (state.now, _level(state.now, span, {}, mechanical.outputs))
    # fault: mechanics first, but thermal on the geometry of the start -> thermal = thermal_pass(halves, made,
    #   span.times("thermal"), None, mechanical.work, at_end) | coupler/test_schemes
    thermal = thermal_pass(halves, made, span.times("thermal"), slope, mechanical.work, at_end)
    return _swept(state, span, thermal, mechanical, (delivered(made.accounts, halves.thermal.blocks), thermal))


ONCE: Mapping[Scheme, Callable[[Halves, CoupledState, Span], Swept]] = {
    Scheme.STAGGERED: lambda halves, state, span: thermal_first(halves, state, span, None),
    Scheme.EXTRAPOLATED: lambda halves, state, span: extrapolated(halves, state, span, 0.0),
    Scheme.MECHANICAL_FIRST: lambda halves, state, span: mechanical_first(halves, state, span, exchanged(state.now)),
    Scheme.PARALLEL: parallel,
    Scheme.ADIABATIC: lambda halves, state, span: mechanical_first(halves, state, span, exchanged(state.now)),
}
"""The schemes that solve each half once."""


def _swept(state: CoupledState, span: Span, thermal: Pass, mechanical: Pass,
           end: tuple[Mapping[str, EnergyAccount], Pass]) -> Swept:
    """end : the accounts after the window, and the pass that came last."""
    accounts, last = end
    now = _level(state.now, span, thermal.outputs, mechanical.outputs, _heat(state.now, thermal))
    monitors = {"touching": float(mechanical.outputs.get("contact.touching", np.zeros(()))),
                "max_T": float(now.T.max()), "max_p": float(-now.t_N.min(initial=0.0)),
                **{f"thermal.{n}": v for n, v in thermal.told.items()},
                **{f"mechanical.{n}": v for n, v in mechanical.told.items()}}
    return Swept(now, accounts, last.sent, thermal.terms, last.work, monitors)


def _heat(start: Level, thermal: Pass) -> Array | None:
    """Heat stored by each body since the start of the run; None where the thermal half tells none."""
    names = sorted([n for n in thermal.terms[0] if n.startswith(STORED)]) if thermal.terms else []
    if not names:
        return None
    found = np.array([sum([terms[n] for terms in thermal.terms]) for n in names])
    # fault: heat stored told of the last window only -> return found | stability/test_freezing
    return found if start.heat is None else start.heat + found


def _level(start: Level, span: Span, thermal: Mapping[str, Array], mechanical: Mapping[str, Array],
           heat: Array | None = None) -> Level:
    """The level at the end of the window; what a half has not told is as at the start."""
    return Level(span.end, thermal.get("T", start.T), mechanical["x"],
                 mechanical.get("contact.t_N", np.zeros(len(start.t_N))), mechanical.get("contact.gap", start.gap),
                 mechanical.get("contact.covered", start.covered), thermal.get("f_s"), heat)
