"""From the journal of a run to run.h5 and its field files, all of them or none."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from coupler.errors import ResultsError
from coupler.fmu.outputs import On, OutputField, at_nodes, of_pairs, output_field
from coupler.record.checksums import FORMAT_BOUNDS, close_texts, put
from coupler.record.frames import thinned
from coupler.record.journal import JournalRecord, read_journal
from coupler.record.paths import making_of, put_away
from coupler.record.tables import (
    CALL_FIELDS,
    ERROR_FIELDS,
    ESTIMATE_FIELDS,
    EXCHANGED,
    EXCHANGED_IN_PAIRS,
    FIELDS,
    FORMAT,
    FORMAT_VERSION,
    ITERATE_FIELDS,
    TIMING,
    TIMING_FIELDS,
    WINDOW_FIELDS,
)
from coupler.record.vtkhdf import FieldFile, FileField, MeshCells
from coupler.scenario.conditions import condition_output
from coupler.schemes.ledger import PREFIX

# What the records of a journal come to: rows of windows that stand, without those that were rewound.

RUNNING = {"outcome": "running", "message": ""}
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


# Field files of a finished run: frames of the journal to one .vtkhdf a half.

Arrays = dict[str, NDArray[Any]]


def write_field_files(folder: Path, meta: dict[str, Any], mesh: Arrays,
                      frames: Iterable[JournalRecord]) -> list[Path]:
    """Write every half's frames to a file in `folder`; returns the files written.

    meta : the run's header; "fields" : half -> {"point": [...], "cell": [...]}, "outputs" : what the halves say of
    those that are no part of the exchange (OutputField), "field_files" : half -> name of its file.
    mesh : nodes, quads, triangles, quad_body, triangle_body, contact_nodes, pair_nodes.
    """
    fields, names, known = meta["fields"], meta["field_files"], outputs_of(meta)
    body = np.concatenate([mesh["quad_body"], mesh["triangle_body"]]).astype(np.int32)
    cells, frames = MeshCells(mesh["quads"], mesh["triangles"], len(mesh["nodes"])), iter(frames)
    begin = list(islice(frames, 1))
    arrays = begin[0].arrays if begin else {}

    def columns(half: str, at: str) -> list[FileField]:
        return [_file_field(half, n, known, arrays) for n in fields[half][at]]

    with ExitStack() as stack:
        files = {half: stack.enter_context(FieldFile(folder / names[half], cells, columns(half, "point"),
                                                     columns(half, "cell"), {"body": body})) for half in fields}
        for frame in chain(begin, frames):
            a = frame.arrays
            for half, file in files.items():
                values = {n: _array(half, n, known, a, mesh) for n in (*fields[half]["point"], *fields[half]["cell"])}
                file.append(float(frame.meta["t_now"]), a["x"], values, values)
    return [folder / names[half] for half in fields]


def outputs_of(meta: Mapping[str, Any]) -> dict[tuple[str, str], OutputField]:
    """Half and label -> what the half says of it; a header of an earlier version has none."""
    fields = (output_field(about) for about in meta.get("outputs", ()))
    return {(field.half, field.label): field for field in fields}


def _file_field(half: str, name: str, known: Mapping[tuple[str, str], OutputField], first: Arrays) -> FileField:
    """How a field is written.  first : the arrays of the first frame, which tell where the header does not."""
    if field := known.get((half, name)):
        somewhere = field.on in (On.CONTACT_NODES, On.PAIR_NODES)
        return FileField(name, field.unit, field.components, field.description, somewhere)
    if own := next((f for f in EXCHANGED[half] if f.name == name), None):
        return own
    array = first.get(name, np.empty(0))
    return FileField(name, components=int(np.prod(array.shape[1:])))


def _array(half: str, name: str, known: Mapping[tuple[str, str], OutputField], a: Arrays, mesh: Arrays) -> NDArray[Any]:
    """A field of a frame as it is written: on all nodes or all cells."""
    field = known.get((half, name))
    if field is None:
        return a[name]
    # fault: an output of one half is written under the same name of the other -> array = a.get(f"thermal/{name}",
    #   a[f"{half}/{name}"]) | coupler/test_outputs::test_two_halves_may_have_outputs_of_one_name
    array = a[f"{half}/{name}"]
    if field.on is On.PAIR_NODES:
        return of_pairs(array, mesh["pair_nodes"], len(mesh["nodes"]), field.unit)
    return at_nodes(array, mesh["contact_nodes"], len(mesh["nodes"])) if field.on is On.CONTACT_NODES else array


@dataclass
class LooseArrays:
    """Outputs without a place on the mesh, and what is exchanged of pair nodes, frame after frame.

    fields : what they are.  t [s] : of the frames.  values : half and label -> the arrays of the frames.
    exchange : name -> arrays (n_q,) of pair nodes, which a field at nodes does not hold: pairs may share a node.
    """

    fields: Mapping[tuple[str, str], OutputField]
    t: list[float] = field(default_factory=list)
    values: dict[tuple[str, str], list[NDArray[Any]]] = field(default_factory=dict)
    exchange: dict[str, list[NDArray[Any]]] = field(default_factory=dict)

    def taken_from(self, frames: Iterable[JournalRecord]) -> Iterator[JournalRecord]:
        """The frames, unchanged, after their arrays were taken."""
        for frame in frames:
            self.t.append(float(frame.meta["t_now"]))
            for (half, label), about in self.fields.items():
                if about.on in (On.BODIES, On.NOTHING):
                    self.values.setdefault((half, label), []).append(frame.arrays[f"{half}/{label}"])
            for name, array in _of_pair_nodes(self.fields, frame.arrays):
                self.exchange.setdefault(name, []).append(array)
            yield frame


def _of_pair_nodes(fields: Mapping[tuple[str, str], OutputField], arrays: Arrays) -> Iterator[tuple[str, NDArray[Any]]]:
    """What a frame holds of the exchange at pair nodes, by its name at the border; nothing of earlier versions."""
    for name in EXCHANGED_IN_PAIRS:
        if name in arrays:
            yield name, arrays[name]
        elif (about := fields.get(("mechanical", name))) is not None and about.on is On.PAIR_NODES:
            yield name, arrays[f"mechanical/{name}"]


HDF5_ROOM = 500_000  # bytes that results files take beyond what they hold


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
        raise ResultsError(f"{path}: cannot be made from {journal.name} ({reason_of(exc)}). All windows are in the "
                           f"journal: once this is mended{older} `slideline report {path}` makes the file") from exc
    put_away(journal, path, complete)


def reason_of(exc: Exception) -> str:
    """What HDF5 means, without its file descriptors and addresses."""
    found = re.search(r"error message = '([^']*)'", str(exc))
    return found[1] if found else str(exc)


class NothingYetError(ResultsError):
    """A journal that does not hold the beginning of a run."""


def snapshot(journal: Path, path: Path) -> None:
    """Make run.h5 and the field files of what a run that goes on has written so far; its journal stays as it is.

    Raises NothingYetError if the journal does not hold the beginning of a run, ResultsError if it cannot be read or the
    files cannot be written.
    """
    try:
        _make(journal, path, RUNNING)
    except (OSError, RuntimeError) as exc:
        raise ResultsError(f"{path}: cannot be made from {journal.name} ({reason_of(exc)})") from exc


def _make(journal: Path, path: Path, without_end: Mapping[str, Any] = MappingProxyType({})) -> bool:
    """Whether the run is complete.  without_end : what became of a run that has written no end."""
    records = read_journal(journal)
    header = next((r for r in records if r.kind == "run"), None)
    if header is None:
        raise NothingYetError(f"{journal}: the run ended before its first window; nothing to recover")
    meta, arrays = header.meta, header.arrays
    meta["field_files"] = {half: f"{path.stem}.{half}.vtkhdf" for half in meta["fields"]}
    told = gathered(records)
    if without_end and told.end is KILLED:
        told.end = without_end
    loose = LooseArrays(outputs_of(meta))
    frames = loose.taken_from(
        r for k, r in enumerate(r for r in read_journal(journal) if r.kind == "frame") if k in told.frames)
    with _folder(making_of(path)) as scratch:
        part = scratch / path.name
        parts = write_field_files(scratch, meta, arrays, frames)
        with h5py.File(part, "w", track_order=True, libver=FORMAT_BOUNDS) as f:
            _write(f, meta, told)
            _write_mesh(f, arrays)
            _write_contact(f, meta, arrays, told)
            _write_outputs(f, meta["field_files"], loose)
            _write_exchange(f, loose)
            _write_end(f, arrays, told)
            close_texts(f)
        for file in (*parts, part):
            os.replace(file, path.with_name(file.name))
    return str(told.end["outcome"]) == "completed"


@contextmanager
def _folder(path: Path) -> Iterator[Path]:
    """An empty folder, while the block lasts; what a process that was killed left of it goes first."""
    # fault: what a killed run left of its results file stays -> pass | coupler/test_resume
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir()
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _write(f: h5py.File, meta: dict[str, Any], told: Gathered) -> None:
    """The file, from the header and what was gathered of the records after it."""
    text = h5py.string_dtype("utf-8")
    f.attrs.update(format=FORMAT, version=FORMAT_VERSION, outcome=told.end["outcome"],
                   message=told.end["message"], header=json.dumps(meta),
                   totals=json.dumps({**told.end.get("totals", {}), "rewound": told.rewound}))
    f.create_dataset("scenario", data=meta["scenario"]["text"], dtype=text)
    put(f, "t", told.t)
    put(f, "windows", np.array(told.rows, dtype=list(WINDOW_FIELDS)))
    # A dataset, not an attribute: those hold 64 kB at most.
    f.create_dataset("words", data=json.dumps(told.words), dtype=text)
    if told.iterates:
        put(f, "iterates", np.array(told.iterates, dtype=list(ITERATE_FIELDS)))
    if told.estimates:
        put(f, "estimates", np.array(told.estimates, dtype=list(ESTIMATE_FIELDS)))
    if told.errors:
        put(f, "errors", np.array(told.errors, dtype=list(ERROR_FIELDS)))
    _write_timings(f, told)
    if told.max_T is not None:
        f.attrs["max_T"] = told.max_T
    group = f.create_group("probes", track_order=True)
    table = np.array(told.probes, dtype=float).reshape(len(told.t), len(meta["probes"]))
    for i, (name, about) in enumerate(meta["probes"].items()):
        put(group, name, table[:, i]).attrs.update(unit=about["unit"], quantity=about["quantity"])
    _write_conditions(f, meta, told)
    _write_ranges(f, meta, told)
    _write_rows(f.create_group("ledger", track_order=True), told.terms, PREFIX, 0.0)
    for data in f["ledger"].values():
        data.attrs["unit"] = "J"
    _write_rows(f.create_group("monitors", track_order=True), told.monitors, "", np.nan)


def _write_timings(f: h5py.File, told: Gathered) -> None:
    """The tables of where the time went, where any was told."""
    if not told.timings:
        return
    rows = np.zeros(len(told.rows), dtype=list(TIMING_FIELDS))
    for name, kind in TIMING_FIELDS:
        rows[name] = np.nan if kind == "f8" else 0
    for row, parts in told.timings.items():
        # A journal of before knows of nothing that was done at the same time.
        rows[row] = (*parts, *(0.0,) * (len(TIMING_FIELDS) - len(parts)))
    put(f, "timings", rows)
    calls = np.zeros(sum(map(len, told.calls.values())), dtype=list(CALL_FIELDS))
    calls["window"] = np.repeat(list(told.calls), [len(of) for of in told.calls.values()])
    every = np.concatenate(list(told.calls.values()))
    for k, (name, _) in enumerate(CALL_FIELDS[1:]):
        calls[name] = every[:, k]
    put(f, "calls", calls, compression="gzip", compression_opts=1, shuffle=True)


def _write_conditions(f: h5py.File, meta: dict[str, Any], told: Gathered) -> None:
    """A dataset a condition, (n_t,) or (n_t, 2), with what the header says of it."""
    known = [condition_output(about) for about in meta.get("conditions", ())]
    group, first = f.create_group("conditions", track_order=True), 0
    for of in known:
        last = first + len(of.parts)
        values = np.array([row[first:last] for row in told.conditions], dtype=float).reshape(-1, last - first)
        data = put(group, of.name, values[:, 0] if len(of.parts) == 1 else values)
        data.attrs.update(unit=of.unit, kind=of.kind, place=of.place)
        # fault: conditions in the file are all the first one's -> first = 0 | coupler/test_named_conditions
        first = last


def _write_ranges(f: h5py.File, meta: dict[str, Any], told: Gathered) -> None:
    """A dataset a field, (n_t, 2) least and largest value anywhere; a time at which it was not recorded is nan."""
    names = meta.get("ranges", [])
    if not names or not told.ranges:
        return
    group = f.create_group("ranges", track_order=True)
    none = np.full((len(names), 2), np.nan)
    rows = np.array([row if len(row) == len(names) else none for row in told.ranges])
    for k, name in enumerate(names):
        put(group, name, rows[:, k])


def _write_mesh(f: h5py.File, header: Mapping[str, NDArray[Any]]) -> None:
    """The mesh as it was before anything moved: what another run may start from."""
    group = f.create_group("mesh", track_order=True)
    for name in ("nodes", "quads", "triangles", "quad_body", "triangle_body"):
        put(group, name, header[name])
    surfaces = group.create_group("surfaces", track_order=True)
    for name, edges in header.items():
        if name.startswith("surface."):
            put(surfaces, name.removeprefix("surface."), edges)


def _write_end(f: h5py.File, header: Mapping[str, NDArray[Any]], told: Gathered) -> None:
    """What another run may start from at the end, where the mechanical half told it; with the nodes of pair nodes."""
    if not told.memory:
        return
    group = f.create_group("end", track_order=True)
    group.attrs["t"] = told.end["t_now"]
    put(group, "pair_nodes", header["pair_nodes"])
    for name, data in told.memory.items():
        # Most points of a body have not flowed: a row of zeros takes no room.
        put(group, name, data, compression="gzip", compression_opts=1)


def _write_contact(f: h5py.File, meta: dict[str, Any], header: Mapping[str, NDArray[Any]], told: Gathered) -> None:
    """A group a pair: s and X of its contact line, and (n_t, n) of each field; a row without one is nan."""
    names = [n for n in FIELDS if any(n in row for row in told.contact)]
    first = 0
    for pair in meta["pairs"] if names else ():
        group = f.create_group(f"contact/{pair['name']}", track_order=True)
        for n in ("s", "X"):
            put(group, n, header[f"{n}.{pair['name']}"])
        here = slice(first, first + len(group["s"]))
        none = np.full(len(group["s"]), np.nan, np.float32)
        for n in names:
            rows = [row[n][here] if n in row else none for row in told.contact]
            data = put(group, n, np.array(rows, dtype=np.float32), compression="gzip", compression_opts=1)
            data.attrs["unit"] = FIELDS[n]
        first = here.stop


def _write_outputs(f: h5py.File, files: Mapping[str, str], loose: LooseArrays) -> None:
    """A group a half: its outputs at the times of the frames; of those on the mesh the place in the field file."""
    group = f.create_group("fields", track_order=True)
    put(group, "t", loose.t)
    for (half, label), about in loose.fields.items():
        name = f"{half}/{label}"
        if about.on in (On.BODIES, On.NOTHING):
            data = np.array(loose.values.get((half, label), np.empty((0, *about.shape))))
            put(group, name, data).attrs.update(unit=about.unit, description=about.description)
        else:
            place = "CellData" if about.on is On.CELLS else "PointData"
            group[name] = h5py.ExternalLink(files[half], f"/VTKHDF/{place}/{label}")


def _write_exchange(f: h5py.File, loose: LooseArrays) -> None:
    """What the thermal half was told of contact at the frames, (n_t, n_q) a name, to be played again."""
    group = f.create_group("exchange", track_order=True)
    for name, arrays in loose.exchange.items():
        if len(arrays) == len(loose.t):
            put(group, name, np.array(arrays)).attrs["unit"] = EXCHANGED_IN_PAIRS[name]


def _write_rows(group: h5py.Group, rows: list[Mapping[str, float]], prefix: str, missing: float) -> None:
    """A dataset a name, a value a row."""
    for name in dict.fromkeys(n for row in rows for n in row):
        values: NDArray[np.float64] = np.array([row.get(name, missing) for row in rows])
        put(group, name.removeprefix(prefix), values)
