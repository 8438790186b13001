"""Probes: a linear field is read exactly wherever they stand."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.scenario import Probe, Scenario

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text


def with_probe(folder: Path, target: object, **overrides: object) -> tuple[Scenario, Probe]:
    s = load_text(folder, GOOD, {**overrides, "probes": {"it": target}})
    return s, s.probes["it"]


def linear(s: Scenario) -> np.ndarray:
    """3 + 2 x - 5 y at the nodes."""
    return np.asarray(3 + s.interface.nodes @ (2.0, -5.0))


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("at", [(0, 1), (2, 2), (0.4, 1.5), (0.123, 1.0), (1.999, 1.777), (1.0, 2.0), (1, 1.25)])
def test_points_anywhere_read_a_linear_field(at: tuple[float, float], triangles: bool, tmp_path: Path) -> None:
    s, probe = with_probe(tmp_path, {"T": {"at": at, "body": "upper"}},
                          **{"bodies.upper.mesh.rectangle.triangles": triangles})
    assert probe.of(linear(s)) == pytest.approx(3 + 2 * at[0] - 5 * at[1], rel=1e-13)
    assert probe.weights.sum() == pytest.approx(1, abs=1e-15)
    assert (s.interface.node_body[probe.nodes] == 1).all(), "both bodies have nodes at y = 1; the probe is in one"


def test_a_centre_between_two_nodes_is_interpolated(tmp_path: Path) -> None:
    s, probe = with_probe(tmp_path, {"T": "upper.bottom.centre"}, **{"bodies.upper.mesh.rectangle.cells": [31, 2]})
    assert probe.weights == pytest.approx([0.5, 0.5])
    assert s.interface.nodes[probe.nodes].mean(axis=0) == pytest.approx([1.0, 1.0])
    assert len(with_probe(tmp_path, {"T": "lower.bottom.centre"})[1].nodes) == 1


def test_reductions_over_a_surface(tmp_path: Path) -> None:
    cells = {"bodies.upper.mesh.rectangle.grading": [7, 1]}
    s, mean = with_probe(tmp_path, {"p": {"mean": "upper.bottom"}}, **cells)
    assert mean.of(linear(s)) == pytest.approx(3 + 2 * 1.0 - 5 * 1.0, abs=1e-13)
    assert (mean.quantity, mean.unit, mean.reduction) == ("p", "Pa", "mean")
    s, high = with_probe(tmp_path, {"gap": {"max": "upper.bottom"}}, **cells)
    assert high.of(linear(s)) == pytest.approx(2.0)
    s, low = with_probe(tmp_path, {"u_x": {"min": "upper.right"}}, **cells)
    assert low.of(linear(s)) == pytest.approx(3 + 4 - 10)


def test_a_mean_is_by_area_in_axisymmetric_geometry(tmp_path: Path) -> None:
    s, mean = with_probe(tmp_path, {"T": {"mean": "upper.bottom"}}, geometry="axisymmetric")
    r = s.interface.nodes[:, 0]
    # The mean of r over a disc of radius 2 is 2/3 of 2.
    assert mean.of(r) == pytest.approx(4 / 3, rel=1e-13)


def test_a_point_in_a_distorted_quad(tmp_path: Path) -> None:
    """The inverse of the bilinear map, checked by mapping forth again."""
    from dataclasses import replace

    from coupler.scenario.locate import locate

    interface = load_text(tmp_path, GOOD).interface
    shift = 0.06 * np.sin(7 * interface.nodes[:, ::-1] + 1)
    distorted = replace(interface, nodes=interface.nodes + shift)
    for at in np.random.default_rng(1).uniform((0.2, 0.2), (1.8, 0.8), (50, 2)):
        found = locate(distorted, "lower", at)
        assert found is not None
        nodes, weights = found
        assert weights @ distorted.nodes[nodes] == pytest.approx(at, abs=1e-12)
        assert weights.min() > 0
    assert locate(distorted, "lower", np.array([2.2, 0.5])) is None
