"""A study, from a scenario to a folder: plan, run what is not kept, measure, write."""

from __future__ import annotations

import os
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from coupler.errors import ResultsError, ScenarioError
from coupler.pilot import is_quick, pilot
from coupler.scenario.document import Document
from coupler.scenario.reading import read_document
from coupler.study.cluster import run_there
from coupler.study.limits import Limit, limits_of
from coupler.study.plan import Planned, StudyPlan, plan_of, reference_words
from coupler.study.pool import run_here
from coupler.study.reference import Reference, from_file, richardson
from coupler.study.score import Point, Scale, point_of, scale_of
from coupler.study.show import StudyLine
from coupler.trials.store import Store, sources
from coupler.trials.trial import Job, Trial


@dataclass(frozen=True)
class How:
    """processes : of this machine, one thread each; 0: as many as it has cores.  cluster : a Dask scheduler's address
    instead; empty: none.  limit [s] : of wall time for one run; not with a cluster.

    pilot : predict limits even where it takes time.
    """

    processes: int = 0
    cluster: str = ""
    limit: float | None = None
    pilot: bool = False


@dataclass(frozen=True)
class Study:
    """What a study found.  points : of plan.runs, in order."""

    document: Document
    plan: StudyPlan
    trials: Sequence[Trial]
    points: Sequence[Point]
    reference: Reference
    scale: Scale
    limits: Sequence[Limit] = ()
    notes: Sequence[str] = field(default=())


def conduct(path: Path, out: Path, overrides: Mapping[str, Any], options: Mapping[str, Any], how: How,
            show: StudyLine) -> Study:
    """Run the study of the scenario file `path`; trials are kept in out/runs, and what is there is not run again.

    overrides : dotted key -> value, of every run.  options : keys of `study` in place of the file's own.
    Raises ScenarioError before anything runs, ResultsError for a folder that cannot be used or a reference that
    failed.  Ctrl-C leaves a folder from which the same call goes on.
    """
    if how.cluster and how.limit is not None:
        raise ScenarioError("a run on a cluster cannot be given up", key="--limit", value=how.limit,
                            remedy="Leave --limit or --cluster out.")
    document = read_document(path)
    plan = plan_of(document, overrides, options, sources())
    _make(out)
    store = Store(out / "runs")
    answer = from_file(path.parent / plan.spec.reference.file, plan.spec.reference.error) \
        if plan.spec.reference.file else None
    every = {run.key: run for run in (*plan.references, *plan.runs)}
    trials = _run(every, store, how, show)
    if answer is None:
        words = reference_words(plan.spec.reference, plan.references)
        answer = richardson([trials[r.key] for r in plan.references], words, plan.spec.measure, plan.span)
    scale = scale_of(answer, plan.spec.measure, plan.span)
    found = [trials[run.key] for run in plan.runs]
    points = [point_of(run.cell.label, run.cell.series, o, answer, scale)
              for run, o in zip(plan.runs, found, strict=True)]
    limits = _limits(plan, points, how)
    return Study(document, plan, found, points, answer, scale, limits, plan.notes)


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise ResultsError(f"{out}: the folder of the study cannot be made ({exc.strerror})") from exc


def _run(every: Mapping[str, Planned], store: Store, how: How, show: StudyLine) -> dict[str, Trial]:
    """The trial of every run, by its key."""
    trials = {key: kept for key in every if (kept := store.get(key)) is not None}
    # fault: a study runs again what it has -> left = {key: run.job for key, run in every.items()} |
    #   coupler/test_study_run
    left = {key: run.job for key, run in every.items() if key not in trials}
    try:
        show.begin(len(every), len(trials))
        with closing(_running(left, how)) as running:
            for key, trial in running:
                trials[key] = trial
                if trial.kept:
                    store.put(key, trial)
                show(every[key].cell.label, trial)
    except KeyboardInterrupt as exc:
        exc.add_note(f"stopped; {len(trials)} of {len(every)} runs are kept, and the same command goes on from them")
        raise
    return trials


def _running(jobs: Mapping[str, Job], how: How) -> Generator[tuple[str, Trial], None, None]:
    if jobs:
        yield from (run_there(jobs, how.cluster) if how.cluster
                    else run_here(jobs, how.processes or os.cpu_count() or 1, how.limit))


def _limits(plan: StudyPlan, points: Sequence[Point], how: How) -> Sequence[Limit]:
    if plan.base.coupling.adaptive is not None or not (how.pilot or is_quick(plan.base)):
        return ()
    return limits_of(pilot(plan.base), plan.runs, points)
