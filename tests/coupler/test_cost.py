"""What a scheme costs for the error that is wanted, and which is taken by it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from coupler.control.cost import FIRST_PAUSE, LONGEST_PAUSE, SchemeCosts, learned, rate
from coupler.control.error_estimate import Estimate
from coupler.control.window_size import AIM
from coupler.scenario.options import Scheme
from coupler.schemes.levels import Level
from coupler.schemes.state import CoupledState, IterationHistory, Solved, Verdict, Work

NOTHING = np.zeros(0)
STATE = CoupledState(Level(0.0, NOTHING, NOTHING.reshape(0, 2), NOTHING, NOTHING, NOTHING), (), 0, {})


def window(solves: int, iterated: bool) -> Solved:
    history = IterationHistory((), (), 0.1) if iterated else None
    return Solved(Verdict.ACCEPTED, "", STATE, (), Work(thermal_solves=solves, mechanical_solves=solves), {},
                  history=history, scheme=Scheme.ITERATED if iterated else Scheme.EXTRAPOLATED)


def error(share: float, order: int) -> Estimate:
    return Estimate({"temperature": share}, {}, {}, order, ratios={"temperature": 1.0}, size=share)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("longer", [0.5, 1.0, 3.0])
def test_a_rate_does_not_depend_on_the_window_it_was_measured_in(order: int, longer: float) -> None:
    """An error that goes with H^(p + 1) tells the same calls a second from a window of any length."""
    known = rate(window(2, iterated=False), 0.1, error(AIM, order))
    assert known == pytest.approx(4 / 0.1)
    found = rate(window(2, iterated=False), 0.1 * longer, error(AIM * longer ** (order + 1), order))
    assert found == pytest.approx(known)


def test_a_window_in_two_halves_counts_as_the_window_in_one() -> None:
    one = window(2, iterated=False)
    assert rate(replace(window(6, iterated=False), whole=one), 0.1, error(AIM, 2)) == rate(one, 0.1, error(AIM, 2))


def test_iterating_is_kept_to_where_it_costs_clearly_less() -> None:
    once, twice = window(1, iterated=False), window(2, iterated=True)
    costs = learned(SchemeCosts(), once, 1.0, error(AIM, 2), exact=True)
    assert not costs.waits
    assert math.isnan(costs.iterated)
    # Twice the calls: an error of an eighth lets windows be twice as long, and is worth no change; a 64th is.
    assert not learned(costs, twice, 1.0, error(AIM / 8, 2), exact=True).waits
    better = learned(costs, twice, 1.0, error(AIM / 64, 2), exact=True)
    assert better.waits
    assert better.pause == FIRST_PAUSE


def test_what_is_dearer_is_tried_again_more_and_more_seldom() -> None:
    once, good = (window(1, iterated=False), error(AIM, 2)), (window(2, iterated=True), error(AIM / 64, 2))
    costs, pauses = SchemeCosts(), []
    costs = learned(costs, *with_H(once), exact=True)
    for _ in range(300):
        taken = good if costs.waits or math.isnan(costs.iterated) else once
        costs = learned(costs, *with_H(taken), exact=True)
        if not costs.waited:
            pauses.append(costs.pause)
    assert pauses[:3] == [FIRST_PAUSE, 2 * FIRST_PAUSE, 4 * FIRST_PAUSE]
    assert max(pauses) == LONGEST_PAUSE
    # Where windows solved once have become the cheaper ones, one trial is enough.
    cheap = learned(costs, window(1, iterated=False), 1.0, error(AIM / 1000, 2), exact=True)
    assert not cheap.waits


def with_H(taken: tuple[Solved, Estimate]) -> tuple[Solved, float, Estimate]:
    return taken[0], 1.0, taken[1]


def test_loose_iterates_and_errors_that_were_not_measured_tell_nothing() -> None:
    known = learned(SchemeCosts(), window(1, iterated=False), 1.0, error(AIM, 2), exact=True)
    iterated = window(2, iterated=True)
    assert math.isnan(learned(known, iterated, 1.0, error(AIM / 64, 2), exact=False).iterated)
    assert math.isnan(learned(known, iterated, 1.0, replace(error(AIM / 64, 2), ratios={}), exact=True).iterated)
    assert math.isnan(learned(known, iterated, 1.0, None, exact=True).iterated)
