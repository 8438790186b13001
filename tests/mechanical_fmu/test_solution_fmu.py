"""B1, B2, B9, B12 through one built FMU: six bodies about one axis, each a row of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface, write_interface

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, NO_CELLS, hold, press, rectangle

pytestmark = pytest.mark.slow

SMALL = 0.01  # of the loads of B1 and B2, whose closed forms are linear
TUBES = ("b1", "b2_0", "b2_1", "b2_2")
STEPS = 75  # in each of the three ranges of B12
STRAIN = 100e6 / 150e9
DRIVE = """
import sys
import numpy as np
from pathlib import Path
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Status
half = load_half(Path(sys.argv[1]), None, "mechanical")
script = np.load(sys.argv[2])
t, T = script["t"], script["T"]
outputs = ("x", "sigma", "sigma_v", "E_M", "cuts")
kept = {n: [] for n in outputs}
half.initialise(t[0], t[-1], {}, {"T": T[0]}, outputs)
for i in range(1, len(t)):
    answer = half.advance(t[i - 1], t[i] - t[i - 1], {"T": T[i]}, outputs)
    assert answer.status is Status.OK, answer.message
    for n in outputs:
        kept[n].append(answer.outputs[n])
half.close()
np.savez(sys.argv[3], **{n: np.array(v) for n, v in kept.items()})
"""


def scene():
    """The interface and, for each body, its nodes."""
    radii = np.geomspace(0.02, 0.05, 21)
    grids = {name: (radii, 0.1 * i + np.array([0.0, 0.002])) for i, name in enumerate(TUBES)}
    grids |= {name: (np.linspace(0.0, 0.01, 2), z + np.array([0.0, 0.1])) for name, z in (("b9", 1.0), ("b12", 2.0))}
    nodes, quads, body, surfaces, of = [], [], [], {}, {}
    for i, (name, (x, y)) in enumerate(grids.items()):
        first = sum(map(len, nodes))
        X, cells, lines = rectangle(x, y, first=first)
        nodes.append(X)
        quads.append(cells)
        body.append(np.full(len(cells), i, np.int32))
        surfaces |= {f"{name}.{side}": edges for side, edges in lines.items()}
        of[name] = slice(first, first + len(X))
    none = np.empty(0, np.int32)
    return Interface("axisymmetric", np.concatenate(nodes), np.concatenate(quads).astype(np.int32), NO_CELLS[3],
                     np.concatenate(body), none, tuple(grids), tuple(grids), surfaces), of


def model():
    tube = {"E": 200e9, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 0.0}
    materials = {"b1": tube, **{f"b2_{i}": tube | {"nu": nu} for i, nu in enumerate(EXPECTED["B2"]["nu"])},
                 "b9": tube | {"plastic": {"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}}},
                 "b12": {"E": 150e9, "nu": 0.3, "creep": {"A": 1e-40, "n": 4.0}}}
    ends = [hold(f"{name}.{side}", 1, 0.1 * STRAIN if (name, side) == ("b12", "top") else 0.0)
            for name in materials for side in ("bottom", "top")]
    pressed = [press(f"b2_{i}.left", SMALL * EXPECTED["B2"]["p"]) for i in range(3)]
    return {"half": "elastic", "format": 2, "tolerance": 1e-10, "materials": materials,
            "bodies": {name: {"material": name} for name in materials}, "boundary": ends + pressed}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Times, and the outputs at the ends of steps."""
    folder = tmp_path_factory.mktemp("rows")
    interface, of = scene()
    stops = EXPECTED["B12"]["t"]
    t = [0.0, *np.linspace(0.0, stops[0], STEPS + 1)[1:]]
    for stop in stops[1:]:
        t += list(t[-1] * (stop / t[-1]) ** (np.arange(1, STEPS + 1) / STEPS))
    T = np.zeros((len(t), len(interface.nodes)))
    T[:, of["b1"]] = SMALL * 200.0 * np.log(0.05 / interface.nodes[of["b1"], 0]) / np.log(2.5)
    # The bar is heated by 300 K and cooled back, a kelvin more than it takes to yield in one of the steps.
    bar = np.interp(np.arange(len(t)), [0, 5, 6, 50, 100], [0.0, 104.0, 105.0, 300.0, 0.0])
    T[:, of["b9"]] = bar[:, None]
    write_interface(interface, folder / "interface.h5")
    (folder / "model.json").write_text(json.dumps(model()), encoding="utf-8")
    np.savez(folder / "script.npz", t=np.array(t), T=T)
    call("-m", "mechanical_fmu.build", folder, folder / "half.fmu")
    call("-c", DRIVE, folder / "half.fmu", folder / "script.npz", folder / "out.npz")
    return interface, of, dict(np.load(folder / "out.npz"))


def call(*arguments):
    answer = subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr[-3000:]


def test_b1_and_b2(run):
    interface, of, out = run
    u = (out["x"][0] - interface.nodes) / SMALL
    row = EXPECTED["B1"]
    assert u[of["b1"]][0, 0] == pytest.approx(row["u_a"], rel=row["tolerance"])
    assert u[of["b1"]][-1, 0] == pytest.approx(row["u_b"], rel=row["tolerance"])
    # Cell means taken to the faces by a smooth curve: they vary like ln r and 1/r2.
    sigma, r = out["sigma"][0, :20] / SMALL, np.geomspace(0.02, 0.05, 21)
    middle = 0.5 * (r[:-1] + r[1:])
    for component, at, key in ((3, 0.02, "s_th_a"), (3, 0.05, "s_th_b"), (0, 0.03, "s_r_03")):
        curve = np.polyfit(np.log(middle), sigma[:, component], 5)
        assert np.polyval(curve, np.log(at)) == pytest.approx(row[key], rel=row["tolerance"])
    row = EXPECTED["B2"]
    for i, expected in enumerate(row["u_a"]):
        assert u[of[f"b2_{i}"]][0, 0] == pytest.approx(expected, rel=row["tolerance"])


def test_b9(run):
    """The stress of the row is per reference section: Cauchy times J, and J from the bar's width.

    Finite strain: ln(1 + 3.6e-3) for 3.6e-3 moves it by 5e-5 when heated, by 6e-4 where it has yielded twice.
    """
    interface, of, out = run
    width = out["x"][:, of["b9"]][:, 2, 0] / interface.nodes[of["b9"]][2, 0]
    row, bar = EXPECTED["B9"], out["sigma_v"][:, -2] * width**2
    assert bar[49] == pytest.approx(-row["heated"], rel=1e-4)
    assert bar[99] == pytest.approx(row["cooled"], rel=1e-3)
    assert bar[4] == pytest.approx(2e11 * 1.2e-5 * 104.0, rel=1e-3)
    assert bar[5] == pytest.approx(250e6, rel=1e-4)
    assert not out["E_M"][:5, -2].any()
    # It flows by the strain its hardening stands for: work times .9 became heat.
    made = out["E_M"][:50, -2].sum() / (np.pi * 0.01**2 * 0.1)
    e = (254.653465e6 - 250e6) / 2e9
    assert made == pytest.approx(0.9 * (250e6 * e + 1e9 * e**2), rel=5e-3)
    assert not out["cuts"].any()


def test_b12(run):
    """Backward Euler: 75 steps a range leave just under 1 % (0.2 % with 300)."""
    _, _, out = run
    row = EXPECTED["B12"]
    assert out["sigma_v"][[STEPS - 1, 2 * STEPS - 1, 3 * STEPS - 1], -1] == pytest.approx(row["stress"], rel=1e-2)
