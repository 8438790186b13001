"""Which rules would have fired in a run that is done, from what it recorded."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from coupler.record.results import Results
from coupler.rules import engine as plug
from coupler.scenario import Scenario
from coupler.scenario.rule_model import INCREMENT, RATE, Rule, with_rate
from coupler.schemes.state import Verdict

# Columns of the windows table that are monitors under another name.
COLUMNS = {"window": "H", "iterations": "iterations", "contraction": "contraction", "touching": "touching",
           "max_T": "max_T", "max_p": "max_p", "thermal.iterations": "thermal_iterations",
           "mechanical.iterations": "mechanical_iterations", "error": "error"}
ALWAYS = frozenset({*COLUMNS, "t", "number"}) | plug.OF_FAILURE
DISCARDS = {Verdict.THERMAL_DISCARD.value: "thermal", Verdict.MECHANICAL_DISCARD.value: "mechanical"}
FAILED = (*DISCARDS, Verdict.MAX_ITERATIONS.value)


@dataclass(frozen=True)
class Would:
    """What one rule would have done.  missing : monitors the run did not record; then it is not known.

    firings : row of the windows table (from 0), t [s] (of the end of a window that was taken, of the start of one that
    failed), and the monitors it looked at.  did : how often the run's own rule of this name fired.
    """

    rule: Rule
    missing: tuple[str, ...] = ()
    firings: tuple[tuple[int, float, Mapping[str, float]], ...] = ()
    did: int = 0


def replayed(rules: Sequence[Rule], results: Results) -> list[Would]:
    """Each rule by itself on the windows of a run: what it would have changed is not in the record, so nothing follows.

    A rule of the run that put windows back never fires on those that were taken: `did` counts what it did then.
    """
    seen = list(_monitors(results))
    has = ALWAYS | {*results.monitors, *results.probe_names} | ({RATE} if INCREMENT in results.monitors else set())
    found = []
    for rule in rules:
        did = sum(f.rule == rule.name for f in results.firings)
        missing = tuple(sorted(rule.monitors - has))
        found.append(Would(rule, missing, () if missing else tuple(_firings(rule, results, seen)), did))
    return found


def rules_report(scenario: Scenario, results: Results) -> Iterator[str]:
    """Lines for a user: the run, then a line on each rule."""
    taken = int(results.windows.taken.sum())
    yield (f"{results.path.name}: {results.header['title']}, {results.outcome}, {taken} windows to "
           f"t = {results.t[-1]:.6g} s. Of the rules of {scenario.file.name}:")
    for would in replayed(scenario.rules, results):
        yield f"  {words(would, results)}"
    if not scenario.rules:
        yield "  there are none"


def words(would: Would, results: Results) -> str:
    """A line on it."""
    name, own = would.rule.name, f"; it fired {_times(would.did)} in the run itself" if would.did else ""
    if would.missing:
        return f"{name}: not known, for {results.path.name} has not recorded {', '.join(would.missing)}{own}"
    if not would.firings:
        return f"{name}: never{own}"
    row, t, values = would.firings[0]
    told = ", ".join(f"{n} {v:.6g}" for n, v in values.items())
    return f"{name}: {_times(len(would.firings))}, first in row {row + 1} of the windows, t = {t:.6g} s" + (
        f" ({told})" if told else "") + own


def _times(n: int) -> str:
    return "once" if n == 1 else f"{n} times"


def _firings(rule: Rule, results: Results, seen: Sequence[tuple[int, bool, Mapping[str, float]]]) -> Iterator[
        tuple[int, float, Mapping[str, float]]]:
    memory = plug.Memory(last=_told(results, 0) | {"t": float(results.t[0])})
    for row, failed, monitors in seen:
        fired, memory = plug.alone(rule, memory, monitors, failed)
        if fired is not None:
            yield row, monitors["t"], fired.values


def _monitors(results: Results) -> Iterator[tuple[int, bool, Mapping[str, float]]]:
    """(row, whether it failed, monitors) of every window that was taken, or that failed."""
    taken = failures = 0
    for row, w in enumerate(results.windows):
        found = {name: float(w[column]) for name, column in COLUMNS.items()} | {"number": float(taken + 1)}
        found["iterations"] = max(found["iterations"], 1.0)
        verdict = str(w["verdict"])
        if w["taken"]:
            taken, failures = taken + 1, 0
            found |= _told(results, taken) | {"t": float(results.t[taken])}
            substeps = float(w["mechanical_solves"]) / found["iterations"]
            yield row, False, with_rate(found, found["window"] / max(substeps, 1.0))
            continue
        failures += 1
        if verdict in FAILED:
            status = {f"{side}.status": float(DISCARDS.get(verdict) == side) for side in ("thermal", "mechanical")}
            yield row, True, {n: found[n] for n in ("window", "number", "iterations")} | status | {
                "t": float(w["t"]), "failures": float(failures)}


def _told(results: Results, k: int) -> dict[str, float]:
    """Probes and recorded monitors at results.t[k]."""
    found = {name: float(values[k]) for name, values in results.monitors.items()}
    found |= {name: float(results.probe(name)[1][k]) for name in results.probe_names}
    return {name: value for name, value in found.items() if not math.isnan(value)}
