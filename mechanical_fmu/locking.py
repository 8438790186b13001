"""How much strain energy triangles make of nothing by pressures that they hold against each other.

A plane triangle has one dilatation.  Near nu = 1/2 it keeps its volume, two triangles a node leave the node no way to
go, and what they are held by is a pressure that jumps from one to the next.  What they miss then is no jump of their
stress: that has the energy p^2/kappa, which is next to nothing, and a body that is held fast by its cells has a smooth
deviator.  But forces r of the difference between the pressure of the cells and a smoother one, recovered at nodes
(recovery.py), are what its nodes would follow.  They would go about as far as in the same body of nu = 0.3, K, and the
energy r K^-1 r/2 is made of nothing.  Where pressures jump without any force on the nodes, as on a chessboard, that is
0, and so they do no harm.

It is added to the energy that jumps of stress tell.  Both are of the bodies where they are now; loads and contact stay.
Quads have one dilatation too, but only one a node, and are judged well without.  What flows or creeps is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.interface import Interface
from contact.half.linalg import factorise, pattern_of
from mechanical_fmu.cells import ELASTIC, Cells, cells_of
from mechanical_fmu.material import Moduli
from mechanical_fmu.volume import DeformableMesh, PointStep

Floats = NDArray[np.float64]

TRIANGLE = 3  # corners
LOCKS = 14.0 / 3.0  # kappa/mu of nu = 0.4: below it there is little of it
FOLLOWS = 13.0 / 6.0  # kappa/mu of nu = 0.3
HELD = 1e-9  # of its own stiffness: what holds each unknown, for a body that only contact holds


def locks(kinds: Sequence[Cells], moduli: Sequence[Moduli]) -> bool:
    """Return whether any cells may lock: triangles that can hardly change their volume."""
    return any(_may(cells) and bool((m.kappa > LOCKS * m.mu).any()) for cells, m in zip(kinds, moduli, strict=True))


def _may(cells: Cells) -> bool:
    return cells.nodes.shape[1] == TRIANGLE and cells.treatment == ELASTIC


def locked_energy(interface: Interface, x: Floats, free: Floats, kinds: Sequence[Cells], jumps: Sequence[Floats],
                  moduli: Sequence[Moduli]) -> Floats:
    """Return that energy of each body, (n_bodies,) [J].  Raises contact.half.linalg.SingularMatrixError.

    x : (n_nodes, 2) [m] where nodes are.  free : (2 n_nodes,) 0 where a displacement is given.  jumps : of each kind,
    (n_e, nq) [Pa] how far the recovered pressure is above that of the cells, tension positive.
    """
    n, n_cells = len(x), len(interface.quads) + len(interface.triangles)
    try:
        kinds_now = cells_of(replace(interface, nodes=np.ascontiguousarray(x)))
    except ValueError:
        # A quad may hold with a corner turned in: then all are looked at where they were drawn.
        kinds_now = cells_of(interface)
    volume = DeformableMesh(kinds_now, n)
    mu, jump = np.zeros(n_cells), np.zeros(n_cells)
    for cells, of, m in zip(kinds, jumps, moduli, strict=True):
        mu[cells.number] = m.mu
        # fault: pressures that triangles hold against each other do nothing -> held = np.zeros(len(of), dtype=bool) |
        #   mechanical_fmu/test_locking
        held = _may(cells) & (m.kappa > LOCKS * m.mu)
        jump[cells.number] = np.where(held, (of * cells.weight).sum(axis=1) / cells.volume, 0.0)
    # Rigid bodies have no modulus, and follow nothing.
    alike = tuple(Moduli(of, FOLLOWS * of, np.zeros((len(of), 1)))
                  for c in volume.kinds for of in [np.where(mu[c.number] > 0.0, mu[c.number], 1.0)])
    r = np.zeros((n, 2))
    for c in volume.kinds:
        f = np.einsum("eqai,eq->eai", c.B, c.weight)
        f[..., 0] += np.einsum("eqa,eq->ea", c.N_over_R, c.weight)
        np.add.at(r, c.nodes, f * jump[c.number][:, None, None])
    entries = volume.evaluate(np.zeros((n, 2)), alike, PointStep(), tangent=True).entries
    assert entries is not None
    K = pattern_of(2 * n, *(c.dofs for c in volume.kinds)).matrix(entries)
    hold = diags_array(free)
    own = np.abs(K.diagonal())
    # Rows of rigid bodies are nodes of no cell.
    bare = (own == 0.0).astype(np.float64)
    stiff = csr_matrix(hold @ K @ hold + diags_array(HELD * free * own + (1.0 - free) * np.maximum(own, 1.0) + bare))
    force = r.ravel() * free
    u = factorise(stiff, True)(force)
    of_nodes = 0.5 * (force * u).reshape(n, 2).sum(axis=1)
    # fault: a rigid body ends the run that triangles may lock in -> mine = np.ones(n, dtype=bool) |
    #   mechanical_fmu/test_locking
    mine = interface.node_body >= 0
    return np.asarray(np.bincount(interface.node_body[mine], of_nodes[mine], len(interface.bodies)), dtype=float)
