"""Order of the exchange on casting_1d while it freezes: windows halved, the steps of the thermal half held fixed.

With a step a window no order of 2 is seen here.  With the steps fixed their own error is the same in all runs, and what
is left is that of the exchange.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler import Run, load_scenario
from coupler.control.loop import finished, step
from coupler.control.plan import Plan
from coupler.control.state import first
from coupler.schemes.level import Scheme
from coupler.schemes.schedule import WindowRange, schedule

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios/casting_1d.yaml"
START, END, STEPS = 20.0, 28.0, 256  # s; steps of the thermal half between them
SHARED = 8  # times at which the gap is compared


@pytest.fixture(scope="module")
def frozen() -> Iterator[Run]:
    """At 20 s, .306 solid, by the windows of the scenario."""
    listed = [{"until": 1, "first": 0.005, "last": 0.05}, {"until": 5, "size": 0.1}, {"until": START, "size": 0.2}]
    scenario = load_scenario(SCENARIO, overrides={"coupling.end": START, "coupling.windows": listed})
    with tempfile.TemporaryDirectory() as folder, Run(scenario, Path(folder) / "run.h5") as run:
        for _ in run.windows():
            pass
        yield run


def gaps(run: Run, scheme: Scheme, substeps: int) -> np.ndarray:
    """(SHARED,) gap [m], each window of so many steps of the thermal half.  run : at START; it is left there."""
    size, both, found = (END - START) * substeps / STEPS, (run.halves.thermal, run.halves.mechanical), []
    tokens = [half.save() for half in both]
    windows = schedule(END, [WindowRange(START, START, START), WindowRange(END, size, size)], ())
    plan = Plan(windows, scheme, {"thermal": substeps, "mechanical": 1})
    at = first(replace(run.state, sent={}), plan)
    at = replace(at, control=replace(at.control, tick=windows.bounds[1]))
    while not finished(at, plan):
        at = step(run.halves, at, plan).after
        found.append(float(np.nanmean(at.state.now.gap[np.isfinite(at.state.now.gap)])))
    for half, token in zip(both, tokens, strict=True):
        half.restore(token)
        half.release(token)
    return np.array(found)[STEPS // substeps // SHARED - 1::STEPS // substeps // SHARED]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("scheme", "order", "last"), [
    (Scheme.STAGGERED, 1.0, 5e-8), (Scheme.EXTRAPOLATED, 2.0, 2e-10)])
def test_order_of_the_exchange_while_it_freezes(frozen: Run, scheme: Scheme, order: float, last: float) -> None:
    coarse, middle, fine = (gaps(frozen, scheme, k) for k in (16, 8, 4))
    first_, second = (float(np.sqrt(((a - b) ** 2).mean())) for a, b in ((coarse, middle), (middle, fine)))
    assert np.log2(first_ / second) == pytest.approx(order, abs=0.05)
    assert second < last
