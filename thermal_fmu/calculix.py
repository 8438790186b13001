"""The thermal half `ccx`: heat inside bodies by CalculiX, one deck a step; all else by this package.

A step is *HEAT TRANSFER in one increment, from *INITIAL CONDITIONS, with *CFLUX at the nodes.  Prescribed temperatures
are given as the heat that holds them: at nodes of *BOUNDARY ccx leaves out the heat that storage shares with them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.calculix import CONTROLS, both, calculix, number, printed, refuse_axisymmetric, run, slab, table
from contact.half.functions import Property
from contact.half.interface import Interface
from contact.half.program import Program
from contact.half.volume import VolumeMesh, part_volumes
from thermal_fmu.half import ThermalHalf, thermal_program_half
from thermal_fmu.program import HeatAnswer, HeatTask, ThermalProgram
from thermal_fmu.volume import VolumeMaterial

Floats = NDArray[np.float64]


class CalculixHeat(ThermalProgram):
    """Heat inside bodies by ccx."""

    def __init__(self, program: Program) -> None:
        self._program = program

    def start(self, mesh: VolumeMesh, materials: tuple[VolumeMaterial, ...]) -> None:
        """As of ThermalProgram."""
        refuse_axisymmetric(mesh)
        self._mesh, self._materials = mesh, materials

    def step(self, task: HeatTask) -> HeatAnswer:
        """As of ThermalProgram."""
        # Seven digits are printed: of the least numbers that will do.
        shift = 0.5 * float(task.T.min() + task.T.max())
        found = printed(run(self._program, [*self._deck(task, shift)]), "temperatures", len(task.T), 1)
        return HeatAnswer(found[:, 0] + shift)

    def _deck(self, task: HeatTask, shift: float) -> Iterator[str]:
        n = len(task.T)
        yield from slab(self._mesh, task.x, "C3D8")
        # Mass is that of the reference: where cells grow the density falls.
        grown = part_volumes(self._mesh, task.x) / part_volumes(self._mesh, task.X)
        used = np.unique(np.concatenate([self._mesh.quad_part, self._mesh.triangle_part])).tolist()
        for k in used:
            m = self._materials[k]
            # fault: the mass of a body grows with it -> rho = m.rho | thermal_fmu/test_calculix_heat
            rho = m.rho / float(grown[k])
            yield from (f"*MATERIAL, NAME=M{k}", "*CONDUCTIVITY", *table(m.k, shift=shift), "*SPECIFIC HEAT",
                        *table(m.c, shift=shift), "*DENSITY", *table(Property(rho)),
                        f"*SOLID SECTION, ELSET=P{k}, MATERIAL=M{k}")
        yield "*INITIAL CONDITIONS, TYPE=TEMPERATURE"
        for layer in (0, 1):
            for i, T in enumerate((task.T - shift).tolist()):
                yield f"{layer * n + i + 1}, {number(T)}"
        yield from ("*STEP", *CONTROLS, "*HEAT TRANSFER, DIRECT", f"{number(task.dt)}, {number(task.dt)}")
        at = np.flatnonzero(task.heat)
        if at.size:
            yield "*CFLUX"
            yield from both(at, n, 11, task.heat[at])
        yield from ("*NODE PRINT, NSET=NFRONT", "NT", "*END STEP")


def load(interface: Interface, model: Mapping[str, Any]) -> ThermalHalf:
    """Make the half of an interface file and a model.json.  Raises ValueError, also where there is no ccx."""
    return thermal_program_half(CalculixHeat(calculix(model.get("options", {}))), interface, model)
