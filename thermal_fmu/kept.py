"""What need not be worked out again: shapes of cells that did not move, matrices of bodies whose data are constant.

Kept values are those that would be worked out, to the bit, so nothing here is part of the state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.phase import Fields
from thermal_fmu.spec import Body
from thermal_fmu.volume import Block, Reference, Shape, Volume, conduct, shape_of, store, turned

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
            if known and before is not None and np.array_equal(before[block.nodes], x[block.nodes]):
                shapes.append(self._shapes[b])
            else:
                shapes.append(turned(block, first, shape_of(volume, block, x), x))
        self._x, self._references, self._shapes = np.array(x), references, tuple(shapes)
        return self._shapes


class KeptMatrix:
    """M + slope K of blocks whose c and k are constant, for the shapes and the slope last asked for."""

    def __init__(self) -> None:
        self._of: dict[int, tuple[tuple[Reference, Shape], tuple[float, bool], Floats]] = {}

    def fill(self, volume: Volume, bodies: Sequence[Body], on: Sequence[tuple[Reference, Shape]], slope: float,
             stores: bool, data: Floats) -> frozenset[int]:
        """Put the entries of such blocks into data; returns which blocks they are, by their place in the volume.

        on : reference and shape of every block.  stores : whether M is in it.
        """
        found = [b for b, block in enumerate(volume.blocks) if block.alone and _is_constant(bodies[block.body])]
        for b in found:
            block, now, asked = volume.blocks[b], on[b], (slope, stores)
            kept = self._of.get(b)
            if kept is None or kept[0][0] is not now[0] or kept[0][1] is not now[1] or kept[1] != asked:
                kept = (now, asked, _entries(volume, block, bodies, now, slope, stores))
                self._of[b] = kept
            data[block.places] = kept[2]
        return frozenset(found)


def _entries(volume: Volume, block: Block, bodies: Sequence[Body], on: tuple[Reference, Shape], slope: float,
             stores: bool) -> Floats:
    """(n_places,) entries of one block.  T = 0 serves: the entries know no temperature."""
    own = replace(volume, blocks=(replace(block, slots=block.own_slots),))
    nothing, values = np.zeros(volume.n), np.zeros(block.places.size)
    if stores:
        store(own, on[:1], bodies, (nothing, nothing), np.zeros(volume.n), values)
    conduct(own, on[1:], bodies, Fields(nothing), np.zeros(volume.n), slope, values)
    return values


def _is_constant(body: Body) -> bool:
    material = body.material
    return material.phase is None and material.c.is_constant and material.k.is_constant
