"""`slideline schema` and `slideline migrate`: the form of a scenario, for editors, and of older files."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from coupler.errors import ScenarioError
from coupler.running.safe_write import check_free, new_files
from coupler.scenario.json_schema import json_schema
from coupler.scenario.load import checked_form
from coupler.scenario.schema import VERSION
from coupler.scenario.versions import migrated, unsaid


def schema_command(out: Annotated[Path | None, typer.Option("--out", "-o", help="A new file for it.")] = None) -> None:
    """Write the JSON Schema of a scenario: editors complete and check its keys by it."""
    text = json.dumps(json_schema(), indent=1) + "\n"
    if out is None:
        typer.echo(text, nl=False)
        return
    check_free(out)
    with new_files({out: text}):
        typer.echo(f"{out}: the keys of a scenario of version {VERSION}.\n"
                   f"  In the first line of a scenario: # yaml-language-server: $schema={out}")


def migrate_command(scenario: Annotated[Path, typer.Argument(help="The scenario, a YAML file.", show_default=False)]
                    ) -> None:
    """Write a scenario of an older version as one of the newest, with the same numbers."""
    document, file = checked_form(scenario)
    if file.slideline == VERSION:
        typer.echo(f"{scenario} is of version {VERSION} already.")
        return
    said = unsaid(file)
    _replace(scenario, migrated(document.text, file))
    typer.echo(f"{scenario}: version {file.slideline} -> {VERSION}")
    for at, key, value in said:
        typer.echo(f"  {'.'.join(map(str, at))}: {key}: {value}, as version {file.slideline} had it")


def _replace(path: Path, text: str) -> None:
    """Write a file anew, whole or not at all.  Raises ScenarioError."""
    aside = path.with_name(f".{path.name}.new")
    try:
        aside.write_text(text, encoding="utf-8")
        os.replace(aside, path)
    except OSError as exc:
        aside.unlink(missing_ok=True)
        raise ScenarioError(f"the file cannot be written ({exc.strerror})", file=str(path)) from exc
