"""Finds the cheapest model within the tolerances: searches, reports, and writes the advised scenario."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

from coupler.errors import ScenarioError
from coupler.experiments.advice_search import ModelSearch, OnTrial, TrialRunner
from coupler.experiments.advice_text import advice, summary
from coupler.experiments.findings import Findings, edits_of
from coupler.experiments.goals import parse_goal
from coupler.experiments.variants import CELLS, Edit, at, edited, iterated, meshed, timed
from coupler.fmu.launch import make_folder
from coupler.running.safe_write import write_whole
from coupler.scenario.document import WIDTH, Document, document_from, dumped, layout, read_document
from coupler.scenario.edits import apply_overrides
from coupler.scenario.load import load_scenario

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
    load_scenario(path, options.overrides)  # its errors name lines, so it is checked before anything is tried
    document = apply_overrides(read_document(path), options.overrides or {})
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
        if document_from(path, text).tree == wanted:
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
