"""Contact quadrature points: what faces what, with the pressure between them, and Gauss points on edges of surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import ContactSurfaces
from contact.half.functions import Field
from contact.half.gap_area import gap_areas
from contact.half.linalg import Pattern
from contact.messages import Facing

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# 2-point Gauss on [0, 1]: exact for N_i N_j r along an edge.
EDGE_XI: Floats = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
EDGE_WEIGHT = 0.5


@dataclass(frozen=True)
class EdgePoints:
    """Quadrature points on the edges of a surface.

    edge : (n,) row of the surface's edges.  N : (n, 2) shape functions of its two nodes [1].
    area : (n,) [m2], per metre of depth when plane; negative where a part of an edge is taken off.
    """

    edge: NDArray[np.intp]
    N: Floats
    area: Floats


def shape_functions(xi: Floats) -> Floats:
    """Evaluate the shape functions of an edge's two nodes at xi : (n,) in [0, 1]; return (n, 2) [1]."""
    return np.stack([1.0 - xi, xi], axis=1)


def gauss_points(edges: Ints, x: Floats, axisymmetric: bool, *data: Field) -> EdgePoints:
    """Place two Gauss points on every edge : (n, 2) nodes, at coordinates x : (n_nodes, 2) [m].

    Areas carry 2 pi r if axisymmetric.  data : what is read at the points.  Where a profile of it kinks within an edge,
    each part of that edge has two points: what a strip gives is the same wherever nodes are, also one narrower than an
    edge.
    """
    edge, start, share = _parts(edges, x, data)
    a, b = x[edges[edge, 0]], x[edges[edge, 1]]
    length = np.repeat(np.hypot(b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]) * share, EDGE_XI.size)
    N = shape_functions((start[:, None] + share[:, None] * EDGE_XI).ravel())
    edge = np.repeat(edge, EDGE_XI.size)
    r = N[:, 0] * x[edges[edge, 0], 0] + N[:, 1] * x[edges[edge, 1], 0]
    # fault: 2 pi r dropped on edges -> depth = 1.0 | thermal_fmu/test_thermal_space
    depth = 2.0 * np.pi * r if axisymmetric else 1.0
    return EdgePoints(edge, N, EDGE_WEIGHT * length * depth)


def _parts(edges: Ints, x: Floats, data: Sequence[Field]) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Return the edge : (m,) of each part between kinks of data, where on it the part begins and its share of it [1].
    """
    every = np.arange(len(edges))
    edge, xi = [every, every], [np.zeros(len(edges)), np.ones(len(edges))]
    for axis in (0, 1):
        a, b = x[edges[:, 0], axis], x[edges[:, 1], axis]
        for kinks in (field.kinks[axis] for field in data):
            first = np.searchsorted(kinks, np.minimum(a, b), "right")
            # fault: edges are not parted where data kink -> inside = 0 * first | thermal_fmu/test_flux_strip
            inside = np.maximum(np.searchsorted(kinks, np.maximum(a, b), "left") - first, 0)
            crossed = np.repeat(every, inside)
            nth = np.arange(crossed.size) - np.repeat(np.cumsum(inside) - inside, inside)
            edge.append(crossed)
            xi.append((kinks[first[crossed] + nth] - a[crossed]) / (b[crossed] - a[crossed]))
    of, at = np.concatenate(edge), np.concatenate(xi)
    order = np.lexsort((at, of))
    of, at = of[order], at[order]
    part = (of[1:] == of[:-1]) & (at[1:] > at[:-1])
    return of[1:][part], at[:-1][part], np.diff(at)[part]


def edge_slots(pattern: Pattern, edges: Ints) -> NDArray[np.int64]:
    """Find the (n, 2, 2) places in the matrix data of the blocks of edges : (n, 2), which are edges of cells.

    Raises ValueError where an edge belongs to no cell.
    """
    row = np.repeat(edges[:, :, None], 2, axis=2).astype(np.int64)
    col = np.repeat(edges[:, None, :], 2, axis=1).astype(np.int64)
    rows = np.repeat(np.arange(pattern.n, dtype=np.int64), np.diff(pattern.indptr))
    keys = rows * pattern.n + pattern.indices
    slots = np.searchsorted(keys, row * pattern.n + col)
    if slots.size and not (keys[np.minimum(slots, keys.size - 1)] == row * pattern.n + col).all():
        raise ValueError("a surface has an edge that belongs to no cell")
    return slots


@dataclass(frozen=True)
class ContactPoints:
    """Contact quadrature points with the pressure between them.

    nodes : (n_p, 4) nodes of the mesh, slave edge's two, master edge's two.  searched : (n_p, 2) pair nodes of the edge
    the point was searched from.  N_s, N_m : (n_p, 2) shape functions [1].
    gap : (n_p,) [m], 0 where touching.  p : (n_p,) [Pa], > 0 where touching.  area : (n_p,) [m2] of the exchange where
    closed, measured on the side searched from; open_area : (n_p,) [m2] that of the gas between the two sides.
    area_s, area_m : (n_p,) [m2] the piece as either side measures it, spread over its points so that shape functions
    are integrated exactly; end_s, end_m : (n_p,) [m2] the same two of round surfaces, spread as on the side searched
    from, where the piece is apart, else `area`.  pair, slave_edge, master_edge : (n_p,) as registered.  from_master :
    (n_p,) True where a second pass searched the point from the master; None where none does.  Slave and master are
    those of the pair all the same.  gap_at_end : (n_p,) [m] where the point's half of its piece ends, nan: not known.
    join [m] : gap within which what is apart still conducts as in touch, in part.
    """

    nodes: Ints
    searched: Ints
    N_s: Floats
    N_m: Floats
    gap: Floats
    p: Floats
    area: Floats
    open_area: Floats
    area_s: Floats
    area_m: Floats
    end_s: Floats
    end_m: Floats
    pair: Ints
    slave_edge: Ints
    master_edge: Ints
    from_master: NDArray[np.bool_] | None = None
    gap_at_end: Floats | None = None
    join: float = 0.0

    @property
    def closed_share(self) -> Floats:
        """(n_p,) of each point that conducts as in touch [1]: all under pressure, apart less the wider the gap."""
        touching = (self.p > 0).astype(float)
        # fault: conductance jumps where it was to be joined -> return touching | thermal_fmu/test_join
        return np.maximum(touching, 1.0 - self.gap / self.join) if self.join > 0.0 else touching

    @property
    def searched_from(self) -> tuple[Ints, Floats]:
        """Pair nodes (n_p, 2) and shape functions (n_p, 2) of the side each point was searched from."""
        if self.from_master is None:
            return self.searched, self.N_s
        return self.searched, np.where(self.from_master[:, None], self.N_m, self.N_s)


def contact_points(surfaces: ContactSurfaces, facing: Facing, t_N: Floats, x: Floats,
                   join: float = 0.0) -> ContactPoints:
    """Give each contact quadrature point its pressure and its areas.

    t_N : (n_q,) nodal tractions [Pa] of the pairs, <= 0, linear along the edge searched from.  x : (n_nodes, 2) [m],
    where facing was found.  join [m] : as ContactPoints has it.
    A positive gap under pressure is read as no gap (touching means p_N > 0).
    """
    N_s, N_m = shape_functions(facing.xi_s), shape_functions(facing.xi_m)
    searched = surfaces.searched_nodes(facing)
    p = (N_s * np.maximum(-t_N[searched], 0.0)).sum(axis=1)
    if any(pair.tied for pair in surfaces.interface.pairs):
        bonded = np.array([pair.tied for pair in surfaces.interface.pairs])[facing.pair]
        # What is bonded touches, whatever it carries.
        # fault: a tied pair that is pulled conducts like an open one -> bonded &= False |
        #   coupler/test_ties::test_heat_crosses_it_by_its_resistance_though_it_is_pulled
        p = np.where(bonded, np.maximum(p, np.finfo(float).tiny), p)
    # fault: touching by gap instead of pressure -> gap = np.maximum(facing.gap, 0.0) | thermal_fmu/test_thermal_contact
    gap = np.where(p > 0, 0.0, np.maximum(facing.gap, 0.0))
    nodes = np.concatenate([surfaces.edges[facing.slave_edge], surfaces.edges[facing.master_edge]], axis=1)
    apart = gap > 0.0
    mean, end_s, end_m = (np.where(apart, area, facing.area)
                          for area in gap_areas(surfaces.interface, surfaces.edges, facing, x))
    points = ContactPoints(nodes, searched, N_s, N_m, gap, p, facing.area, mean, facing.area, facing.area_m, end_s,
                           end_m, facing.pair, facing.slave_edge, facing.master_edge,
                           gap_at_end=_gaps_at_ends(surfaces, facing) if apart.any() else None, join=join)
    # fault: a second pass exchanges the sides of its pair -> exchanged = None | thermal_fmu/test_thermal_friction
    exchanged = _from_master(surfaces, facing)
    return points if exchanged is None else _by_pair_sides(points, exchanged)


# From a Gauss point on to the end of its piece, of the way between both points.
ON = 0.5 * (np.sqrt(3.0) - 1.0)
AT_NODE = 1e-6  # of a slave edge: a piece that ends nearer to its node ends there
NEAR_NODE = 0.25  # of a master edge: what lies along it at the end of a piece is known less well


def _gaps_at_ends(surfaces: ContactSurfaces, facing: Facing) -> Floats:
    """Return (n_p,) the gap [m] where the piece of each point ends on its side, which is at a node of slave or master.

    nan where no such node is found, or what nodes face is not told.
    """
    out = np.full(facing.gap.size, np.nan)
    of, passes = surfaces.pair_nodes, surfaces.message.passes
    if facing.node_gap.size == 0:
        return out
    begin = np.zeros((len(surfaces.interface.pairs), len(surfaces.first)), dtype=np.int32)
    begin[passes.pair, passes.master] = of.first[:, 1]
    own = surfaces.searched_nodes(facing)
    other = begin[facing.pair, surfaces.message.edge_surface[facing.master_edge]][:, None] + of.place[
        facing.master_edge]
    twin = np.arange(out.size) + 1 - 2 * (np.arange(out.size) % 2)
    for nodes, xi, near in ((other, facing.xi_m, NEAR_NODE), (own, facing.xi_s, AT_NODE)):
        end = xi + ON * (xi - xi[twin])
        second = np.round(np.clip(end, 0.0, 1.0)).astype(np.intp)
        there = np.abs(end - second) < near
        gap = facing.node_gap[nodes[np.arange(out.size), second]]
        out = np.where(there, gap, out)
    return out


def touching(points: ContactPoints | None, solved: NDArray[np.bool_]) -> int:
    """Count points under pressure whose slave is solved for here.

    solved : (n_nodes,) False at nodes of bodies that another half solves for, which counts theirs.
    """
    # fault: points between two halves are counted by both -> return 0 if points is None else int((points.p > 0).sum())
    #   | coupler/test_several::test_numbers_of_the_role_are_those_of_one_half
    return 0 if points is None else int(((points.p > 0) & solved[points.nodes[:, 0]]).sum())


def _from_master(surfaces: ContactSurfaces, facing: Facing) -> NDArray[np.bool_] | None:
    """Return (n_p,) True where the point was searched from the pair's master; None where every pair is searched once.
    """
    pairs, message = surfaces.interface.pairs, surfaces.message
    if message.passes.pair.size == len(pairs):
        return None
    slave = np.array([message.edge_surface[surfaces.first[pair.slave]] for pair in pairs])
    return np.asarray(message.edge_surface[facing.slave_edge] != slave[facing.pair])


def _by_pair_sides(points: ContactPoints, exchanged: NDArray[np.bool_]) -> ContactPoints:
    """Exchange the sides of points a second pass searched from the master: properties belong to the sides of a pair."""
    def sides(s: NDArray[Any], m: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        other = exchanged.reshape(-1, *[1] * (s.ndim - 1))
        return np.where(other, m, s), np.where(other, s, m)

    N_s, N_m = sides(points.N_s, points.N_m)
    area_s, area_m = sides(points.area_s, points.area_m)
    end_s, end_m = sides(points.end_s, points.end_m)
    slave_edge, master_edge = sides(points.slave_edge, points.master_edge)
    nodes = np.concatenate(sides(points.nodes[:, :2], points.nodes[:, 2:]), axis=1)
    return replace(points, nodes=nodes, N_s=N_s, N_m=N_m, area_s=area_s, area_m=area_m, end_s=end_s, end_m=end_m,
                   slave_edge=slave_edge, master_edge=master_edge, from_master=exchanged)
