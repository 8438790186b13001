"""Windows that find their own size against fixed ones, on the sliding blocks: error against half-solves.

    python benchmarks/adaptive_blocks.py [--quick] [--cells 8] [--half elastic] [--json FILE] [--chart FILE.svg]

24 x 24 cells a block unless told otherwise, to 15000 s, the rigid half (the elastic one: `docs/study.md`).  The error
is that of the left, centre and right probe as they are drawn, straight between window ends, in the mean square over
2500 to 15000 s, as a share of the mean square of the probes; the reference has windows four times shorter than those
chosen by hand in the scenario.  Half-solves count everything: rejected windows, windows solved in two halves to measure
their error.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scene import blocks, pin, table

from coupler import Results, run

Array = NDArray[np.float64]
END, FROM = 15000.0, 2500.0
PROBES = ("lower.top.left", "lower.top.centre", "lower.top.right")
TIMES = np.linspace(FROM, END, 125_001)
BY_HAND = ((2500, 5, 100), (9900, 120, 10), (10000, 10, 0.5), (12500, 1, 100), (12550, 1, 9), (15000, 9, 9))
FINER = 4  # times shorter than by hand: the reference
LOOSE = (1024, 256, 64, 16, 4, 1)  # times 2e-4 of T, .01 of the rest
SIZES = (100, 50, 25, 12.5, 6.25)  # s, fixed windows


@dataclass(frozen=True)
class Row:
    """One run.  error : share of the probes' mean square.  approach, touch : median windows [s] in [3000, 9000] and
    [9980, 10020]."""

    name: str
    setting: float
    windows: int
    half_solves: int
    error: float
    approach: float
    touch: float


def by_hand(finer: float) -> dict[str, Any]:
    """The windows of the scenario, so many times shorter."""
    return {"coupling__windows": [{"until": t, "first": a / finer, "last": b / finer} for t, a, b in BY_HAND]}


def adaptive(loose: float) -> dict[str, Any]:
    """Windows that find their own size, by tolerances times a number; 5 has the default of T."""
    rtol = {"rtol": 0.01 * loose}
    return {"coupling__adaptive": {"first": 5.0, "least": 0.01, "most": 500.0, "tolerance": {
        "temperature": {"atol": 0.01 * loose, "rtol": 2e-4 * loose}, "gap": rtol, "heat": rtol, "displacement": rtol}}}


def runs(quick: bool) -> Iterator[tuple[str, float, dict[str, Any]]]:
    """Name, setting and overrides of each."""
    for loose in LOOSE[1:4] if quick else LOOSE:
        yield "adaptive", loose, adaptive(loose)
    for scheme in ("extrapolated", "staggered"):
        for H in SIZES[:3] if quick else SIZES:
            yield scheme, H, {"coupling__scheme": scheme, "coupling__windows": [{"until": END, "size": H}]}
    yield "by hand", 1.0, by_hand(1.0)


def solved(half: str, cells: int, overrides: Mapping[str, Any], folder: Path) -> Results:
    scenario = blocks(cells, half, coupling__end=END, output__fields={"at": [END]}, **overrides)
    return run(scenario, folder / "run.h5")


def drawn(results: Results) -> Array:
    """The probes at TIMES : (3, n)."""
    return np.array([np.interp(TIMES, *results.probe(name)) for name in PROBES])


def row(name: str, setting: float, results: Results, exact: Array) -> Row:
    error = float(np.sqrt(((drawn(results) - exact) ** 2).mean() / (exact**2).mean()))
    t = results.probe(PROBES[0])[0]
    at, H = t[:-1], np.diff(t)
    medians = [float(np.median(H[(at >= a) & (at < b)])) for a, b in ((3000, 9000), (9980, 10020))]
    return Row(name, setting, len(H), int(results.windows.solves.sum()), error, *medians)


def cost_of(rows: list[Row], name: str, error: float) -> float:
    """Half-solves to an error, on a straight line in logarithms; nan outside of what was run."""
    own = sorted((r.error, r.half_solves) for r in rows if r.name == name)
    x, y = np.log([e for e, _ in own]), np.log([n for _, n in own])
    return float(np.exp(np.interp(np.log(error), x, y))) if x[0] <= np.log(error) <= x[-1] else float("nan")


def chart(rows: list[Row], path: Path) -> None:
    """Error against half-solves."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "slideline"  # equal numbers make equal files
    from matplotlib import pyplot as plt

    figure, axis = plt.subplots(figsize=(6.0, 3.8), layout="constrained")
    for name, marker in (("adaptive", "o"), ("extrapolated", "s"), ("staggered", "^"), ("by hand", "*")):
        own = sorted((r.half_solves, 100.0 * r.error) for r in rows if r.name == name)
        if own:
            label = name if name in ("adaptive", "by hand") else f"fixed, {name}"
            axis.loglog(*zip(*own, strict=True), marker=marker, label=label)
    for percent in (1.0, 0.1):
        axis.axhline(percent, color="0.7", linewidth=0.8)
    axis.set_xticks([300, 500, 1000, 2000, 5000], ["300", "500", "1000", "2000", "5000"])
    axis.minorticks_off()
    axis.set_xlabel("half-solves, all counted")
    axis.set_ylabel("error of the probes, 2500 to 15000 s [%]")
    axis.grid(True, alpha=0.3)
    axis.legend(frameon=False)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three runs of each, a coarser reference")
    parser.add_argument("--cells", type=int, default=24, help="along an edge of a block; an even number")
    parser.add_argument("--half", choices=("rigid", "elastic"), default="rigid", help="the mechanical half")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--chart", type=Path, help="draw error against cost, SVG")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="adaptive.") as name:
        folder = Path(name)
        how = args.half, args.cells
        exact = drawn(solved(*how, by_hand(2.0 if args.quick else FINER), folder))
        rows = [row(n, s, solved(*how, o, folder), exact) for n, s, o in runs(args.quick)]
    print(table([{"windows": r.name, "setting": f"{r.setting:g}", "number": str(r.windows),
                  "half-solves": str(r.half_solves), "error %": f"{100 * r.error:.3f}",
                  "approach s": f"{r.approach:.3g}", "touch s": f"{r.touch:.3g}"} for r in rows]))
    for error in (0.01, 0.001):
        print(f"{error:.1%}: " + ", ".join(
            f"{n} {cost_of(rows, n, error):.0f}" for n in ("adaptive", "extrapolated", "staggered")))
    if args.json:
        args.json.write_text(json.dumps([asdict(r) for r in rows], indent=1))
    if args.chart:
        chart(rows, args.chart)


if __name__ == "__main__":
    main()
