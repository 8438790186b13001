"""A scenario's physics in SI, on its mesh: what the problems of its halves are made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contact.half.interface import Interface
from contact.half.start import start_temperature
from contact.problem.start import AtNodes
from coupler.scenario.bodies import FromRun, MeshedBody
from coupler.scenario.document import Key
from coupler.scenario.schema import ScenarioFile

ROOM = 293.15  # K, where a material that does not expand says no T_ref
NEAREST = ".nearest"  # the node set that stands for a named point where no node lies


@dataclass(frozen=True)
class Stated:
    """A scenario's physics in SI.  file : the checked file, its materials, bodies, contact and halves in SI."""

    file: ScenarioFile
    interface: Interface
    unit: str
    offset: float
    file_folder: Path

    @property
    def pairs(self) -> dict[str, Any]:
        """The pairs whose surfaces exist."""
        there = {pair.name for pair in self.interface.pairs}
        return {name: pair for name, pair in self.file.contact.items() if name in there}

    @property
    def used(self) -> tuple[str, ...]:
        """Materials in use, each once."""
        parts = [part for body in self.file.bodies.values() for part in body.parts.values()]
        return tuple(dict.fromkeys(part.material for part in parts if part.material in self.file.materials))

    @property
    def parts(self) -> Iterator[tuple[str, Key, MeshedBody]]:
        """Every part that has cells: its name (Interface.parts), where it stands in the file, what it is, in full."""
        for name, body in self.file.bodies.items():
            for region, part in body.parts.items():
                whole = f"{name}.{region}" if region else name
                key: Key = ("bodies", name, "regions", region) if region else ("bodies", name)
                if len(self.interface.part_nodes(self.interface.parts.index(whole))):
                    yield whole, key, part

    def start_range(self, name: str, T0: Any) -> tuple[float, float]:
        """The lowest and the highest temperature [K] a part has at its nodes at the start."""
        T0 = stated_start(T0)
        if isinstance(T0, float):
            return T0, T0
        T = start_temperature(T0, self.interface, self.interface.part_nodes(self.interface.parts.index(name)))
        return (float(T.min()), float(T.max())) if T.size else (ROOM, ROOM)


def stated_start(T0: Any) -> Any:
    """T0 as a model.json has it: a number [K], a sum, or where interface.h5 has what another run left."""
    return AtNodes(dataset="start/T") if isinstance(T0, FromRun) else T0
