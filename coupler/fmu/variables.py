"""Variables of an FMU as blocks: scalars `T[1]`, `T[2]`, ... are gathered, an array of FMI 3.0 is one already."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Block
from coupler.fmu.units import SI, Conversion

_INDEXED = re.compile(r"^(.+)\[(\d+(?:,\d+)*)\]$")


@dataclass(frozen=True)
class VariableBlock:
    """A block and where it lies.

    block : in the SI unit of its name, if it has one (coupler.fmu.names).  references : value references, last index
    fastest: (size,) one a value, or (1,) that of an array of FMI 3.0.  start : as written in the XML, of a scalar only.
    variability : as in the XML, the standard's default where it is left out.  declared : the unit in the XML.
    conversion : of numbers in it.  type : as the XML has it, Real or Float64, Integer or Int32, ...; by it values are
    got and set.
    """

    block: Block
    references: NDArray[np.uint32]
    start: str | None
    variability: str
    declared: str = "1"
    conversion: Conversion = SI
    type: str = ""

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.block.shape)


@dataclass(frozen=True)
class Scalar:
    """A variable of one value, as the XML has it.  kind : of its block.  type : "" where that is the kind."""

    name: str
    reference: int
    causality: str
    variability: str
    kind: str
    unit: str
    start: str | None
    description: str = ""
    type: str = ""


def stated(node: ElementTree.Element, name: str) -> str:
    """Return an attribute that an element must have.  Raises ValueError where it has not."""
    text = node.get(name)
    if not text:
        raise ValueError(f"a {node.tag} {node.get('name', '')!r} has no {name}")
    return text


def reference_of(node: ElementTree.Element) -> int:
    """Return the value reference of an element.  Raises ValueError where it is none."""
    text = stated(node, "valueReference")
    # fault: a reference that is no number ends in a traceback -> if False: | coupler/test_description
    if not (text.isascii() and text.isdigit() and len(text) <= 10 and int(text) < 1 << 32):
        raise ValueError(f"the valueReference of {node.get('name', '')!r} is {text[:20]!r}, no number of 32 bits")
    return int(text)


@dataclass(frozen=True)
class _Element:
    """A scalar of a block.  index : from 1, () of a scalar alone."""

    index: tuple[int, ...]
    scalar: Scalar


def gather(scalars: Sequence[Scalar], places: Mapping[str, str] = MappingProxyType({})) -> dict[str, VariableBlock]:
    """Scalars a[1], a[2], ... to one block "a"; what does not fill a whole box of 1-based indices stays scalar.

    places : block -> what its rows belong to.
    """
    groups: dict[str, list[_Element]] = {}
    for scalar in scalars:
        match = _INDEXED.match(scalar.name)
        name, index = (match[1], tuple(map(int, match[2].split(",")))) if match else (scalar.name, ())
        groups.setdefault(name, []).append(_Element(index, scalar))
    fields: dict[str, VariableBlock] = {}
    for name, members in groups.items():
        field = _block(name, members, places.get(name, ""))
        if field is not None:
            fields[name] = field
        else:
            fields.update({m.scalar.name: _field(m.scalar.name, (), [m.scalar]) for m in members})
    return fields


def _block(name: str, members: list[_Element], on: str) -> VariableBlock | None:
    indices, scalars = [m.index for m in members], [m.scalar for m in members]
    alike = {(s.kind, s.type, s.causality, s.unit) for s in scalars}
    if len({len(index) for index in indices}) > 1 or len(alike) > 1:
        return None
    shape = tuple(max(column) for column in zip(*indices, strict=True))
    whole = len(set(indices)) == len(members) == math.prod(shape)
    if not whole or any(min(index, default=1) < 1 for index in indices):
        return None
    return _field(name, shape, [m.scalar for m in sorted(members, key=lambda m: m.index)], on)


def _field(name: str, shape: tuple[int, ...], scalars: list[Scalar], on: str = "") -> VariableBlock:
    first = scalars[0]
    return VariableBlock(Block(name, shape, first.unit, first.causality, first.kind, first.description, on),
                         np.array([s.reference for s in scalars], dtype=np.uint32),
                         None if shape else first.start, first.variability, first.unit, type=first.type or first.kind)
