"""A scene of stations, which never changes, and the data that a substep freezes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import ContactSurfaces
from contact.half.interface import Interface
from thermal_fmu.conditions import owners
from thermal_fmu.contact_quadrature import ContactPoints, gauss_points, touching
from thermal_fmu.elsewhere import counted_of
from thermal_fmu.exchange import conduction_groups, radiation_groups
from thermal_fmu.gap_pieces import parted
from thermal_fmu.phase_change import Melting, NodalFields
from thermal_fmu.problem import Exposed, Model
from thermal_fmu.scene import Fixed, SubstepData
from thermal_fmu.sources import is_plain
from thermal_fmu.stations.stations import StationGeometry, StationMesh, Stations
from thermal_fmu.surface_terms import (
    ExposedPoints,
    FrictionHeat,
    SurfaceGeometry,
    at_nodes,
    freeze_film,
    freeze_radiator,
    friction_power,
    slave_fraction,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True)
class StationScene:
    """Model, mesh, and which of its nodes share a temperature."""

    interface: Interface
    model: Model
    stations: Stations

    @cached_property
    def mesh(self) -> StationMesh:
        return StationMesh(self.interface, self.stations)

    @cached_property
    def surfaces(self) -> ContactSurfaces:
        return ContactSurfaces(self.interface)

    @cached_property
    def fixed(self) -> NDArray[np.bool_]:
        """(n,) True where T is prescribed: a station is, as soon as one of its nodes is."""
        fixed = np.zeros(self.stations.n, dtype=np.bool_)
        for boundary in self.model.prescribed:
            fixed[self.stations.of_node[boundary.nodes]] = True
        return fixed | ~self.solved

    @cached_property
    def solved(self) -> NDArray[np.bool_]:
        """(n,) False at stations of bodies that another half solves for."""
        solved = np.ones(self.stations.n, dtype=np.bool_)
        solved[self.stations.of_node[self.model.elsewhere]] = False
        return solved

    @cached_property
    def columns_elsewhere(self) -> Ints:
        """(m,) for each node elsewhere the place among them of one that has its temperature, at a surface in contact
        where there is one: nodes of a station are alike, and those inside bodies are told as they were."""
        nodes = self.model.elsewhere
        of = self.stations.of_node[nodes]
        found = np.zeros(self.stations.n, dtype=np.intp)
        found[of] = np.arange(nodes.size)
        # fault: whole bodies elsewhere are as warm as inside, a substep late -> touching = np.zeros(0, np.intp) |
        #   coupler/test_several::test_whole_bodies_of_one_temperature
        touching = np.flatnonzero(np.isin(nodes, self.interface.contact_nodes))
        found[of[touching]] = touching
        return found[of]

    def counted(self, of_bodies: Floats) -> Floats:
        """Return (n_bodies,) with 0 for bodies that another half solves for."""
        return counted_of(self.interface, self.model, of_bodies)

    @cached_property
    def melting(self) -> tuple[Melting, ...]:
        """The bodies that melt, with their stations."""
        phases = [body.material.phase for body in self.model.bodies]
        return tuple(Melting(own, change) for own, change in zip(self.stations.own, phases, strict=True)
                     if change is not None)

    @cached_property
    def owners(self) -> NDArray[np.int32]:
        """(n_fixed,) which prescribed temperature each fixed station belongs to."""
        return owners(self.fixed, [self.mapped(b.nodes) for b in self.model.prescribed])

    @cached_property
    def fixed_places(self) -> tuple[Ints, Ints]:
        """Flat places of the band in rows or columns of fixed stations, and their diagonal ones."""
        s = self.stations
        row = np.repeat(np.arange(3 * s.width + 1), s.n) - 2 * s.width + s.column_of_slot
        inside = (row >= 0) & (row < s.n)
        touched = inside & (self.fixed[np.clip(row, 0, s.n - 1)] | self.fixed[s.column_of_slot])
        at = np.flatnonzero(self.fixed)
        return np.flatnonzero(touched), s.slots(at, at)

    def mapped(self, nodes: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return the stations of nodes : (...) of the mesh, in their shape."""
        return np.asarray(self.stations.of_node[nodes], dtype=np.int32)


def freeze_stations(scene: StationScene, shape: StationGeometry, x: Floats, E_M: Floats,
                    points: ContactPoints | None) -> SubstepData:
    """Compute everything that follows from coordinates x, energies E_M and contact points.

    x : (n_nodes, 2) [m].  E_M : (n_cells,) [J].  The boundary terms are those of the thermal half, with stations in the
    place of nodes.
    """
    model, axisymmetric = scene.model, scene.interface.axisymmetric
    # fault: one temperature a body, and gaps by two points an edge -> pass | thermal_fmu/test_gap_pieces
    points = None if points is None else parted(points, model, [pair.by_node for pair in scene.interface.pairs])
    geometry = SurfaceGeometry(x, axisymmetric, scene.surfaces, points)
    groups = () if points is None else conduction_groups(points, model.pairs)
    near = () if points is None else radiation_groups(points, model.pairs)
    return SubstepData(
        model.stated.sigma_SB, (), (), scene.mesh.spread(E_M, shape) if E_M.any() else np.zeros(scene.stations.n),
        _sources(scene, shape), (), (),
        (*(Fixed(np.unique(scene.mapped(b.nodes)), None) for b in model.prescribed),
         # Those of a station are alike in the half that solves for them, which is of the same kind.
         *((Fixed(scene.mapped(model.elsewhere), None),) if model.elsewhere.size else ())),
        tuple(_areas(scene, flux.edges, x) for flux in model.fluxes),
        tuple(replace(frozen, points=_moved(scene, frozen.points)) for frozen in
              (freeze_film(film, _no_slots(film.where), geometry) for film in model.films)),
        tuple(replace(frozen, points=_moved(scene, frozen.points)) for frozen in
              (freeze_radiator(radiator, _no_slots(radiator.where), geometry) for radiator in model.radiators)),
        tuple(replace(group, nodes=scene.mapped(group.nodes)) for group in groups),
        tuple(replace(group, nodes=scene.mapped(group.nodes)) for group in near),
        touching(points, model.solved),
        solved=scene.solved if model.elsewhere.size else None,
    )


def stations_with_friction(substep: SubstepData, scene: StationScene, points: ContactPoints, E: Floats, at: NodalFields,
                           h: float) -> SubstepData:
    """Add the friction heat E : (n_q,) [J] of pair nodes, spread evenly over h [s]; at : (n,) at its start."""
    if not E.any():
        return substep
    interface, of_node = scene.interface, scene.stations.of_node
    nodal = NodalFields(at.T[of_node], None if at.f_s is None else at.f_s[of_node])
    fraction = slave_fraction(points, scene.model.pairs, scene.model.parts, interface, nodal)
    power = friction_power(points, fraction, E, interface, h)
    gather = scene.stations.gather
    # fault: friction heat of rods lost -> return replace(substep, friction=FrictionHeat(gather(power.slave), 0.0 *
    #   gather(power.master), power.pairs)) | thermal_fmu/test_thermal_rod
    return replace(substep, friction=FrictionHeat(gather(power.slave), gather(power.master), power.pairs))


def _no_slots(where: Exposed) -> NDArray[np.int64]:
    return np.zeros((len(where.edges), 2), dtype=np.int64)


def _moved(scene: StationScene, points: ExposedPoints) -> ExposedPoints:
    node = scene.mapped(points.node)
    return replace(points, node=node, slots=scene.stations.slots(node.astype(np.intp), node.astype(np.intp)))


def _areas(scene: StationScene, edges: NDArray[np.int32], x: Floats) -> Floats:
    points = gauss_points(edges, x, scene.interface.axisymmetric)
    return at_nodes(scene.mapped(edges[points.edge]), points.area[:, None] * points.N, scene.stations.n)


def _sources(scene: StationScene, shape: StationGeometry) -> Floats | None:
    bodies = scene.model.bodies
    if all(body.Q_T.is_zero for body in bodies):
        return None
    out = np.zeros((len(bodies), scene.stations.n))
    for b, (body, own) in enumerate(zip(bodies, scene.stations.own, strict=True)):
        if is_plain(body) and not body.Q_T.is_zero:
            out[b, own] = shape.volume[own]
    return out
