"""What a half, or the coupler, tells the contact service of a scene, once."""

from __future__ import annotations

import numpy as np

from contact.half.interface import Interface
from contact.wire import Register


def surface_names(interface: Interface) -> list[str]:
    """The contact surfaces in the order of their numbers: as the pairs first name them, slave before master."""
    return list(dict.fromkeys(name for pair in interface.pairs for name in (pair.slave, pair.master)))


def register_message(interface: Interface) -> Register:
    """The surfaces of an interface file as the message that registers them.

    The edges of one surface are consecutive and keep their order; nodes are indices s into Interface.contact_nodes.
    """
    names = surface_names(interface)
    number = {name: i for i, name in enumerate(names)}
    nodes = interface.contact_nodes
    edges = [np.searchsorted(nodes, interface.surfaces[name]).reshape(-1, 2) for name in names]
    return Register(
        n_nodes=len(nodes),
        edges=np.concatenate([np.empty((0, 2), dtype=np.int32), *edges]).astype(np.int32),
        edge_surface=np.repeat(np.arange(len(names)), [len(e) for e in edges]).astype(np.int32),
        pair_slave=np.array([number[p.slave] for p in interface.pairs], dtype=np.int32),
        pair_master=np.array([number[p.master] for p in interface.pairs], dtype=np.int32),
        gap_max=np.array([p.gap_max for p in interface.pairs], dtype=np.float64),
        eps_N=np.array([p.eps_N for p in interface.pairs], dtype=np.float64),
        axisymmetric=interface.axisymmetric,
    )
