"""What the levels of a window tell of each quantity: its size, its differences, how far two answers are apart.

levels : of the end of the window, of its start, and of ends before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from coupler.control.body_strain import NO_CELLS, BodyCells
from coupler.control.unannounced import WHOLLY
from coupler.schemes.levels import Level
from coupler.schemes.schemes import scheme_of
from coupler.schemes.state import ELASTIC_STRAIN, Solved

Array = NDArray[np.float64]

# fault: near radiation is no heat between bodies -> HEAT = ("heat.contact.slave", "heat.gap.slave") |
#   coupler/test_sliding_off
HEAT = ("heat.contact.slave", "heat.gap.slave", "heat.near_radiation.slave")
FRICTION = ("heat.friction.slave", "heat.friction.master")
QUANTITIES = ("temperature", "gap", "heat", "displacement", ELASTIC_STRAIN)


def quantity_of(name: str) -> str:
    """Return the quantity of a name in an estimate: elastic_strain of elastic_strain.BODY."""
    return name.partition(".")[0]


def scale(name: str, levels: Sequence[Level], solved: Solved, cells: BodyCells) -> float:
    """Return what the relative part of a tolerance is measured by (coupler.scenario.options)."""
    now, start = levels[0], levels[1]
    if name == "temperature":
        return max(float(now.T.max()), float(start.T.max())) - min(float(now.T.min()), float(start.T.min()))
    if name == "heat":
        # What rubs warms both bodies, and little of that crosses from one to the other.
        # fault: heat that crosses is held against itself alone where surfaces rub -> return abs(heat_of(solved) or
        #   0.0) | coupler/test_estimate
        return abs(heat_of(solved) or 0.0) + abs(sum_of(FRICTION, solved) or 0.0)
    if name in cells.names:
        return max(size_of(name, values_of(name, level, levels, cells)) for level in (now, start))
    return largest(values_of(name, now, levels, cells) - values_of(name, start, levels, cells))


def second_differences(levels: Sequence[Level], rate: float, solved: Solved,
                       cells: BodyCells = NO_CELLS) -> dict[str, float]:
    """Return quantity -> max |H^2 v''|; 0 where there are two levels; what the scene does not have is left out.

    rate : heat through contact in the window before [W]; nan: not known.
    """
    t = [level.t for level in levels]
    H, heat = t[0] - t[1], heat_of(solved)
    found = {n: 0.0 for n in ("temperature", "gap", "displacement") if n != "gap" or faced(levels).any()}
    if heat is not None:
        found["heat"] = 0.0
    if levels[0].elastic_strain is not None:
        # fault: no window tolerance sees stress -> pass |
        #   coupler/test_estimate_strain::test_stress_that_relaxes_is_as_exact_as_its_tolerance
        found |= dict.fromkeys(cells.names, 0.0)
    if len(levels) < 3:
        return found
    # fault: second differences as if all windows were alike -> weight = H | coupler/test_estimate
    weight = 2.0 * H * H / (t[0] - t[2])
    for name in found:
        if name == "heat":
            found[name] = 0.0 if heat is None or math.isnan(rate) else weight * abs(heat / H - rate)
            continue
        a, b, c = (values_of(name, level, levels, cells) for level in levels[:3])
        found[name] = weight * size_of(name, (a - b) / H - (b - c) / (t[1] - t[2]))
    return found


def third_difference(levels: Sequence[Level]) -> float:
    """Return max |H^3 T'''|; where there are three levels the second difference stands for it; 0 of two."""
    t, T = [level.t for level in levels[:4]], [level.T for level in levels[:4]]
    n = len(t)
    if n < 3:
        return 0.0
    for k in range(1, n):
        T = [(T[i] - T[i + 1]) / (t[i] - t[i + k]) for i in range(n - k)]
    return math.factorial(n - 1) * (t[0] - t[1]) ** (n - 1) * largest(T[0])


def apart(levels: Sequence[Level], solved: Solved, whole: Solved, names: Iterable[str], cells: BodyCells
          ) -> dict[str, float]:
    """Return quantity -> how far the answers of the whole window and of its two halves are apart.

    Where mechanics see the T of the start, x is late by the window, and that of the halves by half of it.  That would
    be told as an error of every window, while what is late is late once: the window in one is taken as late as its
    halves, at the rate of the window before.
    """
    a, b = solved.state.now, whole.state.now
    both, told = (a, b), {}
    late = scheme_of(solved.scheme).sees_start_T and len(levels) > 2
    for n in names:
        if n == "heat":
            continue
        distance = values_of(n, a, both, cells) - values_of(n, b, both, cells)
        # fault: x that comes a window late is an error of every window -> if False: | coupler/test_estimate
        if late and n in ("gap", "displacement"):
            now, start, before = levels[:3]
            distance -= 0.5 * (now.t - start.t) / (start.t - before.t) * (values_of(n, start, both, cells)
                                                                      - values_of(n, before, both, cells))
        told[n] = size_of(n, distance)
    heat, other = heat_of(solved), heat_of(whole)
    if heat is not None and other is not None:
        told["heat"] = abs(heat - other)
    return told


def values_of(name: str, level: Level, levels: Sequence[Level], cells: BodyCells) -> Array:
    """Return a quantity at a level, (n,) in SI; gaps : of nodes faced at all levels."""
    if name == "temperature":
        return level.T
    if name in cells.names:
        assert level.elastic_strain is not None, "a half that tells it tells it at every level"
        return cells.weighted(name, level.elastic_strain)
    return level.x if name == "displacement" else level.gap[faced(levels)]


def faced(levels: Sequence[Level]) -> NDArray[np.bool_]:
    """Return the surface nodes wholly faced at the last three levels: a gap that begins or ends is no error of it."""
    known = np.isfinite(levels[0].gap)
    for level in levels[:3]:
        # fault: a gap that begins counts as an error of it -> known &= level.covered > -1.0 | coupler/test_estimate
        known &= level.covered > WHOLLY
    return known


def heat_of(solved: Solved) -> float | None:
    """Return the energy through contact in the window [J]; None where the scene has none."""
    return sum_of(HEAT, solved)


def sum_of(terms: Sequence[str], solved: Solved) -> float | None:
    """Return the energy of some heat terms in the window [J]; None where the scene has none of them."""
    names = [n for n in terms if solved.terms and n in solved.terms[0]]
    return sum(told[n] for told in solved.terms for n in names) if names else None


def size_of(name: str, values: Array) -> float:
    """Return the size of values: of elastic strain the root mean square over a body, of anything else the largest."""
    return float(np.linalg.norm(values)) if quantity_of(name) == ELASTIC_STRAIN else largest(values)


def largest(values: Array) -> float:
    """Return the largest of values : (n,), whatever its sign."""
    return float(np.abs(values).max(initial=0.0))
