"""Results for people who compute: fields at a time, surfaces, tables of pandas, xarray and pyvista."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupler import Results, ResultsError, load_scenario, run
from coupler.record import access

SCENARIOS = Path(__file__).parents[2] / "scenarios"
COARSE = {"bodies.lower.mesh.rectangle.cells": [3, 3], "bodies.upper.mesh.rectangle.cells": [3, 4],
          "output.fields": {"every": 5}}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Results:
    scenario = load_scenario(SCENARIOS / "sliding_blocks.yaml", overrides=COARSE)
    return run(scenario, tmp_path_factory.mktemp("access") / "run.h5", until=300.0)


def test_a_field_at_a_time_is_on_the_line_between_frames(ran: Results) -> None:
    times, T = ran.fields("T")
    assert len(times) > 3
    assert np.array_equal(ran.fields("thermal.T", t=float(times[2])), T[2])
    middle = 0.25 * times[1] + 0.75 * times[2]
    assert ran.fields("T", t=float(middle)) == pytest.approx(0.25 * T[1] + 0.75 * T[2], rel=1e-12)
    assert ran.fields("u", t=0.0).shape == (len(ran.mesh().nodes), 2)
    assert ran.fields["mechanical.sigma_v"].unit == "Pa"


def test_times_have_words_and_what_is_no_time_is_told(ran: Results) -> None:
    T = ran.fields("T")[1]
    assert np.array_equal(ran.fields("T", t="end"), T[-1])
    assert np.array_equal(ran.fields("T", t="start"), T[0])
    assert not np.array_equal(T[0], T[-1])
    for t in ("last", [1.0, 2.0], np.array([1.0])):
        with pytest.raises(ResultsError, match='is no time: give one in seconds, "start" or "end"'):
            ran.fields("T", t=t)


def test_temperatures_are_drawn_in_the_unit_of_the_scene(ran: Results) -> None:
    assert ran.header["temperature_unit"] == "degC"
    axes = ran.plot("lower.top.left")
    assert axes.get_ylabel() == "[degC]"
    assert axes.lines[0].get_ydata() == pytest.approx(ran.probe("lower.top.left", "degC")[1])
    assert ran.plot("lower.top.left", unit="K").get_ylabel() == "[K]"


def test_repr_is_one_line_on_the_run(ran: Results) -> None:
    title, end = ran.header["title"], ran.header["coupling"]["end"]
    assert repr(ran) == f"Results({title!r}: {ran.outcome}, t = {ran.t[-1]:g} of {end:g} s, {ran.path})"


def test_what_is_not_there_is_named(ran: Results) -> None:
    with pytest.raises(ResultsError, match="sigma_v"):
        ran.fields("sigma_w")
    with pytest.raises(ResultsError, match="outside the frames, from 0 to"):
        ran.fields("T", t=1e6)
    with pytest.raises(ResultsError, match=r"upper\.bottom"):
        ran.surface("upper.botom")
    with pytest.raises(ResultsError, match="several units"):
        ran.plot("lower.top.left", "interface.p")


def test_a_name_of_both_halves_is_asked_for_in_full(ran: Results) -> None:
    both = access.Fields({"thermal.a": ran.fields["thermal.q"], "mechanical.a": ran.fields["thermal.q"]}, ran)
    with pytest.raises(ResultsError, match=r"thermal\.a or mechanical\.a"):
        both("a")


def test_a_surface_is_in_order_along_it(ran: Results) -> None:
    for name in ("upper.bottom", "lower.top"):
        surface = ran.surface(name)
        assert len(surface.nodes) == 4
        assert surface.X[:, 0] == pytest.approx(surface.s, abs=1e-15)
        assert np.ptp(surface.X[:, 1]) == 0.0
    along = ran.contact["interface"]
    assert np.array_equal(ran.surface("upper.bottom").X, along.X)
    assert np.array_equal(ran.surface("upper.bottom").s, along.s)


def test_pandas_has_all_that_is_known_at_each_time(ran: Results) -> None:
    pytest.importorskip("pandas")
    frame = ran.to_pandas()
    assert np.array_equal(frame.index, ran.t)
    for name in ran.probe_names:
        assert np.array_equal(frame[name], ran.probe(name)[1])
        assert frame.attrs["units"][name] == ran.unit(name)
    assert np.array_equal(frame["thermal.T.max"], ran.extremes["thermal.T"][:, 1])
    assert frame["heat_balance.convection"].iloc[-1] == ran.ledger["convection"]


def test_xarray_has_fields_over_frames(ran: Results) -> None:
    pytest.importorskip("xarray")
    data = ran.to_xarray()
    times, q = ran.field("thermal.q")
    assert data["thermal.q"].dims == ("frame", "cell", "2 components")
    assert np.array_equal(data["thermal.q"], q)
    assert np.array_equal(data["frame"], times)
    assert data["thermal.T"].sel(frame=times[1]).attrs["units"] == "K"
    assert data["mechanical.sigma"].dims[-1] == "4 components"
    assert set(ran.fields) <= set(data)


def test_pyvista_has_both_halves_on_the_deformed_mesh(ran: Results) -> None:
    pytest.importorskip("pyvista")
    grid, mesh = ran.to_pyvista(t=150.0), ran.mesh()
    assert grid.n_cells == len(mesh.quads) + len(mesh.triangles)
    assert grid.points[:, :2] == pytest.approx(mesh.nodes + ran.fields("u", t=150.0), rel=1e-6, abs=1e-9)
    assert np.array_equal(grid.point_data["thermal.T"], ran.fields("T", t=150.0))
    assert grid.cell_data["mechanical.sigma_v"].shape == (grid.n_cells,)
    assert np.array_equal(grid.cell_data["body"], mesh.cell_body)
    assert list(grid.field_data["bodies"]) == ["lower", "upper"]
    assert np.array_equal(ran.to_pyvista().point_data["thermal.T"], ran.fields("T")[1][-1])


def test_a_package_that_is_missing_is_named_with_its_extra(ran: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(ResultsError, match=r"slideline\[data\]"):
        ran.to_pandas()


def test_plots_and_notebooks_show_the_probes(ran: Results) -> None:
    axes = ran.plot("lower.top.left", "lower.top.right", unit="degC")
    assert [line.get_label() for line in axes.get_lines()] == ["lower.top.left", "lower.top.right"]
    assert np.array_equal(axes.get_lines()[0].get_ydata(), ran.probe("lower.top.left", "degC")[1])
    html = ran._repr_html_()
    assert all(name in html for name in ran.probe_names)
    assert f"{ran.probe('lower.top.left')[1][-1]:.6g}" in html


def test_plot_is_shown_in_a_notebook(ran: Results) -> None:
    png = ran.plot("lower.top.left")._repr_png_()
    assert png.startswith(b"\x89PNG")
    assert len(png) > 5_000  # a curve with its axes, not an empty picture


def test_a_scenario_says_itself_in_three_lines() -> None:
    lines = repr(load_scenario(SCENARIOS / "sliding_blocks.yaml")).splitlines()
    assert len(lines) == 3
    assert "Sliding blocks" in lines[0]
    assert "1250 nodes, 1152 cells, 1 contact pair" in lines[1]
    assert "to t = 25000 s" in lines[2]
