"""What drives a condition from outside, and follower pressure on surfaces with its tangent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Values
from contact.half.signal import Signal

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# n = TURN t is the outward normal of an edge with tangent t (its length included): the body lies on its left.
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


def driven(value: Signal, name: str, t: float, side: int, inputs: Values) -> float:
    """value(t) load.<name> + bc.<name>, or value(t) where the condition has no name; side : of a jump at t.

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


def pressure_forces(x: Floats, edges: Ints, p: Floats, axisymmetric: bool) -> Floats:
    """Nodal forces (n_edges, 2, 2) [N] of pressures p : (n_edges,) [Pa] on edges of a mesh at x : (n_nodes, 2) [m].

    f_a = -p n int N_a (2 pi r) ds, exact for straight edges.
    """
    m, _ = edge_weights(x[edges][:, :, 0], axisymmetric)
    n = (x[edges[:, 1]] - x[edges[:, 0]]) @ TURN.T
    # fault: pressure pulls -> return p[:, None, None] * m[:, :, None] * n[:, None, :] |
    #   mechanical_fmu/test_elastic_cylinder
    return -p[:, None, None] * m[:, :, None] * n[:, None, :]


def pressure_blocks(x: Floats, edges: Ints, p: Floats, axisymmetric: bool) -> Floats:
    """Stiffness -d(force)/dx : (n_edges, 4, 4) [N/m] on (node, component), of pressure_forces; not symmetric."""
    m, dm = edge_weights(x[edges][:, :, 0], axisymmetric)
    n = (x[edges[:, 1]] - x[edges[:, 0]]) @ TURN.T
    # fault: follower pressure does not turn in the tangent -> dn = 0.0 * np.stack([-TURN, TURN]) |
    #   mechanical_fmu/test_elastic_patch
    dn = np.stack([-TURN, TURN])  # by node b: (2, component, component)
    blocks = np.einsum("e,ea,bij->eaibj", p, m, dn)
    blocks[:, :, :, :, 0] += np.einsum("e,ei,ab->eaib", p, n, dm)
    return blocks.reshape(-1, 4, 4)


def edge_weights(r: Floats, axisymmetric: bool) -> tuple[Floats, Floats]:
    """m : (n_edges, 2) = int N_a (2 pi r) dxi over the unit edge, and its constant derivative by r : (2, 2)."""
    if not axisymmetric:
        return np.full(r.shape, 0.5), np.zeros((2, 2))
    dm = 2.0 * np.pi * np.array([[1.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 3.0]])
    return r @ dm, dm
