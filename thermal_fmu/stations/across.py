"""How far temperatures differ inside what has one temperature: across a rod, or in a lumped body.

One temperature stands for the mean of its station.  What its surfaces exchange makes others warmer or colder; once that
has settled, each point warms by the same rate, so heat that enters by q is taken up evenly, k lap T = const:

- a rod's column of height w between fluxes q and p into its two sides: a parabola, whose sides differ from its mean by
  (w/k) (q/3 - p/6); of p = q that is q L/(3 k) with L = w/2, of p = 0 with L = w;
- a lumped body of volume V: its mean gradient is G = sum F (x - x_c)/(k V) over heat F that enters at x (Green's second
  identity with a coordinate, which is harmonic), exact for every shape.  What F has beyond that of G, r = F - k G n A,
  goes in alike everywhere: |r| L/(3 k) with L = V/A of where it goes in, a slab's own depth.  In a slab both together
  are the parabola.  Around an axis only y is such a coordinate, and what goes in radially is in the second part.

Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, 5.1 (the Biot number) and 3.5 (slabs with a source).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.outlines import outline_of
from thermal_fmu.cells import cell_mesh, shapes_of
from thermal_fmu.contact_quadrature import ContactPoints, gauss_points
from thermal_fmu.exchange import conduction_groups, exchange_flow, gap_radiation_flow, radiation_groups
from thermal_fmu.gap_pieces import parted
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.sources import ThermalLoads
from thermal_fmu.stations.scene import StationScene
from thermal_fmu.surface_terms import (
    ExposedPoints,
    SurfaceGeometry,
    film_flow,
    freeze_film,
    freeze_radiator,
    friction_power,
    slave_fraction,
    surroundings_radiation_flow,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

T_OFF = "across.T_off"


@dataclass(frozen=True)
class Outlines:
    """The edges of all bodies.  edges : (m, 2) nodes, the body on the left hand.  body : (m,) of each.

    fixed : (m,) whether both its nodes have a prescribed temperature.
    """

    edges: Ints
    body: Ints
    fixed: NDArray[np.bool_]

    def places(self, nodes: NDArray[np.integer]) -> Ints:
        """Return (n,) the number of the edge with nodes : (n, 2), in either order."""
        order, keys = self._by_nodes
        return np.asarray(order[np.searchsorted(keys, np.sort(nodes.astype(np.intp), axis=1) @ (self._size, 1))])

    @property
    def _size(self) -> int:
        return int(self.edges.max(initial=0)) + 1

    @cached_property
    def _by_nodes(self) -> tuple[Ints, Ints]:
        keys = np.sort(self.edges, axis=1) @ (self._size, 1)
        order = np.argsort(keys)
        return order, keys[order]


def outlines_of(scene: StationScene) -> Outlines:
    """Collect the edges of all bodies of a scene."""
    interface = scene.interface
    own = [outline_of(interface, body) for body in range(len(interface.bodies))]
    edges = np.concatenate(own)
    held = np.zeros(len(interface.nodes), dtype=np.bool_)
    for prescribed in scene.model.prescribed:
        held[prescribed.nodes] = True
    return Outlines(edges, np.repeat(np.arange(len(own)), [len(e) for e in own]), held[edges[:, 0]] & held[edges[:, 1]])


@dataclass(frozen=True)
class SurfaceState:
    """What surfaces exchange by.  x : (n_nodes, 2) [m].  points : of contact; None: no pairs.  at : the fields at the
    stations.  E : (n_q,) [J] friction heat of pair nodes in a substep of h [s].
    """

    x: Floats
    points: ContactPoints | None
    loads: ThermalLoads
    at: NodalFields
    E: Floats
    h: float


def temperature_off(scene: StationScene, outlines: Outlines, state: SurfaceState) -> float:
    """Return how far a surface of a body differs from the one temperature of its station there, the most of all [K]."""
    edges = outlines.edges
    flow = _through_edges(scene, outlines, state)
    places = gauss_points(edges.astype(np.int32), state.x, scene.interface.axisymmetric)
    area = np.bincount(places.edge, places.area, len(edges)).astype(np.float64)
    along = state.x[edges[:, 1]] - state.x[edges[:, 0]]
    length = np.hypot(*along.T)
    sides = _Sides(outlines, flow, area, np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None])
    if scene.stations.columns is None:
        return _of_bodies(scene, sides, state)
    return _of_columns(scene, sides, state)


@dataclass(frozen=True)
class _Sides:
    """flow : (m,) [W] into the body through each edge.  area : (m,) [m2].  normal : (m, 2) outwards [1]."""

    outlines: Outlines
    flow: Floats
    area: Floats
    normal: Floats

    def held(self, of: Ints, use: Ints, n: int) -> Floats:
        """Return the flow (m,) [W] of the edges, those with a prescribed temperature letting out what others let in.

        of : (m,) what each edge is a side of, up to n; use : those that count.
        """
        fixed = np.zeros(len(of), dtype=np.bool_)
        fixed[use] = self.outlines.fixed[use]
        flow = np.where(fixed, 0.0, self.flow)
        net = np.bincount(of[use], flow[use], n)
        held = np.bincount(of[fixed], self.area[fixed], n)
        per_area = np.divide(net, held, out=np.zeros(n), where=held > 0.0)
        # fault: what a prescribed temperature lets out is not told -> return flow |
        #   thermal_fmu/test_across::test_a_wall_at_a_temperature
        return np.where(fixed, -per_area[of] * self.area, flow)


def _conductivities(scene: StationScene, at: NodalFields) -> Floats:
    """(n,) of the stations [W/mK]."""
    k = np.empty(scene.stations.n)
    for body, own in zip(scene.model.bodies, scene.stations.own, strict=True):
        k[own] = body.material.k.k_1(at.T[own], None if at.f_s is None else at.f_s[own])
    return k


def _of_bodies(scene: StationScene, sides: _Sides, state: SurfaceState) -> float:
    """As temperature_off, of lumped bodies."""
    x, edges, body = state.x, sides.outlines.edges, sides.outlines.body
    n = len(scene.stations.own)
    flow = sides.held(body, np.arange(len(edges)), n)
    middle, volume, centre = 0.5 * (x[edges[:, 0]] + x[edges[:, 1]]), np.zeros(n), np.zeros((n, 2))
    cells = cell_mesh(scene.interface)
    for block, shape in zip(cells.blocks, shapes_of(cells, x), strict=True):
        volume[block.body] += shape.dV.sum()
        centre[block.body] += np.einsum("eq,qa,eai->i", shape.dV, block.table.N, x[block.cells])
    centre /= volume[:, None]
    k, worst = _conductivities(scene, state.at), 0.0
    for b, (own,) in enumerate(scene.stations.own):
        of = np.flatnonzero(body == b)
        if not scene.solved[own] or not flow[of].any():
            continue
        G = flow[of] @ (middle[of] - centre[b]) / (k[own] * volume[b])
        if scene.interface.axisymmetric:
            G[0] = 0.0
        # fault: heat that goes through a body leaves no trace -> linear = 0.0 |
        #   thermal_fmu/test_across::test_heat_that_goes_through_as_films
        linear = float(np.abs((x[edges[of, 0]] - centre[b]) @ G).max())
        r = np.abs(flow[of] - k[own] * sides.normal[of] @ G * sides.area[of])
        total = float(r.sum())
        even = 0.0
        if total > 1e-9 * float(np.abs(flow[of]).sum()):  # less is round-off
            A = total**2 / float((r**2 / np.maximum(sides.area[of], 1e-300)).sum())
            depth = min(volume[b] / A, 0.5 * float(np.ptp(x[edges[of, 0]], axis=0).max()))
            even = total / A * depth / (3.0 * k[own])
        worst = max(worst, linear + even)
    return worst


def _of_columns(scene: StationScene, sides: _Sides, state: SurfaceState) -> float:
    """As temperature_off, across rods."""
    columns = scene.stations.columns
    assert columns is not None
    ends = columns.of_node[sides.outlines.edges]
    # What goes in at an end goes along the rod, alike all over it.
    lateral = np.flatnonzero(ends[:, 0] != ends[:, 1])
    n = scene.stations.n
    q = np.zeros((2, n))
    # Both sides of a piece of a rod are between the same two columns.
    held = sides.held(ends.min(axis=1), lateral, n)
    for side, sign in enumerate((1.0, -1.0)):
        own = lateral[sign * sides.normal[lateral, 1] > 0.0]
        flow, area = (np.bincount(ends[own].ravel(), 0.5 * np.repeat(v[own], 2), n) for v in (held, sides.area))
        q[side] = np.divide(flow, area, out=np.zeros(n), where=area > 0.0)
    k, of_column = np.empty(n), np.empty(n, dtype=np.intp)
    of_column[columns.of_node] = scene.stations.of_node
    k[:] = _conductivities(scene, state.at)[of_column]
    off = columns.heights(state.x) / k * np.abs(q / 3.0 - q[::-1] / 6.0).max(axis=0)
    return float(off[scene.solved[of_column]].max(initial=0.0))


def _through_edges(scene: StationScene, outlines: Outlines, state: SurfaceState) -> Floats:
    """(m,) [W] into the bodies through each edge of their outlines, prescribed temperatures apart."""
    model, loads, n = scene.model, state.loads, len(outlines.edges)
    T = state.at.T[scene.stations.of_node]
    points = state.points
    if points is not None:
        points = parted(points, model, [pair.by_node for pair in scene.interface.pairs])
    geometry = SurfaceGeometry(state.x, scene.interface.axisymmetric, scene.surfaces, points)
    out = np.zeros(n)

    def add(edges: NDArray[np.integer], heat: Floats) -> None:
        if len(edges):
            out[:] += np.bincount(outlines.places(edges), heat, n)

    for flux, q in zip(model.fluxes, loads.fluxes, strict=True):
        places = gauss_points(flux.edges, state.x, scene.interface.axisymmetric)
        add(flux.edges[places.edge], float(np.sum(q)) * places.area)
    for film, level in zip(model.films, loads.films, strict=True):
        frozen = freeze_film(film, np.zeros((len(film.where.edges), 2), dtype=np.int64), geometry)
        add(frozen.points.edges, -_of_points(frozen.points, film_flow(frozen, level.h, level.Te, T)[0]))
    for radiator, around in zip(model.radiators, loads.radiators, strict=True):
        glow = freeze_radiator(radiator, np.zeros((len(radiator.where.edges), 2), dtype=np.int64), geometry)
        heat = surroundings_radiation_flow(glow, model.stated.sigma_SB, around.factor, around.T_inf, T)[0]
        add(glow.points.edges, -_of_points(glow.points, heat))
    if points is None:
        return out
    crossing = [(group.nodes, exchange_flow(group, loads.pairs[group.pair].of(group.closed), T)[0])
                for group in conduction_groups(points, model.pairs)]
    crossing += [(group.nodes, gap_radiation_flow(group, model.stated.sigma_SB, T)[0])
                 for group in radiation_groups(points, model.pairs)]
    crossing += _rubbed(scene, state)
    for nodes, leaves in crossing:
        for side in (slice(0, 2), slice(2, 4)):
            add(nodes[:, side], -leaves[:, side].sum(axis=1))
    return out


def _of_points(points: ExposedPoints, flow: Floats) -> Floats:
    """(n/2,) [W] of each point, of flow : (n,) [W] of its edge's two nodes."""
    return np.asarray(flow.reshape(len(points.edges), 2).sum(axis=1))


def _rubbed(scene: StationScene, state: SurfaceState) -> Sequence[tuple[NDArray[np.int32], Floats]]:
    """Friction heat as what crosses at points: nodes (n_p, 4), and (n_p, 4) [W] that leaves them (below 0)."""
    points = state.points
    if points is None or not state.E.any():
        return ()
    T, f_s = (None if v is None else v[scene.stations.of_node] for v in (state.at.T, state.at.f_s))
    assert T is not None
    model, interface = scene.model, scene.interface
    fraction = slave_fraction(points, model.pairs, model.parts, interface, NodalFields(T, f_s))
    # By area over the points of a pair: where on its surface it is made matters little to one temperature.
    power = friction_power(points, fraction, state.E, interface, state.h).pairs
    whole = np.bincount(points.pair, points.area, len(interface.pairs))
    part = np.divide(points.area, whole[points.pair], out=np.zeros(points.area.size), where=points.area > 0.0)
    heat = 0.5 * part[:, None] * power[points.pair]
    return ((points.nodes, -np.repeat(heat, 2, axis=1)),)


