"""`slideline compare`: the same scene first, then the same within error, or from when on and where not."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from coupler import load_scenario, run
from coupler.cli.cli import app
from coupler.cli.options import own_scenario_of
from coupler.errors import ResultsError, ScenarioError
from coupler.record.results import Results
from coupler.report.verdict import Bound, bounds_of, verdict

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, write_run

CASE = Case(frames=2, reject=0)
NAME = "lower.top.left"
BARS = Path(__file__).resolve().parents[2] / "scenarios/heated_bars.yaml"


def errors_of(r: Results, share: float) -> None:
    """Gives every probe an error that is a share of its range."""
    r.totals["probe_errors"] = {n: {"error": share * float(np.ptp(r.probe(n)[1])), "range": 1.0, "unit": r.unit(n)}
                                for n in r.probe_names}


@pytest.fixture
def runs(tmp_path: Path) -> tuple[Results, Results]:
    """A run, and the same 3 K off in one probe from its window 10 on."""
    a = write_run(tmp_path / "a.h5", CASE)
    write_run(tmp_path / "b.h5", CASE)
    with h5py.File(tmp_path / "b.h5", "r+") as f:
        f[f"probes/{NAME}"][10:] += 3.0
    return a, Results(tmp_path / "b.h5")


def test_runs_are_the_same_within_what_both_may_be_off_by(runs):
    a, b = runs
    for r in runs:
        errors_of(r, 1.0)
    found = verdict(a, b, {})
    assert not found.differs
    assert "b.h5 and a.h5 say the same within error: " in found.text(("a.h5", "b.h5"))
    off = next(j for j in found.judged if j.name == NAME)
    assert off.off == pytest.approx(3.0)
    assert off.allowed == pytest.approx(2.0 * np.ptp(a.probe(NAME)[1]), rel=0.05)


def test_runs_differ_from_the_first_time_on_and_there(runs):
    a, b = runs
    for r in runs:
        errors_of(r, 1e-6)
    found = verdict(a, b, {})
    assert found.differs
    first = found.apart[0]
    assert (first.name, first.first) == (NAME, a.t[10])
    told = found.text(("a.h5", "b.h5"))
    assert told.startswith(f"b.h5 differs from a.h5, first at t = {a.t[10]:.6g} s, at {NAME}: ")
    assert "allowed" in told


@pytest.mark.few("pressure-3e-05-True", "upper.bottom.centre-3e-06-False")
@pytest.mark.parametrize(("share", "differs"), [(3e-6, False), (3e-5, True)])
@pytest.mark.parametrize("name", ["pressure", "upper.bottom.centre"])
def test_what_is_held_is_solved_for_to_a_part_of_what_it_is(tmp_path, name, share, differs):
    """A pressure of 10 MPa, a temperature beside 1000 K of others: neither has a range of its own."""
    runs = [write_run(tmp_path / f"{n}.h5", CASE) for n in "ab"]
    size = {"pressure": 1e7, "upper.bottom.centre": 1000.0}[name]
    for r, off in zip(runs, (0.0, share * size), strict=True):
        with h5py.File(r.path, "r+") as f:
            f[f"probes/{name}"][:] = (1e7 if name == "pressure" else 1273.15) + off
            if name != "pressure":
                f["probes/lower.top.left"][:] = np.linspace(273.15, 1273.15, len(f["probes/lower.top.left"]))
    runs = [Results(r.path) for r in runs]
    for r in runs:
        errors_of(r, 1e-9)
    found = verdict(*runs, {})
    judged = next(j for j in found.judged if j.name == name)
    assert judged.allowed == pytest.approx(1e-5 * size, rel=1e-3)
    assert (judged.first is not None) is differs


@pytest.mark.few("T=2.9K-True", "lower.top.left=3.1K-False")
@pytest.mark.parametrize(("within", "differs"), [("T=3.1K", False), ("T=2.9K", True), (f"{NAME}=3.1K", False),
                                                 ("T=0.001%", True)])
def test_what_was_asked_for_is_what_is_allowed(runs, within, differs):
    a, b = runs
    for r in runs:
        errors_of(r, 1e-6)
    assert verdict(a, b, bounds_of(within)).differs is differs


def test_a_probe_of_which_no_error_is_known_is_not_judged(runs):
    a, b = runs
    errors_of(a, 1.0)
    found = verdict(a, b, bounds_of("T=5K"))
    assert {j.name for j in found.judged if "." in j.name} >= {NAME}
    assert "gap" in found.unjudged
    assert "not judged, for no error of it is known: " in found.text(("a", "b"))


def test_two_scenes_get_no_verdict_and_no_exit_code_0(tmp_path):
    a = write_run(tmp_path / "a.h5", CASE)
    b = write_run(tmp_path / "b.h5", replace(CASE, windows=20))
    a.header["scenario"]["resolved"] = {"bodies": {"lower": {"T0": 20}}, "coupling": {"end": 5}}
    b.header["scenario"]["resolved"] = {"bodies": {"lower": {"T0": 30}}, "coupling": {"end": 6}}
    found = verdict(a, b, bounds_of("T=1000K"))
    assert found.changed == (("bodies.lower.T0", "20", "30"),)
    assert found.text(("a", "b")) == "no verdict: a and b are of two scenes (bodies.lower.T0: 20 against 30)."
    assert not found.judged


def test_how_a_scene_is_solved_is_no_other_scene(tmp_path):
    a = write_run(tmp_path / "a.h5", CASE)
    b = write_run(tmp_path / "b.h5", CASE)
    cells = "bodies", "lower", "mesh", "rectangle", "cells"
    for r, n in ((a, 8), (b, 16)):
        tree: dict = {"thermal": {"half": f"h{n}", "method": "theta"}, "mechanical": {"half": f"m{n}"}}
        at = tree
        for key in cells[:-1]:
            at = at.setdefault(key, {})
        at["cells"] = [n, n]
        r.header["scenario"]["resolved"] = tree
    found = verdict(a, b, bounds_of("T=1K,gap=1mm,p=1MPa,u_y=1mm"))
    assert not found.changed
    assert "the meshes differ" in found.text(("a", "b"))


@pytest.mark.parametrize(("text", "bounds"), [
    ("T=1K", {"T": Bound(1.0)}), ("T=1K,p=1%", {"T": Bound(1.0), "p": Bound(0.01, True)}),
    ("u_y=2mm", {"u_y": Bound(2e-3)}), ("T=1degC", {"T": Bound(1.0)}), ("p=1e5", {"p": Bound(1e5)}),
    ("a.b=1.5e-3MPa", {"a.b": Bound(1500.0)})])
def test_bounds(text, bounds):
    found = bounds_of(text)
    assert found.keys() == bounds.keys()
    assert all(found[n].value == pytest.approx(b.value) and found[n].of_range == b.of_range for n, b in bounds.items())


@pytest.mark.parametrize("text", ["T", "T=", "=1K", "T=K", "T=-1K", "T=1parsec", "T=nan"])
def test_what_is_no_bound_is_refused(text):
    with pytest.raises(ScenarioError, match=r"--within.*a bound is QUANTITY=NUMBER"):
        bounds_of(text)


def test_fields_of_real_runs_are_judged_on_contact_surfaces(tmp_path):
    """The bars, and the same in windows of another size: fields differ by the windows' error and no more."""
    scene = {"coupling.end": 20, "coupling.windows": [{"until": 20, "size": 1}]}
    a = run(load_scenario(BARS, overrides=scene), tmp_path / "a.h5")
    finer = {**scene, "coupling.windows": [{"until": 20, "size": 0.5}]}
    b = run(load_scenario(BARS, overrides=finer), tmp_path / "b.h5")
    found = verdict(a, b, bounds_of("T=5K,p=1%"))
    field = next(j for j in found.judged if j.name == "thermal.T")
    assert 0.0 < field.off <= field.most
    assert field.where == " on contact surfaces"
    assert not found.differs
    assert verdict(a, b, bounds_of("T=1e-6K,p=1%")).differs
    nodes = len(read_nodes(a))
    assert field.off <= field.most <= np.sqrt(nodes) * field.off


def read_nodes(r: Results) -> np.ndarray:
    return r.field("thermal.T")[1][0]


def test_the_command_ends_with_5_where_runs_differ(tmp_path):
    write_run(tmp_path / "a.h5", CASE)
    write_run(tmp_path / "b.h5", CASE)
    with h5py.File(tmp_path / "b.h5", "r+") as f:
        f[f"probes/{NAME}"][10:] += 3.0
    for within, code in (("T=5K,gap=1m,p=1GPa,u_y=1m", 0), ("T=1K", 5)):
        done = CliRunner().invoke(app, ["compare", str(tmp_path / "a.h5"), str(tmp_path / "b.h5"), "--within", within])
        assert done.exit_code == code, done.output
        told = CliRunner().invoke(app, ["compare", str(tmp_path / "a.h5"), str(tmp_path / "b.h5"), "--within", within,
                                        "--json"])
        facts = json.loads(told.output)
        assert (told.exit_code, facts["same"], facts["page"]) == (code, code == 0, str(tmp_path / "b-against-a.html"))
        assert facts["verdict"] in done.output


@pytest.mark.slow
def test_run_with_compare_swaps_runs_and_judges(tmp_path):
    out = tmp_path / "rod.h5"
    done = CliRunner().invoke(app, ["run", str(BARS), "-o", str(out), "--swap", "thermal=lumped", "--compare", "--set",
                                    "coupling.end=5", "--set", "coupling.windows=[{until: 5, size: 1}]",
                                    "--within", "T=1e-3K"])
    assert done.exit_code == 5, done.output
    assert "rod.h5 differs from rod-own.h5, first at t = " in done.output
    assert Results(tmp_path / "rod-own.h5").header["halves"]["thermal"] == "thermal"
    with pytest.raises(ScenarioError, match="no half is swapped"):
        CliRunner().invoke(app, ["run", str(BARS), "--compare"], catch_exceptions=False)


def test_what_our_own_half_would_be_given_to_compare_is_told_before_anything_runs(tmp_path):
    """Options belong to the half that is swapped in; what is wrong with our own run is told at once."""
    words = ["run", str(BARS), "-o", str(tmp_path / "a.h5"), "--compare", "--swap", "thermal=ccx"]
    own = own_scenario_of(BARS, ["thermal.options.time_limit=5", "coupling.end=5",
                                 "coupling.windows=[{until: 5, size: 1}]"], ["thermal=ccx"])
    assert own.thermal_half == "thermal"
    assert own.coupling.end == 5.0
    with pytest.raises(ScenarioError, match="options are for halves of other packages"):
        CliRunner().invoke(app, [*words, "--set", "mechanical.options.contact=force"], catch_exceptions=False)
    (tmp_path / "a-own.h5").mkdir()
    with pytest.raises(ResultsError, match="a-own"):
        CliRunner().invoke(app, words, catch_exceptions=False)
    assert not (tmp_path / "a.h5").exists()


def test_run_with_compare_and_json_prints_one_document_and_quiet_holds_for_both_runs(tmp_path):
    out = tmp_path / "rod.h5"
    done = CliRunner().invoke(app, ["run", str(BARS), "-o", str(out), "--swap", "thermal=lumped", "--compare", "--set",
                                    "coupling.end=5", "--set", "coupling.windows=[{until: 5, size: 1}]",
                                    "--within", "T=1e-3K", "--json", "-q"])
    assert done.exit_code == 5, done.output
    told = json.loads(done.stdout)
    assert (told["file"], told["comparison"]["same"]) == (str(out), False)
    assert "rod.h5 differs from rod-own.h5, first at t = " in told["comparison"]["verdict"]
    assert Path(told["comparison"]["page"]).exists()
    assert done.stderr == ""


STEPPED = """
slideline: 2
units: {temperature: K}
geometry: plane
materials: {steel: {rho: 7800, c: 480, k: 45}}
bodies:
  plate: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.01], cells: [2, 1]}}, material: steel, T0: 300}
thermal: {boundary: [{on: plate.left, flux: 2.0e4}, {on: plate.right, convection: {h: 500, T: 300}}]}
mechanical: {half: rigid}
coupling: {end: 600, scheme: iterated, windows: [{until: 600, size: SIZE}]}
probes:
  T: {T: {mean: plate}}
  step: {thermal.heat.flux: value}
"""


def test_windows_that_end_elsewhere_are_no_difference(tmp_path):
    """The line through one is off by 0.1 K for its bend; what a step moves goes with its length: nobody judges it."""
    found = []
    for size in (50, 40):
        (tmp_path / "s.yaml").write_text(STEPPED.replace("SIZE", str(size)))
        found.append(run(load_scenario(tmp_path / "s.yaml"), tmp_path / f"{size}.h5"))
    judged = verdict(*found, {"T": Bound(0.05)})
    assert not judged.differs
    assert judged.unjudged == ("step",)
