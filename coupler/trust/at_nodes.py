"""Whether nodes lie close enough for what is stated over place and read at nodes alone.

A start temperature and what is prescribed, temperature or displacement, are read at nodes, with straight lines between
them.  A part of their table that is narrower than a cell is missed, or as wide as the cells about a node: a hot strip
between two rows of nodes is not there at all, and the run goes on as if nothing had been stated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, field_from
from contact.half.interface import Interface
from coupler.trust.checks import Check, measured
from coupler.trust.thermal_data import stated_data

Array = NDArray[np.float64]

NAME = "data over place read at nodes"
# Of what is stated: what is seen in a curve, and what no sketch may be off by.
NOTE_AT, LIMIT = 0.02, 0.2
SAMPLES = 32  # along a side of a cell or an edge; a part that is narrower than a cell is seen down to some 1/30 of it
AT_ONCE = 512  # cells


@dataclass(frozen=True)
class _Read:
    """where : in words.  off : what nodes say less what is stated, over what is stated above the least of it, or below
    the largest if that is less.

    narrow [m] : the narrowest part of its tables.
    """

    where: str
    off: float
    narrow: float


def checks(interface: Interface, thermal: Mapping[str, Any], mechanical: Mapping[str, Any]) -> tuple[Check, ...]:
    """Return the row of both halves' model.json; none where no table bends between nodes."""
    specs = (*_of_heat(interface, thermal), *_of_motion(interface, mechanical))
    found = [read for where, spec, corners in specs
             if (read := _read(where, field_from(spec), corners)) is not None]
    if not found:
        return ()
    worst = max(found, key=lambda read: abs(read.off))
    more = "more" if worst.off > 0.0 else "less"
    return (measured(NAME, abs(worst.off), (NOTE_AT, LIMIT),
                     what=f"{worst.where} bends between nodes, which read {100.0 * abs(worst.off):.3g} % {more} of it "
                          "than is stated, above its least value or below its largest",
                     remedy=f"Put nodes where its table bends, or make cells there smaller than {worst.narrow:.3g} m, "
                            "its narrowest part"),)


def _of_heat(interface: Interface, model: Mapping[str, Any]) -> Iterator[tuple[str, Any, Array]]:
    """Name and form of each sum of terms, and the corners of cells or edges : (n, 2, 3 or 4, 2) [m] that read it."""
    for p, part in enumerate(interface.parts):
        body, _, region = part.partition(".")
        stated = model.get("bodies", {}).get(body, {})
        T0 = (stated | stated.get("regions", {}).get(region, {})).get("T0") if region else stated.get("T0")
        if isinstance(T0, Mapping) and "terms" in T0:
            for cells, of in ((interface.quads, interface.quad_part), (interface.triangles, interface.triangle_part)):
                if (of == p).any():
                    yield f"T0 of {part}", T0, interface.nodes[cells[of == p]]
    for stated_one in stated_data(model):
        given = stated_one.given
        if (stated_one.kind == "temperature" and isinstance(given, Mapping) and "terms" in given
                and stated_one.on in interface.surfaces):
            yield f"the temperature of {stated_one.on}", given, interface.nodes[interface.surfaces[stated_one.on]]


def _of_motion(interface: Interface, model: Mapping[str, Any]) -> Iterator[tuple[str, Any, Array]]:
    """The same of prescribed displacements, which are read where nodes are drawn."""
    for condition in model.get("boundary", ()):
        on = condition.get("on")
        for key in ("u_x", "u_y"):
            given = condition.get(key)
            if isinstance(given, Mapping) and "terms" in given and on in interface.surfaces:
                yield f"{key} of {on}", given, interface.nodes[interface.surfaces[on]]


def _read(where: str, data: Field, corners: Array) -> _Read | None:
    """How far what nodes read of a field is from it; None where none of its tables bends within a cell.

    corners : (n, 2 of an edge, 3 or 4, 2) [m].
    """
    crossed = data.bends_within(corners)
    if not crossed.any():
        return None
    level = np.array([signal.value[np.abs(signal.value).argmax()] for signal in data.signals])
    nodal, size = _values(data, level, corners), _sizes(corners)
    whole = float(size[~crossed] @ nodal[~crossed].mean(axis=1))
    low, high, over, off = float(nodal.min()), float(nodal.max()), 0.0, 0.0
    N = _places(corners.shape[1])
    # So many at once that their places take some 10 MB.
    for some in np.array_split(np.flatnonzero(crossed), math.ceil(crossed.sum() / AT_ONCE)):
        stated, shares = _values(data, level, N @ corners[some]), _shares(corners[some])
        low, high = min(low, float(stated.min())), max(high, float(stated.max()))
        over += float((shares * stated).sum())
        off += float((shares * (nodal[some] @ N.T - stated)).sum())
    # What is stated rises from one level, or sinks from it.
    rises, sinks = whole + over - low * float(size.sum()), high * float(size.sum()) - whole - over
    given, more = (rises, off) if rises <= sinks else (sinks, -off)
    tables = [profile.at for term in data.terms for profile in (term.x, term.y)
              if profile is not None and profile.at is not None]
    # Of a jump, which is stated by two places side by side, the plateaus count.
    narrow = min(float((at[2:] - at[:-2]).min()) if len(at) > 2 else float(at[1] - at[0]) for at in tables)
    return _Read(where, more / given if given > 0.0 else 0.0, narrow)


def _values(data: Field, level: Array, x: Array) -> Array:
    """(...,) the field with its terms at their largest, at x : (..., 2) [m]."""
    shapes = data.shapes(x.reshape(-1, 2))
    assert shapes is not None, "what is the same everywhere bends nowhere"
    return np.asarray(level @ shapes).reshape(x.shape[:-1])


def _places(corners: int) -> Array:
    """Shape functions (m, corners) [1] at places spread over a cell or an edge."""
    s = (np.arange(SAMPLES) + 0.5) / SAMPLES
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


def _shares(cells: Array) -> Array:
    """What of each cell or edge : (n, corners, 2) [m] is about each of its places, (n, m) [m2] or [m]."""
    N = _places(cells.shape[1])
    if cells.shape[1] != 4:
        return np.repeat(_sizes(cells)[:, None] / len(N), len(N), axis=1)
    a, b, c, d = np.moveaxis(cells, 1, 0)
    p, q = N[:, 1] + N[:, 2], N[:, 2] + N[:, 3]
    size = _cross((b - a)[:, None] * (1.0 - q)[:, None] + (c - d)[:, None] * q[:, None],
                  (d - a)[:, None] * (1.0 - p)[:, None] + (c - b)[:, None] * p[:, None])
    return np.abs(size) / len(N)


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
