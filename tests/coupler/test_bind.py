"""`bind`: an FMU of another tool, with names, units and signs of its own, runs as it is."""

from __future__ import annotations

import hashlib
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from coupler import Results, load_scenario, run
from coupler.cli import cli
from coupler.errors import ScenarioError
from coupler.fmu import description
from coupler.fmu.bind import bind, check_bindings
from coupler.fmu.description import read_description, unpack, with_description

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
from make import SLOPE, T_HOT, TAU, make
from scenario_text import ROOT

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux", reason="needs a C compiler")
BIND: dict[str, Any] = {"T": {"name": "wall.T_{i0}"}, "x": {"name": "node{i}.{xy}", "unit": "mm"},
                        "contact.t_N": {"name": "press({i})", "unit": "MPa", "sign": -1}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The heated bars, whose thermal half is the wall of another tool."""
    path = tmp_path_factory.mktemp("bind")
    shutil.copy(ROOT / "scenarios/heated_bars.yaml", path / "s.yaml")
    interface = load_scenario(path / "s.yaml").interface
    make(path, len(interface.nodes), len(interface.pair_nodes))
    return path


def overrides(**bindings: Any) -> dict[str, Any]:
    return {"thermal.half": "wall.fmu", "bodies.hot.T0": 293.15, "bodies.cold.T0": 293.15, "thermal.boundary": [],
            "thermal.bind": BIND | {k.replace("__", "."): v for k, v in bindings.items()},
            "coupling.end": 20, "coupling.windows": [{"until": 20, "size": 2}], "coupling.scheme": "staggered"}


def test_it_runs_as_its_own_law_says_in_units_of_ours(folder: Path) -> None:
    """From 20 degC towards 120 degC and 5 K for each MPa of pressure, which stands at 1 MPa: t_N = -p."""
    content = hashlib.sha256((folder / "wall.fmu").read_bytes()).hexdigest()
    # It is checked first where it is one of FMI 3 (test_bind3.py).
    results = run(load_scenario(folder / "s.yaml", overrides=overrides()), out=folder / "run.h5", verify="never")
    assert results.outcome == "completed"
    t, found = results.probe("hot.top", unit="degC")
    end = T_HOT + SLOPE * 1.0
    assert found == pytest.approx(end + (20.0 - end) * np.exp(-t / TAU), abs=1e-9)
    assert hashlib.sha256((folder / "wall.fmu").read_bytes()).hexdigest() == content


def test_positions_arrive_in_its_own_unit(folder: Path, tmp_path: Path) -> None:
    scenario = load_scenario(folder / "s.yaml", overrides=overrides())
    fmu = bind(scenario, "thermal", folder / "wall.fmu", tmp_path / "bound.fmu")
    fields = read_description(unpack(fmu, tmp_path / "bound")).fields
    n, n_q = len(scenario.interface.nodes), len(scenario.interface.pair_nodes)
    assert {k: f.block.shape for k, f in fields.items()} == {"T": (n,), "x": (n, 2), "contact.t_N": (n_q,)}
    assert fields["x"].conversion.factor == 1e-3
    assert fields["contact.t_N"].conversion.factor == -1e6
    assert fields["T"].conversion.offset == 273.15
    assert fields["T"].block.causality == "output"
    assert fields["x"].references.reshape(n, 2)[3].tolist() == [1006, 1007]


def test_an_offset_is_added_in_si(folder: Path, tmp_path: Path) -> None:
    given = overrides(T={"name": "wall.T_{i0}", "offset": 0.5})
    fmu = bind(load_scenario(folder / "s.yaml", overrides=given), "thermal", folder / "wall.fmu", tmp_path / "b.fmu")
    assert read_description(unpack(fmu, tmp_path / "b")).fields["T"].conversion.offset == pytest.approx(273.65)


@pytest.mark.parametrize(("name", "binding", "text", "remedy"), [
    ("T", {"name": "Temp_{i}"}, "no variable of the FMU has a name like 'Temp_{i}'", "wall.T_"),
    ("T", {"name": "press({i})"}, "names 7 variables, the last one [7], but T has shape (69,)", "of one mesh"),
    ("T", {"name": "wall.T_{i}"}, "but T has shape (69,)", "({i0}: at 0)"),
    ("T", {"name": "wall.T_{i}{i}"}, "'wall.T_{i}{i}' has {i} twice", "stands once"),
    ("x", {"name": "node{i}.{xy}"}, "does not say what 'node{i}.{xy}' are in", "State a `unit`: m"),
    ("T", {"name": "wall.T_1"}, "must have one {i}", "number of a row"),
    ("contact.t_N", {"name": "press({i})"}, "are in furlong, which cannot be made Pa", "MPa"),
    ("contact.t_N", {"name": "press({i})", "unit": "stone"}, "are in stone, which cannot be made Pa", "MPa"),
    ("temperature", {"name": "wall.T_{i0}"}, "a thermal half has no 'temperature' at its border", ""),
    ("sigma_v", {"name": "wall.T_{i0}"}, "a thermal half has no 'sigma_v' at its border", ""),
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


TYPED = (b'<TypeDefinitions><SimpleType name="Temp"><Real unit="degC"/></SimpleType><SimpleType name="Bare"><Real/>'
         b"</SimpleType></TypeDefinitions><ModelVariables>")


def typed(name: bytes) -> Any:
    """Changes a description so that the unit of the temperatures stands in a type."""
    return lambda xml: xml.replace(b"<ModelVariables>", TYPED).replace(
        b'<Real unit="degC"/></ScalarVariable>', b'<Real declaredType="' + name + b'"/></ScalarVariable>')


def test_the_unit_of_a_declared_type_is_the_variables(folder: Path, tmp_path: Path) -> None:
    """Those of an FMU that needs no bind, too."""
    fmu = with_description(folder / "wall.fmu", typed(b"Temp"), tmp_path / "typed.fmu")
    bound = bind(load_scenario(folder / "s.yaml", overrides=overrides()), "thermal", fmu, tmp_path / "bound.fmu")
    assert read_description(unpack(bound, tmp_path / "bound")).fields["T"].conversion.offset == 273.15
    own = with_description(fmu, lambda xml: re.sub(rb"wall\.T_([0-9]+)", lambda m: b"T[%d]" % (int(m[1]) + 1), xml),
                           tmp_path / "own.fmu")
    T = read_description(unpack(own, tmp_path / "own")).fields["T"]
    assert (T.declared, T.conversion.offset) == ("degC", 273.15)


@pytest.mark.parametrize(("change", "more", "key", "text"), [
    (typed(b"Bare"), {}, "T", "does not say what 'wall.T_{i0}' are in"),
    (lambda xml: xml.replace(b'"wall.T_1"', b'"wall.T_00"'), {}, "T",
     "names 'wall.T_0' and 'wall.T_00', both [1]"),
    (lambda xml: xml, {"f_s": {"name": "wall.T_{i0}", "unit": "1"}}, "f_s", "'wall.T_{i0}' are bound as T already"),
], ids=["a type without a unit", "a number twice", "a variable twice"])
def test_what_a_description_leaves_open_is_told(folder: Path, tmp_path: Path, change: Any, more: Any, key: str,
                                                text: str) -> None:
    fmu = with_description(folder / "wall.fmu", change, tmp_path / "changed.fmu")
    with pytest.raises(ScenarioError) as raised:
        bind(load_scenario(folder / "s.yaml", overrides=overrides(**more)), "thermal", fmu, tmp_path / "bound.fmu")
    assert (raised.value.key, raised.value.others) == (f"thermal.bind.{key}", ())
    assert text in raised.value.message


def test_an_archive_that_unpacks_to_more_than_any_half_has_is_not_read(folder: Path, tmp_path: Path,
                                                                       monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(description, "LIMIT", 1000)
    with pytest.raises(ScenarioError, match="unpacks to more than 0 GiB"):
        bind(load_scenario(folder / "s.yaml", overrides=overrides()), "thermal", folder / "wall.fmu", tmp_path / "b")
    assert not (tmp_path / "b").exists()


def test_check_and_run_tell_it_and_end_with_2(folder: Path) -> None:
    for command in (["check"], ["run", "-o", str(folder / "no.h5")]):
        sets = [f"{k}={v}" for k, v in overrides(T={"name": "gone{i}"}).items()]
        done = CliRunner().invoke(cli.app, [*command, str(folder / "s.yaml"), *(x for s in sets for x in ("--set", s))])
        assert isinstance(done.exception, ScenarioError) or done.exit_code == 2
        assert "gone{i}" in f"{done.exception}{done.output}"
    assert not (folder / "no.h5").exists()


def test_bindings_stay_where_the_half_is_another_kind(folder: Path) -> None:
    """A swap is one word."""
    scenario = load_scenario(folder / "s.yaml", overrides=overrides() | {"thermal.half": "thermal"})
    assert isinstance(run(scenario, out=folder / "own.h5", until=2.0), Results)
