"""Temperatures at the start, wherever they come from: a number, a function of place, or another run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, field_from
from contact.half.interface import Interface
from contact.half.memory import U
from contact.problem.curves import FieldSum
from contact.problem.start import Course, FromFrames

Floats = NDArray[np.float64]
START_T = "T"  # of Interface.start


@dataclass(frozen=True)
class CourseField(Field):
    """What other runs left of a body, as a field at its nodes: straight lines between times.

    t : (n_t,) [s], ascending.  T : (n_t, n) [K] at its nodes, ascending; constant outside the times.
    """

    t: Floats = dataclasses.field(default_factory=lambda: np.zeros(1))
    T: Floats = dataclasses.field(default_factory=lambda: np.zeros((1, 0)))

    @property
    def is_uniform(self) -> bool:
        """False: it differs from node to node."""
        return False

    @property
    def is_zero(self) -> bool:
        """False."""
        return False

    @property
    def least(self) -> float | None:
        """The lowest temperature [K]."""
        return float(self.T.min())

    def level(self, t: float, side: int = 1) -> Floats:
        """The shares (n_t,) [1] of the times in what it is at t [s]."""
        shares = np.zeros(self.t.size)
        k = int(np.clip(np.searchsorted(self.t, t), 1, max(self.t.size - 1, 1)))
        if self.t.size == 1:
            return np.ones(1)
        share = float(np.clip((t - self.t[k - 1]) / (self.t[k] - self.t[k - 1]), 0.0, 1.0))
        # fault: a course is that of its next frame -> shares[k] = 1.0 |
        #   coupler/test_given_temperatures::test_another_run_gives_its_frames_on_straight_lines
        shares[k - 1], shares[k] = 1.0 - share, share
        return shares

    def shapes(self, x: Floats) -> Floats:
        """Return the temperatures (n_t, n) [K], wherever its nodes x : (n, 2) are."""
        return self.T


def given_field(spec: Any, interface: Interface) -> Field:
    """Make the Field of a prescribed temperature: as field_from, or of {"dataset": "start/T.BODY", ...}.

    Raises ValueError where interface.h5 has no such course.
    """
    if isinstance(spec, FromFrames):
        raise ValueError("model.json: a results file is not a half's to read: the coupler puts it into interface.h5")
    if not isinstance(spec, Course):
        return field_from(spec)
    body = spec.dataset.removeprefix("start/T.")
    if f"t.{body}" not in interface.start or f"T.{body}" not in interface.start:
        raise ValueError(f"interface.h5 has no {spec.dataset}")
    return CourseField((), interface.start[f"t.{body}"], interface.start[f"T.{body}"])


def start_temperature(T0: Any, interface: Interface, nodes: NDArray[np.integer]) -> Floats:
    """Return the temperatures (n,) [K] that a start states at nodes : (n,), numbers of the mesh.

    T0 : a number [K]; a sum of terms, {"terms": [...]}, at the reference coordinates; or {"dataset": "start/T"}, what
    stands in interface.h5.  Each as it is, or as a model.json has it.  Raises ValueError where a node has none there.
    """
    if isinstance(T0, int | float):
        return np.full(len(nodes), float(T0))
    if isinstance(T0, FieldSum) or (isinstance(T0, Mapping) and "terms" in T0):
        # fault: a start at coordinates of its own -> return field_from(T0).at(interface.nodes[nodes] -
        #   interface.nodes[nodes].mean(axis=0), 0.0) | coupler/test_starts
        return field_from(T0).at(interface.nodes[nodes], 0.0)
    T = interface.start[START_T][nodes] if START_T in interface.start else np.full(len(nodes), np.nan)
    if np.isnan(T).any():
        raise ValueError(f"interface.h5: start/T has no temperature for node {int(nodes[np.argmax(np.isnan(T))]) + 1}")
    return T


def start_coordinates(interface: Interface) -> Floats:
    """Return where the nodes are at the start, (n_nodes, 2) [m]: as drawn, or where another run left them."""
    return interface.nodes + np.nan_to_num(interface.start[U], nan=0.0) if U in interface.start else interface.nodes


def mean_start(T0: Any, interface: Interface, nodes: NDArray[np.integer]) -> float:
    """Return the mean [K] of the temperatures that a start states at nodes : (n,); the number itself where it is one.
    """
    return float(T0) if isinstance(T0, int | float) else float(start_temperature(T0, interface, nodes).mean())


def start_temperatures(interface: Interface, T0: Sequence[Any]) -> Floats:
    """Return the temperatures (n_nodes,) [K] at the start.

    T0 : of each part (Interface.parts), as start_temperature takes it.  Where parts meet in a node the last one holds.
    A node that no cell uses has the first one's mean.
    """
    T = np.empty(len(interface.nodes))
    loose = interface.node_body < 0
    if loose.any():
        T[loose] = start_temperature(T0[0], interface, interface.part_nodes(0)).mean()
    for part, one in enumerate(T0):
        nodes = np.flatnonzero(interface.node_body == part) if not interface.regions else interface.part_nodes(part)
        T[nodes] = start_temperature(one, interface, nodes)
    return T
