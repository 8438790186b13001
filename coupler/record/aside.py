"""What the halves tell for the record alone, beside the exchange: fields for pictures, what friction does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Half
from coupler.record.strips import FRICTION
from coupler.schemes.window import Halves

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
