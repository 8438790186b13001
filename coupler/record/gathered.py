"""What the records of a journal come to: rows of windows that stand, without those that were rewound."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.record.frames import thinned
from coupler.record.journal import JournalRecord
from coupler.record.tables import TIMING, WINDOW_FIELDS

KILLED = {"outcome": "killed", "message": "the run was killed; this is all it had written"}
# What was spent on windows that were rewound is not forgotten with them.
SPENT = ("solves", "thermal_solves", "mechanical_solves", "thermal_seconds", "mechanical_seconds", "fmi_seconds",
         "recording_seconds", "seconds")


@dataclass
class Gathered:
    """rows : of WINDOW_FIELDS.  words : of each row what there is of message, reason, event and fired.

    t [s], probes, conditions, ranges, terms (the ledger so far), monitors, contact (as `contact_row` gives it) : at the
    start and the ends of the windows taken.
    frames : numbers of the frames to be kept, from 0.  chosen : of those that were chosen for change.
    thinnings : when [s] every second of these went, and the frames before that: a rewind brings them back.
    rewound : windows and what was spent on them.
    timings, calls : row -> where its time went (coupler.fmu.metered.Timing), where that was told.
    max_T : [K] at the start.  memory : what another run may start from at the end (contact.half.memory).
    """

    rows: list[tuple[Any, ...]] = field(default_factory=list)
    words: list[dict[str, Any]] = field(default_factory=list)
    iterates: list[tuple[Any, ...]] = field(default_factory=list)
    estimates: list[tuple[Any, ...]] = field(default_factory=list)
    errors: list[tuple[Any, ...]] = field(default_factory=list)
    timings: dict[int, NDArray[Any]] = field(default_factory=dict)
    calls: dict[int, NDArray[Any]] = field(default_factory=dict)
    max_T: float | None = None
    t: list[float] = field(default_factory=list)
    probes: list[NDArray[Any]] = field(default_factory=list)
    conditions: list[NDArray[Any]] = field(default_factory=list)
    ranges: list[NDArray[Any]] = field(default_factory=list)
    terms: list[Mapping[str, float]] = field(default_factory=list)
    monitors: list[Mapping[str, float]] = field(default_factory=list)
    contact: list[Mapping[str, NDArray[Any]]] = field(default_factory=list)
    frames: dict[int, float] = field(default_factory=dict)
    chosen: list[int] = field(default_factory=list)
    thinnings: list[tuple[float, dict[int, float]]] = field(default_factory=list)
    rewound: dict[str, float] = field(default_factory=dict)
    end: Mapping[str, Any] = field(default_factory=lambda: KILLED)
    memory: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def gathered(records: Iterable[JournalRecord]) -> Gathered:
    """What the records after the header tell."""
    told, frames = Gathered(), 0
    for record in records:
        kind, m, a = record.kind, record.meta, record.arrays
        if f"{TIMING}.row" in a:
            row = int(a[f"{TIMING}.row"])
            told.timings[row], told.calls[row] = a[f"{TIMING}.parts"], a[f"{TIMING}.calls"]
        if kind == "start":
            told.max_T = m.get("max_T")
        if kind == "frame":
            told.frames[frames] = float(m["t_now"])
            told.chosen += [frames] if m.get("chosen") else []
            frames += 1
        elif kind == "thin":
            told.thinnings.append((told.t[-1] if told.t else -math.inf, told.frames))
            told.frames = thinned(told.frames, told.chosen)
        elif kind == "window":
            _window(told, m)
        elif kind == "rewind":
            _rewind(told, float(m["t_now"]), int(m["rows"]))
        elif kind == "end":
            told.end, told.memory = m, {n: v for n, v in a.items() if not n.startswith(f"{TIMING}.")}
        if kind in ("start", "window") and "probes" in a:
            told.t.append(float(m["t_now"]))
            told.probes.append(a["probes"])
            told.conditions.append(a.get("conditions", np.empty(0)))
            told.ranges.append(a.get("ranges", np.empty((0, 2))))
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
    # fault: the times of windows that were rewound stay -> pass |
    #   coupler/test_timings::test_windows_that_were_rewound_leave_no_times
    told.timings, told.calls = ({k: v for k, v in of.items() if k < rows} for of in (told.timings, told.calls))
    told.iterates = [row for row in told.iterates if row[0] < rows]
    told.estimates = [row for row in told.estimates if row[0] < rows]
    told.errors = [row for row in told.errors if row[0] < rows]
    kept = int(np.searchsorted(told.t, t, side="right"))
    # fault: extremes of windows that were rewound stay -> for history in (told.t, told.probes, told.conditions,
    #   told.terms, told.monitors, told.contact): | coupler/test_extremes
    for history in (told.t, told.probes, told.conditions, told.ranges, told.terms, told.monitors, told.contact):
        del history[kept:]
    # fault: a thinning of frames outlives the windows that made it -> while False: | coupler/test_frames
    while told.thinnings and told.thinnings[-1][0] > t:
        told.frames = told.thinnings.pop()[1]
    told.frames = {k: at for k, at in told.frames.items() if at <= t}
