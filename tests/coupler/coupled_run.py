"""Run two fake halves over windows of one size by a scheme."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from coupler.control.loop import Plan, Tried, windows
from coupler.scenario.options import Iteration, Scheme, WindowRange
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.levels import Level
from coupler.schemes.schedule import schedule
from coupler.schemes.state import CoupledState, wanted_outputs


def start(T: float, x: float, *t_N: float) -> CoupledState:
    """One temperature, one coordinate that matters, and t_N where it is given."""
    now = Level(0.0, np.array([T]), np.array([[0.0, x]]), np.array(t_N), np.zeros(len(t_N)), np.zeros(len(t_N)))
    return CoupledState(now, (), 0, {"E_M": EnergyAccount(np.zeros(1))})


def couple(halves: tuple, state: CoupledState, time: tuple[float, int], scheme: Scheme, *,
           how: Iteration | None = None, substeps: tuple[int, int] = (1, 1),
           kinks: Iterable[float] = ()) -> tuple[CoupledState, list[Tried]]:
    """time : (end [s], number of windows).  The state at the end, and every window tried."""
    end, n = time
    plan = Plan(schedule(end, [WindowRange(end, end / n, end / n)], kinks), scheme,
                {"thermal": substeps[0], "mechanical": substeps[1]}, how or Iteration())
    tried = []
    for w in windows(wanted_outputs(*halves), state, plan):
        tried.append(w)
        state = w.solved.state if w.accepted else state
    return state, tried
