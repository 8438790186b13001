"""Stations on given coordinates: volumes, and what conducts between the columns of rods."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.columns import Columns
from contact.half.interface import Interface
from thermal_fmu.edges import EDGE_WEIGHT, EDGE_XI, shape_functions
from thermal_fmu.stations import Stations
from thermal_fmu.volume import InvertedCellError, Volume, shapes_of, volume_of

Floats = NDArray[np.float64]

N = shape_functions(EDGE_XI)  # (points, ends) of a piece between two columns


@dataclass(frozen=True)
class Piece:
    """The pieces between the columns of one body.  dV : (m, 2) volume of Gauss points [m3].

    conducts : (m, 2) what k of each point is to be multiplied with for the conductance between the two columns [m].
    """

    dV: Floats
    conducts: Floats


@dataclass(frozen=True)
class StationShape:
    """volume : (n,) of each station [m3].  pieces : of every body; empty where bodies are lumped."""

    volume: Floats
    pieces: tuple[Piece, ...]


@dataclass(frozen=True)
class Ruler:
    """Measures stations.  Values in, values out; what it knows of the mesh never changes."""

    interface: Interface
    stations: Stations

    @cached_property
    def _cells(self) -> Volume:
        return volume_of(self.interface)

    def shape(self, x: Floats) -> StationShape:
        """The stations on coordinates x : (n_nodes, 2) [m].  Raises InvertedCellError."""
        if self.stations.columns is None:
            return StationShape(self._of_bodies(x), ())
        return self._of_columns(self.stations.columns, x)

    def _of_bodies(self, x: Floats) -> Floats:
        volume = np.zeros(self.stations.n)
        for block, shape in zip(self._cells.blocks, shapes_of(self._cells, x), strict=True):
            volume[self.stations.own[block.body]] += shape.dV.sum()
        return volume

    def _of_columns(self, columns: Columns, x: Floats) -> StationShape:
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
                raise InvertedCellError(f"rod {self.interface.bodies[body]} is turned inside out by the coordinates "
                                        "that came in")
            dV = EDGE_WEIGHT * area * length[:, None]
            # fault: rods conduct on half their area -> pieces.append(Piece(dV, 0.5 * EDGE_WEIGHT * area / length[:,
            #   None])) | thermal_fmu/test_thermal_rod
            pieces.append(Piece(dV, EDGE_WEIGHT * area / length[:, None]))
            ends = dV @ N
            volume[own[:-1]] += ends[:, 0]
            volume[own[1:]] += ends[:, 1]
        return StationShape(volume, tuple(pieces))

    def spread(self, E: Floats, shape: StationShape) -> Floats:
        """(n,) shares of energies E : (n_cells,) [J] of cells, even in the volume between two columns."""
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
    """(m, 2) values at Gauss points between neighbours of values : (m + 1,)."""
    return np.stack([values[:-1], values[1:]], axis=1) @ N.T
