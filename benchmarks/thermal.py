"""Error against time of the thermal half: three closed forms, three methods, meshes and steps each halved.

    python benchmarks/thermal.py [--quick] [--cases A5 D2] [--json FILE] [--charts FOLDER]

  A5  NAFEMS T3, a face at 100 sin(pi t/40): smooth.            Error: the largest at a node, at 32 s.
  A9  two-phase Stefan problem, isothermal melting: a front.    Error: the mean over .1 m, at 10 s.
  D2  two half-spaces that touch at t = 0: a jump at contact.   Error: the largest at a node, at 10 s.
The scene is a strip eight times as long as wide, so that finer cells cost what they cost in two dimensions.  Seconds of
CPU are those of the steps alone: the half is built and its kernels are compiled before.  Charts: a line a mesh.
"""

from __future__ import annotations

import argparse
import json
import math
import os
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from time import process_time

import numpy as np
from scene import pin, table
from thermal_cases import CASES, Case, first_inputs

from contact.half.model import Discard

METHODS = ("midpoint", "sdirk2", "backward_euler")
CELLS = (20, 40, 80, 160)
STEPS = (8, 16, 32, 64, 128)
SLENDER = 8  # length of the strip by its width
SHORT = 0.3  # s of CPU; a run shorter than this is repeated and the faster one counts


@dataclass(frozen=True)
class Cost:
    """One run.  worst, mean : error [K].  seconds : of CPU.  iterations : linear solves."""

    case: str
    method: str
    cells: int
    unknowns: int
    steps: int
    worst: float
    mean: float
    seconds: float
    iterations: int

    @property
    def error(self) -> float:
        """What the case is judged by [K]."""
        return self.mean if self.case == "A9" else self.worst


class Run:
    """A half on a mesh of a case, ready to be stepped again and again."""

    def __init__(self, case: Case, method: str, cells: int) -> None:
        from contact.rpc.link import DirectLink
        from contact.service import ContactService
        from thermal_fmu.half import load

        self.case, self.mesh = case, case.mesh(cells, max(cells // SLENDER, 1))
        self.half = load(self.mesh, {**case.spec, "method": method})
        self.link = DirectLink(ContactService().handle)
        self.inputs = first_inputs(self.half.variables)
        if case.pairs:
            self.inputs["contact.t_N"][:] = -case.pressure

    def steps(self, n: int) -> tuple[np.ndarray, float, int]:
        """T : (n_nodes,) [K] at the end after n equal steps, seconds of CPU, linear solves; NaN where a step failed."""
        dt, iterations = self.case.end / n, 0
        state, outputs = self.half.start(self.inputs, 0.0, self.link)
        begun = process_time()
        for i in range(n):
            done = self.half.step(state, self.inputs, i * dt, dt, self.link)
            if isinstance(done, Discard):
                return np.full(len(self.mesh.nodes), math.nan), process_time() - begun, iterations
            state, outputs = done.state, done.outputs
            iterations += int(outputs["iterations"])
        return np.asarray(outputs["T"]), process_time() - begun, iterations

    def cost(self, method: str, cells: int, n: int) -> Cost:
        T, seconds, iterations = self.steps(n)
        if seconds < SHORT:
            seconds = min(seconds, self.steps(n)[1])
        y = self.mesh.nodes[:, 1].copy()
        if self.case.pairs:  # two nodes at y = 0, one a body
            y[(self.mesh.node_body == 0) & (y == 0.0)] = -1e-300
        wrong = np.abs(T - self.case.exact(y))[np.abs(y) <= self.case.judged]
        return Cost(self.case.name, method, cells, y.size, n, float(wrong.max()), float(wrong.mean()), seconds,
                    iterations)


def measure(names: tuple[str, ...], cells: tuple[int, ...], steps: tuple[int, ...]) -> list[Cost]:
    """All of them, methods in turns on every mesh so that each sees the same machine."""
    found = []
    for name in names:
        case = CASES[name]()
        for n in cells:
            for method in METHODS:
                run = Run(case, method, n)
                run.steps(4)  # kernels, factors and library calls are warm
                found += [run.cost(method, n, k) for k in steps]
    return found


def slopes(costs: list[Cost]) -> list[dict[str, str]]:
    """Rows of the table: error down a column of steps on one mesh, and the order at its end where it still falls."""
    rows = []
    for key in dict.fromkeys((c.case, c.method, c.cells, c.unknowns) for c in costs):
        own = [c for c in costs if (c.case, c.method, c.cells, c.unknowns) == key]
        orders = [math.log2(a.error / b.error) for a, b in pairwise(own)]
        rows.append({"case": key[0], "method": key[1], "cells": str(key[2]), "unknowns": str(key[3]),
                     "steps": "/".join(str(c.steps) for c in own),
                     "error K": " ".join(f"{c.error:.1e}" for c in own),
                     "order": " ".join(f"{o:.1f}" for o in orders),
                     "CPU ms a step": f"{1e3 * own[-1].seconds / own[-1].steps:.2f}",
                     "solves a step": f"{own[-1].iterations / own[-1].steps:.2f}"})
    return rows


def best(costs: list[Cost], targets: tuple[float, ...]) -> list[dict[str, str]]:
    """What each method needs at least for an error: seconds, as a ratio to the midpoint rule."""
    rows = []
    for case in dict.fromkeys(c.case for c in costs):
        for target in targets:
            least = {m: min((c.seconds for c in costs if (c.case, c.method) == (case, m) and c.error <= target),
                            default=math.nan) for m in METHODS}
            ratios = {m: least[m] / least["midpoint"] for m in METHODS[1:]}
            rows.append({"case": case, "error K <=": f"{target:g}", "midpoint s": f"{least['midpoint']:.3f}",
                         **{f"{m} / midpoint": "-" if math.isnan(r) else f"{r:.2f}" for m, r in ratios.items()}})
    return rows


def chart(costs: list[Cost], path: Path) -> None:
    """Error against seconds of one case, log-log."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import NullFormatter

    plt.rcParams["svg.hashsalt"] = "slideline"  # equal numbers make equal files
    figure, axis = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    for method, colour in zip(METHODS, ("C0", "C2", "C1"), strict=True):
        for cells, marker in zip(CELLS, "osD^", strict=True):
            own = [c for c in costs if (c.method, c.cells) == (method, cells)]
            axis.loglog([c.seconds for c in own], [c.error for c in own], color=colour, marker=marker, ms=4, lw=1,
                        label=f"{method}, {cells} cells")
    t, e = min(c.seconds for c in costs), max(c.error for c in costs)
    for order, style in ((1, ":"), (2, "--")):  # seconds go with the number of steps
        span = np.array([t, t * 30.0])
        axis.loglog(span, e * (span / t) ** -order, color="grey", ls=style, lw=1, label=f"order {order} in the step")
    axis.set(xlabel="CPU time of the steps [s]", ylim=(0.5 * min(c.error for c in costs), 2.0 * e),
             ylabel=f"{costs[0].case}: {'mean' if costs[0].case == 'A9' else 'largest'} error of T [K]")
    axis.xaxis.set_minor_formatter(NullFormatter())  # its labels would lie on each other
    axis.grid(True, which="both", alpha=0.3)
    axis.legend(frameon=False, fontsize=6, ncols=2)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two meshes, three steps")
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--charts", type=Path, help="draw error against time here, thermal_speed_CASE.svg")
    args = parser.parse_args()
    costs = measure(tuple(args.cases), CELLS[:2] if args.quick else CELLS, STEPS[1:4] if args.quick else STEPS)
    print(f"solver {os.environ.get('SLIDELINE_SOLVER', 'superlu')}")
    print(table(slopes(costs)))
    print(table(best(costs, (3.0, 1.0, 0.3, 0.1, 0.03, 0.01))))
    if args.json:
        args.json.write_text(json.dumps([asdict(c) for c in costs], indent=1))
    if args.charts:
        for case in args.cases:
            chart([c for c in costs if c.case == case], args.charts / f"thermal_speed_{case}.svg")


if __name__ == "__main__":
    main()
