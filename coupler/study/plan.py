"""What a study will run: every cell checked and named before the first run begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from coupler.errors import ScenarioError
from coupler.scenario import Scenario
from coupler.scenario.document import Document
from coupler.scenario.load import checked
from coupler.scenario.override import apply_overrides
from coupler.scenario.schema_study import Study, StudyReference
from coupler.study.grid import Cell, cell_at, cells_of
from coupler.study.reference import RATIOS
from coupler.trials.store import key_of
from coupler.trials.trial import LEAN, Job

# Keys of this part change how a scene is solved, not the scene.
OF_THE_COUPLING = ("coupling", "scheme", "windows", "tolerance", "substeps")


@dataclass(frozen=True)
class Planned:
    """One run.  key : its name in the store."""

    cell: Cell
    job: Job
    key: str


@dataclass(frozen=True)
class StudyPlan:
    """runs : of the grid.  references : of the reference, finest first; empty: it is a file.  base : the scenario."""

    runs: tuple[Planned, ...]
    references: tuple[Planned, ...]
    base: Scenario
    spec: Study
    notes: tuple[str, ...]

    @property
    def span(self) -> tuple[float, float]:
        """Over which errors are measured [s]."""
        return self.spec.span or (0.0, self.base.coupling.end)


def plan_of(document: Document, overrides: Mapping[str, Any], options: Mapping[str, Any], packages: str) -> StudyPlan:
    """Check everything a study will run.

    options : of the command line, in place of the keys of the scenario's `study`.  packages : hash of the sources.
    Raises ScenarioError that names the setting of the grid which is wrong.
    """
    changed = apply_overrides(document, overrides)
    written = changed.tree.get("study") or {}
    sets = {**overrides, "study": {**written, **options}} if isinstance(written, dict) else overrides
    base = checked(document, sets)
    spec = Study.model_validate(base.resolved["study"])
    if spec.span is not None and spec.span[0] >= base.coupling.end:
        raise ScenarioError(f"the span begins after the run ends, at {base.coupling.end:g} s", key="study.span",
                            value=list(spec.span))
    planner = _Planner(document, overrides, packages)
    runs = tuple(planner.planned(cell, f"run {cell.label!r}") for cell in cells_of(changed, spec.grid))
    references = tuple(planner.planned(cell, "the reference") for cell in _reference_cells(changed, spec))
    return StudyPlan(runs, references, base, spec, tuple(_notes(spec)))


@dataclass(frozen=True)
class _Planner:
    document: Document
    overrides: Mapping[str, Any]
    packages: str

    def planned(self, cell: Cell, who: str) -> Planned:
        sets = {**self.overrides, **cell.sets}
        try:
            scenario = checked(self.document, {**sets, **LEAN})
        except ScenarioError as exc:
            raise ScenarioError(f"{who}: {exc.message}", file=exc.file, line=exc.line, key=exc.key, value=exc.value,
                                remedy=exc.remedy) from exc
        job = Job(self.document.text, str(Path(self.document.path).absolute()), sets)
        return Planned(cell, job, key_of(scenario, self.packages))


def _reference_cells(document: Document, spec: Study) -> list[Cell]:
    """Windows `finer` times as fine as the finest of the grid, then twice and four times as long."""
    r = spec.reference
    if r.file is not None:
        return []
    finest = min((float(v) for grid in spec.grid for v in grid.get("windows", ())), default=1.0)
    cells = []
    for ratio in RATIOS:
        try:
            cell = cell_at(document, {"scheme": r.scheme.value, **r.set, "windows": finest * ratio / r.finer})
        except ScenarioError as exc:
            raise ScenarioError(f"the reference: {exc.message}", key=exc.key, value=exc.value, remedy=(
                "Give it windows: study.reference.set: {coupling.windows: [...]}, or a file.")) from exc
        cells.append(replace(cell, at={"reference": ratio, **cell.at}))
    return cells


def reference_words(r: StudyReference, runs: Sequence[Planned]) -> str:
    """What the reference is, in words."""
    if r.file is not None:
        return f"the answer in {Path(r.file).name}"
    finest = runs[0].cell.at["windows"]
    more = "".join(f", {axis} {value}" for axis, value in r.set.items() if not isinstance(value, list | dict))
    return f"{r.scheme.value} with windows of {finest:g} times those of the scenario{more}"


def _notes(spec: Study) -> list[str]:
    axes = {axis for grid in spec.grid for axis in grid if axis.split(".")[0] not in OF_THE_COUPLING}
    if not axes:
        return []
    against = "the stored answer" if spec.reference.file else "the scenario as it is"
    if spec.reference.set:
        against = "the scenario with " + ", ".join(f"{a} {v}" for a, v in spec.reference.set.items())
    return [f"The grid changes {', '.join(sorted(axes))}, and its errors are to {against}. The reference's own error, "
            "as it is estimated here, is that of its windows alone."]
