"""What happened to contact in a run, kept from window to window (contact.half.diagnostics says what is looked for)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from contact.half.diagnostics import ContactLog, ContactMonitor, ContactSample
from contact.half.interface import Interface
from coupler.fmu.half import Half
from coupler.record.tables import FRICTION
from coupler.scenario import Probe
from coupler.schemes.state import Halves, Level


class Watched:
    """Of a run whose mechanical half says which nodes face something (outputs); of any other nothing is known."""

    def __init__(self, interface: Interface, outputs: Collection[str]) -> None:
        self._watch = ContactMonitor(interface) if "contact.covered" in outputs and interface.pairs else None
        self._seen = ContactLog()
        self._said: tuple[str, ...] = ()

    @property
    def memory(self) -> tuple[ContactLog, tuple[str, ...]]:
        """What was seen and said up to now."""
        return self._seen, self._said

    def put_back(self, seen: ContactLog, said: tuple[str, ...]) -> None:
        """Go on from what was remembered once."""
        self._seen, self._said = seen, said

    def after(self, before: Level, now: Level) -> tuple[str, ...]:
        """What an accepted window brought that should not go by in silence."""
        if self._watch is None:
            return ()
        self._seen, notes = self._watch.after_window(self._seen, now.t, _contact(before), _contact(now))
        self._said = (*self._said, *notes)
        return notes

    def at_end(self, now: Level) -> list[str]:
        """All that was said, and what is to be said at the end."""
        return list(self._said) + (self._watch.at_end(self._seen, now.x) if self._watch is not None else [])


def _contact(level: Level) -> ContactSample:
    return ContactSample(level.x, level.t_N, level.covered)


# What the halves tell for the record alone, beside the exchange: fields for pictures, what friction does.

Array = NDArray[np.float64]
PICTURES: Mapping[str, Mapping[str, Sequence[str]]] = {
    "thermal": {"point": ("f_s",), "cell": ("q",)}, "mechanical": {"point": (), "cell": ("sigma_v", "sigma")}}


def picture_names(halves: Halves) -> dict[str, dict[str, list[str]]]:
    """half -> "point", "cell" -> those of PICTURES it has."""
    own: Mapping[str, Half] = {"thermal": halves.thermal, "mechanical": halves.mechanical}
    return {role: {at: [n for n in names if n in own[role].blocks] for at, names in kinds.items()}
            for role, kinds in PICTURES.items()}


def pictures(halves: Halves) -> dict[str, Array]:
    """Those fields as they are now."""
    found: dict[str, Array] = {}
    for half, kinds in zip((halves.thermal, halves.mechanical), picture_names(halves).values(), strict=True):
        names = [n for of_kind in kinds.values() for n in of_kind]
        found |= half.read(names) if names else {}
    return found


def friction(halves: Halves) -> dict[str, Array]:
    """(n_s,) each of slave nodes, what the mechanical half tells of FRICTION."""
    half = halves.mechanical
    told = [f"contact.{n}" for n in FRICTION if f"contact.{n}" in half.blocks]
    return {n.removeprefix("contact."): v for n, v in half.read(told).items()} if told else {}


# Probes read from a level of the exchange.

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
