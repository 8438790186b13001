"""What all defaults cost against fixed schemes in uniform windows: solver calls and CPU seconds to 1 % and 0.1 %.

    python benchmarks/default_cost.py [--only SCENE] [--json FILE]

The error of a run is one of time alone: of its worst probe, the largest distance at the ends of its windows from a
reference on the same mesh, over the range of that probe.  The reference is `iterated` in listed windows that end at
events of contact; where something jumps or nearly does they begin a thousand times shorter.  A second one in windows
twice as long tells how far it may be off itself.
Fixed schemes run in windows halved from the first size on, all defaults (nothing stated but the end) by tolerances of
512 to 1/64 times their own; cost at an error by straight lines between the logarithms.  The best fixed scheme and size
are found by hindsight, which no user has.
`iterated` is by its default, IQN-ILS; `Aitken` is `iterated` with `coupling.iteration.acceleration: aitken`.
CPU seconds are of the whole run, set-up and results file included, after one run of each kind that is not counted.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "coupler"))

import fresh_scenes as fresh  # noqa: E402  (of the tests)

from coupler import CouplingError, Results, Scenario, load_scenario, run  # noqa: E402
from coupler.scenario.load import scenario_from  # noqa: E402

Array = NDArray[np.float64]
Coupling = Mapping[str, Any]
Curves = Mapping[str, tuple[Array, Array]]
WANTED = (1e-2, 1e-3)
LOOSER = (512.0, 64.0, 8.0, 1.0, 0.125, 0.015625)
TOO_DEAR = 5000  # calls, after which no finer run follows
DEFAULTS = "all defaults"
WAYS: Mapping[str, Coupling] = {
    "staggered": {"scheme": "staggered"},
    "extrapolated": {"scheme": "extrapolated"},
    "iterated": {"scheme": "iterated", "iteration": {"acceleration": "iqn_ils"}},
    "Aitken": {"scheme": "iterated", "iteration": {"acceleration": "aitken"}},
    "adiabatic": {"scheme": "adiabatic"},
}
USUAL = ("staggered", "extrapolated", "iterated", "Aitken")


@dataclass(frozen=True)
class Case:
    """scene : with such a `coupling`.  first : the longest uniform window [s], halved `times` times at most.

    fine : (until, first, last) [s], windows of the reference.  more : of `coupling`, for reference and fixed schemes.
    without : probes of which the reference is not known well enough.  reduced : against the scenario.
    """

    scene: Callable[[Coupling], Scenario]
    end: float
    first: float
    times: int
    fine: Sequence[tuple[float, float, float]]
    ways: tuple[str, ...] = USUAL
    more: Coupling = field(default_factory=dict)
    without: tuple[str, ...] = ()
    reduced: str = ""


def of_document(doc: fresh.Doc) -> Callable[[Coupling], Scenario]:
    return lambda coupling: scenario_from(
        json.dumps({**doc, "slideline": 2, "coupling": coupling}), Path("scene.yaml"), {})


def of_file(name: str, **more: Any) -> Callable[[Coupling], Scenario]:
    """A scenario of the project; more : overrides, with __ for dots."""
    overrides = {key.replace("__", "."): value for key, value in more.items()}
    return lambda coupling: load_scenario(
        ROOT / "scenarios" / name, overrides={**overrides, "coupling": coupling, "output": {}})


def grown(end: float, fine: float) -> Sequence[tuple[float, float, float]]:
    """Windows of the reference that grow from a thousandth of `fine` at first."""
    return (20 * fine, 1e-3 * fine, fine), (end, fine, fine)


CASES: Mapping[str, Case] = {
    "two rods": Case(of_document(fresh.two_rods(1.0, 30.0)), 30.0, 0.5, 5, grown(30.0, 0.015625), reduced="to 30 s"),
    "thermoelastic column": Case(
        of_document(fresh.column(end=1.5)), 1.5, 0.1, 5, grown(1.5, 0.00078125), ("iterated", "Aitken", "adiabatic"),
        {"iteration": fresh.column()["coupling"]["iteration"]}, reduced="to 1.5 s"),
    "two-sided rod": Case(of_document(fresh.two_sided_rod(1.0, 10.0, method="midpoint")), 10.0, 0.32, 6,
                          grown(10.0, 0.004), reduced="to 10 s"),
    "seizing rod": Case(of_document(fresh.seizing_rod()), 300.0, 20.0, 5, grown(300.0, 0.625)),
    "casting_1d": Case(
        of_file("casting_1d.yaml", bodies__rod__mesh__rectangle__cells=[50, 1]), 20.0, 2.0, 5,
        ((1, 0.0005, 0.02), (20, 0.02, 0.05)), without=("rod.right",), reduced="50 cells, to 20 s"),
    "aluminium can": Case(
        of_file("aluminium_can.yaml", bodies__melt__mesh__rectangle__cells=[4, 12]), 6.0, 1.0, 4,
        ((1, 0.0005, 0.0125), (6, 0.0125, 0.0125)), without=("p.max",), reduced="4 x 12 cells in the casting, to 6 s"),
    "hot_upsetting": Case(
        of_file("hot_upsetting.yaml", bodies__billet__mesh__rectangle__cells=[6, 9],
                bodies__die__mesh__rectangle__cells=[12, 5]),
        0.4, 0.02, 4, ((0.1, 0.00001, 0.001), (0.12, 0.00001, 0.0005), (0.4, 0.0005, 0.0005)),
        reduced="6 x 9 and 12 x 5 cells, to 0.4 s"),
    "sliding blocks": Case(
        of_file("sliding_blocks.yaml", contact__interface__penalty=2.1e13,
                **{f"bodies__{b}__mesh__rectangle__cells": [8, 8] for b in ("lower", "upper")}),
        25000.0, 400.0, 4, ((2500, 1, 20), (9900, 20, 2), (10000, 2, 0.1), (12500, 0.1, 20), (14600, 1, 4),
                            (14800, 0.5, 0.5), (25000, 1, 80)),
        # The largest pressure peaks within windows of the reference, each time that an edge leaves another.
        more={"kinks": [14772.727272727272, 14776]}, without=("interface.p",), reduced="8 x 8 cells a block"),
}


def reference_of(case: Case, shorter: float) -> Scenario:
    """The run that errors are measured from, in windows that many times shorter than those of the case."""
    windows = [{"until": t, "first": a / shorter, "last": b / shorter} for t, a, b in case.fine]
    return case.scene({**case.more, "end": case.end, "windows": windows, "scheme": "iterated",
                       "events": {"locate": True}})


def fixed(case: Case, way: str, size: float) -> Scenario:
    """The scene in uniform windows [s]."""
    iteration = {**case.more.get("iteration", {}), **WAYS[way].get("iteration", {})}
    return case.scene({**case.more, **WAYS[way], "iteration": iteration, "end": case.end,
                       "windows": [{"until": case.end, "size": size}]})


def by_defaults(case: Case, looser: float) -> Scenario:
    """The scene with nothing stated but its end, and tolerances of so many times the defaults."""
    own = case.scene({"end": case.end}).coupling.adaptive
    assert own is not None, "windows are adaptive where none are listed"
    tolerance = {name: {"atol": looser * q.atol, "rtol": min(looser * q.rtol, 1.0)} for name, q in own.tolerance}
    return case.scene({"end": case.end, "adaptive": {"tolerance": tolerance}})


@dataclass(frozen=True)
class Point:
    """What a run cost and how far it was off, of the range of its worst probe."""

    calls: int
    seconds: float
    error: float
    worst: str


def solved(scenario: Scenario) -> tuple[Results, float]:
    """Results and CPU seconds.  Raises CouplingError for a run that failed."""
    with tempfile.TemporaryDirectory() as folder:
        started = time.process_time()
        results = run(scenario, Path(folder) / "run.h5")
        return results, time.process_time() - started


def point(scenario: Scenario, reference: Curves) -> Point | None:
    """Return None for a run that failed."""
    try:
        results, seconds = solved(scenario)
    except CouplingError:
        return None
    errors = {name: off(results.probe(name), reference[name]) for name in reference}
    worst = max(errors, key=errors.__getitem__)
    calls = results.windows.thermal_solves.sum() + results.windows.mechanical_solves.sum()
    return Point(int(calls), seconds, errors[worst], worst)


def off(probe: tuple[Array, Array], reference: tuple[Array, Array]) -> float:
    """Left out are gaps that nothing faces, and times within windows of the reference in which something may jump."""
    t, values = probe
    apart = np.abs(values - np.interp(t, *reference))[(t == 0.0) | (t >= reference[0][1])]
    return float(np.nanmax(apart) / (np.nanmax(reference[1]) - np.nanmin(reference[1])))


def curves(results: Results, case: Case) -> Curves:
    """The probes that vary."""
    found = {n: results.probe(n) for n in results.probe_names if n not in case.without}
    return {n: curve for n, curve in found.items() if np.nanmax(curve[1]) > np.nanmin(curve[1])}


def reference_curves(case: Case) -> tuple[Curves, float]:
    """The reference, and how far one in windows twice as long is off."""
    coarse, fine = (solved(reference_of(case, shorter))[0] for shorter in (0.5, 1.0))
    known = {n: broken(curve, fine) for n, curve in curves(fine, case).items()}
    return known, max(off(curve, known[n]) for n, curve in curves(coarse, case).items())


def broken(curve: tuple[Array, Array], results: Results) -> tuple[Array, Array]:
    """The curve with nothing in the window after each event of contact: a pressure may jump there, and where in it."""
    t, values = curve
    starts = [i + 1 for i in results.events if i + 2 < t.size]  # window i ends at t[i + 1]
    ends = [(t[i] + part * (t[i + 1] - t[i]), math.nan) for i in starts for part in (1e-9, 1.0 - 1e-9)]
    times, gone = np.array(ends).reshape(-1, 2).T
    order = np.argsort(np.concatenate([t, times]), kind="stable")
    return np.concatenate([t, times])[order], np.concatenate([values, gone])[order]


def tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def until_good(scenarios: Iterable[Scenario], reference: Curves) -> list[Point]:
    """Runs, each finer than the one before, until one is off by half of the least error wanted or was too dear."""
    points: list[Point] = []
    for scenario in scenarios:
        if (found := point(scenario, reference)) is not None:
            points.append(found)
            tell(f"  {found.calls} calls, {found.seconds:.1f} s, {100 * found.error:.2g} % ({found.worst})")
            if found.error < 0.5 * min(WANTED) or found.calls > TOO_DEAR:
                break
    return points


def cost(points: Sequence[Point], wanted: float) -> tuple[float, float]:
    """Return calls and CPU seconds from which on no run with more calls has a larger error; inf: no run has."""
    ordered = sorted(points, key=lambda p: p.calls)
    last = max((i for i, p in enumerate(ordered) if p.error > wanted), default=-1)
    if last + 1 == len(ordered):
        return math.inf, math.inf
    good = ordered[last + 1]
    if last < 0 or good.error <= 0.0:
        return float(good.calls), good.seconds
    bad = ordered[last]
    share = math.log(bad.error / wanted) / math.log(bad.error / good.error)
    return bad.calls * (good.calls / bad.calls) ** share, bad.seconds * (good.seconds / bad.seconds) ** share


def measured(case: Case, reference: Curves) -> dict[str, list[Point]]:
    solved(by_defaults(case, LOOSER[0]))  # loads what is compiled
    runs = {way: [fixed(case, way, case.first / 2**k) for k in range(case.times + 1)] for way in case.ways}
    found = {}
    for way, scenarios in {**runs, DEFAULTS: [by_defaults(case, k) for k in LOOSER]}.items():
        tell(f" {way}")
        found[way] = until_good(scenarios, reference)
    return found


@dataclass(frozen=True)
class Ratio:
    """Cost of all defaults over that of the best fixed scheme; nan : neither got there.  at_most : no fixed scheme did.
    """

    value: float
    best: str
    at_most: bool

    def __str__(self) -> str:
        if math.isnan(self.value):
            return "-"
        return f"{'< ' if self.at_most else ''}{self.value:.2f} {self.best}"


def ratio(found: Mapping[str, Sequence[Point]], wanted: float, of: int) -> Ratio:
    """of : 0 calls, 1 CPU seconds.

    Where no fixed scheme gets there, the best would cost more than the cheapest of their dearest runs.
    """
    mine = cost(found[DEFAULTS], wanted)[of]
    costs = {way: cost(points, wanted)[of] for way, points in found.items() if way != DEFAULTS}
    best = min(costs, key=costs.__getitem__)
    if costs[best] < math.inf:
        return Ratio(mine / costs[best], best, False)
    tried = {way: max((p.calls, p.seconds)[of] for p in found[way]) for way in costs if found[way]}
    best = min(tried, key=tried.__getitem__)
    return Ratio(mine / tried[best] if mine < math.inf else math.nan, best, True)


def rows_of(name: str, case: Case, found: Mapping[str, Sequence[Point]]) -> list[dict[str, str]]:
    """One row an error wanted."""
    rows, title = [], f"{name}, {case.reduced}" if case.reduced else name
    for wanted in WANTED:
        cells = {}
        for way in (*WAYS, DEFAULTS):
            calls, seconds = cost(found.get(way, ()), wanted)
            cells[way] = f"{calls:.0f} / {seconds:.1f}" if calls < math.inf else "-" if way in found else ""
        rows.append({"scene": title, "error": f"{100 * wanted:g} %", **cells,
                     "ratio of calls": str(ratio(found, wanted, 0)), "of seconds": str(ratio(found, wanted, 1))})
    return rows


def summary(found: Sequence[Mapping[str, Sequence[Point]]]) -> str:
    """Geometric means and largest ratios, of the scenes where a fixed scheme got there; else there are bounds."""
    lines = []
    for wanted in WANTED:
        for of, what in enumerate(("calls", "CPU seconds")):
            known = [r.value for f in found if not (r := ratio(f, wanted, of)).at_most]
            mean = math.exp(sum(map(math.log, known)) / len(known)) if known else math.nan
            lines.append(f"{100 * wanted:g} %, {what}, all defaults over the best fixed scheme: geometric mean "
                         f"{mean:.2f}, largest {max(known, default=math.nan):.2f}, of {len(known)} scenes of "
                         f"{len(found)}")
    return "\n".join(lines)


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
        tell(name)
        reference, doubt = reference_curves(case)
        kept[name] = measured(case, reference)
        rows += rows_of(name, case, kept[name])
        tell(f"{name}: reference and one in windows twice as long differ by {100 * doubt:.3f} %; "
             f"{time.process_time():.0f} s of CPU so far")
        if args.json:
            args.json.write_text(json.dumps({n: {way: [asdict(p) for p in points] for way, points in f.items()}
                                             for n, f in kept.items()}, indent=1))
    print(table(rows))
    print(summary(list(kept.values())))


if __name__ == "__main__":
    main()
