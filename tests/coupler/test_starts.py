"""Bodies that begin with a function of place: as stated, in the file's unit, and refused where it cannot be."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler import run
from coupler.errors import ScenarioError

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import BAR, edited, linear, loaded, solved, temperatures

PROFILE = {"terms": [{"t": 320.0},
                     {"t": 500.0, "x": {"polynomial": [0.0, 1.0]}, "y": {"at": [0, 0.02], "value": [1, 2]}},
                     {"t": -3.0, "x": {"at": [0.0, 0.05], "value": [0, 1]}}]}


def errors_of(folder: Path, doc: dict) -> list[ScenarioError]:
    with pytest.raises(ScenarioError) as told:
        loaded(folder, doc)
    return [told.value, *told.value.others]


@pytest.mark.parametrize("unit", ["K", "degC"])
def test_every_node_begins_with_the_sum_of_the_terms(tmp_path, unit):
    shift = {"K": 0.0, "degC": 273.15}[unit]
    terms = [{**PROFILE["terms"][0], "t": 320.0 - shift}, *PROFILE["terms"][1:]]
    doc = edited(BAR, units__temperature=unit, bodies__bar__T0={"terms": terms}, coupling__end=2.0,
                 materials__steel__T_ref=300.0 - shift, coupling__windows=[{"until": 2.0, "size": 2.0}])
    results = solved(tmp_path, doc)
    x, y = loaded(tmp_path, doc).interface.nodes.T
    expected = 320.0 + 500.0 * x * (1.0 + y / 0.02) - 3.0 * np.minimum(x / 0.05, 1.0)
    np.testing.assert_allclose(temperatures(results)[0], expected, rtol=0, atol=1e-11)


def test_one_constant_term_is_the_number_to_the_bit(tmp_path):
    walls = [{"on": "bar.left", "temperature": 400.0}]
    a, b = (solved(tmp_path, edited(BAR, bodies__bar__T0=T0, thermal__boundary=walls), name)
            for T0, name in ((350.0, "number"), ({"terms": [{"t": 350.0}]}, "terms")))
    np.testing.assert_array_equal(temperatures(a), temperatures(b))
    assert a.ledger == b.ledger


@pytest.mark.parametrize("half", ["thermal", "rod"])
def test_what_is_steady_stays(tmp_path, half):
    walls = [{"on": "bar.left", "temperature": 300.0}, {"on": "bar.right", "temperature": 400.0}]
    T = temperatures(solved(tmp_path, edited(BAR, bodies__bar__T0=linear(300.0, 1000.0), thermal__boundary=walls,
                                             thermal__half=half)))
    np.testing.assert_allclose(T, T[:1] + 0 * T, rtol=0, atol=1e-9)


def test_without_boundary_the_mean_stays_and_the_rest_decays(tmp_path):
    """An insulated bar that begins linear: the mean stays, the slowest mode leaves exp(-pi^2 a t / L^2)."""
    doc = edited(BAR, bodies__bar__T0=linear(300.0, 1000.0), coupling__end=200.0,
                 coupling__windows=[{"until": 200.0, "size": 2.0}],
                 bodies__bar__mesh__rectangle__cells=[40, 1])
    results = solved(tmp_path, doc)
    T, x = temperatures(results), loaded(tmp_path, doc).interface.nodes[:, 0]
    assert results.heat_imbalance < 1e-10
    assert not results.broken
    assert abs(results.ledger["stored.bar"]) < 1e-10 * 8000.0 * 500.0 * 0.002 * 50.0  # J, of what moves inside
    left, right = T[:, x == 0.0].mean(axis=1), T[:, x == 0.1].mean(axis=1)
    np.testing.assert_allclose(left + right, 700.0, rtol=0, atol=1e-8)
    t, a, L = results.field("thermal.T")[0], 1e-5, 0.1
    n = np.arange(1, 40, 2)
    exact = 8.0 * 100.0 / np.pi**2 * (np.exp(-np.pi**2 * n**2 * a * t[:, None] / L**2) / n**2).sum(axis=1)
    late = t > 100.0
    np.testing.assert_allclose((right - left)[late], exact[late], rtol=2e-3)


def test_a_poured_body_of_uneven_warmth_begins_without_stress(tmp_path):
    melt = {"rho": 2700.0, "c": 1000.0, "k": 200.0, "E": 7e10, "nu": 0.3, "alpha": 2e-5, "T_ref": 300.0,
            "latent": {"L": 4e5, "T_s": 800.0, "T_l": 900.0},
            "liquid": {"eta": 1e3, "bulk": 7e10, "T_s": 800.0, "T_l": 900.0, "shrinkage": 0.02}}
    doc = edited(BAR, materials__steel=melt, bodies__bar__T0=linear(780.0, 1500.0), mechanical={
        "half": "elastic", "elastic": {"boundary": [{"on": "bar.bottom", "u_x": 0, "u_y": 0}]}},
        coupling__end=1.0, coupling__windows=[{"until": 1.0, "size": 1.0}])
    sigma = solved(tmp_path, doc).field("mechanical.sigma_v")[1]
    assert sigma[0].max() < 1e-3  # Pa; drawn at one temperature for all it is 1e7


def test_what_cannot_begin_is_told_all_at_once(tmp_path):
    bar = BAR["bodies"]["bar"]
    doc = edited(BAR, bodies={
        "late": {**bar, "T0": {"terms": [{"t": {"t": [0, 1], "value": [300, 400]}}]}},
        "named": {**bar, "T0": {"terms": [{"t": 300.0}, {"t": "push"}]}}}, signals={"push": 1.0})
    found = errors_of(tmp_path, doc)
    assert [e.key for e in found] == ["bodies.late.T0.terms.0.t", "bodies.named.T0.terms.1.t"]
    assert all("no course in time" in str(e) and "Write a number" in str(e) for e in found)
    doc = edited(BAR, units__temperature="degC", materials__steel__T_ref=20.0, bodies={
        "cold": {**bar, "T0": linear(-300.0, 1000.0)}, "edge": {**bar, "T0": linear(-273.15, 0.0)}})
    found = errors_of(tmp_path, doc)
    assert [e.key for e in found] == ["bodies.cold.T0.terms", "bodies.edge.T0.terms"]
    assert "reaches -300 degC in body 'cold'" in str(found[0])


@pytest.mark.parametrize(("half", "refused"), [("lumped", linear(300.0, 10.0)), ("rod", PROFILE)])
def test_halves_with_fewer_temperatures_refuse_what_they_cannot_hold(tmp_path, half, refused):
    (error,) = errors_of(tmp_path, edited(BAR, bodies__bar__T0=refused, thermal__half=half))
    assert error.key == "bodies.bar.T0"
    assert "has one temperature" in str(error)


def test_polynomials_are_held_against_every_temperature_of_the_start(tmp_path):
    doc = edited(BAR, bodies__bar__T0=linear(300.0, 5000.0),
                 materials__steel__k={"polynomial": [40.0, -0.1], "T_ref": 300.0})
    assert "is -10 at the T0 of body 'bar'" in str(errors_of(tmp_path, doc)[0])
    doc = edited(BAR, bodies__bar__T0=linear(300.0, 5000.0), thermal__boundary=[
        {"on": "bar.right", "radiation": {"emissivity": {"polynomial": [0.5, 0.01], "T_ref": 300.0}, "T": 300.0}}])
    assert "is 5.5 at the T0 of body 'bar'" in str(errors_of(tmp_path, doc)[0])


def test_halves_of_other_packages_are_told_by_the_format(tmp_path):
    """What a half must know to read its model.json: one that asks for format 2 refuses it by itself."""
    assert loaded(tmp_path, BAR).models["thermal"]["format"] == 2
    model = loaded(tmp_path, edited(BAR, bodies__bar__T0=linear(300.0, 1.0))).models["thermal"]
    assert (model["format"], model["bodies"]["bar"]["T0"]) == (3, {"terms": [{"t": 300.0}, {
        "t": 1.0, "x": {"polynomial": [0.0, 1.0]}}]})


@pytest.mark.slow
def test_embedded_codec_and_processes_give_the_same_bits(tmp_path):
    doc = edited(BAR, bodies__bar__T0=PROFILE, coupling__end=6.0, coupling__windows=[{"until": 6.0, "size": 2.0}],
                 mechanical={"half": "elastic", "elastic": {"boundary": [{"on": "bar.left", "u_x": 0, "u_y": 0}]}})
    a = run(loaded(tmp_path, doc), tmp_path / "a.h5")
    b = run(loaded(tmp_path, edited(doc, coupling__link="codec")), tmp_path / "b.h5")
    c = run(loaded(tmp_path, doc), tmp_path / "c.h5", processes=True)
    for other in (b, c):
        np.testing.assert_array_equal(temperatures(a), temperatures(other))
        np.testing.assert_array_equal(a.field("mechanical.u")[1], other.field("mechanical.u")[1])
