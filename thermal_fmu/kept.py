"""What need not be worked out again: shapes of cells that did not move, matrices of bodies whose data are constant.

Kept values are those that would be worked out, to the bit, so nothing here is part of the state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.phase import Fields
from thermal_fmu.spec import Body
from thermal_fmu.volume import Block, Entries, Reference, Shape, Volume, conduct, shape_of, store, turned

Floats = NDArray[np.float64]


class KeptShapes:
    """The shapes of the coordinates last asked for, block by block."""

    def __init__(self) -> None:
        self._x: Floats | None = None
        self._references: tuple[Reference, ...] = ()
        self._shapes: tuple[Shape, ...] = ()

    def of(self, volume: Volume, references: tuple[Reference, ...], x: Floats) -> tuple[Shape, ...]:
        """Every block on x : (n, 2) [m], with the turn of its axes.  Raises InvertedCellError."""
        before, known = self._x, self._references is references
        shapes = []
        for b, (block, first) in enumerate(zip(volume.blocks, references, strict=True)):
            # fault: shapes kept though the cells moved -> if known and before is not None and before.shape == x.shape:
            #   | thermal_fmu/test_thermal_kept
            if known and before is not None and np.array_equal(before[block.nodes], x[block.nodes]):
                shapes.append(self._shapes[b])
            else:
                shapes.append(turned(block, first, shape_of(volume, block, x), x))
        self._x, self._references, self._shapes = np.array(x), references, tuple(shapes)
        return self._shapes


@dataclass(frozen=True)
class _Asked:
    """What the entries of a block follow from.  entries : (n_places,), once they were asked for twice."""

    first: Reference
    shape: Shape
    slope: float
    stores: bool
    entries: Floats | None = None

    def is_for(self, first: Reference, shape: Shape, slope: float, stores: bool) -> bool:
        # fault: matrix kept though the step's length changed -> return self.first is first and self.shape is shape and
        #   self.stores == stores | thermal_fmu/test_thermal_kept
        return self.first is first and self.shape is shape and (self.slope, self.stores) == (slope, stores)


class KeptMatrix:
    """M + slope K of blocks whose c and k are constant, for the shapes and the slope last asked for."""

    def __init__(self) -> None:
        self._of: dict[int, _Asked] = {}

    def fill(self, volume: Volume, bodies: Sequence[Body], on: Sequence[tuple[Reference, Shape]], into: Entries,
             stores: bool) -> Entries:
        """Put in the entries of blocks that were asked for before, and say which.

        A block that moves in every step is left to the caller: to keep its entries would cost and never pay.
        on : reference and shape of every block.  stores : whether M is in it.
        """
        filled = []
        for b, block in enumerate(volume.blocks):
            if not (block.alone and _is_constant(bodies[block.body])):
                continue
            kept = self._of.get(b)
            if kept is None or not kept.is_for(*on[b], into.slope, stores):
                self._of[b] = _Asked(*on[b], into.slope, stores)
                continue
            if kept.entries is None:
                kept = replace(kept, entries=_entries(volume, block, bodies, on[b], into.slope, stores))
                self._of[b] = kept
            into.data[block.places] = kept.entries
            filled.append(b)
        return replace(into, filled=frozenset(filled))


def _entries(volume: Volume, block: Block, bodies: Sequence[Body], on: tuple[Reference, Shape], slope: float,
             stores: bool) -> Floats:
    """(n_places,) entries of one block.  T = 0 serves: the entries know no temperature."""
    own = replace(volume, blocks=(replace(block, slots=block.own_slots),))
    nothing, into = np.zeros(volume.n), Entries(np.zeros(block.places.size), slope)
    if stores:
        store(own, on[:1], bodies, (nothing, nothing), np.zeros(volume.n), into)
    conduct(own, on[1:], bodies, Fields(nothing), np.zeros(volume.n), into)
    return into.data


def _is_constant(body: Body) -> bool:
    material = body.material
    return material.phase is None and material.c.is_constant and material.k.is_constant
