"""A window of the sliding blocks against what it consists of: its kernels, factors and solves, called alone.

    python benchmarks/window_floor.py [--n 20] [--windows 40] [--against CHECKOUT] [--turns 5] [--json FILE]

The windows are those of window_cost.py: in the slide, both halves, contact and coupler, embedded; medians of CPU ms.
The floor: every call of a compiled kernel, of a factorisation, of a triangular and of a dense solve that Python made in
some windows is made again, alone, with the numbers it had.  Dense products are not among them: `@` cannot be watched.
Calls are those of Python functions, by cProfile.
With --against another checkout is run by turns with this one, each in a process of its own.
"""

from __future__ import annotations

import argparse
import copy
import cProfile
import json
import os
import pstats
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scene import APPROACH, SLIDE_END, SLIDE_START, SLIP_OFF, blocks, cpu_clock, pin, table

PACKAGES = ("contact", "coupler", "mechanical_fmu", "thermal_fmu")
SETTLE = 3  # windows after the start of the slide that are left out: the first is damped, the next have no history
RECORDED = 4  # windows whose calls are made again: factors are not made in each
AGAIN = 20  # times
COLUMNS = ("window", "floor", "window/floor", "kernels", "factors", "triangular", "dense", "n factors", "n triangular",
           "python calls")


class Recorder:
    """Calls by kind, kept while `on`.  The packages know nothing of it."""

    def __init__(self) -> None:
        self.on = False
        self.calls: dict[str, list[Callable[[], Any]]] = {}

    def recording(self, kind: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same and is recorded."""
        def recorded(*args: Any, **options: Any) -> Any:
            if self.on:
                given = copy.deepcopy((args, options))
                self.calls.setdefault(kind, []).append(lambda: function(*given[0], **given[1]))
            return function(*args, **options)

        return recorded

    def milliseconds(self, kind: str) -> float:
        """CPU ms that the calls of a kind take, alone."""
        begun = process_time()
        for call in self.calls.get(kind, []) * AGAIN:
            call()
        return 1e3 * (process_time() - begun) / AGAIN


def watch(recorder: Recorder) -> None:
    """Put the recorder between Python and all that is compiled."""
    from numba.core.dispatcher import Dispatcher

    import contact.half.linalg

    plain = contact.half.linalg.splu

    class Watched:
        def __init__(self, A: Any, **options: Any) -> None:
            self.solve = recorder.recording("triangular", plain(A, **options).solve)

    watched = recorder.recording("factors", plain)

    def splu(A: Any, **options: Any) -> Watched:
        if recorder.on:
            watched(A, **options)
        return Watched(A, **options)

    contact.half.linalg.splu = splu
    for name in ("solve", "inv", "eigh"):
        setattr(np.linalg, name, recorder.recording("dense", getattr(np.linalg, name)))
    for module in [m for name, m in sys.modules.items() if name.partition(".")[0] in PACKAGES]:
        for name, value in vars(module).items():
            if isinstance(value, Dispatcher):
                setattr(module, name, recorder.recording("kernels", value))


def slide(n: int) -> Iterator[Any]:
    """Yield windows of the slide without end; the first ones settle."""
    from coupler import Run
    from coupler.control.loop import windows

    scenario = blocks(n, coupling__end=SLIDE_END, coupling__kinks=[SLIP_OFF], output__fields={"at": [SLIDE_END]},
                      coupling__windows=[*APPROACH, {"until": SLIDE_END, "size": 250.0 / (1.1 * n)}])
    with tempfile.TemporaryDirectory(prefix="floor.") as folder, Run(scenario, Path(folder) / "run.h5") as run:
        for tried in windows(run.halves, run.state, run.plan):
            if tried.t >= SLIDE_START:
                yield tried


def measure(n: int, count: int) -> dict[str, float]:
    """CPU ms of a window and of its parts, and how many there are."""
    recorder, each = Recorder(), []
    steps = slide(n)
    for _ in range(SETTLE):
        next(steps)
    for _ in range(count):
        begun = process_time()
        next(steps)
        each.append(1e3 * (process_time() - begun))
    profile = cProfile.Profile()
    profile.enable()
    for _ in range(RECORDED):
        next(steps)
    profile.disable()
    # All kernels have machine code by now, so none is compiled with a recorder in place of another.  Factors made
    # before are not watched: a new run is.
    steps.close()
    watch(recorder)
    steps = slide(n)
    for _ in range(SETTLE + count):
        next(steps)
    recorder.on = True
    for _ in range(RECORDED):
        next(steps)
    recorder.on = False
    steps.close()
    parts = {kind: recorder.milliseconds(kind) / RECORDED for kind in ("kernels", "factors", "triangular", "dense")}
    floor, window = sum(parts.values()), statistics.median(each)
    return {"window": window, "floor": floor, "window/floor": window / floor, **parts,
            **{f"n {kind}": len(recorder.calls.get(kind, [])) / RECORDED for kind in ("factors", "triangular")},
            "python calls": pstats.Stats(profile).total_calls / RECORDED}


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=20, help="cells along an edge")
    parser.add_argument("--windows", type=int, default=40)
    parser.add_argument("--against", type=Path, help="another checkout, with which this one takes turns")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        with cpu_clock():
            args.child.write_text(json.dumps(measure(args.n, args.windows)))
        return
    here = Path(__file__).resolve().parents[1]
    places = {"this": here} if args.against is None else {"other": args.against.resolve(), "this": here}
    found: dict[str, list[dict[str, float]]] = {name: [] for name in places}
    for _ in range(args.turns):
        for name, place in places.items():
            found[name].append(in_a_new_process(place, args))
    middle = {name: {c: statistics.median(f[c] for f in all_) for c in COLUMNS} for name, all_ in found.items()}
    rows = [{"code": name, **{c: f"{row[c]:.4g}" for c in COLUMNS}} for name, row in middle.items()]
    if len(middle) == 2:
        rows.append({"code": "this/other", **{c: f"{middle['this'][c] / (middle['other'][c] or 1.0):.2f}"
                                              for c in COLUMNS}})
    print(f"n = {args.n}, CPU ms a window, medians of {args.turns} processes")
    print(table(rows))
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))


def in_a_new_process(place: Path, args: argparse.Namespace) -> dict[str, float]:
    """Measure the code of a checkout."""
    with tempfile.TemporaryDirectory(prefix="floor.") as folder:
        out = Path(folder) / "child.json"
        command = [sys.executable, __file__, "--child", str(out), "--n", str(args.n), "--windows", str(args.windows)]
        subprocess.run(command, env={**os.environ, "PYTHONPATH": str(place)}, check=True)
        found: dict[str, float] = json.loads(out.read_text())
    return found


if __name__ == "__main__":
    main()
