"""Temperatures at the start, wherever they come from: a number, a function of place, or another run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import field_from
from contact.half.interface import Interface
from contact.problem.curves import FieldSum

Floats = NDArray[np.float64]
START_T = "T"  # of Interface.start


def start_temperature(T0: Any, interface: Interface, nodes: NDArray[np.integer]) -> Floats:
    """Return the temperatures (n,) [K] that a start states at nodes : (n,), numbers of the mesh.

    T0 : a number [K]; a sum of terms, {"terms": [...]}, at the reference coordinates; or {"dataset": "start/T"}, what
    stands in interface.h5.  Each as it is, or as a model.json has it.  Raises ValueError where a node has none there.
    """
    if isinstance(T0, int | float):
        return np.full(len(nodes), float(T0))
    if isinstance(T0, FieldSum) or (isinstance(T0, Mapping) and "terms" in T0):
        # fault: a start at coordinates of its own -> return field_from(T0).at(interface.nodes[nodes] -
        #   interface.nodes[nodes].mean(axis=0), 0.0) | coupler/test_starts
        return field_from(T0).at(interface.nodes[nodes], 0.0)
    T = interface.start[START_T][nodes] if START_T in interface.start else np.full(len(nodes), np.nan)
    if np.isnan(T).any():
        raise ValueError(f"interface.h5: start/T has no temperature for node {int(nodes[np.argmax(np.isnan(T))]) + 1}")
    return T


def mean_start(T0: Any, interface: Interface, nodes: NDArray[np.integer]) -> float:
    """Return the mean [K] of the temperatures that a start states at nodes : (n,); the number itself where it is one.
    """
    return float(T0) if isinstance(T0, int | float) else float(start_temperature(T0, interface, nodes).mean())


def start_temperatures(interface: Interface, T0: Sequence[Any]) -> Floats:
    """Return the temperatures (n_nodes,) [K] at the start.

    T0 : of each part (Interface.parts), as start_temperature takes it.  Where parts meet in a node the last one holds.
    A node that no cell uses has the first one's mean.
    """
    T = np.empty(len(interface.nodes))
    loose = interface.node_body < 0
    if loose.any():
        T[loose] = start_temperature(T0[0], interface, interface.part_nodes(0)).mean()
    for part, one in enumerate(T0):
        nodes = np.flatnonzero(interface.node_body == part) if not interface.regions else interface.part_nodes(part)
        T[nodes] = start_temperature(one, interface, nodes)
    return T
