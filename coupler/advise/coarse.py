"""What trials are run with: few cells, few windows, probes of what a simpler model would miss."""

from __future__ import annotations

import math
from typing import Any

from coupler.advise.edit import Edit, Tree, at
from coupler.scenario.document import Key
from coupler.scenario.scaled import cells_as, windows_times

# A body of a trial has no more cells than this; shapes and layers stay as they are.
CELLS = 64
# Windows are made longer while there are more than this, but never by more than cells are: what bounds a window, heat
# crossing a cell or an edge passing it, grows with the cell.
WINDOWS = 400
OWN = "advise."  # probes of our own begin so


def mesh_factor(tree: Tree, cells: int = CELLS) -> float:
    """The factor on cells along an edge with which no body has more than so many; 1 where nothing can be coarsened."""
    factor = 1.0
    for body in tree["bodies"].values():
        if (n := at(body, ("mesh", "rectangle", "cells"))) is not None:
            power = 1.0 if min(n) == 1 else 0.5
            factor = min(factor, (cells / (n[0] * n[1])) ** power)
    return factor


def meshed(tree: Tree, factor: float) -> Edit:
    """`factor` times as many cells along every edge.  Even counts stay even, so that midpoints stay nodes."""
    return Edit(cells_as(tree, lambda n: _count(n, factor)) if factor != 1.0 else {})


def _count(n: int, factor: float) -> int:
    # fault: advice: even counts of cells turn odd -> step = 1 | coupler/test_advise
    step = 2 if n % 2 == 0 else 1
    return n if n <= 2 else max(round(n * factor / step) * step, 2)


def cells_of(tree: Tree) -> int:
    """Cells of all rectangles."""
    found = (at(body, ("mesh", "rectangle", "cells")) for body in tree["bodies"].values())
    return sum(int(n[0]) * int(n[1]) for n in found if n is not None)


def windows_factor(count: int, mesh: float) -> float:
    """The factor on windows for a scenario of so many, meshed by this factor: a power of 2."""
    longer = 2.0 ** math.ceil(math.log2(max(count / WINDOWS, 1.0)))
    return min(longer, 2.0 ** math.floor(math.log2(1.0 / mesh)))


def timed(tree: Tree, factor: float) -> Edit:
    """Windows `factor` times as long, none longer than its range; nothing where windows find their own size."""
    return Edit(windows_times(tree, factor) if factor != 1.0 else {})


def watched(tree: Tree) -> Edit:
    """Probes of pressure and place at every pair."""
    put: dict[Key, Any] = {}
    for name, pair in tree.get("contact", {}).items():
        side = pair["slave"]
        for what, probe in (("p.max", {"p": {"max": side}}), ("p.mean", {"p": {"mean": side}}),
                            ("u_x", {"u_x": {"mean": side}}), ("u_y", {"u_y": {"mean": side}})):
            put["probes", f"{OWN}{name}.{what}"] = probe
    return Edit(put)
