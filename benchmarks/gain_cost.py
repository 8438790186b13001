"""What it costs to measure whether the exchange is stable (coupler.control.gain): solves and CPU seconds of a run.

    python benchmarks/gain_cost.py [--quick]

Each scene runs with gains measured and without, by turns, and nothing is changed for what is found (on_unstable: warn),
so that both solve the same windows.  Budget: 5 % of the half-solves of a run whose exchange is stable.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from time import process_time
from typing import Any
from unittest import mock

from coupler import Results, run
from coupler.control import spare
from coupler.scenario.load import load_scenario, scenario_from

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "coupler"))
from fresh_scenes import column, seizing_rod, two_rods, two_sided_rod

ROOT = Path(__file__).resolve().parent.parent
WARN = {"coupling.on_unstable": "warn"}


def scenes(quick: bool) -> dict[str, Any]:
    """Name -> scenario."""
    docs = {"two rods, 0.5 s": two_rods(0.5), "two rods, 0.05 s": two_rods(0.05),
            "two-sided rod, staggered, 0.02 s": two_sided_rod(0.02, 4.0),
            "two-sided rod, staggered, 0.15 s": two_sided_rod(0.15, 20.0),
            "the rod that seizes, 2.5 s": seizing_rod(2.5), "thermoelastic column": column()}
    found = {n: scenario_from(json.dumps(d), Path("scene.yaml"), WARN) for n, d in docs.items()}
    names = ("lumped_gap",) if quick else ("lumped_gap", "rubbing_block", "brake_pad")
    return found | {n: load_scenario(ROOT / f"scenarios/{n}.yaml", overrides=WARN) for n in names}


def solved(scenario: Any, folder: Path, measure: bool) -> tuple[Results, float]:
    """The results of a run, and its CPU seconds."""
    began = process_time()
    with mock.patch.object(spare, "asks_gain", spare.asks_gain if measure else lambda *args: False):
        results = run(scenario, folder / "run.h5")
    return results, process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one round, small scenes")
    quick = parser.parse_args().quick
    print("| scene | windows | solves of gains, of the run's | CPU with gains over without |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, scenario in scenes(quick).items():
            seconds: dict[bool, list[float]] = {True: [], False: []}
            looks: dict[bool, int] = {}
            for _ in range(1 if quick else 3):
                for measure in (True, False):
                    results, took = solved(scenario, Path(folder), measure)
                    seconds[measure].append(took)
                    looks[measure] = int(results.totals["looks"]["solves"])
                    own = int(results.windows.thermal_solves.sum() + results.windows.mechanical_solves.sum())
            share = 100.0 * (looks[True] - looks[False]) / own
            times = min(seconds[True]) / min(seconds[False])
            print(f"| {name} | {len(results.windows)} | {share:.1f} % | {times:.2f} |", flush=True)


if __name__ == "__main__":
    main()
