"""Whether nodes lie close enough for what is stated over place and read at nodes alone.

A start temperature, what is prescribed, temperature or displacement, and the fit of a pair are read at nodes, with
straight lines between them.  A part of their table that is narrower than a cell is missed, or as wide as the cells
about a node: a hot strip between two rows of nodes is not there at all, and the run goes on as if nothing had been
stated.  Of a polynomial nodes read the chords.  What belongs together (all cells of a body or region, all edges of a
surface) is judged as one; in a scene about an axis each place counts with its radius.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, field_from
from contact.half.interface import Interface
from coupler.scenario.thermal_data import stated_data
from coupler.trust.checks import Check, measured

Array = NDArray[np.float64]

NAME = "data over place read at nodes"
# Of what is stated: what is seen in a curve, and what no sketch may be off by.
NOTE_AT, LIMIT = 0.02, 0.2
SAMPLES = 32  # along a side of a cell or an edge; a part that is narrower than a cell is seen down to some 1/30 of it
SMOOTH = 4  # the same where nothing but polynomials bend: what nodes miss of a parabola is seen to 1/16
AT_ONCE = 512  # cells


@dataclass(frozen=True)
class _Read:
    """where : in words.  off : what nodes say less what is stated, over what is stated above the least of it, or below
    the largest if that is less.

    narrow [m] : the narrowest part of its tables; inf where it has none.
    """

    where: str
    off: float
    narrow: float


def checks(interface: Interface, thermal: Mapping[str, Any], mechanical: Mapping[str, Any],
           fits: Mapping[str, Any] | None = None) -> tuple[Check, ...]:
    """Return the row of both halves' model.json; none where nothing bends between nodes.

    fits : pair -> its clearance or interference, as stated in SI.
    """
    specs = (*_of_heat(interface, thermal), *_of_motion(interface, mechanical), *_of_fits(interface, fits or {}))
    found = [read for where, spec, parts in specs
             if (read := _read(where, field_from(spec), parts, interface.axisymmetric)) is not None]
    if not found:
        return ()
    worst = max(found, key=lambda read: abs(read.off))
    more = "more" if worst.off > 0.0 else "less"
    return (measured(NAME, abs(worst.off), (NOTE_AT, LIMIT),
                     what=f"{worst.where} bends between nodes, which read {100.0 * abs(worst.off):.3g} % {more} of it "
                          "than is stated, above its least value or below its largest",
                     remedy="Use smaller cells there" if math.isinf(worst.narrow) else
                            f"Put nodes where its table bends, or make cells there smaller than {worst.narrow:.3g} m, "
                            "its narrowest part"),)


def _of_heat(interface: Interface, model: Mapping[str, Any]) -> Iterator[tuple[str, Any, list[Array]]]:
    """Name and form of each sum of terms, and what reads it: corners of cells or edges, (n, 2, 3 or 4, 2) [m] each."""
    kinds = (interface.quads, interface.quad_part), (interface.triangles, interface.triangle_part)
    for p, part in enumerate(interface.parts):
        body, _, region = part.partition(".")
        stated = model.get("bodies", {}).get(body, {})
        T0 = (stated | stated.get("regions", {}).get(region, {})).get("T0") if region else stated.get("T0")
        if isinstance(T0, Mapping) and "terms" in T0:
            # fault: a body of quads and triangles is judged by its quads -> own = [interface.nodes[interface.quads]] |
            #   coupler/test_trust_at_nodes
            own = [interface.nodes[cells[of == p]] for cells, of in kinds]
            yield f"T0 of {part}", T0, own
    for stated_one in stated_data(model):
        given = stated_one.given
        if (stated_one.kind == "temperature" and isinstance(given, Mapping) and "terms" in given
                and stated_one.on in interface.surfaces):
            yield f"the temperature of {stated_one.on}", given, _edges(interface, stated_one.on)


def _of_motion(interface: Interface, model: Mapping[str, Any]) -> Iterator[tuple[str, Any, list[Array]]]:
    """The same of prescribed displacements, which are read where nodes are drawn."""
    for condition in model.get("boundary", ()):
        on = condition.get("on")
        for key in ("u_x", "u_y"):
            given = condition.get(key)
            if isinstance(given, Mapping) and "terms" in given and on in interface.surfaces:
                yield f"{key} of {on}", given, _edges(interface, on)


def _of_fits(interface: Interface, fits: Mapping[str, Any]) -> Iterator[tuple[str, Any, list[Array]]]:
    """The same of fits, which are read at the nodes of the side that is searched from."""
    for pair in interface.pairs:
        # fault: what nodes miss of a fit is not told -> if False: | coupler/test_trust_at_nodes
        if pair.name in fits:
            sides = (pair.slave, pair.master) if pair.two_pass else (pair.slave,)
            yield f"the fit of pair {pair.name}", fits[pair.name], [c for on in sides for c in _edges(interface, on)]


def _edges(interface: Interface, on: str) -> list[Array]:
    return [interface.nodes[interface.surfaces[on]]]


def _read(where: str, data: Field, parts: Sequence[Array], axisymmetric: bool) -> _Read | None:
    """How far what nodes read of a field is from it; None where it bends within no cell.

    parts : (n, 2 of an edge, 3 or 4, 2) [m] each; together they read the field.  axisymmetric : x is the radius.
    """
    crossed = [data.bends_within(corners) for corners in parts]
    samples = SAMPLES if any(c.any() for c in crossed) else SMOOTH
    crossed = [c | data.is_curved for c in crossed]
    if not any(c.any() for c in crossed):
        return None
    level = np.array([signal.value[np.abs(signal.value).argmax()] for signal in data.signals])
    low, high, size, over, off = np.inf, -np.inf, 0.0, 0.0, 0.0
    for corners, bends in zip(parts, crossed, strict=True):
        if not len(corners):
            continue
        nodal, sizes, N = _values(data, level, corners), _sizes(corners), _places(corners.shape[1], samples)
        low, high = min(low, float(nodal.min())), max(high, float(nodal.max()))
        around = _around(corners, axisymmetric)
        size += float((sizes[~bends, None] * around[~bends]).sum()) / corners.shape[1]
        over += float((sizes[~bends, None] * around[~bends] * nodal[~bends]).sum()) / corners.shape[1]
        # So many at once that their places take some 10 MB.
        for some in np.array_split(np.flatnonzero(bends), max(1, math.ceil(bends.sum() / AT_ONCE))):
            at = N @ corners[some]
            stated, shares = _values(data, level, at), _shares(corners[some], N) * _around(at, axisymmetric)
            low, high = min(low, float(stated.min(initial=low))), max(high, float(stated.max(initial=high)))
            size += float(shares.sum())
            over += float((shares * stated).sum())
            off += float((shares * (nodal[some] @ N.T - stated)).sum())
    # What is stated rises from one level, or sinks from it.
    rises, sinks = over - low * size, high * size - over
    given, more = (rises, off) if rises <= sinks else (sinks, -off)
    return _Read(where, more / given if given > 0.0 else 0.0, data.narrowest)


def _around(x: Array, axisymmetric: bool) -> Array:
    """What a place x : (..., 2) [m] counts, (...,): its radius [m] in a scene about an axis, else 1."""
    # fault: a ring counts as a strip -> return np.ones(x.shape[:-1]) | coupler/test_trust_at_nodes
    return x[..., 0] if axisymmetric else np.ones(x.shape[:-1])


def _values(data: Field, level: Array, x: Array) -> Array:
    """(...,) the field with its terms at their largest, at x : (..., 2) [m]."""
    shapes = data.shapes(x.reshape(-1, 2))
    assert shapes is not None, "what is the same everywhere bends nowhere"
    return np.asarray(level @ shapes).reshape(x.shape[:-1])


def _places(corners: int, samples: int) -> Array:
    """Shape functions (m, corners) [1] at places spread over a cell or an edge, so many along a side."""
    s = (np.arange(samples) + 0.5) / samples
    if corners == 2:
        return np.stack([1.0 - s, s], axis=1)
    p, q = (a.ravel() for a in np.meshgrid(s, s, indexing="ij"))
    if corners == 3:
        # A square folded onto its half.
        p, q = np.where(p + q > 1.0, 1.0 - p, p), np.where(p + q > 1.0, 1.0 - q, q)
        return np.stack([1.0 - p - q, p, q], axis=1)
    return np.stack([(1.0 - p) * (1.0 - q), p * (1.0 - q), p * q, (1.0 - p) * q], axis=1)


def _sizes(cells: Array) -> Array:
    """(n,) [m2] or [m] of each cell or edge : (n, corners, 2) [m]."""
    if cells.shape[1] == 2:
        return np.asarray(np.linalg.norm(cells[:, 1] - cells[:, 0], axis=1))
    # Half of the product of the diagonals; of a triangle, of two of its sides.
    return np.abs(0.5 * _cross(cells[:, 2] - cells[:, 0], cells[:, -1] - cells[:, 1]))


def _shares(cells: Array, N: Array) -> Array:
    """What of each cell or edge : (n, corners, 2) [m] is about each of its places N : (m, corners), (n, m) [m2] or [m].
    """
    if cells.shape[1] != 4:
        return np.repeat(_sizes(cells)[:, None] / len(N), len(N), axis=1)
    a, b, c, d = np.moveaxis(cells, 1, 0)
    p, q = N[:, 1] + N[:, 2], N[:, 2] + N[:, 3]
    size = _cross((b - a)[:, None] * (1.0 - q)[:, None] + (c - d)[:, None] * q[:, None],
                  (d - a)[:, None] * (1.0 - p)[:, None] + (c - b)[:, None] * p[:, None])
    return np.abs(size) / len(N)


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
