"""What a mechanical half leaves for another run: which arrays of its state they are, and how they are named.

A half tells it in a text that never changes, its variable `memory.layout`.  The coupler reads the arrays out of the
bytes of the half's state when a run ends, keeps them with the results, and puts those of a body into `start` of another
scene's interface.h5, under the same names:
    u (n_nodes, 2) [m];  multipliers [Pa] and mobilised [1], (n_q,) of the pair nodes, and mobilised_at (n_h, 3), the
    friction of points as in contact.shear_history;
    cells.PART.SHAPE.LAWS (n, width), a row a cell of a part, ascending by number;
    as_left (1,), in an interface.h5 alone, where the whole scene begins as one run ended.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.state import StateError, from_bytes

Floats = NDArray[np.float64]

LAYOUT = "memory.layout"  # the variable of a half
U, MULTIPLIERS, MOBILISED, MOBILISED_AT, CELLS = "u", "multipliers", "mobilised", "mobilised_at", "cells."
SIDES, AS_LEFT = "sides", "as_left"
ELASTIC = "elastic"  # laws that begin so remember nothing that u and T do not say
SHAPES = ("quads", "triangles")


@dataclass(frozen=True)
class CellRows:
    """Cells of one shape whose rows are alike.  parts : names.  width : numbers a cell.  laws : what they are of."""

    shape: str
    parts: tuple[str, ...]
    width: int
    laws: str

    def name(self, part: str) -> str:
        """Name the array of a part."""
        return f"{CELLS}{part}.{self.shape}.{self.laws}"

    def numbers(self, interface: Interface) -> NDArray[np.intp]:
        """Return the part (n,) of each row's cell, ascending by the cell's number."""
        of_cell = interface.quad_part if self.shape == SHAPES[0] else interface.triangle_part
        own = [interface.parts.index(part) for part in self.parts]
        return np.asarray(of_cell[np.isin(of_cell, own)], dtype=np.intp)


@dataclass(frozen=True)
class MemoryLayout:
    """Where arrays stand in a half's state: field after field.  rows : those of `cells`, one kind after the other."""

    u: tuple[str, ...]
    multipliers: tuple[str, ...]
    mobilised: tuple[str, ...]
    mobilised_at: tuple[str, ...]
    cells: tuple[str, ...]
    rows: tuple[CellRows, ...]

    def text(self) -> str:
        """Return the layout as the text of the variable."""
        return json.dumps(asdict(self))


def layout_from(text: str) -> MemoryLayout:
    """Read the layout of a half's text.  Raises ValueError where it is none."""
    try:
        told = json.loads(text)
        rows = tuple(CellRows(str(r["shape"]), tuple(r["parts"]), int(r["width"]), str(r["laws"]))
                     for r in told.pop("rows"))
        return MemoryLayout(**{name: tuple(path) for name, path in told.items()}, rows=rows)
    except (TypeError, KeyError, AttributeError, ValueError) as exc:
        raise ValueError(f"{LAYOUT} is not the layout of a memory ({exc})") from exc


def remembered(data: bytes, layout: MemoryLayout, interface: Interface) -> dict[str, Floats]:
    """Return what the bytes of a half's state hold for another run, by name (at the head of this file).

    Raises ValueError where bytes, layout and interface do not fit together.
    """
    try:
        state = from_bytes(data, None)
    except StateError as exc:
        raise ValueError(str(exc)) from exc
    n, n_q = len(interface.nodes), interface.pair_nodes.size
    out = {U: _array(state, layout.u).reshape(-1, 2)[:n]}
    if n_q:
        pairs = [pair.name for pair in interface.pairs]
        sides = [(pairs.index(side.pair), side.own, side.at.start, side.at.stop) for side in interface.pair_sides]
        # Those of ties, behind them, are found anew with the equilibrium.
        out |= {MULTIPLIERS: _array(state, layout.multipliers)[:n_q], MOBILISED: _array(state, layout.mobilised),
                MOBILISED_AT: _array(state, layout.mobilised_at).reshape(-1, 3),
                SIDES: np.array(sides, dtype=np.float64)}
    history, at = _array(state, layout.cells).ravel(), 0
    for kind in layout.rows:
        parts = kind.numbers(interface)
        own = history[at:at + parts.size * kind.width].reshape(parts.size, kind.width)
        at += own.size
        # fault: the cells of one body remember what another's did -> out |= {kind.name(part): own[:np.sum(parts ==
        #   interface.parts.index(part))] for part in kind.parts} | coupler/test_warm_starts
        out |= {kind.name(part): own[parts == interface.parts.index(part)] for part in kind.parts}
    sizes = {U: n, MULTIPLIERS: n_q, MOBILISED: n_q}
    if at != history.size or any(len(out[name]) != size for name, size in sizes.items() if name in out):
        raise ValueError("the state of the half does not fit the layout it tells")
    return out


def _array(state: Any, path: tuple[str, ...]) -> Floats:
    for name in path:
        if not isinstance(state, Mapping) or name not in state:
            raise ValueError(f"the state of the half has no {'.'.join(path)}")
        state = state[name]
    return np.asarray(state, dtype=np.float64)
