"""From the journal of a run to run.h5 and its field files, all of them or none."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from coupler.errors import ResultsError
from coupler.fmu.outputs import On
from coupler.record.checksums import FORMAT_BOUNDS, close_texts, put
from coupler.record.field_files import LooseArrays, outputs_of, write_field_files
from coupler.record.gathered import KILLED, Gathered, gathered
from coupler.record.journal import read_journal
from coupler.record.paths import making_of, put_away
from coupler.record.tables import (
    CALL_FIELDS,
    ERROR_FIELDS,
    ESTIMATE_FIELDS,
    EXCHANGED_IN_PAIRS,
    FIELDS,
    FORMAT,
    FORMAT_VERSION,
    ITERATE_FIELDS,
    TIMING_FIELDS,
    WINDOW_FIELDS,
)
from coupler.scenario.conditions import condition_output
from coupler.schemes.ledger import PREFIX

RUNNING = {"outcome": "running", "message": ""}
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
    text = str(exc)
    cut = re.search(r"truncated file: eof = (\d+), .*stored_eof = (\d+)", text)
    # fault: a file that is cut short is told in the words of HDF5 -> if False: | coupler/test_results
    if cut is not None:
        return f"it is cut short: {cut[1]} of its {cut[2]} bytes are there"
    found = re.search(r"error message = '([^']*)'", text)
    return found[1] if found else text.strip("'")


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
