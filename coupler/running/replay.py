"""Replays rules on a finished run: which of them would have fired, from what the run recorded."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from coupler.record.results import Results
from coupler.rules import engine
from coupler.scenario import Scenario
from coupler.scenario.rule_model import INCREMENT, RATE, Rule, with_rate
from coupler.schemes.state import Verdict

# Columns of the windows table that are monitors under another name.
COLUMNS = {"window": "H", "iterations": "iterations", "contraction": "contraction", "touching": "touching",
           "max_T": "max_T", "max_p": "max_p", "thermal.iterations": "thermal_iterations",
           "mechanical.iterations": "mechanical_iterations", "error": "error"}
ALWAYS = frozenset({*COLUMNS, "t", "number"}) | engine.OF_FAILURE
DISCARDS = {Verdict.THERMAL_DISCARD.value: "thermal", Verdict.MECHANICAL_DISCARD.value: "mechanical"}
FAILED = (*DISCARDS, Verdict.MAX_ITERATIONS.value)


@dataclass(frozen=True)
class ReplayedFiring:
    """A firing.  row : of the windows table, from 0.  values : of the monitors that the rule compares.

    t : end of an accepted window, start of one that failed [s].
    """

    row: int
    t: float
    values: Mapping[str, float]


@dataclass(frozen=True)
class RuleReplay:
    """What one rule would have done.

    missing : monitors the run did not record, so that nothing can be said.
    did : how often the run's own rule of this name fired.
    """

    rule: Rule
    missing: tuple[str, ...] = ()
    firings: tuple[ReplayedFiring, ...] = ()
    did: int = 0


@dataclass(frozen=True)
class _RecordedWindow:
    row: int
    failed: bool
    monitors: Mapping[str, float]


def replayed(rules: Sequence[Rule], results: Results) -> list[RuleReplay]:
    """Replay each rule alone on the windows of a run; what it would have changed is not in the record.

    A rule of the run that rejected windows never fires on those that were accepted: `did` counts what it did then.
    """
    windows = list(_monitors(results))
    has = ALWAYS | {*results.monitors, *results.probe_names} | ({RATE} if INCREMENT in results.monitors else set())
    replays = []
    for rule in rules:
        did = sum(f.rule == rule.name for f in results.firings)
        missing = tuple(sorted(rule.monitors - has))
        replays.append(RuleReplay(rule, missing, () if missing else tuple(_firings(rule, results, windows)), did))
    return replays


def rules_report(scenario: Scenario, results: Results) -> Iterator[str]:
    """Yield lines for a user: the run, then a line on each rule."""
    taken = int(results.windows.taken.sum())
    yield (f"{results.path.name}: {results.header['title']}, {results.outcome}, {taken} windows to "
           f"t = {results.t[-1]:.6g} s. Of the rules of {scenario.file.name}:")
    for replay in replayed(scenario.rules, results):
        yield f"  {sentence(replay, results)}"
    if not scenario.rules:
        yield "  there are none"


def sentence(replay: RuleReplay, results: Results) -> str:
    """Return a line on a rule."""
    name, own = replay.rule.name, f"; it fired {_times(replay.did)} in the run itself" if replay.did else ""
    if replay.missing:
        return f"{name}: unknown, because {results.path.name} has not recorded {', '.join(replay.missing)}{own}"
    if not replay.firings:
        return f"{name}: never{own}"
    first = replay.firings[0]
    values = ", ".join(f"{n} {v:.6g}" for n, v in first.values.items())
    return f"{name}: {_times(len(replay.firings))}, first in row {first.row + 1} of the windows, " \
        f"t = {first.t:.6g} s" + (f" ({values})" if values else "") + own


def _times(n: int) -> str:
    return "once" if n == 1 else f"{n} times"


def _firings(rule: Rule, results: Results, windows: Sequence[_RecordedWindow]) -> Iterator[ReplayedFiring]:
    memory = engine.Memory(last=_recorded(results, 0) | {"t": float(results.t[0])})
    for window in windows:
        fired, memory = engine.alone(rule, memory, window.monitors, window.failed)
        if fired is not None:
            yield ReplayedFiring(window.row, window.monitors["t"], fired.values)


def _monitors(results: Results) -> Iterator[_RecordedWindow]:
    """Yield every window that was accepted, or that failed."""
    taken = failures = 0
    for row, w in enumerate(results.windows):
        monitors = {name: float(w[column]) for name, column in COLUMNS.items()} | {"number": float(taken + 1)}
        monitors["iterations"] = max(monitors["iterations"], 1.0)
        verdict = str(w["verdict"])
        if w["taken"]:
            taken, failures = taken + 1, 0
            monitors |= _recorded(results, taken) | {"t": float(results.t[taken])}
            substeps = float(w["mechanical_solves"]) / monitors["iterations"]
            yield _RecordedWindow(row, False, with_rate(monitors, monitors["window"] / max(substeps, 1.0)))
            continue
        failures += 1
        if verdict in FAILED:
            status = {f"{side}.status": float(DISCARDS.get(verdict) == side) for side in ("thermal", "mechanical")}
            yield _RecordedWindow(row, True, {n: monitors[n] for n in ("window", "number", "iterations")} | status | {
                "t": float(w["t"]), "failures": float(failures)})


def _recorded(results: Results, k: int) -> dict[str, float]:
    """Return probes and recorded monitors at results.t[k], SI."""
    values = {name: float(series[k]) for name, series in results.monitors.items()}
    values |= {name: float(results.probe(name)[1][k]) for name in results.probe_names}
    return {name: value for name, value in values.items() if not math.isnan(value)}
