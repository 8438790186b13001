"""A brake: mu N s as heat, half-spaces early on, and halves whose steps differ by a factor of ten."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.report.comparison import compare

pytestmark = pytest.mark.usefixtures("unlooked")

ROOT = Path(__file__).resolve().parents[2]
D10 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["D10"]
MU, LENGTH, SPEED, BEGINS = 0.3, 0.3, 0.05, 0.1
Q = 150e3  # W/m2, that of D10
EARLY = 0.3  # s; where two runs need not go farther
# Runs that are compared are solved in equal windows.
EQUAL = {"coupling.scheme": "staggered",
         "coupling.windows": [{"until": 0.1, "size": 0.05}, {"until": 1.3, "size": 0.02}]}


def braked(folder: Path, name: str, **changes: object) -> Results:
    scene = load_scenario(ROOT / "scenarios/brake_pad.yaml",
                          overrides={"output.fields.at": []} | {k.replace("__", "."): v for k, v in changes.items()})
    return run(scene, folder / f"{name}.h5")


@pytest.fixture(scope="module")
def brake(tmp_path_factory) -> Results:
    return braked(tmp_path_factory.mktemp("brake"), "once")


def slid(brake: Results) -> np.ndarray:
    """(n,) how far the disc has moved under the pad [m], without what both bend."""
    return brake.probe("disc.u")[1] - brake.probe("pad.u")[1]


def heat(brake: Results) -> float:
    return brake.ledger["friction.slave"] + brake.ledger["friction.master"]


@pytest.mark.slow
def test_as_shipped_it_is_to_be_trusted(brake: Results) -> None:
    assert brake.outcome == "completed", brake.message
    assert [f"{c.name}: {c.what}" for c in brake.broken] == []


@pytest.mark.slow
def test_mu_n_s_becomes_heat_and_all_is_delivered(brake: Results) -> None:
    p = brake.probe("pad.mean_p")[1]
    s = slid(brake)
    work = float((MU * LENGTH * 0.5 * (p[1:] + p[:-1]) * np.diff(s)).sum())
    # Way that only winds up the spring of sticking: mu p/eps_T, a micrometre of 50 mm.
    assert heat(brake) == pytest.approx(work, rel=1e-4)
    account = brake.totals["friction_heat"]
    assert account["made"] == pytest.approx(account["delivered"] + account["carried"], rel=1e-14)
    assert heat(brake) == pytest.approx(account["delivered"], rel=1e-12)
    assert account["carried"] < 1e-6 * account["made"]
    assert brake.ledger["friction.slave"] / heat(brake) == pytest.approx(D10["share"], abs=5e-8)
    assert brake.heat_imbalance < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pad.T", "disc.T"])
def test_the_middle_warms_as_half_spaces_do(brake: Results, name: str) -> None:
    """D10's first second under the local mu p v.

    1 %: 20 cells over the depth, and a pressure that varies along the disc (measured: .6 % after .2 s).
    """
    for since in (0.2, 0.4, 1.0):
        t = BEGINS + since
        q = MU * SPEED * float(np.interp(t, *brake.probe("pad.p")))
        expected = D10["dT"][0] * q / Q * np.sqrt(since)
        assert float(np.interp(t, *brake.probe(name))) - 293.15 == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("side", "times", "dT"), [
    # Of 2 K.  Friction and way are the same in ten steps as in one, but for how the pad's ends spring back.
    ("mechanical", 10, 0.01),
    # The first window of heat is a jump, and the thermal half resolves it with as many steps as it has: .06 K then.
    ("thermal", 10, 0.08)])
def test_a_half_stepped_finer_says_the_same(tmp_path: Path, side: str, times: int, dT: float) -> None:
    once = braked(tmp_path, "once", **EQUAL, coupling__end=EARLY)
    finer = braked(tmp_path, side, **EQUAL, **{f"coupling__substeps__{side}": times, "coupling__end": EARLY})
    same_heat_and_temperatures(once, finer, dT)


@pytest.mark.slow
def test_mechanics_a_hundred_times_finer_say_the_same(tmp_path: Path) -> None:
    """Seven windows of a hundred mechanical steps each."""
    once = braked(tmp_path, "once", **EQUAL, coupling__end=0.2)
    finer = braked(tmp_path, "hundred", **EQUAL, coupling__substeps__mechanical=100, coupling__end=0.2)
    same_heat_and_temperatures(once, finer, 0.01)


def same_heat_and_temperatures(brake: Results, finer: Results, dT: float) -> None:
    """The largest difference is below dT; in the middle of the pad, at the end, it is a hundredth of a kelvin."""
    c = compare(brake, finer)
    assert max(abs(d.by) for d in c.differences if d.curves.quantity == "T") < dT
    middle = next(d.curves for d in c.differences if d.curves.name == "pad.T")
    assert abs(middle.b[-1] - middle.a[-1]) < 0.01
    account = finer.totals["friction_heat"]
    assert account["made"] == pytest.approx(account["delivered"] + account["carried"], rel=1e-12)
    for side in ("friction.slave", "friction.master"):
        made, own = c.heats[side]
        assert own == pytest.approx(made, rel=1e-4)
    assert finer.heat_imbalance < 1e-10


@pytest.mark.slow
def test_a_pad_that_cannot_expand_keeps_its_edge_pressed(brake: Results, tmp_path: Path) -> None:
    """Bowed by its own heat the pad takes pressure from its edge and gives it to the middle (14 % after a second)."""
    cold = braked(tmp_path, "cold", materials__steel__alpha=0, materials__aluminium__alpha=0, coupling__end=0.7)
    by = {d.curves.name: d.curves for d in compare(brake, cold).differences}
    assert by["pad.most_p"].a[-1] < 0.95 * by["pad.most_p"].b[-1]
    assert by["pad.p"].a[-1] > 1.005 * by["pad.p"].b[-1]
    assert by["pad.mean_p"].a[-1] == pytest.approx(by["pad.mean_p"].b[-1], rel=1e-4)
