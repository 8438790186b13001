"""The mechanical half `ccx`: elastic bodies in plane strain by CalculiX, one deck a step; all else by this package.

A step is *STATIC with *CLOAD at the nodes, *BOUNDARY at prescribed components and *TEMPERATURE, of large displacements,
from the reference: an elastic body remembers nothing, so nothing has to be restarted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.calculix import CONTROLS, both, calculix, held, number, printed, refuse_axisymmetric, run, slab, table
from contact.half.interface import Interface
from contact.half.program import Program
from contact.half.volume import VolumeMesh
from mechanical_fmu.elastic_half import ElasticHalf, mechanical_program_half
from mechanical_fmu.given import ElasticMaterial
from mechanical_fmu.program import DisplacementAnswer, ForceTask, MechanicalProgram

Floats = NDArray[np.float64]

CONTACT = ("force", "displacement")  # what ccx may be given at contact surfaces


class CalculixSolid(MechanicalProgram):
    """Deformation of bodies by ccx."""

    def __init__(self, program: Program, takes: str) -> None:
        self._program, self.takes = program, takes

    def start(self, mesh: VolumeMesh, materials: tuple[ElasticMaterial, ...]) -> None:
        """As of MechanicalProgram."""
        refuse_axisymmetric(mesh)
        self._mesh, self._materials = mesh, materials
        self._used = np.unique(np.concatenate([mesh.quad_part, mesh.triangle_part])).tolist()
        # ccx counts the thermal strain from the temperature a node begins with.
        T = np.full(len(mesh.nodes), np.nan)
        for cells, part in ((mesh.quads, mesh.quad_part), (mesh.triangles, mesh.triangle_part)):
            for k in self._used:
                nodes, T_ref = np.unique(cells[part == k]), materials[k].T_ref
                if np.any(np.isfinite(T[nodes]) & (T[nodes] != T_ref)):
                    raise ValueError(f"{mesh.parts[k]}: regions that meet have another T_ref; the half ccx needs one")
                T[nodes] = T_ref
        self._T_ref = np.where(np.isfinite(T), T, materials[0].T_ref)

    def solve(self, task: ForceTask) -> DisplacementAnswer:
        """As of MechanicalProgram."""
        n = len(task.T)
        text = run(self._program, [*self._deck(task)])
        u = printed(text, "displacements", n, 3)[:, :2]
        # Both layers have the same: half of the force is on either.
        reaction = 2.0 * printed(text, "forces", n, 3)[:, :2]
        return DisplacementAnswer(u, reaction.ravel()[task.fixed])

    def _deck(self, task: ForceTask) -> Iterator[str]:
        n, mesh = len(task.T), self._mesh
        yield from slab(mesh, mesh.nodes, "C3D8I")
        for k in self._used:
            m = self._materials[k]
            yield from (f"*MATERIAL, NAME=M{k}", "*ELASTIC", *table(m.E, m.nu),
                        f"*EXPANSION, ZERO={number(m.T_ref)}", *table(m.alpha),
                        f"*SOLID SECTION, ELSET=P{k}, MATERIAL=M{k}")
        yield "*INITIAL CONDITIONS, TYPE=TEMPERATURE"
        yield from _temperatures(self._T_ref)
        yield from ("*STEP, NLGEOM", *CONTROLS, "*STATIC", "1., 1.", "*BOUNDARY", "NALL, 3, 3, 0.")
        nodes, component = np.divmod(task.fixed, 2)
        for c in (0, 1):
            own = component == c
            yield from held(nodes[own], n, c + 1, task.u_fixed[own])
        at = [np.flatnonzero(task.force[:, c]) for c in (0, 1)]
        if any(a.size for a in at):
            yield "*CLOAD"
            for c, a in enumerate(at):
                yield from both(a, n, c + 1, task.force[a, c])
        yield "*TEMPERATURE"
        yield from _temperatures(task.T)
        yield from ("*NODE PRINT, NSET=NFRONT", "U, RF", "*END STEP")


def _temperatures(T: Floats) -> Iterator[str]:
    for layer in (0, 1):
        for i, value in enumerate(T.tolist()):
            yield f"{layer * len(T) + i + 1}, {number(value)}"


def load(interface: Interface, model: Mapping[str, Any]) -> ElasticHalf:
    """Make the half of an interface file and a model.json.  Raises ValueError, also where there is no ccx."""
    options = model.get("options", {})
    program, takes = calculix(options, "contact"), options.get("contact", "force")
    if takes not in CONTACT:
        raise ValueError(f"options.contact must be one of {', '.join(CONTACT)}; it is {takes!r}")
    if model.get("state", "plane_strain") != "plane_strain":
        raise ValueError("mechanical.elastic.state: the half ccx is for plane strain; choose the half elastic")
    return mechanical_program_half(CalculixSolid(program, str(takes)), interface, model)
