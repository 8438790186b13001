"""Heat that a half states as stored is held against rho c dT and latent heat of its temperatures."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half import build_fmu
from coupler import Results, load_scenario
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.laws import stored
from thermal_fmu.half import load

sys.path.insert(0, str(Path(__file__).parent))
from model_half import ModelHalf
from wrong_laws import SCENES, materials

Model = dict[str, Any]
MATERIALS = "latent: {L: 2.0e5, T_s: 580, T_l: 620}"
TWO_PHASES = SCENES["melting"].replace(
    "c: 1000, k: 5", "c: {solid: 1000, liquid: {T: [600, 900], value: [1500, 2500]}}, k: 5")
AT_ONCE = SCENES["melting"].replace(MATERIALS, "latent: {L: 2.0e5, T_m: 600}")
ALL = {**SCENES, "two phases": TWO_PHASES, "melts at once": AT_ONCE,
       "round, melting": TWO_PHASES.replace("geometry: plane", "geometry: axisymmetric")}


def told(folder: Path, scene: str, wrong: Callable[[Model], None] | None = None, mute: bool = False,
         f_s: bool = True, steps: int = 12, back: bool = False) -> Check:
    """What the row says of our half, told another model; heated and pressed together as it goes.

    f_s : whether it gives out its solid fraction.  back : whether bodies go back to where they were.
    """
    (folder / "s.yaml").write_text(ALL[scene])
    scenario = load_scenario(folder / "s.yaml")
    i, model = scenario.interface, json.loads(json.dumps(scenario.models["thermal"]))
    if wrong is not None:
        wrong(model)
    half = ModelHalf(load(i, model))
    names = ["T", *(["f_s"] if f_s and "f_s" in half.blocks else []),
             *([] if mute else [n for n in half.blocks if n.startswith("heat.stored.")])]
    none = np.zeros(0)

    def level(t: float, out: dict[str, Any]) -> Level:
        return Level(t, out["T"], i.nodes * 1.001, none, none, none, out.get("f_s"))

    watch = stored.StoredHeat(i, scenario.models["thermal"])
    log = watch.begun(level(0.0, half.initialise(0.0, 1.0, {}, {}, names)))
    E = np.full(len(i.quads), 2.0e3)
    for k in range(steps):
        heat = {"E_M": -E if back and 2 * k >= steps else E}
        out = dict(half.advance(float(k), 1.0, {**heat, "x": i.nodes * np.array([1.0 + 0.01 * k, 1.0])}, names).outputs)
        log = watch.watched(log, level(k + 1.0, out), {n: float(v) for n, v in out.items() if n.startswith("heat.")})
    (check,) = watch.checks(log, 300.0)
    return check


@pytest.mark.few("two phases-", "melting-without f_s", "round-")
@pytest.mark.parametrize("f_s", [True, False], ids=["", "without f_s"])
@pytest.mark.parametrize("scene", ["apart", "melting", "round", "two phases", "melts at once", "round, melting"])
def test_ours_is_that_of_its_temperatures(tmp_path: Path, scene: str, f_s: bool) -> None:
    """Phases, tables, the axis, bodies that move: to round-off, in which what the mesh leaves open has no share."""
    check = told(tmp_path, scene, f_s=f_s)
    assert check.verdict is TrustVerdict.HOLDS
    assert check.number < 1e-12


def hotter(above: float, factor: float, value: Any) -> Any:
    """A heat capacity larger by a factor above a temperature [K]."""
    T = sorted({*value["T"], above, above + 1.0}) if isinstance(value, dict) else [200.0, above, above + 1.0, 2000.0]
    old = np.interp(T, value["T"], value["value"]) if isinstance(value, dict) else np.full(len(T), value)
    return {"T": list(T), "value": [float(v * (factor if t > above else 1.0)) for t, v in zip(T, old, strict=True)]}


@pytest.mark.few("melts at once-changed-0.05", "round-changed-0.09")
@pytest.mark.parametrize(("scene", "wrong", "least"), [
    ("apart", materials(rho=lambda rho: 1.0), 0.9),
    ("apart", materials(c=lambda c: 1.1 * c), 0.09),
    ("round", materials(c=lambda c: c / 1.1), 0.09),
    ("apart", materials(c=partial(hotter, 800.0, 2.0)), 0.05),
    ("melting", materials(latent=lambda was: {**was, "L": 2.6e5}), 0.05),
    ("melts at once", materials(latent=lambda was: {**was, "L": 1.4e5}), 0.05),
    ("two phases", materials(c=lambda c: c["solid"] if isinstance(c, dict) and "solid" in c else c), 0.05),
])
def test_other_materials_are_named(tmp_path: Path, scene: str, wrong: Callable[[Model], None], least: float) -> None:
    check = told(tmp_path, scene, wrong)
    assert check.verdict is TrustVerdict.BROKEN, check
    assert check.number > least
    assert "from rho c dT of its temperatures" in check.what


def test_heat_that_came_and_went_is_not_forgotten(tmp_path: Path) -> None:
    check = told(tmp_path, "apart", materials(c=lambda c: 1.2 * c), back=True)
    assert check.number == pytest.approx(1.0 / 6.0, rel=0.02)


def test_a_body_at_rest_is_not_held_against_its_round_off(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(ALL["apart"])
    scenario = load_scenario(tmp_path / "s.yaml")
    i, none = scenario.interface, np.zeros(0)
    watch, T = stored.StoredHeat(i, scenario.models["thermal"]), np.full(len(scenario.interface.nodes), 300.0)
    log = watch.watched(watch.begun(Level(0.0, T, i.nodes, none, none, none)),
                        Level(1.0, T + 1e-13, i.nodes, none, none, none), {"heat.stored.lower": 1e-9})
    assert watch.checks(log, 100.0)[0].verdict is TrustVerdict.HOLDS


def test_quadrature_in_cells_in_place_of_nodes_is_right(tmp_path: Path) -> None:
    """Temperatures that jump within a cell, c that goes with them: the middle of the cell says 7 % less."""
    (tmp_path / "s.yaml").write_text(ALL["melting"])
    scenario = load_scenario(tmp_path / "s.yaml")
    i, none = scenario.interface, np.zeros(0)
    watch = stored.StoredHeat(i, scenario.models["thermal"])
    X = i.nodes
    upper = i.node_body == 1
    T0 = np.where(upper, 300.0, 500.0)
    T = np.where(upper & (X[:, 1] > X[upper, 1].max() - 1e-9), 900.0, T0)
    middle = T[i.quads].mean(axis=1)
    c = {"T": [300, 900], "value": [400, 900]}
    at = np.linspace(300.0, 900.0, 601)
    area = 0.01 * 0.02 / 3.0
    inside = sum(8000.0 * area * np.trapezoid(np.interp(at[at <= m], c["T"], c["value"]), at[at <= m])
                 for m, b in zip(middle, i.quad_body, strict=True) if b == 1)
    log = watch.watched(watch.begun(Level(0.0, T0, X, none, none, none)), Level(1.0, T, X, none, none, none),
                        {"heat.stored.upper": inside, "heat.stored.lower": 0.0})
    check = watch.checks(log, 600.0)[0]
    assert check.number < 1e-3
    at_nodes, is_open = watch._increase(log.start, Level(1.0, T, X, none, none, none))
    assert is_open[1] > 0.05 * at_nodes[1]


def test_what_there_is_not_to_compare_says_why(tmp_path: Path) -> None:
    check = told(tmp_path, "apart", mute=True)
    assert check.verdict is TrustVerdict.UNCHECKED
    assert "heat.stored.BODY" in check.what
    scenario = load_scenario(tmp_path / "s.yaml")
    model, i = scenario.models["thermal"], scenario.interface
    level = Level(0.0, np.full(len(i.nodes), 300.0), i.nodes, *[np.zeros(0)] * 3)
    bare = {**model, "materials": {"steel": {"k": 30.0}, "salt": {"k": 5.0}}}
    for said, watch in {"no density or heat capacity": stored.StoredHeat(i, bare),
                        "steady": stored.StoredHeat(i, {**model, "method": "steady"}),
                        "mesh of its own": stored.StoredHeat(i, model, own_mesh=True),
                        "leave out materials.rho, materials.c": stored.StoredHeat(i, model, False, [
                            "materials.rho", "materials.c"])}.items():
        (row,) = watch.checks(watch.begun(level), 1.0)
        assert row.verdict is TrustVerdict.UNCHECKED
        assert said in row.what


def test_physics_of_its_own_is_noted(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(ALL["apart"])
    scenario = load_scenario(tmp_path / "s.yaml")
    i, none = scenario.interface, np.zeros(0)
    watch = stored.StoredHeat(i, {**scenario.models["thermal"], "options": {"moist": 0.1}})
    T = np.full(len(i.nodes), 300.0)
    log = watch.watched(watch.begun(Level(0.0, T, i.nodes, none, none, none)),
                        Level(1.0, T + 10.0, i.nodes, none, none, none), {"heat.stored.lower": 0.0})
    assert watch.checks(log, 10.0)[0].verdict is TrustVerdict.NOTED


@pytest.mark.slow
def test_a_run_that_checks_no_half_ends_with_4(tmp_path: Path) -> None:
    """A heat capacity that is wrong above 400 K alone: nothing before the run meets it, and the balance closes."""
    bars = Path(__file__).resolve().parents[2] / "scenarios" / "heated_bars.yaml"
    scenario = load_scenario(bars)
    scenario.write_half("thermal", tmp_path / "half")
    file = tmp_path / "half" / "model.json"
    model = json.loads(file.read_text())
    materials(c=partial(hotter, 420.0, 1.3))(model)
    file.write_text(json.dumps(model))
    fmu = build_fmu(tmp_path / "half", tmp_path / "half.fmu", package="thermal_fmu", load="thermal_fmu.half:load")
    out = tmp_path / "run.h5"
    done = subprocess.run([sys.executable, "-m", "coupler.cli", "run", str(bars), "-o", str(out), "-q", "--no-verify",
                           "--swap", f"thermal={fmu}"], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 4, done.stdout + done.stderr
    rows = {c.name: c for c in Results(out).trust}
    assert rows[stored.NAME].verdict is TrustVerdict.BROKEN
    assert rows["heat balance"].verdict is TrustVerdict.HOLDS
