"""scenarios/casting_1d.yaml, case F2-1D: the gap that freezing makes, and what it costs to exchange it seldom."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run

sys.path.insert(0, str(Path(__file__).parent))
from small_scenes import ROOT, at

pytestmark = pytest.mark.usefixtures("unlooked")

CASE = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["F2_1D"]
SCENARIO = ROOT / "scenarios/casting_1d.yaml"
K_G, G_M = 0.06, 30e-6


@pytest.fixture(scope="module")
def casting(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return run(load_scenario(SCENARIO), out=tmp_path_factory.mktemp("casting") / "run.h5")


def test_the_table(casting: Results) -> None:
    """.1 % and half a unit of the last digit of the page's table: 100 cells and windows up to .2 s leave .05 %."""
    # pytest takes the larger of the two tolerances.
    gap, T = at(casting, "interface.gap", CASE["t"]), at(casting, "rod.right", CASE["t"])
    h = K_G / (gap + G_M)
    for name, values, digit in (("gap", gap, 0.05e-6), ("h", h, 0.5), ("q", h * (T - 400.0), 0.5e3),
                                ("solid", at(casting, "rod.solid", CASE["t"]), 0.5e-4)):
        assert values == pytest.approx(CASE[name], rel=1e-3, abs=digit), name
    # A front that passes from node to node makes the surface swing, by .7 K at 100 cells (.2 mm).
    assert pytest.approx(CASE["T_surface"], abs=0.8) == T


def test_when_all_is_solid(casting: Results) -> None:
    solid = casting.probe("rod.solid")[1]
    first = int(np.argmax(solid >= 1.0))
    assert casting.t[first - 1] - 1.0 < CASE["solid_at"] < casting.t[first] + 1.0
    assert (np.diff(solid) >= -1e-12).all()
    assert (casting.probe("interface.p")[1] == 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("frozen", CASE["frozen_gap"], ids=lambda case: f"{case['every']:g} s")
def test_what_a_seldom_exchange_costs(tmp_path: Path, frozen: dict[str, float]) -> None:
    """The gap held through windows, the thermal half in substeps of .1 s: .5 % of the page's numbers."""
    every = frozen["every"]
    result = run(load_scenario(SCENARIO, overrides={
        "coupling.scheme": "staggered", "coupling.end": 20, "coupling.windows": [{"until": 20, "size": every}],
        "coupling.substeps.thermal": round(every / 0.1)}), out=tmp_path / "run.h5")
    assert result.probe("rod.solid")[1][-1] == pytest.approx(frozen["solid"], rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["extrapolated", "auto"])
def test_windows_that_find_their_size_are_few_and_right(tmp_path: Path, scheme: str) -> None:
    """.5 % of the solid fraction at 20 s and 1 % of when all is solid, with fewer solves than the 407 listed windows.

    Windows are up to 10 s long at the end: the fraction is drawn on from the last two that were not solid.
    """
    text = SCENARIO.read_text(encoding="utf-8")
    listed = text[text.index("  scheme: extrapolated"):text.index("probes:")]
    path = tmp_path / "adaptive.yaml"
    path.write_text(text.replace(listed, f"  scheme: {scheme}\n  end: 200\n  adaptive: {{first: 0.005}}\n\n"), "utf-8")
    result = run(load_scenario(path), out=tmp_path / "run.h5")
    t, solid = result.probe("rod.solid")
    assert np.interp(20.0, t, solid) == pytest.approx(CASE["solid"][2], rel=5e-3)
    i = int(np.argmax(solid >= 1.0))
    slope = (solid[i - 1] - solid[i - 2]) / (t[i - 1] - t[i - 2])
    assert t[i - 1] + (1.0 - solid[i - 1]) / slope == pytest.approx(CASE["solid_at"], rel=1e-2)
    assert result.heat_imbalance < 1e-10
    assert result.windows.thermal_solves.sum() < 407


def test_along_the_heat_an_exchange_every_five_seconds_is_enough(tmp_path: Path) -> None:
    result = run(load_scenario(SCENARIO, overrides={
        "coupling.scheme": "along_heat", "coupling.end": 20, "coupling.windows": [{"until": 20, "size": 5}],
        "coupling.substeps.thermal": 8}), out=tmp_path / "run.h5")
    case, w = CASE["every_5"], result.windows
    assert result.probe("rod.solid")[1][-1] == pytest.approx(CASE["solid"][2], rel=case["tolerance"])
    assert w.thermal_solves.sum() <= case["passes"] * 8 * len(w)
    assert w.mechanical_solves.sum() <= case["passes"] * len(w)
    assert result.heat_imbalance < 1e-10
