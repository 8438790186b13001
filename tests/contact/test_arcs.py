"""What faces what across a gap: wedges and round bodies have their closed forms, and either side finds the same."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import ask, flat, scene

from contact.messages import Facing, Floats

ROUND_OFF = 1e-12


def arc(radius: float, first: float, last: float, n: int, centre: tuple[float, float] = (0.0, 0.0),
        grading: float = 1.0) -> Floats:
    """(n + 1, 2) points [m] of an arc between two angles [degrees], each step `grading` times the one before."""
    steps = grading ** np.arange(n)
    at = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    angle = np.radians(first + (last - first) * at)
    points = np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    points[np.abs(points) < 1e-15] = 0.0
    return points


def ask_far(slave: Floats, master: Floats, axisymmetric: bool = False) -> Facing:
    """What a slave line faces within 5 m, the body on the left of either."""
    register, x = scene(slave, master, axisymmetric=axisymmetric)
    return ask(replace(register, passes=replace(register.passes, gap_max=np.array([5.0]))), x)


def either(inner: Floats, outer: Floats, axisymmetric: bool = False) -> tuple[Facing, Facing]:
    """What faces what with the inner line as the slave, and with the outer one; both run counterclockwise."""
    return ask_far(inner, outer[::-1], axisymmetric), ask_far(outer[::-1], inner, axisymmetric)


def layers(facing: Facing) -> float:
    """Sum of round areas over gaps [m]: what a gas of conductivity 1 W/mK passes by 1 K if no area changed."""
    return float((facing.area * facing.wide_s / facing.gap).sum())


@pytest.mark.parametrize("slope", [0.1, 0.5, 1.0])
def test_gaps_of_a_wedge_are_its_arcs(slope: float) -> None:
    """The lines of heat flow between the sides of a wedge are arcs about its tip: gap = r theta, areas as long."""
    theta = np.arctan(slope)
    r = np.linspace(1.0, 2.0, 6)[:, None]
    below, above = r * [1.0, 0.0], np.linspace(1.0, 2.0, 9)[:, None] * [np.cos(theta), np.sin(theta)]
    for facing in (ask_far(below[::-1], above), ask_far(above, below[::-1])):
        assert facing.area.sum() == pytest.approx(1.0, abs=ROUND_OFF)
        assert facing.area_m.sum() == pytest.approx(1.0, abs=ROUND_OFF)
        # Gauss points: the integral of 1/(r theta).
        assert layers(facing) == pytest.approx(np.log(2.0) / theta, rel=2e-4)
        assert (facing.gap > theta).all()
        assert (facing.gap < 2.0 * theta).all()


@pytest.mark.parametrize(("n", "m", "grading"), [(16, 16, 1.0), (16, 21, 1.0), (12, 16, 1.0), (16, 16, 1.1)])
@pytest.mark.parametrize("axisymmetric", [False, True])
def test_a_narrow_round_gap_is_that_of_the_arcs(n: int, m: int, grading: float, axisymmetric: bool) -> None:
    """50 and 51 mm: chords of 16 a quarter lie 60 um below their arcs, whatever faces them; also at both ends."""
    for facing in either(arc(0.05, 0, 90, n, grading=grading), arc(0.051, 0, 90, m, grading=1.0 / grading),
                         axisymmetric=axisymmetric):
        np.testing.assert_allclose(facing.gap, 1e-3, rtol=4e-3, atol=0)
        quarter = 2.0 * np.pi * 0.05**2 if axisymmetric else 0.5 * np.pi * 0.05
        inner, outer = sorted([(facing.area * facing.wide_s).sum(), (facing.area_m * facing.wide_m).sum()])
        assert inner == pytest.approx(quarter, rel=2e-5)
        assert outer == pytest.approx(quarter * (1.02**2 if axisymmetric else 1.02), rel=2e-5)
        assert facing.area.sum() < inner + outer  # its own edges, of which the films take the rest


@pytest.mark.parametrize("make", [
    lambda: (arc(1.0, -150, -30, 21), np.column_stack([np.linspace(-2.5, 2.5, 61), np.full(61, -1.02)])),
    lambda: (arc(0.1, -90, 90, 32, (0.0, 0.06)), arc(0.2, -90, 90, 40)),
    lambda: (arc(0.1, 0, 90, 16, grading=1.2), arc(0.2, 10, 80, 13)),
])
@pytest.mark.parametrize("axisymmetric", [False, True])
def test_either_side_finds_the_same(make: object, axisymmetric: bool) -> None:
    inner, outer = make()  # type: ignore[operator]
    if axisymmetric:
        inner, outer = inner + [3.0, 0.0], outer + [3.0, 0.0]
    one, other = either(inner, outer, axisymmetric=axisymmetric)
    assert one.gap.size == other.gap.size
    # The same pieces, measured on the same sides.
    np.testing.assert_allclose(np.sort(pieces(one.area)), np.sort(pieces(other.area_m)), rtol=0, atol=1e-10)
    np.testing.assert_allclose(np.sort(pieces(one.area_m)), np.sort(pieces(other.area)), rtol=0, atol=1e-10)


def pieces(area: Floats) -> Floats:
    return np.asarray(area[::2] + area[1::2])


def test_a_turned_scene_has_the_same_gaps() -> None:
    inner, outer = arc(0.1, 0, 90, 12), arc(0.2, 0, 90, 16, (0.02, 0.01))
    angle = 0.7
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for one, other in zip(either(inner, outer), either(inner @ turn + 3.0, outer @ turn + 3.0), strict=True):
        np.testing.assert_allclose(one.gap, other.gap, rtol=1e-11, atol=0)
        np.testing.assert_allclose(one.area, other.area, rtol=0, atol=1e-12)


def test_flat_parallel_sides_face_as_by_rays() -> None:
    facing = ask(*flat(5, 7, slide=0.3))
    np.testing.assert_allclose(facing.gap, 0.01, rtol=0, atol=ROUND_OFF)
    assert (facing.wide_s == 1.0).all()
    assert (facing.wide_m == 1.0).all()


def test_a_gap_closes_where_the_edges_meet() -> None:
    """A round bottom nears a plane: what its arc lies below its lowest edge never closes the gap, nor does it jump."""
    for g in (1e-3, 1e-5, 1e-8):
        below = arc(1.0, -100, -80, 1 + 2, (0.0, np.cos(np.radians(10.0 / 3.0)) + g))
        plane = np.column_stack([np.linspace(-0.5, 0.5, 8), np.zeros(8)])
        facing = ask_far(below, plane[::-1])
        assert facing.gap.min() >= g / 4.0 * (1.0 - 1e-6)
        assert facing.gap.min() <= g


def test_a_far_tilted_side_is_found() -> None:
    """What an arc reaches lies beside the edge it leaves, by the gap times half the tilt."""
    inner, outer = arc(1.0, -150, -30, 41), np.column_stack([np.linspace(-2.5, 2.5, 301), np.full(301, -1.3)])
    one, other = either(inner, outer)
    assert one.area.sum() == pytest.approx(pieces(other.area_m).sum(), rel=1e-12)
    length = 2.0 * 41 * np.sin(np.radians(120.0 / 41) / 2.0)
    assert one.area.sum() == pytest.approx(length, rel=1e-12)
