"""Gradients at the points of conduction: one cell after the other compiled, and all at once, are the same numbers."""

import numpy as np
import pytest

from contact.half.functions import table_of
from contact.half.gradients import shape_gradients
from contact.half.signs import conduction_gradients

CORNERS = {"quad": np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
           "triangle": np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])}


@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_gradients_of_all_cells_at_once_are_those_of_the_kernel(kind, axisymmetric):
    rng, corners, table = np.random.default_rng(15), CORNERS[kind], table_of(kind)
    cells = np.arange(300 * len(corners), dtype=np.int32).reshape(300, -1)
    x = []
    for _ in cells:
        # Stretched up to 30 to 1 either way, turned, skewed, beside the axis of revolution or far from it.
        stretched = corners * np.exp(rng.uniform(-1.7, 1.7, 2)) + rng.uniform(-0.1, 0.1, corners.shape)
        angle = rng.choice([0.0, 0.5 * np.pi, rng.uniform(0.0, 6.3)])
        turned = stretched @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        x.append(turned - [turned[:, 0].min() - rng.choice([0.0, 0.1, 5.0]), 0.0])
    x = np.concatenate(x)
    # The kernel stops at a cell turned inside out.
    own = np.concatenate([cells[e:e + 1] for e in range(len(cells)) if _fits(x, cells[e:e + 1], table, axisymmetric)])
    assert len(own) > 200
    G, dV, dC = _compiled(x, own, table, axisymmetric)
    at_once = conduction_gradients(x, own, table, axisymmetric)
    if kind == "quad":
        assert np.mean(np.abs(dC - dV).max(axis=1) > 1e-3 * dV.max(axis=1)) > (0.3 if axisymmetric else 0.0)
    np.testing.assert_allclose(at_once[0], G, rtol=0.0, atol=1e-12 * np.abs(G).max())
    np.testing.assert_allclose(at_once[1], dC, rtol=1e-12)


def test_a_cell_inside_out_has_no_say_and_silences_no_other():
    x = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0], [2.0, 1.0]])
    inside_out, right = [0, 3, 2, 1], [1, 4, 5, 2]
    G, dC = conduction_gradients(x, np.array([inside_out, right], np.int32), table_of("quad"), axisymmetric=False)
    assert not G[0].any()
    assert not dC[0].any()
    assert dC[1].sum() == pytest.approx(1.0)


def _compiled(x, cells, table, axisymmetric):
    G = np.zeros((len(cells), len(table.w), cells.shape[1], 2))
    dV, dC = np.zeros(G.shape[:2]), np.zeros(G.shape[:2])
    assert shape_gradients(x, np.ascontiguousarray(cells), table.N, table.dN, table.w, axisymmetric, G, dV, dC) == -1
    return G, dV, dC


def _fits(x, cells, table, axisymmetric):
    G = np.zeros((1, len(table.w), cells.shape[1], 2))
    dV = np.zeros(G.shape[:2])
    return shape_gradients(x, cells, table.N, table.dN, table.w, axisymmetric, G, dV, dV.copy()) == -1
