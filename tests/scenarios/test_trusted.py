"""Every scenario that is shipped ends as a user expects: completed, and to be trusted.

Those of LONG are asked by `-m slow`.  Of two of them their own files ask the same before every merge,
in runs that they make anyway: test_brake_pad.py, and test_sealed_container_fire.py until the gap is at its widest.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler import load_scenario, run

SCENARIOS = sorted((Path(__file__).resolve().parents[2] / "scenarios").glob("*.yaml"))
LONG = {"aluminium_can", "brake_pad", "sealed_container_fire", "sliding_blocks"}


@pytest.mark.parametrize("path", [pytest.param(p, marks=pytest.mark.slow) if p.stem in LONG else p for p in SCENARIOS],
                         ids=[p.stem for p in SCENARIOS])
def test_a_scenario_as_shipped_is_to_be_trusted(path: Path, tmp_path: Path) -> None:
    results = run(load_scenario(path), out=tmp_path / "run.h5")
    assert results.outcome in ("completed", "stopped"), results.message
    assert [f"{c.name}: {c.what}" for c in results.broken] == []
