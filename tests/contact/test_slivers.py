"""What is told of a node that faces next to nothing: no pressure of its own, whatever the scene."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, passes, push, scene

from contact.messages import Floats, Tractions
from contact.nodal import LEAST_PART, SLIVER

DEEP = 1e-6  # [m] by which the sides overlap: EPS DEEP presses everywhere
P = EPS * DEEP
CELLS = [0.5, 0.25, 0.125, 0.125]  # [m] of the slave, its end first


def beside(over: float, cells: list[float] = CELLS, *, turn: float = 0.0, mu: float = 0.0, tilt: float = 0.0,
           backwards: bool = False, two_pass: bool = False) -> Tractions:
    """Push a slave, above, whose first `over` [m] lie on a plate that ends there, or all of it and more.

    turn : angle of the scene.  tilt : slope of the slave, deeper towards the end of the plate.
    """
    s = np.concatenate([[0.0], np.cumsum(cells)])
    slave = np.column_stack([s, -DEEP - tilt * s])
    plate = np.array([[over, 0.0], [over - 1.0, 0.0], [over - 2.0, 0.0]])
    if backwards:
        slave, plate = slave[::-1] * [-1.0, 1.0], plate[::-1] * [-1.0, 1.0]
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    register, x = scene(slave @ R.T, plate @ R.T)
    sides = ((0, 1), (1, 0)) if two_pass else ((0, 1),)
    register = replace(register, passes=passes(*sides, weight=1.0 / len(sides), mu=mu))
    # The slave comes from the left: what rubs slips.
    before = x - (np.array([0.2, 0.0]) @ R.T) * (np.arange(len(x)) < len(s))[:, None] if mu else x
    return push(register, x, None, before) if mu else push(register, x)


def own(told: Tractions, n: int = len(CELLS) + 1) -> Floats:
    """(n,) [Pa] the mean pressure of each slave node over what it faces."""
    return -told.multipliers[:n]


def test_a_node_that_faces_enough_is_told_as_it_is():
    for over in np.linspace(0.05, 1.2, 40):
        told = beside(float(over), tilt=2.0 * DEEP)
        enough = told.node_covered[:5] >= SLIVER
        np.testing.assert_array_equal(-told.t_N[:5][enough], own(told)[enough])


@pytest.mark.parametrize("two_pass", [False, True])
@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_an_even_pressure_stays_even(turn, two_pass):
    """However much of the last node is covered, where the next has at least an edge of its own."""
    for over in 0.5 + np.geomspace(1e-6, 0.2, 30):
        told = beside(float(over), turn=turn, two_pass=two_pass)
        pressed = told.t_N[:5] < 0.0
        np.testing.assert_allclose(-told.t_N[:5][pressed], P, rtol=1e-6)
        assert pressed.sum() == 3


@pytest.mark.parametrize("over", [1e-5, 1e-4, 1e-3])
def test_contact_about_to_end_has_no_pressure_without_bound(over):
    """A line of force on next to nothing: told over a part of what the node stands for."""
    told = beside(over)
    high = beside(over, tilt=-0.9 * DEEP / over)  # the same, most at the corner
    for reply in (told, high):
        force = -(reply.multipliers[:5] * reply.node_covered[:5] * 0.25).sum()
        assert 0.0 < -reply.t_N[0] <= 1.1 * force / (LEAST_PART * 0.25)
        assert -reply.t_N.min() < 0.1 * P


@pytest.mark.few("first")
@pytest.mark.parametrize("places", [np.linspace(1e-4, 0.02, 1001), np.linspace(0.5, 0.6, 501)], ids=["first", "second"])
def test_nothing_jumps_while_a_body_slides_off(places):
    """Of nodes that face something: what faces nothing has nothing.  places : near the first, or the second node."""
    told = np.array([beside(float(w), tilt=0.5 * DEEP).t_N[:5] for w in places])
    steps, pressed = np.abs(np.diff(told, axis=0)), (told[1:] < 0.0) & (told[:-1] < 0.0)
    assert steps[pressed].max() < 0.02 * P


def test_a_sliver_is_told_no_more_than_it_has():
    """Pressure that falls towards the end of the plate, to nothing: the neighbour's mean is more."""
    told = beside(0.51, tilt=-0.99 * DEEP / 0.51)
    sliver = int(np.flatnonzero((told.node_covered[:5] > 0.0) & (told.node_covered[:5] < SLIVER))[0])
    assert 0.0 < -told.t_N[sliver] <= own(told)[sliver]


def test_numbers_and_handedness_do_not_matter():
    for over in (1e-4, 0.02, 0.51):
        there, back = beside(over, tilt=2.0 * DEEP), beside(over, tilt=2.0 * DEEP, backwards=True)
        np.testing.assert_allclose(back.t_N[:5][::-1], there.t_N[:5], rtol=1e-9, atol=1e-6)


def test_forces_and_multipliers_know_nothing_of_it():
    told = beside(0.02, tilt=30.0 * DEEP)
    weight = told.node_covered[:5] * np.array([0.25, 0.375, 0.1875, 0.125, 0.0625])
    assert told.force[:5, 1].sum() == pytest.approx((own(told) * weight).sum(), rel=1e-2)
    assert own(told)[1] > -1.001 * told.t_N[1]


def test_shear_goes_with_its_pressure():
    mu = 0.3
    for over in (1e-3, 0.05, 0.52):
        told = beside(over, tilt=2.0 * DEEP, mu=mu)
        pressed = told.t_N[:5] < 0.0
        np.testing.assert_allclose(np.abs(told.shear[:5][pressed]), -mu * told.t_N[:5][pressed], rtol=1e-9)


@pytest.mark.slow
def test_what_is_told_otherwise_vanishes_with_the_mesh():
    """The width at the end of the plate in which a node is told otherwise: a share of an edge."""
    widths = []
    for n in (4, 8, 16):
        h = 1.0 / n
        over = np.linspace(0.3, 0.3 + h, 201)[1:]
        other = [bool((np.abs(told.t_N[:n + 1] - told.multipliers[:n + 1]) > 1e-9 * P).any())
                 for told in (beside(float(w), [h] * n, tilt=2.0 * DEEP) for w in over)]
        widths.append(np.mean(other) * h)
    assert widths[0] > 0.0
    assert widths[1] == pytest.approx(0.5 * widths[0], rel=0.1)
    assert widths[2] == pytest.approx(0.25 * widths[0], rel=0.1)
