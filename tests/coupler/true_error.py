"""A run in windows of given sizes, each with its estimated and its true local error.

The true one: the same window solved again from the same start in 64 sub-windows, iterated to a tight tolerance.  Where
the estimator asks for a window in two halves it is so solved and their answer saved, as in a run with
`coupling.adaptive`; the windows themselves are given, so that schemes and sizes can be compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from coupler.control import error_estimate, quantities
from coupler.control.solve_window import SavedStates, SolveOptions, doubled, solve_once
from coupler.scenario.options import ErrorTolerances, Iteration, Scheme, Tolerance, Tolerances
from coupler.schemes.schedule import Schedule
from coupler.schemes.state import CoupledState, Halves, Settings, Solved, Span

ONE = {"thermal": 1, "mechanical": 1}
PIECES = 64
TIGHT = Iteration(max_iterations=60, tolerance=Tolerances(
    temperature=Tolerance(atol=1e-8, rtol=0.0), gap=Tolerance(atol=1e-13, rtol=0.0),
    pressure=Tolerance(atol=1e-2, rtol=0.0), solid_fraction=Tolerance(atol=1e-9, rtol=0.0)))
FINE = SolveOptions(Scheme.ITERATED, Settings(Scheme.ITERATED, ONE, TIGHT))


@dataclass(frozen=True)
class Window:
    """One window [s].  estimated, true : quantity -> error [K, m, J].  measured : solved in two halves too.

    floor : what the iteration may leave of T [K].
    """

    t: float
    H: float
    estimated: dict[str, float]
    true: dict[str, float]
    measured: bool
    floor: float


def windows(halves: Halves, state: CoupledState, schedule: Schedule, scheme: Scheme, every: int) -> Iterator[Window]:
    """Every so many windows, with its errors; the others are solved all the same."""
    way, memory = SolveOptions(scheme, Settings(scheme, ONE)), error_estimate.Memory()
    for i, (k0, k1) in enumerate(pairwise(schedule.bounds)):
        span = Span(schedule.clock, k0, k1, ONE)
        exact = fine(halves, state, span) if i % every == 0 else None
        with SavedStates(halves, state.now.t, i + 1) as saved:
            solved = solve_once(halves, state, span, way, saved)
            if error_estimate.wanted(memory, state, span, scheme, solved.state.now):
                solved = doubled(halves, state, span, way, saved, solved)
        found = error_estimate.estimate(memory, state, solved, ErrorTolerances(), way.settings.iteration)
        assert solved.taken, solved.message
        assert found is not None, "a window of which nothing is known is measured"
        memory = error_estimate.after(memory, state, solved, found)
        if exact is not None:
            tolerance = way.settings.iteration.tolerance.temperature
            change = float(np.abs(solved.state.now.T - state.now.T).max())
            floor = tolerance.atol + tolerance.rtol * change if scheme is Scheme.ITERATED else 0.0
            yield Window(state.now.t, span.end - state.now.t, dict(found.errors),
                         true_errors(solved, exact, tuple(found.errors)), found.measured, floor)
        state = solved.state


def fine(halves: Halves, state: CoupledState, span: Span) -> Solved:
    """The window in 64 iterated sub-windows; both halves are as before it."""
    terms: list[dict[str, float]] = []
    ticks = [span.k0 + (span.k1 - span.k0) * i // PIECES for i in range(PIECES + 1)]
    with SavedStates(halves, state.now.t, 0) as start:
        for k0, k1 in pairwise(ticks):
            with SavedStates(halves, state.now.t, 0) as saved:
                solved = solve_once(halves, state, replace(span, k0=k0, k1=k1), FINE, saved)
            assert solved.taken, solved.message
            state = solved.state
            terms += [dict(t) for t in solved.terms]
        start.roll_back("the window was solved for comparison")
    return replace(solved, terms=tuple(terms))


def true_errors(solved: Solved, exact: Solved, names: Sequence[str]) -> dict[str, float]:
    """Quantity -> largest difference."""
    a, b = solved.state.now, exact.state.now
    faced = (a.covered > 0.999) & (b.covered > 0.999)
    told = {"temperature": (a.T, b.T), "displacement": (a.x, b.x), "gap": (a.gap[faced], b.gap[faced])}
    found = {n: float(np.abs(v - w).max(initial=0.0)) for n, (v, w) in told.items() if n in names}
    if "heat" in names:
        found["heat"] = abs(heat(solved) - heat(exact))
    return found


def heat(solved: Solved) -> float:
    """Energy through contact [J]."""
    return sum(terms.get(name, 0.0) for terms in solved.terms for name in quantities.HEAT)
