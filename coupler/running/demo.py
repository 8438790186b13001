"""Runs the demo: a first look at what Slideline does, in seconds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
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
    """Return the folder of scenarios: beside the packages in a checkout, inside this one when installed.

    Raises ScenarioError where there is none.
    """
    here = Path(__file__).resolve().parent.parent
    for folder in (here / "scenarios", here.parent / "scenarios"):
        if (folder / SCENARIO).is_file():
            return folder
    raise ScenarioError("the scenarios that belong to this installation are missing", file=str(here / "scenarios"),
                        remedy="Install slideline again, or give `slideline run` a scenario of your own")


@dataclass(frozen=True)
class Demo:
    """The files of a demo.  scenario : the copy that was run."""

    scenario: Path
    results: Results
    page: Path


def run_demo(folder: Path, on_start: Callable[[Scenario], AbstractContextManager[Callable[[Progress], Any]]],
             ) -> Demo:
    """Copy the sliding blocks to a folder, run them coarse with the rigid half, write the report.

    on_start : called before the run; its context gives what is called after every window.
    Raises ScenarioError where the folder cannot be made, or holds another scenario of this name.
    """
    make_folder(folder)
    copy, text = folder / SCENARIO, (shipped_scenarios() / SCENARIO).read_bytes()
    if copy.exists() and copy.read_bytes() != text:
        raise ScenarioError("another scenario of this name is in this folder already; nothing was written",
                            file=str(copy), remedy="Give the demo another folder: slideline demo FOLDER")
    if not copy.exists():
        copy.write_bytes(text)
    scenario = load_scenario(copy, overrides=OVERRIDES)
    with on_start(scenario) as progress:
        results = run(scenario, folder / "run.h5", on_window=progress)
    return Demo(copy, results, write_report(results, folder / "run.html"))
