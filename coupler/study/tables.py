"""What a study leaves as data: study.json, study.csv, and the cheapest settings as scenario files."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from coupler.errors import ResultsError
from coupler.record.beside import part_of
from coupler.scenario.document import Document
from coupler.scenario.override import apply_overrides
from coupler.scenario.writing import dumped, layout
from coupler.study.plan import Planned
from coupler.study.score import LEVELS, Point, cheapest

FORMAT, VERSION = "slideline.study", 1


def percent(level: float) -> str:
    """1 %, .1 %, .01 %."""
    return f"{100 * level:g} %".removeprefix("0")


def put(path: Path, text: str) -> Path:
    """Write a text whole or not at all.  Raises ResultsError."""
    try:
        part_of(path).write_text(text, encoding="utf-8")
        os.replace(part_of(path), path)
    except OSError as exc:
        raise ResultsError(f"{path}: cannot be written ({exc.strerror})") from exc
    return path


def rows(runs: Sequence[Planned], points: Sequence[Point]) -> list[dict[str, Any]]:
    """One mapping a run; numbers that are not known are None."""
    return [{"label": p.label, **{f"at.{axis}": value for axis, value in run.cell.at.items()},
             "half_solves": p.half_solves, "seconds": _known(p.seconds), "error": _known(p.error),
             "floor": _known(p.floor), "below_floor": p.below, "message": p.message, "run": run.key,
             **{f"error.{n}": _known(e) for n, e in (p.by_probe or {}).items()}}
            for run, p in zip(runs, points, strict=True)]


def as_json(facts: Mapping[str, Any], runs: Sequence[Planned], points: Sequence[Point]) -> str:
    """All of a study as JSON; `facts` stand beside the runs."""
    best = {percent(level): (p.label if (p := cheapest(points, level)) else None) for level in LEVELS}
    whole = {"format": FORMAT, "version": VERSION, **facts, "cheapest": best, "runs": rows(runs, points)}
    return json.dumps(whole, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def as_csv(runs: Sequence[Planned], points: Sequence[Point]) -> str:
    """The runs as a table; columns of all runs, empty where a run has none."""
    table = rows(runs, points)
    file = io.StringIO()
    writer = csv.DictWriter(file, list(dict.fromkeys(name for row in table for name in row)), lineterminator="\n")
    writer.writeheader()
    for row in table:
        writer.writerow({n: json.dumps(v) if isinstance(v, dict | list) else v for n, v in row.items()})
    return file.getvalue()


def setting(document: Document, run: Planned, point: Point, level: float) -> str:
    """A scenario file of one run, complete but for the study itself."""
    # fault: the cheapest setting without what makes it so -> tree = dict(document.tree) | coupler/test_study_run
    tree = dict(apply_overrides(document, run.job.overrides).tree)
    tree.pop("study", None)
    for body in tree["bodies"].values():
        if file := body.get("mesh", {}).get("file"):
            file["path"] = str((document.path.parent / file["path"]).resolve())
    yaml = layout()
    yaml.default_flow_style = None
    return (f"# {document.path.name}, {point.label}: the cheapest run of a study with an error of at most "
            f"{percent(level)}.\n# Its error is {100 * point.known:.2g} %, it costs {point.half_solves} half-solves.\n"
            f"{dumped(tree, yaml)}")


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
