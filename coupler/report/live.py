"""The live part of a page: its script, its numbers, and the policy that lets no other script run."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from coupler.errors import ResultsError
from coupler.record.results import Results
from coupler.report.curves import kinks_of
from coupler.report.pack import Chart, Pack, json_text
from coupler.report.player import line_data, player_data

# In the order in which they build on each other.
SCRIPTS = ("data", "clock", "plot", "raster", "picture", "player", "page")


@dataclass(frozen=True)
class LivePage:
    """meta : JSON.  numbers : base64 of zlib.  script, policy : what runs, and what the browser is told to let run.

    lines : numbers of the contact lines.  player : whether there is something to play.  remarks : what cannot be shown.
    """

    meta: str
    numbers: str
    script: str
    policy: str
    lines: int
    player: bool
    remarks: tuple[str, ...]


@cache
def script() -> str:
    """Return the whole script of a page: the files of `live`, one after the other, in one function."""
    folder = resources.files(__package__).joinpath("live")
    text = "\n".join(folder.joinpath(f"{name}.js").read_text("utf-8") for name in SCRIPTS)
    return f'\n"use strict";\n(() => {{\n{text}}})();\n'


def policy() -> str:
    """The content security policy of a page: this script and no other, pictures inside the page, nothing loaded."""
    digest = base64.b64encode(hashlib.sha256(script().encode()).digest()).decode()
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"


def live_page(results: Results, charts: Sequence[Chart]) -> LivePage:
    """Gather what the script shows of a run.  charts : in the order in which the page has them."""
    pack, remarks = Pack(), []
    meta: dict[str, Any] = {
        "span": [float(results.t[0]), float(results.t[-1])] if len(results.t) else [0.0, 1.0],
        "marks": kinks_of(results), "charts": [chart.packed(pack) for chart in charts], "lines": []}
    times: list[float] = []
    if len(results.t) > 1:
        meta["extremes_t"] = pack.put(results.t)
        try:
            meta |= player_data(results, pack)
        except ResultsError as exc:
            remarks.append(f"The fields cannot be played: {exc}")
        if "frames" in meta:
            times = [float(t) for t in np.unique(meta["frames"].pop("times"))]
        try:
            meta["lines"] = line_data(results, pack, times)
        except ResultsError as exc:
            remarks.append(f"Contact cannot be shown at the time of the cursor: {exc}")
    return LivePage(json_text(meta), pack.text, script(), policy(), len(meta["lines"]), "frames" in meta,
                    tuple(remarks))
