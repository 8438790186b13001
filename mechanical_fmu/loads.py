"""What drives a condition from outside, and follower pressure on surfaces with its tangent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.functions import Signal
from contact.half.interface import Interface
from contact.half.model import Values
from mechanical_fmu.cells import Cells
from mechanical_fmu.problem import DeadLoad

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# n = TURN t is the outward normal of an edge with tangent t (its length included): the body lies on its left.
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


def driven(value: Signal, name: str, t: float, side: int, inputs: Values) -> float:
    """Compute value(t) load.<name> + bc.<name>, or value(t) where the condition has no name; side : of a jump at t.

    So the factor scales what the scenario says and the offset adds to it; a rule that wants to set the value alone
    drives the offset of a signal that is 0.
    """
    if not name:
        return value.at(t, side)
    # fault: prescribed displacement unfactored -> return value.at(t, side) + float(inputs[f"bc.{name}"]) |
    #   mechanical_fmu/test_elastic_patch
    # fault: bc.<name> scaled by load.<name> -> return (value.at(t, side) + float(inputs[f"bc.{name}"])) *
    #   float(inputs[f"load.{name}"]) | mechanical_fmu/test_solution_loads
    return value.at(t, side) * float(inputs[f"load.{name}"]) + float(inputs[f"bc.{name}"])


def driven_slope(value: Signal, name: str, t: float, side: int, inputs: Values) -> float:
    """Compute the slope of `driven`, per second, before or behind a kink at t; what a master adds holds still."""
    return value.slope(t, side) * (float(inputs[f"load.{name}"]) if name else 1.0)


def pressure_forces(x: Floats, edges: Ints, p: Floats, axisymmetric: bool) -> Floats:
    """Compute the nodal forces (n_edges, 2, 2) [N] of pressures p : (n_edges,) [Pa] on edges of a mesh.

    x : (n_nodes, 2) [m].  edges : (n_edges, 2) node numbers.  The result is by edge, node of the edge and component:
    f_a = -p n int N_a (2 pi r) ds, exact for straight edges.
    """
    m, _ = edge_weights(x[edges][:, :, 0], axisymmetric)
    n = (x[edges[:, 1]] - x[edges[:, 0]]) @ TURN.T
    # fault: pressure pulls -> return p[:, None, None] * m[:, :, None] * n[:, None, :] |
    #   mechanical_fmu/test_elastic_cylinder
    return -p[:, None, None] * m[:, :, None] * n[:, None, :]


def pressure_blocks(x: Floats, edges: Ints, p: Floats, axisymmetric: bool) -> Floats:
    """Compute the stiffness -d(force)/dx of pressure_forces, (n_edges, 4, 4) [N/m] on (node, component); not symmetric.

    x : (n_nodes, 2) [m].  edges : (n_edges, 2) node numbers.  p : (n_edges,) [Pa].
    """
    m, dm = edge_weights(x[edges][:, :, 0], axisymmetric)
    n = (x[edges[:, 1]] - x[edges[:, 0]]) @ TURN.T
    # fault: follower pressure does not turn in the tangent -> dn = 0.0 * np.stack([-TURN, TURN]) |
    #   mechanical_fmu/test_elastic_patch
    dn = np.stack([-TURN, TURN])  # by node b: (2, component, component)
    blocks = np.einsum("e,ea,bij->eaibj", p, m, dn)
    blocks[:, :, :, :, 0] += np.einsum("e,ei,ab->eaib", p, n, dm)
    return blocks.reshape(-1, 4, 4)


def edge_weights(r: Floats, axisymmetric: bool) -> tuple[Floats, Floats]:
    """Integrate the shape functions over the unit edge; returns m = int N_a (2 pi r) dxi and its derivative by r.

    r : (n_edges, 2) [m] of the edges' nodes.  m : (n_edges, 2) [m] when axisymmetric, else 1/2 [1].
    dm : (2, 2) [1], constant, 0 unless axisymmetric.
    """
    if not axisymmetric:
        return np.full(r.shape, 0.5), np.zeros((2, 2))
    dm = 2.0 * np.pi * np.array([[1.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 3.0]])
    return r @ dm, dm


# Dead loads: forces that keep size and direction while the body moves.  Eqs. (14), (16).
#
# Each is a fixed pattern of nodal forces times a number that follows its signal.  Weight and body force act on the
# reference volume (rho0 dV0 is what moves along), a traction on the reference edge, so none of them has a stiffness.

@dataclass(frozen=True)
class DeadForces:
    """unit : (2 n, n_loads), the nodal forces of each load of size one; n counts reference rows of rigid bodies too."""

    unit: csr_matrix

    def at(self, magnitudes: Floats) -> Floats:
        """Compute the nodal forces (n, 2) [N] of magnitudes : (n_loads,), in the unit of each load."""
        return np.asarray(self.unit @ magnitudes).reshape(-1, 2)


@dataclass(frozen=True)
class NodalShares:
    """mass : [kg] and volume : [m3] of each body at every row, (n_bodies, n)."""

    mass: Floats
    volume: Floats


@dataclass(frozen=True)
class RigidRows:
    """Degrees of freedom of rigid bodies.

    dofs : (n_rigid, 3) of u_x, u_y and the angle.  per_moment : (n_rigid,) 1/L [1/m], what makes a force of a moment.
    """

    dofs: NDArray[np.intp]
    per_moment: Floats


def dead_forces(interface: Interface, loads: Sequence[DeadLoad], shares: NodalShares, rigid: RigidRows) -> DeadForces:
    """Make the patterns of loads."""
    mass, volume = shares.mass, shares.volume
    columns = []
    for load in loads:
        f = np.zeros((volume.shape[1], 2))
        if load.rigid >= 0:
            dof = rigid.dofs[load.rigid, load.component]
            f.ravel()[dof] = 1.0 if load.component < 2 else rigid.per_moment[load.rigid]
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
    """Integrate the volume (n_parts, n) [m3] of every node in each part: int N_a dV0."""
    shares = np.zeros((len(interface.parts), n))
    for cells in kinds:
        here = np.einsum("eq,qa->ea", cells.weight, cells.N)
        np.add.at(shares, (cells.part[:, None], cells.nodes), here)
    return shares


def edge_shares(interface: Interface, edges: Ints) -> Floats:
    """Compute (n_edges, 2) [m2]: int N_a (2 pi R) dS, when plane per metre of depth.

    edges : (n_edges, 2) node numbers.
    """
    X = interface.nodes[edges]
    length = np.linalg.norm(X[:, 1] - X[:, 0], axis=1)
    # fault: traction shared over the edge as if it were flat about the axis -> return length[:, None] *
    #   edge_weights(X[:, :, 0], False)[0] | mechanical_fmu/test_solution_loads
    return length[:, None] * edge_weights(X[:, :, 0], interface.axisymmetric)[0]
