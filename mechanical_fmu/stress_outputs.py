"""Stress and strain after a step, and what the mesh misses of it, worked out when somebody asks for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Outputs, Value, Variable
from mechanical_fmu.advance import StepDrive, StepResult
from mechanical_fmu.locking import locked_energy, locks
from mechanical_fmu.material import Moduli
from mechanical_fmu.recovery import (
    Stressed,
    dropped_energy,
    heat_energy,
    held_pressure,
    log_volume,
    missed_energy,
    rounding_energy,
    stress_of_stretch,
    uneven_energy,
)
from mechanical_fmu.system import Loading, System
from mechanical_fmu.volume import PointStep, von_mises

Floats = NDArray[np.float64]
NORMAL = np.array([1.0, 1.0, 0.0, 1.0])  # of the components 11, 22, 12, 33


@dataclass(frozen=True)
class Moved:
    """What a step began with.  loading, end : at its end.  u : (n, 2) [m], history : of points, drive : at its start.

    frozen : whether its entropy was held.
    """

    loading: Loading
    u: Floats
    history: Floats
    drive: StepDrive
    frozen: bool
    end: StepDrive


def stress_variables(system: System) -> tuple[Variable, ...]:
    """List what stress_outputs gives, side by side: who reads what lies near reads none of it by the way."""
    n = system.volume.n_cells
    strains = (Variable("strain", (n, 4), description="Green-Lagrange strain 11, 22, 12, 33, cell mean", on="cells"),
               Variable("max_strain_increment"))
    if not system.volume.tells_stress:
        return strains
    # fault: the hoop stress has no name of its own -> hoop = () | coupler/test_one_pressure
    hoop = (Variable("sigma_hoop", (n,), unit="Pa", description="hoop stress, cell mean", on="cells"),)
    return (Variable("sigma_v", (n,), unit="Pa", description="von Mises stress, cell mean", on="cells"),
            Variable("sigma", (n, 4), unit="Pa", description="stress 11, 22, 12, 33, cell mean", on="cells"),
            *(hoop if system.interface.axisymmetric else ()), *strains,
            *((Variable("elastic_strain", (n, 4), unit="1", on="cells",
                        description="strain 11, 22, 12, 33 that the stress needs by linear elasticity, cell mean"),)
              if _remembers(system) else ()))


def _remembers(system: System) -> bool:
    """Whether stress may change while shape and temperature stay: something flows or creeps, and its stress is known.

    Elsewhere stress follows from x and T.
    """
    # fault: bodies that creep do not tell their elastic strain -> return False |
    #   coupler/test_estimate_strain::test_stress_that_relaxes_is_as_exact_as_its_tolerance
    return system.volume.makes_heat and system.volume.tells_stress


def mesh_variables(system: System) -> tuple[Variable, ...]:
    """List what is told of the mesh, of each body with cells that this half solves itself."""
    if not system.volume.tells_stress or system.program is not None:
        return ()
    told = (("missed", "strain energy that the mesh of the body misses, estimated"),
            ("energy", "strain energy of the body's stress, without what plane strain holds across the plane"),
            ("heat", "strain energy of the body's thermal strain, were it held along one direction"),
            ("uneven", "the same of what its thermal strain differs from its mean"))
    return tuple(Variable(f"mesh.{what}.{name}", unit="J", description=text)
                 for name in _bodies_with_cells(system) for what, text in told)


def _bodies_with_cells(system: System) -> dict[str, int]:
    bodies = {int(b) for cells in system.volume.kinds for b in np.unique(cells.body)}
    return {system.interface.bodies[b]: b for b in sorted(bodies)}


def stress_outputs(system: System, found: StepResult, moved: Moved) -> Outputs:
    """Give stress [Pa] and strain [1] at the end of a step, and the largest change of strain over it.

    Of elastic bodies when they are asked for.  Points with a history may fail at it, and then the step has to.
    """
    if not system.volume.elastic:
        return _stresses(system, found, moved)
    # What is kept until then is to be small.
    found = replace(found, balance=replace(found.balance, entries=None, tractions=None))
    told = [v.name for v in (*stress_variables(system), *mesh_variables(system))]
    sizes = _Sizes(system, found.balance.u, moved.loading.moduli)
    apart: dict[str, Callable[[], Value]] = {
        name: partial(getattr, sizes, name) for name in ("sigma_v", "sigma_hoop") if name in told}
    return Outputs({}, tuple(name for name in told if name not in apart), partial(_stresses, system, found, moved),
                   apart)


@dataclass(frozen=True)
class _Sizes:
    """The sizes of the stress, which a run asks for in every window, and of frames alone for the rest."""

    system: System
    u: Floats
    moduli: tuple[Moduli, ...]

    @cached_property
    def _both(self) -> tuple[Floats, Floats]:
        return self.system.volume.stress_sizes(self.u, self.moduli)

    @property
    def sigma_v(self) -> Floats:
        """(n_cells,) [Pa]."""
        return self._both[0]

    @property
    def sigma_hoop(self) -> Floats:
        """(n_cells,) [Pa]."""
        return self._both[1]


def _of_mesh(system: System, now: tuple[tuple[Floats, Floats], ...], moduli: tuple[Moduli, ...], end: StepDrive,
             ends: tuple[Floats, Floats]) -> dict[str, Value]:
    """What mesh_variables lists [J].

    now : stress [Pa] and strain, (n_e, nq, 4) of each kind.  end : what drives the bodies there.  ends : (n_nodes, 2)
    [m] u at both ends of the step.
    """
    volume, n_nodes = system.volume, len(system.interface.nodes)
    n_bodies, free = len(system.interface.bodies), system.expansion(end.T, end.f_s)
    plane = not system.interface.axisymmetric
    heat = [held_pressure(cells, of, m) if plane else None
            for cells, of, m in zip(volume.kinds, free, moduli, strict=True)]
    log_J = [log_volume(strain) for _, strain in now]
    # What flows has an energy of its logarithmic strain, which is that of Hooke's law.
    stress = [of if cells.treatment.kind else stress_of_stretch(of, J, m)
              for cells, (of, _), J, m in zip(volume.kinds, now, log_J, moduli, strict=True)]
    of = Stressed(stress, log_J, system.nodal_stress, heat)
    missed, energy = missed_energy(volume.kinds, of, moduli, n_nodes, n_bodies, plane)
    # fault: heat that cells drop is not told -> dropped = np.zeros_like(missed) |
    #   mechanical_fmu/test_thermal_bending
    dropped = dropped_energy(volume.kinds, free, moduli, n_bodies)
    missed = missed + dropped
    # fault: what triangles lock is not told -> if False: | mechanical_fmu/test_locking
    if locks(volume.kinds, moduli):
        missed = missed + locked_energy(system.interface, system.interface.nodes + ends[1], system.constraints.free,
                                        volume.kinds, of.pressure_jumps(volume.kinds, n_nodes), moduli)
    # A body that comes back through the origin has the rounding of where it came from.
    # fault: what passes the origin has no rounding -> x = np.abs(system.interface.nodes + ends[1]) |
    #   mechanical_fmu/test_recovery
    x = np.maximum(*(np.abs(system.interface.nodes + u) for u in ends))
    # A body that bears nothing has a stress of rounding, and most of that is not recovered.
    # fault: stress of rounding is told as that of a load -> bears = missed >= 0.0 | mechanical_fmu/test_recovery
    bears = missed + energy > rounding_energy(volume.kinds, moduli, x, n_bodies)
    told = {"missed": bears * missed, "energy": bears * energy,
            "heat": heat_energy(volume.kinds, free, moduli, n_bodies),
            "uneven": uneven_energy(volume.kinds, free, moduli, n_bodies)}
    return {f"mesh.{what}.{name}": float(of[b]) for name, b in _bodies_with_cells(system).items()
            for what, of in told.items()}


def _elastic_strain(system: System, sigma: Floats, moduli: tuple[Moduli, ...]) -> Floats:
    """(n_cells, 4) strain [1], 11, 22, 12 (of the tensor), 33, of stress sigma : (n_cells, 4) [Pa]."""
    strain = np.zeros_like(sigma)
    for cells, m in zip(system.volume.kinds, moduli, strict=True):
        of = sigma[cells.number]
        p = of[:, [0, 1, 3]].mean(axis=1)
        # fault: pressure alone has no elastic strain -> squeezed = np.zeros_like(p) | mechanical_fmu/test_fields
        squeezed = p / (3.0 * m.kappa) - p / (2.0 * m.mu)
        strain[cells.number] = of / (2.0 * m.mu[:, None]) + squeezed[:, None] * NORMAL
    return strain


def _stresses(system: System, found: StepResult, moved: Moved) -> Outputs:
    """(n_cells, 4) stress [Pa] and strain [1], 11, 22, 12, 33, and (n_cells,) von Mises stress [Pa], means in a cell.

    And the largest change of a Green-Lagrange component over the step, each end by the history and moduli of its own.
    What is told of the mesh waits until it is asked for.
    """
    volume, moduli = system.volume, moved.loading.moduli
    # At its end a history knows all stresses but a liquid's, which is of the rate and needs the last piece itself.
    # fault: a liquid's stress lost after its step -> now = volume.stress(found.balance.u, moduli, PointStep(0.0,
    #   found.balance.history)) | mechanical_fmu/test_solution_melting
    now = volume.stress(found.balance.u, moduli, found.last if system.melts else PointStep(0.0, found.balance.history))
    sigma, strain, sigma_v = np.zeros((volume.n_cells, 4)), np.zeros((volume.n_cells, 4)), np.zeros(volume.n_cells)
    for cells, (stress, green) in zip(volume.kinds, now, strict=True):
        # fault: shear for thickness in the stress that goes out -> sigma[cells.number], sigma_v[cells.number] =
        #   stress[:, :, [0, 1, 3, 2]].mean(axis=1), von_mises(stress).mean(axis=1) | mechanical_fmu/test_solution_fmu
        sigma[cells.number], sigma_v[cells.number] = stress.mean(axis=1), von_mises(stress).mean(axis=1)
        strain[cells.number] = green.mean(axis=1)
    then = moduli if volume.elastic else system.moduli(moved.drive.T, moved.drive.f_s)
    # fault: strain before a step by the history after it -> before = volume.stress(moved.u, then, PointStep(0.0,
    #   found.balance.history)) | mechanical_fmu/test_solution_melting
    before = volume.stress(moved.u, then, PointStep(0.0, moved.history))
    increment = max([float(np.abs(a[1] - b[1]).max()) for a, b in zip(now, before, strict=True)], default=0.0)
    out: dict[str, Value] = {"strain": strain, "max_strain_increment": increment}
    if volume.tells_stress:
        out |= {"sigma": sigma, "sigma_v": sigma_v}
    if _remembers(system):
        out["elastic_strain"] = _elastic_strain(system, sigma, moduli)
    if system.interface.axisymmetric and volume.tells_stress:
        # fault: the axial stress is told as the hoop stress -> out["sigma_hoop"] = sigma[:, 1].copy() |
        #   mechanical_fmu/test_fields
        out["sigma_hoop"] = sigma[:, 3].copy()
    return Outputs(out, tuple(v.name for v in mesh_variables(system)),
                   partial(_of_mesh, system, now, moduli, moved.end, (moved.u, found.balance.u)))
