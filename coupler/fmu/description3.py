"""The variables of a modelDescription.xml of FMI 3.0: an array is a block as it stands, its values row by row.

Sizes are those of the description: a structural parameter has the value it starts with, and is not changed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree

import numpy as np

from coupler.fmu.half import Block
from coupler.fmu.units import unit_of
from coupler.fmu.variables import Scalar, VariableBlock, gather, reference_of, stated

# Type in the XML -> kind of a block.  Types of other kinds than those of FMI 2.0 are kept by name: no value is one.
KINDS: Mapping[str, str] = {
    "Float64": "Real", "Float32": "Float32", "Boolean": "Boolean", "String": "String", "Enumeration": "Enumeration",
    "Binary": "Binary", "Clock": "Clock",
    **{f"{sign}Int{bits}": "Integer" for sign in ("", "U") for bits in (8, 16, 32, 64)}}
MAX_VALUES = 1 << 27  # of one array: 1 GiB of numbers; no mesh is near it, a damaged or hostile description may be
_UNLIKELY = 19  # digits of a whole number; longer ones need not be read


def fields_of(root: ElementTree.Element, types: Mapping[str, str], places: Mapping[str, str]
              ) -> dict[str, VariableBlock]:
    """Return the blocks of a description, by name, in its order; an alias is a block of its own, of the same values.

    types : units of the types, by name.  places : block -> what its rows belong to.
    Raises ValueError, for the first variable that is none.
    """
    references = _by_reference(root)
    arrays: dict[str, VariableBlock] = {}
    scalars: list[Scalar] = []
    known: set[str] = set()
    for node in references.values():
        shape = _shape(node, references)
        for name, description in _names(node):
            if name in known:
                raise ValueError(f"two variables are named {name!r}")
            known.add(name)
            scalar = _scalar(node, name, description, types)
            if not shape:
                scalars.append(scalar)
                continue
            block = Block(name, shape, scalar.unit, scalar.causality, scalar.kind, scalar.description,
                          places.get(name, ""))
            arrays[name] = VariableBlock(block, np.array([scalar.reference], dtype=np.uint32), None,
                                         scalar.variability, scalar.unit, type=node.tag)
    gathered = gather(scalars, places)
    twice = sorted(gathered.keys() & arrays.keys())
    if twice:
        raise ValueError(f"{twice[0]} is an array, and there are scalars {twice[0]}[...] too")
    return arrays | gathered


def shapes_of(root: ElementTree.Element) -> dict[str, tuple[int, ...]]:
    """Return the shape of every array of a description, by name.  Raises ValueError for a variable that is none."""
    references = _by_reference(root)
    shapes = {stated(node, "name"): _shape(node, references) for node in references.values()}
    return {name: shape for name, shape in shapes.items() if shape}


def _by_reference(root: ElementTree.Element) -> dict[int, ElementTree.Element]:
    """The variables by value reference, in their order."""
    references: dict[int, ElementTree.Element] = {}
    for node in root.iterfind("ModelVariables/*"):
        if node.tag not in KINDS:
            raise ValueError(f"a variable of type {node.tag}, which FMI 3.0 has not")
        at = reference_of(node)
        # fault: of two variables with one reference both are taken -> if False: | coupler/test_description3
        if at in references:
            raise ValueError(f"variables {stated(references[at], 'name')!r} and {stated(node, 'name')!r} have the same "
                             f"valueReference {at}")
        references[at] = node
    return references


def _names(node: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Name and description of a variable, and of each of its aliases."""
    for one in (node, *node.iterfind("Alias")):
        yield stated(one, "name"), one.get("description", "")


def _scalar(node: ElementTree.Element, name: str, description: str, types: Mapping[str, str]) -> Scalar:
    default = "continuous" if node.tag in ("Float64", "Float32") else "discrete"
    text = node.find("Start")
    start = text.get("value") if text is not None else node.get("start")
    return Scalar(name, reference_of(node), node.get("causality", "local"), node.get("variability", default),
                  KINDS[node.tag], unit_of(node, types) or "1", start, description, node.tag)


def _shape(node: ElementTree.Element, references: Mapping[int, ElementTree.Element]) -> tuple[int, ...]:
    name = stated(node, "name")
    shape = tuple(_size(name, dimension, references) for dimension in node.iterfind("Dimension"))
    # fault: an array of any size is made room for -> if False: | coupler/test_description3
    if math.prod(shape) > MAX_VALUES:
        raise ValueError(f"{name} has {' x '.join(map(str, shape))} values, more than {MAX_VALUES}: no half is so "
                         "large")
    return shape


def _size(name: str, dimension: ElementTree.Element, references: Mapping[int, ElementTree.Element]) -> int:
    start, reference = dimension.get("start"), dimension.get("valueReference")
    if (start is None) == (reference is None):
        raise ValueError(f"a Dimension of {name} must have either a start or a valueReference")
    if start is not None:
        return _count(start, f"a Dimension of {name}")
    of = references.get(reference_of(dimension))
    sized = of is not None and of.tag == "UInt64" and of.find("Dimension") is None and (
        of.get("causality") == "structuralParameter" or of.get("variability") == "constant")
    # fault: a size is taken from any variable -> if of is None: | coupler/test_description3
    if of is None or not sized:
        raise ValueError(f"a Dimension of {name} refers to valueReference {reference}, which is no structural "
                         "parameter (or constant) of type UInt64")
    return _count(of.get("start", ""), f"{stated(of, 'name')}, a size of {name},")


def _count(text: str, of: str) -> int:
    digits = text.strip()
    # fault: sizes below 1 are taken -> if not digits.lstrip("-").isdigit(): | coupler/test_description3
    if not (digits.isascii() and digits.isdigit()) or not digits.strip("0"):
        raise ValueError(f"{of} is {text[:_UNLIKELY + 1]!r}: a size is a whole number of 1 or more")
    if len(digits) > _UNLIKELY:
        raise ValueError(f"{of} has {len(digits)} digits: no half is so large")
    return int(digits)
