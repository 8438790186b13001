"""Orders of the coupling on the sliding blocks, from stored states: [3000, 9000] and [10500, 12500] s.

    python benchmarks/orders_stored.py [--half rigid] [--cells 8]

The run goes to the start of the span once; every scheme and window then begins at the same bits.  Orders are of the
mean temperature of the lower block's top edge, at the end of the span, from windows halved twice.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scene import APPROACH, L, blocks, pin, table

from coupler import Run
from coupler.control.loop import finished, step
from coupler.control.plan import Plan
from coupler.control.state import first
from coupler.scenario.options import Acceleration, Iteration, Scheme, Tolerance, Tolerances, WindowRange
from coupler.schemes.schedule import schedule

SHARP = Iteration(acceleration=Acceleration.IQN_ILS, max_iterations=60, tolerance=Tolerances(
    temperature=Tolerance(atol=1e-7, rtol=1e-8), gap=Tolerance(atol=1e-13, rtol=1e-8),
    pressure=Tolerance(atol=1.0, rtol=1e-8)))
# Span [s], window before it [s], numbers of windows in it.  Pressed together the top follows within seconds.
SPANS = ((3000.0, 9000.0, 50.0, (60, 120, 240)), (10500.0, 12500.0, 20.0, (160, 320, 640)))
EARLY = ({"until": 2500, "first": 20, "last": 400},)


def approach(start: float, size: float) -> list[dict[str, float]]:
    """Windows up to the start of a span."""
    kept = EARLY if start < 9000.0 else APPROACH[:3]
    return [*kept, {"until": start, "size": size}]


def measured(run: Run, start: float, end: float, counts: Sequence[int], scheme: Scheme) -> list[float]:
    """Mean T of the top edge at `end` [K] for each number of windows.  run : at `start`; it is left there."""
    nodes = run.scenario.interface.nodes
    top, both, found = np.abs(nodes[:, 1] - L) < 1e-9, (run.halves.thermal, run.halves.mechanical), []
    for n in counts:
        tokens = [half.save() for half in both]
        ranges = [WindowRange(start, start, start), WindowRange(end, (end - start) / n, (end - start) / n)]
        plan = Plan(schedule(end, ranges, ()), scheme, {"thermal": 1, "mechanical": 1}, SHARP)
        at = first(replace(run.state, sent={}), plan)
        at = replace(at, control=replace(at.control, tick=plan.schedule.bounds[1]))
        while not finished(at, plan):
            at = step(run.halves, at, plan).after
        found.append(float(at.state.now.T[top].mean()))
        for half, token in zip(both, tokens, strict=True):
            half.restore(token)
            half.release(token)
    return found


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--half", default="rigid", help="mechanical half: rigid or elastic")
    parser.add_argument("--cells", type=int, default=8, help="of a block, each way")
    args = parser.parse_args()
    rows = []
    for start, end, size, counts in SPANS:
        scenario = blocks(args.cells, args.half, coupling__scheme="extrapolated", coupling__end=start,
                          coupling__windows=approach(start, size), output__fields={"every": 100_000})
        with tempfile.TemporaryDirectory(prefix="orders.") as name, Run(scenario, Path(name) / "run.h5") as run:
            for _ in run.windows():
                pass
            for scheme in (Scheme.STAGGERED, Scheme.EXTRAPOLATED, Scheme.ITERATED):
                a, b, c = measured(run, start, end, counts, scheme)
                rows.append({"span s": f"{start:g} to {end:g}", "scheme": scheme.value, "last change K": f"{c - b:.2e}",
                             "order": f"{np.log2(abs((b - a) / (c - b))):.3f}"})
    print(table(rows))


if __name__ == "__main__":
    main()
