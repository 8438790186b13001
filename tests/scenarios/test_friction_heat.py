"""A block dragged along a bar, from YAML to heat: mu N s, once through both halves, the coupler and the ledger."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.report.heat import heat_table
from coupler.report.page import scenario_facts

pytestmark = pytest.mark.usefixtures("unlooked")

ROOT = Path(__file__).resolve().parents[2]
D10 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["D10"]
MU, WIDTH = 0.3, 0.04
SIDES = ("friction.slave", "friction.master")
# Windows that end where the drag begins and ends, by the scheme that delivers heat a window late.
LATE = {"coupling.scheme": "staggered",
        "coupling.windows": [{"until": 1, "size": 0.5}, {"until": 10, "size": 0.2}]}


def rubbed(folder: Path, stick: float | str = "auto", processes: bool = False, **more: object) -> Results:
    """The scene with its stiffness of sticking changed [Pa/m]."""
    changes = {"contact.face.friction.stick": stick, **LATE, **more}
    return run(load_scenario(ROOT / "scenarios/rubbing_block.yaml", overrides=changes),
               out=folder / f"{stick}{'.hosted' if processes else ''}.h5", processes=processes)


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Results:
    return rubbed(tmp_path_factory.mktemp("block"))


def heat(results: Results) -> float:
    return sum(results.ledger[side] for side in SIDES)


def work(results: Results) -> np.ndarray:
    """mu N ds of every window [J]: N is the mean pressure of the face times its width."""
    (_, p), (_, u) = results.probe("block.p"), results.probe("block.u")
    return MU * p[1:] * WIDTH * np.diff(u)


def test_mu_n_s_becomes_heat(block: Results) -> None:
    """All but what it takes to wind up the spring of sticking and the shear of the bar: 7e-7 m of 40 mm."""
    total = float(work(block).sum())
    assert 0.0 < total - heat(block) < 1e-4 * total
    t, history = block.ledger_history()
    made = np.diff(sum(history[side] for side in SIDES))
    # What a window made enters in the next.  Sliding begins within one window, at 1 s, and ends at 9 s.
    slides = (t[1:-1] > 1.3) & (t[1:-1] < 9.1)
    np.testing.assert_allclose(made[1:][slides], work(block)[:-1][slides], rtol=2e-5)
    assert not made[t[1:] < 1.1].any()
    assert made[t[1:] > 9.3].max() < 1e-4 * made.max()


@pytest.mark.slow
@pytest.mark.parametrize("two_pass", [False, True])
def test_with_all_defaults_no_more_heat_is_delivered_than_was_made(tmp_path: Path, two_pass: bool) -> None:
    """Heat of friction is handed over before it is made; searched from both sides 0.25 % was never taken back."""
    results = run(load_scenario(ROOT / "scenarios/rubbing_block.yaml", overrides={"contact.face.two_pass": two_pass}),
                  out=tmp_path / "run.h5")
    account = results.totals["friction_heat"]
    assert abs(account["carried"]) < 1e-9 * account["made"]
    assert heat(results) == pytest.approx(account["made"], rel=1e-9)
    (_, p), (_, u) = results.probe("block.p"), results.probe("block.u")
    assert heat(results) == pytest.approx(float((MU * WIDTH * 0.5 * (p[1:] + p[:-1]) * np.diff(u)).sum()), rel=2e-4)


def test_what_windows_made_was_delivered_and_shared_by_effusivity(block: Results) -> None:
    account = block.totals["friction_heat"]
    assert account["made"] == pytest.approx(account["delivered"] + account["carried"], rel=1e-14)
    assert heat(block) == pytest.approx(account["delivered"], rel=1e-12)
    assert account["carried"] < 1e-6 * account["made"]
    assert block.ledger["friction.slave"] / heat(block) == pytest.approx(D10["share"], abs=5e-8)
    assert block.heat_imbalance < 1e-10


@pytest.mark.slow
def test_what_is_missing_is_wound_up_in_the_spring_of_sticking(tmp_path: Path) -> None:
    """mu p/eps_T of the way makes no heat: between that of the mean pressure and that of the largest."""
    stick = 1e10
    soft = rubbed(tmp_path, stick)
    p = soft.probe("block.p")[1][-1]
    missing = float(work(soft).sum()) - heat(soft)
    assert MU * p / stick < missing / (MU * WIDTH * p) < MU * soft.windows.max_p.max() / stick


@pytest.mark.slow
def test_processes_give_the_same_bits(block: Results, tmp_path: Path) -> None:
    hosted = rubbed(tmp_path, processes=True)
    assert hosted.ledger == block.ledger
    assert hosted.totals["friction_heat"] == block.totals["friction_heat"]
    for name in block.probe_names:
        np.testing.assert_array_equal(hosted.probe(name)[1], block.probe(name)[1], err_msg=name)


def test_a_stated_share_and_two_passes(tmp_path: Path) -> None:
    """The heat is the same whichever side is searched from; the share is that of the pair's slave."""
    both = rubbed(tmp_path, **{"contact.face.two_pass": True, "contact.face.friction.share": 0.8})
    assert both.ledger["friction.slave"] / heat(both) == pytest.approx(0.8, abs=1e-12)
    total = float(work(both).sum())
    assert 0.0 < total - heat(both) < 1e-4 * total


def test_the_report_calls_friction_by_plain_names(block: Results) -> None:
    table = heat_table(block)
    assert table is not None
    rows = dict(table.came_in)
    assert {"friction, into the slave", "friction, into the master"} <= set(rows)
    assert float(rows["friction, into the slave"]) > 0.0
    facts = dict(scenario_facts(block))
    assert facts["friction heat"].startswith("made 35")
