"""Unknowns a second of the thermal half: assembly, factorisation and solve, from 1e3 to 2e5 unknowns.

    python benchmarks/thermal_speed.py [--quick] [--json FILE] [--chart FILE.svg]

A square of n x n quads whose k and c depend on T (nothing may be kept from one iteration to the next), a face held, a
face with convection.  Substeps of the half are taken as they are; clocks sit around what Newton's method calls.
Assembly is residual and derivative together.  Each solver runs in a process of its own, in turns with the other.
Exponents are fitted to seconds ~ unknowns^p over all sizes; 1.2 was asked for.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scene import pin, table
from scipy.sparse import csr_array
from thermal_cases import first_inputs, strip

SIDES = (31, 63, 99, 157, 223, 315, 447)  # cells: 1 024 to 200 704 unknowns
SOLVERS = ("superlu", "pardiso")
PARTS = ("assembly", "factorisation", "solve")
STEPS = 3  # the first is cut in four after the jump at its start and is no ordinary step


@dataclass(frozen=True)
class Speed:
    """Medians of CPU seconds of each part at a size.  first : the first factorisation, with the pattern's analysis."""

    solver: str
    unknowns: int
    assembly: float
    factorisation: float
    solve: float
    first: float
    step: float
    iterations: float


def scene(m: int) -> tuple[Any, dict[str, Any]]:
    """Mesh and model.json of the square."""
    material = {"rho": 7800.0, "k": {"polynomial": [30.0, 0.02]}, "c": {"polynomial": [400.0, 0.2]}}
    model = {"half": "thermal", "format": 2, "materials": {"m": material},
             "bodies": {"a": {"material": "m", "T0": 300.0}},
             "boundary": [{"on": "a.bottom", "temperature": 500.0},
                          {"on": "a.top", "convection": {"h": 500.0, "T": 300.0}}]}
    return strip((0.1,), m, m), model


def timed(call: Callable[..., Any], into: list[float]) -> Callable[..., Any]:
    """The same call; its seconds of CPU are added to the list."""
    def clocked(*args: Any, **options: Any) -> Any:
        begun = process_time()
        result = call(*args, **options)
        into.append(process_time() - begun)
        return result

    return clocked


def measure(m: int) -> Speed:
    """The parts of a substep on m x m cells, with the solver of this process."""
    from thermal_fmu import newton
    from thermal_fmu.half import load

    newton.factorise(csr_array(np.eye(3)))  # loads the library
    seconds: dict[str, list[float]] = {part: [] for part in PARTS}
    plain, factorise, newton.SMALLEST = newton.balance, newton.factorise, 10**9  # new factors in every iteration
    whole = timed(plain, seconds["assembly"])
    # A residual alone is half of the work: only what gives the derivative too is read.
    newton.balance = lambda *args, jacobian: (whole if jacobian else plain)(*args, jacobian=jacobian)
    make = timed(factorise, seconds["factorisation"])
    newton.factorise = lambda *args: timed(make(*args), seconds["solve"])
    steps, iterations = [], []
    try:
        mesh, model = scene(m)
        half = load(mesh, model)
        inputs = first_inputs(half.variables)
        state, _ = half.start(inputs, 0.0, None)
        while len(steps) < STEPS:
            begun = process_time()
            done = half.step(state, inputs, 0.2 * len(steps), 0.2, None)
            steps.append(process_time() - begun)
            state = done.state
            iterations.append(float(done.outputs["iterations"]))
    finally:
        newton.balance, newton.factorise = plain, factorise
    # The first readings hold what is made once: compiled kernels, the pattern's analysis.
    medians = [statistics.median(seconds[part][1:]) for part in PARTS]
    return Speed(os.environ.get("SLIDELINE_SOLVER", "superlu"), len(mesh.nodes), *medians,
                 seconds["factorisation"][0], statistics.median(steps[1:]), statistics.mean(iterations[1:]))


def in_a_new_process(which: str, m: int) -> Speed:
    """measure(m) with one solver."""
    command = [sys.executable, __file__, "--child", str(m)]
    done = subprocess.run(command, env={**os.environ, "SLIDELINE_SOLVER": which}, check=True, text=True,
                          stdout=subprocess.PIPE)
    return Speed(**json.loads(done.stdout))


def exponent(found: list[Speed], part: str) -> float:
    """p of seconds ~ unknowns^p, least squares over all sizes."""
    return float(np.polyfit(np.log([s.unknowns for s in found]), np.log([getattr(s, part) for s in found]), 1)[0])


def chart(found: list[Speed], path: Path) -> None:
    """Unknowns a second against unknowns, log-log."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import NullFormatter

    plt.rcParams["svg.hashsalt"] = "slideline"  # equal numbers make equal files
    figure, axis = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    for which, style in zip(SOLVERS, ("-", "--"), strict=True):
        own = [s for s in found if s.solver == which]
        n = np.array([s.unknowns for s in own])
        for part, colour in zip(PARTS, ("C0", "C1", "C2"), strict=True):
            if part != "assembly" or which == SOLVERS[0]:
                name = part if part == "assembly" else f"{part}, {which}"
                axis.loglog(n, n / [getattr(s, part) for s in own], style, color=colour, marker="o", ms=4, label=name)
    n = np.array([s.unknowns for s in found if s.solver == SOLVERS[0]])
    start = max(s.unknowns / s.factorisation for s in found)
    axis.loglog(n, start * (n / n[0]) ** -0.2, ":", color="grey", label="seconds ~ unknowns^1.2")
    axis.set(xlabel="unknowns", ylabel="unknowns a second of CPU [1/s]")
    axis.xaxis.set_minor_formatter(NullFormatter())  # its labels would lie on each other
    axis.grid(True, which="both", alpha=0.3)
    axis.legend(frameon=False, fontsize=7)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the three smallest sizes")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--chart", type=Path, help="draw unknowns a second, SVG")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        print(json.dumps(asdict(measure(args.child))))
        return
    found = [in_a_new_process(which, m) for m in (SIDES[:3] if args.quick else SIDES) for which in SOLVERS]
    print("ms of CPU, medians; a step has as many of each as it has solves")
    print(table([{"solver": s.solver, "unknowns": str(s.unknowns),
                  **{part: f"{1e3 * getattr(s, part):.2f}" for part in (*PARTS, "first", "step")},
                  "solves a step": f"{s.iterations:.2f}"} for s in found]))
    print(table([{"solver": which, **{part: f"{exponent([s for s in found if s.solver == which], part):.2f}"
                                      for part in (*PARTS, "step")}} for which in SOLVERS]))
    if args.json:
        args.json.write_text(json.dumps([asdict(s) for s in found], indent=1))
    if args.chart:
        chart(found, args.chart)


if __name__ == "__main__":
    main()
