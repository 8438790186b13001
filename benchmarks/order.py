"""Speed against accuracy: the staggered and the extrapolated scheme on the slide of the sliding blocks.

    python benchmarks/order.py [--quick] [--json FILE] [--chart FILE.svg]

The rigid half prescribes the motion, so what is left is the error of the exchange and of the thermal half's step.
Windows in the slide are halved again and again; the error is the largest difference of the left and centre probes to a
reference of much finer windows, over all window ends the runs share.  The order is the slope of the last halving.
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
COARSEST = 24  # windows in a PIECE: a tenth of the time the edge takes to cross a cell; larger ones ring


@dataclass(frozen=True)
class Cost:
    """One run of the slide.  error [K] against the reference.  half_solves and CPU seconds : in the slide."""

    scheme: str
    window: float
    half_solves: int
    seconds: float
    error: float
    order: float


def slide(scheme: str, k: int, folder: Path) -> tuple[NDArray[np.float64], int, float]:
    """Left and centre probes (2, n) [K] at the ends of the coarsest windows; half-solves; seconds."""
    windows = [*APPROACH, {"until": SLIDE_END, "size": PIECE / k}]
    scenario = blocks(N, "rigid", coupling__scheme=scheme, coupling__windows=windows, coupling__end=SLIDE_END,
                      coupling__kinks=[SLIP_OFF],
                      output__fields={"at": [SLIDE_END]})
    with cpu_clock():
        results = run(scenario, folder / f"{scheme}{k}.h5")
    every = np.linspace(SLIDE_START, SLIDE_END, 11 * COARSEST + 1)[1:]
    rows = results.windows[results.windows.t >= SLIDE_START]
    probes = [np.interp(every, *results.probe(name)) for name in ("lower.top.left", "lower.top.centre")]
    return np.array(probes), int(rows.solves.sum()), float(rows.seconds.sum())


def measure(halvings: int, reference: int) -> list[Cost]:
    """Both schemes at windows of 1, 1/2, 1/4 ... of the coarsest."""
    with tempfile.TemporaryDirectory(prefix="order.") as name:
        folder = Path(name)
        exact, _, _ = slide("extrapolated", reference, folder)
        found: list[Cost] = []
        for scheme in ("staggered", "extrapolated"):
            before = math.nan
            for i in range(halvings + 1):
                k = COARSEST * 2**i
                probes, solves, seconds = slide(scheme, k, folder)
                error = float(np.abs(probes - exact).max())
                found.append(Cost(scheme, PIECE / k, solves, seconds, error, math.log2(before / error)))
                before = error
        return found


def chart(costs: list[Cost], path: Path) -> None:
    """Error against half-solves and against seconds, both schemes."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.4), sharey=True, layout="constrained")
    for axis, what in zip(axes, ("half_solves", "seconds"), strict=True):
        for scheme, marker in (("staggered", "o"), ("extrapolated", "s")):
            own = [c for c in costs if c.scheme == scheme]
            axis.loglog([getattr(c, what) for c in own], [c.error for c in own], marker=marker, label=scheme)
        axis.set_xlabel(what.replace("_", "-") + " in the slide")
        axis.grid(True, which="both", alpha=0.3)
    axes[0].set_ylabel("largest error of two probes [K]")
    axes[0].legend(frameon=False)
    figure.savefig(path)


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two halvings, a coarser reference")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--chart", type=Path, help="draw error against cost, SVG")
    args = parser.parse_args()
    halvings = 2 if args.quick else 4
    costs = measure(halvings, COARSEST * 2 ** (halvings + 1))
    print(table([{"scheme": c.scheme, "window s": f"{c.window:.3f}", "half-solves": str(c.half_solves),
                  "CPU s": f"{c.seconds:.2f}", "error K": f"{c.error:.2e}", "order": f"{c.order:.2f}"}
                 for c in costs]))
    if args.json:
        args.json.write_text(json.dumps([asdict(c) for c in costs], indent=1))
    if args.chart:
        chart(costs, args.chart)


if __name__ == "__main__":
    main()
