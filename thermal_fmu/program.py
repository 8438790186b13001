"""Heat inside bodies by a program: what it is told of a step, and what it answers.

>>> from thermal_fmu import HeatAnswer, HeatTask, ThermalProgram, thermal_program_half
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.volume import VolumeMesh
from thermal_fmu.problem import Model
from thermal_fmu.volume import VolumeMaterial

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class HeatTask:
    """A step of implicit Euler that a program is to take.

    x : (n, 2) where nodes are [m], X : (n, 2) where they were at the start, which sets the mass.  dt : [s].
    T : (n,) at the start of the step [K].
    heat : (n,) into each node, through it and made in it, held through the step [W].
    nodes : (m,) at the surface, of a program that takes temperatures.  T_nodes : (m,) theirs at the end [K].
    """

    x: Floats
    X: Floats
    dt: float
    T: Floats
    heat: Floats
    nodes: NDArray[np.intp]
    T_nodes: Floats


@dataclass(frozen=True)
class HeatAnswer:
    """T : (n,) at the end of the step [K].  heat : (m,) that went into `nodes` [W], of one that takes temperatures."""

    T: Floats
    heat: Floats | None = None


class ThermalProgram(ABC):
    """Heat inside bodies by a program.

    takes : "heat" (it gives temperatures at all nodes), or "temperature" at the surface (it gives the heat there; it
    is told the heat at all other nodes).
    """

    takes = "heat"

    @abstractmethod
    def start(self, mesh: VolumeMesh, materials: tuple[VolumeMaterial, ...]) -> None:
        """Take the mesh and the material of each of its parts; once, before anything else.  Raises ValueError."""

    @abstractmethod
    def step(self, task: HeatTask) -> HeatAnswer:
        """Take a step, from the task alone: the same task has the same answer.  Raises ProgramError."""


def surface_nodes(interface: Interface) -> NDArray[np.intp]:
    """Return the numbers of the nodes at edges of one cell alone, ascending."""
    edges = np.concatenate([np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
                            for cells in (interface.quads, interface.triangles)])
    found, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return np.unique(found[count == 1]).astype(np.intp)


def refuse_beyond(model: Model) -> None:
    """Raise ValueError for what no program is asked for."""
    stated = model.stated
    wrong = []
    if stated.adaptive is not None:
        wrong.append("thermal.adaptive: inner steps are judged by matrices, which a program does not tell")
    if stated.method.value == "steady":
        wrong.append("thermal.method: steady: a program takes steps in time")
    if model.elsewhere.size:
        wrong.append("thermal.halves: a program solves for all bodies")
    if wrong:
        raise ValueError(f"{'; '.join(wrong)}. Leave it out, or choose the half thermal")
