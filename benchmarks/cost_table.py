"""A full run of the sliding blocks (24 x 24, elastic, to 25000 s): CPU seconds cold and warm, and where they go.

    python benchmarks/cost_table.py [--quick] [--json FILE]

Cold: no compiled kernels and no FMUs from earlier runs (both caches empty).  Warm: a second run with the caches of the
first.  `process` is everything, processes that build FMUs included; set-up and all below it are of the run itself.
The budget of the coupler: coupler + FMI + transport <= .3 ms + .1 us a real exchanged, a window.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter
from typing import Any

import numpy as np
from scene import SCENARIO, contact_stopwatch, cpu_clock, pin, table

from coupler import Results, load_scenario, run

BASE, PER_REAL = 0.3e-3, 0.1e-6  # s a window, s a real


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one warm run instead of three")
    parser.add_argument("--mechanical", default="elastic", choices=["elastic", "rigid"])
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        args.child.write_text(json.dumps(one_run(args.mechanical)))
        return
    with tempfile.TemporaryDirectory(prefix="caches.") as caches:
        found = [in_a_new_process(Path(caches), args) for _ in range(2 if args.quick else 4)]
    warm = sorted(found[1:], key=lambda f: f["process"])[(len(found) - 1) // 2]
    print(f"{args.mechanical}, {warm['windows']} windows, {warm['half_solves']} half-solves")
    print(table([{"seconds": name, "cold": f"{found[0][name]:.2f}", "warm": f"{warm[name]:.2f}",
                  "warm ms a window": f"{1e3 * warm[name] / warm['windows']:.3f}"} for name in warm["parts"]]))
    print(f"coupler + FMI + transport: median {1e3 * warm['overhead_median']:.3f} ms a window, budget "
          f"{1e3 * warm['budget_median']:.3f} ms at {warm['values_median']:.0f} reals; "
          f"{100 * warm['within_budget']:.0f} % of the windows are within it")
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))


def in_a_new_process(caches: Path, args: argparse.Namespace) -> dict[str, Any]:
    """What one_run measures, in a process of its own whose caches are in `caches`."""
    out = caches / "child.json"
    command = [sys.executable, __file__, "--child", str(out), "--mechanical", args.mechanical]
    environment = {**os.environ, "SLIDELINE_CACHE": str(caches / "fmus"), "NUMBA_CACHE_DIR": str(caches / "kernels")}
    started, before = perf_counter(), getrusage(RUSAGE_CHILDREN)
    subprocess.run(command, env=environment, check=True)
    after = getrusage(RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    found: dict[str, Any] = json.loads(out.read_text())
    return found | {"process": cpu, "elapsed": perf_counter() - started,
                    "parts": ["elapsed", "process", *found["parts"]]}


def one_run(mechanical: str) -> dict[str, Any]:
    """Run the scene once; seconds by part, and the coupler's budget."""
    scenario = load_scenario(SCENARIO, overrides={"mechanical.half": mechanical})
    with cpu_clock(), tempfile.TemporaryDirectory(prefix="cost.") as folder, contact_stopwatch() as watch:
        results = run(scenario, Path(folder) / "run.h5")
        return split(results, sum(watch.seconds.values())) | {"contact_calls": watch.calls}


def split(results: Results, contact: float) -> dict[str, Any]:
    """Where the seconds of a run went.

    Contact was asked inside the halves.  The coupler is what remains of a window: scheme, states kept, ledger; the rest
    of the loop is probes and progress.
    """
    w, totals = results.windows, results.totals
    overhead = w.seconds - w.thermal_seconds - w.mechanical_seconds
    budget = BASE + PER_REAL * w["values"]
    parts = {
        "set-up": totals["setup_seconds"], "all windows": totals["seconds"],
        "thermal half": float(w.thermal_seconds.sum()), "mechanical half": float(w.mechanical_seconds.sum()),
        "of both: contact": contact,
        "FMI and transport": float(w.fmi_seconds.sum()), "coupler": float((overhead - w.fmi_seconds).sum()),
        "recording": float(w.recording_seconds.sum()),
        "rest of the loop": float(totals["seconds"] - w.seconds.sum() - w.recording_seconds.sum()),
    }
    return parts | {
        "parts": list(parts), "windows": len(w), "half_solves": int(w.solves.sum()),
        "thermal_iterations": int(w.thermal_iterations.sum()),
        "mechanical_iterations": int(w.mechanical_iterations.sum()),
        "overhead_median": float(np.median(overhead)), "budget_median": float(np.median(budget)),
        "values_median": float(np.median(w["values"])), "within_budget": float(np.mean(overhead <= budget)),
        "outcome": results.outcome,
    }


if __name__ == "__main__":
    main()
