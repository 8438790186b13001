"""The headline, the progress line, the probe, the report and ParaView tell one contact pressure."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from coupler import Results, run

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import STEEL, edited, loaded, without_fmus

# A block on a wider plate, whose nodes lie otherwise: nodes of the plate beside it face a sliver of its corner.
BLOCK: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL},
    "bodies": {
        "plate": {"mesh": {"rectangle": {"origin": [-0.021, -0.02], "size": [0.083, 0.02], "cells": [17, 4]}},
                  "material": "steel", "T0": 300.0},
        "block": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.04, 0.02], "cells": [5, 3]}},
                  "material": "steel", "T0": 300.0}},
    "contact": {"base": {"slave": "block.bottom", "master": "plate.top", "gap_max": 0.001}},
    "thermal": {"half": "thermal"},
    "mechanical": {"half": "elastic", "elastic": {"boundary": [
        {"on": "plate.bottom", "u_x": 0, "u_y": 0}, {"on": "block.top", "u_x": 0},
        {"on": "block.top", "u_y": {"t": [0, 1, 3], "value": [0, -2.0e-5, -1.0e-5]}}]}},
    "coupling": {"scheme": "staggered", "end": 3.0, "windows": [{"until": 3.0, "size": 0.5}]},
    "probes": {"p": {"p": {"max": "block.bottom"}}, "below": {"p": {"max": "plate.top"}}},
    "output": {"fields": {"every": 1}, "checkpoint": None}}


def everywhere(folder: Path, doc: dict[str, Any]) -> tuple[Results, dict[str, float]]:
    """Run a scene; the largest pressure [Pa] of the run as each place tells it."""
    seen: list[float] = []
    with without_fmus():
        results = run(loaded(folder, doc), folder / "s.h5", on_window=lambda p: seen.append(p.max_p))
    from coupler.report.page import answer
    from coupler.report.pressure import largest, pressure_pictures

    told = re.search(r"highest contact pressure is ([\d.]+) (\w+)", answer(results)[1])
    assert told is not None
    (picture,) = pressure_pictures(results)
    (along,) = results.contact.values()
    in_caption = re.search(r"Its largest, ([\d.]+) (\w+)", picture.caption)
    assert in_caption is not None
    scales = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}
    assert float(in_caption[1]) * scales[in_caption[2]] == pytest.approx(largest(along)[0], rel=1e-4)
    return results, {
        "headline": float(told[1]) * scales[told[2]], "progress": max(seen),
        "probe": float(results.probe("p")[1].max()), "report": largest(along)[0],
        "paraview": float(np.nanmax(results.field("mechanical.p")[1]))}


@pytest.mark.few("two_pass")
@pytest.mark.parametrize("settings", [{}, {"form": "nodes"}, {"two_pass": True}, {"augmented": None}],
                         ids=["cuts", "nodes", "two_pass", "penalty"])
def test_five_places_tell_one_pressure(tmp_path, settings):
    contact = {"base": {**BLOCK["contact"]["base"], **settings}}
    results, told = everywhere(tmp_path, edited(BLOCK, contact=contact))
    # Where both sides are searched, either may have the largest.
    probe = max(told.pop("probe"), float(results.probe("below")[1].max()) if "two_pass" in settings else 0.0)
    assert probe > 5e7
    if "two_pass" in settings:
        del told["report"]  # its line is the slave's
    assert told == {name: pytest.approx(probe, rel=1e-4 if name == "headline" else 1e-6) for name in told}


def test_a_sliver_does_not_decide_the_largest_pressure(tmp_path):
    """A block that slides off: where 10 um of it are left, force over what they cover is 18.5 GPa."""
    doc = edited(BLOCK, contact={"base": {**BLOCK["contact"]["base"], "gap_max": 0.01}}, mechanical__elastic__boundary=[
        {"on": "plate.bottom", "u_x": 0, "u_y": 0},
        {"on": "block.top", "u_x": {"t": [0, 2, 3], "value": [0, 0.06199, 0.06199]}},
        {"on": "block.top", "u_y": {"t": [0, 1, 3], "value": [0, -2.0e-5, -2.0e-5]}}])
    results, told = everywhere(tmp_path, doc)
    t, p = results.probe("p")
    assert told == {name: pytest.approx(told["probe"], rel=1e-4 if name == "headline" else 1e-6) for name in told}
    assert p.max() < 4.0 * p[t < 1.6].max()


def test_all_there_is_to_look_at_is_in_the_files(tmp_path):
    """Strains, stress with the hoop's by its name, and what surfaces do: for ParaView, and as lines along them."""
    doc = edited(BLOCK, geometry="axisymmetric", materials={"steel": {**STEEL, "plastic": {"s_y": 1e8}}}, contact={
        "base": {**BLOCK["contact"]["base"], "friction": {"mu": 0.2}}}, coupling__windows=[{"until": 3.0, "size": 1.0}])
    for body in doc["bodies"].values():
        body["mesh"]["rectangle"]["origin"][0] += 0.021
    with without_fmus():
        results = run(loaded(tmp_path, doc), tmp_path / "s.h5")
    with h5py.File(results.field_files["mechanical"]) as file:
        cells, points = ({name: np.asarray(values) for name, values in file[f"VTKHDF/{on}Data"].items()}
                         for on in ("Cell", "Point"))
    assert {"sigma", "sigma_v", "sigma_hoop", "strain", "elastic_strain", "peeq"} <= set(cells)
    assert cells["sigma"].shape[1] == cells["strain"].shape[1] == 6  # as VTK has them: xx, yy, zz, xy, yz, xz
    np.testing.assert_array_equal(cells["sigma_hoop"], cells["sigma"][:, 2])
    assert cells["peeq"].max() > 1e-4
    assert {"p", "gap", "contact.t_T", "contact.slip", "contact.slip_path", "contact.status"} <= set(points)
    assert {2.0, 3.0} <= set(points["contact.status"][~np.isnan(points["contact.status"])]) <= {0.0, 1.0, 2.0, 3.0}
    line = results.contact["base"]
    assert line.t_N.shape == line.gap.shape == line.t_T.shape == line.slip_share.shape == (4, 6)
    assert (np.diff(line.s) > 0.0).all()
    assert np.abs(line.t_T).max() == pytest.approx(np.nanmax(np.abs(points["contact.t_T"])), rel=1e-6)
    assert -line.t_N.min() == pytest.approx(np.nanmax(points["p"]), rel=1e-6)


def test_the_lines_shown_are_those_of_the_highest_pressure_and_evenly_spread_ones():
    from coupler.report.pressure import times_to_show

    t, p = np.linspace(0.0, 10.0, 101), np.zeros(101)
    p[10:91], p[33] = 1.0, 2.0
    assert times_to_show(t, p) == [10, 33, 37, 63, 90]


def test_what_the_master_is_told_adds_up_to_what_the_slave_is(tmp_path):
    """At no node of the master more than the slave has somewhere, and in the mean over what is pressed the same."""
    results, _ = everywhere(tmp_path, BLOCK)
    assert results.probe("below")[1].max() <= results.probe("p")[1].max() * (1 + 1e-12)
    assert results.probe("below")[1].max() >= 0.8 * results.probe("p")[1].max()


def test_the_headline_counts_the_start(tmp_path):
    """What presses at t = 0 and never as hard again."""
    doc = edited(BLOCK, mechanical__elastic__boundary=[
        {"on": "plate.bottom", "u_x": 0, "u_y": 0}, {"on": "block.top", "u_x": 0},
        {"on": "block.top", "u_y": {"t": [0, 3], "value": [-2.0e-5, -1.0e-5]}}])
    results, told = everywhere(tmp_path, doc)
    p = results.probe("p")[1]
    assert p.argmax() == 0
    assert told["progress"] < 0.95 * told["probe"]  # of the windows that were
    assert told["headline"] == pytest.approx(p[0], rel=1e-4)
    assert told["report"] == pytest.approx(p[0], rel=1e-6)


def test_a_peak_at_a_corner_is_told_as_one() -> None:
    """At the last node of a surface, with what the rest of it has; in its middle, and on a closed one, without."""
    from coupler.record.results import Along
    from coupler.report.pressure import place_of_peak

    def told(p: list[float], closed: bool = False) -> str:
        x = np.array([[0.01 * k, 0.5] for k in range(4)])
        if closed:
            x[-1] = x[0]
        t_N = -np.array([[0.0] * 4, p], dtype=np.float32)
        return place_of_peak(Along(np.arange(4) * 0.01, x, t_N, np.zeros((2, 4), dtype=np.float32)), "block.bottom")

    corner = told([35e6, 20e6, 34e6, 252e6])
    assert corner.startswith("on block.bottom at (0.03, 0.5) m, the corner at its end")
    assert corner.endswith("has at most 35 MPa then")
    assert told([10e6, 10e6, 10e6, 10e6]) == told([10.05e6, 10e6, 10e6, 10e6]) == "on block.bottom at (0, 0.5) m"
    assert told([35e6, 20e6, 252e6, 34e6]) == "on block.bottom at (0.02, 0.5) m"
    assert told([252e6, 20e6, 34e6, 252e6], closed=True) == "on block.bottom at (0, 0.5) m"


def test_a_peak_on_the_axis_is_no_corner() -> None:
    """A round surface begins on the axis only in the mesh; a node that carries a peak alone is named."""
    from coupler.record.results import Along
    from coupler.report.pressure import place_of_peak

    def told(p: list[float], round_body: bool = True) -> str:
        x = np.array([[0.01 * k, 0.5] for k in range(4)])
        t_N = -np.array([[0.0] * 4, p], dtype=np.float32)
        along = Along(np.arange(4) * 0.01, x, t_N, np.zeros((2, 4), dtype=np.float32))
        return place_of_peak(along, "block.bottom", round_body)

    assert told([40e6, 35e6, 20e6, 0.0]) == "on block.bottom at (0, 0.5) m, on the axis"  # a ball on a floor
    alone = told([290e3, 14e3, 0.0, 0.0])
    assert alone.endswith("on the axis; the rest of the surface has at most 14 kPa then: one node carries the peak")
    assert "the corner at its end" in told([290e3, 14e3, 0.0, 0.0], round_body=False)
    assert "the corner at its end" in told([20e3, 14e3, 0.0, 290e3])
