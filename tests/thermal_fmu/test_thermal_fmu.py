"""The whole road: YAML, its model.json, the FMU built of it, stepped by an FMI importer (A4, A9, A12, D2)."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from coupler.fmu.launch import build_half
from coupler.scenario import Scenario, load_scenario

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from thermal_scenes import EXPECTED  # noqa: E402

pytestmark = pytest.mark.slow

HEAD = "slideline: 2\nunits: {temperature: %s}\ngeometry: plane\n"
TAIL = "mechanical: {half: rigid}\ncoupling: {end: 1, windows: [{until: 1, size: 1}]}\n"

# NAFEMS T2: a rod, hot at one end, radiates from the other.
A4 = HEAD % "degC" + """
materials: {m: {rho: 7850, k: 55.6, c: 460}}
bodies: {rod: {mesh: {rectangle: {origin: [0, 0], size: [0.1, 0.01], cells: [10, 1]}}, material: m, T0: 26.85}}
thermal:
  method: steady
  sigma_SB: 5.67e-8
  boundary:
    - {on: rod.left, temperature: 726.85}
    - {on: rod.right, radiation: {emissivity: 0.98, T: 26.85}}
""" + TAIL

# Two-phase Stefan: aluminium freezes from a cold wall; the far end is out of reach for 10 s.
A9 = HEAD % "K" + """
materials:
  m: {rho: 2500, k: {solid: 210, liquid: 95}, c: {solid: 1100, liquid: 1180}, latent: {L: 3.97e5, T_m: 933}}
bodies: {rod: {mesh: {rectangle: {origin: [0, 0], size: [0.15, 0.01], cells: [300, 1]}}, material: m, T0: 940}}
thermal:
  method: sdirk2
  boundary: [{on: rod.left, temperature: 293.15}]
""" + TAIL

# dT/dt = -(1 + T) T, T(0) = 1, as a source that depends on temperature; exact: T/(1 + T) = e^-t / 2.
A12 = HEAD % "K" + """
materials: {m: {rho: 1, k: 1, c: 1}}
bodies:
  lump:
    mesh: {rectangle: {origin: [0, 0], size: [1, 1], cells: [1, 1]}}
    material: m
    T0: 1
    Q_T: -1
    Q_T_factor: {polynomial: [0, 1, 1]}
thermal: {method: theta, theta: 0.5}
""" + TAIL

# Two half-spaces, at 500 and 300, brought together.
D2 = HEAD % "K" + """
materials: {al: {rho: 1000, k: 210, c: 2750}, steel: {rho: 1000, k: 45, c: 3744}}
bodies:
  a:
    mesh: {rectangle: {origin: [0, 0], size: [0.6, 0.1], cells: [60, 1], grading: [0.005, 1]}}
    material: al
    T0: 500
  b:
    mesh: {rectangle: {origin: [0.6, 0], size: [0.4, 0.1], cells: [60, 1], grading: [200, 1]}}
    material: steel
    T0: 300
contact:
  face: {slave: b.left, master: a.right, gap_max: 0.1, conduction: {closed: {law: constant, h: 2000}, open: null}}
thermal: {boundary: []}
""" + TAIL

GROWTH = 1.04 ** np.arange(120)  # of the steps of D2, as in test_thermal_contact.py
A9_STEPS = np.full(100, 10 / 100)
N12 = (10, 20, 40, 80)
THROUGH = ("heat.temperature.in", "heat.temperature.out")
METHODS = {"theta_half": 0, "theta_one": 3}  # control.method: as in model.json; backward Euler


@dataclass(frozen=True)
class Run:
    """One plan of drive_fmu.py: steps [s], inputs, outputs."""

    text: str
    steps: np.ndarray
    outputs: tuple[str, ...]
    inputs: dict[str, float]


def through(rows: dict[str, np.ndarray]) -> np.ndarray:
    """Net heat through prescribed temperatures, into the bodies [J], a step."""
    return sum((rows[name] for name in THROUGH), np.zeros(1))


RUNS = {
    "A4": Run(A4, np.ones(1), ("T", *THROUGH, "heat.radiation", "iterations"), {}),
    "A9": Run(A9, A9_STEPS, ("T", "f_s", *THROUGH, "heat.stored.rod"), {}),
    **{f"A12 {name} {n}": Run(A12, np.full(n, 1 / n), ("T",), {"control.method": number})
       for name, number in METHODS.items() for n in N12},
    **{f"D2 {t}": Run(D2, GROWTH * t / GROWTH.sum(), ("T", "heat.contact.slave", "heat.contact.master"),
                      {"contact.t_N": -1e6}) for t in EXPECTED["D2"]["t"]},
}


@dataclass(frozen=True)
class Ran:
    """The scene and what its FMU gave: t and each output, a row a step."""

    scene: Scenario
    rows: dict[str, np.ndarray]

    def nodes(self, on: str) -> np.ndarray:
        return np.unique(self.scene.interface.surfaces[on])


@pytest.fixture(scope="module")
def ran(tmp_path_factory) -> dict[str, Ran]:
    """All cases, in one process of their own: an FMU stays in the interpreter that loaded it."""
    folder = tmp_path_factory.mktemp("thermal")
    scenes = {text: load(folder / f"{i}.yaml", text) for i, text in enumerate((A4, A9, A12, D2))}
    fmus = {}
    for i, (text, scene) in enumerate(scenes.items()):
        assert scene.write_half("thermal", folder / str(i)) == "thermal"
        fmus[text] = build_half("thermal", folder / str(i))
    plans = [{"fmu": str(fmus[r.text]), "out": str(folder / f"{n}.npz"), "steps": r.steps.tolist(), "inputs": r.inputs,
              "outputs": list(r.outputs)} for n, r in RUNS.items()]
    (folder / "plan.json").write_text(json.dumps(plans), encoding="utf-8")
    done = subprocess.run([sys.executable, str(HERE / "drive_fmu.py"), str(folder / "plan.json")], capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return {n: Ran(scenes[r.text], dict(np.load(folder / f"{n}.npz"))) for n, r in RUNS.items()}


def load(path: Path, text: str) -> Scenario:
    path.write_text(text, encoding="utf-8")
    return load_scenario(path)


def test_a4_a_rod_that_radiates(ran):
    case, rod = EXPECTED["A4"], ran["A4"]
    T_B = rod.rows["T"][-1][rod.nodes("rod.right")]
    assert np.abs(T_B - case["T_B"]).max() < case["tolerance"]
    # .05 K of 1000 K - T_B is .07 % of the flux.
    q = through(rod.rows)[-1] / 0.01
    assert q == pytest.approx(case["q"], rel=case["tolerance_q"])
    assert -rod.rows["heat.radiation"][-1] / 0.01 == pytest.approx(q, rel=1e-9)


def test_a9_two_phase_stefan(ran):
    """300 cells of .5 mm, 100 steps of sdirk2: the front moves 84 cells."""
    case, rod = EXPECTED["A9"], ran["A9"]
    X = rod.scene.interface.nodes
    row = np.flatnonzero(X[:, 1] == 0.0)
    front = np.trapezoid(rod.rows["f_s"][-1][row], X[row, 0])
    assert front == pytest.approx(case["front"], rel=case["tolerance_front"])
    late = rod.rows["t"] > 9.0  # the mean over the last second; q falls as t^-1/2
    q = -through(rod.rows)[late].sum() / 0.01 / late.sum() / A9_STEPS[0]
    assert q == pytest.approx(case["q_wall"] * np.sqrt(10.0) * 2 * (np.sqrt(10.0) - 3.0), rel=case["tolerance_q"])
    at_05 = np.interp(0.05, X[row, 0], rod.rows["T"][-1][row])
    assert abs(at_05 - case["T_05"]) < 0.05
    heat, stored = through(rod.rows).sum(), rod.rows["heat.stored.rod"].sum()
    assert stored == pytest.approx(heat, rel=case["tolerance_enthalpy"])


@pytest.mark.parametrize("method", METHODS)
def test_a12_order_in_time(ran, method):
    exact = 0.5 * np.exp(-1.0) / (1.0 - 0.5 * np.exp(-1.0))
    errors = [abs(ran[f"A12 {method} {n}"].rows["T"][-1].mean() - exact) for n in N12]
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(EXPECTED["A12"][method], abs=EXPECTED["A12"]["tolerance"])
    assert ran[f"A12 {method} {N12[-1]}"].rows["T"][-1] == pytest.approx(by_hand(method, N12[-1]), rel=1e-9)


def by_hand(method: str, n: int) -> float:
    """The same steps as quadratic equations, the damped first substep (four quarters of backward Euler) included."""
    def euler(T: float, h: float) -> float:
        return (np.sqrt((1 + h) ** 2 + 4 * h * T) - (1 + h)) / (2 * h)

    T, h = 1.0, 1.0 / n
    for i in range(n):
        if method == "theta_one":
            T = euler(T, h)
        elif i == 0:
            for _ in range(4):
                T = euler(T, h / 4)
        else:
            T = 2 * euler(T, h / 2) - T  # the midpoint is half a step of backward Euler on
    return T


@pytest.mark.parametrize("i", range(len(EXPECTED["D2"]["t"])))
def test_d2_two_half_spaces(ran, i):
    case = EXPECTED["D2"]
    pair = ran[f"D2 {case['t'][i]}"]
    surface = [pair.rows["T"][-1][pair.nodes(name)].mean() for name in ("a.right", "b.left")]
    assert 2000.0 * (surface[0] - surface[1]) == pytest.approx(case["q"][i], rel=2e-3)
    if case["t"][i] == 10:
        assert surface == pytest.approx(case["T_10"], abs=0.1)
    slave, master = (pair.rows[f"heat.contact.{side}"].sum() for side in ("slave", "master"))
    assert slave == pytest.approx(-master, rel=1e-12)
