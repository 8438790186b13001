"""Where surfaces are open to their surroundings: whole edges, less what faces something, Eq. (7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.surfaces import ContactSurfaces
from contact.laws import gap_factor
from thermal_fmu.edges import EdgePoints, gauss_points
from thermal_fmu.facing import Points
from thermal_fmu.spec_boundary import Exposed

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class ExposedPoints:
    """nodes : (n, 2).  N : (n, 2).  area : (n,) weighted with kappa [m2].  slots : (n, 2, 2) of the matrix data."""

    nodes: Ints
    N: Floats
    area: Floats
    slots: NDArray[np.int64]

    def places(self, x: Floats) -> Floats:
        """(n, 2) coordinates of the points [m], of nodes at x : (n_nodes, 2)."""
        return np.einsum("pi,pij->pj", self.N, x[self.nodes])


@dataclass(frozen=True)
class Ground:
    """What exposed points are found on.

    x : (n_nodes, 2) current coordinates [m].  points : what faces what, None where nothing can.
    """

    x: Floats
    axisymmetric: bool
    surfaces: ContactSurfaces
    points: Points | None


def exposed_points(where: Exposed, slots: NDArray[np.int64], ground: Ground) -> ExposedPoints:
    """The points of a surface open to its surroundings.  slots : (n_edges, 2, 2) of its edges.

    The whole edge counts with kappa = 1, less its facing pieces, plus kappa(gap) times those pieces, on either side.
    """
    parts = [gauss_points(where.edges, ground.x, ground.axisymmetric)]
    points, first = ground.points, ground.surfaces.first.get(where.surface)
    if points is not None and first is not None and where.near is not None and where.far is not None:
        # fault: no kappa -> excess = 0.0 * points.gap | thermal_fmu/test_thermal_contact
        excess = gap_factor(points.gap, where.near, where.far) - 1.0
        parts += [
            _pieces(points.slave_edge - first, points.N_s, excess * points.area_s, len(where.edges)),
            # fault: kappa on the slave side only -> *(), | thermal_fmu/test_thermal_contact
            _pieces(points.master_edge - first, points.N_m, excess * points.area_m, len(where.edges)),
        ]
    edge = np.concatenate([part.edge for part in parts])
    return ExposedPoints(where.edges[edge], np.concatenate([part.N for part in parts]),
                         np.concatenate([part.area for part in parts]), slots[edge])


def _pieces(edge: NDArray[np.integer], N: Floats, area: Floats, n_edges: int) -> EdgePoints:
    own = (edge >= 0) & (edge < n_edges) & (area != 0.0)
    return EdgePoints(edge[own].astype(np.intp), N[own], area[own])
