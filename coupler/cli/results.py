"""Verbs that read results and draw nothing: `status`, `trace`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from coupler.cli.options import JsonOption
from coupler.errors import ResultsError
from coupler.record.paths import write_whole
from coupler.record.results import Results
from coupler.record.trace import trace_text
from coupler.running.status import status


def status_command(results: Annotated[Path, typer.Argument(help="The results file of a run, finished or not.",
                                                           show_default=False)],
                   as_json: JsonOption = False) -> None:
    """Print the progress of a run, from another terminal, or how it ended."""
    found = status(results)
    typer.echo(json.dumps(found.as_dict()) if as_json else "\n".join(found.lines))


def trace_command(results: Annotated[Path, typer.Argument(help="The results file of a run.", show_default=False)],
                  out: Annotated[Path | None, typer.Option(
                      "--out", "-o", help="The trace, JSON; default: beside the results, run.trace.json.")] = None,
                  ) -> None:
    """Write a trace of a run: when each call ran; for ui.perfetto.dev or chrome://tracing.

    Windows and records of the coupler and the calls of both halves, over the seconds of the run.
    """
    run = Results(results)
    path = out if out is not None else results.with_suffix(".trace.json")
    if path.suffix != ".json":
        raise ResultsError(f"{path}: a trace is JSON; give a name that ends in .json with --out")
    typer.echo(f"trace: {write_whole(path, trace_text(run))}")
