"""What a run records beside the exchange: outputs of the halves, probes, warnings about contact."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contact.half.diagnostics import ContactLog, ContactMonitor, ContactSample
from contact.half.interface import Interface
from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.fmu.half import Block, Half
from coupler.fmu.outputs import (
    On,
    OutputField,
    at_nodes,
    component_of,
    names_of,
    of_pairs,
    output_fields,
    place_of,
    told_at,
    unclear,
)
from coupler.record.look import Look
from coupler.record.tables import FRICTION
from coupler.scenario.conditions import OUTPUT, ConditionOutput
from coupler.scenario.probes import AT_CONTACT, OF_MECHANICS, Probe
from coupler.schemes.levels import Level
from coupler.schemes.state import HALVED, PLACES_OFF, Halves

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
OF_MESH = "mesh."  # what a half tells of its mesh
# The halves' blocks behind what every frame holds of the exchange (EXCHANGED in coupler.record.tables).
OF_THE_EXCHANGE: Mapping[str, tuple[str, ...]] = {
    "thermal": ("T",), "mechanical": ("x", "contact.t_N", "contact.gap")}


class ContactWarnings:
    """Contact that was lost, of a run whose mechanical half says which nodes face something (outputs).

    Of any other run nothing is known.  crosses, torn : as in ContactMonitor.
    """

    def __init__(self, interface: Interface, outputs: Collection[str], crosses: Mapping[str, float],
                 torn: Mapping[str, tuple[float, float]]) -> None:
        told = "contact.covered" in outputs and interface.pairs
        self._watch = ContactMonitor(interface, crosses, torn) if told else None
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
        """The warnings of an accepted window."""
        if self._watch is None:
            return ()
        self._seen, notes = self._watch.after_window(self._seen, now.t, _contact(before), _contact(now))
        self._said = (*self._said, *notes)
        return notes

    def at_end(self, now: Level) -> list[str]:
        """All warnings so far, and those of the end."""
        return list(self._said) + (self._watch.at_end(self._seen, now.x) if self._watch is not None else [])


def _contact(level: Level) -> ContactSample:
    return ContactSample(level.x, level.t_N, level.covered, level.gap)


# Outputs that are recorded but not exchanged.

def _range(values: Array) -> tuple[float, float]:
    """Least and largest of numbers (n,), or of the sizes of vectors (n, 2), in their unit; nan where there is none."""
    # Of squares and their root: as exact as of the sizes themselves.
    # fault: extremes of a vector are those of one component -> size = values[:, 0] ** 2 if values.ndim == 2 else values
    #   | coupler/test_extremes
    size = values[:, 0] ** 2 + values[:, 1] ** 2 if values.ndim == 2 else values
    if not size.size:
        return np.nan, np.nan
    least, most = float(size.min()), float(size.max())
    if not (isfinite(least) and isfinite(most)):
        known = size[np.isfinite(size)]
        least, most = (float(known.min()), float(known.max())) if known.size else (np.nan, np.nan)
    return (sqrt(least), sqrt(most)) if values.ndim == 2 else (least, most)


class ExtraOutputs:
    """Every array that a half gives out and the exchange does not hold.

    fields : what they are.  notes : a sentence on each whose place in the mesh cannot be told.
    """

    def __init__(self, halves: Halves, interface: Interface) -> None:
        own: Mapping[str, Half] = {"thermal": halves.thermal, "mechanical": halves.mechanical}
        other = {"thermal": halves.mechanical, "mechanical": halves.thermal}
        self._halves = own
        self.fields: tuple[OutputField, ...] = ()
        self.notes: list[str] = []
        for role, half in own.items():
            taken = {n for n, b in other[role].blocks.items() if b.causality == "input"}
            known = (*OF_THE_EXCHANGE[role], PLACES_OFF, *(n for n in half.blocks if n.startswith((OUTPUT, HALVED))))
            fields = output_fields(role, half.blocks, interface, known, taken)
            self.fields += fields
            self.notes += unclear(role, fields, interface)

    @property
    def frame_names(self) -> dict[str, list[str]]:
        """Role -> the outputs behind `read`."""
        return {role: [f.name for f in self.fields if f.half == role] for role in self._halves}

    def read(self, look: Look) -> dict[str, Array]:
        """Return HALF/LABEL -> the array in the shape and unit of its output; it may be no number in places."""
        told = {role: look.read(role, names) for role, names in self.frame_names.items()}
        return {f"{f.half}/{f.label}": told[f.half][f.name] for f in self.fields}

    @property
    def ranged(self) -> tuple[OutputField, ...]:
        """The fields on nodes and cells whose least and largest value is recorded: numbers and vectors, no tensors.

        What a half tells of its mesh is none: it costs more than a step, and frames have it.
        """
        # fault: what costs more than a step is read in every window -> told = self.fields | coupler/test_trust_fronts
        told = tuple(f for f in self.fields if not f.name.startswith(OF_MESH))
        return tuple(f for f in told if f.on in (On.NODES, On.CELLS) and f.components <= 2)

    @property
    def range_names(self) -> list[str]:
        """HALF.LABEL of each row of `ranges`."""
        return ["thermal.T", "mechanical.u", *(f"{f.half}.{f.label}" for f in self.ranged)]

    @property
    def names(self) -> dict[str, list[str]]:
        """Role -> the outputs behind `ranges`, in their order."""
        return {role: [f.name for f in self.ranged if f.half == role] for role in self._halves}

    def ranges(self, now: Level, interface: Interface, look: Look) -> Array:
        """Return the least and the largest value anywhere of each field, (k, 2) in SI; of a vector of its size.

        Frames are few, and what is largest may lie between two of them.  nan where no value is a number.
        """
        rows = [_range(now.T), _range(now.x - interface.nodes)]
        for role, names in self.names.items():
            read = look.read(role, names)
            rows += [_range(read[name]) for name in names]
        return np.array(rows)


def friction_names(half: Half) -> dict[str, list[str]]:
    """Return what the mechanical half gives out of FRICTION."""
    return {"mechanical": [f"contact.{n}" for n in FRICTION if f"contact.{n}" in half.blocks]}


def friction(half: Half, look: Look) -> dict[str, Array]:
    """Return what the mechanical half tells of FRICTION: t_T [Pa] and slip_share [1] of pair nodes, (n_q,) each."""
    return {n.removeprefix("contact."): v for role, names in friction_names(half).items()
            for n, v in look.read(role, names).items()}


class ConditionReader:
    """Reads the heat and force of conditions from the halves, those that they give out.

    outputs : what they are.  The halves of other packages may lack them.
    """

    def __init__(self, conditions: Mapping[str, ConditionOutput], halves: Mapping[str, Half]) -> None:
        self.outputs = tuple(c for c in conditions.values() if _gives_out(halves[c.half], c))
        self.names = {role: [c.output for c in self.outputs if c.half == role] for role in halves}

    def read(self, look: Look) -> Array:
        """Return (k,) all numbers of all of them, one after the other, in SI."""
        found = {(role, n): v for role, names in self.names.items() for n, v in look.read(role, names).items()}
        return np.concatenate([np.empty(0), *(np.ravel(found[c.half, c.output]) for c in self.outputs)])


def _gives_out(half: Half, condition: ConditionOutput) -> bool:
    block, n = half.blocks.get(condition.output), len(condition.parts)
    return block is not None and block.causality == "output" and block.shape == (() if n == 1 else (n,))


# Probes: of the exchange read from its level, of any other output of a half read from that half.

@dataclass(frozen=True)
class _Source:
    """Where a probe of an output is read.  column : of it, from 0; of an output without a place the value's number."""

    half: str
    block: Block
    on: On
    column: int


class ProbeReader:
    """Reads the probes of a scenario from its halves, which are loaded.

    about : name -> "quantity", "unit", for the header of a run.
    Raises ScenarioError for a probe of an output that its half does not have, or not at that place.
    """

    def __init__(self, probes: Mapping[str, Probe], interface: Interface, halves: Mapping[str, Half],
                 file: Path | str = "") -> None:
        self._probes, self._interface, self._halves, self._file = probes, interface, halves, str(file)
        self._sources = {name: self._source(name, probe) for name, probe in probes.items() if probe.half}
        self._told = {name: told_at(probe.nodes, interface) for name, probe in probes.items()
                      if probe.quantity in AT_CONTACT or name in self._sources}
        self.about = {n: {"quantity": p.quantity,
                          "unit": self._sources[n].block.unit if n in self._sources else p.unit}
                      for n, p in probes.items()}

    @property
    def names(self) -> dict[str, list[str]]:
        """Role -> the outputs behind probes."""
        return {role: list({s.block.name: 0 for s in self._sources.values() if s.half == role})
                for role in self._halves}

    @property
    def mechanical(self) -> NDArray[np.bool_]:
        """(n_probes,) whether the mechanical half makes what a probe shows, in their order."""
        return np.array([p.half == "mechanical" or p.quantity in OF_MECHANICS for p in self._probes.values()],
                        dtype=bool)

    @property
    def of_a_step(self) -> NDArray[np.bool_]:
        """(n_probes,) whether a probe tells what one step moved, in their order."""
        return np.array([bool(p.of_a_step) for p in self._probes.values()], dtype=bool)

    def values(self, level: Level, look: Look | None = None) -> Array:
        """Return the probes (n_probes,) in SI, in their order; the halves are at the time of the level.

        look : at the halves at that time; None: they are asked for probes alone.
        """
        fields: dict[str, Array] = {}
        look = Look(self._halves, self.names) if look is None else look
        blocks = {role: look.read(role, names) for role, names in self.names.items()}
        found = []
        for name, probe in self._probes.items():
            if source := self._sources.get(name):
                values = blocks[source.half][source.block.name]
                found.append(_of_output(probe, source, values, self._interface, self._told[name]))
                continue
            if probe.quantity in AT_CONTACT:
                # fault: a probe at a corner hears of every pair there -> at = np.arange(len(level.t_N)) |
                #   random_scenes/test_shared_nodes
                at = self._told[name]
                found.append(probe.of(contact_field(probe.quantity, level, at, self._interface)))
                continue
            if probe.quantity not in fields:
                fields[probe.quantity] = _field(probe.quantity, self._interface, level)
            found.append(probe.of(fields[probe.quantity]))
        return np.array(found)

    def measurable(self, level: Level, look: Look | None = None) -> Array:
        """Return the probes as `values` does, but nan for a gap where a node faces nothing and for what one step moved.

        There it is told as `gap_max`, and from one answer of a window to the other it may jump by all of that: no error
        of time tells of it.  What a step moved is half as much in half the step.
        """
        out_of_reach = [pair.gap_max for pair in self._interface.pairs]
        gaps = np.array([probe.quantity == "gap" for probe in self._probes.values()], dtype=bool)
        found = self.values(level, look)
        # fault: a node that faces nothing counts as an error of its gap -> return found | coupler/test_trust_errors
        # fault: what half a step moves is an error of the whole -> return np.where(gaps & np.isin(found, out_of_reach),
        #   np.nan, found) | coupler/test_probes_of_a_step
        return np.where(self.of_a_step | (gaps & np.isin(found, out_of_reach)), np.nan, found)

    def named(self, level: Level) -> dict[str, float]:
        """Name -> value."""
        return dict(zip(self._probes, self.values(level).tolist(), strict=True))

    def _source(self, name: str, probe: Probe) -> _Source:
        interface, half, wanted = self._interface, probe.half, probe.output
        blocks = {n: b for n, b in self._halves[half].blocks.items() if b.causality == "output" and b.kind == "Real"}
        places = {n: place_of(b, interface) if b.shape else On.NOTHING for n, b in blocks.items()}
        columns = {n: int(np.prod(b.shape if places[n] is On.NOTHING else b.shape[1:])) for n, b in blocks.items()}
        # fault: a probe of an output that is not there is taken for the first there is -> found = component_of(wanted,
        #   columns) or (next(iter(columns)), 0) | coupler/test_outputs::test_a_probe_of_what_a_half_does_not_have
        found = component_of(wanted, columns)
        # fault: a probe of a condition is refused in words that the scenario does not have -> if False: |
        #   coupler/test_replay
        if found is None and wanted.startswith(OUTPUT):
            raise self._error(name, probe, f"the {half} half does not tell {wanted.removeprefix(OUTPUT)}",
                              "A half that plays a record, or one of another package, need not give out heat and force "
                              "of conditions: leave this probe out, or take it from the run that was recorded.")
        if found is None:
            raise self._error(name, probe, f"the {half} half gives out no {wanted}",
                              did_you_mean(wanted, names_of(columns)))
        source = _Source(half, blocks[found[0]], places[found[0]], found[1])
        for message, remedy in _misplaced(probe, source, interface):
            raise self._error(name, probe, message, remedy)
        return source

    def _error(self, name: str, probe: Probe, message: str, remedy: str) -> ScenarioError:
        return ScenarioError(message, file=self._file, key=f"probes.{name}.{probe.quantity}", remedy=remedy)


def _misplaced(probe: Probe, source: _Source, interface: Interface) -> Iterator[tuple[str, str]]:
    """What is wrong with the place of a probe, and how to mend it; nothing where it fits its output."""
    if (source.on is On.NOTHING) != probe.placeless:
        yield (("this output has a place", "Say which point, surface or body.") if probe.placeless else
               ("this output belongs to no place of the mesh", "Write `value` in the place of a point."))
    elif source.on in (On.CONTACT_NODES, On.PAIR_NODES) and not np.isin(probe.nodes, interface.contact_nodes).all():
        sides = {s for p in interface.pairs for s in (p.slave, p.master)}
        yield "this output exists only on contact surfaces", f"Contact surfaces here: {', '.join(sorted(sides))}."


def _of_output(probe: Probe, source: _Source, values: Array, interface: Interface, own: Indices) -> float:
    """The probe's value, given the array of its output.  own : (n,) the pair nodes that tell of its place."""
    if source.on is On.NOTHING:
        return float(values.ravel()[source.column])
    column = values.reshape(len(values), -1)[:, source.column]
    match source.on:
        case On.CELLS:
            # fault: a probe of a cell field reads nodes -> return probe.of(column) |
            #   coupler/test_outputs::test_probes_are_read_from_any_output
            return probe.of_cells(column)
        case On.BODIES:
            return float(column[interface.node_body[probe.nodes[0]]])
        case On.CONTACT_NODES:
            return probe.of(at_nodes(column, interface.contact_nodes, len(interface.nodes)))
        case On.PAIR_NODES:
            return probe.of(of_pairs(column[own], interface.pair_nodes[own], len(interface.nodes), source.block.unit))
    return probe.of(column)


def _field(quantity: str, interface: Interface, level: Level) -> Array:
    """A quantity of the exchange that every node has : (n_nodes,)."""
    if quantity == "T":
        return level.T
    if quantity == "f_s":
        assert level.f_s is not None, "the scenario was checked for it"
        return level.f_s
    i = ("u_x", "u_y").index(quantity)
    return level.x[:, i] - interface.nodes[:, i]


def contact_field(quantity: str, level: Level, at: Indices, interface: Interface) -> Array:
    """Return gap [m] or p [Pa] at every node : (n_nodes,), told by pair nodes at : (n,); NaN elsewhere.

    Where several of them tell of one node, it has the least gap and the largest pressure.
    """
    found, nodes = np.full(len(interface.nodes), np.nan), interface.pair_nodes[at]
    if quantity == "gap":
        np.fmin.at(found, nodes, level.gap[at])
    else:
        np.fmax.at(found, nodes, -level.t_N[at])
    return found
