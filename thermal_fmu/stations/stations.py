"""Stations: nodes that share one temperature (columns of rods, or whole lumped bodies), their geometry and band matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgbsv
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from contact.compiled import kernel
from contact.half.columns import Columns, columns_of
from contact.half.interface import Interface
from contact.half.linalg import SingularMatrixError
from thermal_fmu.cells import CellMesh, InvertedMeshError, cell_mesh, shapes_of
from thermal_fmu.contact_quadrature import EDGE_WEIGHT, EDGE_XI, shape_functions
from thermal_fmu.surface_terms import at_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True)
class Stations:
    """Which nodes share a temperature, and how stations are joined.

    of_node : (n_nodes,) station of each node.  body : (n,) body of each station.  own : the stations of each body, from
    left to right; where there is heat conduction inside, neighbours in it are joined.  width : how far apart the
    numbers of
    two stations that exchange heat may be.  columns : of rods, with order : (n,) the column of each station; None:
    bodies
    are lumped.
    """

    of_node: Ints
    body: Ints
    own: tuple[Ints, ...]
    width: int
    columns: Columns | None = None
    order: Ints | None = None

    @property
    def n(self) -> int:
        """Number of stations."""
        return self.body.size

    def slots(self, rows: NDArray[np.integer], columns: NDArray[np.integer]) -> Ints:
        """Return flat places of entries (row, column) in the band (3 width + 1, n).

        rows : (...) and columns : (...) are numbers of stations, of shapes that broadcast.
        """
        return np.asarray((2 * self.width + rows - columns) * self.n + columns, dtype=np.intp)

    def solve(self, band: Floats, b: Floats) -> Floats:
        """Solve A x = b : (n,), A by its band : (3 width + 1, n).  Raises SingularMatrixError."""
        _, _, x, info = dgbsv(self.width, self.width, band, b)
        if info != 0:
            raise SingularMatrixError(f"the matrix of {self.n} temperatures is singular (row {info})")
        return np.asarray(x)

    def times(self, band: Floats, x: Floats) -> Floats:
        """Return A x : (n,) of x : (n,), A by its band : (3 width + 1, n)."""
        out = np.zeros(self.n)
        for below in range(-self.width, self.width + 1):
            first, end = max(0, -below), min(self.n, self.n - below)
            out[first + below:end + below] += band[2 * self.width + below, first:end] * x[first:end]
        return out

    def gather(self, values: Floats) -> Floats:
        """Sum values : (n_nodes,) over the nodes of each station; return (n,)."""
        return at_nodes(self.of_node, values, self.n)

    @cached_property
    def column_of_slot(self) -> Ints:
        """((3 width + 1) n,) the column of each place of the band."""
        return np.tile(np.arange(self.n), 3 * self.width + 1)


def lumped_stations(interface: Interface) -> Stations:
    """Make one station a body.  Raises ValueError for a node that belongs to no body."""
    if (interface.node_body < 0).any():
        raise ValueError(f"node {int(np.argmin(interface.node_body)) + 1} of the mesh belongs to no cell")
    n = len(interface.bodies)
    node_body = interface.node_body.astype(np.intp)
    stations = Stations(node_body, np.arange(n), tuple(np.array([b]) for b in range(n)), 0)
    return _ordered(stations, interface, np.arange(n), None)


def rod_stations(interface: Interface) -> Stations:
    """Make one station a column.  Raises ValueError where a body is no rod along x."""
    columns = columns_of(interface)
    own = tuple(columns.of_body(b) for b in range(len(interface.bodies)))
    body = np.repeat(np.arange(len(own)), [len(c) for c in own])
    return _ordered(Stations(columns.of_node, body, own, 0), interface, np.arange(columns.count), columns)


def _ordered(stations: Stations, interface: Interface, number: Ints, columns: Columns | None) -> Stations:
    """Renumber stations so that those that exchange heat come close to each other: rods in a row are tridiagonal."""
    pairs = [np.stack([c[:-1], c[1:]], axis=1) for c in stations.own]
    for pair in interface.pairs:
        slave, master = (np.unique(stations.of_node[interface.surfaces[s]]) for s in (pair.slave, pair.master))
        pairs.append(np.stack([a.ravel() for a in np.meshgrid(slave, master)], axis=1))
    joined = np.concatenate(pairs)
    n = stations.n
    both = np.concatenate([joined, joined[:, ::-1]])
    graph = coo_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(n, n)).tocsr()
    order = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.intp)
    new = np.empty(n, dtype=np.intp)
    new[order] = number
    width = int(np.abs(new[joined[:, 0]] - new[joined[:, 1]]).max(initial=0))
    return Stations(new[stations.of_node], stations.body[order], tuple(new[c] for c in stations.own), width, columns,
                    order)


# Geometry of stations on given coordinates

N = shape_functions(EDGE_XI)  # (points, ends) of a piece between two columns


@dataclass(frozen=True)
class RodPieces:
    """The pieces between the columns of one body.

    dV : (m, 2) volume of Gauss points [m3].  conducts : (m, 2) factors of k of each point in the conductance between
    the
    two columns [m].
    """

    dV: Floats
    conducts: Floats


@dataclass(frozen=True)
class StationGeometry:
    """Stations on given coordinates.  volume : (n,) of each station [m3].  pieces : of every body; empty where lumped.
    """

    volume: Floats
    pieces: tuple[RodPieces, ...]


@dataclass(frozen=True)
class StationMesh:
    """Mesh and stations: computes their geometry and spreads energies.  It never changes."""

    interface: Interface
    stations: Stations

    @cached_property
    def _cells(self) -> CellMesh:
        return cell_mesh(self.interface)

    def shape(self, x: Floats) -> StationGeometry:
        """Compute the geometry of the stations on coordinates x : (n_nodes, 2) [m].  Raises InvertedMeshError."""
        if self.stations.columns is None:
            return StationGeometry(self._of_bodies(x), ())
        return self._of_columns(self.stations.columns, x)

    def _of_bodies(self, x: Floats) -> Floats:
        volume = np.zeros(self.stations.n)
        for block, shape in zip(self._cells.blocks, shapes_of(self._cells, x), strict=True):
            volume[self.stations.own[block.body]] += shape.dV.sum()
        return volume

    def _of_columns(self, columns: Columns, x: Floats) -> StationGeometry:
        place, height = columns.mean(x[:, 0]), columns.heights(x)
        volume, pieces = np.zeros(self.stations.n), []
        for body, own in enumerate(self.stations.own):
            at = columns.of_body(body)
            length = np.diff(place[at])
            area = _between(height[at])
            if self.interface.axisymmetric:
                # fault: rods around an axis without 2 pi r -> area = area * 1.0 | thermal_fmu/test_thermal_rod
                area = area * 2.0 * np.pi * _between(place[at])
            if not (length > 0.0).all() or not (area > 0.0).all():
                raise InvertedMeshError(f"rod {self.interface.bodies[body]} is turned inside out by the coordinates "
                                        "that came in")
            dV = EDGE_WEIGHT * area * length[:, None]
            # fault: rods conduct on half their area -> pieces.append(RodPieces(dV, 0.5 * EDGE_WEIGHT * area / length[:,
            #   None])) | thermal_fmu/test_thermal_rod
            pieces.append(RodPieces(dV, EDGE_WEIGHT * area / length[:, None]))
            ends = dV @ N
            volume[own[:-1]] += ends[:, 0]
            volume[own[1:]] += ends[:, 1]
        return StationGeometry(volume, tuple(pieces))

    def spread(self, E: Floats, shape: StationGeometry) -> Floats:
        """Spread energies E : (n_cells,) [J] of cells to stations, even in the volume between two columns; return (n,)

        [J].
        """
        out = np.zeros(self.stations.n)
        columns = self.stations.columns
        if columns is None:
            bodies = np.concatenate([self.interface.quad_body, self.interface.triangle_body])
            np.add.at(out, np.concatenate(self.stations.own)[bodies], E)
            return out
        per_piece = np.bincount(columns.of_cell, weights=E, minlength=columns.count)
        for body, (own, piece) in enumerate(zip(self.stations.own, shape.pieces, strict=True)):
            # fault: mechanical heat of a rod to the wrong column -> ends = piece.dV @ N *
            #   (per_piece[columns.of_body(body)[1:]] / piece.dV.sum(axis=1))[:, None] | thermal_fmu/test_thermal_rod
            ends = piece.dV @ N * (per_piece[columns.of_body(body)[:-1]] / piece.dV.sum(axis=1))[:, None]
            out[own[:-1]] += ends[:, 0]
            out[own[1:]] += ends[:, 1]
        return out


def _between(values: Floats) -> Floats:
    """Return (m, 2) values at Gauss points between neighbours of values : (m + 1,)."""
    return np.stack([values[:-1], values[1:]], axis=1) @ N.T


# Compiled loops along rods
#
# Arrays: own (m + 1,) the stations of a rod from left to right; *_q (m, 2) values at the Gauss points between two of
# them; N (2, 2) shape functions at these points; band (3 w + 1, n) with entry (i, j) of the matrix at [2 w + i - j, j].

@kernel
def rod_points(values: Floats, own: Ints, N: Floats) -> Floats:
    """Return (m, 2) values at Gauss points of values : (n,) at stations.

    own : (m + 1,) stations of a rod.  N : (2, 2) shape functions [1].
    """
    m = own.size - 1
    out = np.empty((m, 2))
    for e in range(m):
        a, b = values[own[e]], values[own[e + 1]]
        for q in range(2):
            out[e, q] = N[q, 0] * a + N[q, 1] * b
    return out


@kernel
def add_rod_conduction(T: Floats, own: Ints, kA: Floats, f: Floats) -> Floats:
    """Add conduction by a constant k: f -= the heat that leaves each station.

    T : (n,) [K].  own : (m + 1,).  kA : (m, 2) conductance at Gauss points [W/K].  f : (n,) [W].  Returns (m, 2)
    derivatives by T of the heat of each piece [W/K].
    """
    m = own.size - 1
    slope = np.empty((m, 2))
    for e in range(m):
        G = kA[e, 0] + kA[e, 1]
        flow = G * (T[own[e]] - T[own[e + 1]])
        f[own[e]] -= flow
        f[own[e + 1]] += flow
        slope[e, 0], slope[e, 1] = G, -G
    return slope


@kernel
def add_rod_slopes(own: Ints, slope: Floats, by_s: Floats, scale: float, band: Floats) -> None:
    """Add derivatives to the band: band += scale * slope * by_s.

    own : (m + 1,).  slope : (m, 2) derivatives of the heat from left to right in each piece.  by_s : (n,) derivative by
    the
    unknown of what slope is a derivative by.  band : (3 w + 1, n) with entry (i, j) of the matrix at [2 w + i - j, j].
    """
    w = (band.shape[0] - 1) // 3
    for e in range(own.size - 1):
        i, j = own[e], own[e + 1]
        a, b = scale * slope[e, 0] * by_s[i], scale * slope[e, 1] * by_s[j]
        band[2 * w, i] += a
        band[2 * w + i - j, j] += b
        band[2 * w + j - i, i] -= a
        band[2 * w, j] -= b


@kernel
def add_melting_fields(s: Floats, own: Ints, T_s: float, T_l: float, W: float, T: Floats, f_s: Floats, dT: Floats,
                       df: Floats) -> None:
    """Fill T, f_s, dT/ds and df_s/ds at the stations of a body that melts (thermal_fmu/phase_change.py).

    s : (n,) [K].  own : (m,) its stations.  T_s, T_l, W : solidus, liquidus and width [K].  T : (n,) [K].  f_s : (n,)
    [1].
    dT : (n,) [1].  df : (n,) [1/K].
    """
    for i in own:
        if s[i] <= T_s:
            T[i], f_s[i], dT[i], df[i] = s[i], 1.0, 1.0, 0.0
        elif s[i] < T_s + W:
            phi = (s[i] - T_s) / W
            T[i], f_s[i], dT[i], df[i] = T_s + phi * (T_l - T_s), 1.0 - phi, (T_l - T_s) / W, -1.0 / W
        else:
            T[i], f_s[i], dT[i], df[i] = s[i] - (W - (T_l - T_s)), 0.0, 1.0, 0.0


@kernel
def melting_heat(s0: Floats, s1: Floats, T_m: float, W: float, L: float, c_solid: float, c_liquid: float,
                 C: Floats) -> Floats:
    """Return (m,) increase of enthalpy [J/kg] from s0 to s1 : (m,) [K] at one melting point.

    T_m : the melting point [K].  W : the width [K].  L : [J/kg].  c_solid, c_liquid : [J/kgK].
    C : (m,) filled with the derivative by s1 [J/kgK].
    """
    dh = np.empty(s0.size)
    for i in range(s0.size):
        solid = c_solid * (min(s1[i], T_m) - min(s0[i], T_m))
        liquid = c_liquid * (max(s1[i], T_m + W) - max(s0[i], T_m + W))
        phi0, phi1 = min(max((s0[i] - T_m) / W, 0.0), 1.0), min(max((s1[i] - T_m) / W, 0.0), 1.0)
        dh[i] = solid + liquid + L * (phi1 - phi0)
        C[i] = c_solid if s1[i] <= T_m else (L / W if s1[i] < T_m + W else c_liquid)
    return dh
