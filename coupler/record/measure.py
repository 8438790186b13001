"""Probes read from a level of the exchange."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.scenario import Probe
from coupler.schemes.level import Level

Array = NDArray[np.float64]


def measure(probes: Mapping[str, Probe], interface: Interface, level: Level) -> Array:
    """Values : (n_probes,) in SI, in the order of the probes."""
    fields: dict[str, Array] = {}
    for probe in probes.values():
        if probe.quantity not in fields:
            fields[probe.quantity] = _field(probe.quantity, interface, level)
    return np.array([probe.of(fields[probe.quantity]) for probe in probes.values()])


def _field(quantity: str, interface: Interface, level: Level) -> Array:
    """A quantity at every node : (n_nodes,); contact quantities are NaN away from the contact surfaces."""
    if quantity == "T":
        return level.T
    if quantity == "f_s":
        assert level.f_s is not None, "the scenario was checked for it"
        return level.f_s
    if quantity in ("u_x", "u_y"):
        i = ("u_x", "u_y").index(quantity)
        return level.x[:, i] - interface.nodes[:, i]
    values = np.full(len(interface.nodes), np.nan)
    values[interface.contact_nodes] = level.gap if quantity == "gap" else -level.t_N
    return values
