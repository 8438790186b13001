"""What a user should know of a scene's contact before it starts, though it is no error: one sentence each."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from contact.facing import project
from contact.geometry import ITSELF_BACK
from contact.half.interface import Interface, Pair
from contact.half.register import register_message
from contact.surfaces import surfaces_of
from contact.wire import Facing, Floats

# A penalty beyond this times E/h loses four digits of every solve, and Newton's method the rest.
STIFF = 1e4


def facing_at(interface: Interface, x: Floats) -> Facing:
    """What faces what with the nodes at x : (n_nodes, 2) [m].  Raises ValueError where x is no possible geometry."""
    return project(surfaces_of(register_message(interface)), np.ascontiguousarray(x[interface.contact_nodes]))


def start_notes(interface: Interface, stiffness: Mapping[str, float]) -> list[str]:
    """All of them; stiffness : body -> E [Pa] at the start, of the bodies that have one."""
    if not interface.pairs:
        return []
    met = np.bincount(facing_at(interface, interface.nodes).pair, minlength=len(interface.pairs))
    notes = []
    for pair, points in zip(interface.pairs, met, strict=True):
        notes += [] if points else [nothing_faced(interface, pair, interface.nodes)]
        notes += folding(interface, pair) + stiff_penalty(interface, pair, stiffness)
        notes += jumps(pair, stiffness)
    return notes


def nothing_faced(interface: Interface, pair: Pair, x: Floats) -> str:
    """Why a pair without a facing point may have none; x : (n_nodes, 2) [m]."""
    what = f"pair {pair.name}: nothing of {pair.slave} faces anything of {pair.master} at the start"
    if pair.slave == pair.master:
        return what
    d = nearest(interface, pair, x)
    if d > pair.gap_max:
        return f"{what}: their nearest nodes are {d:.3g} m apart, gap_max is {pair.gap_max:.3g} m"
    return (f"{what}, though their nearest nodes are {d:.3g} m apart (gap_max {pair.gap_max:.3g} m): they lie beside "
            "each other or look the same way")


def nearest(interface: Interface, pair: Pair, x: Floats) -> float:
    """The least distance [m] between a node of the slave and one of the master, at x : (n_nodes, 2) [m]."""
    slave, master = (x[np.unique(interface.surfaces[name])] for name in (pair.slave, pair.master))
    distances, _ = cKDTree(master).query(slave)
    return float(np.min(distances))


def folding(interface: Interface, pair: Pair) -> list[str]:
    """What a surface that faces itself leaves out."""
    if pair.slave != pair.master:
        return []
    h = edge_lengths(interface, pair.slave)
    return [f"pair {pair.name}: {pair.slave} faces itself; edges that share a node never do, and a fold that overlaps "
            f"by more than {ITSELF_BACK:g} of an edge ({ITSELF_BACK * h.min():.3g} m at the shortest) is not seen"]


def stiff_penalty(interface: Interface, pair: Pair, stiffness: Mapping[str, float]) -> list[str]:
    """A penalty that spoils the condition of the matrix."""
    soft = [(stiffness[body], body) for name in (pair.slave, pair.master)
            if (body := name.split(".")[0]) in stiffness]
    if not soft:
        return []
    # fault: penalty held against the harder body -> E, body = max(soft) | contact/test_notes
    E, body = min(soft)
    h = float(edge_lengths(interface, pair.slave).mean())
    if not pair.eps_N * h > STIFF * E:
        return []
    return [f"pair {pair.name}: the penalty of {pair.eps_N:.3g} Pa/m is {pair.eps_N * h / E:.2g} times E/h (E of "
            f"{body}, h = {h:.3g} m): equations lose so many digits, and Newton's method may fail; 10 to 100 times E/h "
            f"({10 * E / h:.2g} to {100 * E / h:.2g} Pa/m), or `augmented`, would do"]


def jumps(pair: Pair, stiffness: Mapping[str, float]) -> list[str]:
    """One point a node between bodies of which one deforms: its force comes and goes as a whole."""
    # fault: one point a node not said to jump -> if True or not stiffness.keys() & {name.split(".")[0] for name in
    #   (pair.slave, pair.master)}: | contact/test_notes
    if not pair.by_node or not stiffness.keys() & {name.split(".")[0] for name in (pair.slave, pair.master)}:
        return []
    return [f"pair {pair.name}: with form: nodes a slave node that slides off an end of {pair.master} lets go of all "
            "its force at once, and Newton's method may find no equilibrium on either side of the jump; form: edges "
            "has none"]


def edge_lengths(interface: Interface, surface: str) -> Floats:
    """(n_edges,) [m] in the reference configuration."""
    ends = interface.nodes[interface.surfaces[surface]]
    return np.hypot(*(ends[:, 1] - ends[:, 0]).T)
