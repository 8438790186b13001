"""Convection from surfaces, covered or not: Eqs. (5-7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.surfaces import ContactSurfaces
from contact.laws import gap_factor
from thermal_fmu.edges import EdgePoints, gauss_points
from thermal_fmu.facing import Points
from thermal_fmu.spec import Film

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class FilmPoints:
    """Where a film acts.  nodes : (n, 2).  N : (n, 2).  area : (n,) kappa-weighted [m2].  slots : (n, 2, 2)."""

    nodes: Ints
    N: Floats
    area: Floats
    slots: NDArray[np.int64]


def film_points(film: Film, slots: NDArray[np.int64], x: Floats, axisymmetric: bool,
                surfaces: ContactSurfaces, points: Points | None) -> FilmPoints:
    """The points of a film on coordinates x : (n_nodes, 2) [m].  slots : (n_edges, 2, 2) of the film's edges.

    The whole edge convects with kappa = 1, less its facing pieces, plus kappa(gap) times those pieces, on either side.
    """
    parts = [gauss_points(film.edges, x, axisymmetric)]
    first = surfaces.first.get(film.surface)
    if points is not None and first is not None and film.d_cut is not None and film.d_full is not None:
        excess = gap_factor(points.gap, film.d_cut, film.d_full) - 1.0
        parts += [
            _pieces(points.slave_edge - first, points.N_s, excess * points.area, len(film.edges)),
            _pieces(points.master_edge - first, points.N_m, excess * points.area_m, len(film.edges)),
        ]
    edge = np.concatenate([part.edge for part in parts])
    return FilmPoints(film.edges[edge], np.concatenate([part.N for part in parts]),
                      np.concatenate([part.area for part in parts]), slots[edge])


def _pieces(edge: NDArray[np.integer], N: Floats, area: Floats, n_edges: int) -> EdgePoints:
    own = (edge >= 0) & (edge < n_edges) & (area != 0.0)
    return EdgePoints(edge[own].astype(np.intp), N[own], area[own])


def film_flow(film: Film, points: FilmPoints, h: float, Te: float, T: Floats) -> tuple[Floats, Floats]:
    """(n, 2) heat that leaves each point's nodes [W] at T : (n_nodes,) [K], and (n, 2, 2) its derivative [W/K].

    h : hbar [W/m2K], Te : ambient [K].  Eq. (5): h |T - Te|^a (T - Te), odd in T - Te.
    """
    dT = (points.N * T[points.nodes]).sum(axis=1) - Te
    strength = h * points.area
    if film.exponent != 0.0:
        strength = strength * np.abs(dT) ** film.exponent
    flow = (strength * dT)[:, None] * points.N
    slope = ((1.0 + film.exponent) * strength)[:, None, None] * points.N[:, :, None] * points.N[:, None, :]
    return flow, slope
