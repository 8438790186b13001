"""Heat from one surface to another: contact and gaps, Eqs. (8-10), and near radiation, (11).

Conductances are those of the contact quadrature points, temperatures differ at the ends of pieces.  An end is a node of
one side or of the other, so nodes that face each other exchange with each other alone, at any conductance.  Shared
between the two nodes of an edge, as by shape functions at the points themselves, the exchange would couple them with the
wrong sign: beside a jump of 500 K a node left its data by 2 to 40 % at cell Biot numbers from 10.  A uniform flow and
equal temperatures of both sides are still met exactly on any two meshes, because shape functions are linear in a piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from contact.laws import Law, closed_conductance, gap_factor, open_conductance
from thermal_fmu.contact_quadrature import ContactPoints
from thermal_fmu.problem import ThermalPair
from thermal_fmu.surface_terms import emissivity_at, fourth

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# A piece lo..hi has two points, at (1 -+ 1/sqrt 3)/2 of it.  What a point has goes to the ends by these shares, and a
# linear function at the points follows from its ends by the same.
NEAR, FAR = 0.5 + 0.5 / np.sqrt(3.0), 0.5 - 0.5 / np.sqrt(3.0)
SHARES: Floats = np.array([[NEAR, FAR], [FAR, NEAR]])
SNAP = 1e-9  # of an edge: an end so near to a node is at it


def ends_of(N: Floats) -> Floats:
    """Return (m, 2, 2) shape functions at the two ends of pieces, from those at their two points, N : (2 m, 2)."""
    first, second = N[::2], N[1::2]
    beyond = (0.5 * (np.sqrt(3.0) - 1.0)) * (second - first)
    ends = np.clip(np.stack([first - beyond, second + beyond], axis=1), 0.0, 1.0)
    ends[ends < SNAP] = 0.0
    ends[ends > 1.0 - SNAP] = 1.0
    return ends


# Conduction, touching or apart, Eqs. (8-10)

@dataclass(frozen=True)
class ConductionGroup:
    """Pieces of one pair with contact quadrature points under one law.

    argument, area : (m, 2) of the two points of a piece: p [Pa] where closed, g [m] where open; [m2], where open that of
    the gas between the sides, 0 where a point is under the other law.  nodes : (m, 4), slave's two, master's two.
    N_s, N_m : (m, 2, 2) at the two ends of a piece [1].  bridges : (m, 2, 2) at each end, for slave and master, the share
    of the exchange between the edge's own nodes that is taken off (within.py); None: nothing is.
    """

    pair: int
    closed: bool
    law: Law
    argument: Floats
    area: Floats
    nodes: Ints
    N_s: Floats
    N_m: Floats
    bridges: Floats | None = None

    @property
    def mechanism(self) -> str:
        """The name of its term in the heat balance."""
        return "contact" if self.closed else "gap"

    @cached_property
    def out(self) -> Floats:
        """(m, 2, 4) what leaves each node of a piece by one unit of flow at each end [1]."""
        # fault: one-sided interface flux -> return np.concatenate([self.N_s, -0.9 * self.N_m], axis=2) |
        #   thermal_fmu/test_thermal_contact
        return np.concatenate([self.N_s, -self.N_m], axis=2)

    @cached_property
    def shared(self) -> Floats:
        """(m, 2, 2) N_1 N_2 of slave and master at each end [1]: not 0 where an end lies within an edge."""
        return np.stack([self.N_s[:, :, 0] * self.N_s[:, :, 1], self.N_m[:, :, 0] * self.N_m[:, :, 1]], axis=2)

    def strength(self, factor: float, T: Floats) -> tuple[Floats, Floats]:
        """Return (m, 2) conductances of the ends [W/K], and (m, 2, 4) their derivatives by the nodes' T [W/K2].

        T : (n_nodes,) [K].  factor : of the conductance [1].
        """
        mean = 0.5 * (SHARES @ np.abs(self.out))
        conductance = closed_conductance if self.closed else open_conductance
        h, dh = conductance(self.law, self.argument, (mean * T[self.nodes][:, None, :]).sum(axis=2))
        # fault: derivative of h(T) forgotten -> dh = 0.0 * dh | thermal_fmu/test_thermal_nonlinear
        return factor * (self.area * h) @ SHARES, SHARES @ (factor * (self.area * dh)[:, :, None] * mean)


def conduction_groups(points: ContactPoints, pairs: Sequence[ThermalPair | None]) -> tuple[ConductionGroup, ...]:
    """Collect the points that conduct, by pair and branch; points of a pair or branch without a law are left out."""
    groups = []
    N_s, N_m, pair_of = ends_of(points.N_s), ends_of(points.N_m), points.pair[::2]
    for pair, own in enumerate(pairs):
        laws = None if own is None else own.stated.conduction
        if laws is None:
            continue
        for closed, law in ((True, laws.closed), (False, laws.open)):
            under = ((points.p > 0) == closed).reshape(-1, 2)
            at = np.flatnonzero((pair_of == pair) & under.any(axis=1))
            if law is not None and at.size:
                argument, area = (v.reshape(-1, 2)[at] for v in (
                    (points.p, points.area) if closed else (points.gap, points.open_area)))
                groups.append(ConductionGroup(pair, closed, law, argument, np.where(under[at], area, 0.0),
                                              points.nodes[::2][at], N_s[at], N_m[at]))
    return tuple(groups)


BETWEEN: Floats = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])  # the two nodes of slave and of master


def exchange_flow(group: ConductionGroup, factor: float, T: Floats) -> tuple[Floats, Floats]:
    """Return (m, 4) heat that leaves the nodes of each piece [W], and (m, 4, 4) its derivative [W/K].

    T : (n_nodes,) [K].  factor : of the conductance [1].  q = factor h(argument, T_mean) (T_s - T_m) A leaves the
    slave's nodes by its shape functions and enters the master's by theirs.
    """
    T_n, out = T[group.nodes], group.out
    W, dW = group.strength(factor, T)
    by_one = (out * T_n[:, None, :]).sum(axis=2)[:, :, None] * out
    slope = np.matmul((W[:, :, None] * out).transpose(0, 2, 1), out)
    if group.bridges is not None:
        # What N_1 N_2 (T_1 - T_2) the shape functions carry from the colder to the warmer node of an edge, back again.
        share = group.bridges * group.shared
        by_one += (share * (T_n @ BETWEEN.T)[:, None, :]) @ BETWEEN
        slope += BETWEEN.T @ ((W[:, :, None] * share).sum(axis=1)[:, :, None] * BETWEEN)
    if dW.any():
        slope += np.matmul(by_one.transpose(0, 2, 1), dW)
    return (W[:, :, None] * by_one).sum(axis=1), slope


# Radiation, Eq. (11)

@dataclass(frozen=True)
class RadiationGroup:
    """Ends of pieces of a pair that radiate to each other.

    nodes : (n, 4), slave's two, master's two.  N_s, N_m : (n, 2) [1].  area : (n,) of the smaller side, weighted with
    1 - w [m2].  part_s, part_m : (n,) that area as a part of either side's own [1], one of them 1.
    emissivities : of slave and master.
    """

    emissivities: tuple[Property, Property]
    nodes: Ints
    N_s: Floats
    N_m: Floats
    area: Floats
    part_s: Floats
    part_m: Floats


def radiation_groups(points: ContactPoints, pairs: Sequence[ThermalPair | None]) -> tuple[RadiationGroup, ...]:
    """Collect the pieces that radiate to each other, touching or apart, by pair; Eq. (11) with its weight 1 - w."""
    groups = []
    N_s, N_m = ends_of(points.N_s), ends_of(points.N_m)
    for pair, laws in enumerate(pairs):
        if laws is None or laws.stated.radiation is None or laws.emissivities is None:
            continue
        gap = laws.stated.radiation.gap
        weight = np.ones(points.gap.size)
        if gap is not None:
            # fault: near radiation at every gap -> weight -= 0.0 * gap_factor(points.gap, *gap.ends) |
            #   thermal_fmu/test_thermal_radiation
            weight -= gap_factor(points.gap, *gap.ends)
        at = np.flatnonzero((points.pair[::2] == pair) & (weight.reshape(-1, 2) > 0.0).any(axis=1))
        if at.size:
            end_s, end_m = (v.reshape(-1, 2)[at].sum(axis=1) for v in (points.end_s, points.end_m))
            # fault: near radiation by the area of the slave alone -> small, end_m = end_s, end_s |
            #   thermal_fmu/test_thermal_gap_area
            small = np.minimum(end_s, end_m)
            part_s, part_m = (np.repeat(np.divide(small, end, out=np.ones(at.size), where=end > 0.0), 2)
                              for end in (end_s, end_m))
            area = (weight * np.minimum(points.end_s, points.end_m)).reshape(-1, 2)[at] @ SHARES
            groups.append(RadiationGroup(laws.emissivities, np.repeat(points.nodes[::2][at], 2, axis=0),
                                         N_s[at].reshape(-1, 2), N_m[at].reshape(-1, 2), area.ravel(), part_s, part_m))
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
