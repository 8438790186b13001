"""Stress at nodes, fitted to the means of cells: exact where it is of second order in place, in any frame."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix

sys.path.insert(0, str(Path(__file__).parent.parent / "coupler"))
from mesh_scenes import rectangles, turned

from contact.half.interface import Interface
from contact.half.nodal_stress import LINEAR, QUADRATIC, _fitted, nodal_stress, von_mises

CELLS = {"low": (6, 4), "up": (5, 3)}
AT = {2: lambda x, y: 3.0 + x - 2.0 * y + 0.5 * x * x - x * y + 2.0 * y * y, 1: lambda x, y: 3.0 + x - 2.0 * y}


def middles(interface):
    """(n_cells, 2) [m]."""
    return np.concatenate([interface.nodes[of].mean(axis=1) for of in (interface.quads, interface.triangles)])


def fitted(interface, values, fits=None):
    """How far the fit is from `values` at its nodes, where their means at the middles of cells are given."""
    fit = nodal_stress(interface) if fits is None else nodal_stress(interface, fits)
    assert fit.known.all()
    return fit.fit @ values(*middles(interface).T) - values(*interface.nodes[fit.node].T)


@pytest.mark.parametrize("grading", [(1.0, 1.0), (5.0, 0.3)])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_field_of_second_order_is_fitted_as_it_is(grading, angle):
    interface = turned(rectangles(CELLS, grading=grading), angle, (3.0, -2.0))
    assert np.abs(fitted(interface, AT[2])).max() < 1e-8
    assert np.abs(fitted(interface, AT[1], LINEAR)).max() < 1e-9
    assert np.abs(fitted(interface, AT[2], LINEAR)).max() > 1e-3


def test_triangles_are_read_in_the_middle_of_their_edges():
    """A triangle is off by something of one sign, its neighbour by the other: where they meet it is nothing."""
    interface = rectangles(CELLS, triangles=("low", "up"))
    fit, x = nodal_stress(interface), middles(interface)
    y = interface.nodes[interface.triangles][..., 1]
    up = np.where(y.mean(axis=1) < 0.5 * (y.min(axis=1) + y.max(axis=1)), 1.0, -1.0)
    assert up.sum() == 0.0
    told = fit.fit @ (AT[1](*x.T) + 0.1 * up) - AT[1](*interface.nodes[fit.node].T)
    assert np.abs(told).max() < 1e-8


def test_two_rows_of_cells_tell_curvature_along_them():
    interface = rectangles({"low": (6, 2), "up": (2, 5)})
    for values, exact in ((lambda x, y: 1.0 + x + y + 2.0 * x * x, True), (lambda x, y: y * y, False)):
        off = np.abs(fitted(interface, values)[interface.node_body[nodal_stress(interface).node] == 0]).max()
        assert (off < 1e-4) == exact


def test_one_row_of_cells_does_not_tell_what_is_across():
    fit = nodal_stress(rectangles({"low": (6, 1), "up": (5, 3)}))
    in_row = fit.part == 0
    assert not fit.known[in_row].any()
    assert fit.known[~in_row].all()
    # What stands in is the mean of the cells around.
    assert np.asarray(fit.fit.sum(axis=1)).ravel() == pytest.approx(1.0)


def hole(around, layers=4, depth=3.0, turn=0.3):
    """A quarter of a plate around a hole of radius 1 m, layers each as much thicker; and the centres of its curve."""
    angle = turn + np.linspace(0.0, np.pi / 2, around + 1)
    r = 1.0 + depth * np.linspace(0.0, 1.0, layers + 1) ** 1.5
    nodes = (r[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)).reshape(-1, 2)
    k = (np.arange(layers)[:, None] * (around + 1) + np.arange(around)).ravel()
    quads = np.stack([k, k + around + 1, k + around + 2, k + 1], axis=1).astype(np.int32)
    centres = np.full_like(nodes, np.nan)
    centres[:around + 1] = 0.0
    return Interface("plane", nodes, quads, np.empty((0, 3), np.int32), np.zeros(len(quads), np.int32),
                     np.empty(0, np.int32), ("b",), ("m",), {}), centres


def around_a_hole(X, pressed):
    """(n, 4) stress of a thick tube without an outer wall (Lame), or of a plate that is pulled along x (Kirsch)."""
    r, angle = np.hypot(*X.T), np.arctan2(X[:, 1], X[:, 0])
    s2, s4 = r**-2.0, r**-4.0
    if pressed:
        radial, hoop, shear = -s2, s2, 0.0 * r
    else:
        c, s = np.cos(2.0 * angle), np.sin(2.0 * angle)
        radial = 0.5 * (1.0 - s2) + 0.5 * (1.0 - 4.0 * s2 + 3.0 * s4) * c
        hoop, shear = 0.5 * (1.0 + s2) - 0.5 * (1.0 + 3.0 * s4) * c, -0.5 * (1.0 + 2.0 * s2 - 3.0 * s4) * s
    half = (0.5 * (radial - hoop) + 1j * shear) * np.exp(2j * angle)
    mean = 0.5 * (radial + hoop)
    return np.stack([mean + half.real, mean - half.real, half.imag, 0.3 * (radial + hoop)], axis=1)


def test_stress_around_a_hole_is_known_with_cells_as_large_as_that():
    """Six quads a quarter, the middle of the first 0.19 radii deep: of Lame's 1 and Kirsch's 3 on the whole edge."""
    (interface, centres), off = hole(6), {}
    at = middles(interface)
    for way in ("lame", "kirsch"):
        exact = around_a_hole(interface.nodes, way == "lame")
        for known in (False, True):
            for fits in (LINEAR, QUADRATIC):
                fit = nodal_stress(interface, fits, centres if known else None)
                edge = np.isfinite(centres[fit.node]).all(axis=1) & fit.known
                told = fit.of(around_a_hole(at, way == "lame"))
                off[way, known, fits is LINEAR] = np.abs(told - exact[fit.node])[edge].max()
    assert off["lame", True, True] < 1e-9 < 0.3 < off["lame", False, True]
    assert off["lame", True, False] < 1e-9 < 0.3 < off["lame", False, False]
    assert off["kirsch", True, False] < 0.3 < 0.7 < off["kirsch", False, False]


@pytest.mark.parametrize("order", [1, 2])
def test_along_one_row_of_cells_a_field_is_fitted_as_it_is(order):
    angle = 0.7
    interface = turned(rectangles({"low": (6, 1), "up": (5, 3)}, grading=(3.0, 1.0)), angle, (3.0, -2.0))
    fit = nodal_stress(interface, rows=order)
    in_row = fit.part == 0
    assert (fit.along == in_row).all()
    assert not fit.known[in_row].any()

    def along(x):
        s = x @ [np.cos(angle), np.sin(angle)]
        return 1.0 + 2.0 * s + (3.0 * s * s if order == 2 else 0.0)

    told, there = fit.fit @ along(middles(interface)), along(interface.nodes[fit.node])
    assert told[in_row] == pytest.approx(there[in_row], abs=1e-9)


def test_along_a_row_that_bends_nothing_is_fitted():
    interface = rectangles({"low": (6, 1), "up": (5, 3)})
    x, y = interface.nodes.T
    bent = replace(interface, nodes=np.stack([x, y + x * x], axis=1))
    assert not nodal_stress(bent, rows=2).along.any()


@pytest.mark.parametrize("turn", [0.1, 1.5, 4.0])
@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("fits", [LINEAR, QUADRATIC])
def test_a_row_that_bends_tells_no_more_of_what_is_across_than_a_straight_one(turn, rows, triangles, fits):
    """Its middles lie on an arc, not on a line, and a field was fitted to how high that is; two rows tell it."""
    interface = rectangles({"low": (12, rows), "up": (5, 3)}, triangles=("low",) if triangles else ())
    x, y = interface.nodes.T
    of_low = np.unique(np.concatenate([interface.quads[interface.quad_body == 0].ravel(),
                                       interface.triangles[interface.triangle_body == 0].ravel()]))
    length = np.ptp(x[of_low])
    angle, r = turn * (x - x[of_low].min()) / length, length / turn + y - y[of_low].max()
    low = np.isin(np.arange(len(x)), of_low)
    bent = np.where(low[:, None], np.stack([r * np.sin(angle), r * np.cos(angle)], axis=1), interface.nodes)
    fit = nodal_stress(replace(interface, nodes=bent), fits)
    assert fit.known[fit.part == 0].any() == (rows == 2)
    assert fit.known[fit.part == 1].all()


def test_what_places_are_off_by_is_not_made_much_of():
    """Places on a circle do not tell what is in its middle; those near one hardly do."""
    angle = np.linspace(0.0, 6.0, 9)
    every, middle = csr_matrix(np.ones((1, 9))), np.zeros((1, 2))
    for uneven, good in ((0.0, False), (0.02, False), (0.5, True)):
        r = 1.0 + uneven * np.cos(3.0 * angle)
        X = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
        assert _fitted(every, X, middle, 2, 9, False)[-1] == [good]


def test_bodies_are_fitted_each_by_itself():
    interface = rectangles(CELLS)
    values = np.where(np.concatenate([interface.quad_body, interface.triangle_body]) == 0, 1.0, 5.0)
    fit = nodal_stress(interface)
    assert fit.fit @ values == pytest.approx(np.where(fit.part == 0, 1.0, 5.0))


def test_the_size_of_a_stress():
    """|s| of tension, sqrt(3) |t| of shear, nothing of pressure."""
    rows = np.array([[3.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0], [4.0, 4.0, 0.0, 4.0]])
    assert von_mises(rows) == pytest.approx([3.0, 2.0 * np.sqrt(3.0), 0.0])
