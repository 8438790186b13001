"""Cells of a thermal scene: geometry on given coordinates, conduction, storage, and caches of what did not change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import CellQuadrature, table_of
from contact.half.gradients import shape_gradients
from contact.half.interface import Interface
from contact.half.linalg import Pattern, pattern_of
from thermal_fmu.kernels import add_conduction, add_conduction_tensor, turn_of
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.potentials import add_secant, flows, potential
from thermal_fmu.problem import ThermalBody
from thermal_fmu.surface_terms import at_nodes

Floats = NDArray[np.float64]


Ints = NDArray[np.int32]
Slots = NDArray[np.int64]


class InvertedMeshError(ArithmeticError):
    """Coordinates from outside turn a cell inside out."""


class BadPropertyError(ArithmeticError):
    """A property takes a value it must not have at a temperature that was met, as a conductivity that is not positive.
    """


@dataclass(frozen=True)
class CellBlock:
    """The cells of one kind in one part: a body, or a region of it.

    part : its number.  cells : (ne, nn) nodes.
    numbers : (ne,) number of each cell, 0-based, quads before triangles as in interface.h5.
    slots : (ne, nn, nn) places in the matrix data.  alone : whether the body has no other block.
    """

    body: int
    part: int
    table: CellQuadrature
    cells: Ints
    numbers: NDArray[np.intp]
    slots: Slots
    alone: bool

    @cached_property
    def places(self) -> Slots:
        """(n_places,) the places in the matrix data it reaches, ascending, each once."""
        return np.unique(self.slots)

    @cached_property
    def own_slots(self) -> Slots:
        """(ne, nn, nn) slots, as positions in places."""
        return np.searchsorted(self.places, self.slots)

    @cached_property
    def nodes(self) -> NDArray[np.int32]:
        """(m,) its nodes, ascending, each once."""
        return np.unique(self.cells)

    @cached_property
    def own_nodes(self) -> NDArray[np.intp]:
        """(ne, nn) cells, as positions in nodes."""
        return np.searchsorted(self.nodes, self.cells)

    @cached_property
    def diagonal(self) -> Slots:
        """(m,) places in the matrix data of the diagonal of its nodes."""
        out = np.empty(self.nodes.size, dtype=np.int64)
        out[self.own_nodes] = np.einsum("eii->ei", self.slots)
        return out


@dataclass(frozen=True)
class CellMesh:
    """All blocks of a scene and the matrix pattern of their n nodes."""

    n: int
    n_cells: int
    axisymmetric: bool
    bodies: tuple[str, ...]
    blocks: tuple[CellBlock, ...]
    pattern: Pattern


@dataclass(frozen=True)
class CellGeometry:
    """A block on given coordinates.

    dV : (ne, nq) [m3] of the quadrature points, per metre of depth when plane.  G : (ne, nq, nn, 2) gradients of shape
    functions [1/m] at the points of conduction, dC : (ne, nq) their [m3] (contact.half.gradients.spread_of).
    turn : (ne, nq) rotation of the material since the reference [rad], where its axes follow it.
    """

    G: Floats
    dV: Floats
    dC: Floats
    turn: Floats | None = None


@dataclass(frozen=True)
class ReferenceCells:
    """A block in the reference configuration.

    nodal_mass : (m,) sum_q N_i rho0 dV0 [kg] of the block's nodes.  G : (ne, nq, nn, 2) [1/m], where axes turn with the
    material.
    """

    nodal_mass: Floats
    G: Floats | None = None


@dataclass(frozen=True)
class MatrixEntries:
    """The entries of the matrix M + slope K while it is assembled.

    data : (nnz,) [J/K], empty where no matrix is asked for.  slope : factor of K [s].  filled : blocks, by their place
    in the mesh, whose entries are in data already.  secant : K is the matrix with K T what flows, not its derivative.
    """

    data: Floats
    slope: float
    filled: frozenset[int] = frozenset()
    secant: bool = False

    def of(self, b: int) -> Floats:
        """Return where block b adds its own entries: data, or an empty array where they are in it already."""
        return self.data[:0] if b in self.filled else self.data


def cell_mesh(interface: Interface) -> CellMesh:
    """Build the blocks of an interface's mesh, body by body, quads before triangles."""
    parts = []
    first, owner = 0, interface.part_body
    for kind, cells, part in (("quad", interface.quads, interface.quad_part),
                              ("triangle", interface.triangles, interface.triangle_part)):
        for p in range(len(interface.parts)):
            own = np.flatnonzero(part == p)
            if own.size:
                parts.append((kind, p, np.ascontiguousarray(cells[own]), first + own))
        first += len(cells)
    n = len(interface.nodes)
    pattern = pattern_of(n, *(cells for _, _, cells, _ in parts))
    blocks, start = [], 0
    for kind, p, cells, numbers in parts:
        nn, b = cells.shape[1], int(owner[p])
        slots = pattern.slots[start:start + cells.size * nn].reshape(len(cells), nn, nn).astype(np.int64)
        alone = [owner[of] for _, of, _, _ in parts].count(b) == 1
        # fault: blocks of one body overwrite each other's entries -> blocks.append(CellBlock(b, p, table_of(kind),
        #   cells, numbers, slots, True)) | thermal_fmu/test_thermal_caches
        blocks.append(CellBlock(b, p, table_of(kind), cells, numbers, slots, alone))
        start += cells.size * nn
    return CellMesh(n, first, interface.axisymmetric, interface.bodies, tuple(blocks), pattern)


def shapes_of(volume: CellMesh, x: Floats) -> tuple[CellGeometry, ...]:
    """Compute the geometry of every block on coordinates x : (n, 2) [m].

    Raises InvertedMeshError naming cell (1-based) and body.
    """
    return tuple(shape_of(volume, block, x) for block in volume.blocks)


def shape_of(volume: CellMesh, block: CellBlock, x: Floats) -> CellGeometry:
    """Compute the geometry of one block on coordinates x : (n, 2) [m].  Raises as shapes_of."""
    t = block.table
    nq, nn = t.N.shape
    ne = len(block.cells)
    shape = CellGeometry(np.empty((ne, nq, nn, 2)), np.empty((ne, nq)), np.empty((ne, nq)))
    bad = shape_gradients(x, block.cells, t.N, t.dN, t.w, volume.axisymmetric, shape.G, shape.dV, shape.dC)
    if bad >= 0:
        where = " or reaches across the axis" if volume.axisymmetric else ""
        raise InvertedMeshError(f"cell {block.numbers[bad] + 1} of body {volume.bodies[block.body]} is "
                                f"turned inside out{where} by the coordinates that came in")
    return shape


def spread(volume: CellMesh, shapes: Sequence[CellGeometry], per_volume: Sequence[Floats]) -> Floats:
    """Integrate densities s to the nodes: (n,) sum_q N_i s dV.

    per_volume : a block each, (ne,) one density a cell or (1,) one for all; the result has its unit times m3.
    """
    out = np.zeros(volume.n)
    for block, shape, s in zip(volume.blocks, shapes, per_volume, strict=True):
        nodal = (shape.dV @ block.table.N) * np.reshape(s, (-1, 1))
        out += at_nodes(block.cells, nodal, volume.n)
    return out


def spread_energies(volume: CellMesh, shapes: Sequence[CellGeometry], E: Floats) -> Floats:
    """Spread energies E : (n_cells,) [J] of cells, each even in its volume, to the nodes: (n,) [J]."""
    per_volume = [E[block.numbers] / shape.dV.sum(axis=1)
                  for block, shape in zip(volume.blocks, shapes, strict=True)]
    # fault: sign of E_M -> return -spread(volume, shapes, per_volume) | thermal_fmu/test_thermal_nonlinear
    return spread(volume, shapes, per_volume)


def reference_cells(volume: CellMesh, parts: Sequence[ThermalBody], X: Floats) -> tuple[ReferenceCells, ...]:
    """Compute masses, and gradients where axes turn, of every block on X : (n, 2) [m].  Raises InvertedMeshError."""
    out = []
    for block, shape in zip(volume.blocks, shapes_of(volume, X), strict=True):
        material = parts[block.part].material
        mass = at_nodes(block.own_nodes, (material.rho * shape.dV) @ block.table.N, block.nodes.size)
        out.append(ReferenceCells(mass, shape.G if material.k.turns else None))
    return tuple(out)


def with_turn(block: CellBlock, first: ReferenceCells, shape: CellGeometry, x: Floats) -> CellGeometry:
    """Return a geometry on x : (n, 2) [m] with the rotation of the material, where its axes follow it."""
    return shape if first.G is None else replace(shape, turn=turn_of(x, block.cells, first.G))


def conduct(volume: CellMesh, shapes: Sequence[CellGeometry], parts: Sequence[ThermalBody], at: NodalFields, f: Floats,
            into: MatrixEntries) -> None:
    """Add conduction, Eq. (1): f -= the heat that leaves each node;  entries += slope * its derivative by s.

    f : (n,) [W].  Raises BadPropertyError.
    """
    for b, (block, shape) in enumerate(zip(volume.blocks, shapes, strict=True)):
        material = parts[block.part].material
        data = into.of(b)
        if not material.k.is_plain or material.phase is not None:
            _conduct_tensor(block, shape, parts[block.part], at, f, replace(into, data=data))
            continue
        k = material.k.k_1.solid
        # fault: lagged conductivity -> by = potential(k, block, np.zeros_like(at.T) + 3.0) |
        #   thermal_fmu/test_thermal_nonlinear
        by = potential(k, block, at.T)
        w = (1.0 if k.constant is None else k.constant) * shape.dC
        if by.k is not None:
            _check_positive("conductivity", by.k, block, parts[block.part].name)
        # fault: derivative of k forgotten -> k_n = np.full(by.U.shape, 1.0 if by.k is None else by.k.mean()) |
        #   thermal_fmu/test_thermal_nonlinear
        k_n = np.ones(by.U.shape) if by.k is None else by.k
        secant = into.secant and by.k is not None
        add_conduction(by.U, block.cells, shape.G, w, k_n, f, block.slots, into.slope, data[:0] if secant else data)
        if secant and data.size:
            add_secant(at.T, block.cells, shape.G, w[:, :, None] * np.array([1.0, 0.0, 1.0]), by.U, k_n, block.slots,
                       into.slope, data)


def _conduct_tensor(block: CellBlock, shape: CellGeometry, body: ThermalBody, at: NodalFields, f: Floats,
                    into: MatrixEntries) -> None:
    dT = np.ones(at.T.size) if at.dT is None or into.secant else at.dT
    df = np.zeros(at.T.size) if at.df is None or into.secant else at.df
    dV = shape.dC[:, :, None]
    for flow in flows(body.material.k, block, at.T, at.f_s, shape.turn):
        k_n = np.ones(flow.by.U.shape) if flow.by.k is None else flow.by.k
        _check_positive("conductivity", k_n, block, body.name)
        secant = into.secant and flow.by.k is not None
        # fault: the derivative of a tensor left out -> by_s = k_n.mean() * dT[block.cells] |
        #   thermal_fmu/test_thermal_newton::test_newton_is_quadratic_on_smooth_problems
        by_s = k_n * dT[block.cells]
        add_conduction_tensor(flow.by.U, block.cells, block.table.N, shape.G, flow.K * dV, flow.K_f * dV, by_s, df, f,
                              block.slots, into.slope, into.data[:0] if secant else into.data)
        if secant and into.data.size:
            add_secant(at.T, block.cells, shape.G, flow.K * dV, flow.by.U, k_n, block.slots, into.slope, into.data)


def store(volume: CellMesh, references: Sequence[ReferenceCells], parts: Sequence[ThermalBody], s0: Floats, s: Floats,
          S: Floats, into: MatrixEntries) -> Floats:
    """Add storage: S += the increase of enthalpy from s0 to s;  entries += its derivative by s [J/K].

    s0, s : (n,) [K].  S : (n,) [J].  Heat is stored at the nodes, sum_q N_i rho0 dV0 h(s_i): shared storage would
    couple neighbours with the wrong sign in steps below h^2/6a, where a jump then undershoots, and a front inside a
    cell would make heat run backwards (Thomee, Galerkin Finite Element Methods for Parabolic Problems, ch. 15).
    Returns (n_bodies,) increase of each body's enthalpy [J], summed over the nodes.  Raises BadPropertyError.
    """
    total = np.zeros(len(volume.bodies))
    for b, (block, first) in enumerate(zip(volume.blocks, references, strict=True)):
        body, s_0, s_1 = parts[block.part], s0[block.nodes], s[block.nodes]
        change, c = body.material.phase, body.material.c.solid
        # fault: storage C(T) dT instead of enthalpy -> dh, c_1 = c(s_1) * (s_1 - s_0), c(s_1) |
        #   thermal_fmu/test_thermal_nonlinear
        dh, c_1 = c.increase(s_0, s_1), c(s_1)
        if change is not None:
            # fault: latent heat by the slope of h at the end: a large step loses it -> dh, c_1 = change.capacity(s_1) *
            #   (s_1 - s_0), change.capacity(s_1) | thermal_fmu/test_thermal_phase::test_a9_no_step_loses_latent_heat
            dh, c_1 = change.increase(s_0, s_1), change.capacity(s_1)
        if change is not None or not c.is_constant:
            _check_positive("heat capacity", c_1[block.own_nodes], block, body.name)
        dE = first.nodal_mass * dh
        S[block.nodes] += dE
        data = into.of(b)
        if data.size:
            data[block.diagonal] += first.nodal_mass * c_1
        total[block.body] += float(dE.sum())
    return total


def capacities(volume: CellMesh, references: Sequence[ReferenceCells], parts: Sequence[ThermalBody],
               s: Floats) -> Floats:
    """Return (n,) the heat capacities of the nodes [J/K], the derivative of what they store by s : (n,) [K]."""
    out = np.zeros(volume.n)
    for block, first in zip(volume.blocks, references, strict=True):
        material, own = parts[block.part].material, s[block.nodes]
        c = material.c.solid(own) if material.phase is None else material.phase.capacity(own)
        out[block.nodes] += first.nodal_mass * c
    return out


def _check_positive(what: str, values: Floats, block: CellBlock, body: str) -> None:
    """values : (ne, any) of the cells of a block."""
    if not (values > 0).all():
        e, at = np.unravel_index(np.argmin(np.where(np.isnan(values), -np.inf, values)), values.shape)
        raise BadPropertyError(f"the {what} of body {body} is {values[e, at]:.6g} at a temperature that was met "
                               f"in cell {block.numbers[e] + 1}")


# Caches: geometry of cells that did not move, matrices of bodies whose data are constant
#
# Cached values are those that would be computed, to the bit, so nothing here is part of the state.


class GeometryCache:
    """The geometry on the coordinates last asked for, block by block."""

    def __init__(self) -> None:
        self._x: Floats | None = None
        self._references: tuple[ReferenceCells, ...] = ()
        self._shapes: tuple[CellGeometry, ...] = ()

    def of(self, volume: CellMesh, references: tuple[ReferenceCells, ...], x: Floats) -> tuple[CellGeometry, ...]:
        """Return the geometry of every block on x : (n, 2) [m], with the rotation of its axes.

        Raises InvertedMeshError.
        """
        before, same_reference = self._x, self._references is references
        shapes = []
        for b, (block, first) in enumerate(zip(volume.blocks, references, strict=True)):
            # fault: shapes kept though the cells moved -> if same_reference and before is not None and before.shape ==
            #   x.shape: | thermal_fmu/test_thermal_caches
            if same_reference and before is not None and np.array_equal(before[block.nodes], x[block.nodes]):
                shapes.append(self._shapes[b])
            else:
                shapes.append(with_turn(block, first, shape_of(volume, block, x), x))
        self._x, self._references, self._shapes = np.array(x), references, tuple(shapes)
        return self._shapes


@dataclass(frozen=True)
class _CachedMatrix:
    """What the entries of a block follow from.  entries : (n_places,), once they were asked for twice."""

    first: ReferenceCells
    shape: CellGeometry
    slope: float
    stores: bool
    entries: Floats | None = None

    def is_for(self, first: ReferenceCells, shape: CellGeometry, slope: float, stores: bool) -> bool:
        # fault: matrix kept though the step's length changed -> return self.first is first and self.shape is shape and
        #   self.stores == stores | thermal_fmu/test_thermal_caches
        return self.first is first and self.shape is shape and (self.slope, self.stores) == (slope, stores)


class MatrixCache:
    """M + slope K of blocks whose c and k are constant, for the geometry and the slope last asked for."""

    def __init__(self) -> None:
        self._of: dict[int, _CachedMatrix] = {}

    def fill(self, volume: CellMesh, parts: Sequence[ThermalBody], references: Sequence[ReferenceCells],
             shapes: Sequence[CellGeometry], into: MatrixEntries, stores: bool) -> MatrixEntries:
        """Put in the entries of blocks that were asked for before, and note which.

        A block that moves in every step is not cached: its entries would never be used again.
        references, shapes : of every block.  stores : whether M is in the matrix.
        """
        filled = []
        for b, (block, first, shape) in enumerate(zip(volume.blocks, references, shapes, strict=True)):
            if not (block.alone and _is_constant(parts[block.part])):
                continue
            cached = self._of.get(b)
            if cached is None or not cached.is_for(first, shape, into.slope, stores):
                self._of[b] = _CachedMatrix(first, shape, into.slope, stores)
                continue
            if cached.entries is None:
                cached = replace(cached, entries=_entries(volume, block, parts, cached))
                self._of[b] = cached
            into.data[block.places] = cached.entries
            filled.append(b)
        return replace(into, filled=frozenset(filled))


def _entries(volume: CellMesh, block: CellBlock, parts: Sequence[ThermalBody], cached: _CachedMatrix) -> Floats:
    """Assemble the (n_places,) entries of one block.  T = 0 serves: the entries do not depend on temperature."""
    own = replace(volume, blocks=(replace(block, slots=block.own_slots),))
    nothing, into = np.zeros(volume.n), MatrixEntries(np.zeros(block.places.size), cached.slope)
    if cached.stores:
        store(own, (cached.first,), parts, nothing, nothing, np.zeros(volume.n), into)
    conduct(own, (cached.shape,), parts, NodalFields(nothing), np.zeros(volume.n), into)
    return into.data


def _is_constant(body: ThermalBody) -> bool:
    material = body.material
    return material.phase is None and material.c.is_constant and material.k.is_constant
