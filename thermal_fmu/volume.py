"""Conduction and storage inside the bodies: by the cells of this half, or by the solver of another package.

>>> from thermal_fmu import ThermalVolume, thermal_half

A half made with `thermal_half` is the half `thermal` in all but its matrices: contact, films, radiation, sources,
prescribed temperatures, time stepping, damping after jumps, balances, discards and state are the same code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, spmatrix

from contact.half.functions import Property
from contact.half.interface import Interface
from contact.half.linalg import Pattern
from contact.half.volume import VolumeError, VolumeMesh, on_pattern, volume_mesh
from thermal_fmu.cells import (
    BadPropertyError,
    CellGeometry,
    CellMesh,
    MatrixCache,
    MatrixEntries,
    ReferenceCells,
    capacities,
    conduct,
    store,
)
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.problem import Model, ThermalBody

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class VolumeMaterial:
    """rho [kg/m3] of the reference; k [W/mK] and c [J/kgK] are functions of T, `.constant` their number where they are.
    """

    rho: float
    k: Property
    c: Property


class ThermalVolume(ABC):
    """Conduction and storage inside bodies, by any solver whose unknowns are the temperatures of the mesh's nodes."""

    @abstractmethod
    def start(self, mesh: VolumeMesh, materials: tuple[VolumeMaterial, ...]) -> None:
        """Take the mesh and the material of each of its parts; once, before anything else."""

    @abstractmethod
    def matrices(self, x: Floats, T: Floats) -> tuple[Any, Any, Any]:
        """Return M, K, f on coordinates x : (n, 2) [m] at temperatures T : (n,) [K], from these arguments alone.

        M : (n, n) or (n,) [J/K] heat capacity; it is taken by its row sums, for heat is stored at nodes (docs/design.md
        says why).  K : (n, n) [W/K], sparse, K T being the heat that leaves the nodes; it couples nodes of one cell
        only.  f : (n,) [W] heat made in the bodies beside the scene's own sources, or None.
        """


@dataclass(frozen=True)
class Coordinates:
    """x : (n, 2) where nodes are [m].  X : (n, 2) where they were at the start, which sets the mass."""

    x: Floats
    X: Floats


class InsideData(Protocol):
    """What the inside of bodies takes of a substep's data (scene.SubstepData).

    masses, shapes : of the blocks of cells.  place : where nodes are, for a given volume.
    """

    @property
    def masses(self) -> Sequence[ReferenceCells]: ...

    @property
    def shapes(self) -> Sequence[CellGeometry]: ...

    @property
    def place(self) -> Coordinates | None: ...


class Bulk(Protocol):
    """What a stage's heat balance asks of the inside of bodies.  Arguments as of the functions in cells.py."""

    def fill(self, substep: InsideData, into: MatrixEntries, stores: bool) -> MatrixEntries:
        """Put in the entries that are known already, and note which."""
        ...

    def store(self, substep: InsideData, s0: Floats, s: Floats, S: Floats, into: MatrixEntries) -> Floats:
        """Add storage from s0 to s : (n,) [K]; returns (n_bodies,) [J]."""
        ...

    def conduct(self, substep: InsideData, at: NodalFields, f: Floats, into: MatrixEntries) -> None:
        """Add conduction: f : (n,) [W] -= the heat that leaves each node."""
        ...

    def capacities(self, substep: InsideData, s: Floats) -> Floats:
        """Return the heat capacities (n,) [J/K] of the nodes."""
        ...

    def made(self, substep: InsideData, at: NodalFields) -> Floats | None:
        """Return heat (n,) [W] that the volume makes itself, None where it makes none."""
        ...


@dataclass(frozen=True)
class OwnCells:
    """The inside of bodies by the cells of this half."""

    volume: CellMesh
    parts: tuple[ThermalBody, ...]
    cache: MatrixCache

    def fill(self, substep: InsideData, into: MatrixEntries, stores: bool) -> MatrixEntries:
        """As Bulk."""
        return self.cache.fill(self.volume, self.parts, substep.masses, substep.shapes, into, stores)

    def store(self, substep: InsideData, s0: Floats, s: Floats, S: Floats, into: MatrixEntries) -> Floats:
        """As Bulk."""
        return store(self.volume, substep.masses, self.parts, s0, s, S, into)

    def conduct(self, substep: InsideData, at: NodalFields, f: Floats, into: MatrixEntries) -> None:
        """As Bulk."""
        conduct(self.volume, substep.shapes, self.parts, at, f, into)

    def capacities(self, substep: InsideData, s: Floats) -> Floats:
        """As Bulk."""
        return capacities(self.volume, substep.masses, self.parts, s)

    def made(self, substep: InsideData, at: NodalFields) -> Floats | None:
        """As Bulk."""
        return None


@dataclass(frozen=True)
class _Matrices:
    """What a volume gave.  x, T : it was asked for.  C : (n,) [J/K].  K : on the pattern.  f : (n,) [W] or None."""

    x: Floats
    T: Floats
    C: Floats
    K: csr_matrix
    f: Floats | None


class GivenVolume:
    """The inside of bodies by a ThermalVolume.

    Heat is stored at the nodes, at the capacity of the mean of both temperatures: exact where c is linear in T.  K is
    its own derivative but for that of k by T, which costs iterations where k varies, not accuracy.
    What is kept is what would be asked for again, so it is no part of the state.
    """

    def __init__(self, given: ThermalVolume, interface: Interface, model: Model, pattern: Pattern) -> None:
        """Raises ValueError for a material that no ThermalVolume is told of."""
        self._given, self._pattern = given, pattern
        self._body, self._n_bodies = interface.node_body, len(interface.bodies)
        self._diagonal = np.flatnonzero(np.repeat(np.arange(pattern.n), np.diff(pattern.indptr)) == pattern.indices)
        materials = volume_materials(model)
        self._constant = all(m.k.is_constant and m.c.is_constant for m in materials) and not getattr(
            given, "depends_on_T", False)
        self._kept: list[_Matrices] = []
        given.start(volume_mesh(interface), materials)

    def fill(self, substep: InsideData, into: MatrixEntries, stores: bool) -> MatrixEntries:
        """As Bulk: nothing is known before."""
        return into

    def store(self, substep: InsideData, s0: Floats, s: Floats, S: Floats, into: MatrixEntries) -> Floats:
        """As Bulk."""
        C = self._at(_place(substep).X, 0.5 * (s0 + s)).C
        # fault: a given volume stores half its heat -> dE = 0.5 * C * (s - s0) | thermal_fmu/test_given_volume
        dE = C * (s - s0)
        S += dE
        if into.data.size:
            into.data[self._diagonal] += C
        own = self._body >= 0
        return np.asarray(np.bincount(self._body[own], weights=dE[own], minlength=self._n_bodies), dtype=np.float64)

    def conduct(self, substep: InsideData, at: NodalFields, f: Floats, into: MatrixEntries) -> None:
        """As Bulk."""
        # fault: a given volume conducts on the reference -> K = self._at(_place(substep).X, at.T).K |
        #   thermal_fmu/test_given_volume
        K = self._at(_place(substep).x, at.T).K
        f -= K @ at.T
        if into.data.size:
            np.add(into.data, into.slope * K.data, out=into.data)

    def capacities(self, substep: InsideData, s: Floats) -> Floats:
        """As Bulk."""
        return self._at(_place(substep).X, s).C

    def made(self, substep: InsideData, at: NodalFields) -> Floats | None:
        """As Bulk."""
        return self._at(_place(substep).x, at.T).f

    def _at(self, x: Floats, T: Floats) -> _Matrices:
        for kept in self._kept:
            # fault: matrices kept though the bodies moved -> if self._constant: | thermal_fmu/test_given_volume
            if np.array_equal(kept.x, x) and (self._constant or np.array_equal(kept.T, T)):
                return kept
        found = self._asked(x, T)
        self._kept = [found, *self._kept][:KEPT]
        return found

    def _asked(self, x: Floats, T: Floats) -> _Matrices:
        # Copies: a solver may keep what it is given, and must not change ours.
        M, K, f = self._given.matrices(x.copy(), T.copy())
        C = np.asarray(M.sum(axis=1) if np.ndim(M) == 2 or isinstance(M, spmatrix) else M, dtype=np.float64).ravel()
        whose, pattern = f"{type(self._given).__name__}.matrices", self._pattern
        # fault: a volume that holds no heat is taken -> if False: | thermal_fmu/test_given_volume
        if C.shape != (pattern.n,) or not (C[self._body >= 0] > 0.0).all():
            raise BadPropertyError(f"{whose}: M has {C.size} row sums of {_range(C)} J/K; one above 0 for each of the "
                                   f"{pattern.n} nodes is needed")
        try:
            data = on_pattern(K, pattern, whose)
        except VolumeError as exc:
            raise BadPropertyError(str(exc)) from exc
        made = None if f is None else np.broadcast_to(np.asarray(f, dtype=np.float64), (pattern.n,))
        return _Matrices(x.copy(), T.copy(), C, csr_matrix((data, pattern.indices, pattern.indptr),
                                                           shape=(pattern.n, pattern.n)), made)


KEPT = 3  # matrices kept: of the reference, of where bodies are, and one that a rollback returns to


def _place(substep: InsideData) -> Coordinates:
    assert substep.place is not None, "the half says where its nodes are"
    return substep.place


def _range(values: Floats) -> str:
    return f"{values.min():.3g} to {values.max():.3g}" if values.size else "none"


def volume_materials(model: Model) -> tuple[VolumeMaterial, ...]:
    """Return the material of each part, as another solver is told it.  Raises ValueError."""
    return tuple(_told(part) for part in model.parts)


def _told(part: ThermalBody) -> VolumeMaterial:
    material = part.material
    if material.phase is not None:
        raise ValueError(f"body {part.name}: a ThermalVolume does not melt; leave `latent` out, or choose the half "
                         "thermal")
    if not material.k.is_plain:
        raise ValueError(f"body {part.name}: a ThermalVolume is told one conductivity, not one along each axis")
    return VolumeMaterial(material.rho, material.k.k_1.solid, material.c.solid)
