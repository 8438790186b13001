"""Prescribed displacements from few numbers: the levels of signals, of which fields and turns make targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Signal
from contact.half.model import Values
from contact.half.prescribed import Turn
from mechanical_fmu.loads import driven, driven_slope
from mechanical_fmu.problem import Displacement

Floats = NDArray[np.float64]

# Between the times of two levels everything goes along a straight line in the levels: a displacement goes straight, a
# turn along its arc.  So pieces of a step, substeps and rollbacks need the levels alone.


@dataclass(frozen=True)
class Placed:
    """A displacement that varies over place, or turns.

    rows : (k,) of the fixed components it has.  component : (k,) of each.  X : (k, 2) [m], the node of each.
    shapes : by component, (n_levels, k): what the levels make of the displacement before the turn.
    angle : which level is the turn's angle, -1 without one.
    """

    rows: NDArray[np.intp]
    component: NDArray[np.intp]
    X: Floats
    shapes: tuple[Floats, Floats]
    turn: Turn | None
    angle: int


@dataclass(frozen=True)
class Motions:
    """How the prescribed displacements follow from levels.

    displacements : a component each.  column : (n_fixed,) which level a component has, the last (0) where it is still
    or has a Placed.  size : of the levels.
    scale : (n_displacements,) 1, or the length that turns an angle into a reference row's displacement.
    """

    displacements: tuple[Displacement, ...]
    scale: tuple[float, ...]
    column: NDArray[np.intp]
    placed: tuple[Placed, ...]

    def levels(self, t: float, side: int, inputs: Values) -> Floats:
        """Compute (n_levels,), numbers in m and rad, at time t [s], from the given side of a jump."""
        return self._by_signal(driven, Signal.at, 1.0, t, side, inputs)

    def slopes(self, t: float, side: int, inputs: Values) -> Floats:
        """Compute (n_levels,) slopes of the levels, m/s and rad/s, at time t [s], before or behind a kink."""
        return self._by_signal(driven_slope, Signal.slope, 0.0, t, side, inputs)

    def _by_signal(self, whole: Callable[[Signal, str, float, int, Values], float],
                   of: Callable[[Signal, float, int], float], shifts: float, t: float, side: int,
                   inputs: Values) -> Floats:
        """What is asked of all signals, whole : with factor and shift of their condition, of : alone.

        shifts : the share of a shift that counts in it, 1 or 0.
        """
        numbers: list[float] = []
        for d, length in zip(self.displacements, self.scale, strict=True):
            if _is_plain(d):
                numbers.append(whole(d.value.terms[0].t, d.name, t, side, inputs) * length)
            else:
                factor, shift = (1.0, 0.0) if not d.name else (float(inputs[f"load.{d.name}"]),
                                                               float(inputs[f"bc.{d.name}"]))
                numbers += [*(of(s, t, side) * factor for s in d.value.signals), shifts * shift]
            if d.turn is not None:
                numbers.append(whole(d.turn.angle, d.turn.name, t, side, inputs))
        return np.array([*numbers, 0.0])

    def target(self, levels: Floats) -> Floats:
        """Compute (n_fixed,) prescribed displacements [m] of levels : (n_levels,)."""
        target = levels[self.column]
        for p in self.placed:
            u = np.stack([levels @ shape for shape in p.shapes], axis=1)
            if p.turn is not None:
                u = p.turn.displaced(p.X, u, float(levels[p.angle]))
            target[p.rows] = u[np.arange(len(p.rows)), p.component]
        return target


def motions_of(displacements: Sequence[Displacement], source: NDArray[np.intp], fixed: NDArray[np.intp],
               scale: Sequence[float], nodes: Floats) -> Motions:
    """Collect how prescribed components move.

    source : (n_fixed,) which displacement has a component, -1 for a plain 0.  fixed : (n_fixed,) degrees of freedom.
    nodes : (n, 2) [m] of the reference, reference rows of rigid bodies too.
    """
    starts = np.cumsum([0, *(_count(d) for d in displacements)])
    n_levels = int(starts[-1]) + 1
    column = np.where(source >= 0, starts[source], n_levels - 1).astype(np.intp)
    placed = []
    for i, d in enumerate(displacements):
        if _is_plain(d) and d.turn is None:
            continue
        rows = np.flatnonzero(source == i)
        column[rows] = n_levels - 1
        X = nodes[fixed[rows] // 2]
        # A turn needs both components before it: those of its entry, which stand side by side.
        shapes = [np.zeros((n_levels, len(rows))) for _ in range(2)]
        for j in (range(len(displacements)) if d.turn is not None else (i,)):
            other = displacements[j]
            if other.turn is d.turn and other.component < 2:
                shapes[other.component] += _shape(other, int(starts[j]), n_levels, X)
        placed.append(Placed(rows, fixed[rows] % 2, X, (shapes[0], shapes[1]), d.turn, int(starts[i + 1]) - 1))
    return Motions(tuple(displacements), tuple(scale), column, tuple(placed))


def _count(d: Displacement) -> int:
    """How many levels a displacement has: of its terms, what is added to their sum, and the angle."""
    return (1 if _is_plain(d) else len(d.value.terms) + 1) + (d.turn is not None)


def _is_plain(d: Displacement) -> bool:
    """Whether its value is one signal."""
    return d.value.is_uniform and len(d.value.terms) == 1


def _shape(d: Displacement, first: int, n_levels: int, X: Floats) -> Floats:
    """(n_levels, k) what each level makes of a displacement at X : (k, 2) [m]."""
    out = np.zeros((n_levels, len(X)))
    # fault: a field of displacements at one place for all -> shapes = d.value.shapes(0.0 * X + X.mean(axis=0)) |
    #   mechanical_fmu/test_motions
    shapes = d.value.shapes(X)
    n = _count(d) - (d.turn is not None)
    # What is added, and terms that are the same everywhere, count as they are.
    out[first : first + n] = 1.0
    if shapes is not None:
        out[first : first + len(shapes)] = shapes
    return out
