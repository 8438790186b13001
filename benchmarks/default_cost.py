"""What all defaults cost against the best fixed scheme in uniform windows: solver calls to 1 % and 0.1 % of each range.

    python benchmarks/default_cost.py [--only SCENE] [--json FILE]

The error of a run: of its worst probe, the largest distance at the ends of its windows from a run by `iterated` in
short windows on the same mesh, over the range of that probe.  Where data jump (at 0) the windows of that run begin a
thousand times shorter: a probe that jumps there, as the gap before a rod whose end is heated at once, is no straight
line up to the end of the first window, and runs whose windows end within it were told to be 1.7 % off.
Fixed schemes in windows halved from the first size on, all defaults by tolerances of 512 to 1/8 times their own; calls
at an error by straight lines between the logarithms.  The best fixed scheme and size are found by hindsight, which no
user has.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "coupler"))

import fresh_scenes as fresh  # noqa: E402  (of the tests)

from coupler import CouplingError, Results, Scenario, run  # noqa: E402
from coupler.scenario.load import scenario_from  # noqa: E402
from coupler.scenario.options import ErrorTolerances  # noqa: E402

WANTED = (1e-2, 1e-3)
GRADED = 20  # windows of its shortest size over which the reference grows to it
LOOSER = (512.0, 64.0, 8.0, 1.0, 0.125)
SCHEMES = ("staggered", "extrapolated", "iterated")


@dataclass(frozen=True)
class Case:
    """doc : of scheme and window [s].  first : the longest window [s], halved `times` times.  fine : the reference."""

    doc: Callable[[str, float], fresh.Doc]
    first: float
    times: int
    fine: float
    schemes: tuple[str, ...] = SCHEMES


CASES: Mapping[str, Case] = {
    "two-sided rod": Case(lambda s, H: fresh.two_sided_rod(H, 10.0, s, "midpoint"), 0.32, 6, 0.001),
    "thermoelastic column": Case(lambda s, H: fresh.column(H, 1.5, s), 0.1, 3, 0.003125, ("iterated", "adiabatic")),
    "two rods": Case(lambda s, H: fresh.two_rods(H, 30.0, s), 0.5, 6, 0.00390625),
    "seizing rod": Case(lambda s, H: fresh.seizing_rod(H, 300.0, s), 20.0, 4, 0.625),
}


def scenario(doc: fresh.Doc, coupling: Mapping[str, object]) -> Scenario:
    return scenario_from(json.dumps({**doc, "slideline": 2, "coupling": coupling}), Path("scene.yaml"), {})


def reference_of(case: Case) -> Scenario:
    """The run that errors are measured from: `iterated`, in windows that grow from a thousandth to `fine` at first."""
    doc = case.doc("iterated", case.fine)
    grown = {"until": GRADED * case.fine, "first": 1e-3 * case.fine, "last": case.fine}
    windows = [grown, {"until": doc["coupling"]["end"], "size": case.fine}]
    return scenario(doc, {**doc["coupling"], "windows": windows})


def by_defaults(doc: fresh.Doc, looser: float) -> Scenario:
    """The scene with nothing said but its end, and tolerances of so many times the defaults."""
    tolerance = {name: {"atol": looser * q.atol, "rtol": min(looser * q.rtol, 1.0)} for name, q in ErrorTolerances()}
    return scenario(doc, {"end": doc["coupling"]["end"], "adaptive": {"tolerance": tolerance}})


@dataclass(frozen=True)
class Point:
    """What a run cost and how far it was off, of the range of its worst probe."""

    calls: int
    error: float


def point(s: Scenario, reference: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Point | None:
    """Return None for a run that failed."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            results = run(s, Path(folder) / "run.h5")
        except CouplingError:
            return None
        return Point(int(results.windows.thermal_solves.sum() + results.windows.mechanical_solves.sum()),
                     max(off(results, n, reference[n]) for n in results.probe_names))


def off(results: Results, name: str, reference: tuple[np.ndarray, np.ndarray]) -> float:
    t, values = results.probe(name)
    return float(np.abs(values - np.interp(t, *reference)).max()) / float(np.ptp(reference[1]))


def calls(points: Sequence[Point], wanted: float) -> float:
    """Return the least calls from which on no dearer run has a larger error than wanted; inf: none has."""
    ordered = sorted(points, key=lambda p: p.calls)
    last = max((i for i, p in enumerate(ordered) if p.error > wanted), default=-1)
    if last + 1 == len(ordered):
        return math.inf
    good = ordered[last + 1]
    if last < 0 or good.error <= 0.0:
        return float(good.calls)
    bad = ordered[last]
    share = math.log(bad.error / wanted) / math.log(bad.error / good.error)
    return bad.calls * (good.calls / bad.calls) ** share


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", help="a scene; may be repeated")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    args = parser.parse_args()
    rows, kept = [], {}
    for name, case in CASES.items():
        if args.only and name not in args.only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            results = run(reference_of(case), Path(folder) / "run.h5")
            reference = {n: results.probe(n) for n in results.probe_names}
        found = {}
        for scheme in case.schemes:
            docs = [case.doc(scheme, case.first / 2**k) for k in range(case.times + 1)]
            found[scheme] = [p for d in docs if (p := point(scenario(d, d["coupling"]), reference))]
        doc = case.doc("auto", case.first)
        found["all defaults"] = [p for k in LOOSER if (p := point(by_defaults(doc, k), reference))]
        kept[name] = {way: [(p.calls, p.error) for p in points] for way, points in found.items()}
        for wanted in WANTED:
            cost = {way: calls(points, wanted) for way, points in found.items()}
            best = min((w for w in cost if w != "all defaults"), key=lambda w: cost[w])
            rows.append({"scene": name, "error": f"{wanted:.1%}", **{w: f"{c:.0f}" for w, c in cost.items()},
                         "best": best, "defaults / best": f"{cost['all defaults'] / cost[best]:.2f}"})
            print(rows[-1], file=sys.stderr, flush=True)
    print(table([{k: r.get(k, "-") for k in dict.fromkeys(k for row in rows for k in row)} for r in rows]))
    if args.json:
        args.json.write_text(json.dumps(kept, indent=1))


if __name__ == "__main__":
    main()
