"""How honest the error estimate is: estimated over true local error, window by window, the whole histogram a case.

    python benchmarks/estimate.py [--quick] [--json FILE] [--chart FILE.svg]

E8 and E4 are lumped bodies in Python, D13 and casting_1d rods as FMUs, all in given windows (true_error.py).
A window counts as honest if the estimate of its temperature is within a factor of 3; where the true error is below ten
times the tolerance of the iteration, if it is not understated by more than that.  `low`: understated by more than 3.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / "tests" / "coupler"), str(ROOT / "tests" / "scenarios")]

from coupled_run import start  # noqa: E402  (of the tests)
from fake_halves import gap_of, lumped, shrinking  # noqa: E402
from small_scenes import CLOSING  # noqa: E402
from true_error import Window, windows  # noqa: E402

from coupler import load_scenario  # noqa: E402
from coupler.running.run import Run  # noqa: E402
from coupler.scenario.options import Scheme, WindowRange  # noqa: E402
from coupler.schemes.schedule import schedule  # noqa: E402
from coupler.schemes.state import wanted_outputs  # noqa: E402

FACTOR, FLOORS = 3.0, 10.0
# Errors below these are round-off of the halves: T [K], gap and x [m], heat [J].
NOTHING = {"temperature": 1e-8, "gap": 1e-14, "displacement": 1e-14, "heat": 1e-7}
DT_C = {"midpoint": 7.4062, "backward_euler": 10.2449}  # s, of E4
BINS = np.geomspace(1 / 64, 64, 25)


@dataclass(frozen=True)
class Case:
    """One scene by one scheme.  honest, low : shares of the windows; measured : share solved in two halves too."""

    name: str
    windows: int
    measured: float
    honest: float
    low: float
    ratios: Mapping[str, tuple[float, ...]]


def lumped_case(scheme: Scheme, end: float, n: int, method: str = "midpoint") -> list[Window]:
    """E4 from 840 K in n windows."""
    halves = wanted_outputs(lumped(840.0, method), shrinking(840.0))
    plan = schedule(end, [WindowRange(end, end / n, end / n)], ())
    return list(windows(halves, start(840.0, gap_of(840.0)), plan, scheme, 1))


def scene_case(file: Path, scheme: Scheme, every: int, **overrides: object) -> list[Window]:
    """A scenario in its own windows."""
    scenario = load_scenario(file, overrides={"coupling.scheme": scheme.value, **overrides})
    with tempfile.TemporaryDirectory() as folder, Run(scenario, Path(folder) / "run.h5") as r:
        return list(windows(r.halves, r.state, r.plan.schedule, scheme, every))


def cases(quick: bool) -> Iterator[tuple[str, Callable[[], list[Window]]]]:
    """Name -> how to run it."""
    X, I = Scheme.EXTRAPOLATED, Scheme.ITERATED  # noqa: E741
    for scheme in (X, I):
        for n in (20, 40, 80):
            yield f"E8, n {n}, {scheme.value}", lambda s=scheme, n=n: lumped_case(s, 20.0, n)
    for method, limit in DT_C.items():
        for scheme in (X, I):
            yield (f"E4, .3 dt_c, {method}, {scheme.value}",
                   lambda s=scheme, m=method, c=limit: lumped_case(s, 0.3 * c * 40, 40, m))
        yield f"E4, 3 dt_c, {method}, iterated", lambda m=method, c=limit: lumped_case(I, 3 * c * 30, 30, m)
    every = 40 if quick else 5
    for scheme in (X, I):
        yield f"D13, {scheme.value}", lambda s=scheme: closing(s, every)
    for scheme in (X, I):
        file = ROOT / "scenarios" / "casting_1d.yaml"
        yield f"casting_1d, {scheme.value}", lambda s=scheme, f=file: scene_case(f, s, every)


def closing(scheme: Scheme, every: int) -> list[Window]:
    """D13 in windows of 1 s to 200 s."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "closing.yaml"
        file.write_text(CLOSING, encoding="utf-8")
        return scene_case(file, scheme, every, **{"coupling.end": 200, "coupling.windows": [{"until": 200, "size": 1}]})


def judged(name: str, found: list[Window]) -> Case:
    """The case in numbers."""
    good, low, ratios = [], [], {}
    for w in found:
        estimated, true = w.estimated["temperature"], w.true["temperature"]
        if true < NOTHING["temperature"]:
            continue
        good.append(estimated >= true / FACTOR and (estimated <= true * FACTOR or true < FLOORS * w.floor))
        low.append(estimated < true / FACTOR)
    for quantity in found[0].true:
        pairs = [(w.estimated[quantity], w.true[quantity]) for w in found if quantity in w.true]
        ratios[quantity] = tuple(e / t for e, t in pairs if t > NOTHING[quantity])
    return Case(name, len(good), float(np.mean([w.measured for w in found])), float(np.mean(good)), float(np.mean(low)),
                ratios)


def chart(found: list[Case], path: Path) -> None:
    """A histogram a case, of all quantities; the band is the factor of 3."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "slideline"  # equal numbers make equal files
    from matplotlib import pyplot as plt

    rows = -(-len(found) // 4)
    figure, axes = plt.subplots(rows, 4, figsize=(11.0, 2.0 * rows), sharex=True, layout="constrained")
    for axis, case in zip(axes.flat, found, strict=False):
        axis.axvspan(1 / FACTOR, FACTOR, color="0.9")
        for quantity, ratios in case.ratios.items():
            axis.hist(np.clip(ratios, BINS[0], BINS[-1]), BINS, histtype="step" if quantity != "temperature" else "bar",
                      label=quantity, weights=np.full(len(ratios), 1.0 / max(len(ratios), 1)))
        axis.set_xscale("log")
        axis.set_title(f"{case.name}: {case.honest:.0%}", fontsize=8)
    for axis in list(axes.flat)[len(found):]:
        axis.axis("off")
    axes.flat[len(found) - 1].legend(fontsize=6, frameon=False)
    figure.supxlabel("estimated over true local error", fontsize=9)
    figure.supylabel("share of windows", fontsize=9)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer windows of D13 and casting_1d")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--chart", type=Path, help="draw the histograms, SVG")
    args = parser.parse_args()
    found = []
    for name, run in cases(args.quick):
        found.append(judged(name, run()))
        print(f"{name}: {found[-1].honest:.0%}", file=sys.stderr, flush=True)
    print(table([{"case": c.name, "windows": str(c.windows), "measured": f"{c.measured:.0%}",
                  "honest": f"{c.honest:.0%}", "low": f"{c.low:.0%}",
                  **{q: f"{np.median(r):.2f}" if r else "" for q, r in c.ratios.items()}} for c in found]))
    if args.json:
        args.json.write_text(json.dumps([asdict(c) for c in found], indent=1))
    if args.chart:
        chart(found, args.chart)


if __name__ == "__main__":
    main()
