"""The rival: CalculiX on two pressed blocks with pressure-dependent gap conductance, seconds per coupled iteration.

    python benchmarks/calculix.py [--quick] [--json FILE]      needs `ccx` on the path (Debian: calculix-ccx)

The deck is written here.  It is the pressed part of the sliding blocks: two squares of L = .0762 m, plane strain,
4-node quads, bottom at 0, top at 1000, pressed to 10 MPa by a prescribed displacement.  CalculiX solves temperature and
displacement in one matrix; a coupled iteration is one assembly and one factorisation of it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

L, E, NU = 0.0762, 2.0e11, 0.3
K, RHO, C = 30.0, 8000.0, 500.0
P0, H0, H1 = 1.0e7, 2000.0, 6000.0
RAMP, END = 1250.0, 2500.0  # pressed linearly until RAMP, then held: END is eight time constants of the two blocks
PER_LINE = 12  # numbers on a data line; CalculiX reads at most 16


@dataclass(frozen=True)
class Cost:
    """What a run of CalculiX took.  cpu : user + system [s].  T_lower : top of the lower block at the end [degC]."""

    n: int
    element: str
    equations: int
    increments: int
    iterations: int
    cpu: float
    T_lower: float

    @property
    def per_iteration(self) -> float:
        """CPU seconds a coupled iteration, set-up and output included."""
        return self.cpu / self.iterations


def deck(n: int, dt: float, element: str = "CPE4") -> str:
    """The input of CalculiX: n x n cells a block, increments of dt [s].

    element : CPE4 integrates fully, as ours does; CPE4R has one point a cell and is CalculiX's cheapest.
    """
    eps_N = E * n / L  # a penalty of E/h, as ours
    stroke = P0 * (2 * L * (1 - NU**2) / E + 1 / eps_N)
    pressures = [P0 * f for f in (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 1.0, 2.0)]
    gap = [f"{H0 + H1 * min(p / P0, 1.0) ** 0.95:.9g}, {p:.9g}" for p in pressures]
    middle = n // 2 + 1
    n_block, top_row = (n + 1) ** 2, n * (n + 1)
    lines = [
        "*NODE, NSET=NALL", *_nodes(n),
        f"*ELEMENT, TYPE={element}, ELSET=EALL", *_cells(n),
        "*NSET, NSET=NBOTTOM, GENERATE", f"1, {n + 1}",
        "*NSET, NSET=NTOP, GENERATE", f"{n_block + top_row + 1}, {2 * n_block}",
        "*NSET, NSET=NLOWER, GENERATE", f"1, {n_block}",
        "*NSET, NSET=NUPPER, GENERATE", f"{n_block + 1}, {2 * n_block}",
        "*NSET, NSET=NPROBE", f"{top_row + middle}",
        "*ELSET, ELSET=EMASTER, GENERATE", f"{n * (n - 1) + 1}, {n * n}",
        "*ELSET, ELSET=ESLAVE, GENERATE", f"{n * n + 1}, {n * n + n}",
        "*SURFACE, NAME=SMASTER", "EMASTER, S3",
        "*SURFACE, NAME=SSLAVE", "ESLAVE, S1",
        "*MATERIAL, NAME=STEEL", "*ELASTIC", f"{E}, {NU}", "*DENSITY", f"{RHO}",
        "*CONDUCTIVITY", f"{K}", "*SPECIFIC HEAT", f"{C}", "*EXPANSION, ZERO=0.", "0.",
        "*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL", "1.",
        "*SURFACE INTERACTION, NAME=PAIR",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{eps_N:.9g}",
        "*GAP CONDUCTANCE", *gap,
        "*CONTACT PAIR, INTERACTION=PAIR, TYPE=SURFACE TO SURFACE", "SSLAVE, SMASTER",
        "*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NLOWER, 0.", "NUPPER, 1000.",
        "*AMPLITUDE, NAME=PRESS", f"0., 0., {RAMP}, 1., {END}, 1.",
        f"*STEP, NLGEOM, INC={2 * int(END / dt)}",
        "*COUPLED TEMPERATURE-DISPLACEMENT, DIRECT", f"{dt}, {END}",
        "*BOUNDARY", "NBOTTOM, 2, 2, 0.", f"{middle}, 1, 1, 0.", f"{n_block + top_row + middle}, 1, 1, 0.",
        "NBOTTOM, 11, 11, 0.", "NTOP, 11, 11, 1000.",
        "*BOUNDARY, AMPLITUDE=PRESS", f"NTOP, 2, 2, {-stroke:.9g}",
        f"*NODE PRINT, NSET=NPROBE, FREQUENCY={2 * int(END / dt)}", "NT",
        "*END STEP", ""]
    return "\n".join(lines)


def _nodes(n: int) -> Iterator[str]:
    number = 0
    for y0 in (0.0, L):
        for j in range(n + 1):
            for i in range(n + 1):
                number += 1
                yield f"{number}, {i * L / n:.12g}, {y0 + j * L / n:.12g}, 0."


def _cells(n: int) -> Iterator[str]:
    number = 0
    for first in (1, (n + 1) ** 2 + 1):
        for j in range(n):
            for i in range(n):
                number += 1
                a = first + j * (n + 1) + i
                yield f"{number}, {a}, {a + 1}, {a + n + 2}, {a + n + 1}"


def run_calculix(n: int, dt: float, element: str = "CPE4") -> Cost:
    """Write the deck, run ccx on one thread, count what it did.

    Raises RuntimeError with its last output if it fails.
    """
    ccx = shutil.which("ccx")
    if ccx is None:
        raise RuntimeError("ccx is not on the path (Debian: apt-get install calculix-ccx)")
    environment = dict(os.environ, OMP_NUM_THREADS="1", CCX_NPROC_STIFFNESS="1", CCX_NPROC_EQUATION_SOLVER="1",
                       CCX_NPROC_RESULTS="1")
    with tempfile.TemporaryDirectory(prefix="calculix.") as folder:
        Path(folder, "blocks.inp").write_text(deck(n, dt, element))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([ccx, "blocks"], cwd=folder, env=environment, capture_output=True, text=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        if done.returncode or "Job finished" not in done.stdout:
            raise RuntimeError("ccx failed:\n" + (done.stdout + done.stderr)[-2000:])
        rows = [line.split() for line in Path(folder, "blocks.sta").read_text().splitlines()]
        increments = [r for r in rows if len(r) >= 4 and r[0].isdigit()]
        iterations = [line.split() for line in Path(folder, "blocks.cvg").read_text().splitlines()]
        probe = re.findall(r"^\s+\d+\s+([-\d.E+]+)\s*$", Path(folder, "blocks.dat").read_text(), re.M)
        equations = re.findall(r"number of equations\s+(\d+)", done.stdout)
        counted = sum(1 for r in iterations if r and r[0].isdigit())
        return Cost(n, element, int(equations[-1]), len(increments), counted, cpu, float(probe[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer increments, one repeat")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    args = parser.parse_args()
    dt, repeats = (250.0, 1) if args.quick else (50.0, 3)
    found = []
    print("   n  element  equations  increments  iterations   CPU s   ms an iteration   T lower top (exact 487.99)")
    for n, element in product((20, 60), ("CPE4", "CPE4R")):
        costs = [run_calculix(n, dt, element) for _ in range(repeats)]
        middle = sorted(costs, key=lambda c: c.cpu)[len(costs) // 2]
        print(f"{n:4d} {element:>8s} {middle.equations:10d} {middle.increments:11d} {middle.iterations:11d} "
              f"{middle.cpu:7.2f} {1e3 * middle.per_iteration:17.1f}   {middle.T_lower:.2f}")
        found += [asdict(c) for c in costs]
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
