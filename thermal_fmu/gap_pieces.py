"""Pieces of contact whose gap changes so much along them that two points do not tell what crosses.

What crosses a gap goes as 1/(layer + gap), or fades between two gaps.  Where a gap opens from a hinge, most crosses in
a small part of the first edge, between its two Gauss points.  Such a piece is cut in parts with two points each: ever
smaller ones towards its narrow end, and where a law kinks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.laws import Law, gap_factor, open_conductance
from contact.quadrature import GAUSS
from thermal_fmu.contact_quadrature import ContactPoints
from thermal_fmu.problem import Exposed, Model, ThermalPair

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

# Parts are halved towards the narrow end this often at most: a layer of 1e-3 of how far a gap opens along an edge is
# integrated to 1e-4 with 11.
MOST_HALVED = 16
# What the parts of a piece may miss of what crosses it.
MISSED = 1e-4
# A gap that changes by less than this part of itself along a piece is even: of bodies that move straight, all are.
EVEN = 1e-9
# An area less negative than this, of that at the other end, is none.
NONE_AT_AXIS = 3e-3
T_LAW = 300.0  # [K] a law over temperature does not change along a piece for its gap
POINTS = np.array([0.5 - GAUSS, 0.5 + GAUSS])
NODES = np.array([0.0, *POINTS, 1.0])
CUBIC = np.linalg.inv(np.vander(NODES, increasing=True)).T  # values at NODES -> coefficients of 1, x, x^2, x^3
GRID = np.linspace(0.0, 1.0, 33)
# A gap at the end of a piece that is farther than this from a straight one, of how much it changes between its points,
# is that of something else, unless both ends are alike to this part.  Of a parabola both are, and about its end it is
# 1/6.
AS_ROUND = 0.5
NO_NARROWER = 0.02


def parted(points: ContactPoints, model: Model, by_node: Sequence[bool]) -> ContactPoints:
    """Return the points with those pieces in parts where that tells more of what crosses, the others as they are.

    by_node : of each pair, whether it has one point a node; it stays so.  Parts keep what a piece covers of either side
    and each of its shape functions.
    """
    fades = [where.ends for where in (*(f.where for f in model.films), *(r.where for r in model.radiators))
             if isinstance(where, Exposed) and where.ends is not None]
    cut: list[tuple[Rows, Floats, Floats]] = []
    for pair, laws in enumerate(model.pairs):
        if by_node[pair]:
            continue
        told = _told(laws, fades)
        if told:
            # fault: what crosses a gap that opens is told by two points an edge -> pass |
            #   thermal_fmu/test_gap_pieces
            cut += _cuts(points, pair, told)
    if not cut:
        return points
    rows = np.concatenate([rows for rows, _, _ in cut])
    kept = np.ones(points.gap.size, dtype=np.bool_)
    kept[rows] = kept[rows + 1] = False
    return _joined(points, np.flatnonzero(kept), [_Parts.of(*part) for part in cut])


# What crosses a gap

Told = tuple[Callable[[Floats], Floats], tuple[float, ...]]


def _told(laws: ThermalPair | None, fades: Sequence[tuple[float, float]]) -> list[Told]:
    """Return what of a pair depends on its gaps: functions of the gap [m], each with the gaps at which it kinks."""
    told: list[Told] = [(_fading(*ends), ends) for ends in fades]
    if laws is None:
        return told
    conduction, radiation = laws.stated.conduction, laws.stated.radiation
    if conduction is not None and conduction.open is not None:
        told.append((_conducting(conduction.open), tuple(_kinks(conduction.open))))
    if radiation is not None and radiation.gap is not None:
        told.append((_fading(*radiation.gap.ends), radiation.gap.ends))
    return told


def _fading(near: float, far: float) -> Callable[[Floats], Floats]:
    return lambda gap: gap_factor(gap, near, far)


def _conducting(law: Law) -> Callable[[Floats], Floats]:
    return lambda gap: open_conductance(law, gap, T_LAW)[0]


def _kinks(law: Law) -> list[float]:
    """Return the gaps [m] at which a law is bent."""
    if law.law == "sum":
        return [gap for part in law.of for gap in _kinks(part)]  # type: ignore[attr-defined]
    return list(law.x) if law.law == "table" and law.variable == "x" else []  # type: ignore[attr-defined]


# Parts of a piece

def _cuts(points: ContactPoints, pair: int, told: Sequence[Told]) -> list[tuple[Rows, Floats, Floats]]:
    """Return rows : (n,) of the first point of pieces to be cut, with (n, k) where [1] from the first point's end on,
    and their gaps (n, 4) [m] as of _gaps.
    """
    first = np.arange(0, points.gap.size, 2)
    apart = (points.pair[first] == pair) & (points.p[first] == 0.0) & (points.p[first + 1] == 0.0)
    if not apart.any():
        return []
    first = first[apart]
    first = first[_spread(points, first)]
    if not first.size:
        return []
    gaps = _gaps(points, first)
    # fault: even gaps are looked at as closely as others -> uneven = np.ones(first.size, dtype=np.bool_) |
    #   thermal_fmu/test_gap_pieces
    uneven = np.ptp(gaps, axis=1) > EVEN * gaps.max(axis=1)
    first, gaps = first[uneven], gaps[uneven]
    if not first.size:
        return []
    kinks = _kinks_along(gaps, sorted({gap for _, bent in told for gap in bent}))
    narrow = GRID[_along(gaps, GRID[None, :]).argmin(axis=1)]
    # Halves, and parts between kinks, tell whether it is worth while; so most pieces cost little.
    whole = np.broadcast_to([0.0, 1.0], (first.size, 2))
    needed = np.zeros(first.size, dtype=np.bool_)
    for of_gap, _ in told:
        needed |= _misses(of_gap, gaps, whole, _crosses(of_gap, gaps, _about(1, narrow, kinks)))
    first, gaps, kinks, narrow = first[needed], gaps[needed], kinks[needed], narrow[needed]
    if not first.size:
        return []
    depth = np.zeros(first.size, dtype=np.intp)
    finest = _about(MOST_HALVED, narrow, kinks)
    for of_gap, _ in told:
        right = _crosses(of_gap, gaps, finest)
        for d in range(MOST_HALVED):
            off = _misses(of_gap, gaps, _about(d, narrow, kinks), right)
            if not off.any():
                break
            depth[off] = np.maximum(depth[off], d + 1)
    return [(first[own], _about(int(d), narrow[own], kinks[own]), gaps[own])
            for d in np.unique(depth) for own in [depth == d]]


def _gaps(points: ContactPoints, first: Rows) -> Floats:
    """Return (n, 4) gaps [m] at one end of pieces, at their two points, and at the other end.

    Where a gap at an end is not known, or is that of something else that is nearer, the gap goes on straight.
    """
    a, b = points.gap[first], points.gap[first + 1]
    straight = _at(a, b, np.array([[0.0, 1.0]]))
    ends = straight if points.gap_at_end is None else np.stack([points.gap_at_end[first], points.gap_at_end[first + 1]],
                                                              axis=1)
    # fault: gaps beside round surfaces are straight along an edge -> known = np.zeros(a.size, dtype=bool) |
    #   thermal_fmu/test_gap_pieces
    known = _as_round(ends - straight, b - a)
    ends = np.maximum(np.where(known[:, None], ends, straight), 0.0)
    return np.stack([ends[:, 0], a, b, ends[:, 1]], axis=1)


def _as_round(off: Floats, change: Floats) -> NDArray[np.bool_]:
    """Whether gaps at both ends are off a straight one, (n, 2) [m], as beside a round surface: wider, and alike.

    What a node is nearer to than its piece makes its gap narrower.  change : (n,) of the gap between both points [m].
    """
    most, slack = np.abs(off).max(axis=1), AS_ROUND * np.abs(change)
    # fault: a gap that is narrowest within its piece is taken for straight -> alike = np.zeros(most.size, dtype=bool) |
    #   thermal_fmu/test_gap_pieces
    alike = np.abs(off[:, 0] - off[:, 1]) <= AS_ROUND * most
    return np.asarray((off.min(axis=1) >= -NO_NARROWER * slack) & ((most <= slack) | alike))


def _along(gaps: Floats, places: Floats) -> Floats:
    """Return (n, k) the gap [m] at places : (1 or n, k) [1] of pieces, the cubic through gaps : (n, 4)."""
    a, b, c, d = (gaps @ CUBIC)[:, :, None].transpose(1, 0, 2)
    return np.asarray(np.maximum(a + places * (b + places * (c + places * d)), 0.0))


def _kinks_along(gaps: Floats, kinks: Sequence[float]) -> Floats:
    """Return (n, 2 k) the first and last place [1] of pieces where the gap is that of each kink; 0 where it never is.
    """
    grid = _along(gaps, GRID[None, :])
    # A table may have hundreds, of which a piece meets few: where gaps are even, none.
    # fault: kinks are looked for where no gap is -> low, high = 0.0, np.inf | thermal_fmu/test_gap_pieces
    low, high = grid.min(), grid.max()
    kinks = [gap for gap in kinks if low < gap < high]
    out = np.zeros((len(gaps), 2 * len(kinks)))
    row = np.arange(len(gaps))
    # fault: pieces are not cut where laws kink -> for k, gap in (): | thermal_fmu/test_gap_pieces
    for k, gap in enumerate(kinks):
        crossed = (grid[:, :-1] - gap) * (grid[:, 1:] - gap) < 0.0
        for j, at in enumerate((crossed.argmax(axis=1), crossed.shape[1] - 1 - crossed[:, ::-1].argmax(axis=1))):
            a, b = grid[row, at], grid[row, at + 1]
            share = np.divide(gap - a, b - a, out=np.zeros(a.size), where=a != b)
            out[:, 2 * k + j] = np.where(crossed.any(axis=1), GRID[at] + share * (GRID[1] - GRID[0]), 0.0)
    return out


def _spread(points: ContactPoints, first: Rows) -> NDArray[np.bool_]:
    """Whether the areas of both points of a piece are those of one that goes on to its ends: no negative ones there.

    At the axis they are 0 there, but for what a slope of the other side makes of them.
    """
    whole = np.ones(first.size, dtype=np.bool_)
    for name in ("area", "open_area", "area_s", "area_m", "end_s", "end_m"):
        area = getattr(points, name)
        at_ends = _at(area[first], area[first + 1], np.array([[0.0, 1.0]]))
        whole &= (at_ends >= -NONE_AT_AXIS * np.abs(at_ends).max(axis=1, keepdims=True)).all(axis=1)
    return whole & (points.area[first] > 0.0) & (points.area[first + 1] > 0.0)


def _about(halved: int, narrow: Floats, kinks: Floats) -> Floats:
    """Return (n, k) increasing places from 0 to 1 between which parts lie, halved so often towards the narrowest place.

    narrow : (n,) that place [1].  kinks : (n, m) places of kinks in [0, 1].
    """
    away = 0.5 ** np.arange(halved, -1, -1)
    # fault: pieces are not halved towards where they are narrow -> away = away[-1:] | thermal_fmu/test_gap_pieces
    away = np.concatenate([-away, [0.0], away])
    places = np.clip(narrow[:, None] + away, 0.0, 1.0)
    ends = np.broadcast_to([0.0, 1.0], (len(narrow), 2))
    return np.sort(np.concatenate([places, kinks, ends], axis=1), axis=1)


def _misses(of_gap: Callable[[Floats], Floats], gaps: Floats, places: Floats, right: Floats) -> NDArray[np.bool_]:
    """Whether parts at places : (n, k) miss too much of what is right : (n,), as finer ones tell."""
    return np.asarray(np.abs(_crosses(of_gap, gaps, places) - right) > MISSED * np.abs(right))


def _crosses(of_gap: Callable[[Floats], Floats], gaps: Floats, places: Floats) -> Floats:
    """Return (n,) the mean over each piece of what depends on its gap, by two points in each part."""
    size = np.diff(places)
    at = places[:, :-1, None] + size[:, :, None] * POINTS
    gap = _along(gaps, at.reshape(len(gaps), -1)).reshape(at.shape)
    told = of_gap(gap.ravel()).reshape(gap.shape)
    return np.asarray(0.5 * (size[:, :, None] * told).sum(axis=(1, 2)))


def _at(first: Floats, second: Floats, places: Floats) -> Floats:
    """Return (n, k) at places : (1 or n, k) what is linear along pieces, (n,) at their two points."""
    return np.asarray(first[:, None] + (places - POINTS[0]) / (2.0 * GAUSS) * (second - first)[:, None])


class _Parts:
    """The points of the parts of some pieces: first row : (m,) of the piece of each, place on it : (m,), share of the
    areas that are read there : (m,) [1], and gaps : (m, 4) of the piece [m].
    """

    def __init__(self, first: Rows, place: Floats, share: Floats, gaps: Floats) -> None:
        self.first, self.place, self.share, self.gaps = first, place, share, gaps

    @classmethod
    def of(cls, first: Rows, places: Floats, gaps: Floats) -> _Parts:
        """Those of pieces : (n,) cut at places : (n, k), with gaps : (n, 4); parts without a length are none."""
        size = np.diff(places)
        at = (places[:, :-1, None] + size[:, :, None] * POINTS).ravel()
        share = np.repeat(size.ravel(), 2)
        row = np.repeat(np.arange(first.size), 2 * size.shape[1])[share > 0.0]
        return cls(first[row], at[share > 0.0], share[share > 0.0], gaps[row])

    def read(self, values: NDArray[Any], name: str) -> NDArray[Any]:
        """Return a field of ContactPoints at the points of the parts."""
        if name == "gap":
            return _along(self.gaps, self.place[:, None])[:, 0]
        a = values[self.first]
        if not np.issubdtype(values.dtype, np.floating):
            return a
        along = ((self.place - POINTS[0]) / (2.0 * GAUSS)).reshape(-1, *[1] * (values.ndim - 1))
        found = np.asarray(a + along * (values[self.first + 1] - a))
        if name.startswith(("area", "open_area", "end")):
            # fault: parts have the areas of whole pieces -> return np.maximum(found, 0.0) |
            #   thermal_fmu/test_gap_pieces
            return np.maximum(found, 0.0) * self.share
        return np.clip(found, 0.0, 1.0) if name.startswith("N_") else np.maximum(found, 0.0)


def _joined(points: ContactPoints, kept: Rows, parts: Sequence[_Parts]) -> ContactPoints:
    """Return the rows kept, then the points of the parts."""
    made: dict[str, Any] = {}
    for name in (f.name for f in fields(points)):
        values = getattr(points, name)
        if isinstance(values, np.ndarray):
            made[name] = np.concatenate([values[kept], *(part.read(values, name) for part in parts)])
    return replace(points, **made)
