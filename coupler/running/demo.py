"""The demo: a first look at what Slideline does, in seconds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from coupler.errors import ScenarioError
from coupler.fmu.launch import make_folder
from coupler.record.results import Results
from coupler.report import write_report
from coupler.running.progress import Progress
from coupler.running.run import run
from coupler.scenario import Scenario, load_scenario

SCENARIO = "sliding_blocks.yaml"
# Coarse and rigid: the probes stay within 3 K of the full scene's, in about a third of its time.
OVERRIDES = {"mechanical.half": "rigid", "bodies.lower.mesh.rectangle.cells": [12, 12],
             "bodies.upper.mesh.rectangle.cells": [12, 12]}


def shipped_scenarios() -> Path:
    """The folder of scenarios: beside the packages in a checkout, inside this one when installed."""
    here = Path(__file__).resolve().parent.parent
    for folder in (here / "scenarios", here.parent / "scenarios"):
        if (folder / SCENARIO).is_file():
            return folder
    raise ScenarioError("the scenarios that belong to this installation are missing", file=str(here / "scenarios"),
                        remedy="Install slideline again, or give `slideline run` a scenario of your own")


def run_demo(folder: Path, on_start: Callable[[Scenario], AbstractContextManager[Callable[[Progress], Any]]],
             ) -> tuple[Path, Results, Path]:
    """Copy the sliding blocks to a folder, run them coarse with the rigid half, write the report.

    Returns the scenario, the results, the page.  Raises ScenarioError where the folder will not do.
    """
    make_folder(folder)
    copy, text = folder / SCENARIO, (shipped_scenarios() / SCENARIO).read_bytes()
    if copy.exists() and copy.read_bytes() != text:
        raise ScenarioError("a scenario of this name that was changed is there already; it is left as it is",
                            file=str(copy), remedy="Give the demo another folder: slideline demo FOLDER")
    if not copy.exists():
        copy.write_bytes(text)
    scenario = load_scenario(copy, overrides=OVERRIDES)
    with on_start(scenario) as progress:
        results = run(scenario, folder / "run.h5", on_window=progress)
    return copy, results, write_report(results, folder / "run.html")
