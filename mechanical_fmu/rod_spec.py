"""model.json of the half `mechanical_rod`, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from contact.half.checks import keys, known, made, number, signal
from contact.half.columns import SAME, Columns
from contact.half.interface import Interface
from contact.half.property import Property, positive_property, property_from
from contact.half.signal import Signal


@dataclass(frozen=True)
class RodMaterial:
    """alpha : mean expansion from T_ref [1/K].  E : [Pa], None: it does not give way.

    shrinkage : linear strain of solidification, 0 where it does not melt.  melts : whether it was poured, so that its
    mesh has the shape of the start, not of T_ref.
    """

    alpha: Property
    T_ref: float
    E: Property | None
    shrinkage: float
    melts: bool


@dataclass(frozen=True)
class RodBody:
    """left, right : displacement of a held end [m], None where it is free."""

    name: str
    material: RodMaterial
    left: Signal | None
    right: Signal | None


@dataclass(frozen=True)
class Meeting:
    """A contact pair: the right end of one body faces the left end of another."""

    left: int
    right: int


@dataclass(frozen=True)
class RodSpec:
    """bodies, pairs : in the order of the interface."""

    bodies: tuple[RodBody, ...]
    pairs: tuple[Meeting, ...]


def parse_rod(interface: Interface, columns: Columns, spec: Mapping[str, Any]) -> RodSpec:
    """The model a model.json describes.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, "", {"half", "format", "materials", "bodies"}, {"pairs"})
    if spec["half"] != "mechanical_rod" or spec["format"] != 1:
        raise ValueError(f"model.json: half {spec['half']!r}, format {spec['format']!r} is not mechanical_rod, 1")
    if interface.axisymmetric:
        raise ValueError("the half 'mechanical_rod' is straight: an axisymmetric scene would stretch around its axis")
    materials = {name: _material(m, f"materials.{name}") for name, m in spec["materials"].items()}
    bodies = keys(spec["bodies"], "bodies", set(interface.bodies))
    keys(spec.get("pairs", {}), "pairs", set(), [p.name for p in interface.pairs])
    parsed = tuple(_body(name, bodies[name], materials) for name in interface.bodies)
    return RodSpec(parsed, _meetings(interface, columns, parsed))


def _material(spec: Any, where: str) -> RodMaterial:
    keys(spec, where, {"alpha"}, {"T_ref", "E", "shrinkage"})
    alpha = made(property_from, spec["alpha"], f"{where}.alpha")
    if "T_ref" not in spec and not (alpha.is_constant and alpha.constant == 0.0):
        raise ValueError(f"model.json: {where}: it expands, but has no T_ref")
    E = None if spec.get("E") is None else made(lambda v: positive_property(v, "E"), spec["E"], f"{where}.E")
    return RodMaterial(alpha, number(spec.get("T_ref", 0.0), f"{where}.T_ref"), E,
                       number(spec.get("shrinkage", 0.0), f"{where}.shrinkage"), "shrinkage" in spec)


def _body(name: str, spec: Any, materials: Mapping[str, RodMaterial]) -> RodBody:
    where = f"bodies.{name}"
    keys(spec, where, {"material"}, {"left", "right"})
    left, right = (None if spec.get(end) is None else signal(spec[end], f"{where}.{end}") for end in ("left", "right"))
    if left is None and right is None:
        raise ValueError(f"model.json: {where}: nothing holds it; state the displacement of its left or right end")
    return RodBody(name, materials[known(spec["material"], f"{where}.material", materials)], left, right)


def _meetings(interface: Interface, columns: Columns, bodies: tuple[RodBody, ...]) -> tuple[Meeting, ...]:
    """Who ends where whom begins.  Raises ValueError where a pair is not of two ends, or an end meets twice."""
    found: list[Meeting] = []
    for pair in interface.pairs:
        ends = dict(_end(interface, columns, surface, pair.name) for surface in (pair.slave, pair.master))
        if set(ends) != {"left", "right"}:
            raise ValueError(f"contact {pair.name!r}: the right end of one rod must face the left end of another")
        meeting = Meeting(ends["right"], ends["left"])
        if any(m.left == meeting.left or m.right == meeting.right for m in found):
            raise ValueError(f"contact {pair.name!r}: an end of a rod may meet one other only")
        a, b = bodies[meeting.left], bodies[meeting.right]
        low, high = (columns.heights(interface.nodes)[c] for c in
                     (columns.first[meeting.left + 1] - 1, columns.first[meeting.right]))
        if abs(low - high) > SAME * low:
            raise ValueError(f"contact {pair.name!r}: rods that press need equal heights, not {low:g} and {high:g} m")
        if (a.right is not None or a.material.E is None) and (b.left is not None or b.material.E is None):
            raise ValueError(f"contact {pair.name!r}: nothing could give way; give the material of {a.name!r} or "
                             f"{b.name!r} an E, and leave that end free")
        found.append(meeting)
    return tuple(found)


def _end(interface: Interface, columns: Columns, surface: str, pair: str) -> tuple[str, int]:
    at = np.unique(columns.of_node[interface.surfaces[surface]])
    body = int(interface.node_body[interface.surfaces[surface][0, 0]])
    for end, column in (("left", columns.first[body]), ("right", columns.first[body + 1] - 1)):
        if at.size == 1 and at[0] == column:
            return end, body
    raise ValueError(f"contact {pair!r}: {surface!r} is not the left or right end of a rod")
