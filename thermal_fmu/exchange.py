"""Heat exchanged between facing points, touching or apart: Eqs. (8-10), pairwise through one common area."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.laws import Law, closed_conductance, open_conductance
from thermal_fmu.facing import Points
from thermal_fmu.spec_boundary import PairLaws

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Group:
    """Facing points of one pair under one law.

    argument : (n,) p [Pa] where closed, g [m] where open.  nodes : (n, 4), slave's two, master's two.
    """

    pair: int
    closed: bool
    law: Law
    argument: Floats
    nodes: Ints
    N_s: Floats
    N_m: Floats
    area: Floats

    @property
    def mechanism(self) -> str:
        """The word of the heat ledger."""
        return "contact" if self.closed else "gap"


def groups_of(points: Points, laws: Sequence[PairLaws | None]) -> tuple[Group, ...]:
    """The facing points that conduct, by pair and branch; points of a pair or branch without a law are left out."""
    groups = []
    for pair, own in enumerate(laws):
        if own is None:
            continue
        for closed, law in ((True, own.closed), (False, own.open)):
            at = np.flatnonzero((points.pair == pair) & ((points.p > 0) == closed))
            if law is not None and at.size:
                argument = (points.p if closed else points.gap)[at]
                groups.append(Group(pair, closed, law, argument, points.nodes[at], points.N_s[at],
                                    points.N_m[at], points.area[at]))
    return tuple(groups)


def exchange_flow(group: Group, factor: float, T: Floats) -> tuple[Floats, Floats]:
    """(n, 4) heat that leaves the nodes of each point [W], and (n, 4, 4) its derivative [W/K].

    T : (n_nodes,) [K].  q = factor h(argument, T_mean) (T_s - T_m) A leaves the slave's nodes by its shape functions
    and enters the master's by theirs.
    """
    T_s = (group.N_s * T[group.nodes[:, :2]]).sum(axis=1)
    T_m = (group.N_m * T[group.nodes[:, 2:]]).sum(axis=1)
    conductance = closed_conductance if group.closed else open_conductance
    h, dh = conductance(group.law, group.argument, 0.5 * (T_s + T_m))
    # fault: one-sided interface flux -> out = np.concatenate([group.N_s, -0.9 * group.N_m], axis=1) |
    #   thermal_fmu/test_thermal_contact
    out = np.concatenate([group.N_s, -group.N_m], axis=1)
    jump = T_s - T_m
    flow = (factor * group.area * h * jump)[:, None] * out
    mean = np.concatenate([group.N_s, group.N_m], axis=1)
    # fault: derivative of h(T) forgotten -> dq = (factor * group.area)[:, None] * (h[:, None] * out + (0.0 * dh *
    #   jump)[:, None] * mean) | thermal_fmu/test_thermal_nonlinear
    dq = (factor * group.area)[:, None] * (h[:, None] * out + (0.5 * dh * jump)[:, None] * mean)
    return flow, out[:, :, None] * dq[:, None, :]
