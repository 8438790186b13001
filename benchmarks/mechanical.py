"""One Newton iteration of the mechanical half, taken apart: assembly by kind of cell, factorisation, solve.

    python benchmarks/mechanical.py [--quick] [--json FILE] [--chart FILE.svg]

A square of quads in plane strain, bent by some thousandths.  CPU seconds, one thread, the best of some repeats; SuperLU
and PARDISO solve the same matrix in turns.  `cold` is the CPU time to compile the loops, in a process of its own.
`iteration` is all of it as the half does it, on a known pattern; `floor` the bare loop, the sum of its entries, and
PARDISO's own calls for factors and solve of half the same matrix, measured beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray
from scene import pin, table
from scipy.sparse import csr_matrix, triu

from contact.half.interface import Interface
from contact.half.linalg import FACTOR, POSITIVE, SOLVE, _Handle, factorise, pattern_of
from mechanical_fmu.cells import Treatment, cells_of
from mechanical_fmu.laws.catalogue import POINT
from mechanical_fmu.laws.law import PLASTIC
from mechanical_fmu.material import Moduli
from mechanical_fmu.problem import parse_elastic
from mechanical_fmu.system import Loading, system_of
from mechanical_fmu.tangent import fresh_direction
from mechanical_fmu.volume import DeformableMesh, PointStep

CELLS = (70, 157, 315)  # a side: 1.0e4, 5.0e4, 2.0e5 unknowns
FORMS = {"elastic": Treatment(), "plastic": Treatment(PLASTIC), "enhanced": Treatment(enhanced=True),
         "enhanced plastic": Treatment(PLASTIC, enhanced=True), "plane stress": Treatment(plane_stress=True)}
MU, KAPPA = 7.7e10, 1.7e11  # Pa, steel


def square(n: int) -> Interface:
    """n x n quads of the unit square."""
    X = np.stack(np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij"), -1).reshape(-1, 2)
    at = np.arange((n + 1) ** 2, dtype=np.int32).reshape(n + 1, n + 1)
    cells = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    return Interface("plane", X, cells, np.empty((0, 3), np.int32), np.zeros(len(cells), np.int32),
                     np.empty(0, np.int32), ("b",), ("m",), {}, {}, ())


def steel(n_e: int) -> Moduli:
    p = np.zeros(n_e, POINT)
    p["shear_modulus"], p["yield_stress"], p["hardening_modulus"] = MU, 250e6, 2e9
    p["solid_fraction"], p["plastic_heat"] = 1.0, 0.9
    return Moduli(np.full(n_e, MU), np.full(n_e, KAPPA), np.zeros((n_e, 1)), p)


def best(run: Callable[[], object], repeats: int) -> float:
    """Least CPU time of some runs [ms]."""
    run()
    times = []
    for _ in range(repeats):
        start = process_time()
        run()
        times.append(process_time() - start)
    return 1e3 * min(times)


def measure(n: int, repeats: int) -> dict[str, float]:
    """All times [ms] at n x n cells."""
    interface = square(n)
    X = interface.nodes
    u = 3e-3 * np.sin(3.0 * X[:, ::-1])
    out: dict[str, float] = {"unknowns": float(2 * len(X))}
    pattern = pattern_of(2 * len(X), cells_of(interface)[0].dofs)
    for name, form in FORMS.items():
        volume, moduli = DeformableMesh(cells_of(interface, (form,)), len(X)), (steel(n * n),)
        out[name] = best(lambda v=volume, m=moduli: v.evaluate(u, m, PointStep(1.0), tangent=True), repeats)
    entries = DeformableMesh(cells_of(interface), len(X)).tangent(u, (steel(n * n),))[1]
    out["scatter"] = best(lambda: pattern.matrix(entries), repeats)
    K = pattern.matrix(entries)
    held = np.zeros(2 * len(X))
    held[: 2 * (n + 1)] = K.diagonal().max()
    K = K + 0.0 * K
    K.setdiag(K.diagonal() + 1e6 * held)
    b = np.ones(2 * len(X))
    for solver in ("superlu", "pardiso"):
        os.environ["SLIDELINE_SOLVER"] = solver
        out[f"{solver} factor"] = best(lambda: factorise(K), max(1, repeats // 3))
        solve = factorise(K)
        out[f"{solver} solve"] = best(lambda s=solve: s(b), repeats)
        out[f"{solver} iteration"] = best(iteration(interface, u), max(3, repeats // 2))
    out["floor"] = out["elastic"] + out["scatter"] + bare(K, b, max(3, repeats // 2))
    return out


def iteration(interface: Interface, u: NDArray[np.float64]) -> Callable[[], object]:
    """A Newton iteration of the half: forces, tangent, factors and a direction, one side held."""
    held = replace(interface, node_sets={"side": np.flatnonzero(interface.nodes[:, 0] == 0.0).astype(np.int32)})
    boundary = [{"at": "side", "u_x": 0.0, "u_y": 0.0}]
    spec = {"half": "elastic", "format": 2, "materials": {"m": {"E": 2e11, "nu": 0.3}},
            "bodies": {"b": {"material": "m"}}, "boundary": boundary, "pairs": {}}
    system = system_of(held, parse_elastic(held, spec))
    n_fixed = system.constraints.fixed.size
    loading = Loading(system.moduli(np.full(len(u), 300.0)), np.zeros(n_fixed), np.empty(0), None)
    here = u * interface.nodes[:, :1]
    return lambda: fresh_direction(system, system.balance(here, loading, tangent=True), loading, np.zeros(n_fixed))


def bare(K: csr_matrix, b: NDArray[np.float64], repeats: int) -> float:
    """PARDISO's factors and solve of the upper triangle of K on a known analysis [ms]."""
    half = csr_matrix(triu(K, format="csr"))
    half.sort_indices()
    handle, x = _Handle(POSITIVE, half.indptr, half.indices), np.empty_like(b)

    def both() -> None:
        handle.run(FACTOR, half.data)
        handle.run(SOLVE, half.data, b, x)

    return best(both, repeats)


def cold(names: tuple[str, ...]) -> float:
    """CPU seconds to compile the loops of some forms, less those of a process that finds them compiled."""
    code = ("import sys; sys.path.insert(0, sys.argv[1])\nimport numpy as np\n"
            "from mechanical import FORMS, square, steel, cells_of, Volume, Step\nfor name in sys.argv[2].split(','):\n"
            "    volume = Volume(cells_of(square(2), (FORMS[name],)), 9)\n"
            "    volume.evaluate(np.zeros((9, 2)), (steel(4),), Step(1.0), True)")
    with tempfile.TemporaryDirectory() as cache:
        seconds = []
        for _ in range(2):
            before = os.times()
            subprocess.run([sys.executable, "-c", code, str(Path(__file__).parent), ",".join(names)], check=True,
                           env=os.environ | {"NUMBA_CACHE_DIR": cache})
            after = os.times()
            seconds.append(after.children_user - before.children_user)
    return seconds[0] - seconds[1]


def exponent(rows: list[dict[str, float]], what: str) -> float:
    """Slope of log time against log unknowns, least squares."""
    return float(np.polyfit(*(np.log([row[key] for row in rows]) for key in ("unknowns", what)), 1)[0])


def chart(rows: list[dict[str, float]], path: Path) -> None:
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.2))
    n = [row["unknowns"] for row in rows]
    for what, style in (("elastic", "o-"), ("plastic", "s-"), ("enhanced", "^-"), ("superlu factor", "o--"),
                        ("pardiso factor", "s--")):
        axes.loglog(n, [row[what] for row in rows], style, label=what if "factor" in what else f"assembly, {what}")
    axes.set_xlabel("unknowns")
    axes.set_ylabel("CPU time [ms], one thread")
    axes.legend()
    axes.grid(True, which="both", alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})  # equal numbers make equal files


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the two smaller meshes, few repeats")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--chart", type=Path, help="draw time against unknowns, SVG")
    args = parser.parse_args()
    sizes = CELLS[:2] if args.quick else CELLS
    rows = [measure(n, 3 if args.quick else 7) for n in sizes]
    names = [name for name in rows[0] if name != "unknowns"]
    print(table([{"ms": name, **{f"{row['unknowns']:.0f}": f"{row[name]:.2f}" for row in rows},
                  "exponent": f"{exponent(rows, name):.2f}"} for name in names]))
    over = [row["pardiso iteration"] / row["floor"] for row in rows]
    print("an elastic iteration with PARDISO over the floor: " + ", ".join(f"{x:.2f}" for x in over))
    seconds = {"elastic": cold(("elastic",)), "all": cold(tuple(FORMS))}
    print(f"cold: {seconds['elastic']:.1f} s of CPU to compile for elastic scenes, {seconds['all']:.1f} s for all")
    if args.json:
        args.json.write_text(json.dumps({"rows": rows, "cold": seconds}, indent=1))
    if args.chart:
        chart(rows, args.chart)


if __name__ == "__main__":
    main()
