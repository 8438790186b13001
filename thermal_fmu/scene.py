"""What never changes of a scene, and what follows from it alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.surfaces import ContactSurfaces
from thermal_fmu.edges import edge_slots
from thermal_fmu.kept import KeptMatrix, KeptShapes
from thermal_fmu.phase import Melting, melting_of
from thermal_fmu.spec import Model
from thermal_fmu.volume import Reference, Volume, references_of, volume_of

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """Model, cells, surfaces, fixed nodes.

    fixed : (n,) True where T is prescribed (or no cell uses the node).
    """

    interface: Interface
    model: Model

    @cached_property
    def volume(self) -> Volume:
        return volume_of(self.interface)

    @cached_property
    def surfaces(self) -> ContactSurfaces:
        return ContactSurfaces(self.interface)

    @cached_property
    def film_slots(self) -> tuple[NDArray[np.int64], ...]:
        """Places in the matrix data of the edges of every film."""
        return tuple(edge_slots(self.volume.pattern, film.where.edges) for film in self.model.films)

    @cached_property
    def radiator_slots(self) -> tuple[NDArray[np.int64], ...]:
        """Places in the matrix data of the edges of every radiating surface."""
        return tuple(edge_slots(self.volume.pattern, r.where.edges) for r in self.model.radiators)

    @cached_property
    def fixed(self) -> NDArray[np.bool_]:
        fixed = self.interface.node_body < 0
        for boundary in self.model.prescribed:
            fixed[boundary.nodes] = True
        return fixed

    @cached_property
    def slave_nodes(self) -> NDArray[np.bool_]:
        """(n,) True on slave surfaces."""
        slave = np.zeros(self.volume.n, dtype=np.bool_)
        for pair in self.interface.pairs:
            slave[self.interface.surfaces[pair.slave]] = True
        return slave

    @cached_property
    def held_rows(self) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
        """Of the matrix data: which entries lie in a row or column of a fixed node, and their diagonal places."""
        pattern = self.volume.pattern
        row = np.repeat(np.arange(pattern.n), np.diff(pattern.indptr))
        touched = self.fixed[row] | self.fixed[pattern.indices]
        return touched, np.flatnonzero((row == pattern.indices) & self.fixed[row])

    @cached_property
    def kept_shapes(self) -> KeptShapes:
        """Shapes of the last coordinates."""
        return KeptShapes()

    @cached_property
    def kept_matrix(self) -> KeptMatrix:
        """Matrices of blocks with constant data."""
        return KeptMatrix()

    @cached_property
    def melting(self) -> tuple[Melting, ...]:
        """The bodies that melt."""
        return melting_of(self.interface.node_body, [body.material.phase for body in self.model.bodies])

    def masses(self, X: Floats) -> tuple[Reference, ...]:
        """Every block on reference coordinates X : (n, 2) [m]: its mass at quadrature points."""
        return references_of(self.volume, self.model.bodies, X)
