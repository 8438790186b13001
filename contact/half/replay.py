"""The half `replay`: plays what another run recorded, so that the half beside it can be worked on alone.

`python -m contact.half.replay DIRECTORY OUT.fmu` builds it, of either role.  It takes what the other half gives out,
as a half must, and does not listen to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from contact.half.build import main as build_main
from contact.half.interface import Interface
from contact.half.model import Discard, Done, Link, Value, Values, Variable
from contact.half.recording import ENERGIES, OUTPUTS, Recording, recording_in

# What a half of either role must take, whatever it does with it.
TAKES = {"thermal": "x", "mechanical": "T"}
ON = {"T": "nodes", "f_s": "nodes", "x": "nodes", "E_M": "cells", "E_S": "cells"}


@dataclass(frozen=True)
class ReplayState:
    """t [s]: all else follows from it."""

    t: float


class ReplayHalf:
    """HalfModel of what was recorded, on straight lines between the rows of the recording."""

    def __init__(self, interface: Interface, role: str) -> None:
        """Raises ValueError where interface.h5 has no recording.  role : thermal or mechanical."""
        self._recording: Recording = recording_in(interface, role)
        n = len(interface.nodes)
        takes = (Variable("x", (n, 2), "input", "m", interface.nodes, on="nodes") if TAKES[role] == "x" else
                 Variable("T", (n,), "input", "K", 293.15, on="nodes"))
        given = tuple(
            Variable(name, values.shape[1:], unit=OUTPUTS[role][name], start=values[0],
                     on=ON.get(name, "pair_nodes"), description="as it was recorded")
            for name, values in self._recording.outputs.items() if values.shape[1:] != (0,))
        at_end = (Variable("contact.E_friction.at", kind="String", start="end", variability="constant"),)
        self._names = tuple(v.name for v in given)
        self.variables = (takes, *given, *(at_end if "contact.E_friction" in self._names else ()))

    def start(self, inputs: Values, t: float, link: Link) -> tuple[ReplayState, Mapping[str, Value]]:
        """Return what was recorded at t; of energies nothing, for no time has passed."""
        return ReplayState(t), self._outputs(t, t)

    def step(self, state: ReplayState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Return what was recorded at t + h, and the energies in between."""
        return Done(ReplayState(t + h), self._outputs(t, t + h))

    def _outputs(self, t0: float, t1: float) -> dict[str, Value]:
        told = self._recording
        return {n: told.energy(n, t0, t1) if n in ENERGIES else told.at(n, t1) for n in self._names}


def load_thermal(interface: Interface, model: Mapping[str, Any]) -> ReplayHalf:
    """Make the thermal half of an interface file with a recording.  Raises ValueError where it has none."""
    return ReplayHalf(interface, "thermal")


def load_mechanical(interface: Interface, model: Mapping[str, Any]) -> ReplayHalf:
    """Make the mechanical half of an interface file with a recording.  Raises ValueError where it has none."""
    return ReplayHalf(interface, "mechanical")


LOADS = {"thermal_replay": "contact.half.replay:load_thermal",
         "mechanical_replay": "contact.half.replay:load_mechanical"}
"""`half` of model.json -> the function that loads it."""


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("contact", LOADS)


if __name__ == "__main__":
    main()
