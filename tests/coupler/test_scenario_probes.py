"""Probes: a linear field is read exactly wherever they stand."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.errors import ScenarioError
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


def test_a_mean_along_the_axis_is_by_length(tmp_path: Path) -> None:
    s, mean = with_probe(tmp_path, {"T": {"mean": "lower.left"}}, geometry="axisymmetric")
    y = s.interface.nodes[:, 1]
    assert not s.interface.nodes[mean.nodes, 0].any()
    assert mean.of(y) == pytest.approx(0.5 * (y[mean.nodes].min() + y[mean.nodes].max()), rel=1e-13)
    _, stress = with_probe(tmp_path, {"mechanical.sigma.yy": {"mean": "lower.left"}}, geometry="axisymmetric")
    assert stress.cell_weights.sum() == pytest.approx(1.0, rel=1e-13)


def test_a_point_in_a_distorted_quad(tmp_path: Path) -> None:
    """The inverse of the bilinear map, checked by mapping forth again."""
    from dataclasses import replace

    from coupler.scenario.probes import locate

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


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a_mean_over_a_body_is_by_volume(geometry: str, triangles: bool, tmp_path: Path) -> None:
    s, mean = with_probe(tmp_path, {"T": {"mean": "upper"}}, geometry=geometry, **{
        "bodies.upper.mesh.rectangle.grading": [7, 3], "bodies.upper.mesh.rectangle.triangles": triangles})
    r, z = s.interface.nodes.T
    # r 0 to 2, z 1 to 2: the mean of r is 1 in the plane and 2/3 of 2 in a cylinder; that of z is 1.5 in both.
    assert mean.of(r) == pytest.approx(1 if geometry == "plane" else 4 / 3, rel=1e-13)
    assert mean.of(z) == pytest.approx(1.5, rel=1e-13)
    assert (mean.reduction, mean.unit) == ("mean", "K")


def test_a_body_of_bent_cells(tmp_path: Path) -> None:
    """Its mean of r and of z is its centre of volume, here from the outline: exact, as polygons are."""
    from dataclasses import replace

    from coupler.scenario.probes import body_mean

    interface = load_text(tmp_path, GOOD, {"geometry": "axisymmetric"}).interface
    x = interface.nodes + 0.06 * np.sin(7 * interface.nodes[:, ::-1] + 1)
    nodes, weights = body_mean(replace(interface, nodes=x), "upper")
    own = [e for name, e in interface.surfaces.items() if name.startswith("upper.")]
    (a, p), (b, q) = (x[np.concatenate(own)[:, k]].T for k in (0, 1))
    volume = ((q - p) * (a * a + a * b + b * b) / 6).sum()  # of r dr dz, by Green's theorem
    moment = ((q - p) * (a**3 + a * a * b + a * b * b + b**3) / 12).sum()  # of r2 dr dz
    assert weights @ x[nodes, 0] == pytest.approx(moment / volume, rel=1e-12)


def test_extremes_over_a_body_are_its_own(tmp_path: Path) -> None:
    s, high = with_probe(tmp_path, {"T": {"max": "lower"}})
    assert high.of(s.interface.nodes[:, 1]) == pytest.approx(1.0), "upper reaches 2"


def test_contact_quantities_are_not_of_a_body(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="exists only on contact surfaces"):
        with_probe(tmp_path, {"gap": {"max": "upper"}})


def test_an_output_without_its_half_is_told_how_it_is_written(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"begin with the half: mechanical\.sigma_v or thermal\.sigma_v"):
        with_probe(tmp_path, {"sigma_v": {"max": "upper"}})


@pytest.mark.parametrize(("target", "key", "text"), [
    ({"T": {"body": "upper", "component": "y"}}, "probes.it.T.component", "unknown key"),
    ({"mechanical.iterations": {"component": "y"}}, "probes.it.mechanical.iterations.component", "unknown key"),
    ({"T": {}}, "probes.it.T", "exactly one of at, max, min, mean"),
    ({"T": [1]}, "probes.it.T", "a mapping is needed"), ({"T": {"max": 3}}, "probes.it.T.max", "text is needed")])
def test_what_is_wrong_with_a_probe_is_told_once_by_the_keys_of_the_file(
        target: object, key: str, text: str, tmp_path: Path) -> None:
    """A value may be text or a mapping: names of the two forms stood among the keys, and both were told."""
    with pytest.raises(ScenarioError, match=text) as caught:
        with_probe(tmp_path, target)
    assert caught.value.key == key
    assert str(caught.value).count("probes.it") == 1
    assert "function" not in str(caught.value)
