"""The verb `advise`: climb, say what was found, write the cheapest scenario that stays inside the tolerances."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupler.errors import ScenarioError
from coupler.experiments.advice_search import Climb, Known, Trials, parse_goal
from coupler.experiments.advice_text import advice, advised, summary, text_of, write
from coupler.experiments.variants import CELLS
from coupler.fmu.launch import make_folder
from coupler.scenario.document import read_document
from coupler.scenario.edits import apply_overrides
from coupler.scenario.load import load_scenario

FILE, TEXT, TRIALS = "advised.yaml", "advice.txt", "trials"

Tell = Callable[[str], Callable[[float], object]]


@dataclass(frozen=True)
class Options:
    """asked : PROBE=TOLERANCE each; none: every probe within 1 % of its range.  overrides : dotted key -> value.

    limit : wall time [s].  cells : most cells of a body in a trial.
    """

    asked: Sequence[str] = ()
    overrides: Mapping[str, Any] | None = None
    limit: float = 600.0
    cells: int = CELLS


@dataclass(frozen=True)
class Advice:
    """lines : what to tell.  file : the advised scenario, None where none was found.  known : all of it."""

    lines: tuple[str, ...]
    file: Path | None
    known: Known

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it."""
        return "Ctrl-C" in self.known.stopped


def advise(path: Path, folder: Path, options: Options, tell: Tell = lambda name: lambda share: None) -> Advice:
    """Advise on the scenario at `path`; `folder` keeps trials, the advice and the advised scenario.

    tell : told the name of every trial before it runs, gives what is told the share that is done.
    Raises ScenarioError, CouplingError where the scene itself cannot be run, ResultsError.
    """
    if not 0.0 < options.limit < math.inf:
        raise ScenarioError("a time limit is a number of seconds greater than zero", key="--limit", value=options.limit)
    if options.cells < 1:
        raise ScenarioError("a body has one cell at least", key="--cells", value=options.cells)
    asked = [parse_goal(text) for text in options.asked]
    load_scenario(path, options.overrides)  # told with its lines, before anything is tried
    document = apply_overrides(read_document(path), options.overrides or {})
    make_folder(folder)
    trials = Trials(document, folder / TRIALS, time.monotonic() + options.limit)
    known = Climb(trials, asked, tell, options.cells).run()
    file = None
    if known.final_share <= 1.0:
        edits = advised(document, known)
        head = (f"Made by `slideline advise {path.name}`.", *summary(known))
        file = write(folder / FILE, text_of(document, edits, head, folder / FILE))
    lines = tuple(advice(known, str(file) if file else ""))
    write(folder / TEXT, "\n".join((*lines, "")))
    return Advice(lines, file, known)
