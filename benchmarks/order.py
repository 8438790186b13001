"""Speed against accuracy: the staggered and the extrapolated scheme on the slide of the sliding blocks.

    python benchmarks/order.py [--quick] [--json FILE] [--chart FILE.svg]

The rigid half prescribes the motion, so what is left is the error of the exchange and of the thermal half's step.
Windows in the slide are halved again and again; the error is the largest difference of the left and centre probes to a
reference of windows four times finer than the finest, over the window ends all runs share.  Two spans are told apart:
  whole    all of the slide.  Its largest error sits at the left corner in the first windows, where the midpoint rule
           rings; the ringing dies faster than any power of the window, so a slope of this column is no order.
  settled  from the time the centre is passed: the ringing is over, and the slope is the order of the coupling.
The reference being finite, a method of second order reads 2.07 at the last halving.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scene import APPROACH, SLIDE_END, SLIDE_START, SLIP_OFF, blocks, cpu_clock, pin, table

from coupler import run

N = 24
PIECE = SLIDE_END - SLIP_OFF  # the slide is eleven of these long, so windows of PIECE/k end at every kink
SETTLED = 0.5 * (SLIDE_START + SLIP_OFF)  # s, the edge passes the centre
COARSEST = 24  # windows in a PIECE: a tenth of the time the edge takes to cross a cell; larger ones ring


@dataclass(frozen=True)
class Cost:
    """One run of the slide.  whole, settled : error [K] over each span.  half_solves and CPU seconds : in the slide."""

    scheme: str
    window: float
    half_solves: int
    seconds: float
    whole: float
    settled: float
    slope_whole: float
    order: float


def shared_times() -> NDArray[np.float64]:
    """(n,) [s] ends of the coarsest windows, which are window ends of every run."""
    return np.linspace(SLIDE_START, SLIDE_END, 11 * COARSEST + 1)[1:]


def slide(scheme: str, k: int, folder: Path) -> tuple[NDArray[np.float64], int, float]:
    """Left and centre probes (2, n) [K] at the ends of the coarsest windows; half-solves; seconds."""
    windows = [*APPROACH, {"until": SLIDE_END, "size": PIECE / k}]
    scenario = blocks(N, "rigid", coupling__scheme=scheme, coupling__windows=windows, coupling__end=SLIDE_END,
                      coupling__kinks=[SLIP_OFF],
                      output__fields={"at": [SLIDE_END]})
    with cpu_clock():
        results = run(scenario, folder / f"{scheme}{k}.h5")
    rows = results.windows[results.windows.t >= SLIDE_START]
    probes = [np.interp(shared_times(), *results.probe(name)) for name in ("lower.top.left", "lower.top.centre")]
    return np.array(probes), int(rows.solves.sum()), float(rows.seconds.sum())


def measure(halvings: int, reference: int) -> list[Cost]:
    """Both schemes at windows of 1, 1/2, 1/4 ... of the coarsest."""
    settled = shared_times() >= SETTLED
    with tempfile.TemporaryDirectory(prefix="order.") as name:
        folder = Path(name)
        exact, _, _ = slide("extrapolated", reference, folder)
        found: list[Cost] = []
        for scheme in ("staggered", "extrapolated"):
            before = (math.nan, math.nan)
            for i in range(halvings + 1):
                k = COARSEST * 2**i
                probes, solves, seconds = slide(scheme, k, folder)
                error = np.abs(probes - exact)
                now = (float(error.max()), float(error[:, settled].max()))
                found.append(Cost(scheme, PIECE / k, solves, seconds, *now,
                                  math.log2(before[0] / now[0]), math.log2(before[1] / now[1])))
                before = now
        return found


def chart(costs: list[Cost], path: Path) -> None:
    """Error against half-solves and against seconds, both schemes."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.4), sharey=True, layout="constrained")
    for axis, what in zip(axes, ("half_solves", "seconds"), strict=True):
        for scheme, marker in (("staggered", "o"), ("extrapolated", "s")):
            own = [c for c in costs if c.scheme == scheme]
            axis.loglog([getattr(c, what) for c in own], [c.settled for c in own], marker=marker, label=scheme)
        axis.set_xlabel(what.replace("_", "-") + " in the slide")
        axis.xaxis.set_minor_formatter(NullFormatter())  # its labels would lie on each other
        axis.grid(True, which="both", alpha=0.3)
    axes[0].set_ylabel("largest error, settled [K]")
    axes[0].legend(frameon=False)
    figure.savefig(path, metadata={"Date": None})  # equal numbers make equal files


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one halving, a coarser reference")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--chart", type=Path, help="draw error against cost, SVG")
    args = parser.parse_args()
    halvings = 1 if args.quick else 3
    costs = measure(halvings, COARSEST * 2 ** (halvings + 2))
    print(table([{"scheme": c.scheme, "window s": f"{c.window:.3f}", "half-solves": str(c.half_solves),
                  "CPU s": f"{c.seconds:.2f}", "whole K": f"{c.whole:.2e}",
                  "slope": f"{c.slope_whole:.2f}", "settled K": f"{c.settled:.2e}", "order": f"{c.order:.2f}"}
                 for c in costs]))
    if args.json:
        args.json.write_text(json.dumps([asdict(c) for c in costs], indent=1))
    if args.chart:
        chart(costs, args.chart)


if __name__ == "__main__":
    main()
