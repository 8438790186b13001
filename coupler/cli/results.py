"""Verbs that read results and draw nothing: `status`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from coupler.cli.options import JsonOption
from coupler.running.status import status


def status_command(results: Annotated[Path, typer.Argument(help="The results file of a run, which may go on.",
                                                           show_default=False)],
                   as_json: JsonOption = False) -> None:
    """Tell how far a run is, from another terminal, or what became of it."""
    found = status(results)
    typer.echo(json.dumps(found.as_dict()) if as_json else "\n".join(found.lines))
