"""What the page's player shows: the mesh, displacements and fields at chosen frames, contact along slave surfaces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from coupler.fmu.outputs import On, OutputField
from coupler.record.mesh import RunMesh
from coupler.record.results import Along, Results
from coupler.record.vtkhdf import FieldReader, in_plane
from coupler.report.curves import kinks_of
from coupler.report.figures import Shown, axis_names, choose, progress, shown
from coupler.report.pack import Pack
from coupler.report.pressure import largest

Array = NDArray[np.float64]

MOST_FRAMES = 50
MOST_BYTES = 5_000_000  # of fields, before they are packed
LEAST_FRAMES = 8  # a player of fewer tells no story: then fields are left out instead
LINE_BYTES, LINE_ROWS = 1_000_000, 400
SAME = 1e-9  # of a field: round-off of one value everywhere
COLOURS = 48  # of a colour map
MAPS = {"heat": ("inferno", 0.08, 1.0), "size": ("viridis", 0.0, 1.0), "signed": ("coolwarm", 0.0, 1.0)}
SIGNED = 0.05  # share of the largest below which what is negative is not worth colours of its own
LOUD, QUIET = 0.995, 0.6  # where this share of all values lies below so much of the largest, the colours end there
TITLES = {"T": "temperature", "u": "displacement", "q": "heat flux", "f_s": "solid fraction",
          "sigma_v": "von Mises stress", "sigma": "stress", "strain": "strain",
          "elastic_strain": "elastic strain", "sigma_hoop": "hoop stress",
          "peeq": "equivalent plastic strain"}
TENSOR = ((0, "{0}{0}"), (1, "{1}{1}"), (2, "{0}{1}"), (3, "out of plane"))


@dataclass(frozen=True)
class Shows:
    """A field of the player.  component : of a tensor, None: the value itself, or the size of a vector."""

    field: OutputField
    title: str
    component: int | None = None

    @property
    def name(self) -> str:
        return f"{self.field.half}.{self.field.label}" + ("" if self.component is None else f".{self.component}")

    @property
    def vector(self) -> bool:
        return self.field.components == 2

    def of(self, file: FieldReader, frame: int) -> Array:
        """Return the values (n,) or (n, 2) of a frame in SI."""
        read = file.cell_field if self.field.on is On.CELLS else file.point_field
        value = in_plane(read(self.field.label, frame), self.field.components)
        return value if self.component is None else value[:, self.component]


def title_of(field: OutputField) -> str:
    """What a field is called: as in textbooks, or as its half says."""
    about = field.description.partition("(")[0].partition(",")[0].strip()
    # A symbol such as E_M keeps its capital letter.
    return TITLES.get(field.label) or (about[:1].lower() + about[1:] if about[1:2].islower() else about or field.label)


def fields_to_show(results: Results) -> list[Shows]:
    """Return the fields on nodes and cells: numbers and vectors of both halves first, components of tensors last.

    Of the former the temperature comes first, and after all others what has one value everywhere at all times.
    Pressure and gap are not among them: they are shown along the surfaces.
    """
    first, last = [], []
    axes = axis_names(str(results.header["geometry"]))
    for field in results.fields.values():
        if field.on not in (On.NODES, On.CELLS) or field.label in ("p", "gap"):
            continue
        title = title_of(field)
        if field.components <= 2:
            first.append(Shows(field, title))
        elif field.components == 4:
            last += [Shows(field, f"{title} {name.format(*axes)}", c) for c, name in TENSOR]
    # fault: report: a field of one value is shown first ->
    #   return sorted(first, key=lambda s: s.field.label != "T") + last |
    #   coupler/test_report_windows::test_a_run_that_moves_no_heat_says_so
    return sorted(first, key=lambda s: (_is_one_value(results, s.field), s.field.label != "T")) + last


def _is_one_value(results: Results, field: OutputField) -> bool:
    course = results.extremes.get(f"{field.half}.{field.label}")
    if course is None or not np.isfinite(course).any():
        return False
    least, largest = float(np.nanmin(course)), float(np.nanmax(course))
    return largest - least <= SAME * max(abs(least), abs(largest))


def frames_to_show(results: Results, file: FieldReader, most: int) -> list[int]:
    """Return the numbers of the frames for the player: at breakpoints and events, and where most changes."""
    # The thermal file alone has T, by which change is measured; without it frames are taken evenly.
    told = progress(file) if "T" in file.point_fields else np.linspace(0.0, 1.0, len(file.times))
    w = results.windows
    marks = [*kinks_of(results), *(float(w.t[k] + w.H[k]) for k in results.events)]
    marks += [float(results.t[largest(along)[1]]) for along in results.contact.values() if largest(along)[0] > 0.0]
    return choose(file.times, told, marks, most)


def player_data(results: Results, pack: Pack) -> dict[str, Any]:
    """Return mesh, frames and fields for the script; their numbers go into `pack`.

    Empty for a run without frames.  Raises ResultsError where a field file or the mesh cannot be read.
    """
    mesh, shows = results.mesh(), fields_to_show(results)
    with ExitStack() as stack:
        readers = {half: stack.enter_context(FieldReader(path)) for half, path in results.field_files.items()}
        file = next(iter(readers.values()))
        if not len(file.times) or not shows:
            return {}
        shows, count = _affordable(shows, mesh)
        picks = frames_to_show(results, file, count)
        fields = [f for show in shows if (f := _field(results, show, readers[show.field.half], picks, pack))]
        return {"mesh": _mesh(results, mesh, pack), "frames": _frames(mesh, file, picks, pack), "fields": fields,
                "maps": {name: _colours(*about) for name, about in MAPS.items()}}


def _affordable(shows: Sequence[Shows], mesh: RunMesh) -> tuple[list[Shows], int]:
    """The fields that there is room for, and how many frames of them; components of tensors go first."""
    cells = len(mesh.quads) + len(mesh.triangles)

    def bytes_of(some: Sequence[Shows]) -> int:
        return 4 * len(mesh.nodes) + sum(2 * (3 if s.vector else 1) * (cells if s.field.on is On.CELLS
                                                                        else len(mesh.nodes)) for s in some)

    kept = list(shows)
    while len(kept) > 1 and bytes_of(kept) * MOST_FRAMES > MOST_BYTES and kept[-1].component is not None:
        kept.pop()
    while len(kept) > 1 and bytes_of(kept) * LEAST_FRAMES > MOST_BYTES:
        kept.pop()
    return kept, int(np.clip(MOST_BYTES // bytes_of(kept), 2, MOST_FRAMES))


def _field(results: Results, show: Shows, file: FieldReader, picks: Sequence[int], pack: Pack) -> dict[str, Any] | None:
    """A field for the script; None of one that is 0 everywhere, always, or unknown."""
    rows = np.array([show.of(file, k) for k in picks], dtype=float)
    sizes = np.linalg.norm(rows, axis=2) if rows.ndim == 3 else rows
    known = sizes[np.isfinite(sizes)]
    if not known.size or not np.abs(known).max() > 0:
        return None
    scale = shown(show.field.unit, float(np.abs(known).max()), results.header["temperature_unit"])
    values = scale(sizes)
    low, high, colours, clipped = limits(show, scale(known))
    about: dict[str, Any] = {
        "name": show.name, "title": show.title, "short": show.title, "half": show.field.half, "unit": scale.unit,
        "on": "cells" if show.field.on is On.CELLS else "nodes", "low": low, "high": high, "map": colours,
        "clipped": clipped, "values": pack.table(values), "parts": None, "extremes": None}
    if rows.ndim == 3:
        about["parts"] = [pack.table(rows[:, :, c] * scale.factor) for c in range(2)]
    if show.component is None and (course := results.extremes.get(show.name)) is not None:
        about["extremes"] = [pack.put(scale(course[:, c])) for c in range(2)]
    return about


def limits(show: Shows, known: Array) -> tuple[float, float, str, list[bool]]:
    """Return what the colours run from and to, which map, and whether values lie below and above.

    known : (n,) all values as shown.
    """
    low, high = float(known.min()), float(known.max())
    if show.field.unit == "K":
        return (low, high, "heat", [False, False]) if high > low else (low - 0.5, high + 0.5, "heat", [False, False])
    if show.field.label == "f_s":
        return 0.0, 1.0, "size", [False, False]
    size = max(abs(low), abs(high))
    # A corner or a first contact may be a hundred times larger than all else and would leave the rest dark.
    loud = float(np.quantile(np.abs(known), LOUD))
    top = loud if 0.0 < loud < QUIET * size else size
    if low < -SIGNED * size:
        return -top, top, "signed", [low < -top, high > top]
    return 0.0, top, "size", [False, high > top]


def _mesh(results: Results, mesh: RunMesh, pack: Pack) -> dict[str, Any]:
    return {"X": pack.put(mesh.nodes), "quads": pack.put(mesh.quads, "u4"), "triangles": pack.put(mesh.triangles, "u4"),
            "owner": pack.put(mesh.cell_body, "u1"), "node_body": pack.put(mesh.node_body, "u1"),
            "outline": pack.put(mesh.outline(), "u4"), "bodies": list(mesh.bodies),
            "pairs": [pack.put(nodes_of(results, mesh, pair, along), "u4")
                      for pair, along in _pairs(results)]}


def _pairs(results: Results) -> Iterator[tuple[dict[str, Any], Along]]:
    pairs = {p["name"]: p for p in results.header["pairs"]}
    for name, along in results.contact.items():
        yield pairs[name], along


def nodes_of(results: Results, mesh: RunMesh, pair: dict[str, Any], along: Along) -> NDArray[np.intp]:
    """Return the node numbers (n,) of a slave surface: the nodes of its body that stand where it says."""
    body = mesh.bodies.index(str(pair["slave"]).partition(".")[0])
    # fault: report: of two nodes in one place the other body's is taken -> own = np.arange(len(mesh.nodes)) |
    #   coupler/test_live
    own = np.flatnonzero(mesh.node_body == body)
    away = ((mesh.nodes[own][None] - along.X[:, None]) ** 2).sum(axis=2)
    return np.asarray(own[away.argmin(axis=1)])


def _frames(mesh: RunMesh, file: FieldReader, picks: Sequence[int], pack: Pack) -> dict[str, Any]:
    """Times, the mean displacement of each body, and each node's beyond it, which the page can magnify."""
    body, n = mesh.node_body, len(mesh.bodies)
    u = np.array([file.points(k) - mesh.nodes for k in picks])
    count = np.maximum(np.bincount(body, minlength=n), 1)
    means = np.array([[np.bincount(body, weights=at[:, c], minlength=n) / count for c in range(2)] for at in u])
    means = means.transpose(0, 2, 1)
    own = u - means[:, body]
    return {"t": pack.put(file.times[list(picks)]), "times": file.times[list(picks)].tolist(), "means": pack.put(means),
            "own": [pack.table(own[:, :, c]) for c in range(2)]}


def _colours(name: str, first: float, last: float) -> list[str]:
    return [to_hex(colormaps[name](x)) for x in np.linspace(first, last, COLOURS)]


def line_data(results: Results, pack: Pack, times: Sequence[float]) -> list[dict[str, Any]]:
    """Return for each pair what contact did along its slave surface; times [s] : of the player, which must be there."""
    mesh = results.mesh() if results.contact else None
    found = []
    for pair, along in _pairs(results):
        assert mesh is not None
        rows = _rows(results, along, times)
        length = shown("m", float(along.s[-1]))
        p, top = np.maximum(-along.t_N[rows].astype(float), 0.0), largest(along)[0]
        scale = shown("Pa", top)
        pressure = [("pressure", scale(p))]
        if along.t_T is not None and np.nan_to_num(np.abs(along.t_T)).any():
            pressure.append(("shear", scale(along.t_T[rows].astype(float))))
        # fault: a pressure that is never there is an empty chart -> groups = [(f"pressure [{scale.unit}]", pressure)] |
        #   coupler/test_live::test_what_is_never_pressed_has_no_chart_of_pressure
        groups = [(f"pressure [{scale.unit}]", pressure)] if top > 0.0 else []
        gap = np.where(along.gap[rows] >= np.float32(pair["gap_max"]), np.nan, along.gap[rows].astype(float))
        if np.isfinite(gap).any():
            wide: Shown = shown("m", float(np.nanmax(np.abs(gap))))
            groups.append((f"gap [{wide.unit}]", [("gap", wide(gap))]))
        found.append({"pair": pair["name"], "slave": pair["slave"], "s": pack.put(length(along.s)),
                      "t": pack.put(results.t[rows]), "label": f"along {pair['slave']} [{length.unit}]",
                      "pressed": top > 0.0,
                      "nodes": nodes_of(results, mesh, pair, along).tolist(),
                      "fields": [_group(label, curves, pack) for label, curves in groups]})
    return found


def _group(label: str, curves: Sequence[tuple[str, Array]], pack: Pack) -> dict[str, Any]:
    every = np.concatenate([values.ravel() for _, values in curves])
    low, high = float(np.nanmin(every)), float(np.nanmax(every))
    room = 0.05 * (high - low) or 1.0
    return {"label": label, "low": low - room, "high": high + room,
            "curves": [{"name": name, "values": pack.table(values)} for name, values in curves]}


def _rows(results: Results, along: Along, times: Sequence[float]) -> list[int]:
    """Numbers of the times to keep of a contact line: those of the player, that of the largest pressure, and evenly."""
    n = len(results.t)
    most = int(np.clip(LINE_BYTES // (6 * max(len(along.s), 1)), 2, LINE_ROWS))
    kept = {int(np.abs(results.t - t).argmin()) for t in times} | {largest(along)[1]}
    return sorted(kept | set(np.linspace(0, n - 1, min(most, n)).round().astype(int).tolist()))

