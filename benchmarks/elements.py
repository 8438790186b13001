"""Would elements of second order pay?  Error against unknowns and against time, Q1 and P1 against Q2 and P2.

    python benchmarks/elements.py [--quick] [--json FILE] [--chart FILE.svg]

The half has bilinear quads and linear triangles.  Here the same heat equation is solved apart from it, with elements of
both orders from scikit-fem, one assembly for all of them, and the half's direct solver:
  smooth  NAFEMS T3 (A5): a wave from one face.  Largest error at a node, at 32 s; 200 steps, Crank-Nicolson.  The error
          of the steps is taken out by a run of half their size.
  corner  NAFEMS T4 (A6): where the held face meets the cooled one the flux has a logarithm.  Error at (.6, .2).
  front   the two-phase Stefan problem over a mushy range of 10 K, one dimension, 100 steps of backward Euler.  Mean
          error over .1 m against 4 000 linear cells with the same steps.  "P1 nodal": storage at nodes, as in the half.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scene import pin, table
from scipy.sparse import csr_matrix, diags_array, vstack
from thermal_cases import ZERO, Stefan, nafems_t3

from contact.half.linalg import factorise

Floats = NDArray[np.float64]
KINDS = {"Q1": (skfem.MeshQuad, skfem.ElementQuad1), "Q2": (skfem.MeshQuad, skfem.ElementQuad2),
         "P1": (skfem.MeshTri, skfem.ElementTriP1), "P2": (skfem.MeshTri, skfem.ElementTriP2)}
MUSH = 10.0  # K
T4_POINT, T4_EXACT = (0.6, 0.2), 18.25375654  # m, degC


@dataclass(frozen=True)
class Cost:
    """error [K].  seconds : of CPU, assembly and solves."""

    case: str
    kind: str
    unknowns: int
    error: float
    seconds: float


@dataclass(frozen=True)
class Space:
    """N, D : (nq, n) and (dim nq, n), from nodal values to values and gradients at quadrature points.

    dx : (nq,) weights.  x : (dim, n) nodes [m].
    """

    N: csr_matrix
    D: csr_matrix
    dx: Floats
    x: Floats

    def mass(self, c: Floats | float) -> csr_matrix:
        return csr_matrix(self.N.T @ diags_array(self.dx * c) @ self.N)

    def stiffness(self, k: Floats | float) -> csr_matrix:
        dim = self.D.shape[0] // self.dx.size
        return csr_matrix(self.D.T @ diags_array(np.tile(self.dx * k, dim)) @ self.D)


def space(basis: Any) -> Space:
    """Of a basis of scikit-fem."""
    dx = basis.dx.ravel()
    rows = np.arange(dx.size).reshape(basis.dx.shape)
    shape = (dx.size, basis.N)

    def operator(of: Callable[[Any], Floats]) -> csr_matrix:
        parts = [(np.broadcast_to(of(basis.basis[i][0]), rows.shape).ravel(), rows.ravel(),
                  np.repeat(basis.element_dofs[i], rows.shape[1])) for i in range(basis.Nbfun)]
        v, r, c = (np.concatenate(p) for p in zip(*parts, strict=True))
        return csr_matrix((v, (r, c)), shape=shape)

    dim = basis.mesh.dim()
    N = operator(lambda f: f.value)
    is_cell = isinstance(basis, skfem.CellBasis) and not isinstance(basis, skfem.FacetBasis)
    D = vstack([operator(lambda f, j=j: f.grad[j]) for j in range(dim)], format="csr") if is_cell else N
    return Space(N, D, dx, basis.doflocs)


def held_solve(A: csr_matrix, held: NDArray[np.bool_]) -> Callable[[Floats, Floats], Floats]:
    """Solve A x = b with x given where held."""
    free = np.flatnonzero(~held)
    part = csr_matrix(A[free][:, free])
    solve, rest = factorise(part, symmetric=True), csr_matrix(A[free][:, np.flatnonzero(held)])

    def call(b: Floats, given: Floats) -> Floats:
        x = np.array(given)
        x[free] = solve(b[free] - rest @ given[held])
        return x

    return call


def smooth(kind: str, m: int) -> Cost:
    """A5 on m cells along the strip."""
    begun = process_time()
    case = nafems_t3()
    L, rate = 0.1, 440.5 * 7200.0
    make, element = KINDS[kind]
    mesh = make.init_tensor(np.linspace(0.0, L, m + 1), np.linspace(0.0, L / 8.0, m // 8 + 1))
    parts = space(skfem.CellBasis(mesh, element()))
    M, K, x = parts.mass(rate), parts.stiffness(35.0), parts.x[0]
    far, held = np.isclose(x, L), np.isclose(x, L) | np.isclose(x, 0.0)

    def run(steps: int) -> Floats:
        dt = case.end / steps
        solve, T = held_solve(csr_matrix(M + 0.5 * dt * K), held), np.zeros(x.size)
        explicit = csr_matrix(M - 0.5 * dt * K)
        for i in range(steps):
            given = np.where(far, 100.0 * math.sin(math.pi * (i + 1) * dt / 40.0), 0.0)
            T = solve(explicit @ T, given)
        return T

    coarse = run(200)
    seconds = process_time() - begun
    T = (4.0 * run(400) - coarse) / 3.0
    return Cost("smooth", kind, int(x.size), float(np.abs(T - (case.exact(x) - ZERO)).max()), seconds)


def corner(kind: str, m: int) -> Cost:
    """A6 on 3 m x 5 m cells of one size."""
    begun = process_time()
    make, element = KINDS[kind]
    mesh = make.init_tensor(np.linspace(0.0, 0.6, 3 * m + 1), np.linspace(0.0, 1.0, 5 * m + 1))
    cells = skfem.CellBasis(mesh, element())
    film = skfem.FacetBasis(mesh, element(),
                            facets=mesh.facets_satisfying(lambda x: np.isclose(x[0], 0.6) | np.isclose(x[1], 1.0)))
    A = csr_matrix(space(cells).stiffness(52.0) + space(film).mass(750.0))
    held = np.isclose(cells.doflocs[1], 0.0)
    T = held_solve(A, held)(np.zeros(cells.N), np.where(held, 100.0, 0.0))
    at = np.argmin(np.hypot(cells.doflocs[0] - T4_POINT[0], cells.doflocs[1] - T4_POINT[1]))
    return Cost("corner", kind, int(cells.N), float(abs(T[at] - T4_EXACT)), process_time() - begun)


def enthalpy(T: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """rho h [J/m3], its slope, k [W/mK], its slope, at T [K]: a straight line through the mush."""
    s = Stefan()
    low, high = s.T_m - 0.5 * MUSH, s.T_m + 0.5 * MUSH
    f = np.clip((T - low) / MUSH, 0.0, 1.0)
    mushy = (f > 0.0) & (f < 1.0)
    jump = s.rho * (s.L + 0.5 * (s.c_s + s.c_l) * MUSH)
    h = s.rho * s.c_s * np.minimum(T - low, 0.0) + jump * f + s.rho * s.c_l * np.maximum(T - high, 0.0)
    slope = np.where(mushy, jump / MUSH, s.rho * np.where(f > 0.5, s.c_l, s.c_s))
    return h, slope, s.k_s + (s.k_l - s.k_s) * f, np.where(mushy, (s.k_l - s.k_s) / MUSH, 0.0)


def freeze(kind: str, m: int, steps: int = 100) -> tuple[Floats, Floats]:
    """Nodes x and T at 10 s on m cells of one size."""
    s = Stefan()
    mesh = skfem.MeshLine(np.linspace(0.0, 0.15, m + 1))
    element = skfem.ElementLineP2() if kind == "P2" else skfem.ElementLineP1()
    flow = space(skfem.CellBasis(mesh, element))
    nodal = {"quadrature": (np.array([[0.0, 1.0]]), np.array([0.5, 0.5]))} if kind == "P1 nodal" else {}
    storage = space(skfem.CellBasis(mesh, element, **nodal))
    x, dt = flow.x[0], 10.0 / steps
    free = np.flatnonzero(x > 0.0)
    T = np.where(x > 0.0, s.melt, s.wall)

    def residual(T: Floats, before: Floats) -> Floats:
        h, k = enthalpy(storage.N @ T)[0], enthalpy(flow.N @ T)[2]
        out: Floats = storage.N.T @ (storage.dx * (h - before)) + dt * (flow.D.T @ (flow.dx * k * (flow.D @ T)))
        return out[free]

    for _ in range(steps):
        before = enthalpy(storage.N @ T)[0]
        r = residual(T, before)
        scale = float(np.abs(r).sum())
        for _ in range(100):
            slope, (k, dk) = enthalpy(storage.N @ T)[1], enthalpy(flow.N @ T)[2:]
            J = storage.mass(slope) + dt * flow.stiffness(k)
            J = csr_matrix(J + dt * flow.D.T @ diags_array(flow.dx * dk * (flow.D @ T)) @ flow.N)[free][:, free]
            d = factorise(csr_matrix(J), symmetric=False)(-r)
            share = 1.0
            while share > 1e-3:
                trial = T.copy()
                trial[free] += share * d
                after = residual(trial, before)
                if np.abs(after).sum() <= (1.0 - 1e-4 * share) * np.abs(r).sum():
                    break
                share *= 0.5
            T, r = trial, after
            if np.abs(r).sum() <= 1e-8 * scale:
                break
        else:
            raise RuntimeError(f"front: {kind} on {m} cells does not converge")
    order = np.argsort(x)
    return x[order], T[order]


def front(kind: str, m: int, reference: tuple[Floats, Floats]) -> Cost:
    """The Stefan problem against a reference, over .1 m."""
    begun = process_time()
    x, T = freeze(kind, m)
    seconds = process_time() - begun
    at = np.linspace(0.0, 0.1, 2001)
    # Between nodes the quadratic is taken as straight lines over half cells: the front lies in one of them.
    error = np.abs(np.interp(at, x, T) - np.interp(at, *reference)).mean()
    return Cost("front", kind, int(x.size), float(error), seconds)


def measure(quick: bool) -> list[Cost]:
    """All cases; the smallest mesh is solved once before, so that imports and caches are paid."""
    halvings = 3 if quick else 5
    found = []
    for case, kinds, coarsest in ((smooth, KINDS, 8), (corner, KINDS, 1)):
        for kind in kinds:
            case(kind, coarsest)
            first = coarsest * (1 if kind.endswith("2") else 2)
            found += [case(kind, first * 2**i) for i in range(halvings)]
    reference = freeze("P1 nodal", 1000 if quick else 4000)
    for kind in ("P1 nodal", "P1", "P2"):
        first = 10 if kind == "P2" else 20
        found += [front(kind, first * 2**i, reference) for i in range(halvings)]
    return found


def rows(costs: list[Cost]) -> list[dict[str, str]]:
    """A row a case and kind; order: against unknowns^(1/dimension)."""
    out = []
    for case, kind in dict.fromkeys((c.case, c.kind) for c in costs):
        own = [c for c in costs if (c.case, c.kind) == (case, kind)]
        dim = 1 if case == "front" else 2
        orders = [dim * math.log(a.error / b.error) / math.log(b.unknowns / a.unknowns) for a, b in pairwise(own)]
        out.append({"case": case, "kind": kind, "unknowns": " ".join(str(c.unknowns) for c in own),
                    "error K": " ".join(f"{c.error:.1e}" for c in own),
                    "order": " ".join(f"{o:.1f}" for o in orders),
                    "CPU s": " ".join(f"{c.seconds:.3f}" for c in own)})
    return out


def chart(costs: list[Cost], path: Path) -> None:
    """Error against unknowns (above) and seconds (below), a column a case."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import NullFormatter

    plt.rcParams["svg.hashsalt"] = "slideline"  # equal numbers make equal files
    figure, axes = plt.subplots(2, 3, figsize=(9.0, 5.4), layout="constrained")
    colours = {"Q1": "C0", "P1": "C1", "P1 nodal": "C4", "Q2": "C2", "P2": "C3"}
    for column, case in enumerate(("smooth", "corner", "front")):
        for row, (what, label) in enumerate((("unknowns", "unknowns"), ("seconds", "CPU time [s]"))):
            axis, own = axes[row, column], [c for c in costs if c.case == case]
            for kind in dict.fromkeys(c.kind for c in own):
                mine = [c for c in own if c.kind == kind]
                axis.loglog([getattr(c, what) for c in mine], [c.error for c in mine], marker="o", ms=4,
                            color=colours[kind], label=kind)
            if row == 0:
                n, dim = np.array([min(c.unknowns for c in own), max(c.unknowns for c in own)]), 1 + (column < 2)
                for order, style in ((2, ":"), (4, "--")):
                    axis.loglog(n, own[0].error * (n / own[0].unknowns) ** (-order / dim), style, color="grey",
                                label=f"order {order}")
            axis.set(xlabel=label, ylabel=f"{case}: error of T [K]",
                     ylim=(0.5 * min(c.error for c in own), 2.0 * max(c.error for c in own)))
            axis.xaxis.set_minor_formatter(NullFormatter())  # its labels would lie on each other
            axis.grid(True, which="both", alpha=0.3)
            axis.legend(frameon=False, fontsize=6)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three meshes of each")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--chart", type=Path, help="draw error against unknowns and time, SVG")
    args = parser.parse_args()
    costs = measure(args.quick)
    print(table(rows(costs)))
    if args.json:
        args.json.write_text(json.dumps([asdict(c) for c in costs], indent=1))
    if args.chart:
        chart(costs, args.chart)


if __name__ == "__main__":
    main()
