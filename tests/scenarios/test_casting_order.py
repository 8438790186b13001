"""Order of the exchange on casting_1d while it freezes: windows halved, the steps of the thermal half held fixed.

With a step a window no order of 2 is seen here.  With the steps fixed their own error is the same in all runs, and what
is left is that of the exchange.  A cell that begins to freeze is a kink of the gap, about one a second: across kinks
`iterated` shows no clean order, between two of them it does.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from coupler import Run, load_scenario
from coupler.control.loop import finished, step
from coupler.control.plan import Plan
from coupler.control.state import first
from coupler.scenario.options import Iteration, Scheme, Tolerance, Tolerances, WindowRange
from coupler.schemes.schedule import schedule

pytestmark = pytest.mark.usefixtures("unlooked")

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios/casting_1d.yaml"
FROZEN = 20.0  # s, .306 solid
SHARED = 8  # times at which the gap is compared
SHARP = Iteration(max_iterations=80, tolerance=Tolerances(
    temperature=Tolerance(atol=1e-9, rtol=1e-9), gap=Tolerance(atol=1e-15, rtol=1e-9),
    pressure=Tolerance(atol=1.0, rtol=1e-9), solid_fraction=Tolerance(atol=1e-9, rtol=1e-9)))


@dataclass(frozen=True)
class Stretch:
    """start, end [s].  steps : of the thermal half between them."""

    start: float
    end: float
    steps: int


LONG = Stretch(FROZEN, 28.0, 256)  # a cell begins about once a second
BETWEEN = Stretch(21.0, 22.0, 128)  # cells begin to freeze at 20.93 and 22.03 s


@contextmanager
def stored(start: float) -> Iterator[Run]:
    """The run at `start`, by the windows of the scenario to 20 s and such of 1/64 s from there."""
    listed = [{"until": 1, "first": 0.005, "last": 0.05}, {"until": 5, "size": 0.1}, {"until": FROZEN, "size": 0.2}]
    if start > FROZEN:
        listed.append({"until": start, "size": 1 / 64})
    scenario = load_scenario(SCENARIO, overrides={"coupling.end": start, "coupling.windows": listed})
    with tempfile.TemporaryDirectory() as folder, Run(scenario, Path(folder) / "run.h5") as run:
        for _ in run.windows():
            pass
        yield run


@pytest.fixture(scope="module")
def at_20() -> Iterator[Run]:
    with stored(LONG.start) as run:
        yield run


@pytest.fixture(scope="module")
def at_21() -> Iterator[Run]:
    with stored(BETWEEN.start) as run:
        yield run


def gaps(run: Run, stretch: Stretch, scheme: Scheme, substeps: int) -> np.ndarray:
    """(SHARED,) gap [m], each window of so many steps of the thermal half.  run : at the start; it is left there."""
    start, end, both, found = stretch.start, stretch.end, (run.halves.thermal, run.halves.mechanical), []
    size, tokens = (end - start) * substeps / stretch.steps, [half.save() for half in both]
    windows = schedule(end, [WindowRange(start, start, start), WindowRange(end, size, size)], ())
    plan = Plan(windows, scheme, {"thermal": substeps, "mechanical": 1}, SHARP)
    at = first(replace(run.state, sent={}), plan)
    at = replace(at, control=replace(at.control, tick=windows.bounds[1]))
    while not finished(at, plan):
        at = step(run.halves, at, plan).after
        found.append(float(np.nanmean(at.state.now.gap[np.isfinite(at.state.now.gap)])))
    for half, token in zip(both, tokens, strict=True):
        half.restore(token)
        half.release(token)
    every = stretch.steps // substeps // SHARED
    return np.array(found)[every - 1::every]


def order(run: Run, stretch: Stretch, scheme: Scheme, coarsest: int) -> tuple[float, float]:
    """The order in the mean square of windows halved twice, and what the last halving changes [m]."""
    coarse, middle, fine = (gaps(run, stretch, scheme, k) for k in (coarsest, coarsest // 2, coarsest // 4))
    first_, second = (float(np.sqrt(((a - b) ** 2).mean())) for a, b in ((coarse, middle), (middle, fine)))
    return float(np.log2(first_ / second)), second


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize(("scheme", "expected", "last"), [
    (Scheme.STAGGERED, 1.0, 5e-8), (Scheme.EXTRAPOLATED, 2.0, 2e-10)])
def test_order_of_the_exchange_while_it_freezes(at_20: Run, scheme: Scheme, expected: float, last: float) -> None:
    found, change = order(at_20, LONG, scheme, 16)
    assert found == pytest.approx(expected, abs=0.05)
    assert change < last


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize(("scheme", "expected", "last"), [
    (Scheme.STAGGERED, 1.0, 8e-10), (Scheme.EXTRAPOLATED, 2.0, 1.3e-12), (Scheme.ITERATED, 2.0, 2.5e-13)])
def test_order_of_the_exchange_between_two_cells(at_21: Run, scheme: Scheme, expected: float, last: float) -> None:
    found, change = order(at_21, BETWEEN, scheme, 8)
    assert found == pytest.approx(expected, abs=0.05)
    assert change < last
