"""Fields of a finished run: frames of the journal to one .vtkhdf a half, and those without a place on the mesh."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.outputs import On, OutputField, at_nodes, of_pairs, output_field
from coupler.record.journal import JournalRecord
from coupler.record.tables import EXCHANGED, EXCHANGED_IN_PAIRS
from coupler.record.vtkhdf import FieldFile, FileField, MeshCells

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
