"""Heat through surfaces: films, Eqs. (5-7); contact and gaps, (8-10); radiation, (11) and (12); friction heat, 2.4.

T^4 is continued below 0 K as T |T|^3, and an emissivity beyond its range as its nearest bound: iterates of Newton's
method may lie there.  What it ends with is checked (thermal_fmu/boundary.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import ContactSurfaces
from contact.half.functions import Field, Level, Property, resolve
from contact.half.interface import Interface
from contact.laws import gap_factor
from thermal_fmu.contact_quadrature import ContactPoints, EdgePoints, gauss_points
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.problem import Exposed, Film, Radiator, ThermalBody, ThermalPair

# Exposed surfaces: whole edges, less what faces something, Eq. (7)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class ExposedPoints:
    """Quadrature points of a surface open to its surroundings, each twice: its heat is that of the edge's two nodes.

    node : (n,) whose temperature counts.  area : (n,) weighted with kappa and the node's shape function [m2].
    slots : (n,) of the node's diagonal in the matrix data.  edges : (n/2, 2) nodes of each point's edge, at : (n/2, 2)
    shape functions where it lies [1].
    """

    node: Ints
    area: Floats
    slots: NDArray[np.int64]
    edges: Ints
    at: Floats

    def places(self, x: Floats) -> Floats:
        """Return (n, 2) coordinates of the points [m], of nodes at x : (n_nodes, 2) [m]."""
        return np.repeat(np.einsum("pi,pij->pj", self.at, x[self.edges]), 2, axis=0)


@dataclass(frozen=True)
class SurfaceGeometry:
    """What exposed points are placed on.

    x : (n_nodes, 2) current coordinates [m].  points : contact quadrature points, None where nothing can face.
    """

    x: Floats
    axisymmetric: bool
    surfaces: ContactSurfaces
    points: ContactPoints | None


def exposed_points(where: Exposed, slots: NDArray[np.int64], geometry: SurfaceGeometry, *data: Field) -> ExposedPoints:
    """Place the points of a surface open to its surroundings.

    slots : (n_edges, 2) of the diagonals of its edges' nodes in the matrix data.  data : what is read at the points.

    The whole edge counts with kappa = 1, less its facing pieces, plus kappa(gap) times those pieces, on either side.
    """
    parts = [gauss_points(where.edges, geometry.x, geometry.axisymmetric, *data)]
    points, first = geometry.points, geometry.surfaces.first.get(where.surface)
    if points is not None and first is not None and where.ends is not None:
        # fault: no kappa -> excess = 0.0 * points.gap | thermal_fmu/test_thermal_contact
        excess = gap_factor(points.gap, *where.ends) - 1.0
        parts += [
            _pieces(points.slave_edge - first, points.N_s, excess * points.area_s, len(where.edges)),
            # fault: kappa on the slave side only -> *(), | thermal_fmu/test_thermal_contact
            _pieces(points.master_edge - first, points.N_m, excess * points.area_m, len(where.edges)),
        ]
    # At the nodes, as storage: shared between neighbours a film would couple them with the wrong sign, and beside a
    # cell Biot number of 100 they would leave their data by 1.4 %.  What the film depends on is taken in place.
    edge, N, area = (np.concatenate([getattr(part, name) for part in parts]) for name in ("edge", "N", "area"))
    # fault: each node of an edge takes half of it -> weight = np.full(N.shape, 0.5) | thermal_fmu/test_thermal_space
    weight = N
    edges = where.edges[edge]
    return ExposedPoints(edges.ravel(), (area[:, None] * weight).ravel(), slots[edge].ravel(), edges, N)


def _pieces(edge: NDArray[np.integer], N: Floats, area: Floats, n_edges: int) -> EdgePoints:
    own = (edge >= 0) & (edge < n_edges) & (area != 0.0)
    return EdgePoints(edge[own].astype(np.intp), N[own], area[own])


# Radiation, Eqs. (11) and (12)

LEAST_EMISSIVITY = 1e-6  # met only between Newton's steps; it keeps 1/eps a number


@dataclass(frozen=True)
class FrozenRadiator:
    """A radiating surface on given coordinates.  T_inf : (n_terms, n) shapes at the points [1], None where uniform."""

    radiator: Radiator
    points: ExposedPoints
    T_inf: Floats | None


def freeze_radiator(radiator: Radiator, slots: NDArray[np.int64], geometry: SurfaceGeometry) -> FrozenRadiator:
    """Place a radiating surface where it is open.  slots : as exposed_points has them."""
    points = exposed_points(radiator.where, slots, geometry, radiator.T_inf)
    uniform = radiator.T_inf.is_uniform
    return FrozenRadiator(radiator, points, None if uniform else radiator.T_inf.shapes(points.places(geometry.x)))


def surroundings_radiation_flow(frozen: FrozenRadiator, sigma: float, factor: float, T_inf: Level,
                                T: Floats) -> tuple[Floats, Floats]:
    """Return (n,) heat that leaves each point's node [W] at T : (n_nodes,) [K], and (n,) its derivative [W/K].

    sigma : [W/m2K4].  factor : of the flow [1].  T_inf : level of the surroundings [K].
    Eq. (12): factor sigma eps(T) (T^4 - T_inf^4).
    """
    points = frozen.points
    T_a = T[points.node]
    around = resolve(T_inf, frozen.T_inf)
    eps, deps = emissivity_at(frozen.radiator.emissivity, T_a)
    strength = factor * sigma * points.area
    # fault: radiation to 0 K whatever surrounds -> excess = fourth(T_a) | thermal_fmu/test_thermal_radiation
    excess = fourth(T_a) - fourth(around)
    flow = strength * eps * excess
    # fault: derivative of far radiation -> dq = strength * (deps * excess + 3.0 * eps * np.abs(T_a) ** 3) |
    #   thermal_fmu/test_thermal_fields
    dq = strength * (deps * excess + 4.0 * eps * np.abs(T_a) ** 3)
    return flow, dq


def fourth(T: float | Floats) -> Floats:
    return np.asarray(T * np.abs(T) ** 3)


def emissivity_at(emissivity: Property, T: Floats) -> tuple[Floats, Floats]:
    """Return value [1] and derivative [1/K] by temperature at T : (n,) [K]."""
    raw = emissivity(T)
    eps = np.clip(raw, LEAST_EMISSIVITY, 1.0)
    if emissivity.is_constant:
        return eps, np.zeros(eps.shape)
    return eps, np.where(raw == eps, emissivity.slope(T), 0.0)


# Films, Eqs. (5-7)

@dataclass(frozen=True)
class FrozenFilm:
    """A film on given coordinates.  h, Te : (n_terms, n) shapes of its fields at the points [1], None where uniform."""

    film: Film
    points: ExposedPoints
    h: Floats | None
    Te: Floats | None


def freeze_film(film: Film, slots: NDArray[np.int64], geometry: SurfaceGeometry) -> FrozenFilm:
    """Place a film where it acts.  slots : as exposed_points has them."""
    points = exposed_points(film.where, slots, geometry, film.h, film.Te)
    if film.h.is_uniform and film.Te.is_uniform:
        return FrozenFilm(film, points, None, None)
    places = points.places(geometry.x)
    return FrozenFilm(film, points, film.h.shapes(places), film.Te.shapes(places))


def film_flow(frozen: FrozenFilm, h: Level, Te: Level, T: Floats) -> tuple[Floats, Floats]:
    """Return (n,) heat that leaves each point's node [W] at T : (n_nodes,) [K], and (n,) its derivative [W/K].

    h, Te : levels of the coefficient [W/m2K^(1 + exponent)] and of the ambient [K].
    Eq. (5): h h_factor(T) |T - Te|^a (T - Te), odd in T - Te.
    """
    film, points = frozen.film, frozen.points
    T_a = T[points.node]
    dT = T_a - resolve(Te, frozen.Te)
    strength = resolve(h, frozen.h) * points.area
    if film.exponent != 0.0:
        # fault: film exponent even -> strength = strength * np.abs(dT) ** (2 * film.exponent) |
        #   thermal_fmu/test_thermal_time
        strength = strength * np.abs(dT) ** film.exponent
    if film.h_factor is None:
        dq = (1.0 + film.exponent) * strength
    else:
        # fault: derivative of h_factor forgotten -> grows = 0.0 * T_a | thermal_fmu/test_thermal_fields
        grows = film.h_factor.slope(T_a) * strength * dT
        # fault: h_factor at the ambient -> strength = film.h_factor(T_a - dT) * strength |
        #   thermal_fmu/test_thermal_fields
        strength = film.h_factor(T_a) * strength
        dq = (1.0 + film.exponent) * strength + grows
    return strength * dT, dq


# Sums at nodes

def at_nodes(nodes: NDArray[np.integer], values: Floats, n: int) -> Floats:
    """Sum values : (n_places, m) at their nodes : (n_places, m); return (n,) in their unit."""
    return np.bincount(nodes.ravel(), weights=values.ravel(), minlength=n).astype(np.float64, copy=False)


# Friction heat, split between the two sides

@dataclass(frozen=True)
class FrictionHeat:
    """Friction heat into the nodes of either side, spread evenly over the substep.  slave, master : (n,) [W].

    pairs : (n_pairs, 2) [W] of each pair into its slave and its master.
    """

    slave: Floats
    master: Floats
    pairs: Floats


def friction_power(points: ContactPoints, slave_fraction: Floats, E: Floats, interface: Interface,
                   h: float) -> FrictionHeat:
    """Turn friction energies E : (n_q,) [J] of pair nodes into power over a substep h [s].

    slave_fraction : (n_p,) [1] of each point's energy that the slave takes.
    A node's energy goes to the contact quadrature points searched from it by N A, from there by N_s to the slave's
    nodes and by N_m to the master's.  A node that faces nothing keeps its energy.
    """
    with_friction, N = points.searched_from
    # fault: friction heat spread without areas -> weight = N | thermal_fmu/test_thermal_friction
    weight = N * points.area[:, None]
    whole = at_nodes(with_friction, weight, E.size)
    faces = whole > 0.0
    per_area = np.divide(E, whole, out=np.zeros(E.size), where=faces)
    Q = (per_area[with_friction] * weight).sum(axis=1)
    # fault: joules of nodes that face nothing lost -> unshared = np.where(faces, 0.0, 0.0 * E) |
    #   thermal_fmu/test_thermal_friction
    unshared = np.where(faces, 0.0, E)
    n = len(interface.nodes)
    slave = at_nodes(points.nodes[:, :2], (slave_fraction * Q)[:, None] * points.N_s, n)
    master = at_nodes(points.nodes[:, 2:], ((1.0 - slave_fraction) * Q)[:, None] * points.N_m, n)
    numbers = {pair.name: k for k, pair in enumerate(interface.pairs)}
    pairs = np.stack([np.bincount(points.pair, part * Q, len(numbers))
                      for part in (slave_fraction, 1.0 - slave_fraction)], axis=1)
    for side in interface.pair_sides:
        (slave if side.own else master)[side.nodes] += unshared[side.at]
        pairs[numbers[side.pair], 0 if side.own else 1] += unshared[side.at].sum()
    # fault: friction energy as power -> return FrictionHeat(slave, master, pairs) | thermal_fmu/test_thermal_friction
    return FrictionHeat(slave / h, master / h, pairs / h)


def slave_fraction(points: ContactPoints, pairs: Sequence[ThermalPair | None], parts: Sequence[ThermalBody],
                   interface: Interface, at: NodalFields) -> Floats:
    """Return (n_p,) the slave's part of friction heat: the pair's friction.share, else e_s/(e_s + e_m).

    parts : of interface.parts.  e : effusivities sqrt(k rho c); half-spaces that slide take heat by them
    while their surfaces stay equally warm.  at : the start of the substep.
    """
    out = np.empty(points.pair.size)
    for pair, laws in enumerate(pairs):
        of = np.flatnonzero(points.pair == pair)
        friction = None if laws is None else laws.stated.friction
        if friction is not None and friction.share is not None:
            out[of] = friction.share
        elif of.size:
            e_s, e_m = (_effusivity(points.nodes[of, side], N[of], parts, interface, at)
                        for side, N in ((slice(0, 2), points.N_s), (slice(2, 4), points.N_m)))
            # fault: friction shares swapped -> out[of] = e_m / (e_s + e_m) | thermal_fmu/test_thermal_friction
            out[of] = e_s / (e_s + e_m)
    return out


def _effusivity(nodes: NDArray[np.int32], N: Floats, parts: Sequence[ThermalBody], interface: Interface,
                at: NodalFields) -> Floats:
    """(n,) at points of edges with nodes : (n, 2), each of the part its edge is of."""
    T, f_s = ((N * v[nodes]).sum(axis=1) if v is not None else None for v in (at.T, at.f_s))
    assert T is not None
    of, out = interface.edge_parts(nodes), np.empty(T.size)
    for part in np.unique(of):
        here = of == part
        out[here] = parts[part].material.effusivity(T[here], None if f_s is None else f_s[here])
    return out
