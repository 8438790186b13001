"""CalculiX as either half of a whole run: the thermal half of the bars, the mechanical half of a press fit.

Each is run by `slideline run --swap ROLE=ccx --compare`, in processes, stopped and resumed, and held by `verify-half`.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from coupler import Results, load_scenario, run
from coupler.cli.cli import app
from coupler.cli.verifying import fmu_of
from coupler.running.resume import resume, resumed
from coupler.verify.border import CheckVerdict
from coupler.verify.child import findings_of

pytestmark = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed (calculix-ccx)")

ROOT = Path(__file__).parents[2]
BARS = {"end: 2000": "end: 100", "until: 2000, first: 1, last: 100": "until: 100, size: 25",
        "method: sdirk2": "method: backward_euler"}
FIT = """\
slideline: 2
title: A core of aluminium is heated in a seat of steel
units: {temperature: degC}
geometry: plane
materials:
  steel: {rho: 7850, c: 480, k: 45, E: 2.1e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20}
  aluminium: {rho: 2700, c: 900, k: 210, E: 7.0e10, nu: 0.33, alpha: 2.3e-5, T_ref: 20}
bodies:
  core: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.02], cells: [3, 3]}}, material: aluminium, T0: 20}
  seat: {mesh: {rectangle: {origin: [0.02, 0], size: [0.02, 0.02], cells: [2, 4]}}, material: steel, T0: 20}
contact:
  fit:
    slave: core.right
    master: seat.left
    gap_max: 0.001
    penalty: 1.0e14
    conduction: {closed: {law: constant, h: 3000}, open: null}
thermal:
  boundary: [{on: core.left, temperature: 120}, {on: seat.right, temperature: 20}]
mechanical:
  half: elastic
  elastic:
    boundary:
      - {on: core.left, u_x: 0}
      - {on: core.bottom, u_y: 0}
      - {on: seat.right, u_x: 0}
      - {on: seat.bottom, u_y: 0}
coupling: {scheme: staggered, end: 40, windows: [{until: 40, size: 10}]}
probes:
  p: {p: {mean: core.right}}
  T: {T: {mean: core.right}}
  u: {u_y: core.top.right}
"""
OF = {"thermal": "bars.yaml", "mechanical": "fit.yaml"}
HALF_WAY = {"thermal": 50.0, "mechanical": 20.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both scenes, and each as run and compared with our half: ROLE.h5, ROLE-own.h5, ROLE.txt."""
    there = tmp_path_factory.mktemp("calculix")
    bars = (ROOT / "scenarios/heated_bars.yaml").read_text(encoding="utf-8")
    for old, new in BARS.items():
        bars = bars.replace(old, new)
    (there / "bars.yaml").write_text(bars, encoding="utf-8")
    (there / "fit.yaml").write_text(FIT, encoding="utf-8")
    for role, name in OF.items():
        # An option of ccx belongs to ccx: our half, with which it is compared, has none.
        words = ["run", str(there / name), "-o", str(there / f"{role}.h5"), "--swap", f"{role}=ccx", "--compare", "-q",
                 "--set", f"{role}.options.time_limit=90"]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
        (there / f"{role}.txt").write_text(done.output, encoding="utf-8")
    return there


def scene(folder: Path, role: str) -> Any:
    return load_scenario(folder / OF[role], overrides={f"{role}.half": "ccx", f"{role}.options.time_limit": 90})


def off(folder: Path, role: str, probe: str) -> tuple[float, float]:
    """The largest difference of a probe, and the largest change of its value, of our own run."""
    (_, a), (_, b) = (Results(folder / f"{role}{own}.h5").probe(probe) for own in ("", "-own"))
    return float(np.abs(a - b).max()), float(np.ptp(b))


@pytest.mark.parametrize("role", OF)
def test_the_comparison_says_the_same(role: str, folder: Path) -> None:
    said = (folder / f"{role}.txt").read_text(encoding="utf-8")
    assert f"{role}.h5 and {role}-own.h5 say the same within error: 6 of 6 probes and fields" in said
    halves = Results(folder / f"{role}.h5").header["halves"]
    assert halves[role] == f"{role}_ccx"


def test_heat_through_the_bars_is_ours_and_balanced(folder: Path) -> None:
    """In windows of 25 s what differs is where ccx stores heat: 1.4 K of 177 K in the first one."""
    for probe in ("hot.top", "cold.bottom"):
        by, of = off(folder, "thermal", probe)
        assert 0.0 < by < 0.01 * of, probe
    assert abs(Results(folder / "thermal.h5").heat_imbalance) < 1e-7


def test_the_press_fit_is_ours(folder: Path) -> None:
    """Other elements: 0.1 % of the displacement; the pressure, which the seat resists, by 0.02 %."""
    for probe, most in (("p", 1e-3), ("u", 3e-3), ("T", 1e-5)):
        by, of = off(folder, "mechanical", probe)
        assert 0.0 < by < most * of, probe
    assert Results(folder / "mechanical.h5").probe("p")[1].max() > 1.5e8


def assert_same_bits(a: Results, b: Results) -> None:
    assert a.outcome == b.outcome == "completed"
    for probe in a.probe_names:
        np.testing.assert_array_equal(a.probe(probe)[1], b.probe(probe)[1], err_msg=probe)


@pytest.mark.slow
@pytest.mark.parametrize("role", OF)
def test_in_processes_it_is_the_same_to_the_bit(role: str, folder: Path) -> None:
    there = run(scene(folder, role), folder / f"{role}-processes.h5", processes=True)
    assert_same_bits(Results(folder / f"{role}.h5"), there)


@pytest.mark.slow
@pytest.mark.parametrize("role", OF)
def test_resumed_it_is_the_same_to_the_bit(role: str, folder: Path) -> None:
    out = folder / f"{role}-resumed.h5"
    assert run(scene(folder, role), out, until=HALF_WAY[role]).outcome == "stopped"
    assert_same_bits(Results(folder / f"{role}.h5"), resume(resumed(out)))


@pytest.mark.slow
@pytest.mark.parametrize("role", OF)
def test_it_keeps_to_the_interface_specification(role: str, folder: Path, tmp_path: Path) -> None:
    found = fmu_of(f"{role}=ccx", folder / OF[role], tmp_path / "half")
    findings = {f.check: f for f in findings_of(found.fmu, tmp_path, 1.0, found.scene)}
    assert not [(f.check, f.reason) for f in findings.values() if f.verdict is CheckVerdict.FAIL]
    assert findings["hot and cold caches, same bits"].verdict is CheckVerdict.PASS
    if role == "thermal":
        assert findings["heat terms close"].verdict is CheckVerdict.PASS
