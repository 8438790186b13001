"""Heat from one surface to another: contact and gaps, Eqs. (8-10), and near radiation, (11)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from contact.laws import Law, closed_conductance, gap_factor, open_conductance
from thermal_fmu.averages import AveragedExchange, NodeAverages, Relief, averaged_exchange
from thermal_fmu.contact_quadrature import ContactPoints
from thermal_fmu.problem import ThermalPair
from thermal_fmu.surface_terms import emissivity_at, fourth

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Conduction between contact quadrature points, touching or apart, Eqs. (8-10)

@dataclass(frozen=True)
class ConductionGroup:
    """Contact quadrature points of one pair under one law.

    argument : (n,) p [Pa] where closed, g [m] where open.  nodes : (n, 4), slave's two, master's two.
    N_s, N_m : (n, 2) [1].  area : (n,) [m2], where open that of the gas between the sides.  by_node : (n,) how far the
    exchange goes from node to node in place of by shape functions [1] (monotone.py); None: nowhere.  most : (n,) what a
    point is let conduct [W/K]; None: all.  pointwise : (n,) up to what it exchanges by itself [W/K]; what it conducts
    beyond that goes by averages, from which relief is taken off; None: all of it.
    """

    pair: int
    closed: bool
    law: Law
    argument: Floats
    nodes: Ints
    N_s: Floats
    N_m: Floats
    area: Floats
    by_node: Floats | None = None
    most: Floats | None = None
    pointwise: Floats | None = None
    averages: NodeAverages | None = None
    relief: Relief | None = None

    @property
    def mechanism(self) -> str:
        """The name of its term in the heat balance."""
        return "contact" if self.closed else "gap"

    def strength(self, factor: float, T: Floats) -> tuple[Floats, Floats]:
        """Return (n,) conductances of the points [W/K], and (n,) their derivatives by the mean of the sides [W/K2].

        T : (n_nodes,) [K].  factor : of the conductance [1].
        """
        T_n = T[self.nodes]
        mean = 0.5 * ((self.N_s * T_n[:, :2]).sum(axis=1) + (self.N_m * T_n[:, 2:]).sum(axis=1))
        h, dh = (closed_conductance if self.closed else open_conductance)(self.law, self.argument, mean)
        W = factor * self.area * h
        # fault: derivative of h(T) forgotten -> dW = 0.0 * dh | thermal_fmu/test_thermal_nonlinear
        dW = factor * self.area * dh
        if self.most is None:
            return W, dW
        # fault: contact conducts beyond what numbers hold -> most = W | thermal_fmu/test_thermal_ledger
        most = self.most
        return np.minimum(W, most), np.where(most < W, 0.0, dW)

    def split(self, W: Floats, dW: Floats) -> tuple[Floats, Floats, Averaged | None]:
        """Part conductances W : (n,) [W/K] and their derivatives dW : (n,) [W/K2] into what points exchange by
        themselves and what goes by averages, None where nothing does.
        """
        if self.pointwise is None or self.averages is None:
            return W, dW, None
        # fault: contact that conducts far better than cells is exchanged at points -> more = W < 0.0 |
        #   thermal_fmu/test_thermal_stiff
        more = self.pointwise < W
        if not more.any():
            return W, dW, None
        own, down = np.where(more, self.pointwise, W), np.where(more, 0.0, dW)
        return own, down, Averaged(self.averages, W - own, dW - down)


@dataclass(frozen=True)
class Averaged:
    """What goes by averages.  V : (n,) conductances [W/K], dV : (n,) their derivatives by the mean of the sides [W/K2].
    """

    over: NodeAverages
    V: Floats
    dV: Floats


@dataclass(frozen=True)
class ThroughCells:
    """What the cells at each node conduct, (n_nodes,) [W/m2K]: k over the shortest edge, the most of them, and over the
    longest, the least.
    """

    most: Floats
    least: Floats


# Times what the cells beside a contact conduct: more of it moves T by less than 1e-9 of its drop in one of these cells,
# and round-off of h A T is the heat of the whole step.  A law of pressure goes there far beyond its data.
STIFFEST = 1e9
# Times what the cells of both sides conduct: more of it goes by averages (averages.py).  With 0 to 100 steps beside a
# contact come out as on meshes that match; up to 20 pointwise exchange does no harm, and costs less.
POINTWISE = 20.0


def conduction_groups(points: ContactPoints, pairs: Sequence[ThermalPair | None],
                      through_cells: ThroughCells | None = None,
                      by_node: Sequence[bool] = ()) -> tuple[ConductionGroup, ...]:
    """Collect the points that conduct, by pair and branch; points of a pair or branch without a law are left out.

    through_cells : None: contact may conduct whatever it is said to.
    by_node : which pairs have one point a node, so that nothing is to be averaged; as many as pairs, or none.
    """
    groups, in_touch = [], points.closed_share
    for pair, own in enumerate(pairs):
        laws = None if own is None else own.stated.conduction
        if laws is None:
            continue
        for closed, law in ((True, laws.closed), (False, laws.open)):
            if law is None:
                continue
            share = in_touch if closed else 1.0 - in_touch
            at = np.flatnonzero((points.pair == pair) & (share > 0.0))
            if at.size:
                argument, area = (points.p, points.area) if closed else (points.gap, points.open_area)
                area = area * share if points.join > 0.0 else area
                most = None if through_cells is None else \
                    STIFFEST * area[at] * through_cells.most[points.nodes[at]].max(axis=1)
                group = ConductionGroup(pair, closed, law, argument[at], points.nodes[at], points.N_s[at],
                                        points.N_m[at], area[at], None, most)
                if through_cells is not None and closed and not any(by_node[pair : pair + 1]):
                    searched, N = points.searched_from
                    group = replace(group, pointwise=POINTWISE * area[at] * _in_a_row(group, through_cells.least),
                                    averages=NodeAverages(searched[at], N[at], group.nodes))
                groups.append(group)
    return tuple(groups)


def _in_a_row(group: ConductionGroup, through_cells: Floats) -> Floats:
    """Return (n,) [W/m2K] what the cells of both sides conduct at each point, one behind the other."""
    sides = [(N * through_cells[nodes]).sum(axis=1)
             for N, nodes in ((group.N_s, group.nodes[:, :2]), (group.N_m, group.nodes[:, 2:]))]
    return np.asarray(sides[0] * sides[1] / (sides[0] + sides[1]))


def exchange_flow(group: ConductionGroup, factor: float, T: Floats) -> tuple[Floats, Floats, AveragedExchange | None]:
    """Return (n, 4) heat that leaves the nodes of each point [W], and (n, 4, 4) its derivative [W/K]; and what goes by
    averages, None where nothing does.

    T : (n_nodes,) [K].  factor : of the conductance [1].  q = factor h(argument, T_mean) (T_s - T_m) A leaves the
    slave's nodes by its shape functions and enters the master's by theirs.
    """
    W, dW, averaged = group.split(*group.strength(factor, T))
    # fault: one-sided interface flux -> out = np.concatenate([group.N_s, -0.9 * group.N_m], axis=1) |
    #   thermal_fmu/test_thermal_contact
    out = np.concatenate([group.N_s, -group.N_m], axis=1)
    # Differences to a node of the point: of temperatures as they are, round-off times a large conductance is a flow.
    # fault: round-off of whole temperatures across contact -> T = T[group.nodes] |
    #   thermal_fmu/test_thermal_ledger
    T = T[group.nodes] - T[group.nodes[:, :1]]
    jump = (group.N_s * T[:, :2]).sum(axis=1) - (group.N_m * T[:, 2:]).sum(axis=1)
    by_one, dq = jump[:, None] * out, W[:, None] * out
    slope = out[:, :, None] * dq[:, None, :]
    if group.by_node is not None:
        other = group.by_node[:, None, None] * (between_nodes(group.N_s, group.N_m) - out[:, :, None] * out[:, None, :])
        by_one += (other * T[:, None, :]).sum(axis=2)
        slope += W[:, None, None] * other
    if dW.any():
        slope += by_one[:, :, None] * (0.5 * dW[:, None] * np.abs(out))[:, None, :]
    flow = np.asarray(W[:, None] * by_one)
    if averaged is None:
        return flow, slope, None
    return flow, slope, averaged_exchange(averaged.over, group.relief, averaged.V, averaged.dV, jump, out)


def between_nodes(N_s: Floats, N_m: Floats) -> Floats:
    """Return (n, 4, 4) the exchange from node to node that one unit of conductance at each point makes [1].

    N_s, N_m : (n, 2) [1].  Between a slave's and a master's node w_ij >= 0, with sum_j w_ij = N_s_i and sum_i w_ij =
    N_m_j; of all such w this one moves heat least along the surface: nodes that face each other exchange with each
    other alone.  Edges run against each other: slave's first node faces master's last.
    """
    w = np.empty((len(N_s), 2, 2))
    w[:, 0, 1] = np.minimum(N_s[:, 0], N_m[:, 1])
    w[:, 0, 0] = N_s[:, 0] - w[:, 0, 1]
    w[:, 1, 1] = N_m[:, 1] - w[:, 0, 1]
    w[:, 1, 0] = N_s[:, 1] - w[:, 1, 1]
    out = np.zeros((len(w), 4, 4))
    i = np.arange(2)
    out[:, i, i], out[:, 2 + i, 2 + i] = N_s, N_m
    out[:, :2, 2:], out[:, 2:, :2] = -w, -w.transpose(0, 2, 1)
    return out


# Radiation, Eq. (11)

@dataclass(frozen=True)
class RadiationGroup:
    """Contact quadrature points of a pair that radiate to each other.

    pair : its number.  nodes : (n, 4), slave's two, master's two.  N_s, N_m : (n, 2) [1].  area : (n,) of the smaller
    side, weighted with 1 - w [m2].  part_s, part_m : (n,) that area as a part of either side's own [1], one of them 1.
    emissivities : of slave and master.
    """

    pair: int
    emissivities: tuple[Property, Property]
    nodes: Ints
    N_s: Floats
    N_m: Floats
    area: Floats
    part_s: Floats
    part_m: Floats


def radiation_groups(points: ContactPoints, pairs: Sequence[ThermalPair | None]) -> tuple[RadiationGroup, ...]:
    """Collect the points that radiate to each other, touching or apart, by pair; Eq. (11) with its weight 1 - w."""
    groups = []
    for pair, laws in enumerate(pairs):
        if laws is None or laws.stated.radiation is None or laws.emissivities is None:
            continue
        gap = laws.stated.radiation.gap
        weight = np.ones(points.gap.size)
        if gap is not None:
            # fault: near radiation at every gap -> weight -= 0.0 * gap_factor(points.gap, *gap.ends) |
            #   thermal_fmu/test_thermal_radiation
            weight -= gap_factor(points.gap, *gap.ends)
        at = np.flatnonzero((points.pair == pair) & (weight > 0.0))
        if at.size:
            end_s, end_m = points.end_s[at], points.end_m[at]
            # fault: near radiation by the area of the slave alone -> small, end_m = end_s, end_s |
            #   thermal_fmu/test_thermal_gap_area
            small = np.minimum(end_s, end_m)
            part_s, part_m = (np.divide(small, end, out=np.ones(at.size), where=end > 0.0) for end in (end_s, end_m))
            groups.append(RadiationGroup(pair, laws.emissivities, points.nodes[at], points.N_s[at], points.N_m[at],
                                         weight[at] * small, part_s, part_m))
    return tuple(groups)


def gap_radiation_flow(group: RadiationGroup, sigma: float, T: Floats) -> tuple[Floats, Floats]:
    """Return (n, 4) heat that leaves the nodes of each point [W], and (n, 4, 4) its derivative [W/K].

    T : (n_nodes,) [K], sigma : [W/m2K4].  Eq. (11): q leaves the slave's nodes by its shape functions and enters the
    master's by theirs.  It is (1 - w) sigma (T_s^4 - T_m^4) over a row of three resistances: (1 - eps)/(eps A) of
    either surface, and 1/A of the smaller one, whose rays all meet the other (Howell, Menguc & Siegel, Thermal
    Radiation Heat Transfer, 5.3).  With equal areas that makes A/(1/eps_s + 1/eps_m - 1), as between plates.
    """
    T_s = (group.N_s * T[group.nodes[:, :2]]).sum(axis=1)
    T_m = (group.N_m * T[group.nodes[:, 2:]]).sum(axis=1)
    of_slave, of_master = group.emissivities
    # fault: emissivities mixed up between the sides -> eps_s, deps_s = emissivity_at(of_slave, T_m) |
    #   thermal_fmu/test_thermal_radiation
    eps_s, deps_s = emissivity_at(of_slave, T_s)
    eps_m, deps_m = emissivity_at(of_master, T_m)
    # fault: black bodies between plates -> resistance = group.part_s / eps_s + group.part_m / eps_m |
    #   thermal_fmu/test_thermal_radiation
    resistance = group.part_s / eps_s + group.part_m / eps_m - np.minimum(group.part_s, group.part_m)  # times area
    strength = sigma * group.area / resistance
    q = strength * (fourth(T_s) - fourth(T_m))
    per_resistance = q / resistance  # a point may have no area
    dq_s = 4.0 * strength * np.abs(T_s) ** 3 + per_resistance * group.part_s * deps_s / eps_s**2
    # fault: derivative of the master's emissivity forgotten -> dq_m = -4.0 * strength * np.abs(T_m) ** 3 + 0.0 *
    #   per_resistance | thermal_fmu/test_thermal_fields
    dq_m = -4.0 * strength * np.abs(T_m) ** 3 + per_resistance * group.part_m * deps_m / eps_m**2
    # fault: near radiation one-sided -> out = np.concatenate([group.N_s, -0.9 * group.N_m], axis=1) |
    #   thermal_fmu/test_thermal_friction
    out = np.concatenate([group.N_s, -group.N_m], axis=1)
    dq = np.concatenate([dq_s[:, None] * group.N_s, dq_m[:, None] * group.N_m], axis=1)
    return q[:, None] * out, out[:, :, None] * dq[:, None, :]


def radiated_along_edges(groups: Sequence[RadiationGroup], sigma: float,
                         T: Floats) -> Iterator[tuple[Ints, Floats]]:
    """Yield nodes : (n, 2) of edges that radiate to others, and (n,) what that couples them by at most [W/K].

    T : (n_nodes,) [K], sigma : [W/m2K4].  What the warmer node of an edge takes up, N_1 S (T_m^4 - T_s^4) where T_m is
    no warmer than T_1, is at most 4 T_1^3 S N_1 N_2 (T_1 - T_2); with the larger T^3 it holds for both nodes.
    """
    for group in groups:
        sides = ((group.nodes[:, :2], group.N_s), (group.nodes[:, 2:], group.N_m))
        (eps_s, _), (eps_m, _) = (emissivity_at(eps, (N * T[nodes]).sum(axis=1))
                                  for eps, (nodes, N) in zip(group.emissivities, sides, strict=True))
        strength = sigma * group.area / (group.part_s / eps_s + group.part_m / eps_m
                                         - np.minimum(group.part_s, group.part_m))
        for nodes, N in sides:
            yield nodes, 4.0 * strength * N.prod(axis=1) * np.abs(T[nodes]).max(axis=1) ** 3
