"""Bodies that begin where another run ended: exact on the same mesh, told on another, refused where it cannot be."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from coupler import Results, run
from coupler.errors import ScenarioError
from coupler.scenario.transfer import BodyNodes, moved

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import BAR, edited, linear, loaded, solved, temperatures

pytestmark = pytest.mark.usefixtures("unlooked")

WALL = [{"on": "bar.left", "temperature": 400.0}, {"on": "bar.right", "convection": {"h": 500.0, "T": 320.0}}]
STEPS = edited(BAR, thermal__boundary=WALL, thermal__method="backward_euler")


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with first.h5, a bar that warmed up for 20 s."""
    folder = tmp_path_factory.mktemp("first")
    solved(folder, STEPS, "first")
    return folder


@pytest.fixture
def beside(first: Path, tmp_path: Path) -> Path:
    """A copy of that folder, which may be spoilt."""
    return Path(shutil.copytree(first, tmp_path / "copy"))


def after(T0: Any = None, **more: Any) -> dict[str, Any]:
    return edited(STEPS, bodies__bar__T0={"from": "first.h5"} if T0 is None else T0, **more)


def refusal(folder: Path, doc: dict[str, Any]) -> ScenarioError:
    with pytest.raises(ScenarioError) as told:
        loaded(folder, doc)
    return told.value


def test_the_same_mesh_takes_every_value_as_it_was_and_goes_on_as_one_run(beside):
    """Backward Euler remembers nothing but T: two runs of 20 s are one of 40 s, but for what a solver leaves over."""
    one = solved(beside, edited(STEPS, coupling__end=40.0, coupling__windows=[{"until": 40.0, "size": 2.0}]), "one")
    two = solved(beside, after({"from": "first.h5", "t": "end"}), "two")
    np.testing.assert_array_equal(temperatures(two)[0], temperatures(Results(beside / "first.h5"))[-1])
    np.testing.assert_allclose(temperatures(two), temperatures(one)[10:], rtol=0, atol=1e-9)
    (note,) = two.header["notes"]
    assert note == "body bar starts from first.h5 at 20 s: the mesh is the same, every value as it was"
    (source,) = two.header["starts"]
    assert len(source["sha256"]) == 64
    assert (source["from"], source["of"], source["t"], source["worst"]) == ("first.h5", "bar", 20.0, 0.0)


def test_a_time_between_frames_is_on_a_straight_line(beside):
    T = temperatures(solved(beside, after({"from": "first.h5", "t": 7.0}), "two"))[0]
    first = temperatures(solved(beside, STEPS, "again"))
    np.testing.assert_allclose(T, 0.5 * (first[3] + first[4]), rtol=1e-12)  # a clock of ticks
    assert "between its frames at 6 and 8 s" in loaded(beside, after({"from": "first.h5", "t": 7.0})).notes[0]
    exact = temperatures(solved(beside, after({"from": "first.h5", "t": 6.0}), "three"))[0]
    np.testing.assert_array_equal(exact, first[3])


def test_another_body_of_another_name(beside):
    bar = after()["bodies"]["bar"]
    doc = after(bodies={"rod": {**bar, "T0": {"from": "first.h5", "body": "bar"}}},
                thermal__boundary=[{"on": "rod.left", "temperature": 400.0}])
    np.testing.assert_array_equal(temperatures(solved(beside, doc, "two"))[0],
                                  temperatures(solved(beside, STEPS, "again"))[-1])
    assert "body rod starts from first.h5, body bar, at 20 s" in loaded(beside, doc).notes[0]


@pytest.mark.few("other2", "other0")
@pytest.mark.parametrize("other", [{"cells": [7, 3]}, {"cells": [13, 1], "triangles": True},
                                   {"cells": [5, 5], "grading": [3.0, 0.5]}])
def test_a_linear_field_is_exact_on_any_mesh(tmp_path, other):
    T0 = {"terms": [{"t": 300.0}, {"t": 900.0, "x": {"polynomial": [0.0, 1.0]}},
                    {"t": 2000.0, "y": {"polynomial": [0.0, 1.0]}}]}
    solved(tmp_path, edited(BAR, bodies__bar__T0=T0), "first")
    doc = after({"from": "first.h5", "t": 0}, bodies__bar__mesh__rectangle={"origin": [0, 0], "size": [0.1, 0.02],
                                                                            **other})
    scenario = loaded(tmp_path, doc)
    x, y = scenario.interface.nodes.T
    np.testing.assert_allclose(scenario.interface.start["T"], 300.0 + 900.0 * x + 2000.0 * y, rtol=0, atol=1e-9)
    assert scenario.starts["bar"].source["worst"] < 1e-9


def test_the_error_told_is_that_of_there_and_back_and_falls_with_the_mesh(tmp_path):
    """Of a parabola on n cells, interpolated on 2 n and back, nothing is lost; on n/2 and back it is T'' h^2 / 8."""
    T0 = {"terms": [{"t": 300.0}, {"t": 1e4, "x": {"polynomial": [0.0, 0.0, 1.0]}}]}
    solved(tmp_path, edited(BAR, bodies__bar__T0=T0), "first")

    def told(n: int) -> tuple[float, str]:
        scenario = loaded(tmp_path, after({"from": "first.h5", "t": 0}, bodies__bar__mesh__rectangle__cells=[n, 2]))
        return float(scenario.starts["bar"].source["worst"]), scenario.notes[0]

    assert told(20)[0] < 1e-9
    h = 0.1 / 5
    worst, note = told(5)
    assert worst == pytest.approx(2e4 * h**2 / 8, rel=1e-6)
    assert f"interpolated there and back, its temperatures change by up to {worst:.3g} K" in note


def test_points_outside_are_counted_and_take_the_edge(tmp_path):
    solved(tmp_path, edited(BAR, bodies__bar__T0=linear(300.0, 1000.0)), "first")
    doc = after({"from": "first.h5", "t": 0}, bodies__bar__mesh__rectangle={
        "origin": [0, 0], "size": [0.104, 0.02], "cells": [13, 1]})
    scenario = loaded(tmp_path, doc)
    x = scenario.interface.nodes[:, 0]
    np.testing.assert_allclose(scenario.interface.start["T"], 300.0 + 1000.0 * np.minimum(x, 0.1), atol=1e-9)
    assert "2 nodes lie up to 0.004 m outside the mesh there and take the value of its edge" in scenario.notes[0]
    apart = edited(doc, bodies__bar__mesh__rectangle__origin=[5, 5])
    assert "no node of it lies in the body of that run" in str(refusal(tmp_path, apart))


def test_distorted_quads_hold_what_is_bilinear_in_them():
    """On a skewed mesh a linear field comes over exactly, at random points too."""
    rng = np.random.default_rng(4)
    X, Y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 5))
    nodes = np.stack([X.ravel(), Y.ravel()], axis=1)
    inner = ((nodes > 0) & (nodes < 1)).all(axis=1)
    nodes[inner] += rng.uniform(-0.05, 0.05, (inner.sum(), 2))
    grid = np.arange(30).reshape(5, 6)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    mesh = BodyNodes(nodes, quads, np.empty((0, 3), int))
    points = BodyNodes(rng.uniform(0, 1, (200, 2)), np.empty((0, 4), int), np.arange(3)[None])
    T = 3.0 + nodes @ (2.0, -7.0)
    np.testing.assert_allclose(moved(T, mesh, points).values, 3.0 + points.nodes @ (2.0, -7.0), atol=1e-12)


def test_the_temperature_unit_of_the_file_is_no_matter(beside):
    doc = after(units__temperature="degC", materials__steel__T_ref=20.0, thermal__boundary=[])
    T = loaded(beside, after()).interface.start["T"]
    np.testing.assert_array_equal(loaded(beside, doc).interface.start["T"], T)


def test_another_source_is_another_scenario(beside):
    before = loaded(beside, after()).hash
    assert loaded(beside, after()).hash == before
    solved(beside, edited(STEPS, bodies__bar__T0=301.0), "first.tmp")
    for half in ("", ".thermal", ".mechanical"):
        suffix = ".h5" if not half else ".vtkhdf"
        shutil.move(beside / f"first.tmp{half}{suffix}", beside / f"first{half}{suffix}")
    with h5py.File(beside / "first.h5", "r+") as f:
        header = json.loads(f.attrs["header"])
        header["field_files"] = {h: f"first.{h}.vtkhdf" for h in ("thermal", "mechanical")}
        f.attrs["header"] = json.dumps(header)
    assert loaded(beside, after()).hash != before


def _cut(folder: Path) -> None:
    data = (folder / "first.h5").read_bytes()
    (folder / "first.h5").write_bytes(data[:len(data) // 2])


def _changed(change: Callable[[Any], None], file: str = "first.h5") -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        with h5py.File(folder / file, "r+") as f:
            change(f)
    return spoil


def _replaced(name: str, value: Any) -> Callable[[Any], None]:
    def change(f: Any) -> None:
        del f[name]
        f[name] = value
    return change


def _led_away(f: Any) -> None:
    header = json.loads(f.attrs["header"])
    header["field_files"]["thermal"] = "../../secret.vtkhdf"
    f.attrs["header"] = json.dumps(header)


def _huge(f: Any) -> None:
    del f["mesh/quads"]
    f.create_dataset("mesh/quads", (10**9, 4), dtype="i8", chunks=(1000, 4))


def _linked(f: Any) -> None:
    del f["mesh/nodes"]
    f["mesh/nodes"] = h5py.ExternalLink("/etc/other.h5", "/x")


def _outside_storage(f: Any) -> None:
    del f["VTKHDF/PointData/T"]
    f.create_dataset("VTKHDF/PointData/T", (33 * 11,), dtype="f8", external=[("/dev/zero", 0, h5py.h5f.UNLIMITED)])


def _nan(f: Any) -> None:
    f["VTKHDF/PointData/T"][-1] = np.nan


def _cold(f: Any) -> None:
    f["VTKHDF/PointData/T"][-1] = -5.0


THERMAL = "first.thermal.vtkhdf"
SPOILT: dict[str, tuple[Callable[[Path], Any], str]] = {
    "no file": (lambda f: (f / "first.h5").unlink(), "there is no file"),
    "text": (lambda f: (f / "first.h5").write_text("T: 300"), "cannot be read as results of a run"),
    "cut": (_cut, "cannot be read as results of a run"),
    "another format": (_changed(lambda f: f.attrs.update(format="x")), "is not the results file of a run"),
    "no mesh": (_changed(lambda f: f.__delitem__("mesh")), "kept no mesh"),
    "no header": (_changed(lambda f: f.attrs.update(header="[" * 100_000)), "cannot be read as results of a run"),
    "header of a list": (_changed(lambda f: f.attrs.update(header="[1]")), "no header of a run"),
    "no field file": (lambda f: (f / THERMAL).unlink(), "there is no file"),
    "led away": (_changed(_led_away), "names no field file beside it"),
    "huge": (_changed(_huge), "more than a mesh"),
    "linked": (_changed(_linked), "leads to another place"),
    "stored outside": (_changed(_outside_storage, THERMAL), "no array of numbers"),
    "node that is not there": (_changed(lambda f: f["mesh/quads"].__setitem__((0, 0), 10**6)), "does not fit together"),
    "text for numbers": (_changed(_replaced("mesh/nodes", "abc")), "no array of numbers"),
    "fewer values": (_changed(_replaced("VTKHDF/PointData/T", np.zeros(5)), THERMAL), "has 5 values of T for 33 nodes"),
    "nan": (_changed(_nan, THERMAL), "T is not finite everywhere"),
    "below zero": (_changed(_cold, THERMAL), "reaches -5 K"),
    "no time": (_changed(_replaced("VTKHDF/Steps/Values", np.zeros(0)), THERMAL), "no frames in order of time"),
}


@pytest.mark.parametrize("case", SPOILT)
def test_a_file_that_cannot_be_is_refused_by_name(beside, case):
    spoil, words = SPOILT[case]
    spoil(beside)
    error = refusal(beside, after())
    assert words in str(error)
    assert error.key == "bodies.bar.T0.from"
    assert error.line > 1


def test_what_the_run_does_not_have_is_told_all_at_once_with_all_else(beside):
    bar = after()["bodies"]["bar"]
    doc = after(bodies={"bar": {**bar, "T0": {"from": "first.h5", "t": 21.0}}, "rod": {**bar, "T0": {
        "from": "first.h5"}}, "far": {**bar, "T0": {"from": "first.h5", "body": "bra"}},
        "odd": {**bar, "T0": 300.0, "Q_T": "none"}})
    error = refusal(beside, doc)
    told = {e.key: str(e) for e in (error, *error.others)}
    assert set(told) == {"bodies.bar.T0.t", "bodies.rod.T0", "bodies.far.T0.body", "bodies.odd.Q_T"}
    assert "has frames from 0 to 20 s" in told["bodies.bar.T0.t"]
    assert "has no body 'rod'" in told["bodies.rod.T0"]
    assert "Did you mean 'bar'?" in told["bodies.far.T0.body"]
    assert "not the path" in str(refusal(beside, after({"from": ""})))
    assert refusal(beside, after({"from": "first.h5", "t": "begin"})).key == "bodies.bar.T0.t"
    assert refusal(beside, after({"from": "first.h5", "t": -1})).key == "bodies.bar.T0.t"
    assert "one temperature a body" in str(refusal(beside, after(thermal__half="lumped", thermal__method="midpoint")))


def test_a_run_that_ended_early_is_told(beside):
    from start_scenes import without_fmus
    scenario = loaded(beside, STEPS, "early")
    with without_fmus():
        run(scenario, beside / "early.h5", until=10.0)
    assert "at 10 s (that run ended early: stopped)" in loaded(beside, after({"from": "early.h5"})).notes[0]


@pytest.mark.slow
def test_embedded_codec_and_processes_give_the_same_bits(beside):
    doc = after(coupling__end=6.0, coupling__windows=[{"until": 6.0, "size": 2.0}])
    a = run(loaded(beside, doc), beside / "a.h5")
    b = run(loaded(beside, edited(doc, coupling__link="codec")), beside / "b.h5")
    c = run(loaded(beside, doc), beside / "c.h5", processes=True)
    for other in (b, c):
        np.testing.assert_array_equal(temperatures(a), temperatures(other))
