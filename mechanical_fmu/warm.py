"""Starts from another run: what bodies took over of displacements, points and contact, and what one may take of us."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import History
from contact.half.memory import (
    AS_LEFT,
    CELLS,
    ELASTIC,
    MOBILISED,
    MOBILISED_AT,
    MULTIPLIERS,
    SHAPES,
    CellRows,
    MemoryLayout,
    U,
)
from mechanical_fmu.cells import Cells
from mechanical_fmu.laws.law import CREEP, KINEMATIC, LIQUID, OVERSTRESS, PLASTIC
from mechanical_fmu.system import System

Floats = NDArray[np.float64]

NAMES = {PLASTIC: "plastic", CREEP: "creep", KINEMATIC: "kinematic", OVERSTRESS: "overstress", LIQUID: "liquid"}
STATE = "state"  # where a state stands in what the half's FMI face saves


@dataclass(frozen=True)
class Beginning:
    """What a scene begins with.  u : (n_nodes, 2) [m].  history : (n_history,) of points and cells.  contact : its own.

    as_left : whether all of it is as another run ended, so that there is nothing to solve.
    """

    u: Floats
    history: Floats
    contact: History
    as_left: bool


def memory_layout(system: System) -> MemoryLayout:
    """Tell where in the state of the elastic half stands what another run may start from."""
    rows = tuple(_rows(system, cells) for cells in system.volume.kinds if cells.n_row)
    contact = (STATE, "contact")
    return MemoryLayout((STATE, "u"), (*contact, "multipliers"), (*contact, "mobilised"), (*contact, "mobilised_at"),
                        (STATE, "history"), rows)


def _rows(system: System, cells: Cells) -> CellRows:
    how, parts = cells.treatment, system.interface.parts
    laws = [name for law, name in NAMES.items() if how.kind & law] or [ELASTIC]
    laws += [name for name in ("enhanced", "plane_stress") if getattr(how, name)]
    return CellRows(SHAPES[0 if cells.nodes.shape[1] == 4 else 1], tuple(parts[k] for k in np.unique(cells.part)),
                    cells.n_row, "+".join(laws))


def beginning(system: System) -> Beginning:
    """Return what the scene begins with: as interface.h5 says of bodies that start from another run, else nothing.

    Raises ValueError where what a body's points remembered there does not fit what they remember here.
    """
    interface, start = system.interface, system.interface.start
    u, history = np.zeros((system.volume.n_nodes, 2)), system.start_history()
    if U in start:
        u[:len(start[U])] = np.nan_to_num(start[U], nan=0.0)
    names, at = set(), 0
    for cells in system.volume.kinds:
        if not cells.n_row:
            continue
        size = len(cells.nodes) * cells.n_row
        own, rows = history[at:at + size].reshape(-1, cells.n_row), _rows(system, cells)
        at += size
        for k in np.unique(cells.part):
            name = rows.name(interface.parts[k])
            if name in start and start[name].shape == (np.sum(cells.part == k), cells.n_row):
                # fault: what points remember is not taken over -> names.add(name); continue | coupler/test_warm_starts
                own[cells.part == k] = start[name]
                names.add(name)
    for name in sorted(name for name in start if name.startswith(CELLS)):
        part, _, laws = name.removeprefix(CELLS).rsplit(".", 2)
        if name not in names and not laws.startswith(ELASTIC):
            raise ValueError(f"body {part} starts with the history of {laws}, which its material or its element here "
                             "does not have; give it those of that run, or leave u0 out")
    contact = system.contact.no_history(interface.nodes + u)
    if MULTIPLIERS in start:
        multipliers = contact.multipliers.copy()
        multipliers[:system.contact.pair_nodes.size] = np.nan_to_num(start[MULTIPLIERS], nan=0.0)
        # fault: what friction's points remember is not taken over -> points = contact.mobilised_at |
        #   coupler/test_warm_starts
        points = start.get(MOBILISED_AT, contact.mobilised_at)
        contact = History(multipliers, contact.x, np.nan_to_num(start[MOBILISED], nan=0.0), points)
    # fault: a run that goes on is solved at its start -> return Beginning(u, history, contact, False) |
    #   coupler/test_warm_starts
    return Beginning(u, history, contact, AS_LEFT in start and not system.contact.pair_nodes.tied.size)
