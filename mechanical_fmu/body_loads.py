"""Dead loads: forces that keep size and direction while the body moves.  Eqs. (14), (16).

Each is a fixed pattern of nodal forces times a number that follows its signal.  Weight and body force act on the
reference volume (rho0 dV0 is what moves along), a traction on the reference edge, so none of them has a stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.interface import Interface
from mechanical_fmu.boundary_spec import DeadLoad
from mechanical_fmu.elements import Cells
from mechanical_fmu.loads import edge_weights

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

@dataclass(frozen=True)
class DeadForces:
    """unit : (2 n, n_loads), the nodal forces of each load of size one; n counts reference rows of rigid bodies too."""

    unit: csr_matrix

    def at(self, magnitudes: Floats) -> Floats:
        """(n, 2) [N] of magnitudes : (n_loads,)."""
        return np.asarray(self.unit @ magnitudes).reshape(-1, 2)


def dead_forces(interface: Interface, loads: Sequence[DeadLoad], shares: tuple[Floats, Floats],
                rigid: tuple[NDArray[np.intp], Floats]) -> DeadForces:
    """The patterns of loads.

    shares : mass [kg] and volume [m3] of each body at every row, (n_bodies, n).  rigid : (n_rigid, 3) degrees of
    freedom of u_x, u_y and the angle of each rigid body, and (n_rigid,) 1/L, what makes a force of a moment.
    """
    mass, volume = shares
    columns = []
    for load in loads:
        f = np.zeros((volume.shape[1], 2))
        if load.rigid >= 0:
            f.ravel()[rigid[0][load.rigid, load.component]] = 1.0 if load.component < 2 else rigid[1][load.rigid]
        elif load.kind == "traction":
            edges = interface.surfaces[load.on]
            np.add.at(f[:, load.component], edges, edge_shares(interface, edges))
        elif load.kind == "force":
            nodes = np.unique(interface.node_sets[load.on])
            f[nodes, load.component] = 1.0 / len(nodes)
        else:
            f[:, load.component] = (mass if load.kind == "gravity" else volume)[interface.bodies.index(load.on)]
        columns.append(f.ravel())
    return DeadForces(csr_matrix(np.array(columns).T))


def nodal_shares(interface: Interface, kinds: Sequence[Cells], n: int) -> Floats:
    """(n_bodies, n) [m3]: int N_a dV0 of every node over each body."""
    shares = np.zeros((len(interface.bodies), n))
    for cells in kinds:
        here = np.einsum("eq,qa->ea", cells.weight, cells.N)
        np.add.at(shares, (cells.body[:, None], cells.nodes), here)
    return shares


def edge_shares(interface: Interface, edges: Ints) -> Floats:
    """(n_edges, 2) [m2]: int N_a (2 pi R) dS."""
    X = interface.nodes[edges]
    length = np.linalg.norm(X[:, 1] - X[:, 0], axis=1)
    # fault: traction shared over the edge as if it were flat about the axis -> return length[:, None] *
    #   edge_weights(X[:, :, 0], False)[0] | mechanical_fmu/test_solution_loads
    return length[:, None] * edge_weights(X[:, :, 0], interface.axisymmetric)[0]
