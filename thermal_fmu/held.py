"""What is held through a substep: geometry, facing points, and everything that follows from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.surfaces import ContactSurfaces
from thermal_fmu.edges import edge_slots, gauss_points
from thermal_fmu.exchange import Group, groups_of
from thermal_fmu.facing import Points
from thermal_fmu.film import FilmPoints, film_points
from thermal_fmu.spec import Model
from thermal_fmu.volume import Shape, Volume, shapes_of, spread, volume_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Scene:
    """What never changes: model, cells, surfaces, fixed nodes.

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
        return tuple(edge_slots(self.volume.pattern, film.edges) for film in self.model.films)

    @cached_property
    def fixed(self) -> NDArray[np.bool_]:
        fixed = self.interface.node_body < 0
        for boundary in self.model.prescribed:
            fixed[boundary.nodes] = True
        return fixed

    @cached_property
    def held_rows(self) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
        """Of the matrix data: which entries lie in a row or column of a fixed node, and their diagonal places."""
        pattern = self.volume.pattern
        row = np.repeat(np.arange(pattern.n), np.diff(pattern.indptr))
        touched = self.fixed[row] | self.fixed[pattern.indices]
        return touched, np.flatnonzero((row == pattern.indices) & self.fixed[row])

    def masses(self, X: Floats) -> tuple[Floats, ...]:
        """rho0 dV0 [kg] of every block at its quadrature points, from reference coordinates X : (n, 2) [m]."""
        return tuple(self.model.bodies[block.body].material.rho * shape.dV
                     for block, shape in zip(self.volume.blocks, shapes_of(self.volume, X), strict=True))


@dataclass(frozen=True)
class Held:
    """Held through a substep.

    sources : (n_bodies, n) volume of each body spread over its nodes [m3].  E_M : (n,) [J] of the substep.
    flux_areas : one (n,) [m2] a prescribed flux.  films, groups : where films act and where bodies exchange heat.
    touching : number of facing points under pressure.
    """

    shapes: tuple[Shape, ...]
    masses: tuple[Floats, ...]
    sources: Floats
    E_M: Floats
    flux_areas: tuple[Floats, ...]
    films: tuple[FilmPoints, ...]
    groups: tuple[Group, ...]
    touching: int


def hold(scene: Scene, masses: tuple[Floats, ...], x: Floats, E_M: Floats, points: Points | None) -> Held:
    """Everything that follows from coordinates x : (n, 2) [m], energies E_M : (n_cells,) [J] and facing points.

    Raises InvertedCellError.
    """
    volume, model = scene.volume, scene.model
    shapes = shapes_of(volume, x)
    return Held(
        shapes, masses, _sources(scene, shapes), _mechanical(volume, shapes, E_M),
        tuple(_areas(b.edges, x, volume) for b in model.fluxes),
        tuple(film_points(film, slots, x, volume.axisymmetric, scene.surfaces, points)
              for film, slots in zip(model.films, scene.film_slots, strict=True)),
        () if points is None else groups_of(points, model.pairs),
        0 if points is None else int((points.p > 0).sum()),
    )


def _sources(scene: Scene, shapes: Sequence[Shape]) -> Floats:
    out = np.zeros((len(scene.model.bodies), scene.volume.n))
    for b, body in enumerate(scene.model.bodies):
        if body.Q_T.value.any():
            weights = [np.full(1, float(block.body == b)) for block in scene.volume.blocks]
            out[b] = spread(scene.volume, shapes, weights)
    return out


def _mechanical(volume: Volume, shapes: Sequence[Shape], E_M: Floats) -> Floats:
    if not E_M.any():
        return np.zeros(volume.n)
    per_volume = [E_M[block.numbers] / shape.dV.sum(axis=1)
                  for block, shape in zip(volume.blocks, shapes, strict=True)]
    return spread(volume, shapes, per_volume)


def _areas(edges: Ints, x: Floats, volume: Volume) -> Floats:
    points = gauss_points(edges, x, volume.axisymmetric)
    share = points.area[:, None] * points.N
    area = np.bincount(edges[points.edge].ravel(), weights=share.ravel(), minlength=volume.n)
    return area.astype(np.float64, copy=False)


def prescribed_values(model: Model, values: Sequence[float], T: Floats) -> Floats:
    """T : (n,) [K] with the prescribed temperatures put in; where two meet at a node the later one holds."""
    out = T.copy()
    for boundary, value in zip(model.prescribed, values, strict=True):
        out[boundary.nodes] = value
    return out


def factors_of(model: Model, inputs: Mapping[str, object]) -> dict[str, float]:
    """The factor inputs load.<name> by name."""
    return {name: float(np.asarray(inputs[f"load.{name}"], dtype=float)) for name in model.load_names}
