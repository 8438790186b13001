"""A half in C that is wrong in one way at a time: `verify-half` names it, and so does a run.  FMI 2.0 and 3.0."""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from coupler import load_scenario, run
from coupler.errors import CouplingError, HalfError
from coupler.fmu.description import with_description
from coupler.scenario import Scenario
from coupler.verify.border import CheckVerdict
from coupler.verify.child import ALIVE, findings_of
from coupler.verify.matter import known_scene

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
from broken_halves import SCENE
from make import make_body, make_wall

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux",
                                reason="the half in C needs a C compiler (cc), which is not here")
START, NUMBERS = "starts as the scene", "numbers that can be"
ALL_AT_20 = {"bodies.lower.T0": 20, "bodies.upper.T0": 20, "thermal.boundary": [], "coupling.end": 6,
             "coupling.windows": [{"until": 6, "size": 1}]}


@dataclass(frozen=True)
class Wrong:
    """flags : as half.c names what is wrong.  check : the row that fails.  says : what that row says.

    run : what a run says, "" where it cannot see it.
    """

    flags: tuple[str, ...]
    check: str
    says: str
    run: str
    T_start: float = 293.15
    scale: float = 0.0  # of a mechanical half
    unit: str = "K"


WRONG = {
    "discards": Wrong(("DISCARDS",), "takes substeps", "takes no substep", "thermal.*gave no reason"),
    "not a number": Wrong(("NOT_A_NUMBER",), "takes substeps", "T[2] is not finite", r"T\[2\] is not finite"),
    "runs away": Wrong(("RUNS_AWAY",), NUMBERS, r"T[2] is 1e+09 K", r"T\[2\] is 1e\+09 K"),
    "crashes": Wrong(("CRASHES",), ALIVE, "ended by signal 11, asked to step from", "thermal.*signal 11"),
    "exits": Wrong(("EXITS",), ALIVE, "ended with code 0, asked to step from", "thermal.*process ended with code 0"),
    "hangs": Wrong(("HANGS",), ALIVE, "gave no answer for 5 s, asked to step from", "thermal.*5 s"),
    "degrees Celsius": Wrong((), START, "its first T[1] is 20 K", r"thermal.*first T\[\d+\] is 20 K.*degrees Celsius",
                             T_start=20.0),
    "hidden state": Wrong(("HIDDEN",), "same inputs, same bits", "T", ""),
    "keeps its own time": Wrong(("KEEPS_TIME",), "time passes", "a substep of 0.001 s changes T", ""),
    "millimetres": Wrong((), START, "its first x[", r"mechanical.*first x.*It is mm", scale=1e3),
    "displacements": Wrong(("DISPLACEMENTS",), START, "its first x[", "mechanical.*first x.*not how far they moved",
                           scale=1.0),
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "s.yaml"
    path.write_text(SCENE)
    return path


def made(case: Wrong, scenario: Scenario, folder: Path, fmi: int = 2) -> Path:
    i = scenario.interface
    if case.scale:
        return make_body(folder, i.nodes, case.scale, *case.flags, fmi=fmi)
    return make_wall(folder, len(i.nodes), len(i.pair_nodes), case.T_start, *case.flags, unit=case.unit, fmi=fmi)


def found(fmu: Path, scenario: Scenario, scratch: Path) -> dict[str, Any]:
    scratch.mkdir()
    border = known_scene(scenario.interface, scenario.models["thermal"], scenario.models["mechanical"])
    return {f.check: f for f in findings_of(fmu, scratch, 1.0, border, limit=5.0)}


# Each in one version of FMI here, and by a plain run in the other (test_plain_run.py).
@pytest.mark.few("exits-3", "hidden state-2")
@pytest.mark.parametrize(("name", "fmi"), [(name, 3 - k % 2) for k, name in enumerate(WRONG)])
def test_verify_half_names_it(name: str, fmi: int, scene: Path, tmp_path: Path) -> None:
    case, scenario = WRONG[name], load_scenario(scene, overrides=ALL_AT_20)
    finding = found(made(case, scenario, tmp_path / "half", fmi), scenario, tmp_path / "scratch")[case.check]
    assert finding.verdict is CheckVerdict.FAIL
    assert case.says in finding.reason
    assert finding.remedy


# Each in one version of FMI, a crash in both.
@pytest.mark.few("discards-2")
@pytest.mark.parametrize(("name", "fmi"), [*((name, 2 + k % 2) for k, name in enumerate(WRONG) if WRONG[name].run),
                                           ("crashes", 2)])
def test_a_run_names_it(name: str, fmi: int, scene: Path, tmp_path: Path) -> None:
    case = WRONG[name]
    fmu = made(case, load_scenario(scene, overrides=ALL_AT_20), tmp_path / "half", fmi)
    role = "mechanical" if case.scale else "thermal"
    swap: dict[str, Any] = {"mechanical.half": "rigid", f"{role}.half": str(fmu), "coupling.deadlines.thermal": 5}
    with pytest.raises((HalfError, CouplingError), match=f"(?s){case.run}"):
        run(load_scenario(scene, overrides=ALL_AT_20 | swap), out=tmp_path / "run.h5", verify="never")


@pytest.mark.few("Float32-Float32")
@pytest.mark.parametrize(("type_", "kind"), [("Float32", "Float32"), ("Int64", "Integer")])
def test_an_array_of_another_type_is_named(type_: str, kind: str, scene: Path, tmp_path: Path) -> None:
    """Of numbers of 32 bits the half would be told nonsense, of whole ones no more than their whole part."""
    scenario = load_scenario(scene, overrides=ALL_AT_20)
    i = scenario.interface
    fmu = with_description(make_wall(tmp_path / "half", len(i.nodes), len(i.pair_nodes), 293.15, fmi=3),
                           lambda xml: re.sub(rb'Float64( name="x".*?)Float64', f"{type_}\\1{type_}".encode(), xml),
                           tmp_path / "other.fmu")
    finding = found(fmu, scenario, tmp_path / "scratch")["types"]
    assert (finding.verdict, finding.reason) == (CheckVerdict.FAIL, f"x is {kind}, not Real")
    with pytest.raises(HalfError, match=f"thermal.*its x is of type {kind}, not Real"):
        run(load_scenario(scene, overrides=ALL_AT_20 | {"mechanical.half": "rigid", "thermal.half": str(fmu)}),
            out=tmp_path / "run.h5", verify="never")


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_one_that_is_right_in_degrees_celsius_passes_and_runs(fmi: int, scene: Path, tmp_path: Path) -> None:
    """Its description says degC, so the border makes kelvin of it; without a state it is told what that costs."""
    scenario, n = load_scenario(scene, overrides=ALL_AT_20), 21
    fmu = make_wall(tmp_path / "half", n, len(scenario.interface.pair_nodes), 20.0, unit="degC", state=False,
                    fmi=fmi)
    rows = found(fmu, scenario, tmp_path / "scratch")
    assert [check for check, f in rows.items() if f.verdict is CheckVerdict.FAIL] == []
    assert rows["keeps its state"].verdict is CheckVerdict.NOT_APPLICABLE
    assert "no second try" in rows["keeps its state"].remedy
    assert rows["units converted"].reason == "T from degC"
    assert rows["substeps converge"].verdict is CheckVerdict.PASS
    swap = {"mechanical.half": "rigid", "thermal.half": str(fmu)}
    results = run(load_scenario(scene, overrides=ALL_AT_20 | swap), out=tmp_path / "run.h5")
    assert results.outcome == "completed"
    assert results.probe("T", unit="degC")[1][-1] == pytest.approx(140.0 - 120.0 * 2.718281828459045**(-6.0 / 30.0))
