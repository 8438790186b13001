"""Prescribed displacements: a field over the reference, then a turn about a point; and two that disagree on a node."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, Signal, field_from, signal_from
from contact.half.interface import Interface
from contact.half.turns import rotated
from contact.problem.boundary import HELD
from contact.problem.errors import Wrong
from contact.problem.values import did_you_mean

if TYPE_CHECKING:
    # The thermal half has no such conditions.
    from contact.problem.mechanical import ElasticBoundary, ElasticProblem, Rotation

Floats = NDArray[np.float64]

# Two prescriptions of one node are the same where they differ by no more than this share of themselves: round-off.
SAME_PLACE = 1e-12


@dataclass(frozen=True)
class Turn:
    """A turn in the plane.  about : (2,) [m], the point that stays.  angle : [rad], anticlockwise.

    name : of the inputs that scale and shift the angle, "" for none.
    """

    about: Floats
    angle: Signal
    name: str = ""

    def displaced(self, X: Floats, u: Floats, angle: float) -> Floats:
        """Compute (n, 2) [m], where x = about + R(angle) (X + u - about) lies from X.

        X : (n, 2) [m].  u : (n, 2) or (2,) [m], what comes before the turn.  angle : [rad].
        """
        return np.asarray(u + rotated(X + u - self.about, angle))


def turn_from(spec: Rotation | None, name: str = "") -> Turn | None:
    """Make a Turn of what model.json states, None of none."""
    return None if spec is None else Turn(np.array(spec.about), signal_from(spec.angle), name)


# Two conditions that prescribe one component of one node

@dataclass(frozen=True)
class _Prescription:
    """One entry of "boundary", at some nodes: displacement before the turn by component, and the turn."""

    entry: int
    spec: ElasticBoundary
    u: tuple[Field | None, Field | None]
    turn: Turn | None

    @property
    def components(self) -> tuple[int, ...]:
        return tuple(i for i, u in enumerate(self.u) if self.turn is not None or u is not None)

    @property
    def times(self) -> Floats:
        """Every time at which something of it bends [s]."""
        signals = [s for u in self.u if u is not None for s in u.signals]
        return np.unique(np.concatenate([s.t for s in (*signals, *([self.turn.angle] if self.turn else []))]))

    def at(self, X: Floats, t: float, side: int) -> Floats:
        """(n, 2) displacement [m] of X : (n, 2) [m]; 0 in a component that is not prescribed."""
        u = np.stack([np.zeros(len(X)) if one is None else one.at(X, t, side) for one in self.u], axis=1)
        return u if self.turn is None else self.turn.displaced(X, u, self.turn.angle.at(t, side))


def conflicts(problem: ElasticProblem, interface: Interface) -> Iterator[Wrong]:
    """Components of nodes that two entries prescribe differently, one Wrong for each pair of entries."""
    owner = np.full((len(interface.nodes), 2), -1)
    known: dict[int, _Prescription] = {}
    for i, b in enumerate(problem.boundary):
        if isinstance(b.until, dict):
            for name in b.until:
                if name not in [pair.name for pair in interface.pairs]:
                    yield Wrong(("boundary", i, "until", name), f"there is no contact pair {name!r}",
                                did_you_mean(name, [pair.name for pair in interface.pairs]))
                # fault: what waits for a tie to close is let go at once, or never -> if False: | coupler/test_ties
                if any(pair.tied for pair in interface.pairs if pair.name == name):
                    yield Wrong(("boundary", i, "until", name), f"the pair {name!r} is tied: it is closed from the "
                                "start, and never closes", "State the time at which the displacement is released.")
        nodes = nodes_of(b, problem, interface)
        if nodes is None or all(getattr(b, key) is None for key in HELD):
            continue
        new = _Prescription(i, b, (None if b.u_x is None else field_from(b.u_x),
                                   None if b.u_y is None else field_from(b.u_y)), turn_from(b.rotation))
        told: set[int] = set()
        for c in new.components:
            for first in np.unique(owner[nodes, c]):
                both = nodes[owner[nodes, c] == first]
                # fault: disagreeing prescriptions taken -> if first < 0 or True: | mechanical_fmu/test_elastic_spec
                if first < 0 or first in told:
                    continue
                for wrong in _differs(known[int(first)], new, c, both, interface.nodes):
                    told.add(int(first))
                    yield wrong
            owner[nodes, c] = np.where(owner[nodes, c] < 0, i, owner[nodes, c])
        known[i] = new
    yield from _rigid_conflicts(problem)


def nodes_of(b: ElasticBoundary, problem: ElasticProblem, interface: Interface) -> NDArray[np.intp] | None:
    """Return the nodes (n,) of a place; None of rigid bodies, and where there is no such place."""
    if b.body is not None:
        if b.body not in interface.bodies or b.body not in problem.bodies or problem.bodies[b.body].rigid:
            return None
        return np.flatnonzero(interface.node_body == interface.bodies.index(b.body))
    found = interface.surfaces.get(b.where) if b.on is not None else interface.node_sets.get(b.where)
    return None if found is None else np.unique(found).astype(np.intp)


def _differs(a: _Prescription, b: _Prescription, c: int, nodes: NDArray[np.intp], X: Floats) -> Iterator[Wrong]:
    """The Wrong of two entries that prescribe component c of nodes, if they do so differently at any time."""
    times = np.union1d(a.times, b.times)
    times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))  # a turn bends between its times
    instants = [(float(t), side) for t in times for side in (-1, 1)]
    u, v = (np.array([one.at(X[nodes], t, side)[:, c] for t, side in instants]) for one in (a, b))
    apart = np.abs(u - v) - SAME_PLACE * np.maximum(np.abs(u), np.abs(v))
    when, k = np.unravel_index(int(np.argmax(apart)), apart.shape)
    key = ("u_x", "u_y")[c]
    where = ("boundary", b.entry, "rotation" if b.turn is not None else key)
    place = f"{key} of {len(nodes)} node{'s' if len(nodes) > 1 else ''} of {_place(b.spec)}"
    first = f"entry {a.entry} ({_place(a.spec)})"
    if apart[when, k] > 0.0:
        x, y = X[nodes[k]]
        yield Wrong(where, f"{place} is prescribed by {first} already, and differently: {u[when, k]:.6g} m there, "
                    f"{v[when, k]:.6g} m here, for node {nodes[k] + 1} at ({x:.6g}, {y:.6g}) m at t = "
                    f"{instants[when][0]:.6g} s",
                    "Let one of them hold the node, or make both the same there.")
    elif a.spec.until != b.spec.until:
        yield Wrong(where, f"{place} is prescribed by {first} already, which ends another time",
                    "Give both the same `until`, or let one of them hold the node.")
    elif a.spec.name != b.spec.name:
        yield Wrong(where, f"{place} is prescribed by {first} already, which goes by another input",
                    "A rule may drive the two apart: let one of them hold the node.")


def _place(b: ElasticBoundary) -> str:
    return str(b.on or b.at or b.body)


def _rigid_conflicts(problem: ElasticProblem) -> Iterator[Wrong]:
    """Components of a rigid body that two entries prescribe."""
    owner: dict[tuple[str, str], int] = {}
    for i, b in enumerate(problem.boundary):
        if b.body is None or b.body not in problem.bodies or not problem.bodies[b.body].rigid:
            continue
        keys = ("u_x", "u_y", "angle") if b.rotation is not None else [k for k in HELD if getattr(b, k) is not None]
        for key in keys:
            first = owner.setdefault((b.body, key), i)
            other = problem.boundary[first]
            same = (b.rotation is None and other.rotation is None and getattr(other, key) == getattr(b, key)
                    and other.name == b.name)
            if first != i and not same:
                yield Wrong(("boundary", i, "rotation" if b.rotation is not None else key),
                            f"{key} of body {b.body!r} is prescribed by entry {first} already, and differently",
                            "Keep one of the two.")
                break
