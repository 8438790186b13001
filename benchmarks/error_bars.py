"""How honest the errors are that a run tells of its probes: told over true, with few looks, and by companions.

    python benchmarks/error_bars.py [--quick] [--only SCENE] [--json FILE]

Scenes by each scheme in equal windows of several sizes; true: the largest distance of a probe from a run by `iterated`
in windows 5 to 50 times as short as the shortest.  Probes that are off by less than 0.1 % of their range tell nothing.
`run`: what the run tells by itself (coupler/trust/in_time/errors.py).  `companions`: --confidence.  `passed`: runs
that are off by more than 12 % of a range, and none of whose checks is broken.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / "tests" / "coupler"), str(ROOT / "tests" / "scenarios")]

import fresh_scenes as fresh  # noqa: E402  (of the tests)
from small_scenes import CLOSING  # noqa: E402

from coupler import Results, Scenario, load_scenario, run  # noqa: E402
from coupler.experiments.confidence import confidence  # noqa: E402
from coupler.scenario.load import scenario_from  # noqa: E402

FACTOR, SEEN, SPOILT = 3.0, 1e-3, 0.12
SCHEMES = ("staggered", "extrapolated", "iterated")


@dataclass(frozen=True)
class Case:
    """scene : of scheme and window [s].  sizes : of windows [s], the last for the reference."""

    scene: Callable[[str, float], Scenario]
    sizes: tuple[float, ...]
    schemes: tuple[str, ...] = SCHEMES


@dataclass(frozen=True)
class Found:
    """Told over true of every probe that is off, by the run itself and by companions; and what passed."""

    run: tuple[float, ...] = ()
    companions: tuple[float, ...] = ()
    passed: tuple[str, ...] = ()

    def plus(self, other: Found) -> Found:
        return Found(self.run + other.run, self.companions + other.companions, self.passed + other.passed)


def made(doc: fresh.Doc) -> Scenario:
    return scenario_from(json.dumps(doc), Path("scene.yaml"), {})


def in_windows(text: str | Path, end: float) -> Callable[[str, float], Scenario]:
    """Return a scenario of a file, or of its text, to `end` [s]."""
    def scene(scheme: str, size: float) -> Scenario:
        sets = {"coupling.scheme": scheme, "coupling.end": end, "coupling.windows": [{"until": end, "size": size}]}
        return load_scenario(text, overrides=sets) if isinstance(text, Path) else scenario_from(
            text, Path("scene.yaml"), sets)
    return scene


CASES: Mapping[str, Case] = {
    "lumped_gap": Case(in_windows(ROOT / "scenarios/lumped_gap.yaml", 20.0), (5.0, 2.0, 1.0, 0.5, 0.02)),
    "two-sided rod": Case(lambda s, H: made(fresh.two_sided_rod(H, 4.0, s, "midpoint")), (0.2, 0.1, 0.05, 0.02, 0.002)),
    "two rods": Case(lambda s, H: made(fresh.two_rods(H, 15.0, s)), (0.5, 0.25, 0.1, 0.05, 0.005)),
    "D13": Case(in_windows(CLOSING, 200.0), (20.0, 10.0, 5.0, 1.0, 0.1)),
    "casting_1d": Case(in_windows(ROOT / "scenarios/casting_1d.yaml", 20.0), (4.0, 2.0, 1.0, 0.5, 0.02)),
    "column": Case(lambda s, H: made(fresh.column(H, 1.5, s)), (0.1, 0.05, 0.01), ("adiabatic", "iterated")),
    "seizing rod": Case(lambda s, H: made(fresh.seizing_rod(H, 300.0, s)), (10.0, 5.0, 0.625)),
}


def held(case: Case, scheme: str, size: float, reference: Results, companions: bool) -> Found:
    """Hold one run against the reference."""
    scenario = case.scene(scheme, size)
    with tempfile.TemporaryDirectory() as folder:
        results = run(scenario, Path(folder) / "run.h5")
        bars = confidence(scenario, results) if companions else {}
        by_run, by_companions, worst = [], [], 0.0
        for name in results.probe_names:
            t, values = results.probe(name)
            span = float(np.ptp(values))
            true = float(np.nan_to_num(np.abs(values - np.interp(t, *reference.probe(name)))).max())
            if span <= 1e-12 * float(np.abs(values).max()) or true <= SEEN * span:
                continue
            worst = max(worst, true / span)
            by_run.append(results.probe_errors[name].error / true)
            if name in bars:
                by_companions.append(float(np.nan_to_num(bars[name].error).max()) / true)
        passed = worst > SPOILT and not results.broken
    return Found(tuple(by_run), tuple(by_companions), (f"{scheme} {size:g}: {worst:.0%}",) if passed else ())


def row(name: str, by: str, ratios: tuple[float, ...]) -> dict[str, str]:
    r = np.array(ratios)
    within = np.mean((r >= 1 / FACTOR) & (r <= FACTOR))
    return {"scene": name, "by": by, "probes": str(len(r)), "within 3": f"{within:.0%}",
            "understated": f"{np.mean(r < 1 / FACTOR):.1%}", "median": f"{np.median(r):.2f}", "least": f"{r.min():.2f}",
            "most": f"{r.max():.1f}"}


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="no companions")
    parser.add_argument("--only", action="append", help="a scene; may be repeated")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    args = parser.parse_args()
    rows, all_of_them = [], Found()
    for name, case in CASES.items():
        if args.only and name not in args.only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            reference = run(case.scene("iterated", case.sizes[-1]), Path(folder) / "run.h5")
            found = Found()
            for scheme in case.schemes:
                for size in case.sizes[:-1]:
                    found = found.plus(held(case, scheme, size, reference, not args.quick))
        rows += [row(name, by, r) for by, r in (("run", found.run), ("companions", found.companions)) if r]
        all_of_them = all_of_them.plus(found)
        print(f"{name}: passed {', '.join(found.passed) or 'none'}", file=sys.stderr, flush=True)
    rows += [row("all", by, r) for by, r in (("run", all_of_them.run), ("companions", all_of_them.companions)) if r]
    print(table(rows))
    if args.json:
        args.json.write_text(json.dumps(asdict(all_of_them), indent=1))


if __name__ == "__main__":
    main()
