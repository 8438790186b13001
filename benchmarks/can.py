"""The casting in its can, scenarios/aluminium_can.yaml, at three meshes and with halved windows.

Use: `python benchmarks/can.py`.
Runs what FOLDER (--folder, default can_runs) does not hold yet, prints a table, and draws docs/images/can_gap.svg and
can_flux.svg.  --only NAME ... : of coarse, coarse_half, medium, medium_half, fine.  --variants : what else the physics
could be, on the coarse mesh, one line each: when it is solid, the gaps then, and what touches; can_variants.svg.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "scenarios")]

import numpy as np  # noqa: E402
from can_pictures import draw, draw_variants  # noqa: E402
from can_readings import CanRun, read_can, touching  # noqa: E402

from coupler import Results, load_scenario, run  # noqa: E402

SCENARIO = ROOT / "scenarios" / "aluminium_can.yaml"
REFERENCE_TIMES = (0.5, 4, 8, 14, 20, 30, 40, 50, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1000)
HALVED = {"coupling.windows": [{"until": 10, "first": 0.05, "last": 0.25}, {"until": 1100, "size": 2}],
          "output.fields.every": 4}


def finer(name: str, k: int) -> dict[str, Any]:
    """Overrides for a mesh k times as fine as the coarse one."""
    return {"bodies.melt.mesh.rectangle.cells": [8 * k, 24 * k],
            "bodies.can.mesh.file.path": f"aluminium_can_{name}.msh"}


RUNS: dict[str, dict[str, Any]] = {"coarse": {}, "coarse_half": HALVED, "medium": finer("medium", 2),
                                   "medium_half": finer("medium", 2) | HALVED, "fine": finer("fine", 4)}


BY_PENALTY: dict[str, Any] = {f"contact.{pair}.{key}": value for pair in ("side", "base")
                              for key, value in (("augmented", None), ("penalty", 1e9))}
FRICTION = {"contact.side.friction": {"mu": 0.5}, "contact.base.friction": {"mu": 0.5}}
SHRINKAGE = "materials.aluminium.liquid.shrinkage"


def creep(factor: float) -> dict[str, Any]:
    """Power-law creep of pure aluminium (Frost and Ashby 1982, table 4.1) as Norton's law, its mu/T taken at 900 K.

    A = 3^-(n + 1)/2 A_2 D_0 b mu^(1 - n)/(k T), n = 4.4, A_2 = 3.4e6, D_0 = 1.7e-4 m2/s, b = 2.86e-10 m, mu = 17.2 GPa.
    """
    return {"materials.aluminium.creep": {"A": 1.08e-23 * factor, "n": 4.4, "Q": 142000}}


VARIANTS: dict[str, dict[str, Any]] = {
    "the scenario": {}, "by a penalty of 1 MPa/mm alone": BY_PENALTY, "creep": creep(1.0),
    "1000 times the creep": creep(1000.0), "mu 0.5": FRICTION,
    "a can that keeps its size": {"materials.steel.alpha": 1e-12},
    "1/4 of the shrinkage": {SHRINKAGE: 0.00575515}, "1/10 of the shrinkage": {SHRINKAGE: 0.00230206},
    "no shrinkage": {SHRINKAGE: 0.0}, "no shrinkage, mu 0.5": FRICTION | {SHRINKAGE: 0.0}}
VARIANT_HEAD = """| variant | all solid at s | gap at half height um | in the corner um | gap under the edge um | \
wall touches | base touches from, to mm |
|---|---|---|---|---|---|---|"""


def variant_row(name: str, c: CanRun) -> str:
    """One line of the table of variants."""
    k = int(np.argmin(abs(c.t - c.solid_at)))
    r = 1e3 * c.base_r[c.base_p[k] > 0.0]
    return (f"| {name} | {c.solid_at:.0f} | {1e6 * c.gap[k, len(c.z) // 2]:.0f} | {1e6 * c.gap[k, 0]:.0f} | "
            f"{max(0.0, 1e6 * c.base_gap[k, -1]):.0f} | {touching(c, k):.0%} | {r.min():.0f}, {r.max():.0f} |")


def made(folder: Path, name: str, overrides: dict[str, Any]) -> Results:
    """The run of that name: read, if the folder holds it already."""
    out = folder / f"{name}.h5"
    return Results(out) if out.exists() else run(load_scenario(SCENARIO, overrides=overrides), out=out)


def row(name: str, results: Results, c: CanRun) -> str:
    """One line of the table."""
    k = int(np.argmin(abs(c.t - c.solid_at)))
    half = np.interp(0.5, c.solid, c.solid_t)
    middle = len(c.z) // 2
    seconds = sum(results.seconds_by_part.values())
    return (f"| {name} | {len(results.windows)} | {half:.1f} | {c.solid_at:.0f} | {1e6 * c.gap[k, middle]:.0f} | "
            f"{1e6 * mean_base(c, k):.0f} | {100 * (c.unheated[k] - 1):.2f} | {results.heat_imbalance:.0e} | "
            f"{seconds:.0f} |")


def mean_base(c: CanRun, k: int) -> float:
    """The mean gap under the casting [m], by area."""
    g, r = c.base_gap[k], c.base_r
    return float(np.trapezoid(g * r, r) / np.trapezoid(r, r))


HEAD = """| run | windows | half solid at s | all solid at s | gap at half height um | mean gap below um | volume % | \
heat imbalance | s |
|---|---|---|---|---|---|---|---|---|"""


def reference(c: CanRun, columns: int = 5) -> None:
    """Writes what tests/scenarios/test_aluminium_can.py compares with, of the coarse run."""
    at = np.linspace(0, len(c.z) - 1, columns).round().astype(int)
    every = np.unique([int(np.argmin(abs(c.t - t))) for t in REFERENCE_TIMES])
    table = np.column_stack([c.t[every], np.interp(c.t[every], c.solid_t, c.solid), 1e6 * c.gap[every][:, at],
                             c.h[every][:, at]])
    heights = ", ".join(f"{1e3 * z:g}" for z in c.z[at])
    np.savetxt(ROOT / "tests" / "scenarios" / "data" / "aluminium_can.txt", table, fmt="%.5g",
               header=f"t s, solid fraction, gap um and then h W/m2K at heights {heights} mm; coarse mesh")


def main() -> None:
    """Run, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path("can_runs"))
    parser.add_argument("--only", nargs="*", choices=list(RUNS), default=list(RUNS))
    parser.add_argument("--reference", action="store_true", help="store the coarse run as the test's reference")
    parser.add_argument("--variants", action="store_true", help="what else the physics could be")
    options = parser.parse_args()
    options.folder.mkdir(exist_ok=True)
    if options.variants:
        print(VARIANT_HEAD)
        cans = {}
        for i, (name, overrides) in enumerate(VARIANTS.items()):
            cans[name] = read_can(made(options.folder, f"variant_{i}", overrides))
            print(variant_row(name, cans[name]), flush=True)
        draw_variants(cans, ROOT / "docs" / "images")
        return
    print(HEAD)
    read = {}
    for name in options.only:
        results = made(options.folder, name, RUNS[name])
        read[name] = read_can(results)
        print(row(name, results, read[name]), flush=True)
    if options.reference:
        reference(read["coarse"])
    finest = next(n for n in ("fine", "medium", "coarse", *read) if n in read)
    draw(read[finest], Results(options.folder / f"{finest}.h5"), ROOT / "docs" / "images")


if __name__ == "__main__":
    main()
