"""The cells of a scene: their blocks, geometry on given coordinates, conduction and storage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.elements import Table, table_of
from contact.half.interface import Interface
from contact.half.sparse import Pattern, pattern_of
from thermal_fmu.kernels import add_conduction, add_storage, at_points, shape_gradients
from thermal_fmu.spec import Body

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Slots = NDArray[np.int64]


class InvertedCellError(ArithmeticError):
    """The incoming coordinates turn a cell inside out."""


class BadPropertyError(ArithmeticError):
    """A conductivity or heat capacity is not positive at a temperature that was met."""


@dataclass(frozen=True)
class Block:
    """The cells of one kind in one body.

    cells : (ne, nn) nodes.  numbers : (ne,) number e of each cell, 0-based, quads before triangles as in
    interface.h5.  slots : (ne, nn, nn) places in the matrix data.
    """

    body: int
    table: Table
    cells: Ints
    numbers: NDArray[np.intp]
    slots: Slots


@dataclass(frozen=True)
class Volume:
    """All blocks of a scene and the matrix pattern of their nodes."""

    n: int
    n_cells: int
    axisymmetric: bool
    bodies: tuple[str, ...]
    blocks: tuple[Block, ...]
    pattern: Pattern


@dataclass(frozen=True)
class Shape:
    """A block on given coordinates.  G : (ne, nq, nn, 2) [1/m].  dV : (ne, nq) [m3], per metre when plane."""

    G: Floats
    dV: Floats


def volume_of(interface: Interface) -> Volume:
    """The blocks of an interface's mesh, body by body, quads before triangles."""
    found = []
    first = 0
    for kind, cells, body in (("quad", interface.quads, interface.quad_body),
                              ("triangle", interface.triangles, interface.triangle_body)):
        for b in range(len(interface.bodies)):
            own = np.flatnonzero(body == b)
            if own.size:
                found.append((kind, b, np.ascontiguousarray(cells[own]), first + own))
        first += len(cells)
    n = len(interface.nodes)
    pattern = pattern_of(n, *(cells for _, _, cells, _ in found))
    blocks, start = [], 0
    for kind, b, cells, numbers in found:
        nn = cells.shape[1]
        slots = pattern.slots[start:start + cells.size * nn].reshape(len(cells), nn, nn).astype(np.int64)
        blocks.append(Block(b, table_of(kind), cells, numbers, slots))
        start += cells.size * nn
    return Volume(n, first, interface.axisymmetric, interface.bodies, tuple(blocks), pattern)


def shapes_of(volume: Volume, x: Floats) -> tuple[Shape, ...]:
    """Every block on coordinates x : (n, 2) [m].  Raises InvertedCellError naming cell (1-based) and body."""
    shapes = []
    for block in volume.blocks:
        nq, nn = block.table.N.shape
        shape = Shape(np.empty((len(block.cells), nq, nn, 2)), np.empty((len(block.cells), nq)))
        t = block.table
        bad = shape_gradients(x, block.cells, t.N, t.dN, t.w, volume.axisymmetric, shape.G, shape.dV)
        if bad >= 0:
            where = " or reaches across the axis" if volume.axisymmetric else ""
            raise InvertedCellError(f"cell {block.numbers[bad] + 1} of body {volume.bodies[block.body]} is "
                                    f"turned inside out{where} by the coordinates that came in")
        shapes.append(shape)
    return tuple(shapes)


def spread(volume: Volume, shapes: Sequence[Shape], per_volume: Sequence[Floats]) -> Floats:
    """(n,) nodal values sum_q N_i s dV of densities s : one (ne,) array or scalar array a block."""
    out = np.zeros(volume.n)
    for block, shape, s in zip(volume.blocks, shapes, per_volume, strict=True):
        share = (shape.dV @ block.table.N) * np.reshape(s, (-1, 1))
        out += np.bincount(block.cells.ravel(), weights=share.ravel(), minlength=volume.n)
    return out


def conduct(volume: Volume, shapes: Sequence[Shape], bodies: Sequence[Body], T: Floats, f: Floats,
            scale: float, data: Floats) -> None:
    """f -= the heat that leaves each node by conduction at T : (n,) [K];  data += scale * its derivative.

    Eq. (1).  Raises BadPropertyError.
    """
    for block, shape in zip(volume.blocks, shapes, strict=True):
        k = bodies[block.body].material.k
        T_q = np.empty(shape.dV.shape) if k.is_constant else at_points(T, block.cells, block.table.N)
        k_q = k(T_q)
        if not k.is_constant:
            _demand_positive("conductivity", k_q, bodies[block.body].name)
        add_conduction(T, block.cells, block.table.N, shape.G, k_q * shape.dV, k.slope(T_q) * shape.dV, f,
                       block.slots, scale, data)


def store(volume: Volume, masses: Sequence[Floats], bodies: Sequence[Body], T0: Floats, T: Floats,
          S: Floats, data: Floats) -> Floats:
    """S += nodal increase of enthalpy from T0 to T : (n,) [J];  data += its derivative [J/K].

    masses : rho0 dV0 of each block, (ne, nq) [kg].  Returns (n_bodies,) increase of each body's enthalpy [J], summed
    over quadrature points, not over nodes.  Raises BadPropertyError.
    """
    total = np.zeros(len(bodies))
    for block, mass in zip(volume.blocks, masses, strict=True):
        c = bodies[block.body].material.c
        T_q = at_points(T, block.cells, block.table.N)
        dE_q = mass * c.increase(at_points(T0, block.cells, block.table.N), T_q)
        c_q = c(T_q)
        if not c.is_constant:
            _demand_positive("heat capacity", c_q, bodies[block.body].name)
        add_storage(block.cells, block.table.N, dE_q, mass * c_q, S, block.slots, data)
        total[block.body] += dE_q.sum()
    return total


def _demand_positive(what: str, values: Floats, body: str) -> None:
    if not (values > 0).all():
        raise BadPropertyError(f"the {what} of body {body} is {np.min(values):.6g} at a temperature that was met")
