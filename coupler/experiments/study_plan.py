"""Plans a study: every run of the grid and of the reference, checked and named before the first one begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from coupler.errors import ScenarioError
from coupler.experiments.grid import Setting, setting_at, settings_of
from coupler.experiments.reference import RATIOS
from coupler.experiments.trial import LEAN, Job, key_of
from coupler.scenario import Scenario
from coupler.scenario.document import Document
from coupler.scenario.edits import apply_overrides
from coupler.scenario.load import checked
from coupler.scenario.schema import StudyReference, StudySpec

# Keys of this part change how a scene is solved, not the scene.
OF_THE_COUPLING = ("coupling", "scheme", "windows", "tolerance", "substeps")


@dataclass(frozen=True)
class PlannedRun:
    """A run of a study.  key : its name in the store."""

    setting: Setting
    job: Job
    key: str


@dataclass(frozen=True)
class StudyPlan:
    """The runs of a study.

    runs : of the grid.  references : of the reference, finest first; empty: it is a file.  base : the scenario.
    """

    runs: tuple[PlannedRun, ...]
    references: tuple[PlannedRun, ...]
    base: Scenario
    spec: StudySpec
    notes: tuple[str, ...]

    @property
    def span(self) -> tuple[float, float]:
        """Over which errors are measured [s]."""
        return self.spec.span or (0.0, self.base.coupling.end)


def study_plan_of(document: Document, overrides: Mapping[str, Any], options: Mapping[str, Any],
                  packages: str) -> StudyPlan:
    """Plan a study, and check everything it will run.

    options : of the command line, in place of the keys of the scenario's `study`.  packages : hash of the sources.
    Raises ScenarioError that names the setting of the grid which is wrong.
    """
    changed = apply_overrides(document, overrides)
    written = changed.tree.get("study") or {}
    sets = {**overrides, "study": {**written, **options}} if isinstance(written, dict) else overrides
    base = checked(document, sets)
    spec = StudySpec.model_validate(base.resolved["study"])
    if spec.span is not None and spec.span[0] >= base.coupling.end:
        raise ScenarioError(f"the span begins after the run ends, at {base.coupling.end:g} s", key="study.span",
                            value=list(spec.span))
    planner = _Planner(document, overrides, packages)
    runs = tuple(planner.planned(setting, f"run {setting.label!r}") for setting in settings_of(changed, spec.grid))
    references = tuple(planner.planned(setting, "the reference") for setting in _reference_settings(changed, spec))
    return StudyPlan(runs, references, base, spec, tuple(_notes(spec)))


@dataclass(frozen=True)
class _Planner:
    document: Document
    overrides: Mapping[str, Any]
    packages: str

    def planned(self, setting: Setting, who: str) -> PlannedRun:
        sets = {**self.overrides, **setting.sets}
        try:
            scenario = checked(self.document, {**sets, **LEAN})
        except ScenarioError as exc:
            raise ScenarioError(f"{who}: {exc.message}", file=exc.file, line=exc.line, key=exc.key, value=exc.value,
                                remedy=exc.remedy) from exc
        job = Job(self.document.text, str(Path(self.document.path).absolute()), sets)
        return PlannedRun(setting, job, key_of(scenario, self.packages))


def _reference_settings(document: Document, spec: StudySpec) -> list[Setting]:
    """Return the settings of the reference: windows `finer` times as fine as the finest of the grid, then twice and
    four times as long."""
    r = spec.reference
    if r.file is not None:
        return []
    finest = min((float(v) for grid in spec.grid for v in grid.get("windows", ())), default=1.0)
    settings = []
    for ratio in RATIOS:
        try:
            setting = setting_at(document, {"scheme": r.scheme.value, **r.set, "windows": finest * ratio / r.finer})
        except ScenarioError as exc:
            raise ScenarioError(f"the reference: {exc.message}", key=exc.key, value=exc.value, remedy=(
                "Give it windows: study.reference.set: {coupling.windows: [...]}, or a file.")) from exc
        settings.append(replace(setting, at={"reference": ratio, **setting.at}))
    return settings


def describe_reference(r: StudyReference, runs: Sequence[PlannedRun]) -> str:
    """Describe what the reference is."""
    if r.file is not None:
        return f"the answer in {Path(r.file).name}"
    finest = runs[0].setting.at["windows"]
    more = "".join(f", {axis} {value}" for axis, value in r.set.items() if not isinstance(value, list | dict))
    return f"{r.scheme.value} with windows of {finest:g} times those of the scenario{more}"


def _notes(spec: StudySpec) -> list[str]:
    axes = {axis for grid in spec.grid for axis in grid if axis.split(".")[0] not in OF_THE_COUPLING}
    if not axes:
        return []
    against = "the stored answer" if spec.reference.file else "the scenario as it is"
    if spec.reference.set:
        against = "the scenario with " + ", ".join(f"{a} {v}" for a, v in spec.reference.set.items())
    return [f"The grid changes {', '.join(sorted(axes))}, and its errors are to {against}. The reference's own error, "
            "as it is estimated here, is that of its windows alone."]
