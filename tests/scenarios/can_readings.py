"""What is read from a run of scenarios/aluminium_can.yaml: gap, pressure, conductance and heat flux along the wall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler import Results
from coupler.record.vtkhdf import FieldReader

Array = NDArray[np.float64]
RADIUS, HEIGHT = 0.05, 0.15
K_G, G_M, H_CLOSED, H_PRESSURE, EXPONENT, P_MAX = 0.06, 30e-6, 2000.0, 8000.0, 0.95, 2.348e6
# The node in the corner belongs to both pairs: what it bears with this gap [m] to the wall, the floor gives it.
TOUCH = 5e-6
RHO, GRAVITY = 2375.0, 9.81
SIGMA, EMISSIVITIES, D_NEAR, D_FAR = 5.670374419e-8, (0.1, 0.8), 1e-3, 5e-3
T_REF, T_POURED = 933.0, 940.0
ALPHA_T, ALPHA = (300.0, 500.0, 700.0, 900.0, 933.0), (27.72e-6, 29.24e-6, 31.07e-6, 33.0e-6, 33.0e-6)


@dataclass(frozen=True, eq=False)
class CanRun:
    """Frames of a run at times t : (n,) [s]; m nodes of the casting's side, from its bottom corner up.

    z : (m,) [m] reference heights.  gap : (n, m) [m] across to the wall, from where the nodes are.  p : (n, m) [Pa].
    h : (n, m) [W/m2K] of gas and touch.  flux : (n, m) [W/m2] into the wall, radiation with it.
    base_r, base_gap : (k,), (n, k) [m] the same of the casting's bottom.  volume : (n,) the casting's, over the
    poured one; unheated : the same with the thermal part taken out.  solid_t, solid : every window's solid fraction.
    """

    t: Array
    z: Array
    gap: Array
    p: Array
    h: Array
    flux: Array
    base_r: Array
    base_gap: Array
    base_p: Array
    volume: Array
    unheated: Array
    solid_t: Array
    solid: Array

    @property
    def solid_at(self) -> float:
        """[s] when the last of it is solid, between the two windows that enclose it."""
        k = int(np.argmax(self.solid >= 1.0 - 1e-9))
        if self.solid[k] < 1.0 - 1e-9:
            raise ValueError("the run ends before all is solid")
        return float(self.solid_t[k - 1] + self.solid_t[k]) / 2

    def at(self, values: Array, t: float) -> Array:
        """values : (n, ...) at the frame nearest to t [s]."""
        return np.asarray(values[int(np.argmin(abs(self.t - t)))])


def read_can(results: Results) -> CanRun:
    """All frames of a run.  The casting is the first body, so its nodes come first."""
    with (FieldReader(results.field_files["mechanical"]) as mechanical,
          FieldReader(results.field_files["thermal"]) as thermal):
        X = mechanical.points(0) - mechanical.point_field("u", 0)[:, :2]
        melt = mechanical.quads[mechanical.cell_field("body", 0) == 0]
        own = np.unique(melt)
        side = _line(X, own[abs(X[own, 0] - RADIUS) < 1e-9], 1)
        base = _line(X, own[abs(X[own, 1]) < 1e-9], 0)
        others = np.setdiff1d(np.arange(len(X)), own)
        wall = _line(X, others[(abs(X[others, 0] - RADIUS) < 1e-9) & (X[others, 1] > -1e-9)], 1)
        floor = _line(X, others[(abs(X[others, 1]) < 1e-9) & (X[others, 0] < RADIUS + 1e-9)], 0)
        frames = [_frame(mechanical, thermal, k, (side, wall, base, floor, melt)) for k in range(len(mechanical.times))]
        t = mechanical.times
    columns = {name: np.array([f[name] for f in frames]) for name in frames[0]}
    volume, hot = columns.pop("volume"), columns.pop("hot")
    solid_t, solid = results.probe("solid")
    return CanRun(t=t, z=X[side, 1], base_r=X[base, 0], volume=volume / volume[0],
                  unheated=(volume / hot) / (volume[0] / hot[0]), solid_t=solid_t, solid=solid, **columns)


def _frame(mechanical: FieldReader, thermal: FieldReader, k: int, lines: tuple[Any, ...]) -> dict[str, Any]:
    side, wall, base, floor, melt = lines
    x, T, p = mechanical.points(k), thermal.point_field("T", k), mechanical.point_field("p", k)
    gap = np.interp(x[side, 1], x[wall, 1], x[wall, 0]) - x[side, 0]
    T_wall = np.interp(x[side, 1], x[wall, 1], T[wall])
    p_side = np.where(gap < TOUCH, p[side], 0.0)
    h = conductance(gap, p_side)
    v = volumes(x[melt])
    T_cell = T[melt].mean(axis=1)
    return {"gap": gap, "p": p_side, "h": h, "flux": h * (T[side] - T_wall) + near_radiation(gap, T[side], T_wall),
            "base_gap": x[base, 1] - np.interp(x[base, 0], x[floor, 0], x[floor, 1]), "base_p": p[base],
            "volume": v.sum(), "hot": _heated(v, T_cell)}


def _heated(v: Array, T: Array) -> float:
    """The volume over what it would be at T_REF: (1 + alpha (T - T_ref))^3, in the mean over the cells."""
    stretch = 1 + np.interp(T, ALPHA_T, ALPHA) * (T - T_REF)
    return float(v.sum() / (v / stretch**3).sum())


def _line(X: Array, nodes: NDArray[np.integer], axis: int) -> NDArray[np.integer]:
    return nodes[np.argsort(X[nodes, axis])]


def conductance(gap: Array, p: Array) -> Array:
    """h [W/m2K]: 2000 + 8000 (p/1 MPa)^.95 where it presses, k_g/(g + g_m) where it does not."""
    closed = H_CLOSED + H_PRESSURE * (np.clip(p, 0.0, P_MAX) / 1e6) ** EXPONENT
    return np.where(p > 0.0, closed, K_G / (np.maximum(gap, 0.0) + G_M))


def near_radiation(gap: Array, T_a: Array, T_b: Array) -> Array:
    """[W/m2] from a to b: parallel plates, fading to nothing over the gaps D_NEAR to D_FAR."""
    both = 1 / sum((1 / e for e in EMISSIVITIES), -1.0)
    return np.asarray(np.clip((D_FAR - gap) / (D_FAR - D_NEAR), 0, 1) * SIGMA * both * (T_a**4 - T_b**4))


def volumes(x: Array) -> Array:
    """(n,) [m3] of the rings that quads with corners x : (n, 4, 2) sweep, each as two triangles (Pappus)."""
    total = np.zeros(len(x))
    for tri in ((0, 1, 2), (0, 2, 3)):
        a, b, c = (x[:, i] for i in tri)
        area = ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])) / 2
        total += 2 * np.pi * area * (a[:, 0] + b[:, 0] + c[:, 0]) / 3
    return total


def opening_times(can: CanRun) -> Array:
    """(m,) [s] when each node of the side first bears nothing; NaN if it always does."""
    free = can.p <= 0.0
    return np.where(free.any(axis=0), can.t[np.argmax(free, axis=0)], np.nan)


def flips(can: CanRun) -> NDArray[np.integer]:
    """(m,) how often each node of the side began or ceased to touch."""
    return np.asarray(abs(np.diff((can.p > 0.0).astype(int), axis=0)).sum(axis=0))


def touching(can: CanRun, k: int) -> float:
    """Share of the side's height that touches at frame k; a node stands for half of each edge beside it."""
    return float(np.trapezoid((can.p[k] > 0.0).astype(float), can.z) / (can.z[-1] - can.z[0]))


def mean_stress(results: Results) -> tuple[float, float]:
    """Of the stress left at the end: the means over the casting of s_rr + s_tt and of s_zz, over those of their sizes.

    Stress that balances itself has none (virtual work of the displacements r and z); s_zz less what the weight makes.
    """
    with FieldReader(results.field_files["mechanical"]) as mechanical:
        last = len(mechanical.times) - 1
        own = mechanical.cell_field("body", 0) == 0
        cells, stress = mechanical.quads[own], mechanical.cell_field("sigma", last)[own]
        X, x = mechanical.points(0) - mechanical.point_field("u", 0)[:, :2], mechanical.points(last)
    v, z = volumes(x[cells]), x[cells, 1].mean(axis=1) - x[cells, 1].min()
    weight = RHO * GRAVITY * float(volumes(X[cells]) @ z)
    rr, zz, tt = (v * stress[:, i] for i in range(3))
    return (float((rr + tt).sum() / (abs(rr) + abs(tt)).sum()), float((zz.sum() + weight) / abs(zz).sum()))
