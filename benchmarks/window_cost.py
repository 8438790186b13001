"""One of our windows against one coupled iteration of CalculiX, side by side on the same meshes.

    python benchmarks/window_cost.py [--quick] [--json FILE]

Ours: the sliding blocks, pressed, then windows in the slide in which nothing opens or closes and the mechanical half
needs at least two Newton iterations; both halves, contact and coupler together, recording apart, CPU seconds of the
whole process a window.
CalculiX runs between batches of our windows, so that both see the same machine.  Budget: a window of ours costs at most
half of a coupled iteration of CalculiX.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time

from calculix import Cost, run_calculix
from scene import (
    APPROACH,
    SLIDE_END,
    SLIDE_START,
    SLIP_OFF,
    Stopwatch,
    blocks,
    contact_stopwatch,
    cpu_clock,
    pin,
    table,
)

from coupler import Run
from coupler.control.loop import Tried, windows

BATCH = 12  # windows between two runs of CalculiX
SETTLE = 3  # windows after the start of the slide that are left out: the first is damped, the next have no history
ELEMENTS = ("CPE4", "CPE4R")


@dataclass(frozen=True)
class Window:
    """Seconds of one window: of CPU, and by part (contact is asked inside the halves and is part of theirs)."""

    iterations: int
    cpu: float
    thermal: float
    mechanical: float
    contact: float
    fmi: float
    coupler: float


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="n = 20 only, short runs of CalculiX")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    args = parser.parse_args()
    found, rows = [], []
    for n in (20,) if args.quick else (20, 60):
        ours, rival = side_by_side(n, batches=1 if args.quick else 3, dt=250.0 if args.quick else 125.0)
        rows.append(row_of(n, ours, rival))
        found.append({"n": n, "windows": [asdict(w) for w in ours], "calculix": [asdict(c) for c in rival]})
    print(f"ms of CPU, medians; solver {os.environ.get('SLIDELINE_SOLVER', 'superlu')}; scheme extrapolated")
    print(table(rows))
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))


def side_by_side(n: int, batches: int, dt: float) -> tuple[list[Window], list[Cost]]:
    """Our windows and CalculiX's runs, in turns."""
    size = 250.0 / (1.1 * n)  # a tenth of the time the edge takes to cross a cell
    scenario = blocks(n, coupling__end=SLIDE_END,
                      coupling__windows=[*APPROACH, {"until": SLIDE_END, "size": size}], coupling__kinks=[SLIP_OFF],
                      output__fields={"at": [SLIDE_END]})
    ours: list[Window] = []
    rival: list[Cost] = []
    with (tempfile.TemporaryDirectory(prefix="window.") as folder, cpu_clock(), contact_stopwatch() as watch,
          Run(scenario, Path(folder) / "run.h5") as r):
        steps = windows(r.halves, r.state, r.plan)
        before = next(tried for tried in steps if tried.t >= SLIDE_START)
        for _ in range(SETTLE):
            before = next(steps)
        for _ in range(batches):
            found, before = _batch(steps, before, watch)
            ours += found
            rival += [run_calculix(n, dt, element) for element in ELEMENTS]
    if not ours:
        raise RuntimeError(f"n = {n}: no window of the slide was free of events with two Newton iterations")
    return ours, rival


def _batch(steps: Iterator[Tried], before: Tried, watch: Stopwatch) -> tuple[list[Window], Tried]:
    """The windows of a batch in which nothing opened or closed and mechanics iterated at least twice."""
    found = []
    for _ in range(BATCH):
        contact = sum(watch.seconds.values())
        begun = process_time()
        tried = next(steps)
        cpu = process_time() - begun
        contact = sum(watch.seconds.values()) - contact
        work, touching = tried.solved.work, tried.solved.monitors.get("touching")
        if tried.accepted and touching == before.solved.monitors.get("touching") and work.mechanical_iterations >= 2:
            halves = work.thermal_seconds + work.mechanical_seconds
            found.append(Window(work.mechanical_iterations, cpu, work.thermal_seconds, work.mechanical_seconds, contact,
                                work.fmi_seconds, cpu - halves - work.fmi_seconds))
        before = tried
    return found, before


def row_of(n: int, ours: list[Window], rival: list[Cost]) -> dict[str, str]:
    """One line of the table, times in ms."""

    def middle(name: str) -> float:
        return 1e3 * statistics.median(float(getattr(w, name)) for w in ours)

    row = {"n": str(n), "windows": str(len(ours)),
           "newton": f"{statistics.mean(w.iterations for w in ours):.1f}", "ours": f"{middle('cpu'):.1f}",
           **{part: f"{middle(part):.2f}" for part in ("thermal", "mechanical", "contact", "fmi", "coupler")}}
    for element in ELEMENTS:
        theirs = 1e3 * statistics.median(c.per_iteration for c in rival if c.element == element)
        row |= {element: f"{theirs:.1f}", f"ours/{element}": f"{middle('cpu') / theirs:.2f}"}
    return row


if __name__ == "__main__":
    main()
