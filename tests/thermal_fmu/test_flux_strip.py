"""Data that change over place are read as they are, however their kinks lie between nodes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, run, scene, spec

from contact.half.functions import field_from
from thermal_fmu.contact_quadrature import gauss_points

# A strip of 3 W/m2 and 0.05 m, which begins and ends within 1e-6 m: 1/6 to 5/3 of an edge.
WIDE, SHARP, VALUE = 0.05, 1e-6, 3.0


def strip(start, axis="x"):
    at = [start, start + SHARP, start + WIDE - SHARP, start + WIDE]
    return {"terms": [{"t": VALUE, axis: {"at": at, "value": [0.0, 1.0, 1.0, 0.0]}}]}


def line(n, turned=False, rng=None):
    """Edges of uneven lengths along y = 0 from x = 1 to 2, or upright; (n, 2) and (n + 1, 2) [m]."""
    s = np.linspace(1.0, 2.0, n + 1)
    if rng is not None:
        s[1:-1] += rng.uniform(-0.3, 0.3, n - 1) / n
    x = np.stack([s, np.zeros(n + 1)], axis=1)
    edges = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1).astype(np.int32)
    return edges, x[:, ::-1].copy() if turned else x


def given(field, edges, x, axisymmetric=False):
    """(n_nodes,) [W] what a flux gives to each node."""
    points = gauss_points(edges, x, axisymmetric, field)
    shape = field.shapes(np.einsum("pi,pij->pj", points.N, x[edges[points.edge]]))
    weights = VALUE * shape[0][:, None] * points.area[:, None] * points.N
    return np.bincount(edges[points.edge].ravel(), weights.ravel(), len(x))


@pytest.mark.parametrize("n", [3, 33])
@pytest.mark.parametrize("turned", [False, True])
def test_a_strip_gives_its_heat_and_moment_wherever_nodes_are(n, turned):
    rng = np.random.default_rng(n)
    for start in rng.uniform(1.0, 1.9, 20):  # the strip ends before 2
        edges, x = line(n, turned, rng)
        heat = given(field_from(strip(start, "y" if turned else "x")), edges, x)
        power = VALUE * (WIDE - SHARP)
        assert heat.sum() == pytest.approx(power, rel=1e-12)
        assert heat @ x.sum(axis=1) == pytest.approx(power * (start + 0.5 * WIDE), rel=1e-12)


def test_rings_of_a_strip_about_an_axis_too():
    edges, x = line(4)
    heat = given(field_from(strip(1.3)), edges, x, axisymmetric=True)
    assert heat.sum() == pytest.approx(VALUE * (WIDE - SHARP) * 2.0 * np.pi * (1.3 + 0.5 * WIDE), rel=1e-12)


def test_a_strip_that_moves_warms_no_node_at_once():
    """By a way of 1e-4 of an edge a node's heat changes by no more than what enters and leaves on that way."""
    edges, x = line(10)
    starts = np.arange(1.2, 1.4, 1e-5)
    heat = np.array([given(field_from(strip(start)), edges, x) for start in starts[::4]])
    assert np.abs(np.diff(heat, axis=0)).max() <= VALUE * 4.1e-5


def test_without_kinks_points_are_two_an_edge_and_those_of_before():
    edges, x = line(7)
    plain, smooth = gauss_points(edges, x, True), gauss_points(edges, x, True, field_from(2.0), field_from(
        {"terms": [{"x": {"polynomial": [1.0, 2.0]}}]}), field_from(strip(5.0)))
    for name in ("edge", "N", "area"):
        assert (getattr(plain, name) == getattr(smooth, name)).all()
    assert len(plain.edge) == 14


@pytest.mark.parametrize("start", [0.02, 0.31, 0.65])
def test_a_half_reads_flux_film_and_surroundings_so(start):
    """Edges of a third: the ledger holds what a strip gives, by flux, by a film and to a warm sky."""
    mesh, power = scene(Box(0, 1, 0, 1, 3, 2)), VALUE * (WIDE - SHARP)
    held = [{"on": f"a.{side}", "temperature": 300.0} for side in ("left", "right", "top", "bottom")]
    sky = {"terms": [{"t": 300.0}, *({**term, "t": 1e-3} for term in strip(start)["terms"])]}
    conditions = [("flux", {"flux": strip(start)}, power),
                  ("convection", {"convection": {"h": strip(start), "T": 301.0}}, power),
                  ("convection", {"convection": {"h": VALUE, "T": sky}}, 1e-3 * power),
                  ("radiation", {"radiation": {"emissivity": 1.0, "T": sky}},
                   1e-3 * 4.0 * 5.670374419e-8 * 300.0**3 * (WIDE - SHARP))]
    for name, condition, expected in conditions:
        model = spec([{"on": "a.top", **condition}, *held], T0=300.0, method="steady")
        out = run(mesh, model, 1.0, 1).outputs[-1]
        assert out[f"heat.{name}"] == pytest.approx(expected, rel=1e-4)
