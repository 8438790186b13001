"""The data of bodies: the least and largest temperature they began at, were held at or exchanged heat with.

Without sources no temperature leaves them, over any number of steps.  What one step leaves them by must not become a
datum of the next one, and what a body has cooled from is one still: so they are remembered, and not taken from the
temperatures at the start of each step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    """low, high : (n,) [K] of bodies or nodes; inf and -inf where nothing is known."""

    low: Floats
    high: Floats

    @staticmethod
    def nothing(n: int) -> KnownRange:
        """Return that of n bodies or nodes of which nothing is known."""
        return KnownRange(np.full(n, np.inf), np.full(n, -np.inf))

    def add(self, places: NDArray[np.integer], values: Floats | float) -> None:
        """Widen it by values [K] at places: one number for all, or as many."""
        if np.ndim(values) == 0:  # a tenth of the time
            self.low[places] = np.minimum(self.low[places], values)
            self.high[places] = np.maximum(self.high[places], values)
            return
        np.minimum.at(self.low, places, values)
        np.maximum.at(self.high, places, values)


@dataclass(frozen=True)
class DataRange:
    """The data of a step.  low, high : (n,) [K] those of each node's body and of what exchanges heat with it.

    bodies : the same, of bodies.  of_body : (n_bodies,) a number of the bodies that exchange heat, the same for all of
    them.  to_node : (n,) the body of each node, -1 in none.  fixed : (n,) True at nodes whose temperature is
    prescribed: they do not leave what is prescribed.
    """

    low: Floats
    high: Floats
    bodies: KnownRange
    of_body: NDArray[np.int64]
    to_node: NDArray[np.int32]
    fixed: NDArray[np.bool_]

    def left_by(self, T: Floats) -> Signs:
        """Return (n,) 1 at nodes that are warmer at T : (n,) [K], -1 at colder ones, 0 elsewhere."""
        seen = least_seen(T)
        out = (T - self.high > seen).astype(np.int8)
        out -= self.low - T > seen
        out[self.fixed] = 0
        return out

    def heated(self, T: Floats, given: Floats) -> DataRange:
        """Widen it by the temperatures T : (n,) [K] of nodes that are heated or cooled whatever surrounds them.

        given : (n,) [W] that such nodes are given.  Beside a source bodies are as warm as it is: they leave no data by
        wrong signs unless they are warmer.
        """
        if not given.any():
            return self
        component = np.append(self.of_body, -1)[self.to_node]
        # fault: what a source warms has left its data -> warm, cold = given > np.inf, given < -np.inf |
        #   thermal_fmu/test_thermal_monotone::test_bodies_beside_a_source_keep_their_conduction
        warm, cold = given > 0.0, given < 0.0
        more = widened(_by_component(self.of_body, component[warm], T[warm], T[warm]),
                       _by_component(self.of_body, component[cold], T[cold], T[cold]))
        return replace(self, low=np.minimum(self.low, np.append(more.low, np.inf)[self.to_node]),
                       high=np.maximum(self.high, np.append(more.high, -np.inf)[self.to_node]))

    def after(self, T: Floats, given: Floats) -> KnownRange:
        """Return what is known after the step, which led to T : (n,) [K].

        given : (n,) what nodes are given whatever surrounds them, as by sources.  Where any is, T itself is known.
        """
        if not given.any():
            return self.bodies
        component = np.append(self.of_body, -1)[self.to_node]
        heated = np.isin(component, component[given != 0.0])
        return widened(self.bodies, _by_component(self.of_body, component[heated], T[heated], T[heated]))


def least_seen(T: Floats) -> float:
    """Return what is no round-off of temperatures T : (n,) [K]."""
    return max(LEAST * float(np.ptp(T)), ROUND_OFF * float(np.abs(T).max()))


def range_of(scene: ThermalScene, T: Floats) -> KnownRange:
    """Return the range of T : (n,) [K] in each body."""
    return _by_component(np.arange(len(scene.interface.bodies)), scene.interface.node_body, T, T)


def widened(one: KnownRange, other: KnownRange) -> KnownRange:
    """Return the range of both."""
    return KnownRange(np.minimum(one.low, other.low), np.maximum(one.high, other.high))


def data_range(scene: ThermalScene, substep: SubstepData, known: KnownRange, around: KnownRange) -> DataRange:
    """Collect the data of a step.

    known : those of bodies before it.  around : of bodies, and of nodes of none, what they are held at or exchange heat
    with beside bodies.
    """
    of_body, to_node = _exchanging(scene, substep), scene.interface.node_body
    # fault: what a body was is no datum of it -> own = KnownRange(around.low[:-1], around.high[:-1]) |
    #   thermal_fmu/test_thermal_monotone
    own = widened(KnownRange(around.low[:-1], around.high[:-1]), known)
    bodies = _by_component(of_body, of_body, own.low, own.high)
    return DataRange(np.append(bodies.low, -np.inf)[to_node], np.append(bodies.high, np.inf)[to_node], bodies,
                     of_body, to_node, scene.fixed)


def _exchanging(scene: ThermalScene, substep: SubstepData) -> NDArray[np.int64]:
    """Return (n_bodies,) a number of the bodies that heat crosses between now, the same for all of them."""
    number = np.arange(len(scene.interface.bodies))
    of = scene.interface.node_body
    for nodes in (group.nodes for groups in (substep.conduction_groups, substep.radiation_groups) for group in groups):
        one, other = number[of[nodes[0, (0, 2)]]]
        # fault: bodies that exchange heat keep their own data -> number[number == other] = other |
        #   thermal_fmu/test_thermal_monotone
        number[number == other] = one
    return number


def _by_component(of_body: NDArray[np.integer], places: NDArray[np.integer], low: Floats, high: Floats) -> KnownRange:
    """Return for each body the range of low, high : (n,) at components : (n,), -1 at none."""
    out = KnownRange.nothing(of_body.size + 1)
    np.minimum.at(out.low, places, low)
    np.maximum.at(out.high, places, high)
    return KnownRange(out.low[of_body], out.high[of_body])
