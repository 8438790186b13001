"""`bind` of arrays: an FMU of FMI 3.0 with names, units and signs of its own."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import load_scenario, run
from coupler.errors import ScenarioError
from coupler.fmu.bind import bind, check_bindings
from coupler.fmu.description import read_description, unpack, with_description

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
from make import SLOPE, T_HOT, TAU, make
from scenario_text import ROOT

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux", reason="needs a C compiler")
BIND: dict[str, Any] = {"T": {"name": "wall.T"}, "x": {"name": "nodes", "unit": "mm"},
                        "contact.t_N": {"name": "press", "unit": "MPa", "sign": -1}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The heated bars, whose thermal half is the wall of another tool."""
    path = tmp_path_factory.mktemp("bind3")
    shutil.copy(ROOT / "scenarios/heated_bars.yaml", path / "s.yaml")
    interface = load_scenario(path / "s.yaml").interface
    make(path, len(interface.nodes), len(interface.pair_nodes), fmi=3)
    return path


def overrides(**bindings: Any) -> dict[str, Any]:
    return {"thermal.half": "wall.fmu", "bodies.hot.T0": 293.15, "bodies.cold.T0": 293.15, "thermal.boundary": [],
            "thermal.bind": BIND | {k.replace("__", "."): v for k, v in bindings.items()},
            "coupling.end": 20, "coupling.windows": [{"until": 20, "size": 2}], "coupling.scheme": "staggered"}


def test_it_runs_as_its_own_law_says_in_units_of_ours(folder: Path) -> None:
    """From 20 degC towards 120 degC and 5 K for each MPa of pressure, which stands at 1 MPa: t_N = -p."""
    results = run(load_scenario(folder / "s.yaml", overrides=overrides()), out=folder / "run.h5")
    assert results.outcome == "completed"
    t, found = results.probe("hot.top", unit="degC")
    end = T_HOT + SLOPE * 1.0
    assert found == pytest.approx(end + (20.0 - end) * np.exp(-t / TAU), abs=1e-9)


def test_unit_sign_and_offset_are_the_block_s(folder: Path, tmp_path: Path) -> None:
    given = overrides(T={"name": "wall.T", "offset": 0.5})
    scenario = load_scenario(folder / "s.yaml", overrides=given)
    fields = read_description(unpack(bind(scenario, "thermal", folder / "wall.fmu", tmp_path / "b.fmu"),
                                     tmp_path / "b")).fields
    n, n_q = len(scenario.interface.nodes), len(scenario.interface.pair_nodes)
    assert {k: f.block.shape for k, f in fields.items()} == {"time": (), "T": (n,), "x": (n, 2), "contact.t_N": (n_q,)}
    assert {k: (f.conversion.factor, f.conversion.offset, f.block.causality) for k, f in fields.items()} == {
        "time": (1.0, 0.0, "independent"), "T": (1.0, pytest.approx(273.65), "output"), "x": (1e-3, 0.0, "input"),
        "contact.t_N": (-1e6, 0.0, "input")}


@pytest.mark.parametrize(("name", "binding", "text", "remedy"), [
    ("T", {"name": "Temp"}, "the pattern 'Temp' must have one {i}", "the name of an array"),
    ("T", {"name": "press"}, "the array 'press' has shape (7,), but T has shape (69,)", "of one mesh"),
    ("x", {"name": "wall.T", "unit": "m"}, "'wall.T' has shape (69,), but x has shape (69, 2)", "of one mesh"),
    ("T", {"name": "wall.T_{i}"}, "no variable of the FMU has a name like 'wall.T_{i}'", "wall.T"),
    ("x", {"name": "nodes"}, "does not say what 'nodes' are in", "State a `unit`: m"),
    ("contact.t_N", {"name": "press"}, "'press' are in furlong, which cannot be made Pa", "MPa"),
    ("f_s", {"name": "wall.T", "unit": "1"}, "'wall.T' are bound as T already", "leave one of the two out"),
])
def test_what_does_not_fit_is_one_error_with_its_place(folder: Path, tmp_path: Path, name: str, binding: Any, text: str,
                                                       remedy: str) -> None:
    scenario = load_scenario(folder / "s.yaml", overrides=overrides(**{name.replace(".", "__"): binding}))
    with pytest.raises(ScenarioError) as raised:
        check_bindings(scenario, tmp_path)
    assert not raised.value.others
    assert raised.value.key == f"thermal.bind.{name}"
    assert text in raised.value.message
    assert remedy in raised.value.remedy


@pytest.mark.parametrize(("old", "new", "text"), [
    (b'Float64 name="wall.T"', b'Int32 name="wall.T"', "'wall.T' are of type Int32, not Real"),
    (b'start="7"', b'start="-7"', "a Dimension of press is '-7'"),
    (b'valueReference="2"', b'valueReference="1"', "have the same valueReference 1")])
def test_a_damaged_array_is_told(folder: Path, tmp_path: Path, old: bytes, new: bytes, text: str) -> None:
    def change(xml: bytes) -> bytes:
        assert old in xml
        lines = xml.replace(old, new, 1).split(b"\n")
        return b"\n".join(line.replace(b"/Float64", b"/Int32") if b"<Int32" in line else line for line in lines)

    fmu = with_description(folder / "wall.fmu", change, tmp_path / "changed.fmu")
    with pytest.raises(ScenarioError) as raised:
        bind(load_scenario(folder / "s.yaml", overrides=overrides()), "thermal", fmu, tmp_path / "bound.fmu")
    assert text in raised.value.message
