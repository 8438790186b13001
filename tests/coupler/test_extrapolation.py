"""How x and t_N are drawn on: exact on lines and parabolas, what is seen of a zigzag, and where that lies between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupler.schemes.levels import Level, alternating_gain, closest, extrapolated_slope, geometry_at, weights

UNEVEN = [3.0, 2.0, 0.5]


def level(t: float, x: float, t_N: float = 0.0) -> Level:
    return Level(t, np.array([900.0]), np.array([[0.0, x]]), np.array([t_N]), np.zeros(1), np.zeros(1))


def drawn(values: list[float], times: list[float], end: float, curve: float) -> float:
    """x at the middle of the window, as the thermal half is given it."""
    now, *past = (level(t, v) for t, v in zip(times, values, strict=True))
    return float(geometry_at(now, extrapolated_slope(now, past, end, curve), 0.5 * (now.t + end))[0][0, 1])


@pytest.mark.parametrize("curve", [-1.0, -0.4, 0.0, 0.3, 1.0])
def test_a_line_is_extrapolated_slope_as_it_is(curve):
    assert drawn([3.0 * t - 1.0 for t in UNEVEN], UNEVEN, 4.6, curve) == pytest.approx(3.0 * 3.8 - 1.0, rel=1e-14)


def test_a_parabola_is_met_by_the_closest_and_missed_by_the_others_as_told():
    assert drawn([t * t for t in UNEVEN], UNEVEN, 4.6, 1.0) == pytest.approx(3.8**2, rel=1e-13)
    even = [2.0, 1.0, 0.0]
    missed = [2.5**2 - drawn([t * t for t in even], even, 3.0, curve) for curve in (-1.0, 0.0, 1.0)]
    assert missed == pytest.approx([2 * 0.625, 2 * 0.375, 0.0], abs=1e-13)


def test_what_is_seen_of_a_zigzag():
    even = [2.0, 1.0, 0.0]
    gains = [alternating_gain(even, 3.0, c) for c in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    assert gains == pytest.approx([1.0, 1.5, 2.0, 2.75, 3.5])
    assert drawn([1.0, -1.0, 1.0], even, 3.0, 0.5) == pytest.approx(2.75)
    assert alternating_gain(UNEVEN, 4.6, -1.0) == pytest.approx(1.0)
    assert [alternating_gain(UNEVEN[:n], 4.6, 1.0) for n in (1, 2)] == pytest.approx([1.0, 1.0 + 2 * 0.8])


def test_the_closest_that_sees_no_more():
    for most in (1.0, 1.3, 2.7):
        curve = closest(UNEVEN, 4.6, most)
        assert curve is not None
        assert alternating_gain(UNEVEN, 4.6, curve) == pytest.approx(most)
    assert closest(UNEVEN, 4.6, 0.99) is None
    assert closest(UNEVEN, 4.6, 99.0) == 1.0
    assert closest(UNEVEN[:2], 4.6, 99.0) == 0.0
    between = closest(UNEVEN[:2], 4.6, 2.5)
    assert between is not None
    assert -1.0 < between < 0.0, "between the line and what is now, held"
    assert alternating_gain(UNEVEN[:2], 4.6, between) == pytest.approx(2.5)
    assert weights(UNEVEN[:2], 4.6, -1.0) == (1.0, 0.0)
    assert closest(UNEVEN[:2], 4.6, 0.99) is None
    assert sum(weights(UNEVEN, 4.6, -0.3)) == pytest.approx(1.0)


def test_with_less_behind_it_is_the_line_or_nothing_and_a_tension_is_open():
    a, b, c = level(2.0, 1.0, -1.0), level(1.0, 0.5, -4.0), level(0.0, 3.0, -9.0)
    assert extrapolated_slope(a, (), 3.0, 1.0) is None
    assert extrapolated_slope(a, (b,), 3.0, 1.0) == (b, a)
    assert extrapolated_slope(a, (b, c), 3.0, 0.0) == (b, a)
    seen = [geometry_at(a, extrapolated_slope(a, (b, c), 3.0, curve), 2.5)[1].tolist() for curve in (1.0, 0.2)]
    assert seen == [[-0.25], [0.0]]
    pressed = replace(a, t_N=np.array([-5.0]))
    assert geometry_at(pressed, extrapolated_slope(pressed, (b, c), 3.0, -1.0), 2.5)[1].tolist() == [-4.0]
