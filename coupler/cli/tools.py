"""`slideline list` and `slideline cache`: what is installed, and what was built."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from coupler.cli.options import JsonOption
from coupler.fmu.launch import CAP, cache_directory, cached_halves, clear_cache, drop_to, known_halves
from coupler.init.shipped import shipped_scenarios
from coupler.scenario.kinds import OWN, PROGRAMS, SHIPPED

ABOUT = {
    ("thermal", "thermal"): "heat conduction on the mesh, with radiation, convection, melting and sources",
    ("thermal", "lumped"): "one temperature a body, for bodies that are evenly warm",
    ("thermal", "rod"): "heat conduction along a row of cells",
    ("thermal", "replay"): "temperatures as an earlier run recorded them",
    ("mechanical", "elastic"): "stress and deformation on the mesh, with plasticity, creep, contact and friction",
    ("mechanical", "rigid"): "bodies that only move as prescribed",
    ("mechanical", "rod"): "one-dimensional bars that lengthen and are pressed together",
    ("mechanical", "replay"): "deformation as an earlier run recorded it",
    ("thermal", "ccx"): "heat conduction by the program CalculiX, one deck a step",
    ("mechanical", "ccx"): "elastic deformation by the program CalculiX, one deck a step",
}


def sentence_of(scenario: Path) -> str:
    """The first sentence of what a scenario says of itself: of its comment at the top."""
    lines = []
    for line in scenario.read_text(encoding="utf-8").splitlines():
        words = line.removeprefix("#").strip()
        if not line.startswith("#") or not words:
            break
        lines.append(words)
    text = " ".join(" ".join(lines).split())
    # A full stop ends a sentence where a capital follows: "1e-3 1/s." does, "20.5 mm" does not.
    return re.split(r"(?<=[.?!])\s+(?=[A-Z])", text)[0]


def listed() -> dict[str, list[dict[str, str]]]:
    """What `slideline list` tells: scenarios with their files, halves with their roles, a sentence each."""
    folder = shipped_scenarios()
    scenarios = [{"name": path.stem, "file": str(path), "about": sentence_of(path)}
                 for path in sorted(folder.glob("*.yaml"))]
    halves = [{"name": name, "role": role, "about": ABOUT[role, name]}
              for table in (OWN, PROGRAMS) for role, kinds in table.items() for name in kinds]
    halves += [{"name": name, "role": "either", "about": f"of the package {point.module.partition('.')[0]}"}
               for name, point in sorted(known_halves().items()) if name not in SHIPPED]
    return {"scenarios": scenarios, "halves": halves}


def list_command(as_json: JsonOption = False) -> None:
    """List the installed scenarios and halves, with a sentence each."""
    found = listed()
    if as_json:
        typer.echo(json.dumps(found, indent=1))
        return
    wide = max(len(row["name"]) for rows in found.values() for row in rows) + 2
    typer.echo(f"scenarios, in {shipped_scenarios()}:")
    for row in found["scenarios"]:
        typer.echo(f"  {row['name']:{wide}}{row['about']}")
    typer.echo("halves (--swap ROLE=NAME):")
    for row in found["halves"]:
        typer.echo(f"  {row['name']:{wide}}{row['role']}: {row['about']}")


def cache_command(clear: Annotated[bool, typer.Option("--clear", help="Remove all built halves.")] = False,
                  cap: Annotated[float | None, typer.Option(
                      "--cap", metavar="GB", min=0.0,
                      help="Remove the least recently used files, down to this size.")] = None,
                  as_json: JsonOption = False) -> None:
    """Print the size of the cache of built halves, or clear it; beyond 2 GB it drops those not used for a day."""
    folder = cache_directory()
    removed = clear_cache(folder) if clear else drop_to(folder, cap * 1e9) if cap is not None else 0
    places = cached_halves(folder)
    about: dict[str, Any] = {"folder": str(folder), "halves": len(places), "bytes": sum(size for _, _, size in places),
                             "cap_bytes": CAP, "removed": removed}
    if as_json:
        typer.echo(json.dumps(about, indent=1))
        return
    if removed:
        typer.echo(f"{removed} halves removed")
    typer.echo(f"{folder}: {about['halves']} halves, {about['bytes'] / 1e6:.1f} MB of at most {CAP / 1e9:g} GB")
