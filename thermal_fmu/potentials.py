"""Heat flows down its potential U = int k dT: q = -k grad T = -grad U (Kirchhoff's transformation; Carslaw & Jaeger,
Conduction of Heat in Solids, section 1.6).

Cells know U at their nodes, by the exact integral of k, and take it linear between them as they do T where k is
constant.  So a k that changes its value within a few kelvin conducts right however many kelvin a cell spans, and a
steady flow through bodies of one material is as exact as with constant k.  By k at points of cells, what lies between
these points is not seen: where k rises 30-fold within 4 K, cells of 40 K carried 13 % too little through a wall.  Each
coupling of two nodes is that by geometry times the mean of k between their temperatures: its sign is not k's.

Along two axes, and of two phases, each has a potential of its own; what lies between phases is mixed at points by f_s.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from contact.half.functions import CellQuadrature, Property
from thermal_fmu.kernels import at_points
from thermal_fmu.problem import Conductivity, Phased

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Slots = NDArray[np.int64]


class Cells(Protocol):
    """What is asked of a block of cells.  nodes : (m,).  cells : (ne, nn) nodes, own_nodes : as positions in nodes."""

    @property
    def nodes(self) -> NDArray[np.int32]: ...

    @property
    def cells(self) -> NDArray[np.int32]: ...

    @property
    def own_nodes(self) -> NDArray[np.intp]: ...

    @property
    def table(self) -> CellQuadrature: ...


@dataclass(frozen=True)
class Potential:
    """U : (ne, nn) at the nodes of cells [W/m], from that of one of them on.  k : (ne, nn) dU/dT there [W/mK].

    Where k is constant U is T [K] and k is None: whoever asks multiplies by the constant.
    """

    U: Floats
    k: Floats | None


def potential(k: Property, block: Cells, T: Floats) -> Potential:
    """Return the potential of one property at T : (n,) [K]."""
    if k.is_constant:
        return Potential(T[block.cells], None)
    own = T[block.nodes]
    # fault: the potential of the mean k -> U = k(np.full(1, own.mean())) * (own - own[0]) |
    #   thermal_fmu/test_steep_conductivity
    U = k.increase(np.full(own.size, own[0]), own)
    return Potential(U[block.own_nodes], k(own)[block.own_nodes])


@dataclass(frozen=True)
class Flow:
    """A part of the heat flux, -K grad U.

    by : the potential.  K : (ne, nq, 3) at quadrature points, components xx, xy, yy: the directions [1], or the whole
    conductivity [W/mK] where U is T.  K_f : the derivative of K by the solid fraction.
    """

    by: Potential
    K: Floats
    K_f: Floats


def flows(k: Conductivity, block: Cells, T: Floats, f_s: Floats | None, turn: Floats | None) -> Iterator[Flow]:
    """Yield the parts of the heat flux, of each axis and of each phase.

    T, f_s : (n,) [K], [1]; None: all is solid.  turn : (ne, nq) of the material [rad]; None: not turned.
    """
    N = block.table.N
    f_q = None if f_s is None else at_points(f_s, block.cells, N)
    axes = [k.k_1] if k.k_2 is None else [k.k_1, k.k_2]
    if all(p.solid.is_constant and p.liquid.is_constant for p in axes):
        # T_q sets nothing but the shape.
        whole = tensors(k, np.empty((len(block.cells), len(N))), f_q, turn)
        yield Flow(potential(axes[0].solid, block, T), whole.K, whole.K_f)
        return
    for axis, along in zip(axes, directions(k, (len(block.cells), len(N)), turn), strict=True):
        yield from _of_phases(axis, block, T, f_q, along)


def _of_phases(axis: Phased, block: Cells, T: Floats, f_q: Floats | None, along: Floats) -> Iterator[Flow]:
    if axis.is_one or f_q is None:
        yield _flow(axis.solid, block, T, along, np.zeros(along.shape))
        return
    # fault: a liquid flows down the potential of the solid -> for phase, share, change in ((axis.solid, f_q, 1.0),
    #   (axis.solid, 1.0 - f_q, -1.0)): | thermal_fmu/test_steep_conductivity
    for phase, share, change in ((axis.solid, f_q, 1.0), (axis.liquid, 1.0 - f_q, -1.0)):
        yield _flow(phase, block, T, share[:, :, None] * along, change * along)


def _flow(k: Property, block: Cells, T: Floats, K: Floats, K_f: Floats) -> Flow:
    by = potential(k, block, T)
    scale = 1.0 if k.constant is None else k.constant
    return Flow(by, scale * K, scale * K_f)


# Conductivity at points


@dataclass(frozen=True)
class Tensors:
    """Conductivity tensors at quadrature points, with their derivative by solid fraction.

    K, K_f : (ne, nq, 3), components xx, xy, yy of k and dk/df_s [W/mK].
    """

    K: Floats
    K_f: Floats


def tensors(k: Conductivity, T: Floats, f_s: Floats | None, turn: Floats | None) -> Tensors:
    """Evaluate the conductivity tensor K = k_1 a a' + k_2 b b', a at angle + turn to x and b across it.

    T : (ne, nq) [K].  f_s : (ne, nq) solid fraction [1]; None: solid.  turn : (ne, nq) of the material [rad]; None: not
    turned.
    """
    axes = [k.k_1] if k.k_2 is None else [k.k_1, k.k_2]
    parts = list(zip(axes, directions(k, T.shape, turn), strict=True))
    return Tensors(np.sum([axis(T, f_s)[:, :, None] * along for axis, along in parts], axis=0),
                   np.sum([axis.phase_slope(T)[:, :, None] * along for axis, along in parts], axis=0))


def directions(k: Conductivity, shape: tuple[int, ...], turn: Floats | None) -> list[Floats]:
    """Return a a' and b b', (ne, nq, 3) each as xx, xy, yy [1], a at angle + turn to x; of an isotropic k one, I.

    shape : (ne, nq).  turn : (ne, nq) of the material [rad]; None: not turned.
    """
    if k.k_2 is None:
        return [np.broadcast_to(np.array([1.0, 0.0, 1.0]), (*shape, 3))]
    # fault: axes turn the other way -> angle = np.broadcast_to(k.angle if turn is None else k.angle - turn, shape) |
    #   thermal_fmu/test_thermal_anisotropy::test_axes_turn_with_the_material
    angle = np.broadcast_to(k.angle if turn is None else k.angle + turn, shape)
    c, s = np.cos(angle), np.sin(angle)
    # fault: skewed axes without their skew -> return [np.stack([c * c, -c * s, s * s], axis=-1), np.stack([s * s, c *
    #   s, c * c], axis=-1)] | thermal_fmu/test_thermal_anisotropy::test_a13_patch_with_skewed_axes
    return [np.stack([c * c, c * s, s * s], axis=-1), np.stack([s * s, -c * s, c * c], axis=-1)]


# The matrix of what flows

# Temperatures this close are one: what divides differences of potential by them is rounding.
SAME_T = 1e-6


@kernel
def add_secant(T: Floats, cells: Ints, G: Floats, K_q: Floats, U: Floats, k: Floats, slots: Slots, scale: float,
               data: Floats) -> None:
    """Add scale times the matrix S with S T = what flows by U: couplings by geometry times the mean of k between T.

    T : (n,) [K].  cells : (ne, nn).  G : (ne, nq, nn, 2) [1/m].  K_q : (ne, nq, 3) directions times dV [m3].  U, k :
    (ne, nn) potential at the nodes of cells [W/m] and dU/dT [W/mK].  slots : (ne, nn, nn).  data : (nnz,) [W/K].
    """
    ne, nn = cells.shape
    for e in range(ne):
        for i in range(nn):
            for j in range(i):
                dot = 0.0
                for q in range(K_q.shape[1]):
                    xx, xy, yy = K_q[e, q]
                    dot += G[e, q, j, 0] * (xx * G[e, q, i, 0] + xy * G[e, q, i, 1])
                    dot += G[e, q, j, 1] * (xy * G[e, q, i, 0] + yy * G[e, q, i, 1])
                dT = T[cells[e, j]] - T[cells[e, i]]
                mean = 0.5 * (k[e, i] + k[e, j])
                if abs(dT) > SAME_T:
                    # fault: the secant of a steep k is its slope -> mean = mean |
                    #   thermal_fmu/test_steep_conductivity
                    mean = (U[e, j] - U[e, i]) / dT
                part = scale * dot * mean
                data[slots[e, i, j]] += part
                data[slots[e, j, i]] += part
                data[slots[e, i, i]] -= part
                data[slots[e, j, j]] -= part
