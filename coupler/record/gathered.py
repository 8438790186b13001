"""What the records of a journal come to: rows of windows that stand, without those that were rewound."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.record.columns import WINDOW_FIELDS

KILLED = {"outcome": "killed", "message": "the run was killed; this is all it had written"}
# What was spent on windows that were rewound is not forgotten with them.
SPENT = ("solves", "thermal_solves", "mechanical_solves", "thermal_seconds", "mechanical_seconds", "fmi_seconds",
         "recording_seconds", "seconds")

Record = tuple[str, dict[str, Any], dict[str, NDArray[Any]]]


@dataclass
class Gathered:
    """rows : of WINDOW_FIELDS.  words : of each row what there is of message, reason, event and fired.

    t [s], probes, terms (the ledger so far), monitors, contact (as `contact_row` gives it) : at the start and the ends
    of the windows taken.
    frames : numbers of the frames to be kept, from 0.  rewound : windows and what was spent on them.
    max_T : [K] at the start.
    """

    rows: list[tuple[Any, ...]] = field(default_factory=list)
    words: list[dict[str, Any]] = field(default_factory=list)
    iterates: list[tuple[Any, ...]] = field(default_factory=list)
    estimates: list[tuple[Any, ...]] = field(default_factory=list)
    errors: list[tuple[Any, ...]] = field(default_factory=list)
    max_T: float | None = None
    t: list[float] = field(default_factory=list)
    probes: list[NDArray[Any]] = field(default_factory=list)
    terms: list[Mapping[str, float]] = field(default_factory=list)
    monitors: list[Mapping[str, float]] = field(default_factory=list)
    contact: list[Mapping[str, NDArray[Any]]] = field(default_factory=list)
    frames: dict[int, float] = field(default_factory=dict)
    rewound: dict[str, float] = field(default_factory=dict)
    end: Mapping[str, Any] = field(default_factory=lambda: KILLED)


def gathered(records: Iterable[Record]) -> Gathered:
    """What the records after the header tell."""
    told, frames = Gathered(), 0
    for kind, m, a in records:
        if kind == "start":
            told.max_T = m.get("max_T")
        if kind == "frame":
            told.frames[frames] = float(m["t_now"])
            frames += 1
        elif kind == "window":
            _window(told, m)
        elif kind == "rewind":
            _rewind(told, float(m["t_now"]), int(m["rows"]))
        elif kind == "end":
            told.end = m
        if kind in ("start", "window") and "probes" in a:
            told.t.append(float(m["t_now"]))
            told.probes.append(a["probes"])
            told.terms.append(dict(m["terms"]))
            told.monitors.append(dict(m.get("monitors", {})))
            told.contact.append({n.removeprefix("contact."): v for n, v in a.items() if n.startswith("contact.")})
    return told


def _window(told: Gathered, m: Mapping[str, Any]) -> None:
    number = len(told.rows)
    told.words.append({n: m[n] for n in ("message", "reason", "event", "fired") if m.get(n)})
    told.iterates += [(number, *row) for row in m.get("iterates", ())]
    if m.get("estimate"):
        told.estimates.append((number, *m["estimate"]))
    if m.get("errors"):
        told.errors.append((number, *m["errors"]))
    told.rows.append(tuple(m[n].encode() if k.startswith("S") else m[n] for n, k in WINDOW_FIELDS))


def _rewind(told: Gathered, t: float, rows: int) -> None:
    """Back to the time t [s], at which so many rows stood."""
    names = [n for n, _ in WINDOW_FIELDS]
    gone = told.rows[rows:]
    told.rewound["windows"] = told.rewound.get("windows", 0) + sum(row[names.index("taken")] for row in gone)
    for name in SPENT:
        told.rewound[name] = told.rewound.get(name, 0) + sum(row[names.index(name)] for row in gone)
    # fault: windows that were rewound stay in the table -> del told.words[rows:] | coupler/test_interactive
    del told.rows[rows:], told.words[rows:]
    told.iterates = [row for row in told.iterates if row[0] < rows]
    told.estimates = [row for row in told.estimates if row[0] < rows]
    told.errors = [row for row in told.errors if row[0] < rows]
    kept = int(np.searchsorted(told.t, t, side="right"))
    for history in (told.t, told.probes, told.terms, told.monitors, told.contact):
        del history[kept:]
    told.frames = {k: at for k, at in told.frames.items() if at <= t}
