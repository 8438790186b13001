"""Results of a run: run.h5, made from the run's journal, and what Python users read from it."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from coupler.beside import journal_of, put_away
from coupler.errors import ResultsError
from coupler.fields import write_field_files
from coupler.journal import being_written, read_journal
from coupler.ledger import PREFIX, imbalance

FORMAT, FORMAT_VERSION = "slideline.run", 2
Array = NDArray[np.float64]

WINDOW_FIELDS: tuple[tuple[str, str], ...] = (
    ("t", "f8"), ("H", "f8"), ("verdict", "S24"), ("scheme", "S16"), ("solves", "i4"),
    ("thermal_solves", "i4"), ("mechanical_solves", "i4"), ("thermal_iterations", "i4"),
    ("mechanical_iterations", "i4"), ("thermal_seconds", "f8"), ("mechanical_seconds", "f8"),
    ("fmi_seconds", "f8"), ("seconds", "f8"), ("recording_seconds", "f8"), ("values", "i8"),
    ("touching", "i4"), ("max_T", "f8"), ("max_p", "f8"), ("imbalance", "f8"), ("taken", "?"),
    ("iterations", "i4"), ("misfit", "f8"), ("contraction", "f8"),
)
"""Columns of the windows table, one row a window tried, rejected too; times [s], max_T [K], max_p [Pa].

taken : the run went on from its end.  iterations : of the window, 0 where the scheme does not iterate; misfit : the
largest difference left, in tolerances; contraction : measured ratio of successive residuals of plain iteration.
"""

ITERATE_FIELDS: tuple[tuple[str, str], ...] = (
    ("window", "i4"), ("iterate", "i4"), ("temperature", "f8"), ("gap", "f8"), ("pressure", "f8"),
    ("solid_fraction", "f8"), ("factor", "f8"),
)
"""Columns of the iterates table, one row an iterate: row of the windows table (from 0), number in the window (from
1), differences in units of their tolerances, factor of the step that led to it."""

HDF5_ROOM = 500_000  # bytes that results files take beyond what they hold

UNITS = {"K": (1.0, 0.0), "degC": (1.0, -273.15), "m": (1.0, 0.0), "mm": (1e3, 0.0), "um": (1e6, 0.0),
         "Pa": (1.0, 0.0), "kPa": (1e-3, 0.0), "MPa": (1e-6, 0.0)}
_KIND_OF_UNIT = {"K": "K", "degC": "K", "m": "m", "mm": "m", "um": "m", "Pa": "Pa", "kPa": "Pa", "MPa": "Pa"}


class Results:
    """What a run left in its results file.

    >>> t, T = Results("run.h5").probe("lower.top.left", unit="degC")

    path : the run.h5, or one whose run was killed: it is then made from the journal found beside it.
    outcome : completed | interrupted | stopped | failed | killed, with its message.
    header, totals : what the run wrote before its first window and after its last one.
    t : (n,) [s], the start and the ends of the accepted windows.
    windows : one row a window tried (WINDOW_FIELDS); messages : row number -> why it was rejected.
    iterates : one row an iterate of a scheme that iterates (ITERATE_FIELDS), else none.
    later : the journal of a later, unfinished run to the same file, if there is one.
    Raises ResultsError if the file is missing, unreadable or not one of ours, or its run still goes on.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        journal = journal_of(self.path)
        if not self.path.exists() and journal.exists():
            _recover(journal, self.path)
        self.later: Path | None = journal if journal.exists() else None
        if not self.path.exists():
            raise ResultsError(f"{self.path}: no such results file, and no journal of a run beside it")
        try:
            with h5py.File(self.path, "r") as f:
                self._read(f)
        except (OSError, KeyError, ValueError) as exc:
            raise ResultsError(f"{self.path}: not a readable results file ({_reason(exc)})") from exc

    def _read(self, f: h5py.File) -> None:
        if f.attrs.get("format") != FORMAT or f.attrs.get("version") != FORMAT_VERSION:
            raise ValueError(f"its format is not {FORMAT} {FORMAT_VERSION}")
        self.outcome: str = str(f.attrs["outcome"])
        self.message: str = str(f.attrs["message"])
        self.header: dict[str, Any] = json.loads(f.attrs["header"])
        self.totals: dict[str, Any] = json.loads(f.attrs["totals"])
        self.t: Array = f["t"][()]
        rows = f["windows"][()]
        text = [(n, k.replace("S", "U")) for n, k in WINDOW_FIELDS]
        self.windows: np.recarray[Any, Any] = rows.astype(text).view(np.recarray)
        self.messages = {int(k): str(v) for k, v in json.loads(f["windows"].attrs["messages"]).items()}
        self.iterates: np.recarray[Any, Any] = (
            f["iterates"][()] if "iterates" in f else np.zeros(0, list(ITERATE_FIELDS))).view(np.recarray)
        self._probes = {n: (d[()], str(d.attrs["unit"]), str(d.attrs["quantity"]))
                        for n, d in f["probes"].items()}
        self._terms: dict[str, Array] = {n: d[()] for n, d in f["ledger"].items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know though it is no error: of the scenario, then of what happened in the run."""
        return tuple(map(str, (*self.header.get("notes", ()), *self.totals.get("notes", ()))))

    @property
    def probe_names(self) -> tuple[str, ...]:
        return tuple(self._probes)

    def probe(self, name: str, unit: str | None = None) -> tuple[Array, Array]:
        """(t, value) of a probe: times [s] as in `t`; values in SI.

        unit : convert to "degC", "mm", "MPa", ...  Raises ResultsError for an unknown probe or unit.
        """
        value, own, _ = self._probe(name)
        if unit is None or unit == own:
            return self.t, value
        if _KIND_OF_UNIT.get(unit) != own:
            fits = [u for u, k in _KIND_OF_UNIT.items() if k == own]
            raise ResultsError(f"probe {name!r} is in {own}; it cannot be given in {unit!r}, "
                               f"only in {', '.join(fits) or own}")
        factor, shift = UNITS[unit]
        return self.t, value * factor + shift

    def quantity(self, name: str) -> str:
        """What a probe measures: T, u_x, u_y, gap or p.  Raises ResultsError for an unknown probe."""
        return self._probe(name)[2]

    def unit(self, name: str) -> str:
        """The SI unit of a probe.  Raises ResultsError for an unknown probe."""
        return self._probe(name)[1]

    def _probe(self, name: str) -> tuple[Array, str, str]:
        if name not in self._probes:
            has = ", ".join(self._probes) or "none"
            raise ResultsError(f"{self.path} has no probe {name!r}; it has {has}")
        return self._probes[name]

    @property
    def ledger(self) -> dict[str, float]:
        """Heat over the whole run [J] by mechanism, into the bodies; `stored.<body>` is what a body kept."""
        return {n: float(v[-1]) for n, v in self._terms.items() if v.size}

    def ledger_history(self) -> tuple[Array, dict[str, Array]]:
        """(t, mechanism -> heat so far [J]) at the ends of the accepted windows."""
        return self.t, dict(self._terms)

    @property
    def heat_imbalance(self) -> float:
        """|sum of the ledger's terms| / sum of |terms| over the run."""
        return imbalance({PREFIX + n: e for n, e in self.ledger.items()})

    @property
    def seconds_by_part(self) -> dict[str, float]:
        """Where the wall-clock seconds went; the coupler's are what is left when all others are taken out."""
        w = self.windows
        parts = {name: float(w[column].sum()) for name, column in (
            ("thermal half", "thermal_seconds"), ("mechanical half", "mechanical_seconds"),
            ("FMI and transport", "fmi_seconds"), ("recording", "recording_seconds"))}
        # A killed run left no totals: its windows are then all that is known.
        total = float(self.totals.get("seconds", w.seconds.sum() + parts["recording"]))
        return parts | {"coupler": max(total - sum(parts.values()), 0.0),
                        "set-up": float(self.totals.get("setup_seconds", 0.0))}

    @property
    def field_files(self) -> dict[str, Path]:
        """The .vtkhdf file of each half."""
        return {half: self.path.with_name(name) for half, name in self.header["field_files"].items()}


def iteration_words(results: Results) -> str:
    """How much the windows iterated, in words; empty for a scheme that does not."""
    w = results.windows[results.windows.taken & (results.windows.iterations > 0)]
    if not len(w):
        return ""
    known = w.contraction[np.isfinite(w.contraction)]
    text = f"{w.iterations.mean():.1f} iterations a window, {w.iterations.max()} at most"
    if len(known):
        text += f", contraction of plain iteration up to {known.max():.3g}"
    at_max = int((w.verdict != "accepted").sum())
    return text + (f"; {at_max} windows taken though they did not converge" if at_max else "")


def _recover(journal: Path, path: Path) -> None:
    """Make run.h5 from the journal of a killed run."""
    if being_written(journal):
        raise ResultsError(f"{path}: its run still goes on; the results file is made when it ends")
    finish(journal, path)


def finish(journal: Path, path: Path) -> None:
    """Make run.h5 and the field files from a journal, each in one atomic step.

    The journal is removed, or, with the checkpoint of a run that is not complete, kept for resuming it.
    All are written aside before the first is put in its place: an error, a full disk say, changes nothing.
    Raises ResultsError if the journal does not hold the beginning of a run, or the files cannot be written.
    """
    try:
        size, free = journal.stat().st_size, shutil.disk_usage(path.parent).free
        # Asked first, because HDF5 meets a full disk with a page of noise for every open file.
        if free < size + HDF5_ROOM:
            raise OSError(f"{free / 1e6:.1f} MB are free on its disk, {(size + HDF5_ROOM) / 1e6:.1f} MB are needed")
        complete = _make(journal, path)
    except (OSError, RuntimeError) as exc:  # a full disk is either, by where HDF5 meets it
        older = ", after the older file is moved away," if path.exists() else ""
        raise ResultsError(f"{path}: cannot be made from {journal.name} ({_reason(exc)}). All windows are in the "
                           f"journal: once this is mended{older} `slideline report {path}` makes the file") from exc
    put_away(journal, path, complete)


def _reason(exc: Exception) -> str:
    """What HDF5 means, without its file descriptors and addresses."""
    found = re.search(r"error message = '([^']*)'", str(exc))
    return found[1] if found else str(exc)


def _make(journal: Path, path: Path) -> bool:
    """Whether the run is complete."""
    records = read_journal(journal)
    header = next(((m, a) for kind, m, a in records if kind == "run"), None)
    if header is None:
        raise ResultsError(f"{journal}: the run ended before its first window; nothing to recover")
    meta, arrays = header
    meta["field_files"] = {half: f"{path.stem}.{half}.vtkhdf" for half in meta["fields"]}
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as scratch:
        part = Path(scratch) / path.name
        frames = (r for r in read_journal(journal) if r[0] == "frame")
        parts = write_field_files(Path(scratch), meta, arrays, frames)
        with h5py.File(part, "w", track_order=True) as f:
            complete = _write(f, meta, records) == "completed"
        for file in (*parts, part):
            os.replace(file, path.with_name(file.name))
    return complete


def _write(f: h5py.File, meta: dict[str, Any],
           records: Iterator[tuple[str, dict[str, Any], dict[str, NDArray[Any]]]]) -> str:
    """The file, from the records after the header.  Returns what became of the run."""
    outcome: dict[str, Any] = {"outcome": "killed",
                               "message": "the run was killed; this is all it had written"}
    rows: list[tuple[Any, ...]] = []
    t, probes = [], []
    terms: list[Mapping[str, float]] = []
    messages: dict[int, str] = {}
    iterates: list[tuple[Any, ...]] = []
    for kind, m, a in records:
        if kind == "window":
            if m["message"]:
                messages[len(rows)] = m["message"]
            iterates += [(len(rows), *row) for row in m.get("iterates", ())]
            rows.append(tuple(m[n].encode() if k.startswith("S") else m[n] for n, k in WINDOW_FIELDS))
        if kind in ("start", "window") and "probes" in a:
            t.append(float(m["t_now"]))
            probes.append(a["probes"])
            terms.append(dict(m["terms"]))
        if kind == "end":
            outcome = m
    text = h5py.string_dtype("utf-8")
    f.attrs.update(format=FORMAT, version=FORMAT_VERSION, outcome=outcome["outcome"],
                   message=outcome["message"], header=json.dumps(meta),
                   totals=json.dumps(outcome.get("totals", {})))
    f.create_dataset("scenario", data=meta["scenario"]["text"], dtype=text)
    f["t"] = np.array(t)
    f["windows"] = np.array(rows, dtype=list(WINDOW_FIELDS))
    f["windows"].attrs["messages"] = json.dumps(messages)
    if iterates:
        f["iterates"] = np.array(iterates, dtype=list(ITERATE_FIELDS))
    group = f.create_group("probes", track_order=True)
    table = np.array(probes, dtype=float).reshape(len(t), len(meta["probes"]))
    for i, (name, about) in enumerate(meta["probes"].items()):
        group[name] = table[:, i]
        group[name].attrs.update(unit=about["unit"], quantity=about["quantity"])
    _write_ledger(f.create_group("ledger", track_order=True), terms)
    return str(outcome["outcome"])


def _write_ledger(group: h5py.Group, terms: list[Mapping[str, float]]) -> None:
    names = list(dict.fromkeys(n for row in terms for n in row))
    for name in names:
        data = group.create_dataset(name.removeprefix(PREFIX), data=[row.get(name, 0.0) for row in terms])
        data.attrs["unit"] = "J"
