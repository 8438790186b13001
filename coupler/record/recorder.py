"""The recorder: what a run writes to its journal while it runs."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.control.error_estimate import Estimate
from coupler.fmu.metered import Timing
from coupler.record.finish import finish
from coupler.record.journal import Journal, Mark
from coupler.record.observe import contact_field
from coupler.record.paths import check_target, drop, journal_of, take_up
from coupler.record.tables import (
    ERROR_QUANTITIES,
    ITERATE_FIELDS,
    TIMING,
    WINDOW_FIELDS,
    contact_lines,
    contact_row,
)
from coupler.rules.engine import Firing
from coupler.schemes.ledger import Ledger
from coupler.schemes.levels import Level
from coupler.schemes.state import IterationHistory, Solved

Array = NDArray[np.float64]
NONE: Array = np.empty(0)
NO_RANGES: Array = np.empty((0, 2))


@dataclass(frozen=True)
class WindowRecord:
    """What a window's record holds besides its outcome.

    reason : why it had its size and scheme.  event, fired, error : as in Tried.
    monitors : those that rules look at, of a window that was taken.  friction : at its end, as in `contact_row`.
    conditions : (k,) heats and forces of conditions at its end, as ConditionReader has them.
    ranges : (m, 2) least and largest value of fields at its end, as ExtraOutputs has them; (0, 2): not recorded.
    """

    reason: str = ""
    event: str = ""
    fired: tuple[Firing, ...] = ()
    error: Estimate | None = None
    monitors: Mapping[str, float] = field(default_factory=dict)
    friction: Mapping[str, Array] = field(default_factory=dict)
    conditions: Array = field(default_factory=lambda: NONE)
    ranges: Array = field(default_factory=lambda: NO_RANGES)


class Recorder:
    """Writes the header, each window, frames of fields and the end; finish() makes run.h5 of it.

    header : what is known before the first window (scenario, versions, probes, fields); see checkpoint.header_of.
    since : go on with the journal of a run that ended early, behind this place, under the header it has.
    Raises ResultsError if `out` may not or cannot be written.
    """

    def __init__(self, out: Path, header: Mapping[str, Any], interface: Interface,
                 since: Mark | None = None) -> None:
        check_target(out)
        self.out = out
        self._interface = interface
        self._lines = contact_lines(interface)
        self._seconds = 0.0
        self._timed: dict[str, NDArray[Any]] = {}  # of the row before, which its own record could not hold
        self.rows = 0  # windows recorded so far that stand in the table, rejected ones too
        if since is not None:
            take_up(out)
            self._journal = Journal(journal_of(out), since)
            return
        self._journal = Journal(journal_of(out))
        drop(out)
        self._journal.write("run", header, {
            **{n: getattr(interface, n) for n in ("nodes", "quads", "triangles", "quad_body", "triangle_body",
                                                  "contact_nodes", "pair_nodes")},
            **{f"surface.{n}": edges for n, edges in interface.surfaces.items()},
            **{f"{n}.{line.pair}": getattr(line, n) for line in self._lines for n in ("s", "X")}})

    @property
    def mark(self) -> Mark:
        """Where the next record goes."""
        return self._journal.mark

    def sync(self) -> None:
        """Wait until all records are on the disk.  Raises OSError."""
        self._journal.sync()

    def start(self, now: Level, probes: Array, friction: Mapping[str, Array] = MappingProxyType({}),
              conditions: Array = NONE, ranges: Array = NO_RANGES) -> None:
        """Write the values before the first window.

        probes : (n_probes,) in SI.  friction : (n_q,) each of t_T [Pa] and slip_share [1], those that are told.
        conditions : (k,) as ConditionReader has them.  ranges : (m, 2) as ExtraOutputs has them.
        """
        self._journal.write("start", {"t_now": now.t, "terms": {}, "max_T": float(now.T.max())},
                            {"probes": probes, "conditions": conditions, "ranges": ranges,
                             **contact_row(self._lines, now, friction)})

    def window(self, solved: Solved, facts: Mapping[str, float | str], ledger: Ledger, probes: Array,
               record: WindowRecord = WindowRecord()) -> None:
        """Write one window tried.  facts : t, H, scheme and seconds of it.

        probes : (n_probes,) in SI at its end, recorded where it was taken.
        Its recording_seconds are those spent on records since the row before it: a row cannot hold its own.
        """
        started = time.perf_counter()
        self.rows += 1
        w = solved.work
        row = {"verdict": solved.verdict.value, "solves": w.thermal_solves + w.mechanical_solves, **vars(w),
               **{n: solved.monitors.get(n, 0.0) for n in ("touching", "max_T", "max_p")},
               "taken": solved.taken, **iterated(solved.history), "imbalance": ledger.imbalance,
               "error": math.nan if record.error is None else record.error.error,
               "recording_seconds": self._seconds, **facts}
        meta = {n: row[n] for n, _ in WINDOW_FIELDS} | {"message": solved.message, **_values_of(record)}
        if solved.history is not None:
            meta["iterates"] = iterates(solved.history)
        accepted = solved.taken
        if accepted:
            meta |= {"t_now": solved.state.now.t, "terms": ledger.terms}
        arrays: dict[str, NDArray[Any]] = {}
        if accepted:
            arrays = {"probes": probes, "conditions": record.conditions, "ranges": record.ranges,
                      **contact_row(self._lines, solved.state.now, record.friction)}
        self._journal.write("window", meta, arrays | self._timed)
        self._timed = {}
        self._seconds = time.perf_counter() - started

    def timed(self, timing: Timing) -> None:
        """Keep where the time of the last row's window went, for the next record."""
        self._timed = {f"{TIMING}.row": np.array(self.rows - 1), f"{TIMING}.parts": timing.parts,
                       f"{TIMING}.calls": timing.calls}

    def rewind(self, t: float, rows: int) -> None:
        """What was recorded after the time t [s], where so many rows stood, is no longer so; the journal keeps it."""
        self._journal.write("rewind", {"t_now": t, "rows": rows})
        # fault: the time of a window that was rewound is told of another -> pass |
        #   coupler/test_timings::test_windows_that_were_rewound_leave_no_times
        self._timed = {} if rows < self.rows else self._timed
        self.rows = rows

    def thin(self) -> None:
        """Every second frame that was chosen for change so far goes, once the results file is made."""
        self._journal.write("thin", {})

    def frame(self, level: Level, more: Mapping[str, Array], chosen: bool = False) -> None:
        """Write the fields of both halves at one time.

        chosen : for change, within a budget (coupler.record.frames); else it stays in any case.
        more : shape and unit of its output each, HALF/LABEL -> what else they give out, as ExtraOutputs.read has it.
        """
        started = time.perf_counter()
        every = np.arange(len(level.t_N))
        p, gap = (contact_field(name, level, every, self._interface) for name in ("p", "gap"))
        p[np.isnan(p)] = 0.0
        self._journal.write("frame", {"t_now": level.t, "chosen": chosen}, {
            "T": level.T, "x": level.x, "u": level.x - self._interface.nodes, "p": p, "gap": gap,
            "contact.t_N": level.t_N, "contact.gap": level.gap, **more})
        self._seconds += time.perf_counter() - started

    def end(self, outcome: str, message: str, totals: Mapping[str, Any], t: float = 0.0,
            memory: Mapping[str, Array] = MappingProxyType({})) -> None:
        """Write what became of the run, make run.h5 of the journal and close it.

        t : the time it reached [s].  memory : what another run may start from then (contact.half.memory).
        """
        meta = {"outcome": outcome, "message": message, "totals": dict(totals), "t_now": t}
        self._journal.write("end", meta, dict(memory) | self._timed)
        if sys.platform == "win32":  # no lock there, and no open file can be moved away
            self._journal.close()
        # Locked until the results file stands: whoever finds the journal unlocked takes its run for killed and makes
        # the file himself, in the same folder.
        # fault: the journal is free before its results file stands -> if self._journal.close() is None: |
        #   coupler/test_watch
        with self._journal:
            finish(self._journal.path, self.out)


def _values_of(record: WindowRecord) -> dict[str, Any]:
    """What there is of them, as it goes into the journal."""
    values: dict[str, Any] = {"reason": record.reason, "event": record.event, "monitors": dict(record.monitors),
                            "fired": [[f.rule, f.text, dict(f.values)] for f in record.fired]}
    if record.error is not None:
        values["estimate"] = estimated(record.error)
        values["errors"] = [_or_nan(record.error.largest(record.error.errors, n)) for n in ERROR_QUANTITIES]
    return {n: v for n, v in values.items() if v}


def estimated(error: Estimate) -> list[float]:
    """A row as in ESTIMATE_FIELDS from the first quantity on; nan for what is not known."""
    parts = {"": error.shares, "_splitting": error.splitting, "_own": error.own}
    return [_or_nan(error.largest(parts[part], quantity)) for quantity in ERROR_QUANTITIES for part in parts]


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def iterated(history: IterationHistory | None) -> dict[str, float | int]:
    """What a window's row says of its iteration; 0 iterations for a scheme that does not iterate."""
    if history is None:
        return {"iterations": 0, "misfit": 0.0, "contraction": math.nan}
    return {"iterations": len(history.misfits), "misfit": max(history.misfits[-1].values()),
            "contraction": history.contraction}


def iterates(history: IterationHistory) -> list[list[float]]:
    """A row an iterate, as in ITERATE_FIELDS from "iterate" on; nan for what the scene does not have.

    The factor of an iterate is that of the step which led to it.
    """
    names = [n for n, _ in ITERATE_FIELDS[2:-1]]
    return [[k + 1, *(m.get(n, math.nan) for n in names), factor]
            for k, (m, factor) in enumerate(zip(history.misfits, (math.nan, *history.factors), strict=True))]
