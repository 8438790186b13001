"""A thermal scene, which never changes, and the data that a substep freezes: geometry, contact, friction heat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import ContactSurfaces
from contact.half.functions import Level, resolve
from contact.half.interface import Interface
from contact.half.linalg import Pattern
from contact.half.start import start_temperature, start_temperatures
from thermal_fmu.cells import (
    CellGeometry,
    CellMesh,
    GeometryCache,
    MatrixCache,
    ReferenceCells,
    cell_mesh,
    reference_cells,
    spread_energies,
)
from thermal_fmu.conditions import owners
from thermal_fmu.contact_quadrature import ContactPoints, edge_slots, gauss_points, touching
from thermal_fmu.edges import AddedConduction, Couplings
from thermal_fmu.elsewhere import counted_of
from thermal_fmu.exchange import ConductionGroup, RadiationGroup, ThroughCells, conduction_groups, radiation_groups
from thermal_fmu.gap_pieces import parted
from thermal_fmu.phase_change import Melting, NodalFields, PhaseChange, melting_of
from thermal_fmu.problem import Flux, Model
from thermal_fmu.program import ThermalProgram, surface_nodes
from thermal_fmu.sources import FieldSource, SourceCache, TemperatureSource, freeze_sources, plain_sources
from thermal_fmu.surface_terms import (
    FrictionHeat,
    FrozenFilm,
    FrozenRadiator,
    SurfaceGeometry,
    at_nodes,
    freeze_film,
    freeze_radiator,
    friction_power,
    slave_fraction,
)
from thermal_fmu.volume import Bulk, Coordinates, GivenVolume, OwnCells, ThermalVolume

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ThermalScene:
    """Model, mesh and surfaces of a thermal half, with what follows from them alone.

    given : the solver of another package for the inside of bodies; None: the cells of this half.
    program : one that answers at nodes alone, around which the cells of this half search; None: there is none.
    """

    interface: Interface
    model: Model
    given: ThermalVolume | None = None
    program: ThermalProgram | None = None

    @cached_property
    def volume(self) -> CellMesh:
        return cell_mesh(self.interface)

    @cached_property
    def surfaces(self) -> ContactSurfaces:
        return ContactSurfaces(self.interface)

    @cached_property
    def surface_nodes(self) -> NDArray[np.intp]:
        """(m,) nodes at edges of one cell alone."""
        return surface_nodes(self.interface)

    @cached_property
    def film_slots(self) -> tuple[NDArray[np.int64], ...]:
        """(n_edges, 2) places in the matrix data of the diagonals of the nodes of every film's edges."""
        return tuple(_diagonals(self.volume.pattern, film.where.edges) for film in self.model.films)

    @cached_property
    def radiator_slots(self) -> tuple[NDArray[np.int64], ...]:
        """(n_edges, 2) places in the matrix data of the diagonals of the nodes of every radiating surface's edges."""
        return tuple(_diagonals(self.volume.pattern, r.where.edges) for r in self.model.radiators)

    @cached_property
    def fixed(self) -> NDArray[np.bool_]:
        """(n,) True where T is prescribed (or no cell uses the node)."""
        fixed = self.interface.node_body < 0
        for boundary in self.model.prescribed:
            fixed[boundary.nodes] = True
        return fixed | ~self.model.solved

    def counted(self, of_bodies: Floats) -> Floats:
        """Return (n_bodies,) with 0 for bodies that another half solves for."""
        return counted_of(self.interface, self.model, of_bodies)

    @cached_property
    def owners(self) -> NDArray[np.int32]:
        """(n_fixed,) which prescribed temperature each fixed node belongs to."""
        return owners(self.fixed, [b.nodes for b in self.model.prescribed])

    @cached_property
    def couplings(self) -> Couplings:
        """Places in the matrix data by nodes."""
        return Couplings.of(self.volume.pattern)

    @cached_property
    def fixed_entries(self) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
        """Of the matrix data: (nnz,) which entries lie in a row or column of a fixed node, and their diagonal places.
        """
        pattern = self.volume.pattern
        row = np.repeat(np.arange(pattern.n), np.diff(pattern.indptr))
        touched = self.fixed[row] | self.fixed[pattern.indices]
        return touched, np.flatnonzero((row == pattern.indices) & self.fixed[row])

    @cached_property
    def through_cells(self) -> ThroughCells:
        """What the cells at each node conduct, at the start."""
        short, long, X = np.zeros(self.volume.n), np.full(self.volume.n, np.inf), self.interface.nodes
        T = start_temperatures(self.interface, [part.T0 for part in self.model.parts])
        for block in self.volume.blocks:
            own = self.model.parts[block.part].material.k
            k = own.k_1(T[block.cells])
            if own.k_2 is not None:
                k = np.maximum(k, own.k_2(T[block.cells]))
            edges = np.linalg.norm(X[block.cells] - X[np.roll(block.cells, 1, axis=1)], axis=2)
            np.maximum.at(short, block.cells, k / edges.min(axis=1)[:, None])
            np.minimum.at(long, block.cells, k / edges.max(axis=1)[:, None])
        return ThroughCells(short, np.where(np.isfinite(long), long, 0.0))

    @cached_property
    def source_cache(self) -> SourceCache:
        """Keep the sources of blocks that do not move."""
        return SourceCache()

    @cached_property
    def geometry_cache(self) -> GeometryCache:
        """The geometry of the last coordinates."""
        return GeometryCache()

    @cached_property
    def matrix_cache(self) -> MatrixCache:
        """The matrices of blocks with constant data."""
        return MatrixCache()

    @cached_property
    def bulk(self) -> Bulk:
        """Conduction and storage inside bodies."""
        if self.given is not None:
            return GivenVolume(self.given, self.interface, self.model, self.volume.pattern)
        return OwnCells(self.volume, self.model.parts, self.matrix_cache)

    @cached_property
    def melting(self) -> tuple[Melting, ...]:
        """What melts, and its nodes."""
        if not self.interface.regions:
            return melting_of(self.interface.node_body, [body.material.phase for body in self.model.bodies])
        nodes = {p: self.interface.part_nodes(p).astype(np.intp) for p, part in enumerate(self.model.parts)
                 if part.material.phase is not None}
        # Regions of one material that meet share nodes, which melt once.
        return tuple(Melting(own[~np.isin(own, [n for q in nodes if q < p for n in nodes[q]])],
                             cast(PhaseChange, self.model.parts[p].material.phase)) for p, own in nodes.items())

    def start(self, masses: Sequence[ReferenceCells]) -> Floats:
        """Return the temperatures (n,) [K] at the start.

        masses : of the blocks.  A node where parts of different warmth meet has the heat of both: what each stores
        there at its own temperature, over what both hold a kelvin.
        """
        parts, interface = self.model.parts, self.interface
        T = start_temperatures(interface, [part.T0 for part in parts])
        if not interface.regions:
            return T
        heat, capacity, uneven = np.zeros(T.size), np.zeros(T.size), np.zeros(T.size, dtype=np.bool_)
        for block, mass in zip(self.volume.blocks, masses, strict=True):
            part = parts[block.part]
            own = start_temperature(part.T0, interface, block.nodes)
            uneven[block.nodes] |= own != T[block.nodes]
            c = mass.nodal_mass * part.material.c.solid(own)
            heat[block.nodes] += c * own
            capacity[block.nodes] += c
        # fault: where regions meet the last one's temperature holds -> return T |
        #   coupler/test_regions::test_where_regions_of_different_warmth_meet_their_heat_is_kept
        return np.where(uneven, heat / np.where(capacity > 0.0, capacity, 1.0), T)

    def masses(self, X: Floats) -> tuple[ReferenceCells, ...]:
        """Compute the mass of every block at its nodes on reference coordinates X : (n, 2) [m]."""
        return reference_cells(self.volume, self.model.parts, X)


def _diagonals(pattern: Pattern, edges: NDArray[np.int32]) -> NDArray[np.int64]:
    return np.einsum("eii->ei", edge_slots(pattern, edges))


# Data frozen through a substep

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Fixed:
    """Nodes whose temperature is prescribed.

    nodes : (m,).  shapes : (n_terms, m) of its field at them [1], None where uniform.
    """

    nodes: Ints
    shapes: Floats | None


@dataclass(frozen=True)
class SubstepData:
    """What is constant through a substep.

    sigma_SB : [W/m2K4].  E_M : (n,) [J] of the substep.  touching : number of contact quadrature points under pressure.
    uniform_volumes : (n_bodies, n) volume of each body spread over its nodes [m3], None without uniform sources.
    field_sources, temperature_sources : where heat is made by a field, or by the temperature.
    flux_areas : one (n,) or, by terms, (n_terms, n) [m2] a prescribed flux.
    films, radiators : surfaces open to the surroundings.  conduction_groups, radiation_groups : where bodies exchange
    heat.
    friction : [W] at nodes, None where none is made.  added : conduction that makes up for wrong signs (monotone.py).
    place : where nodes are, for a given volume or a program; None: cells know it.  solved : (n,) False at nodes of
    bodies that another half solves for, whose heat is not counted here; None: there are none.
    """

    sigma_SB: float
    shapes: tuple[CellGeometry, ...]
    masses: tuple[ReferenceCells, ...]
    E_M: Floats
    uniform_volumes: Floats | None
    field_sources: tuple[FieldSource, ...]
    temperature_sources: tuple[TemperatureSource, ...]
    fixed: tuple[Fixed, ...]
    flux_areas: tuple[Floats, ...]
    films: tuple[FrozenFilm, ...]
    radiators: tuple[FrozenRadiator, ...]
    conduction_groups: tuple[ConductionGroup, ...]
    radiation_groups: tuple[RadiationGroup, ...]
    touching: int
    friction: FrictionHeat | None = None
    added: AddedConduction | None = None
    place: Coordinates | None = None
    solved: NDArray[np.bool_] | None = None


def freeze(scene: ThermalScene, masses: tuple[ReferenceCells, ...], x: Floats, E_M: Floats,
           points: ContactPoints | None) -> SubstepData:
    """Compute everything that follows from coordinates x : (n, 2) [m], energies E_M and contact points.

    E_M : (n_cells,) mechanical heat of the cells [J].  Raises InvertedMeshError.
    """
    volume, model = scene.volume, scene.model
    # fault: conduction on the reference -> shapes = scene.geometry_cache.of(volume, masses, scene.interface.nodes) |
    #   thermal_fmu/test_thermal_space
    shapes = scene.geometry_cache.of(volume, masses, x)
    by_node = [pair.by_node for pair in scene.interface.pairs]
    points = None if points is None else parted(points, model, by_node)
    geometry = SurfaceGeometry(x, volume.axisymmetric, scene.surfaces, points)
    return SubstepData(
        model.stated.sigma_SB, shapes, masses, _mechanical(volume, shapes, E_M),
        plain_sources(volume, shapes, model.parts), *freeze_sources(volume, shapes, model.parts, x, scene.source_cache),
        # fault: prescribed field in the reference -> (*(Fixed(b.nodes, None if b.value.is_uniform else
        #   b.value.shapes(scene.interface.nodes[b.nodes])) for b in model.prescribed), |
        #   thermal_fmu/test_thermal_fields
        (*(Fixed(b.nodes, None if b.value.is_uniform else b.value.shapes(x[b.nodes])) for b in model.prescribed),
         *((Fixed(model.elsewhere, None),) if model.elsewhere.size else ())),
        tuple(_areas(b, x, volume) for b in model.fluxes),
        tuple(freeze_film(film, slots, geometry) for film, slots in zip(model.films, scene.film_slots, strict=True)),
        tuple(freeze_radiator(radiator, slots, geometry)
              for radiator, slots in zip(model.radiators, scene.radiator_slots, strict=True)),
        () if points is None else conduction_groups(
            points, model.pairs, scene.through_cells, by_node),
        () if points is None else radiation_groups(points, model.pairs),
        touching(points, model.solved),
        solved=model.solved if model.elsewhere.size else None,
    )


def with_friction(substep: SubstepData, scene: ThermalScene, points: ContactPoints, E: Floats, at: NodalFields,
                  h: float) -> SubstepData:
    """Add the friction heat E : (n_q,) [J] at pair nodes, spread evenly over the substep h [s].

    at : temperatures at its start, from which the effusivities of both sides are taken.
    """
    if not E.any():
        return substep
    model, interface = scene.model, scene.interface
    fraction = slave_fraction(points, model.pairs, model.parts, interface, at)
    return replace(substep, friction=friction_power(points, fraction, E, interface, h))


def _mechanical(volume: CellMesh, shapes: Sequence[CellGeometry], E_M: Floats) -> Floats:
    if not E_M.any():
        return np.zeros(volume.n)
    return spread_energies(volume, shapes, E_M)


def _areas(flux: Flux, x: Floats, volume: CellMesh) -> Floats:
    points = gauss_points(flux.edges, x, volume.axisymmetric, flux.value)
    nodes = flux.edges[points.edge]
    weights = points.area[:, None] * points.N
    if flux.value.is_uniform:
        return at_nodes(nodes, weights, volume.n)
    shapes = flux.value.shapes(np.einsum("pi,pij->pj", points.N, x[nodes]))
    assert shapes is not None
    # fault: flux of a field not weighted in place -> return np.array([at_nodes(nodes, term.mean() * weights, volume.n)
    #   for term in shapes]) | thermal_fmu/test_thermal_fields
    return np.array([at_nodes(nodes, term[:, None] * weights, volume.n) for term in shapes])


def prescribed_values(substep: SubstepData, levels: Sequence[Level], T: Floats) -> Floats:
    """Put the prescribed temperatures into T : (n,) [K]; where two meet at a node the later one holds.

    levels : of each prescribed temperature [K].  Returns a copy (n,) [K].
    """
    out = T.copy()
    for fixed, level in zip(substep.fixed, levels, strict=True):
        out[fixed.nodes] = resolve(level, fixed.shapes)
    return out
