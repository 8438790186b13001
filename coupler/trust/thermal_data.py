"""What the boundary conditions of a thermal half state: each flux, temperature, film and radiation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class StatedData:
    """What one condition states of one kind.

    kind : flux, temperature, convection or radiation.  given : what stands there in model.json.  on : a surface, ""
    for a condition that is not on one.  name : of the condition, "" for none.
    """

    kind: str
    given: Any
    on: str
    name: str


def stated_data(model: Mapping[str, Any]) -> Iterator[StatedData]:
    """Everything of a model.json of a thermal half, condition by condition."""
    for condition in model.get("boundary", ()):
        for kind in ("flux", "temperature", "convection", "radiation"):
            if condition.get(kind) is not None:
                yield StatedData(kind, condition[kind], condition.get("on") or "", condition.get("name") or "")
