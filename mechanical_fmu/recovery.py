"""How much strain energy a mesh misses: stress of the cells against a smoother one, recovered at nodes.

Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337 and 33 (1992) 1331: stress recovered at nodes is nearer
to the exact one than that of the cells, so what lies between the two, in the energy norm, estimates the error of the
mesh.  At a node a field of first order is fitted to the means of the cells around, of one body and one material (where
these change stress may jump; contact/half/nodal_stress.py), and interpolated: what is linear all over is recovered as
it is.  In a body of a single row of cells each cell's stress at its points is carried on to its nodes and averaged
there by volume.  Of a body of one cell nothing can be said.

Cells of one dilatation take the mean of theirs, so what it differs from that costs them no energy; they are softer
by that, and may be softer than the body.  Let u be exact and u_h that of the cells, p and p_h the pressures, a the
energy of the deviator, P the mean in a cell.  The forces f of a load do work f u, with

    f u - f u_h = a(u - u_h, u - u_h) + |p - p_h|^2/kappa - 2 (p - P p, div u_h - P div u_h),

because a(u_h, v) + (p_h, div v) = f v and p_h = kappa P div u_h.  With the recovered p the last term is known, and
what a cell misses is the size of all three: in bending by plane strain most of it cancels.

Energies are those of Hooke's law, and at large strain Cauchy stress has no such energy: where rubber is stretched
fivefold it has ten times what is stored there, and a glued corner counted for more than all of a pad.  So of points of
the neo-Hookean energy stress is taken as 2 mu dev V, V the stretch along its axes, beside the pressure: that has about
their energy at any strain (mu/2 (tr V V - 3), within an eighth up to V = 2), and is their stress at small strain.

Stress that no cell has cannot be recovered.  Heat that changes within cells of one thermal strain makes such a stress:
they take its mean, and one cell through a thickness does not bend by heat at all.  Its energy is added.

In plane strain the thickness is held, and heat makes E alpha dT across the plane, which no deformation relieves.  That
energy says nothing of a mesh: only what the plane can relieve counts.  How far heat bends or warps a body hangs on how
much its free strain changes within the body: a free plate that bows has no stress, and what its cells make of it is
held against the energy of that change (uneven_energy).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from contact.half.nodal_stress import NodalStress
from mechanical_fmu.cells import ELASTIC, Cells
from mechanical_fmu.laws.catalogue import flow_stress
from mechanical_fmu.laws.law import CREEP, LIQUID, PLASTIC, Points
from mechanical_fmu.material import Moduli

Floats = NDArray[np.float64]
STEPS = 60  # of Newton's method for the trace of V V, from above; 4 to 8 are made
ROUND = 1e-14  # of it
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


def stress_of_stretch(stress: Floats, log_J: Floats, moduli: Moduli) -> Floats:
    """Return (n_e, nq, 4) [Pa] p + 2 mu dev V of points that have a neo-Hookean energy, whose energy is Hooke's.

    stress : (n_e, nq, 4) [Pa] Cauchy, of the pressure p.  log_J : (n_e, nq) [1] of their volume.
    """
    found = np.empty_like(stress)
    # fault: stress counts as in small strain wherever it is -> return stress | mechanical_fmu/test_recovery
    _stretched(stress, np.exp(log_J), moduli.mu, found)
    return found


@kernel
def _stretched(stress: Floats, J: Floats, mu: Floats, found: Floats) -> None:
    """Fill found.  J dev stress/mu = d is the deviator of V V = 1 + z + d, whose volume is 1: det(1 + z + d) = 1."""
    for e in range(stress.shape[0]):
        for q in range(stress.shape[1]):
            a, b, shear, c = stress[e, q]
            p, share = (a + b + c) / 3.0, J[e, q] / mu[e]
            mean, across = share * (0.5 * (a + b) - p), share * (c - p)
            half, slant = share * 0.5 * (a - b), share * shear
            r = np.hypot(half, slant)
            second = mean * mean + r * r + 0.5 * across * across
            third = (mean * mean - r * r) * across
            # Of z z z + 3 z z + (3 - second) z + third - second the largest root, from above.
            z = np.sqrt(second) + max(-third, 0.0) ** (1.0 / 3.0)
            for _ in range(STEPS):
                slope = 3.0 * z * z + 6.0 * z + 3.0 - second
                less = (((z + 3.0) * z + 3.0 - second) * z + third - second) / slope if slope > 0.0 else 0.0
                z -= less
                if not abs(less) > ROUND * abs(z):
                    break
            # Stretches less 1, exact where they are small.
            most, least, out = mean + r + z, mean - r + z, across + z
            most = most / (np.sqrt(max(1.0 + most, 0.0)) + 1.0)
            least = least / (np.sqrt(max(1.0 + least, 0.0)) + 1.0)
            out = out / (np.sqrt(max(1.0 + out, 0.0)) + 1.0)
            third_of, turn = (most + least + out) / 3.0, 2.0 + most + least
            found[e, q, 0] = p + 2.0 * mu[e] * (0.5 * (most + least) - third_of + half / turn)
            found[e, q, 1] = p + 2.0 * mu[e] * (0.5 * (most + least) - third_of - half / turn)
            found[e, q, 2] = 2.0 * mu[e] * slant / turn
            found[e, q, 3] = p + 2.0 * mu[e] * (out - third_of)


def recovered(kinds: Sequence[Cells], stress: Sequence[Floats], n_nodes: int, fit: NodalStress | None = None
              ) -> list[Floats]:
    """Return the recovered stress at the points of every kind, (n_e, nq, 4) [Pa].

    stress : likewise, of the cells.  fit : to their means, where it is known; None: it is averaged everywhere.
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
    if fit is not None:
        means = np.zeros((fit.fit.shape[1], 4))
        for cells, of in zip(kinds, stress, strict=True):
            means[cells.number] = (of * cells.weight[..., None]).sum(axis=1) / cells.volume[:, None]
        # Rigid bodies have parts too, and no cells here.
        known = fit.known & (fit.part < parts)
        # fault: nothing is fitted -> known[:] = False | mechanical_fmu/test_recovery
        mean[(fit.part * n_nodes + fit.node)[known]] = (fit.fit @ means)[known]
    return [np.einsum("qa,eai->eqi", cells.N, mean[at]) for cells, at in zip(kinds, rows, strict=True)]


def log_volume(strain: Floats) -> Floats:
    """Return ln J : (...,) of strain : (..., 4) of Green and Lagrange, 11, 22, 12, 33."""
    a, b, shear, c = np.moveaxis(2.0 * strain, -1, 0)
    return np.asarray(0.5 * np.log(((1.0 + a) * (1.0 + b) - shear**2) * (1.0 + c)))


def held_pressure(cells: Cells, free: Floats, m: Moduli) -> Floats | None:
    """Return (n_e, nq) [Pa] what heat presses across elastic cells whose thickness is held; None of others.

    free : (n_e, nq) [1] free strain.
    """
    if cells.treatment.kind or cells.treatment.plane_stress:
        return None
    of = free if cells.treatment.enhanced else np.broadcast_to(
        ((free * cells.weight).sum(axis=1) / cells.volume)[:, None], free.shape)
    return np.asarray(m.E[:, None] * of)


def relieved_energy(cells: Cells, smooth: Floats, dilatation: Floats) -> Floats:
    """Return (n_e,) [J] the last term of the sum above, halved, of elastic cells that have one dilatation; else 0.

    What flows does so at nearly constant volume in the mean of a cell, and not at its points: that relieves nothing.

    smooth : (n_e, nq, 4) [Pa] recovered.  dilatation : (n_e, nq) [1] at the points.
    """
    # fault: cells of one dilatation are told to be stiff -> if True: | mechanical_fmu/test_recovery
    if cells.treatment != ELASTIC:
        return np.zeros(len(cells.nodes))
    p, share = smooth[..., [0, 1, 3]].mean(axis=-1), cells.weight / cells.volume[:, None]
    apart = [of - (of * share).sum(axis=1, keepdims=True) for of in (p, dilatation)]
    return np.asarray((apart[0] * apart[1] * cells.weight).sum(axis=1))


@dataclass(frozen=True)
class Stressed:
    """What is looked at of a mesh, of each kind of cells.

    stress : (n_e, nq, 4) [Pa].  dilatation : (n_e, nq) [1]; None: that of cells is one.  fit : as of `recovered`.
    heat : (n_e, nq) [Pa] E times the free strain of elastic cells whose thickness is held, which makes as much pressure
    across them; None where what is across counts for nothing.
    """

    stress: Sequence[Floats]
    dilatation: Sequence[Floats] | None = None
    fit: NodalStress | None = None
    heat: Sequence[Floats | None] | None = None

    def pressure_jumps(self, kinds: Sequence[Cells], n_nodes: int) -> list[Floats]:
        """Return how far the recovered pressure is above that of the cells, (n_e, nq) [Pa], tension positive."""
        stress = self.without_heat()
        return [(smooth - of)[..., [0, 1, 3]].mean(axis=-1)
                for smooth, of in zip(recovered(kinds, stress, n_nodes, self.fit), stress, strict=True)]

    def without_heat(self) -> list[Floats]:
        """Return the stress, (n_e, nq, 4) [Pa], without that of heat across the plane."""
        # fault: heat that is held across the plane is missed -> heat = [None] * len(self.stress) |
        #   mechanical_fmu/test_recovery
        heat = self.heat or [None] * len(self.stress)
        return [of if across is None else np.concatenate([of[..., :3], of[..., 3:] + across[..., None]], axis=-1)
                for of, across in zip(self.stress, heat, strict=True)]


def missed_energy(kinds: Sequence[Cells], of: Stressed, moduli: Sequence[Moduli], n_nodes: int, n_bodies: int,
                  plane: bool = False, signed: bool = False) -> tuple[Floats, Floats]:
    """Return what the mesh misses of each body's strain energy, and that energy, (n_bodies,) [J] each.

    plane : the scene is plane, so that cells without plane stress have a thickness that is held.  signed : where cells
    are too soft it counts below 0.
    """
    missed, energy = np.zeros(n_bodies), np.zeros(n_bodies)
    stress = of.without_heat()
    smooth = recovered(kinds, stress, n_nodes, of.fit)
    for k, (cells, m) in enumerate(zip(kinds, moduli, strict=True)):
        held = plane and not cells.treatment.plane_stress and (of.heat is None or of.heat[k] is None)
        off = 0.5 * energies(smooth[k] - stress[k], m, cells.weight, held)
        if of.dilatation is not None:
            off = off - relieved_energy(cells, smooth[k], of.dilatation[k])
        missed += np.bincount(cells.body, off if signed else np.abs(off), n_bodies)
        energy += np.bincount(cells.body, 0.5 * energies(stress[k], m, cells.weight, held), n_bodies)
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
