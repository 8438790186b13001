"""Every scenario that is shipped ends as a user expects: completed, and to be trusted."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler import load_scenario, run

SCENARIOS = sorted((Path(__file__).resolve().parents[2] / "scenarios").glob("*.yaml"))


@pytest.mark.few("heated_bars", "lumped_gap")
@pytest.mark.parametrize("path", SCENARIOS, ids=[p.stem for p in SCENARIOS])
def test_a_scenario_as_shipped_is_to_be_trusted(path: Path, tmp_path: Path) -> None:
    results = run(load_scenario(path), out=tmp_path / "run.h5")
    assert results.outcome in ("completed", "stopped"), results.message
    assert [f"{c.name}: {c.what}" for c in results.broken] == []
