"""`slideline check` says how long windows may be: case E4 built of a lumped body and a rod, through both FMUs."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler import load_scenario
from coupler.cli.cli import app
from coupler.control.window_size import limits
from coupler.running.pilot import pilot

sys.path.insert(0, str(Path(__file__).parent))
from small_scenes import LUMPED_GAP, ROOT, solve

pytestmark = pytest.mark.usefixtures("unlooked")

E4 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["E4"]
CLOSE = 0.02  # a closed form exists


@pytest.mark.few("backward_euler")
@pytest.mark.parametrize("method", ["backward_euler", "midpoint"])
def test_the_prediction_at_rest_is_the_closed_form(tmp_path: Path, method: str) -> None:
    file = tmp_path / "gap.yaml"
    file.write_text(LUMPED_GAP.format(T0=840, method=method, scheme="staggered", size=5, end=400), encoding="utf-8")
    found = pilot(load_scenario(file))
    assert found.method == method
    assert limits(found.feedbacks[-1], method).staggered == pytest.approx(E4["dt_c"][method], rel=CLOSE)
    said = CliRunner().invoke(app, ["check", str(file)]).output
    last = re.search(r"at t = 400 s: staggered up to ([\d.]+) s", said)
    assert last is not None
    assert float(last[1]) == pytest.approx(E4["dt_c"][method], rel=0.05)  # two figures are said
    assert "stable windows, from a pilot run: shortest at t = " in said


def test_auto_is_written_down_with_its_reasons(tmp_path: Path) -> None:
    results = solve(tmp_path, LUMPED_GAP.format(T0=840, method="midpoint", scheme="auto", size=1, end=60))
    assert results.probe("T")[1][-1] == pytest.approx(E4["T"], abs=1e-3)
    assert results.heat_imbalance <= 1e-10
    assert {"iterated", "extrapolated"} <= set(results.windows["scheme"])
    assert any("stable up to" in reason for reason in results.reasons.values())
