"""Friction heat: what sliding made at surface nodes, shared out between the two sides (2.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.facing import Points
from thermal_fmu.nodal import at_nodes
from thermal_fmu.phase import Fields
from thermal_fmu.spec import Body
from thermal_fmu.spec_boundary import PairLaws

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Friction:
    """slave, master : (n,) [W] into the nodes of either side, spread evenly over the substep."""

    slave: Floats
    master: Floats


def friction_power(points: Points, share: Floats, E: Floats, is_slave: NDArray[np.bool_], h: float) -> Friction:
    """Power from energies E : (n,) [J] at nodes, over a substep h [s].

    share : (n_p,) of each facing point's energy that the slave takes.  is_slave : (n,) nodes of slave surfaces.
    A node's energy goes to the facing points found from it by N A, from there by N_s to the slave's nodes and by N_m
    to the master's.  A node that finds nothing keeps what it carries.
    """
    rubbed, N = points.found_from
    # fault: friction heat spread without areas -> weight = N | thermal_fmu/test_thermal_friction
    weight = N * points.area[:, None]
    whole = at_nodes(rubbed, weight, E.size)
    faces = whole > 0.0
    per_area = np.divide(E, whole, out=np.zeros(E.size), where=faces)
    Q = (per_area[rubbed] * weight).sum(axis=1)
    # fault: joules of nodes that face nothing lost -> kept = np.where(faces, 0.0, 0.0 * E) |
    #   thermal_fmu/test_thermal_friction
    kept = np.where(faces, 0.0, E)
    to_slave = at_nodes(points.nodes[:, :2], (share * Q)[:, None] * points.N_s, E.size)
    to_master = at_nodes(points.nodes[:, 2:], ((1.0 - share) * Q)[:, None] * points.N_m, E.size)
    slave, master = to_slave + np.where(is_slave, kept, 0.0), to_master + np.where(is_slave, 0.0, kept)
    # fault: friction energy as power -> return Friction(slave, master) | thermal_fmu/test_thermal_friction
    return Friction(slave / h, master / h)


def slave_share(points: Points, pairs: Sequence[PairLaws | None], bodies: Sequence[Body],
                node_body: NDArray[np.int32], at: Fields) -> Floats:
    """(n_p,) share of the slave: the pair's friction_share, else e_s/(e_s + e_m) with effusivities sqrt(k rho c).

    Half-spaces that slide take heat by their effusivities while their surfaces stay equally warm.  at : the start of
    the substep.
    """
    out = np.empty(points.pair.size)
    for pair, laws in enumerate(pairs):
        of = np.flatnonzero(points.pair == pair)
        if laws is not None and laws.friction_share is not None:
            out[of] = laws.friction_share
        elif of.size:
            e_s, e_m = (_effusivity(points.nodes[of, side], N[of], bodies[node_body[points.nodes[of[0], side][0]]], at)
                        for side, N in ((slice(0, 2), points.N_s), (slice(2, 4), points.N_m)))
            # fault: friction shares swapped -> out[of] = e_m / (e_s + e_m) | thermal_fmu/test_thermal_friction
            out[of] = e_s / (e_s + e_m)
    return out


def _effusivity(nodes: NDArray[np.int32], N: Floats, body: Body, at: Fields) -> Floats:
    T, f_s = ((N * v[nodes]).sum(axis=1) if v is not None else None for v in (at.T, at.f_s))
    assert T is not None
    return body.material.effusivity(T, f_s)
