"""How much strain energy a mesh misses: stress of the cells against a smoother one, recovered at nodes.

Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337: stress averaged at nodes is nearer to the exact one than
that of the cells, so what lies between the two, in the energy norm, estimates the error of the mesh.  Each cell's
stress at its points is carried on to its nodes, averaged there by volume among the cells of one body and one material
(where these change stress may jump), and interpolated: a field that is linear all over is recovered as it is.  Of a
body of one cell nothing can be said.

Stress that no cell has cannot be recovered.  Heat that changes within cells of one thermal strain makes such a stress:
they take its mean, and one cell through a thickness does not bend by heat at all.  Its energy is added.

In plane strain the thickness is held, and heat makes E alpha dT across the plane, which no deformation relieves.  That
energy says nothing of a mesh: only what the plane can relieve counts.  How far heat bends or warps a body hangs on how
much its free strain changes within the body: a free plate that bows has no stress, and what its cells make of it is
held against the energy of that change (uneven_energy).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from mechanical_fmu.cells import Cells
from mechanical_fmu.laws.catalogue import flow_stress
from mechanical_fmu.laws.law import CREEP, LIQUID, PLASTIC, Points
from mechanical_fmu.material import Moduli

Floats = NDArray[np.float64]
ROUNDED = 4.0  # units in the last place of a coordinate: what a sum of increments and the solution leave


def energies(stress: Floats, moduli: Moduli, weight: Floats, held: bool = False) -> Floats:
    """Return (n_e,) [J], twice the strain energy of stress : (n_e, nq, 4) [Pa], 11, 22, 12, 33, by linear elasticity.

    weight : (n_e, nq) reference volume of the points [m3].  held : the thickness is (plane strain), and what the stress
    across it is beside that of the stress in the plane is left out.
    """
    p = (stress[..., 0] + stress[..., 1] + stress[..., 3]) / 3.0
    normal = stress[..., [0, 1, 3]] - p[..., None]
    # fault: shear counts half in the energy -> squares = (normal**2).sum(axis=-1) + stress[..., 2] ** 2 |
    #   mechanical_fmu/test_recovery
    squares = (normal**2).sum(axis=-1) + 2.0 * stress[..., 2] ** 2
    density = squares / (2.0 * moduli.mu[:, None]) + p**2 / moduli.kappa[:, None]
    # fault: what heat does across a held thickness counts -> if False: | mechanical_fmu/test_recovery
    if held:
        nu = (3.0 * moduli.kappa - 2.0 * moduli.mu) / (6.0 * moduli.kappa + 2.0 * moduli.mu)
        across = stress[..., 3] - nu[:, None] * (stress[..., 0] + stress[..., 1])
        density = np.maximum(density - across**2 / moduli.E[:, None], 0.0)
    return np.asarray((density * weight).sum(axis=1))


def recovered(kinds: Sequence[Cells], stress: Sequence[Floats], n_nodes: int) -> list[Floats]:
    """Return the recovered stress at the points of every kind, (n_e, nq, 4) [Pa].

    stress : likewise, of the cells.
    """
    parts = max((int(cells.part.max()) for cells in kinds), default=0) + 1
    total, volume = np.zeros((parts * n_nodes, 4)), np.zeros(parts * n_nodes)
    rows = [cells.part[:, None].astype(np.intp) * n_nodes + cells.nodes for cells in kinds]
    for cells, of, at in zip(kinds, stress, rows, strict=True):
        nodal = np.einsum("aq,eqi->eai", np.linalg.pinv(cells.N), of)
        share = np.broadcast_to(cells.volume[:, None], at.shape)
        np.add.at(total, at, share[:, :, None] * nodal)
        np.add.at(volume, at, share)
    # fault: stress is not averaged at nodes -> mean = total | mechanical_fmu/test_recovery
    mean = np.divide(total, volume[:, None], out=np.zeros_like(total), where=volume[:, None] > 0.0)
    return [np.einsum("qa,eai->eqi", cells.N, mean[at]) for cells, at in zip(kinds, rows, strict=True)]


def missed_energy(kinds: Sequence[Cells], stress: Sequence[Floats], moduli: Sequence[Moduli], n_nodes: int,
                  n_bodies: int, plane: bool = False) -> tuple[Floats, Floats]:
    """Return what the mesh misses of each body's strain energy, and that energy, (n_bodies,) [J] each.

    plane : the scene is plane, so that cells without plane stress have a thickness that is held.
    """
    missed, energy = np.zeros(n_bodies), np.zeros(n_bodies)
    for cells, of, smooth, m in zip(kinds, stress, recovered(kinds, stress, n_nodes), moduli, strict=True):
        held = plane and not cells.treatment.plane_stress
        missed += np.bincount(cells.body, 0.5 * energies(smooth - of, m, cells.weight, held), n_bodies)
        energy += np.bincount(cells.body, 0.5 * energies(of, m, cells.weight, held), n_bodies)
    return missed, energy


def rounding_energy(kinds: Sequence[Cells], moduli: Sequence[Moduli], x: Floats, n_bodies: int) -> Floats:
    """Return the strain energy of each body, (n_bodies,) [J], that the rounding of x : (n_nodes, 2) [m] alone can make.

    A body that moves far, or is drawn far from the origin, has such a stress without any load.
    """
    energy = np.zeros(n_bodies)
    for cells, m in zip(kinds, moduli, strict=True):
        unit = ROUNDED * np.spacing(np.abs(x[cells.nodes]).max(axis=(1, 2)))
        strain = unit * np.abs(cells.B).sum(axis=(2, 3)).max(axis=1)
        energy += np.bincount(cells.body, 0.5 * m.E * strain**2 * cells.volume, n_bodies)
    return energy


def heat_energy(kinds: Sequence[Cells], expansion: Sequence[Floats], moduli: Sequence[Moduli],
                n_bodies: int) -> Floats:
    """Return the strain energy of each body, (n_bodies,) [J], if it were held along one direction as it expands.

    expansion : (n_e, nq) [1] free strain at the points of every kind.
    """
    energy = np.zeros(n_bodies)
    for cells, free, m in zip(kinds, expansion, moduli, strict=True):
        energy += np.bincount(cells.body, 0.5 * m.E * (free**2 * cells.weight).sum(axis=1), n_bodies)
    return energy


def uneven_energy(kinds: Sequence[Cells], expansion: Sequence[Floats], moduli: Sequence[Moduli],
                  n_bodies: int) -> Floats:
    """Return the strain energy of each body, (n_bodies,) [J], of how its free strain differs from the body's mean.

    expansion : (n_e, nq) [1] free strain at the points of every kind.  Each point is taken as held along one direction.
    """
    moments = np.zeros((2, n_bodies))
    for cells, free, m in zip(kinds, expansion, moduli, strict=True):
        for k in range(2):
            moments[k] += np.bincount(cells.body, m.E * (free**k * cells.weight).sum(axis=1), n_bodies)
    mean = np.divide(moments[1], moments[0], out=np.zeros(n_bodies), where=moments[0] > 0.0)
    uneven = np.zeros(n_bodies)
    for cells, free, m in zip(kinds, expansion, moduli, strict=True):
        off = free - mean[cells.body][:, None]
        uneven += np.bincount(cells.body, 0.5 * m.E * (off**2 * cells.weight).sum(axis=1), n_bodies)
    return uneven


def dropped_energy(kinds: Sequence[Cells], expansion: Sequence[Floats], moduli: Sequence[Moduli],
                   n_bodies: int) -> Floats:
    """Return the strain energy of each body, (n_bodies,) [J], of heat that its cells drop as they take its mean.

    expansion : (n_e, nq) [1] free strain at the points of every kind.  Each point is taken as held along one direction,
    E/2 (strain - mean)^2, and where it would yield by its yield stress.  Cells of enhanced strain drop nothing; of what
    creeps or melts nothing is counted: such a stress relaxes.
    """
    dropped = np.zeros(n_bodies)
    for cells, free, m in zip(kinds, expansion, moduli, strict=True):
        if cells.treatment.enhanced or cells.treatment.kind & (CREEP | LIQUID):
            continue
        E = m.E
        mean = (free * cells.weight).sum(axis=1) / cells.volume
        stress = E[:, None] * np.abs(free - mean[:, None])
        if cells.treatment.kind & PLASTIC:
            # fault: what is dropped knows no yield stress -> pass | mechanical_fmu/test_thermal_bending
            stress = np.minimum(stress, _yield_stress(m.p, m.tables)[:, None])
        dropped += np.bincount(cells.body, 0.5 * (stress**2 * cells.weight).sum(axis=1) / E, n_bodies)
    return dropped


@kernel
def _yield_stress(p: Points, tables: Floats) -> Floats:
    """(n_e,) [Pa] of cells that have not flowed yet."""
    found = np.empty(p.shape[0])
    for e in range(found.size):
        found[e] = flow_stress(p[e], tables, 0.0)[0]
    return found
