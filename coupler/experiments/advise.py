"""Finds the cheapest model within the tolerances: searches, reports, and writes the advised scenario."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from textwrap import wrap
from typing import Any

from coupler.errors import CouplingError, ScenarioError
from coupler.experiments.advice_text import advice, summary
from coupler.experiments.findings import (
    Findings,
    GoalRequest,
    SimplificationTrial,
    combination_of,
    compare,
    edits_of,
    goals_of,
    largest_ratio,
    named,
    own_probes,
    parse_goal,
)
from coupler.experiments.trial import (
    Job,
    StoppedError,
    TrialResult,
    TrialStore,
    key_of,
    run_trial,
    scenario_of,
    sources,
)
from coupler.experiments.variants import (
    CELLS,
    Aspect,
    Edit,
    Simplification,
    at,
    cells_of,
    contact_probes,
    edited,
    iterated,
    mesh_factor,
    meshed,
    simplifications_of,
    timed,
    windows_factor,
)
from coupler.fmu.launch import make_folder
from coupler.record.paths import write_whole
from coupler.running.setup import plan_of
from coupler.scenario import Scenario
from coupler.scenario.document import WIDTH, Document, document_from, dumped, layout, read_document
from coupler.scenario.load import load_scenario
from coupler.scenario.quantities import with_overrides, with_plain_numbers

# Greedy model reduction: the full model, each simplification alone, then all that stay within the tolerances.

# Time that is reserved for the combination and for what may have to be put back into it, in runs of the base.
RESERVE = 2.0
# Wall time a second of processor time takes at least, where others may come to use the machine.
SHARED_MACHINE = 2.0
HALF_MESH, HALF_WINDOWS = 0.5, 0.5
FULL_MODEL, COMBINATION = "the full model", "all accepted simplifications together"
SHORT_WINDOWS = "windows half as long"
OWN_MESH = "the scenario's own mesh and windows"

# Called with the name of each trial before it runs; returns what is called with the fraction that is done.
OnTrial = Callable[[str], Callable[[float], object]]


class LateError(Exception):
    """A trial was not begun, because it would hardly end in time."""


def variant(document: Document, edits: Sequence[Edit]) -> Scenario:
    """Return the scenario with edits, as a trial runs it.  Raises ScenarioError for one that is not valid."""
    return scenario_of(Job(document.text, str(document.path), edited(document.tree, edits)))


class TrialRunner:
    """Runs trials of a scenario and stores them in a folder.

    deadline : of time.monotonic(); a trial that is not done by then is stopped.
    """

    def __init__(self, document: Document, folder: Path, deadline: float = float("inf")) -> None:
        self.document = document
        self.deadline = deadline
        self._store = TrialStore(folder)
        self._sources = sources()

    def run(self, edits: Sequence[Edit], begin: Callable[[], Callable[[float], object]],
            need: float = 0.0) -> TrialResult:
        """Run the trial of these edits, or return the stored one.

        begin : called before it runs; returns what is called with the fraction that is done.  need : time it will
        take [s].  An invalid scenario and a run that fails give a failed trial.
        Raises LateError where there is not so much time, StoppedError, ResultsError where it cannot be stored.
        """
        try:
            scenario = variant(self.document, edits)
        except ScenarioError as exc:
            return TrialResult(f"{exc.key}: {exc.message}" if exc.key else exc.message)
        key = key_of(scenario, self._sources)
        if (stored := self._store.get(key)) is not None:
            return stored
        if (remaining := self.deadline - time.monotonic()) <= 0.0:
            raise StoppedError("time is up")
        if need > remaining:
            raise LateError
        done = run_trial(scenario, self.deadline, begin())
        # fault: advice: trials are not kept -> pass | scenarios/test_advise
        self._store.put(key, done)
        return done


class ModelSearch:
    """One search.  findings : up to now, also after it was stopped.

    runner : runs and stores trials within the time there is.  requests : goals as the user wrote them.
    cells : most cells of a body in trials.
    """

    def __init__(self, runner: TrialRunner, requests: Sequence[GoalRequest], on_trial: OnTrial,
                 cells: int = CELLS) -> None:
        self._runner, self._requests, self._on_trial = runner, requests, on_trial
        self._tree = runner.document.tree
        mesh = min(mesh_factor(self._tree, cells), 1.0)
        plan = plan_of(variant(runner.document, []))
        count = len(plan.schedule.bounds) - 1 if plan.adaptive is None else 0
        self.findings = Findings(mesh=mesh, windows=windows_factor(count, mesh))

    def run(self) -> Findings:
        """Search until done, out of time or interrupted.  Raises CouplingError where the full model cannot be run."""
        try:
            self._run_full_model()
            self._try_simplifications()
            self._combine()
        except (StoppedError, KeyboardInterrupt) as exc:
            self.findings = replace(self.findings, stopped=str(exc) or "stopped by Ctrl-C")
        return self.findings

    def _run_full_model(self) -> None:
        full = self._trial(FULL_MODEL, [])
        if full.failed:
            raise CouplingError(f"the full model cannot be run on the mesh of the trials: {full.failed}",
                                remedy="Give the trials more cells: --cells")
        self.findings = replace(self.findings, full=full, base=full, goals=goals_of(self._requests, full))
        top = self._trial(f"{FULL_MODEL}, iterated", [iterated(self._tree)])
        if not top.failed:
            self.findings = replace(self.findings, iterated=top, coupling_error=compare(full, top, self.findings.goals))

    def _try_simplifications(self) -> None:
        simplifications = simplifications_of(self._tree)
        for aspect in (Aspect.MECHANICS, Aspect.HEAT, Aspect.SCHEME, Aspect.EFFECT, Aspect.WINDOWS):
            for simplification in (s for s in simplifications if s.aspect is aspect):
                rigid = any(s.rigid for s in self.findings.base_simplifications)
                if not (simplification.needs_deformation and rigid):
                    self._try(simplification)
            self._choose_base(aspect)
        if self.findings.mesh * max(self._cells()) > 2:
            self._try(Simplification("half as many cells along an edge", Aspect.MESH, mesh=HALF_MESH))
        self._measure_window_error()
        self._measure_mesh_error()

    def _choose_base(self, aspect: Aspect) -> None:
        """Try what is left on the simplest mechanics and heat flow that are acceptable: trials are then cheap."""
        if aspect not in (Aspect.MECHANICS, Aspect.HEAT):
            return
        k = self.findings
        good = next((t for t in k.trials if t.simplification.aspect is aspect and t.acceptable), None)
        if good is not None:
            self.findings = replace(k, base_simplifications=(*k.base_simplifications, good.simplification),
                                    base=good.trial)

    def _try(self, simplification: Simplification) -> None:
        k, s = self.findings, simplification
        others = [] if s.aspect is Aspect.MECHANICS else edits_of(k.base_simplifications)
        trial = self._in_time(s.name, [*others, s.edit], s.windows, s.mesh)
        if trial is None or k.base is None:
            return
        against = k.reference if s.aspect is Aspect.SCHEME and not k.base_simplifications else k.base
        deviations = {} if trial.failed else compare(trial, against, k.goals)
        self.findings = replace(k, trials=(*k.trials, SimplificationTrial(s, trial, k.base, deviations)))

    def _measure_window_error(self) -> None:
        """Compare the windows of the trials with windows half as long, iterated where that can be."""
        k = self.findings
        if at(self._tree, ("coupling", "windows")) is None:
            return
        edits = edits_of(k.base_simplifications, iterated(self._tree) if k.iterated else None)
        long = self._in_time("windows as they are", edits)
        short = self._in_time(SHORT_WINDOWS, edits, windows=HALF_WINDOWS)
        if long and short and not long.failed and not short.failed:
            self.findings = replace(k, window_error=compare(long, short, k.goals))

    def _measure_mesh_error(self) -> None:
        """Compare the mesh of the trials with the scenario's own."""
        k = self.findings
        if k.mesh == 1.0:
            return
        coarse = cells_of(edited(self._tree, [meshed(self._tree, k.mesh)]))
        cost = k.windows * cells_of(self._tree) / coarse
        trial = self._in_time(OWN_MESH, edits_of(k.base_simplifications), 1 / k.windows, 1 / k.mesh, cost)
        if trial and k.base and not trial.failed:
            self.findings = replace(k, mesh_error=compare(k.base, trial, k.goals))

    def _combine(self) -> None:
        """Run all that is acceptable at once; put back what deviates most alone until it is within the tolerances."""
        rejected: list[Simplification] = []
        iterate = largest_ratio(self.findings.coupling_error) > 1.0
        while True:
            accepted = combination_of(self.findings, rejected)
            # A scheme that is accurate enough alone is not to be iterated.
            iterate_too = iterate and not any(s.aspect is Aspect.SCHEME for s in accepted)
            windows = next((s.windows for s in accepted if s.aspect is Aspect.WINDOWS), 1.0)
            mesh = next((s.mesh for s in accepted if s.aspect is Aspect.MESH), 1.0)
            edits = edits_of(accepted, iterated(self._tree) if iterate_too else None)
            trial = self._trial(COMBINATION, edits, windows, mesh)
            error = {} if trial.failed else compare(trial, self.findings.reference, self.findings.goals)
            self.findings = replace(self.findings, accepted=accepted, iterate=iterate_too, combined=trial,
                                    combined_error=error)
            if self.findings.combined_ratio <= 1.0 or not accepted:
                return
            tried = [t for t in self.findings.trials if t.simplification in accepted]
            rejected.append(max(tried, key=lambda t: t.ratio).simplification)

    def _in_time(self, name: str, edits: Sequence[Edit], windows: float = 1.0, mesh: float = 1.0,
                 cost: float = 1.0) -> TrialResult | None:
        """Run one trial; None where there is no time for it, which is noted.  cost : in those of the base."""
        k = self.findings
        done = [t for t in (k.full, k.iterated, *(s.trial for s in k.trials)) if t and not t.failed]
        # The first run on a machine compiles for minutes: the quickest start tells what another one takes.
        start = min((t.wall - t.processor for t in done), default=0.0)
        # Where others use the machine too, as much as they did until now.
        slow = median([t.seconds / t.processor for t in done if t.processor > 0.0] or [SHARED_MACHINE])
        need = start + (cost + RESERVE) * max(slow, SHARED_MACHINE) * (k.base.processor if k.base else 0.0)
        try:
            return self._trial(name, edits, windows, mesh, need)
        except LateError:
            self.findings = replace(self.findings, untried=(*self.findings.untried, name))
            return None

    def _trial(self, name: str, edits: Sequence[Edit], windows: float = 1.0, mesh: float = 1.0,
               need: float = 0.0) -> TrialResult:
        """Run one trial; windows, mesh : factors on those of the trials.  need [s] : as of TrialRunner.run."""
        k = self.findings
        # Pairs, ranges and bodies are those of the scenario as edited: an edit may take some out.
        tree = edited(self._tree, edits)
        own = [meshed(tree, k.mesh * mesh), timed(tree, k.windows * windows), contact_probes(tree)]
        return self._runner.run([*edits, *own], lambda: self._on_trial(name), need)

    def _cells(self) -> list[int]:
        """Return the cells along the longer edge of every body that can be coarsened; [0] where there is none."""
        cells = (at(body, ("mesh", "rectangle", "cells")) for body in self._tree["bodies"].values())
        return [max(n) for n in cells if n is not None] or [0]


# Finds the cheapest model within the tolerances: searches, reports, and writes the advised scenario.

FILE, TEXT, TRIALS = "advised.yaml", "advice.txt", "trials"

@dataclass(frozen=True)
class AdviceOptions:
    """Options of an advice.

    goals : PROBE=TOLERANCE each; none: every probe within 1 % of its range.  overrides : dotted key -> value.
    limit : wall time [s].  cells : most cells of a body in a trial.
    """

    goals: Sequence[str] = ()
    overrides: Mapping[str, Any] | None = None
    limit: float = 600.0
    cells: int = CELLS


@dataclass(frozen=True)
class Advice:
    """An advice.  lines : of its report.  file : the advised scenario, None where there is none."""

    lines: tuple[str, ...]
    file: Path | None
    findings: Findings

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it."""
        return "Ctrl-C" in self.findings.stopped


def advise(path: Path, folder: Path, options: AdviceOptions,
           on_trial: OnTrial = lambda name: lambda fraction: None) -> Advice:
    """Find the cheapest model of the scenario at `path`; trials, advice and advised scenario go into `folder`.

    on_trial : called with the name of every trial before it runs; returns what is called with the fraction done.
    Raises ScenarioError, CouplingError where the full model cannot be run, ResultsError.
    """
    if not 0.0 < options.limit < math.inf:
        raise ScenarioError("a time limit is a number of seconds greater than zero", key="--limit", value=options.limit)
    if options.cells < 1:
        raise ScenarioError("a body has one cell at least", key="--cells", value=options.cells)
    requests = [parse_goal(text) for text in options.goals]
    # Its errors name lines, so it is checked before anything is tried; names of probes too.
    scenario = load_scenario(path, options.overrides)
    # fault: a scenario without probes is run before it is refused -> pass | coupler/test_advise
    own_probes(scenario.probes)
    for request in requests:
        # fault: names of probes are looked at after the full model has run -> pass |
        #   coupler/test_advise::test_a_probe_that_is_not_there_is_told_before_anything_runs
        named(request.pattern, scenario.probes)
    document = with_overrides(read_document(path), options.overrides or {})
    make_folder(folder)
    runner = TrialRunner(document, folder / TRIALS, time.monotonic() + options.limit)
    findings = ModelSearch(runner, requests, on_trial, options.cells).run()
    file = None
    if findings.combined_ratio <= 1.0:
        edits = advised(document, findings)
        head = (f"Made by `slideline advise {path.name}`.", *summary(findings))
        file = write_whole(folder / FILE, text_of(document, edits, head, folder / FILE))
    lines = tuple(advice(findings, str(file) if file else ""))
    write_whole(folder / TEXT, "\n".join((*lines, "")))
    return Advice(lines, file, findings)


# Merged keys and anchors: an edit in one place would be one in several.
_SHARED = re.compile(r"<<\s*:|(?:^|[\s\[{,:])[&*][A-Za-z_]", re.MULTILINE)


def advised(document: Document, findings: Findings) -> list[Edit]:
    """Return the edits that make the advised scenario."""
    edits = edits_of(findings.accepted, iterated(document.tree) if findings.iterate else None)
    mesh, windows = findings.mesh_factor, findings.windows_factor
    tree = edited(document.tree, edits)
    # fault: advice: an advised mesh in the windows of the file -> return [*edits, meshed(tree, mesh), timed(tree, 1.0)]
    #   | coupler/test_advise
    return [*edits, meshed(tree, mesh), timed(tree, windows)]


def text_of(document: Document, edits: Sequence[Edit], head: Sequence[str], path: Path) -> str:
    """Return the text of the scenario file with edits, for `path`.  head : lines of a comment at its top.

    Comments stay where the file can be edited in place; with merged or shared parts it is written anew without them.
    """
    edits = [*edits, _moved(document, path.parent)]
    wanted = edited(document.tree, edits)
    yaml = layout()
    top = "".join(f"{part}\n" for line in head for part in wrap(
        line, WIDTH, initial_indent="# ", subsequent_indent="#     ", replace_whitespace=False))
    if not _SHARED.search(document.text):
        tree = yaml.load(document.text)
        _override(tree, document)
        text = top + "#\n" + dumped(edited(tree, edits), yaml)
        if with_plain_numbers(document_from(path, text)).tree == wanted:
            return text
    yaml.default_flow_style = None
    text = top + dumped(wanted, yaml)
    assert document_from(path, text).tree == wanted, "plain values survive being written"
    return text


def _override(tree: Any, document: Document) -> None:
    """Copy the values that overrides put into the plain tree to the commented one."""
    for key in sorted(document.overridden, key=len):
        # Where an override made a mapping on its way, the whole of that is put.
        n = next((n for n in range(1, len(key)) if at(tree, key[:n]) is None), len(key))
        holder, plain = at(tree, key[:n - 1]), at(document.tree, key[:n - 1])
        holder[key[n - 1]] = plain[key[n - 1]]
        for gone in [k for k in holder if isinstance(holder, dict) and k not in plain]:
            del holder[gone]


def _moved(document: Document, folder: Path) -> Edit:
    """Give mesh files their whole path where the new file is in another folder."""
    if folder.resolve() == document.path.parent.resolve():
        return Edit()
    files = {("bodies", name, "mesh", "file", "path"): body["mesh"]["file"]["path"]
             for name, body in document.tree["bodies"].items() if at(body, ("mesh", "file", "path")) is not None}
    return Edit({key: str((document.path.parent / path).resolve()) for key, path in files.items()})
