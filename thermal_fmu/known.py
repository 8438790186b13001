"""The data of bodies: the least and largest temperature they began at, were held at or exchanged heat with.

Without sources no temperature leaves them, over any number of steps.  What one step leaves them by must not become a
datum of the next one, so they are remembered, and not taken from the temperatures at the start of each step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.scene import SubstepData, ThermalScene

Floats = NDArray[np.float64]
Signs = NDArray[np.int8]

# Of the range of temperatures: how far a node may leave its data.
LEAST = 1e-9
ROUND_OFF = 1e-13  # of the largest temperature


@dataclass(frozen=True)
class KnownRange:
    """low, high : (n_bodies,) [K] the data of each body so far."""

    low: Floats
    high: Floats


@dataclass(frozen=True)
class Surroundings:
    """Nodes : (n,) that exchange heat with surroundings, and the temperatures of those : (m,) [K]."""

    nodes: NDArray[np.int32]
    T: Floats


@dataclass(frozen=True)
class DataRange:
    """The data of a step.  low, high : (n,) [K] those of each node's body and of what exchanges heat with it.

    bodies : the same, of bodies.  component : (n,) a number of the bodies that exchange heat, -1 in no body.
    of_body : (n_bodies,) that of each body.  fixed : (n,) True at nodes whose temperature is prescribed: they do not
    leave what is prescribed.
    """

    low: Floats
    high: Floats
    bodies: KnownRange
    component: NDArray[np.int64]
    of_body: NDArray[np.int64]
    fixed: NDArray[np.bool_]

    def left_by(self, T: Floats) -> Signs:
        """Return (n,) 1 at nodes that are warmer at T : (n,) [K], -1 at colder ones, 0 elsewhere."""
        seen = least_seen(T)
        out = (T - self.high > seen).astype(np.int8)
        out -= self.low - T > seen
        out[self.fixed] = 0
        return out

    def after(self, T: Floats, given: Floats) -> KnownRange:
        """Return what is known after the step, which led to T : (n,) [K].

        given : (n,) what nodes are given whatever surrounds them, as by sources.  Where any is, T itself is known.
        """
        heated = np.isin(self.component, self.component[given != 0.0])
        if not heated.any():
            return self.bodies
        low, high = _by_component(self.of_body, self.component[heated], T[heated])
        return widened(self.bodies, KnownRange(low, high))


def least_seen(T: Floats) -> float:
    """Return what is no round-off of temperatures T : (n,) [K]."""
    return max(LEAST * float(np.ptp(T)), ROUND_OFF * float(np.abs(T).max()))


def range_of(scene: ThermalScene, T: Floats) -> KnownRange:
    """Return the range of T : (n,) [K] in each body."""
    bodies = np.arange(len(scene.interface.bodies))
    return KnownRange(*_by_component(bodies, scene.interface.node_body.astype(np.int64), T))


def widened(one: KnownRange, other: KnownRange) -> KnownRange:
    """Return the range of both."""
    return KnownRange(np.minimum(one.low, other.low), np.maximum(one.high, other.high))


def data_range(scene: ThermalScene, substep: SubstepData, known: KnownRange | None, T: Floats,
               around: Sequence[Surroundings]) -> DataRange:
    """Collect the data of a step.

    known : before it, None in a steady state.  T : (n,) [K] at its end, of which the prescribed ones count.
    """
    of_body = _exchanging(scene, substep)
    component = np.append(of_body, -1)[scene.interface.node_body]
    places, values = [component[scene.fixed]], [T[scene.fixed]]
    if known is not None:
        places += [of_body, of_body]
        values += [known.low, known.high]
    for one in around:
        for number in np.unique(component[one.nodes]):
            places.append(np.full(one.T.size, number))
            values.append(one.T)
    low, high = _by_component(of_body, np.concatenate(places), np.concatenate(values))
    to_node = scene.interface.node_body
    return DataRange(np.append(low, -np.inf)[to_node], np.append(high, np.inf)[to_node], KnownRange(low, high),
                     component, of_body, scene.fixed)


def _exchanging(scene: ThermalScene, substep: SubstepData) -> NDArray[np.int64]:
    """Return (n_bodies,) a number of the bodies that heat crosses between now, the same for all of them."""
    number = np.arange(len(scene.interface.bodies))
    of = scene.interface.node_body
    for nodes in (group.nodes for groups in (substep.conduction_groups, substep.radiation_groups) for group in groups):
        one, other = number[of[nodes[0, (0, 2)]]]
        number[number == other] = one
    return number


def _by_component(of_body: NDArray[np.int64], places: NDArray[np.int64], values: Floats) -> tuple[Floats, Floats]:
    """Return (n_bodies,) least and (n_bodies,) largest of values : (n,) at components : (n,), -1 at none."""
    low, high = np.full(of_body.size + 1, np.inf), np.full(of_body.size + 1, -np.inf)
    np.minimum.at(low, places, values)
    np.maximum.at(high, places, values)
    return low[of_body], high[of_body]
