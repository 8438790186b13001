"""Resumes a run that ended early: interrupted, stopped, failed or killed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from coupler.errors import ResultsError, ScenarioError
from coupler.record.checkpoint import Origin, read_checkpoint, versions
from coupler.record.journal import being_written, check_mark, read_journal
from coupler.record.paths import checkpoint_of, journal_of, stopped_of
from coupler.record.results import Results
from coupler.running.interactive import Changes
from coupler.running.progress import Progress
from coupler.running.run import Run
from coupler.scenario import Scenario
from coupler.scenario.load import scenario_from


def resume(run: Run | str | Path, *, processes: bool = False, until: float | None = None,
           on_window: Callable[[Progress], None] | None = None, changes: Changes | None = None) -> Results:
    """Resume the run of a results file to its end, into the same file, as if it had never stopped.

    run : the results file, or the run that `resumed` returned.  until : stop at the first window end at or after
    this time [s].  on_window : called after every window tried.  changes : as Run.change has them, before the first
    window, for example those of `changes_of`.
    Raises ResultsError where that run cannot be resumed (nothing is changed then), CouplingError, HalfError.
    """
    with run if isinstance(run, Run) else resumed(run, processes=processes) as r:
        if changes:
            r.change(**changes)
        for progress in r.windows(until):
            if on_window is not None:
                on_window(progress)
    return Results(r.out)


def resumed(out: str | Path, *, processes: bool = False, hosts: str | Path | None = None) -> Run:
    """Return the run of a results file, to be continued window by window.

    >>> with resumed("run.h5") as r:
    ...     for w in r.windows():
    ...         print(w.t, w.max_T)

    Raises ResultsError where it still goes on or is complete, where checkpoint or journal are missing, cut, damaged or
    not of one run, or where the scenario's meshes or the versions of what it computes with have changed.
    """
    path = Path(out)
    journal = _journal(path)
    origin, checkpoint = read_checkpoint(checkpoint_of(path), versions())
    check_mark(journal, checkpoint.record.mark)
    return Run(_scenario(journal, origin), path, processes=processes, since=checkpoint, hosts=hosts)


# What may change between two windows: how they are solved.  All else is built into the halves or recorded already.
CHANGEABLE = ("coupling.scheme", "coupling.substeps", "coupling.iteration", "coupling.adaptive.most")


def changes_of(out: str | Path, overrides: Mapping[str, Any]) -> Changes:
    """Return what values of the scenario change in the run of a results file when it is resumed.

    overrides : by dotted key.  Raises ScenarioError for a value that is wrong, and for a key that cannot change in a
    run that has begun; ResultsError as `resumed`.
    """
    for key, value in overrides.items():
        # fault: what a run is built of is changed on the way, in silence -> if False: | coupler/test_resume
        if not any(key == name or key.startswith(f"{name}.") for name in CHANGEABLE):
            raise ScenarioError("this cannot change in a run that has begun", key=key, value=value,
                                remedy=f"What can: {', '.join(CHANGEABLE)}. For all else run the scenario anew")
    path = Path(out)
    journal = _journal(path)
    origin, _ = read_checkpoint(checkpoint_of(path), versions())
    before = _scenario(journal, origin)
    wanted = {**json.loads(origin.overrides), **overrides}
    most, adaptive = overrides.get("coupling.adaptive.most"), before.coupling.adaptive
    if adaptive is not None and isinstance(most, int | float) and 0.0 < most < adaptive.first:
        wanted["coupling.adaptive.first"] = most  # that window is behind us, and must be no longer than the most
    # The whole scenario is checked with them, so that mistakes are told as always.
    after = scenario_from(before.text, Path(origin.file), wanted)
    changes, new = Changes(), after.coupling
    if "coupling.scheme" in overrides:
        changes["scheme"] = new.scheme
    if any(key.startswith("coupling.substeps") for key in overrides):
        changes["substeps"] = dict(new.substeps)
    if any(key.startswith("coupling.iteration") for key in overrides):
        changes["iteration"] = new.iteration
    if "coupling.adaptive.most" in overrides and new.adaptive is not None:
        changes["window_cap"] = new.adaptive.most
    return changes


def _journal(path: Path) -> Path:
    """Return the journal of a run that ended early.  Raises ResultsError where there is nothing to resume."""
    journal = journal_of(path) if journal_of(path).exists() else stopped_of(path)
    if not journal.exists():
        if path.exists() and Results(path).outcome == "completed":
            raise ResultsError(f"{path}: its run is complete; there is nothing to resume")
        if not path.exists():
            raise ResultsError(f"{path}: there is no such file, and no journal of a run beside it. Check the path")
        raise ResultsError(f"{path}: there is no journal of a run beside it, so nothing can be resumed; run it anew")
    try:
        goes_on = being_written(journal)
    except FileNotFoundError:  # the run ended meanwhile, and has moved it
        return _journal(path)
    if goes_on:
        raise ResultsError(f"{path}: its run still goes on; there is nothing to resume")
    if not checkpoint_of(path).exists():
        raise ResultsError(f"{path}: its run left no checkpoint (it ended before its first window, "
                           "or output.checkpoint is null, or a half cannot write its state down); run it anew")
    return journal


def _scenario(journal: Path, origin: Origin) -> Scenario:
    """Return the scenario as it was run.

    Raises ResultsError if it is another now, ScenarioError if a mesh is missing.
    """
    text = next(str(r.meta["scenario"]["text"]) for r in read_journal(journal) if r.kind == "run")
    scenario = scenario_from(text, Path(origin.file), json.loads(origin.overrides))
    if scenario.hash != origin.scenario:
        raise ResultsError(f"{journal}: belongs to scenario {origin.scenario}, {origin.file} with its meshes is now "
                           f"{scenario.hash}: a mesh file has changed, or the checkpoint is of another run")
    return scenario
