"""Whether a step is worth solving: how far its inputs could move anything, to first order.

    du ~ max|d target| + max(|d e_th|/3 + |d mu|/mu |u|/L) L + sum|dF| L/(E size)
with L the size of a body and size = L per metre depth (2 pi r L when axisymmetric).  Bodies that bend move more than
this says: there, a smaller bound is the remedy.  The change is counted from the last step that was solved, so what is
skipped adds up and never drifts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.drive import Drive
from mechanical_fmu.loads import pressure_forces
from mechanical_fmu.point_layout import CREEP, LIQUID, OVERSTRESS
from mechanical_fmu.system import System

Floats = NDArray[np.float64]


def may_skip(system: System) -> bool:
    """Whether nothing moves while the inputs stand still: no creep, no flow in time."""
    return not any(m.kind & (CREEP | OVERSTRESS | LIQUID) for m in system.spec.materials)


def expected_change(system: System, solved: Drive, now: Drive, u: Floats) -> float:
    """Estimate of max|du| [m] from the inputs last solved for to those of now, about u : (n, 2) [m]."""
    moved = np.abs(now.target - solved.target).max(initial=0.0)
    L = np.array([np.ptp(system.interface.nodes[system.interface.node_body == b], axis=0).max()
                  for b in range(len(system.interface.bodies))])
    largest, E = float(np.abs(u).max()), np.full(len(L), np.inf)
    strain = np.zeros(len(L))
    for cells, before, after in zip(system.volume.kinds, system.moduli(solved.T), system.moduli(now.T), strict=True):
        softer = np.abs(after.mu - before.mu) / before.mu
        change = np.abs(after.e_th - before.e_th) / 3.0 + softer * largest / L[cells.body]
        np.maximum.at(strain, cells.body, change)
        np.minimum.at(E, cells.body, 9.0 * after.kappa * after.mu / (3.0 * after.kappa + after.mu))
    forces = _change_of_forces(system, solved, now, u)
    node_force = np.abs(forces).sum(axis=1)
    on_body = np.bincount(system.constraints.holder + 1, weights=node_force, minlength=len(L) + 1)[1:]
    return float(moved + (strain * L).max(initial=0.0) + (on_body * L / (E * system.size)).max(initial=0.0))


def _change_of_forces(system: System, solved: Drive, now: Drive, u: Floats) -> Floats:
    change = np.zeros_like(u)
    if now.dead.size:
        change += system.masses.dead.at(now.dead - solved.dead)
    x = system.interface.nodes + u
    for load, p in zip(system.loads, now.pressure - solved.pressure, strict=True):
        if p != 0.0:
            forces = pressure_forces(x, load.edges, np.full(len(load.edges), p), system.interface.axisymmetric)
            np.add.at(change, load.edges, forces)
    return change
