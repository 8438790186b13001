"""What a ratio of an error is worth: of two nothings, found small twice, and of windows after one kept in halves."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from test_estimate import ONE, RATIOS, X, known_of, level, measured_after, ratio_of, solved_at, told

from coupler.control import error_estimate
from coupler.control.error_estimate import DECIDES, LIKE, Estimate, Measured, Memory
from coupler.scenario.options import ErrorTolerances, Iteration, Scheme, Tolerance
from coupler.schemes.levels import Level
from coupler.schemes.schedule import Clock
from coupler.schemes.state import Span

NOTHING = Memory()
LEVELS = [level(t, 900.0 + t * t) for t in (3.0, 2.0, 1.0)]  # H^2 T'' = 2 K


def carried(memory: Memory, tolerance: float = 1.0) -> Estimate | None:
    """The error carried on to the last of the levels."""
    before, solved = solved_at(LEVELS[1], (LEVELS[2],)).state, solved_at(LEVELS[0], tuple(LEVELS[1:]))
    allowed = ErrorTolerances(temperature=Tolerance(atol=tolerance, rtol=0.0),
                              displacement=Tolerance(atol=1.0, rtol=0.0))
    return error_estimate.estimate(memory, before, solved, allowed, Iteration())


def known(shares: Mapping[str, float]) -> Memory:
    return known_of(Measured(RATIOS, 1.0, shares=shares))


def test_an_error_that_was_nothing_when_it_was_measured_does_not_size_windows() -> None:
    """1 K of a tolerance of 1 K, told by a ratio that was found at a thousandth of it, is measured first."""
    assert carried(known({"temperature": 1e-3})) is None
    assert carried(known({"temperature": 1.01 / LIKE})) is not None
    # Below what decides, or where nothing else is known, it is as it is told.
    assert carried(known({"temperature": 1e-3}), tolerance=1.01 / DECIDES) is not None
    assert carried(known({})) is not None


def test_a_ratio_that_two_measurements_on_end_find_small_is_believed() -> None:
    """Heat that had just begun to cross was told to be off by 0.4 of its tolerance through 30 windows: 6e-5 of it."""
    told = [m.ratios["temperature"] for m in measured_after(Measured(RATIOS, 1.0), [0.01, 0.02, 0.01])]
    assert told == pytest.approx([0.25, 0.02, 0.01])
    # One of the two may be an error that just passes through 0.
    told = [m.ratios["temperature"] for m in measured_after(Measured(RATIOS, 1.0), [0.5, 0.0, 0.5])]
    assert told == pytest.approx([0.5, 0.25, 0.5])


def in_halves(error: float, memory: Memory = NOTHING) -> tuple[Memory, Estimate]:
    """What is known after a window kept in halves whose answer in one was off by so much more [K].

    memory : before it.
    """
    before, halves = solved_at(LEVELS[1], (LEVELS[2],)).state, solved_at(LEVELS[0], tuple(LEVELS[1:]))
    one = replace(LEVELS[0], T=LEVELS[0].T + np.array([error / 1.5, 0.0]))
    solved = replace(halves, whole=solved_at(one, tuple(LEVELS[1:])))
    found = error_estimate.estimate(memory, before, solved, ErrorTolerances(
        temperature=Tolerance(atol=1.0, rtol=0.0)), Iteration())
    assert found is not None
    return error_estimate.after(memory, before, solved, found), found


@pytest.mark.parametrize(("bent", "error", "begins", "unseen", "pause"), [
    (1.0, 0.01, (), "", 1), (0.1, 0.01, ("temperature",), "", 0), (0.1, 0.001, ("temperature",), "temperature", 0),
    (0.1, 0.0, ("temperature",), "temperature", 0)])
def test_what_begins_in_a_window_is_known_once_it_went_on(bent: float, error: float, begins: tuple[str, ...],
                                                          unseen: str, pause: int) -> None:
    """T bends by 2 K: what was measured where it bent by 0.1 K tells nothing of it, nor do answers within 2 mK."""
    before = known_of(Measured(RATIOS, 1.0, bent={"temperature": bent}))
    assert (carried(before) is None) == bool(begins)
    memory, found = in_halves(error, before)
    assert (found.begins, found.unseen) == (begins, unseen)
    assert memory.of(X).left == pause


def test_after_a_window_kept_in_halves_one_in_one_is_held_against_one_in_one() -> None:
    """It is off by 6 K itself where T bends by 2 K: by 3 times its bend, and its own end bends by 2 + 4 K.

    Carried on by 3 it was told to be off by 18 K, measured again each time, and never left in one.
    """
    memory, found = in_halves(6.0)
    assert memory.halved
    assert found.ratios["temperature"] == pytest.approx(3.0)
    assert found.first["temperature"] == pytest.approx(1.0)
    levels = [replace(level(t, 900.0 + t * t)) for t in (4.0, 3.0, 2.0)]
    off = [replace(levels[0], T=levels[0].T + np.array([4.0, 0.0])), *levels[1:]]
    assert told(memory, off).errors["temperature"] == pytest.approx(6.0)
    # Once windows are in one again, all of them are off alike, and T bends as it does.
    later = error_estimate.after(memory, solved_at(levels[1], (levels[2],)).state, solved_at(levels[0], ()), None)
    assert not later.halved
    assert told(later, levels).errors["temperature"] == pytest.approx(6.0)


def test_what_comes_late_is_no_error_of_windows_in_one() -> None:
    before, halves = (solved_at(at, past, scheme=Scheme.PARALLEL) for at, past in (
        (LEVELS[1], (LEVELS[2],)), (LEVELS[0], tuple(LEVELS[1:]))))
    found = replace(told(ratio_of(1.0, scheme=Scheme.PARALLEL), LEVELS, scheme=Scheme.PARALLEL), ratios=RATIOS,
                    first=RATIOS)
    after = error_estimate.after(Memory(), before.state, halves, found)
    assert after.halved
    assert not after.of(Scheme.PARALLEL).first
    assert after.of(Scheme.PARALLEL).ratios == RATIOS
    assert error_estimate.after(Memory(), before.state, replace(halves, scheme=X), found).of(X).first == RATIOS


def test_a_window_that_is_iterated_to_measure_rho_is_told_by_windows_solved_once() -> None:
    """A sixth of the calls of a run went into halves of windows that were iterated for rho alone."""
    old, fresh = Measured(RATIOS, 1.0, left=-3), Measured({n: 2.0 * r for n, r in RATIOS.items()}, 1.0, left=2)
    by = {Scheme.ITERATED.value: old, Scheme.EXTRAPOLATED.value: fresh}
    assert Memory(by).telling(Scheme.ITERATED) is fresh
    # Not where nothing was ever measured of it: what iterating costs is not known then.
    assert not Memory({Scheme.EXTRAPOLATED.value: fresh}).telling(Scheme.ITERATED).ratios
    # Nor where that is old too, nor of any other scheme, nor where what it has of its own is fresh.
    assert Memory(by | {Scheme.EXTRAPOLATED.value: replace(fresh, left=0)}).telling(Scheme.ITERATED) is old
    assert Memory(by | {Scheme.STAGGERED.value: old}).telling(Scheme.STAGGERED) is old
    assert Memory(by | {Scheme.ITERATED.value: replace(old, left=1)}).telling(Scheme.ITERATED).left == 1
    state, solved = solved_at(LEVELS[1], (LEVELS[2],)).state, solved_at(
        LEVELS[0], tuple(LEVELS[1:]), scheme=Scheme.ITERATED)
    span = Span(Clock(16.0), 2 * 2**36, 3 * 2**36, ONE)
    assert not error_estimate.wanted(Memory(by), state, span, Scheme.ITERATED, LEVELS[0])
    told = error_estimate.estimate(Memory(by), state, solved, ErrorTolerances(), Iteration())
    assert told is not None
    assert told.errors["temperature"] == pytest.approx(2.0 * 2.0 * RATIOS["temperature"])


def test_what_was_measured_of_wide_gaps_is_measured_again_in_narrow_ones() -> None:
    """The error goes with what the exchange feeds back, by 1/gap^2: over a gap that closed from 60 um to 1 it was told
    to be a twentieth of what it was.
    """
    def at(gap: float) -> Level:
        return replace(LEVELS[0], gap=np.array([gap, np.inf]), covered=np.array([1.0, 0.0]))

    before = solved_at(replace(at(5e-6), t=2.0, T=LEVELS[1].T), (replace(at(5e-6), t=1.0, T=LEVELS[2].T),)).state
    span = Span(Clock(16.0), 2 * 2**36, 3 * 2**36, ONE)
    memory = known_of(Measured(RATIOS, 1.0, left=8, gaps=1.0 / 8e-6**2))
    wanted = [error_estimate.wanted(memory, before, span, Scheme.EXTRAPOLATED, at(gap)) for gap in (6e-6, 3e-6, 20e-6)]
    assert wanted == [False, True, True]
    # It is measured in one that is, from there on.
    one = replace(solved_at(at(3e-6), tuple(LEVELS[1:])), whole=solved_at(at(4e-6), tuple(LEVELS[1:])))
    found = error_estimate.estimate(memory, before, one, ErrorTolerances(), Iteration())
    assert found is not None
    assert error_estimate.after(memory, before, one, found).of(Scheme.EXTRAPOLATED).gaps == pytest.approx(1.0 / 3e-6**2)
