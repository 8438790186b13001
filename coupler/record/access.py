"""Results for people who compute: fields by time, surfaces, and tables of other packages."""

from __future__ import annotations

import importlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contact.problem.values import did_you_mean
from coupler.errors import ResultsError
from coupler.fmu.outputs import On, OutputField
from coupler.record.mesh import RunMesh

Array = NDArray[np.float64]
Ints = NDArray[np.integer]

EXTRA = {"pandas": "data", "xarray": "data", "pyvista": "vtk"}
PLACES = {On.NODES: "node", On.CELLS: "cell", On.CONTACT_NODES: "node", On.PAIR_NODES: "node", On.BODIES: "body"}
ENDS = {"start": 0, "end": -1}  # words for times -> frames
SAME_TIME = 1e-9  # of the length of the run
ROWS = 12  # of a table in a notebook


@dataclass(frozen=True, eq=False)
class RunSurface:
    """A named surface.  nodes : (n,) node numbers in order along it, the first again at the end of a closed one.

    s : (n,) [m] length from its start, X : (n, 2) [m], both in the mesh's own shape.
    """

    name: str
    nodes: Ints
    s: Array
    X: Array


class Source(Protocol):
    """What is read here of `coupler.record.results.Results`."""

    path: Path
    t: Array
    outcome: str
    header: dict[str, Any]
    windows: Any
    extremes: dict[str, Array]

    @property
    def broken(self) -> tuple[Any, ...]: ...

    @property
    def probe_names(self) -> tuple[str, ...]: ...

    @property
    def conditions(self) -> Mapping[str, Any]: ...

    @property
    def fields(self) -> Fields: ...

    def probe(self, name: str, unit: str | None = None) -> tuple[Array, Array]: ...

    def unit(self, name: str) -> str: ...

    def ledger_history(self) -> tuple[Array, dict[str, Array]]: ...

    def field(self, name: str) -> tuple[Array, Array]: ...

    def mesh(self) -> RunMesh: ...


class Fields(dict[str, OutputField]):
    """HALF.NAME -> what was recorded at the frames; called, it gives the values: `results.fields("T", t=12.5)`."""

    def __init__(self, known: Mapping[str, OutputField], results: Source) -> None:
        super().__init__(known)
        self._results = results

    def __call__(self, name: str, t: float | str | None = None) -> Any:
        """Return the values of a field in SI, at one time or with the times of all frames.

        name : HALF.NAME, or NAME where one half alone has it.  t [s] : between two frames on a straight line, or
        "start" or "end".
        Values at t : (n_nodes,), (n_cells, k), ...; without t : (times (n_t,), values (n_t, ...)).
        Raises ResultsError for an unknown field and a time outside the frames.
        """
        times, values = self._results.field(self.full_name(name))
        return (times, values) if t is None else between(times, values, t)

    def full_name(self, name: str) -> str:
        """HALF.NAME of a field.  Raises ResultsError where none has the name, or both halves have."""
        found = [full for full in self if name in (full, full.partition(".")[2])]
        if len(found) == 1:
            return found[0]
        if found:
            raise ResultsError(f"{self._results.path}: both halves have a field {name!r}: give {' or '.join(found)}")
        raise ResultsError(f"{self._results.path} has no field {name!r}. {did_you_mean(name, self)}")


def between(times: Array, values: Array, t: float | str) -> Array:
    """Return values (...) at a time t [s] from values (n_t, ...) at times (n_t,) [s], ascending, on a straight line.

    t : or "start" or "end".  Raises ResultsError for a time outside them, and what is no time.
    """
    if not len(times):
        raise ResultsError("there are no frames of fields")
    if isinstance(t, str) and t in ENDS:
        return np.asarray(values[ENDS[t]])
    if isinstance(t, str) or np.ndim(t):
        raise ResultsError(f"t = {t!r} is no time: give one in seconds, \"start\" or \"end\"; of several times, ask "
                           "one after the other, or without t for all frames")
    slack = SAME_TIME * max(float(times[-1] - times[0]), abs(t))
    if not times[0] - slack <= t <= times[-1] + slack:
        raise ResultsError(f"t = {t:g} s is outside the frames, from {times[0]:g} to {times[-1]:g} s")
    k = int(np.clip(np.searchsorted(times, t) - 1, 0, max(len(times) - 2, 0)))
    if len(times) == 1:
        return np.asarray(values[0])
    # fault: fields at a time are those of the frame before -> share = 0.0 | coupler/test_access
    share = float(np.clip((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0))
    return np.asarray((1.0 - share) * values[k] + share * values[k + 1])


def _package(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as exc:
        raise ResultsError(f"this needs {name}, which is not installed: "
                           f"pip install 'slideline[{EXTRA[name]}]'") from exc


def _over_time(results: Source) -> dict[str, tuple[Array, str, str]]:
    """Name -> values (n_t,), SI unit and kind of everything that is known at each of `t`."""
    found = {n: (results.probe(n)[1], results.unit(n), "probe") for n in results.probe_names}
    for name, series in results.conditions.items():
        columns = [series.values] if series.values.ndim == 1 else list(series.values.T)
        for part, values in zip(series.of.parts, columns, strict=True):
            found[f"{name}.{part}" if part else name] = (values, series.of.unit, "condition")
    for name, values in results.ledger_history()[1].items():
        found[f"heat_balance.{name}"] = (values, "J", "heat balance")
    for name, values in results.extremes.items():
        field = results.fields.get(name)
        for c, which in enumerate(("min", "max")):
            found[f"{name}.{which}"] = (values[:, c], field.unit if field else "", "extreme")
    return found


def to_pandas(results: Source) -> Any:
    """Return a DataFrame over t [s]: probes, conditions, heat balance, extremes; attrs["units"] : column -> SI unit."""
    pandas, columns = _package("pandas"), _over_time(results)
    frame = pandas.DataFrame({n: v for n, (v, _, _) in columns.items()}, index=pandas.Index(results.t, name="t"))
    frame.attrs["units"] = {n: unit for n, (_, unit, _) in columns.items()}
    return frame


def to_xarray(results: Source) -> Any:
    """Return a Dataset: all that is known at each window's end over `t`, fields at frames over `frame` (their times).

    Each variable has `units` (SI); those of fields are over node, cell or body, and component.
    """
    xarray = _package("xarray")
    data: dict[str, Any] = {n: ("t", v, {"units": unit, "kind": kind})
                            for n, (v, unit, kind) in _over_time(results).items()}
    coordinates: dict[str, Any] = {"t": ("t", results.t, {"units": "s"})}
    for name, field in results.fields.items():
        times, values = results.field(name)
        coordinates["frame"] = ("frame", times, {"units": "s"})
        place = PLACES.get(field.on, f"row of {name}")
        extra = [f"{values.shape[k]} components" if field.on in PLACES else f"column {k} of {name}"
                 for k in range(2, values.ndim)]
        data[name] = (("frame", place, *extra)[:values.ndim], values,
                      {"units": field.unit, "long_name": field.description, "kind": "field"})
    mesh = results.mesh()
    coordinates |= {"X": ("node", mesh.nodes[:, 0], {"units": "m"}), "Y": ("node", mesh.nodes[:, 1], {"units": "m"}),
                    "body": list(mesh.bodies)}
    return xarray.Dataset(data, coordinates, {"title": results.header["title"], "outcome": results.outcome})


def to_pyvista(results: Source, t: float | str | None = None) -> Any:
    """Return an UnstructuredGrid of both halves' fields at a time [s] (None: the last frame), on the deformed mesh.

    t : as in `Fields`.  Point and cell data by HALF.NAME, in SI;
    `body` : number of the body of each cell, its names in field data "bodies".
    """
    pyvista, mesh = _package("pyvista"), results.mesh()
    fields = results.fields
    u = fields("mechanical.u", t) if t is not None else fields("mechanical.u")[1][-1]
    quads, triangles = (np.column_stack([np.full(len(c), c.shape[1]), c]).ravel() for c in (mesh.quads, mesh.triangles))
    kinds = [pyvista.CellType.QUAD] * len(mesh.quads) + [pyvista.CellType.TRIANGLE] * len(mesh.triangles)
    grid = pyvista.UnstructuredGrid(np.concatenate([quads, triangles]), np.array(kinds, dtype=np.uint8),
                                    np.column_stack([mesh.nodes + u, np.zeros(len(u))]))
    for name, field in fields.items():
        if PLACES.get(field.on) in ("node", "cell"):
            value = fields(name, t) if t is not None else fields(name)[1][-1]
            value = np.column_stack([value, np.zeros(len(value))]) if value.ndim == 2 and value.shape[1] == 2 else value
            (grid.cell_data if field.on is On.CELLS else grid.point_data)[name] = value
    grid.cell_data["body"] = mesh.cell_body.astype(np.int32)
    grid.field_data["bodies"] = list(mesh.bodies)
    return grid


def plot(results: Source, *names: str, unit: str | None = None) -> Any:
    """Draw probes over time and return the axes (matplotlib), which a notebook shows.

    unit : of all of them, as in `Results.probe`; without it SI, of temperatures the scenario's own.
    Raises ResultsError for an unknown probe or unit, and for probes of different units.
    """
    # Not pyplot: a figure that nobody closes would stay in memory.
    matplotlib_axes: Any = importlib.import_module("matplotlib.axes").Axes

    class ProbeAxes(matplotlib_axes):  # type: ignore[misc]
        """Axes that a notebook shows as a picture."""

        # fault: a notebook shows the name of the axes alone -> def _no_png_(self) -> bytes: |
        #   coupler/test_access::test_plot_is_shown_in_a_notebook
        def _repr_png_(self) -> bytes:
            data = io.BytesIO()
            self.figure.savefig(data, format="png", dpi=100)
            return data.getvalue()

    figure = importlib.import_module("matplotlib.figure").Figure(figsize=(8.0, 4.0), layout="constrained")
    names = names or results.probe_names
    # fault: plot: temperatures of a scene in degC are drawn in K -> own = {} | coupler/test_access
    own = {"K": str(results.header["temperature_unit"])}
    units = {unit or own.get(results.unit(n), results.unit(n)) for n in names}
    if len(units) > 1:
        raise ResultsError(f"{results.path}: these probes have several units ({', '.join(sorted(units))}): "
                           "one axis cannot show them; plot them one unit at a time")
    axes = figure.add_subplot(axes_class=ProbeAxes)
    for name in names:
        axes.plot(*results.probe(name, next(iter(units))), label=name)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"[{next(iter(units), '1')}]")
    axes.grid(alpha=0.3)
    axes.legend()
    return axes


def line(results: Source) -> str:
    """Return what `repr` says of results: title, outcome, the time reached of the run's end, file."""
    t, end = float(results.t[-1]) if len(results.t) else 0.0, float(results.header["coupling"]["end"])
    return f"Results({str(results.header['title'])!r}: {results.outcome}, t = {t:.6g} of {end:.6g} s, {results.path})"


def html(results: Source) -> str:
    """Return a few lines and a table of probes, as a notebook shows them."""
    t = float(results.t[-1]) if len(results.t) else 0.0
    broken = "; ".join(c.name for c in results.broken)
    trust = f"<strong>not to be trusted: {escape(broken)}</strong>" if broken else "no check says otherwise"
    rows = "".join(
        f"<tr><td>{escape(n)}</td><td>{v[0]:.6g}</td><td>{v[-1]:.6g}</td><td>{np.nanmin(v):.6g}</td>"
        f"<td>{np.nanmax(v):.6g}</td><td>{escape(results.unit(n))}</td></tr>"
        for n in results.probe_names[:ROWS] if len(v := results.probe(n)[1]))
    more = len(results.probe_names) - ROWS
    return (f"<p><strong>{escape(str(results.header['title']))}</strong>: {escape(results.outcome)}, t = {t:.6g} s, "
            f"{int(results.windows.taken.sum())} windows; {trust}</p>"
            f"<table><tr><th>probe</th><th>first</th><th>last</th><th>least</th><th>largest</th><th>unit</th></tr>{rows}"
            f"</table>" + (f"<p>and {more} more probes</p>" if more > 0 else ""))
