"""The inside of bodies by the solver of another package: forces and stiffness from displacements and temperatures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from contact.half.linalg import Pattern, pattern_of
from contact.half.volume import VolumeError, VolumeMesh, on_pattern
from mechanical_fmu.material import Moduli
from mechanical_fmu.volume import DeformableMesh, Internal, PointStep

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ElasticMaterial:
    """E [Pa], nu [1] and alpha [1/K] are functions of T, `.constant` their number where they are.  T_ref [K]."""

    E: Property
    nu: Property
    alpha: Property
    T_ref: float


class MechanicalVolume(ABC):
    """Internal forces of bodies, by any solver whose unknowns are the displacements of the mesh's nodes."""

    @abstractmethod
    def start(self, mesh: VolumeMesh, materials: tuple[ElasticMaterial, ...]) -> None:
        """Take the mesh and the material of each of its parts; once, before anything else."""

    @abstractmethod
    def forces(self, u: Floats, T: Floats) -> tuple[Any, Any]:
        """Return r, K at displacements u : (n, 2) [m] and temperatures T : (n,) [K], from these arguments alone.

        r : (n, 2) or (2 n,) [N] internal forces, 0 where nothing strains.  K : (2 n, 2 n) [N/m] its derivative, sparse,
        component x of node i in row 2 i, y in row 2 i + 1; it couples nodes of one cell only.
        """


@dataclass(frozen=True)
class GivenMesh(DeformableMesh):
    """A deformable mesh whose forces another package computes.  Its own cells say where nodes are coupled."""

    given: MechanicalVolume | None = None

    @property
    def skew(self) -> bool:
        """True: nobody knows whether the tangent is symmetric."""
        return True

    @property
    def tells_stress(self) -> bool:
        """False: stress is the other package's to know."""
        return False

    @cached_property
    def _pattern(self) -> Pattern:
        return pattern_of(2 * self.n_nodes, *(cells.dofs for cells in self.kinds))

    @cached_property
    def _shares(self) -> Floats:
        """(n_entries,) the share of each cell's entry in the matrix's."""
        slots = self._pattern.slots
        return np.asarray(1.0 / np.bincount(slots, minlength=self._pattern.indices.size)[slots])

    def evaluate(self, u: Floats, moduli: tuple[Moduli, ...], step: PointStep, tangent: bool = False) -> Internal:
        """As of DeformableMesh, at the temperatures that the moduli are of.  Raises VolumeError."""
        assert self.given is not None
        T = moduli[0].T
        assert T is not None, "System.moduli says of which temperatures"
        # Copies: a solver may keep what it is given, and must not change ours.
        r, K = self.given.forces(u.copy(), T.copy())
        whose = f"{type(self.given).__name__}.forces"
        f = np.asarray(r, dtype=np.float64).reshape(-1)
        # fault: forces that are no numbers are taken -> if False: | mechanical_fmu/test_given_volume
        if f.size != 2 * self.n_nodes or not np.isfinite(f).all():
            raise VolumeError(f"{whose}: r has {f.size} numbers, {np.isfinite(f).sum()} of them finite; two finite "
                              f"ones for each of the {self.n_nodes} nodes are needed")
        entries = None
        if tangent:
            # fault: a given stiffness is spread over its cells unevenly -> entries = on_pattern(K, self._pattern,
            #   whose)[self._pattern.slots] | mechanical_fmu/test_given_volume
            entries = on_pattern(K, self._pattern, whose)[self._pattern.slots] * self._shares
        return Internal(f.reshape(-1, 2).copy(), entries, np.empty(0), np.empty(0))
