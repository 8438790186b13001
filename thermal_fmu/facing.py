"""What faces what: the contact service's answer in the words of the thermal half."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.surfaces import ContactSurfaces
from contact.wire import Facing
from thermal_fmu.edges import shape_functions

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Points:
    """Facing points with the pressure between them.

    nodes : (n_p, 4) nodes of the mesh, slave edge's two, master edge's two.  N_s, N_m : (n_p, 2) shape functions.
    gap : (n_p,) [m], 0 where touching.  p : (n_p,) [Pa], > 0 where touching.  area, area_m : (n_p,) [m2].
    pair, slave_edge, master_edge : (n_p,) as registered.
    """

    nodes: Ints
    N_s: Floats
    N_m: Floats
    gap: Floats
    p: Floats
    area: Floats
    area_m: Floats
    pair: Ints
    slave_edge: Ints
    master_edge: Ints


def points_of(surfaces: ContactSurfaces, facing: Facing, t_N: Floats) -> Points:
    """Facing points with pressures from nodal tractions t_N : (n_s,) [Pa], <= 0, linear along the slave edge.

    A positive gap under pressure is read as no gap (physics: touching means p_N > 0).
    """
    N_s, N_m = shape_functions(facing.xi_s), shape_functions(facing.xi_m)
    slave = surfaces.message.edges[facing.slave_edge]
    p = np.maximum(-(N_s * t_N[slave]).sum(axis=1), 0.0)
    gap = np.where(p > 0, 0.0, np.maximum(facing.gap, 0.0))
    nodes = np.concatenate([surfaces.edges[facing.slave_edge], surfaces.edges[facing.master_edge]], axis=1)
    return Points(nodes, N_s, N_m, gap, p, facing.area, facing.area_m, facing.pair, facing.slave_edge,
                  facing.master_edge)
