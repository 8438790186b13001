"""Bodies that hang together by what they touch, and contact of some of them as if the others were not there.

Bodies that are held all over, such as a floor, tie none together: what lies at one end knows nothing of the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from contact.half.interface import Interface
from contact.messages import Tractions
from mechanical_fmu.dynamics import BodyMotion
from mechanical_fmu.system import ForceBalance, Loading, System

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

FAR = 10.0  # times all that is drawn and reached: where bodies are put that are not there


@dataclass(frozen=True)
class Groups:
    """The groups of bodies that touch.

    label : (n_bodies,) number of the group of each, -1 of bodies that are held all over.
    """

    system: System
    label: NDArray[np.intp]

    @cached_property
    def body_of(self) -> NDArray[np.intp]:
        """Return (n_rows,) the body of each row, -1 of none."""
        of = self.system.interface.node_body.astype(np.intp)
        if (rigid := self.system.rigid) is not None:
            of[rigid.point_rows] = of[rigid.turn_rows] = rigid.body
        return of

    def rows(self, bodies: Flags) -> Floats:
        """Return (2 n_rows,) 1.0 for the components of these bodies : (n_bodies,), else 0.0."""
        return np.repeat(np.append(bodies, False)[self.body_of], 2).astype(np.float64)

    def without(self, refused: Flags) -> Flags:
        """Say, (n_bodies,), which are of no group with a body that is refused : (n_bodies,); held ones are of none."""
        return (self.label < 0) | ~np.isin(self.label, self.label[refused & (self.label >= 0)])

    def rigid_ones(self, motion: BodyMotion) -> Flags:
        """Say, (n_bodies,), which are of groups where contact pushes no nodes without mass."""
        pushed = self.system.masses.without & (motion.push != 0.0).any(axis=1)
        refused = np.zeros(self.label.size, dtype=np.bool_)
        refused[self.body_of[pushed]] = True
        return self.without(refused)


def groups_of(system: System, tractions: Tractions, before: Floats | None = None) -> Groups:
    """Find the groups of what touches, or is tied.

    before : (n, 2) [N] contact forces at the start of a step in which bodies may have parted: these touch, too.
    """
    n, touches = len(system.interface.bodies), tractions.t_N != 0.0
    joined, groups = np.zeros((n, n)), Groups(system, np.zeros(n, dtype=np.intp))
    moves, touched = (np.zeros(n + 1, dtype=np.bool_) for _ in range(2))
    moves[groups.body_of[(system.moving.reshape(-1, 2) > 0.0).any(axis=1)]] = True
    if before is not None:
        touched[groups.body_of[(before != 0.0).any(axis=1)]] = True
    for pair, (a, b) in zip(system.interface.pairs, _bodies_of(system.interface), strict=True):
        # fault: a floor ties together what lies on it -> met = True | mechanical_fmu/test_groups
        met = moves[a] and moves[b]
        joined[a, b] = met and (pair.tied or touches[system.contact.on_slaves([pair.name])].any()
                                or (touched[a] and touched[b]))
    _, label = connected_components(csr_matrix(joined), directed=False)
    return replace(groups, label=np.where(moves[:-1], label, -1).astype(np.intp))


def alone(groups: Groups, found: ForceBalance, loading: Loading, here: Flags) -> tuple[ForceBalance, Loading]:
    """Return a balance, and its loading, with the contact of these bodies only, here : (n_bodies,)."""
    if here.all():
        return found, loading
    system, tractions, query = groups.system, found.tractions, loading.query
    assert tractions is not None
    assert query is not None
    interface, pair_nodes = system.interface, system.contact.pair_nodes
    kept = np.array([here[a] and here[b] for a, b in _bodies_of(interface)])[pair_nodes.pair]
    only = replace(tractions, t_N=np.where(kept, tractions.t_N, 0.0), n_touching=int((tractions.t_N[kept] < 0.0).sum()),
                   mobilised=np.where(kept, tractions.mobilised, 0.0), slipping=np.where(kept, tractions.slipping, 0.0))
    reach = max(pair.gap_max for pair in interface.pairs)
    far = FAR * (float(np.ptp(interface.nodes, axis=0).max()) + reach)
    away = np.zeros_like(interface.nodes)
    away[:, 1] = np.where(np.append(here, True)[groups.body_of], 0.0, far)
    return replace(found, tractions=only), replace(loading, query=replace(query, away=away))


def _bodies_of(interface: Interface) -> list[tuple[int, int]]:
    """The bodies of each pair: its slave's, and its master's."""
    at = interface.bodies.index
    return [(at(pair.slave.partition(".")[0]), at(pair.master.partition(".")[0])) for pair in interface.pairs]
