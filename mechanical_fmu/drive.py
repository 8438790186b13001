"""What drives a step: prescribed motions, loads and temperatures, at its end and on the way there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Values
from mechanical_fmu.laws.kinds import CREEP, LIQUID, OVERSTRESS
from mechanical_fmu.loads import driven, pressure_forces
from mechanical_fmu.system import System

Floats = NDArray[np.float64]

# Start value of the input f_s: no share of anything, so that a master that does not connect it gets f_s from T.
NOT_GIVEN = -1.0


@dataclass(frozen=True)
class StepDrive:
    """target : (n_fixed,) [m].  pressure : (n_pressures,) [Pa].  dead : (n_dead,) size of each dead load.

    T : (n_nodes,) [K].  f_s : (n_nodes,) solid fraction; (0,) where nobody gave it, and T says it.
    """

    target: Floats
    pressure: Floats
    dead: Floats
    T: Floats
    f_s: Floats


def drive_of(system: System, inputs: Values, t: float, side: int) -> StepDrive:
    """Compute the drive at time t [s], from the given side of a jump (-1 before it, 1 after it)."""
    spec = system.spec
    pressure = [driven(p.value, p.name, t, side, inputs) for p in spec.pressures]
    dead = [driven(d.value, d.name, t, side, inputs) for d in spec.dead]
    T = np.array(inputs["T"], dtype=np.float64, order="C")
    return StepDrive(system.constraints.values(t, side, inputs), np.array(pressure), np.array(dead), T, _given(inputs))


def between(a: StepDrive, b: StepDrive, share: float) -> StepDrive:
    """Compute the drive after a share of the way from a to b; b itself at its end."""
    if share == 1.0:
        return b
    return StepDrive(*(x + share * (y - x) for x, y in
                       ((a.target, b.target), (a.pressure, b.pressure), (a.dead, b.dead), (a.T, b.T),
                        (a.f_s if a.f_s.size == b.f_s.size else b.f_s, b.f_s))))


def _given(inputs: Values) -> Floats:
    """f_s as it was given, or nothing while all of it is at its start value."""
    f_s = np.array(inputs.get("f_s", ()), dtype=np.float64, order="C")
    return np.empty(0) if (f_s == NOT_GIVEN).all() else f_s


# Whether a step is worth solving: how far its inputs could move anything, to first order.
#
#     du ~ max|d target| + max(|d e_th|/3 + |d mu|/mu |u|/L) L + sum|dF| L/(E size)
# with L the size of a body and size = L per metre depth (2 pi r L when axisymmetric).  Bodies that bend move more than
# this says: there, a smaller bound is the remedy.  The change is counted from the last step that was solved, so what is
# skipped adds up and never drifts.

def may_skip(system: System) -> bool:
    """Say whether nothing moves while the inputs stand still: no creep, no flow in time."""
    return not any(m.kind & (CREEP | OVERSTRESS | LIQUID) for m in system.spec.materials)


def expected_change(system: System, solved: StepDrive, now: StepDrive, u: Floats) -> float:
    """Estimate max|du| [m] from the inputs last solved for to those of now, about u : (n_nodes, 2) [m]."""
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


def _change_of_forces(system: System, solved: StepDrive, now: StepDrive, u: Floats) -> Floats:
    change = np.zeros_like(u)
    if now.dead.size:
        change += system.masses.dead.at(now.dead - solved.dead)
    x = system.interface.nodes + u
    for load, p in zip(system.loads, now.pressure - solved.pressure, strict=True):
        if p != 0.0:
            forces = pressure_forces(x, load.edges, np.full(len(load.edges), p), system.interface.axisymmetric)
            np.add.at(change, load.edges, forces)
    return change
