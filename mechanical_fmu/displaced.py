"""How far nodes are from where a finer mesh would have them, as the stress of its cells tells.

Cells that are too stiff against a motion have stress that no smoother field has: bent cells are sheared.  Energies tell
of that where the motion is most of what a body does.  A bar that is pulled hard and bent a little has next to no energy
of bending, and its deflection may be off by a third unseen.  So the stress s of the cells is held against a smoother
one s*, recovered at nodes (recovery.py): its forces on nodes are not those of the loads, and what is left moves them,

    r = sum of B' (s - s*) over all cells,        du = K^-1 r,

K being the stiffness there, with loads and contact.  This is the first iteration of Loubignac, Cantin and Touzot, AIAA
J. 15 (1977) 1239.  Of a motion of which the mesh misses the share e of its energy du is that share of the exact one, so
of cells that are too stiff by d it is d/(1 + d); above 1/2 loads that take stiffness back hide a part of it.

Pressures s* act at points, those of cells of one dilatation on the mean of it: what these are too soft by is in r too.
Of quads of one dilatation in a single row nothing is known across (contact/half/nodal_stress.py), nor of their body.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.linalg import factorise
from mechanical_fmu.cells import ELASTIC, QUAD, Cells, moved
from mechanical_fmu.recovery import recovered
from mechanical_fmu.system import Loading, System, mesh_nodes

Floats = NDArray[np.float64]

SHAPE = np.array([[0, 2], [2, 1]])  # of the components 11, 22, 12, 33
IN_A_ROW = 0.1  # of the cells of a body: more of a single row, and nothing is told of it


def displaced(system: System, K: csr_matrix, u: Floats, loading: Loading) -> Floats:
    """Return (n_nodes, 2) [m] how much farther nodes at u : (n, 2) [m] would be on a finer mesh; nan: not known.

    K : (2 n, 2 n) [N/m], symmetric, positive, what is prescribed held.  loading : its moduli.  Raises ArithmeticError,
    and ValueError where a quad has a corner turned in.
    """
    volume, interface = system.volume, system.interface
    n = mesh_nodes(system)
    rough = [stress for stress, _ in volume.stress(u, loading.moduli, loading.step)]
    force = np.zeros_like(u)
    # fault: stress that nothing smoothes moves nodes -> smooth = [0.0 * of for of in rough] |
    #   mechanical_fmu/test_displaced
    smooth = recovered(volume.kinds, rough, len(interface.nodes), system.nodal_stress)
    for here, of, even in zip(_there(system, u), rough, smooth, strict=True):
        np.add.at(force, here.nodes, _forces(here, of - even))
    du = np.asarray(factorise(K, True)(force.ravel() * system.constraints.free)).reshape(u.shape)
    # fault: a rigid body stays where it is -> pass | mechanical_fmu/test_displaced
    du = du if system.rigid is None else system.rigid.placed(u + du) - u
    du = du[:n]
    du[_unknown(system)[:n]] = np.nan
    return np.asarray(du)


def _there(system: System, u: Floats) -> tuple[Cells, ...]:
    """The cells where they are at u, kind by kind."""
    interface = system.interface
    now = replace(interface, nodes=np.ascontiguousarray(interface.nodes + u[:len(interface.nodes)]))
    return tuple(moved(cells, now) for cells in system.volume.kinds)


def _forces(here: Cells, stress: Floats) -> Floats:
    """(n_e, nn, 2) [N] of stress : (n_e, nq, 4) [Pa] in cells where they are."""
    of = np.einsum("eqij,eqaj->eqai", stress[..., SHAPE], here.B)
    # fault: a hoop stress pushes nothing -> pass | mechanical_fmu/test_displaced
    of[..., 0] += here.N_over_R * stress[..., 3, None]
    return np.asarray(np.einsum("eq,eqai->eai", here.weight, of))


def _unknown(system: System) -> NDArray[np.bool_]:
    """(n_nodes,) whether a node is of a body of a single row of quads of one dilatation."""
    fit, interface = system.nodal_stress, system.interface
    there, n_bodies = np.zeros(len(interface.nodes), dtype=bool), len(interface.bodies)
    there[fit.node[fit.known]] = True
    in_row, every = np.zeros(n_bodies), np.zeros(n_bodies)
    for cells in system.volume.kinds:
        row = ~there[cells.nodes].any(axis=1) & (cells.treatment == ELASTIC) & (cells.nodes.shape[1] == QUAD)
        in_row += np.bincount(cells.body, row * cells.volume, n_bodies)
        every += np.bincount(cells.body, cells.volume, n_bodies)
    # fault: of a single row of quads its deflection is told -> return np.zeros(len(there), dtype=bool) |
    #   mechanical_fmu/test_displaced
    return np.asarray((in_row > IN_A_ROW * every)[interface.node_body])
