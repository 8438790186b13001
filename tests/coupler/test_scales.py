"""Absolute tolerances that a file does not state: shares of the scales of the scene, whatever its units and size."""

import copy
import json

import numpy as np
import pytest

from coupler import run
from coupler.scenario.load import scenario_from
from coupler.scenario.scales import slight_errors, slight_temperature

SCENE = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
    "materials": {"steel": {"rho": 8000.0, "c": 500.0, "k": 30.0, "E": 2e11, "alpha": 1e-5, "T_ref": 300.0}},
    "bodies": {
        "hot": {"mesh": {"rectangle": {"origin": [0.0, 0.0], "size": [0.1, 0.02], "cells": [4, 1]}},
                "material": "steel", "T0": 340.0},
        "cold": {"mesh": {"rectangle": {"origin": [0.1001, 0.0], "size": [0.05, 0.02], "cells": [2, 1]}},
                 "material": "steel", "T0": 300.0}},
    "contact": {"joint": {"slave": "hot.right", "master": "cold.left", "gap_max": 0.01, "conduction": {
        "closed": {"law": "constant", "h": 1000.0}, "open": {"law": "gas", "k_g": 0.03, "g_m": 1e-5}}}},
    "thermal": {"half": "rod", "boundary": [{"on": "hot.left", "temperature": 350.0}]},
    "mechanical": {"half": "rod", "rod": {"held": {"hot": {"left": 0.0}, "cold": {"left": 0.0, "right": 0.0}}}},
    "coupling": {"end": 100.0},
}


def tolerances(tmp_path, **changes):
    """Of windows and of iterations, with other values at dotted keys (__ for dots)."""
    scenario = scenario_from(json.dumps(SCENE), tmp_path / "scene.yaml",
                             {key.replace("__", "."): value for key, value in changes.items()})
    assert scenario.coupling.adaptive is not None
    return scenario.coupling.adaptive.tolerance, scenario.coupling.iteration.tolerance


def test_they_are_shares_of_the_scene(tmp_path):
    window, iteration = tolerances(tmp_path)
    assert window.temperature.atol == pytest.approx(1e-4 * 50.0), "of what is stated: 300 to 350 K"
    assert window.displacement.atol == pytest.approx(1e-6 * 0.1)
    assert window.gap.atol == pytest.approx(1e-6 * 0.1)
    assert window.heat.atol == pytest.approx(0.1 * 5e-3 * 8000.0 * 500.0 * 0.05 * 0.02), "of the smaller body"
    assert iteration.temperature.atol == pytest.approx(0.003 * window.temperature.atol)
    assert iteration.gap.atol == pytest.approx(0.01 * window.gap.atol)
    assert iteration.pressure.atol == pytest.approx(200.0)


def test_what_harms_nobody_is_what_windows_may_err_by_and_no_more_than_the_scene_says(tmp_path):
    def slight(**adaptive):
        scene = scenario_from(json.dumps(SCENE), tmp_path / "scene.yaml", {f"coupling.{k}": v for k, v in
                                                                          adaptive.items()})
        return slight_temperature(scene.interface, scene.models, scene.coupling)

    of_scene = pytest.approx(1e-4 * 50.0)
    assert slight() == of_scene
    assert slight(windows=[{"until": 100.0, "size": 1.0}]) == of_scene
    assert slight(adaptive={"tolerance": {"temperature": {"atol": 1e-4}}}) == 1e-4
    assert slight(adaptive={"tolerance": {"temperature": {"atol": 2.0}}}) == of_scene


def test_places_and_pressures_are_held_to_what_iterations_leave(tmp_path):
    """1e-9 m of 0.1 m: what windows may err by, 1e-7 m, is all that 0.2 MPa does to steel."""
    scene = scenario_from(json.dumps(SCENE), tmp_path / "scene.yaml", {})
    assert slight_errors(scene.interface, scene.models, scene.coupling) == pytest.approx(
        {"K": 1e-4 * 50.0, "m": 1e-9, "Pa": 200.0})


def test_a_small_span_of_temperatures_counts(tmp_path):
    window, _ = tolerances(tmp_path, bodies__hot__T0=300.5, thermal__boundary__0__temperature=301.0)
    assert window.temperature.atol == pytest.approx(1e-4 * 1.0)


def test_a_thin_layer_of_gas_bounds_that_of_the_gap(tmp_path):
    thin = {"law": "gas", "k_g": 0.03, "g_m": 2e-8}
    window, iteration = tolerances(tmp_path, contact__joint__conduction__open=thin)
    assert window.gap.atol == pytest.approx(2e-8, rel=0.1)
    assert window.displacement.atol == pytest.approx(1e-7)
    assert iteration.gap.atol == pytest.approx(2e-10, rel=0.1)


def test_a_scene_a_thousand_times_as_large_has_tolerances_as_much_larger(tmp_path):
    large = copy.deepcopy(SCENE["bodies"])
    for body in large.values():
        rectangle = body["mesh"]["rectangle"]
        rectangle.update({key: [1000.0 * s for s in rectangle[key]] for key in ("origin", "size")})
    gas = {"law": "gas", "k_g": 30.0, "g_m": 1e-2}
    (small, inner), (window, iteration) = tolerances(tmp_path), tolerances(
        tmp_path, bodies=large, contact__joint__conduction__open=gas)
    for name in ("displacement", "gap"):
        assert getattr(window, name).atol == pytest.approx(1000.0 * getattr(small, name).atol)
    assert iteration.gap.atol == pytest.approx(1000.0 * inner.gap.atol)
    assert window.heat.atol == pytest.approx(1e6 * small.heat.atol)
    assert window.temperature.atol == small.temperature.atol


@pytest.mark.parametrize("heat", [{"thermal__boundary": [{"on": "hot.left", "flux": 1.0}]}, {"bodies__cold__Q_T": 1.0}])
def test_where_heat_is_made_stated_temperatures_do_not_bound_what_comes(tmp_path, heat):
    window, _ = tolerances(tmp_path, **heat)
    highest = 340.0 if "thermal__boundary" in heat else 350.0
    assert window.temperature.atol == pytest.approx(3e-5 * highest)


def test_what_is_stated_stays_and_what_is_left_out_goes_with_rtol(tmp_path):
    usual, _ = tolerances(tmp_path)
    window, _ = tolerances(tmp_path, coupling__adaptive__tolerance={
        "temperature": {"atol": 0.5}, "gap": {"rtol": 1e-3}, "heat": {"atol": 2.0, "rtol": 1e-4},
        "displacement": {"rtol": 0.0}})
    assert window.temperature.atol == 0.5
    assert window.gap.atol == pytest.approx(0.1 * usual.gap.atol), "a tenth of rtol"
    assert window.heat.atol == 2.0
    assert window.displacement.atol == pytest.approx(usual.displacement.atol), "rtol 0 is no share"


def test_iterations_leave_less_than_a_stated_tolerance_of_windows(tmp_path):
    usual = tolerances(tmp_path)[1]
    window, iteration = tolerances(tmp_path, coupling__adaptive__tolerance={
        "temperature": {"atol": 1e-5}, "gap": {"rtol": 1e-5}})
    assert iteration.temperature.atol == pytest.approx(0.003 * 1e-5)
    assert iteration.gap.atol == pytest.approx(0.01 * window.gap.atol)
    loose = tolerances(tmp_path, coupling__adaptive__tolerance={"temperature": {"atol": 10.0}})[1]
    assert loose.temperature.atol == usual.temperature.atol


def test_iterations_that_leave_more_than_a_window_may_err_by_are_told(tmp_path):
    def told(**changes):
        scenario = scenario_from(json.dumps(SCENE), tmp_path / "scene.yaml",
                                 {key.replace("__", "."): value for key, value in changes.items()})
        return [note for note in scenario.notes if "iterations may leave" in note]

    assert not told()
    assert not told(coupling__iteration__tolerance__temperature__atol=1e-3)
    note, = told(coupling__iteration__tolerance__temperature__atol=0.01)
    assert "0.01 K (coupling.iteration.tolerance.temperature.atol)" in note
    assert "0.005 K at rest" in note
    assert not told(coupling__iteration__tolerance__temperature__atol=0.01,
                    coupling__windows=[{"until": 100.0, "size": 1.0}])


def test_a_scene_at_one_temperature_is_held_to_a_share_of_it(tmp_path):
    window, _ = tolerances(tmp_path, bodies__hot__T0=300.0, thermal__boundary=[])
    assert window.temperature.atol == pytest.approx(3e-5 * 300.0)


def test_scenes_that_are_physically_similar_are_solved_alike(tmp_path):
    runs = []
    for times in (1.0, 1024.0, 1.0 / 1024.0):
        doc = copy.deepcopy(SCENE)
        for body in doc["bodies"].values():
            rectangle = body["mesh"]["rectangle"]
            rectangle.update({key: [times * s for s in rectangle[key]] for key in ("origin", "size")})
        pair = doc["contact"]["joint"]
        pair["gap_max"] *= times
        pair["conduction"] = {"closed": {"law": "constant", "h": 3000.0 / times},
                              "open": {"law": "gas", "k_g": 0.03, "g_m": 1e-5 * times}}
        doc["thermal"]["boundary"] = [{"on": "hot.left", "temperature": 600.0},
                                      {"on": "cold.right", "temperature": 300.0}]
        doc["bodies"]["cold"]["mesh"]["rectangle"]["origin"][0] = 0.10003 * times
        doc["coupling"]["end"] = 500.0 * times**2
        doc["probes"] = {"T": {"T": {"mean": "hot.right"}}, "p": {"p": {"max": "hot.right"}}}
        folder = tmp_path / str(len(runs))
        folder.mkdir()
        results = run(scenario_from(json.dumps(doc), folder / "scene.yaml", {}), folder / "run.h5")
        runs.append((results.windows.t / times**2, results.probe("T")[1], results.probe("p")[1]))
    t, T, p = runs[0]
    assert p[-1] > 1e6, "they touch"
    for other in runs[1:]:
        assert len(other[0]) == len(t)
        np.testing.assert_allclose(other[0], t, rtol=1e-9)
        np.testing.assert_allclose(other[1], T, rtol=1e-9)
        np.testing.assert_allclose(other[2], p, rtol=1e-6, atol=1.0)
