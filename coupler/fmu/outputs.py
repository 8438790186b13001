"""Which outputs of a half are fields of the scene, as its modelDescription says: name, shape, unit, place."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.half import Block


class On(Enum):
    """What the rows of an array belong to (contact.half.model.PLACES), all in the order of interface.h5."""

    NODES = "nodes"
    CELLS = "cells"
    CONTACT_NODES = "contact_nodes"
    PAIR_NODES = "pair_nodes"
    BODIES = "bodies"
    NOTHING = "none"  # an array of the half's own, such as a force or the motion of a body


@dataclass(frozen=True)
class OutputField:
    """An array that a half gives out.

    half : "thermal" | "mechanical".  label : its name in files; not always `name`, which the coupler may use itself.
    shape : of the whole array.  unit : SI.  own : the half itself says it belongs to nothing.  exchanged : the other
    half takes it.
    """

    half: str
    name: str
    label: str
    on: On
    shape: tuple[int, ...]
    unit: str
    description: str = ""
    own: bool = False
    exchanged: bool = False

    @property
    def components(self) -> int:
        """Numbers a row."""
        return math.prod(self.shape[1:])

    @property
    def full_name(self) -> str:
        """HALF.NAME, as probes and rules name it."""
        return f"{self.half}.{self.name}"

    def to_json(self) -> dict[str, Any]:
        """Plain values that travel as JSON."""
        return {**vars(self), "on": self.on.value, "shape": list(self.shape)}


def output_field(about: Mapping[str, Any]) -> OutputField:
    """The field behind such values."""
    return OutputField(**{**about, "on": On(about["on"]), "shape": tuple(about["shape"])})


# Names under which the coupler records the exchange: of a half's own output so named HALF.NAME is the label.
RESERVED = frozenset(("T", "u", "p", "gap", "body"))
# Of what names at the border are that begin so (docs/design.md, the FMI face of a half).
BEGINNINGS: Mapping[str, On] = {"contact.": On.PAIR_NODES, "surface.": On.CONTACT_NODES}


def output_fields(half: str, blocks: Mapping[str, Block], interface: Interface, recorded: Collection[str],
                  taken: Collection[str]) -> tuple[OutputField, ...]:
    """Every array of reals that a half gives out, but for those in `recorded`, which the coupler knows itself.

    taken : blocks that the other half takes.
    """
    arrays = (b for b in blocks.values()
              if b.causality == "output" and b.kind == "Real" and b.shape and b.name not in recorded)
    return tuple(OutputField(half, b.name, _label(half, b.name), place_of(b, interface), b.shape, b.unit,
                             b.description, b.on == On.NOTHING.value, b.name in taken) for b in arrays)


def unclear(half: str, fields: Collection[OutputField], interface: Interface) -> Iterator[str]:
    """A sentence on every array that is recorded without a place, though its rows are as many as those of a mesh."""
    for field in fields:
        fits = [on.value for on, n in _sizes(interface).items() if n == field.shape[0]]
        if field.on is On.NOTHING and not field.own and len(fits) > 1:
            yield (f"{half}.{field.name} has {field.shape[0]} rows, as many as there are "
                   f"{' and '.join(n.replace('_', ' ') for n in fits)}: it is recorded, but in no picture; say in its "
                   "modelDescription.xml what it is on (docs/write_a_half.md)")


def place_of(block: Block, interface: Interface) -> On:
    """What the rows of an array belong to: what the half says, if that many are there; else what their number says.

    Where two places have that number and the half does not say, a name of contact decides, else none is taken.
    """
    sizes, n = _sizes(interface), block.shape[0]
    if block.on:
        on = On(block.on)
        there = len(interface.bodies) if on is On.BODIES else sizes.get(on)
        return on if there == n else On.NOTHING
    # Bodies are few, and so are the components of a force: only the half itself can tell these two apart.
    fits = [on for on, size in sizes.items() if size == n]
    if On.CONTACT_NODES in fits and not block.name.startswith("contact."):
        fits = [on for on in fits if on is not On.PAIR_NODES]
    # fault: where nodes and cells are as many an array is taken to be on nodes -> if fits: |
    #   coupler/test_outputs::test_as_many_nodes_as_cells_are_not_confused
    if len(fits) == 1:
        return fits[0]
    return next((on for name, on in BEGINNINGS.items() if block.name.startswith(name) and on in fits), On.NOTHING)


def _sizes(interface: Interface) -> dict[On, int]:
    sizes = {On.NODES: len(interface.nodes), On.CELLS: len(interface.quads) + len(interface.triangles),
             On.CONTACT_NODES: len(interface.contact_nodes), On.PAIR_NODES: len(interface.pair_nodes)}
    return {on: n for on, n in sizes.items() if n}


def _label(half: str, name: str) -> str:
    label = name.replace("/", "_")  # a slash makes a folder of it in HDF5
    return f"{half}.{label}" if label in RESERVED else label


def at_nodes(values: NDArray[np.float64], contact_nodes: NDArray[np.integer], n_nodes: int) -> NDArray[np.float64]:
    """Return values of contact nodes at all nodes : (n_nodes, ...), NaN at all others, in their unit.

    values : (n_s, ...), in any unit.  contact_nodes : (n_s,) node numbers.  n_nodes : nodes of the mesh.
    """
    found = np.full((n_nodes, *values.shape[1:]), np.nan)
    found[contact_nodes] = values
    return found


EXTENSIVE = ("J", "N")  # units of what adds up where pairs share a node


def of_pairs(values: NDArray[np.float64], pair_nodes: NDArray[np.integer], n_nodes: int,
             unit: str) -> NDArray[np.float64]:
    """Return values of pair nodes at all nodes : (n_nodes, ...), NaN at those of no pair, in their unit.

    values : (n_q, ...) in `unit`.  pair_nodes : (n_q,) node numbers.  n_nodes : nodes of the mesh.  Where several pairs
    share a node, energies and forces add up; of anything else the value of largest size is taken.
    """
    found = np.full((n_nodes, *values.shape[1:]), np.nan)
    if unit in EXTENSIVE:
        found[pair_nodes] = 0.0
        np.add.at(found, pair_nodes, values)
        return found
    size = np.linalg.norm(values.reshape(len(values), -1), axis=1)
    order = np.argsort(np.nan_to_num(size, nan=-1.0), kind="stable")
    # fault: where pairs share a node its value is that of the last pair -> order = np.arange(len(values)) |
    #   coupler/test_pair_outputs
    found[pair_nodes[order]] = values[order]
    return found


def told_at(nodes: NDArray[np.integer], interface: Interface) -> NDArray[np.intp]:
    """Return the pair nodes (n,) that tell of a place: those of the surfaces that have all of its nodes : (m,).

    All of them where no surface has.  So at a corner a surface is told by its own pairs.
    """
    sides = [side for side in interface.pair_sides if np.isin(nodes, side.nodes).all()] or interface.pair_sides
    return np.concatenate([np.empty(0, np.intp), *(np.arange(side.at.start, side.at.stop) for side in sides)])


# Components of a field, by the number of its columns: of a vector and of a tensor of the plane.
COMPONENTS: Mapping[int, tuple[str, ...]] = {2: ("x", "y"), 3: ("x", "y", "z"), 4: ("xx", "yy", "xy", "zz")}
_INDEXED = re.compile(r"(.+)\[(\d+)\]")


def component_of(name: str, fields: Mapping[str, int]) -> tuple[str, int] | None:
    """Field and column (from 0) that NAME, NAME.xx or NAME[k] means; None where there is none.

    fields : name -> number of columns.  NAME alone is a field of one column; k counts from 1, as in FMI.
    """
    if fields.get(name) == 1:
        return name, 0
    if (found := _INDEXED.fullmatch(name)) and found[1] in fields and 1 <= int(found[2]) <= fields[found[1]]:
        return found[1], int(found[2]) - 1
    field, _, letters = name.rpartition(".")
    known = COMPONENTS.get(fields.get(field, 0), ())
    return (field, known.index(letters)) if letters in known else None


def names_of(fields: Mapping[str, int]) -> list[str]:
    """All that component_of understands, the shortest form of each."""
    found: list[str] = []
    for name, n in fields.items():
        if n == 1:
            found.append(name)
        else:
            found += [f"{name}.{c}" for c in COMPONENTS[n]] if n in COMPONENTS else [
                f"{name}[{k + 1}]" for k in range(n)]
    return found
