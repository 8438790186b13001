"""What a half, or the coupler, tells the contact service of a scene, once."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from contact.half.interface import Interface, Pair
from contact.half.outlines import thickness_behind
from contact.messages import Passes, Register


def surface_names(interface: Interface) -> list[str]:
    """The contact surfaces in the order of their numbers: as the pairs first name them, slave before master."""
    return list(dict.fromkeys(name for pair in interface.pairs for name in (pair.slave, pair.master)))


# eps_T over eps_N of augmented pairs.  They overlap by nothing, so what sticks is all that yields there: as soft as the
# penalty, which is as soft as cells, it makes zones that stick some per cent too wide (Cattaneo).
STICK = 4.0


def register_message(interface: Interface, parting: Collection[str] = (), rigid: Collection[str] = (),
                     augmented: Collection[str] = ()) -> Register:
    """The surfaces of an interface file as the message that registers them.

    The edges of one surface are consecutive and keep their order; nodes are indices s into Interface.contact_nodes.
    parting : names of pairs that have their penalty alone (contact.messages.Passes).  rigid : of surfaces that do not
    deform.  augmented : of pairs whose pressures are multipliers.
    """
    names = surface_names(interface)
    number = {name: i for i, name in enumerate(names)}
    nodes = interface.contact_nodes
    edges = [np.searchsorted(nodes, interface.surfaces[name]).reshape(-1, 2) for name in names]
    return Register(
        n_nodes=len(nodes),
        edges=np.concatenate([np.empty((0, 2), dtype=np.int32), *edges]).astype(np.int32),
        edge_surface=np.repeat(np.arange(len(names)), [len(e) for e in edges]).astype(np.int32),
        axisymmetric=interface.axisymmetric,
        passes=passes_of(interface, number, parting, rigid, augmented),
        stiffness=np.concatenate([np.empty(0), *(interface.stiffness.get(name, np.zeros(len(e)))
                                                 for name, e in zip(names, edges, strict=True))]),
        offset=interface.gap_offset,
        x=interface.nodes[nodes],
    )


def passes_of(interface: Interface, number: Mapping[str, int], parting: Collection[str] = (),
              rigid: Collection[str] = (), augmented: Collection[str] = ()) -> Passes:
    """How the pairs are searched: once, twice from either side, or a surface from itself; number : of surfaces.

    parting, rigid, augmented : as of register_message.
    """
    rows = []
    for i, pair in enumerate(interface.pairs):
        slave, master = number[pair.slave], number[pair.master]
        # A surface that meets itself finds every place from both sides in one search.
        # fault: two passes of full weight -> weight = 1.0 | mechanical_fmu/test_contact_patch
        weight = 0.5 if pair.two_pass or slave == master else 1.0
        eps_N = 0.0 if pair.local else pair.eps_N
        rest = (weight, int(pair.by_node), pair.gap_max, eps_N, pair.eps_T, pair.mu,
                search_depth(interface, pair), int(pair.tied), int(pair.smooth), int(pair.name in parting))
        # fault: corners lean to faces that come to fit them -> leans = [int(pair.name in parting)] * 2 |
        #   mechanical_fmu/test_bounce_on_a_corner
        leans = [int(pair.name in parting and met in rigid) for met in (pair.master, pair.slave)]
        # fault: what sticks is as soft as cells -> stick = 1.0 | mechanical_fmu/test_cattaneo
        stick = STICK if pair.name in augmented else 1.0
        rows.append((i, slave, master, *rest, leans[0], stick))
        if pair.two_pass and slave != master:
            rows.append((i, master, slave, *rest, leans[1], stick))
    columns = list(zip(*rows, strict=True)) if rows else [()] * 15
    kinds = [np.int32, np.int32, np.int32, np.float64, np.int32, *[np.float64] * 5, *[np.int32] * 4, np.float64]
    return Passes(*(np.array(column, dtype=kind) for column, kind in zip(columns, kinds, strict=True)))


def search_depth(interface: Interface, pair: Pair) -> float:
    """Return half of what the bodies of a pair are thick behind its surfaces, at least [m].

    What overlaps deeper may as well have gone through.  0, so that an edge's length has to do, where both surfaces are
    of one body, or of none.
    """
    # fault: contact looks no deeper than an edge -> return 0.0 | mechanical_fmu/test_passing
    return 0.5 * thickness_behind(interface, pair)
