"""Heat through each boundary condition, each body's source and either side of each contact pair, since the start.

Every step gives the heat of all of them in one order: prescribed temperatures, then what boundary_flow tells: fluxes,
films, radiating surfaces, sources by part (the bodies, then regions), and of each pair the slave's and the master's
side.

A node that two prescribed temperatures share belongs to the later one, whose value it has; its heat is all of that
one's, less what fluxes, films and sources bring there, which are counted as theirs.  So the sum over all of them is the
heat that the bodies stored, less the mechanical heat.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Value, Variable
from thermal_fmu.problem import Model

Floats = NDArray[np.float64]

PREFIX = "condition.heat."
"""Of the outputs.  Names of conditions have no dots, so none of them can be that of a mechanism, `heat.flux`, of a
pair, `condition.heat.pair.NAME`, or of a source, `condition.heat.source.BODY`."""


@dataclass(frozen=True)
class NamedHeat:
    """An output.  rows : of each of its numbers (one, or the two sides of a pair) which heats it adds up."""

    name: str
    rows: tuple[tuple[int, ...], ...]
    description: str

    @property
    def variable(self) -> Variable:
        """The variable of the half."""
        shape = () if len(self.rows) == 1 else (len(self.rows),)
        return Variable(PREFIX + self.name, shape, unit="J", description=self.description, on="none" if shape else "")


def named_heats(interface: Interface, model: Model) -> tuple[NamedHeat, ...]:
    """List the outputs of a scene: its named conditions, sources and pairs."""
    return tuple(_named(interface, model))


def _named(interface: Interface, model: Model) -> Iterator[NamedHeat]:
    kinds: tuple[tuple[str, Sequence[str]], ...] = (
        ("prescribed temperature", [b.name for b in model.prescribed]), ("flux", [b.name for b in model.fluxes]),
        ("film", [b.name for b in model.films]), ("radiation", [b.name for b in model.radiators]))
    row = 0
    for kind, names in kinds:
        for name in names:
            if name:
                yield NamedHeat(name, ((row,),), f"heat given to the body through the {kind} since the start")
            row += 1
    for k, body in enumerate(model.bodies):
        own = tuple(i for i, part in enumerate(model.parts) if interface.part_body[i] == k and not part.Q_T.is_zero)
        if own:
            yield NamedHeat(f"source.{body.name}", (tuple(row + i for i in own),),
                            "heat made by the sources of the body since the start")
    row += len(model.parts)
    for pair in interface.pairs:
        yield NamedHeat(f"pair.{pair.name}", ((row,), (row + 1,)), "heat given to slave and master since the start")
        row += 2


def n_heats(interface: Interface, model: Model) -> int:
    """Count the heats of a step."""
    conditions = (model.prescribed, model.fluxes, model.films, model.radiators)
    return sum(len(c) for c in conditions) + len(model.parts) + 2 * len(interface.pairs)


@dataclass(frozen=True)
class HeatSoFar:
    """total : (n,) [J] since the start, (0,) before anything was counted.

    lost : as many, its low-order bits, so that long runs add up exactly (Neumaier).
    """

    total: Floats
    lost: Floats

    def plus(self, heat: Floats) -> HeatSoFar:
        """Add the heat : (n,) [J] of a step."""
        if not self.total.size:
            return HeatSoFar(np.array(heat), np.zeros(heat.size))
        new = self.total + heat
        larger = np.abs(self.total) >= np.abs(heat)
        # fault: heat of a condition forgets its last bits -> lost = self.lost | thermal_fmu/test_named_heat
        lost = self.lost + np.where(larger, (self.total - new) + heat, (heat - new) + self.total)
        return HeatSoFar(new, lost)

    def outputs(self, named: Sequence[NamedHeat]) -> dict[str, Value]:
        """Return the outputs by name."""
        heat = self.total + self.lost
        found = {one.name: np.array([heat[list(rows)].sum() for rows in one.rows]) for one in named}
        return {PREFIX + name: float(of[0]) if of.size == 1 else of for name, of in found.items()}


NOTHING_COUNTED = HeatSoFar(np.zeros(0), np.zeros(0))


def no_heat_yet(n: int) -> HeatSoFar:
    """Return the heat at the start."""
    return HeatSoFar(np.zeros(n), np.zeros(n))


def owners(fixed: NDArray[np.bool_], nodes: Sequence[NDArray[np.int32]]) -> NDArray[np.int32]:
    """Return (n_fixed,) which prescribed temperature each fixed node belongs to, their number where to none.

    fixed : (n,).  nodes : of each prescribed temperature; the later one has a node of two, as it has its value.
    """
    owner = np.full(fixed.size, len(nodes), dtype=np.int32)
    for i, of in enumerate(nodes):
        # fault: a node of two prescribed temperatures is the first one's -> owner[of[owner[of] == len(nodes)]] = i |
        #   thermal_fmu/test_named_heat
        owner[of] = i
    return owner[fixed]
