"""How round a surface is to heat: arcs and their ends, but no flat edge beside a fillet and no bevel."""

from __future__ import annotations

import numpy as np
import pytest

from contact.messages import Floats, Ints
from contact.rounding import Rounding, rounding_of
from contact.surfaces import edge_frames


def chain(x: Floats, axisymmetric: bool = False) -> Rounding:
    """The Rounding of a chain of edges through points x : (n + 1, 2), the body on its left."""
    n = len(x) - 1
    at = np.arange(n, dtype=np.int32)
    edges: Ints = np.column_stack([at, at + 1]).astype(np.int32)
    previous, following = at - 1, np.where(at + 1 < n, at + 1, -1).astype(np.int32)
    length, normal = edge_frames(x, edges, previous, following)
    return rounding_of(x, edges, previous, following, axisymmetric, length, normal)


def arc(n: int, last: float = 90.0, grading: float = 1.0) -> Floats:
    steps = grading ** np.arange(n)
    angle = np.radians(last) * np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    return np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("outwards", [True, False])
@pytest.mark.parametrize("grading", [1.0, 1.1])
def test_an_arc_is_round_to_its_ends(outwards: bool, grading: float) -> None:
    """Its chords' middles lie 1 - cos(half a step) below it; its ends have the normals of the arc."""
    x = arc(16, grading=grading)
    round_ = chain(x if outwards else x[::-1])
    sag = 1.0 - np.linalg.norm(0.5 * (x[1:] + x[:-1]), axis=1)
    rise = round_.rise if outwards else -round_.rise[::-1]
    assert rise / 4.0 == pytest.approx(sag, rel=2e-3)
    n = round_.normal
    for own, wanted in ((n[0, 1], x[0]), (n[-1, 2], x[-1])) if outwards else ((n[0, 1], -x[-1]), (n[-1, 2], -x[0])):
        assert own == pytest.approx(wanted, abs=1e-9 if grading == 1.0 else 2e-5)


def test_what_ends_on_the_axis_goes_on_as_its_mirror_image() -> None:
    """Two edges are enough: without their images they have no end alike."""
    round_ = chain(arc(3), axisymmetric=True)
    assert round_.normal[-1, 2].tolist() == [0.0, 1.0]
    one = chain(np.array([[0.3, 0.9], [0.0, 1.0]]), axisymmetric=True)
    assert one.normal[0, 2].tolist() == [0.0, 1.0]
    assert one.rise[0] > 0.0


def test_a_flat_edge_beside_a_fillet_is_flat() -> None:
    """A single flat edge ten times as long as those of the fillet; its far end keeps its own normal."""
    fillet = np.array([1.0, 0.1]) + 0.1 * np.column_stack([np.sin(a := np.radians([0, 15, 30, 45, 60])), -np.cos(a)])
    round_ = chain(np.concatenate([[[0.0, 0.0]], fillet]))
    assert round_.rise[0] == 0.0
    assert round_.normal[0, 1].tolist() == [0.0, -1.0]
    assert (round_.rise[2:] > 0.0).all()


@pytest.mark.parametrize("height", [0.1, 0.12])
def test_flat_edges_between_bevels_are_flat(height: float) -> None:
    """Bevels of 45 and 50 degrees on either side of a single edge are bevels."""
    assert (chain(np.array([[0.0, height], [0.1, 0.0], [0.3, 0.0], [0.4, height]])).rise == 0.0).all()


def test_an_edge_that_turns_both_ways_is_straight() -> None:
    x = np.array([[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [3.0, 0.1]])
    assert (chain(x).rise[1:-1] == 0.0).all()
