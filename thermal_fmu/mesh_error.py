"""How much a mesh misses of the temperature differences that drive heat: an estimate, body by body, over a run.

Heat that flows through a body at the rate Q needs temperature differences: int q . K^-1 q dV = Q dT.  What cells too
large miss of that is M = int d . K^-1 d dV, d the error of their flux, and M/Q [K] is the temperature difference that
they leave out.  M has three parts:

- Inside, d is what lies between the flux of the cells and a smoother one, averaged at nodes among the cells of one
  material (Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337).
- At the surface, more heat comes in through a node than the cells behind it conduct away: D [W] of it stays in the
  first half of these cells, at once, where in truth it takes time and a temperature difference to get there.  With d
  falling from D/A to 0 across a cell of thickness h, this part is D D h/(3 k A); a step much shorter than that time
  makes D as large as one likes, so the difference D h/(3 k A) counts up to the span of the body's temperatures.

- Along the surface, films and radiation take their heat at nodes, which is more than between them where temperatures
  differ from node to node (boundary.missed_along): twice as much as the first part, for a fin.

An error made early is made good by later heat (what came in too soon lowers what comes in next), so each substep counts
with the increase of the cube of the heat moved so far.  For a half space the number over the span is then the relative
error of the heat taken in, within a factor of 2, from a tenth of the time h^2/a on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Value, Variable
from thermal_fmu import phase_change
from thermal_fmu.cells import CellBlock, CellGeometry
from thermal_fmu.flux import conductivity, flowing
from thermal_fmu.kernels import add_surface, add_to_nodes, between_fluxes, flux_at_points, held_up, of_bodies
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.scene import ThermalScene

Floats = NDArray[np.float64]
T_MISSED = "mesh.T_missed."  # of a body: an output
LEAST_FACED = 0.5  # of the area of the surface beside a node: what it faces, at least
POWER = 3  # of the heat moved so far, by whose increase a substep counts


@dataclass(frozen=True)
class MissedHeat:
    """What the mesh missed since the start: T_missed [K], the mean over the heat [J] moved.

    (n_bodies,) each; (0,) before anything was counted.
    """

    T_missed: Floats
    heat: Floats

    def plus(self, T_missed: Floats, heat: Floats) -> MissedHeat:
        """Add a substep: T_missed [K] that its heat [J] missed, (n_bodies,) each."""
        if not self.heat.size:
            return MissedHeat(T_missed, heat)
        total = self.heat + heat
        # fault: an early error counts as much as a late one -> before = np.divide(self.heat, total,
        #   out=np.zeros_like(total), where=total > 0.0) |
        #   thermal_fmu/test_mesh_error::test_an_early_error_is_made_good_by_later_heat
        before = np.divide(self.heat, total, out=np.zeros_like(total), where=total > 0.0) ** POWER
        return MissedHeat(before * self.T_missed + (1.0 - before) * T_missed, total)


NOTHING_MISSED = MissedHeat(np.zeros(0), np.zeros(0))


def nothing_missed(n_bodies: int) -> MissedHeat:
    """Return what was missed at the start."""
    return MissedHeat(np.zeros(n_bodies), np.zeros(n_bodies))


@dataclass(frozen=True)
class SubstepHeat:
    """What a substep of h [s] moved, from s_n to s : (n,) [K].

    moved : (n,) [J] that flowed into the nodes.  inside : (n,) [J] the part of it that did not come through the
    surface.  along : (n_bodies,) [W K] that is missed along surfaces.
    """

    h: float
    s_n: Floats
    s: Floats
    moved: Floats
    inside: Floats
    along: Floats


@dataclass(frozen=True)
class _OuterEdges:
    """Edges of a block's cells that no other cell has, the body on their left.

    cell : (m,) in the block.  nodes : (m, 2).
    """

    cell: NDArray[np.intp]
    nodes: NDArray[np.int32]


@dataclass(frozen=True)
class _Flux:
    """Of a block at its Gauss points.  q : (ne, nq, 2) [W/m2].  K : (ne, nq, 1 or 3) [W/mK].  dV : (ne, nq) [m3]."""

    q: Floats
    K: Floats
    dV: Floats


def mesh_variables(scene: ThermalScene) -> tuple[Variable, ...]:
    """List what is told of the mesh, of each body with cells that this half solves itself."""
    return tuple(Variable(T_MISSED + name, unit="K", description="temperature difference that the mesh of the body "
                          "misses, estimated: the mean over the heat moved since the start")
                 for name in solved_bodies(scene))


def solved_bodies(scene: ThermalScene) -> dict[str, int]:
    """Return the bodies with cells that this half solves itself, name -> number."""
    # A body that is given its temperatures as a whole has no heat to solve for.
    # fault: temperatures that are given are told to be missed -> given: list[np.ndarray] = [] |
    #   coupler/test_given_temperatures
    given = [boundary.nodes for boundary in scene.model.prescribed]
    here = {block.body for block in scene.volume.blocks if scene.model.solved[block.nodes].all()
            and not any(np.isin(block.nodes, nodes).all() for nodes in given)}
    return {scene.interface.bodies[b]: b for b in sorted(here)}


class MeshError:
    """Estimates what the mesh of a scene misses.  It remembers what follows from the mesh alone."""

    def __init__(self, scene: ThermalScene) -> None:
        self._scene = scene
        self._n_bodies = len(scene.interface.bodies)

    @cached_property
    def _solved(self) -> dict[str, int]:
        return solved_bodies(self._scene)

    @cached_property
    def _outer(self) -> tuple[_OuterEdges, ...]:
        """Of each block."""
        blocks = self._scene.volume.blocks
        edges = [np.stack([b.cells, np.roll(b.cells, -1, axis=1)], axis=2) for b in blocks]
        keys = [np.sort(e.reshape(-1, 2), axis=1) @ np.array([self._scene.volume.n, 1]) for e in edges]
        known, count = np.unique(np.concatenate(keys), return_counts=True)
        found = []
        for of, key in zip(edges, keys, strict=True):
            once = (count[np.searchsorted(known, key)] == 1).reshape(of.shape[:2])
            found.append(_OuterEdges(np.nonzero(once)[0], of[once]))
        return tuple(found)

    def outputs(self, missed: MissedHeat) -> dict[str, Value]:
        """Return the outputs by name."""
        return {T_MISSED + name: float(missed.T_missed[b]) for name, b in self._solved.items()}

    def after(self, so_far: MissedHeat, shapes: Sequence[CellGeometry], x: Floats, step: SubstepHeat) -> MissedHeat:
        """Return what was missed after a substep on coordinates x : (n, 2) [m], shapes those of the blocks."""
        scene, through = self._scene, step.moved - step.inside
        at, T_n = phase_change.fields(scene.melting, step.s), phase_change.temperature(scene.melting, step.s_n)
        heat, span = of_bodies(scene.interface.node_body, self._n_bodies, T_n, at.T, step.moved, through)
        fluxes = [self._flux(block, shape, x, at) for block, shape in zip(scene.volume.blocks, shapes, strict=True)]
        # fault: what films take at nodes is taken for what they take between -> missed = self._inside(fluxes) +
        #   self._at_surface(fluxes, x, through / step.h, span) | thermal_fmu/test_mesh_error
        missed = self._inside(fluxes) + self._at_surface(fluxes, x, through / step.h, span) + step.along
        return so_far.plus(np.divide(missed * step.h, heat, out=np.zeros_like(heat), where=heat > 0.0), heat)

    def _flux(self, block: CellBlock, shape: CellGeometry, x: Floats, at: NodalFields) -> _Flux:
        k = self._scene.model.parts[block.part].material.k
        parts = flowing(k, block, shape, at)
        q = np.sum([flux_at_points(x, U, block.cells, block.table.dN, K) for U, K in parts], axis=0)
        return _Flux(q, conductivity(k, block, shape, at), shape.dV)

    def _inside(self, fluxes: Sequence[_Flux]) -> Floats:
        """(n_bodies,) [W K] between the fluxes of the blocks and those recovered at nodes, part by part."""
        scene, blocks = self._scene, self._scene.volume.blocks
        missed = np.zeros(self._n_bodies)
        for layer in range(int(self._layer.max(initial=-1)) + 1):
            own = [(b, f) for b, f in zip(blocks, fluxes, strict=True) if self._layer[b.part] == layer]
            total, volume = np.zeros((scene.volume.n, 2)), np.zeros(scene.volume.n)
            for block, flux in own:
                add_to_nodes(block.cells, flux.q, flux.dV, total, volume)
            for block, flux in own:
                missed[block.body] += between_fluxes(block.cells, block.table.N, flux.q, total, volume, flux.K, flux.dV)
        return missed

    @cached_property
    def _layer(self) -> NDArray[np.intp]:
        """(n_parts,) the number of each part within its body: parts of different bodies share no node."""
        of_body = self._scene.interface.part_body
        return np.array([np.count_nonzero(of_body[:p] == of_body[p]) for p in range(len(of_body))], dtype=np.intp)

    def _at_surface(self, fluxes: Sequence[_Flux], x: Floats, through: Floats, span: Floats) -> Floats:
        """(n_bodies,) [W K] of heat that comes in through surfaces and stays in front of the cells.

        through : (n,) [W] in through the surface.  span : (n_bodies,) [K] of temperatures in the substep.
        """
        n = self._scene.volume.n
        stays, area, resistance = through.copy(), np.zeros(n), np.zeros(n)
        facing = np.zeros((n, 2))
        for block, flux, edges in zip(self._scene.volume.blocks, fluxes, self._outer, strict=True):
            add_surface(x, edges.cell, edges.nodes, flux.q, flux.K, flux.dV, self._scene.volume.axisymmetric,
                        1.0 if block.cells.shape[1] == 4 else 2.0, stays, area, facing, resistance)
        return held_up(self._scene.interface.node_body, self._n_bodies, stays, area, facing, resistance, span,
                       LEAST_FACED)
