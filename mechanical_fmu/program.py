"""Deformation of bodies by a program: what it is told of a state of loads, and what it answers.

>>> from mechanical_fmu import DisplacementAnswer, ForceTask, MechanicalProgram, mechanical_program_half
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.volume import VolumeMesh
from mechanical_fmu.given import ElasticMaterial

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ForceTask:
    """An equilibrium that a program is to find, from the reference.

    T : (n,) [K].  force : (n, 2) on the nodes, of any direction, 0 at prescribed components [N].
    fixed : (m,) prescribed components, 2 node + component.  u_fixed : (m,) their displacements [m].
    """

    T: Floats
    force: Floats
    fixed: NDArray[np.intp]
    u_fixed: Floats


@dataclass(frozen=True)
class DisplacementAnswer:
    """u : (n, 2) [m].  reaction : (m,) [N] with which the bodies resist at `fixed`: their internal force there."""

    u: Floats
    reaction: Floats


class MechanicalProgram(ABC):
    """Deformation of bodies by a program.

    takes : at contact surfaces "force" (it gives the displacement), or "displacement" (it gives the force), which
    bodies need that contact alone holds.
    """

    takes = "force"

    @abstractmethod
    def start(self, mesh: VolumeMesh, materials: tuple[ElasticMaterial, ...]) -> None:
        """Take the mesh and the material of each of its parts; once, before anything else.  Raises ValueError."""

    @abstractmethod
    def solve(self, task: ForceTask) -> DisplacementAnswer:
        """Find the equilibrium, from the task alone: the same task has the same answer.  Raises ProgramError."""
