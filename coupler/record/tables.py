"""Contact along the slave surface of each pair at every window's end: recorded for a picture in space and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.metered import CALL_PARTS, PARTS
from coupler.record.vtkhdf import FileField
from coupler.schemes.levels import Level

Array = NDArray[np.float64]
Ints = NDArray[np.integer]
FRICTION = {"t_T": "Pa", "slip_share": "1"}
"""What is kept only where the mechanical half tells it, as one with friction does; `contact.NAME` of its outputs."""
FIELDS = {"t_N": "Pa", "gap": "m", **FRICTION}
"""What is kept of each node, and its unit."""


@dataclass(frozen=True)
class ContactLine:
    """The slave surface of a pair, unrolled.

    nodes : (n,) node numbers along it.  at : (n,) their pair nodes.
    s : (n,) [m] length along the surface from its start, in the mesh's own shape.  X : (n, 2) [m] where they are in it.
    """

    pair: str
    nodes: Ints
    at: Ints
    s: Array
    X: Array


def contact_lines(interface: Interface) -> tuple[ContactLine, ...]:
    """One a pair, in the order of the pairs."""
    found = []
    for pair in interface.pairs:
        nodes, s = unrolled(interface.surfaces[pair.slave], interface.nodes)
        side = interface.side_of(pair.name, pair.slave)
        at = side.at.start + np.searchsorted(side.nodes, nodes)
        found.append(ContactLine(pair.name, nodes, at, s, interface.nodes[nodes]))
    return tuple(found)


def unrolled(edges: Ints, X: Array) -> tuple[Ints, Array]:
    """Return the nodes of a surface one after the other (n,), and the length from its start to each (n,) [m].

    edges : (n_edges, 2) node numbers, X : (n_nodes, 2) [m].  It begins at the end with the smaller X_1 (X_2 where the
    surface stands upright).  A closed surface ends with the node it begins with; a surface in pieces goes on in the
    next, from the left, at the length where the one before ended.
    """
    pieces = sorted((_from_left(piece, X) for piece in _pieces(edges)), key=lambda piece: tuple(X[piece[0]]))
    s, length = [], 0.0
    for piece in pieces:
        steps = np.linalg.norm(np.diff(X[piece], axis=0), axis=1)
        s.append(length + np.append(0.0, np.cumsum(steps)))
        length = float(s[-1][-1])
    return np.concatenate(pieces), np.concatenate(s)


def _from_left(piece: Ints, X: Array) -> Ints:
    way = X[piece[-1]] - X[piece[0]]
    # fault: record: the slave surface is unrolled in the order of its edges' numbers -> return piece if
    #   way[int(np.argmax(np.abs(way)))] < 0.0 else piece | coupler/test_contact_lines
    return piece[::-1] if way[int(np.argmax(np.abs(way)))] < 0.0 else piece


def _pieces(edges: Ints) -> list[Ints]:
    """The chains that the edges make, each as its nodes in order."""
    left = {int(a): int(b) for a, b in edges}
    led_to = set(left.values())
    begins = [a for a in left if a not in led_to]
    found = []
    while left:
        node = begins.pop(0) if begins else next(iter(left))
        chain = [node]
        while node in left:
            node = left.pop(node)
            chain.append(node)
        found.append(np.array(chain))
    return found


def contact_row(found: Sequence[ContactLine], now: Level,
                friction: Mapping[str, Array]) -> dict[str, NDArray[np.float32]]:
    """Return t_N [Pa], gap [m] and what there is of FRICTION, (n,) each, at the n nodes of the lines, line after line.

    friction : (n_q,) each of t_T [Pa] and slip_share [1], those that are told.  Single precision will do.
    """
    if not found:
        return {}
    at = np.concatenate([line.at for line in found])
    values = {"t_N": now.t_N, "gap": now.gap, **friction}
    return {f"contact.{n}": v[at].astype(np.float32) for n, v in values.items()}


# Fields of the exchange that stand in every frame, on all nodes; u, p and gap are made of the mechanical half's x,
# contact.t_N and contact.gap.
EXCHANGED: Mapping[str, tuple[FileField, ...]] = {
    "thermal": (FileField("T", "K"),),
    "mechanical": (FileField("u", "m", 2), FileField("p", "Pa"), FileField("gap", "m"))}

# What the mechanical half tells of pair nodes, and its unit; kept as it is, for pairs may share a node.
EXCHANGED_IN_PAIRS: Mapping[str, str] = {
    "contact.t_N": "Pa", "contact.gap": "m", "contact.covered": "1", "contact.E_friction": "J"}

# Tables of a results file: their names, columns and types.

FORMAT, FORMAT_VERSION = "slideline.run", 3

WINDOW_FIELDS: tuple[tuple[str, str], ...] = (
    ("t", "f8"), ("H", "f8"), ("verdict", "S24"), ("scheme", "S16"), ("solves", "i4"),
    ("thermal_solves", "i4"), ("mechanical_solves", "i4"), ("thermal_iterations", "i4"),
    ("mechanical_iterations", "i4"), ("thermal_seconds", "f8"), ("mechanical_seconds", "f8"),
    ("fmi_seconds", "f8"), ("seconds", "f8"), ("recording_seconds", "f8"), ("values", "i8"),
    ("touching", "i4"), ("max_T", "f8"), ("max_p", "f8"), ("imbalance", "f8"), ("taken", "?"),
    ("iterations", "i4"), ("misfit", "f8"), ("contraction", "f8"), ("error", "f8"),
)
"""Columns of the windows table, one row a window tried, rejected too; times [s], max_T [K], max_p [Pa].

taken : the run went on from its end.  iterations : of the window, 0 where the scheme does not iterate; misfit : the
largest difference left, in tolerances; contraction : measured ratio of successive residuals of plain iteration;
error : the largest estimated error, in tolerances, nan where none is known.
"""

TIMING = "timing"
TIMING_FIELDS: tuple[tuple[str, str], ...] = tuple(
    (name, "i4" if name in ("calls", "requests") else "f8") for name in PARTS)
"""Columns of the timings table, one row a row of the windows table: where its time went (coupler.fmu.metered.PARTS);
nan where that was not told, as of the last window before a run was killed or resumed."""

CALL_FIELDS: tuple[tuple[str, str], ...] = (("window", "i4"), ("side", "u1"), ("call", "u1"), *(
    (name, "f4") for name in CALL_PARTS[2:]))
"""Columns of the calls table, one row a call of a half: row of the windows table (from 0), then as
coupler.fmu.metered.CALL_PARTS; side and call are numbers of SIDES and CALLS there."""

ITERATE_FIELDS: tuple[tuple[str, str], ...] = (
    ("window", "i4"), ("iterate", "i4"), ("temperature", "f8"), ("gap", "f8"), ("pressure", "f8"),
    ("solid_fraction", "f8"), ("factor", "f8"),
)
"""Columns of the iterates table, one row an iterate: row of the windows table (from 0), number in the window (from
1), differences in units of their tolerances, factor of the step that led to it."""

ERROR_QUANTITIES = ("temperature", "gap", "heat", "displacement", "elastic_strain")
ERROR_FIELDS: tuple[tuple[str, str], ...] = (("window", "i4"), *((quantity, "f8") for quantity in ERROR_QUANTITIES))
"""Columns of the errors table, one row a window whose error is known: row of the windows table (from 0), then the
largest error that the window made [K, m, J, m, 1], at any node or of any body; nan where unknown."""

ESTIMATE_FIELDS: tuple[tuple[str, str], ...] = (("window", "i4"), *(
    (f"{quantity}{part}", "f8") for quantity in ERROR_QUANTITIES
    for part in ("", "_splitting", "_own")))
"""Columns of the estimates table, one row a window tried whose error is known: row of the windows table (from
0), then of each quantity the error, its part from the exchange and that from the halves' own steps, all in tolerances;
nan where unknown."""
