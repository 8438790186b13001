"""Results of a run: run.h5, made from the run's journal, and what Python users read from it."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from contact.problem.values import did_you_mean
from coupler.errors import ResultsError
from coupler.fmu.outputs import On, OutputField, output_field
from coupler.record import access
from coupler.record.access import Fields, RunSurface
from coupler.record.checksums import check_texts
from coupler.record.confidence import read_confidence
from coupler.record.finish import finish, reason_of
from coupler.record.journal import taken
from coupler.record.mesh import RunMesh
from coupler.record.paths import journal_of
from coupler.record.tables import (
    CALL_FIELDS,
    ERROR_FIELDS,
    ESTIMATE_FIELDS,
    EXCHANGED,
    FORMAT,
    FORMAT_VERSION,
    ITERATE_FIELDS,
    TIMING_FIELDS,
    WINDOW_FIELDS,
    unrolled,
)
from coupler.record.vtkhdf import FieldReader, FileField, in_plane
from coupler.scenario.conditions import ConditionOutput, condition_output
from coupler.trust.checks import Check, broken
from coupler.trust.in_time.errors import ProbeError

Array = NDArray[np.float64]

UNITS = {"K": (1.0, 0.0), "degC": (1.0, -273.15), "m": (1.0, 0.0), "mm": (1e3, 0.0), "um": (1e6, 0.0),
         "Pa": (1.0, 0.0), "kPa": (1e-3, 0.0), "MPa": (1e-6, 0.0)}
_KIND_OF_UNIT = {"K": "K", "degC": "K", "m": "m", "mm": "m", "um": "m", "Pa": "Pa", "kPa": "Pa", "MPa": "Pa"}


@dataclass(frozen=True)
class FiredRule:
    """row : of the windows table.  t [s]: where its window began.  rule : its name.  text : what it did.

    values : monitors that made it.
    """

    row: int
    t: float
    rule: str
    text: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Along:
    """Contact along the slave surface of a pair, at the times `Results.t`.

    s : (n,) [m] length from the surface's start to each node, X : (n, 2) [m] the node, both in the mesh's own shape.
    t_N : (n_t, n) [Pa], <= 0.  gap : (n_t, n) [m], gap_max where nothing is faced.  t_T : (n_t, n) [Pa] shear, or None.
    slip_share : (n_t, n) of what a node touches the share at Coulomb's bound, 0 to 1, or None.
    """

    s: Array
    X: Array
    t_N: NDArray[np.float32]
    gap: NDArray[np.float32]
    t_T: NDArray[np.float32] | None = None
    slip_share: NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False)
class _ProbeSeries:
    """values : (n_t,) in SI.  unit : SI.  quantity : what is measured."""

    values: Array
    unit: str
    quantity: str


@dataclass(frozen=True, eq=False)
class ConditionSeries:
    """of : what it is.  values : (n_t,) in SI, or (n_t, 2) of a force along x and y, a pair into slave and master."""

    of: ConditionOutput
    values: Array


class Results:
    """What a run left in its results file.

    >>> t, T = Results("run.h5").probe("lower.top.left", unit="degC")

    path : the run.h5, or one whose run was killed: it is then made from the journal found beside it.
    outcome : completed | interrupted | stopped | failed | killed, with its message.
    header, totals : what the run wrote before its first window and after its last one.
    t : (n,) [s], the start and the ends of the accepted windows.
    windows : one row a window tried (WINDOW_FIELDS); messages : row number -> why it was rejected; reasons : why it had
    its size and scheme, where that was chosen; events : what happened to contact at its end or inside.
    iterates : one row an iterate of a scheme that iterates (ITERATE_FIELDS), else none.
    timings : one row a window tried, where its time went (TIMING_FIELDS); calls : one row a call of a half
    (CALL_FIELDS).  Empty for a file of an earlier version.
    estimates, errors : one row a window whose error is known (ESTIMATE_FIELDS, ERROR_FIELDS).  max_T [K] : the highest
    temperature at the start and the ends of windows.  firings : of rules, in order.
    conditions : heat and force of each named condition over time; empty for a file of an earlier version.
    extremes : field (HALF.NAME) -> its least and largest value anywhere, (n_t, 2) in SI, at each of `t`, of vectors of
    their size; not from the frames that were kept.  Empty for a file of an earlier version.
    confidence : probe -> its error against companions in coarser windows (`slideline run --confidence`); else empty.
    contact : pair -> what contact did along its slave surface; empty for a file of an earlier version.
    rewound : what was spent on windows that were rewound and are in no table; empty where there are none.
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
            raise ResultsError(f"{self.path}: no such results file, and no journal of a run beside it. "
                               f"Check the path; `slideline run SCENARIO -o {self.path.name}` writes it")
        # fault: a scenario in place of results is told as a bad signature -> if False: | coupler/test_results
        if self.path.suffix in (".yaml", ".yml"):
            raise ResultsError(f"{self.path}: this is a scenario, not a results file. "
                               f"`slideline run {self.path.name} -o run.h5` makes its results")
        try:
            with h5py.File(self.path, "r") as f:
                self._read(f)
        except (OSError, KeyError, ValueError, RuntimeError, TypeError, AttributeError) as exc:
            raise ResultsError(f"{self.path}: not a readable results file ({reason_of(exc)}). Give a file that "
                               "`slideline run` wrote, such as run.h5") from exc

    def _read(self, f: h5py.File) -> None:
        if f.attrs.get("format") != FORMAT or f.attrs.get("version") != FORMAT_VERSION:
            raise ValueError(f"its format is not {FORMAT} {FORMAT_VERSION}")
        check_texts(f)
        self.outcome: str = str(f.attrs["outcome"])
        self.message: str = str(f.attrs["message"])
        self.header: dict[str, Any] = json.loads(f.attrs["header"])
        self.totals: dict[str, Any] = json.loads(f.attrs["totals"])
        self.t: Array = f["t"][()]
        rows = f["windows"][()]
        text = [(n, k.replace("S", "U")) for n, k in WINDOW_FIELDS]
        self.windows: np.recarray[Any, Any] = rows.astype(text).view(np.recarray)
        words: list[dict[str, Any]] = json.loads(f["words"].asstr()[()])
        self.messages, self.reasons, self.events = (
            {k: str(row[n]) for k, row in enumerate(words) if n in row} for n in ("message", "reason", "event"))
        self.firings = tuple(FiredRule(k, float(self.windows.t[k]), str(rule), str(text), dict(values))
                             for k, row in enumerate(words) for rule, text, values in row.get("fired", ()))
        self.iterates: np.recarray[Any, Any] = (
            f["iterates"][()] if "iterates" in f else np.zeros(0, list(ITERATE_FIELDS))).view(np.recarray)
        self.timings: np.recarray[Any, Any] = (
            f["timings"][()] if "timings" in f else np.zeros(0, list(TIMING_FIELDS))).view(np.recarray)
        self.calls: np.recarray[Any, Any] = (
            f["calls"][()] if "calls" in f else np.zeros(0, list(CALL_FIELDS))).view(np.recarray)
        self.estimates: np.recarray[Any, Any] = (
            f["estimates"][()] if "estimates" in f else np.zeros(0, list(ESTIMATE_FIELDS))).view(np.recarray)
        self.errors: np.recarray[Any, Any] = (
            f["errors"][()] if "errors" in f else np.zeros(0, list(ERROR_FIELDS))).view(np.recarray)
        # Of files before it was kept the start is not known.
        self.max_T = max([float(f.attrs.get("max_T", -np.inf)), *self.windows.max_T[self.windows.taken]])
        self.rewound: dict[str, float] = self.totals.get("rewound", {})
        self._monitors: dict[str, Array] = {n: d[()] for n, d in f["monitors"].items()}
        self._probes = {n: _ProbeSeries(d[()], str(d.attrs["unit"]), str(d.attrs["quantity"]))
                        for n, d in f["probes"].items()}
        self._terms: dict[str, Array] = {n: d[()] for n, d in f["ledger"].items()}
        self._conditions = {of.name: ConditionSeries(of, f["conditions"][of.name][()])
                            for of in map(condition_output, self.header.get("conditions", ()))}
        self.extremes: dict[str, Array] = {n: d[()] for n, d in f.get("ranges", {}).items()}
        self.confidence = read_confidence(f)
        self.contact = {n: Along(**{k: d[()] for k, d in g.items()}) for n, g in f.get("contact", {}).items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know though it is no error: of the scenario, then of what happened in the run."""
        return tuple(map(str, (*self.header.get("notes", ()), *self.totals.get("notes", ()),
                               *self.totals.get("restarts", ()))))

    @property
    def trust(self) -> tuple[Check, ...]:
        """What was measured of the run, check by check; empty for a file of an earlier version, or a killed run's."""
        return tuple(Check.of(row) for row in self.totals.get("trust", ()))

    @property
    def broken(self) -> tuple[Check, ...]:
        """The checks that say the answer is not to be trusted."""
        return broken(self.trust)

    @property
    def probe_errors(self) -> Mapping[str, ProbeError]:
        """Probe -> how far it may be off over the run, in SI, and its range (docs/trust.md); empty where none is known.

        Of a run without probes those of the mean temperatures of its bodies.
        """
        return {n: ProbeError(**row) for n, row in self.totals.get("probe_errors", {}).items()}

    @property
    def probe_names(self) -> tuple[str, ...]:
        return tuple(self._probes)

    def probe(self, name: str, unit: str | None = None) -> tuple[Array, Array]:
        """Return (t, value) of a probe, (n,) each: times [s] as in `t`, and values in SI.

        unit : convert to "degC", "mm", "MPa", ...  Raises ResultsError for an unknown probe or unit.
        """
        value, own = self._probe(name).values, self._probe(name).unit
        if unit is None or unit == own:
            return self.t, value
        if _KIND_OF_UNIT.get(unit) != own:
            fits = [u for u, k in _KIND_OF_UNIT.items() if k == own]
            raise ResultsError(f"probe {name!r} is in {own}; it cannot be given in {unit!r}, "
                               f"only in {', '.join(fits) or own}")
        factor, shift = UNITS[unit]
        return self.t, value * factor + shift

    def quantity(self, name: str) -> str:
        """T, u_x, u_y, gap, p, f_s or HALF.OUTPUT of a probe.  Raises ResultsError for an unknown probe."""
        return self._probe(name).quantity

    def unit(self, name: str) -> str:
        """The SI unit of a probe.  Raises ResultsError for an unknown probe."""
        return self._probe(name).unit

    def _probe(self, name: str) -> _ProbeSeries:
        if name not in self._probes:
            has = ", ".join(self._probes) or "none"
            raise ResultsError(f"{self.path} has no probe {name!r}; it has {has}")
        return self._probes[name]

    @property
    def conditions(self) -> dict[str, ConditionSeries]:
        """Heat and force of the named conditions, of sources and of pairs: `heat.NAME`, `reaction.NAME` -> over time.

        Empty for a file of an earlier version.
        """
        return dict(self._conditions)

    def condition(self, name: str) -> tuple[Array, Array]:
        """Return (t, values) of one of `conditions`, [s] and SI: (n,) and (n,), or (n, 2) of a force and of a pair.

        `heat.NAME` [J] into the body since the start; `heat.pair.NAME` into slave and master; `reaction.NAME` [N] along
        x and y on the body, `reaction_moment.NAME` [N m].  Raises ResultsError for an unknown name.
        """
        if name not in self._conditions:
            raise ResultsError(f"{self.path} has no {name!r}. {did_you_mean(name, self._conditions)}")
        return self.t, self._conditions[name].values

    @property
    def ledger(self) -> dict[str, float]:
        """Heat over the whole run [J] by mechanism, into the bodies; `stored.<body>` is what a body kept."""
        return {n: float(v[-1]) for n, v in self._terms.items() if v.size}

    def ledger_history(self) -> tuple[Array, dict[str, Array]]:
        """Return (t, mechanism -> heat so far), (n,) each, [s] and [J], at each of `t`."""
        return self.t, dict(self._terms)

    @property
    def heat_imbalance(self) -> float:
        """|sum of the ledger's terms| over the heat moved in the run: 0 where every joule is accounted for."""
        taken = self.windows.imbalance[self.windows.taken]
        return float(taken[-1]) if taken.size else 0.0

    @property
    def seconds_by_part(self) -> dict[str, float]:
        """Where the wall-clock seconds went; the coupler's are what is left when all others are taken out.

        Each half has its own, so seconds in which both worked (`overlap_seconds`) count twice.
        """
        w = self.windows
        parts = {name: float(w[column].sum()) + self.rewound.get(column, 0.0) for name, column in (
            ("thermal half", "thermal_seconds"), ("mechanical half", "mechanical_seconds"),
            ("FMI and transport", "fmi_seconds"), ("recording", "recording_seconds"))}
        # A killed run left no totals: its windows are then all that is known.
        total = float(self.totals.get("seconds", w.seconds.sum() + parts["recording"]))
        return parts | {"coupler": max(total + self.overlap_seconds - sum(parts.values()), 0.0),
                        "set-up": float(self.totals.get("setup_seconds", 0.0))}

    @property
    def overlap_seconds(self) -> float:
        """Wall-clock seconds in which both halves worked at the same time; 0 in files that did not record it."""
        return float(np.nansum(self.timings.overlap)) if "overlap" in (self.timings.dtype.names or ()) else 0.0

    @property
    def monitors(self) -> dict[str, Array]:
        """Return name -> value (n,) in SI at each of `t`; nan where one was not known.

        These are the monitors that rules of the run look at.
        """
        return dict(self._monitors)

    @property
    def fields(self) -> Fields:
        """HALF.NAME -> what was recorded at the frames: the exchange, and every array that a half gives out.

        >>> T = results.fields("T", t=12.5)

        Called, it gives the values of a field, at one time between the frames or at all of them (Fields).
        Of a file of an earlier version the units of a half's own fields are in its field files alone.
        """
        known = {(f.half, f.label): f for f in map(output_field, self.header.get("outputs", ()))}
        listed = {(half, name): on for half, about in self.header["fields"].items()
                  for at, on in (("point", On.NODES), ("cell", On.CELLS)) for name in about[at]}
        exchanged = {(half, f.name): f for half, fields in EXCHANGED.items() for f in fields}
        found = {}
        for (half, name), on in (listed | {key: f.on for key, f in known.items()}).items():
            own = exchanged.get((half, name), FileField(name))
            field = known.get((half, name)) or OutputField(half, name, name, on, (0, own.components), own.unit)
            found[f"{half}.{name}"] = field
        return Fields(found, self)

    def field(self, name: str) -> tuple[Array, Array]:
        """Return (t, values) of a field: times of frames (n_t,) [s] and, for each, the array in SI as the half gave it.

        name : HALF.NAME, one of `fields`.  values : (n_t, n_nodes), (n_t, n_nodes, k), or of cells, bodies, ...; of
        contact nodes : at all nodes, NaN where there is no contact surface.  All frames are read into memory.
        Raises ResultsError for an unknown field, and where its field file is missing.
        """
        fields = self.fields
        if name not in fields:
            near = difflib.get_close_matches(name, fields, 1)
            raise ResultsError(f"{self.path} has no field {name!r}"
                               + (f"; did you mean {near[0]!r}?" if near else f"; it has {', '.join(fields)}"))
        field = fields[name]
        if field.on in (On.BODIES, On.NOTHING):
            try:
                with h5py.File(self.path, "r") as f:
                    return f["fields/t"][()], f[f"fields/{field.half}/{field.label}"][()]
            except (OSError, KeyError, RuntimeError) as exc:
                raise ResultsError(f"{self.path}: its field {name} cannot be read ({reason_of(exc)})") from exc
        with FieldReader(self.field_files[field.half]) as file:
            read = file.cell_field if field.on is On.CELLS else file.point_field
            frames = [in_plane(read(field.label, k), field.components) for k in range(len(file.times))]
            return file.times, np.array(frames)

    def mesh(self) -> RunMesh:
        """Return the mesh as it was before anything moved.  Raises ResultsError for a file of an earlier version."""
        try:
            with h5py.File(self.path, "r") as f:
                parts = {n: f[f"mesh/{n}"][()] for n in ("nodes", "quads", "triangles", "quad_body", "triangle_body")}
        except (OSError, KeyError, RuntimeError) as exc:
            raise ResultsError(f"{self.path}: its mesh cannot be read ({reason_of(exc)})") from exc
        return RunMesh(**parts, bodies=tuple(self.header["bodies"]))

    def surface(self, name: str) -> RunSurface:
        """Return a named surface, its nodes in order.  Raises ResultsError for an unknown one and an older file."""
        try:
            with h5py.File(self.path, "r") as f:
                group = f["mesh/surfaces"]
                if name not in group:
                    raise ResultsError(f"{self.path} has no surface {name!r}. {did_you_mean(name, list(group))}")
                nodes, s = unrolled(group[name][()], f["mesh/nodes"][()])
                return RunSurface(name, nodes, s, f["mesh/nodes"][()][nodes])
        except (OSError, KeyError, RuntimeError) as exc:
            raise ResultsError(f"{self.path}: its surfaces cannot be read ({reason_of(exc)})") from exc

    def to_pandas(self) -> Any:
        """Return a pandas DataFrame over time; see coupler.record.access.to_pandas."""
        return access.to_pandas(self)

    def to_xarray(self) -> Any:
        """Return an xarray Dataset with the fields; see coupler.record.access.to_xarray."""
        return access.to_xarray(self)

    def to_pyvista(self, t: float | str | None = None) -> Any:
        """Return a pyvista UnstructuredGrid at a time [s]; see coupler.record.access.to_pyvista."""
        return access.to_pyvista(self, t)

    def plot(self, *names: str, unit: str | None = None) -> Any:
        """Draw probes over time and return matplotlib axes; see coupler.record.access.plot."""
        return access.plot(self, *names, unit=unit)

    def __repr__(self) -> str:
        return access.line(self)

    def _repr_html_(self) -> str:
        return access.html(self)

    @property
    def field_files(self) -> dict[str, Path]:
        """The .vtkhdf file of each half."""
        return {half: self.path.with_name(name) for half, name in self.header["field_files"].items()}


def depth_of(results: Results) -> str:
    """To what a run's energies and forces refer."""
    return "over the full circle" if results.header["geometry"] == "axisymmetric" else "per metre of depth"


def iteration_words(results: Results) -> str:
    """How much the windows iterated, in words; empty for a scheme that does not."""
    w = results.windows[results.windows.taken & (results.windows.iterations > 0)]
    if not len(w):
        return ""
    known = w.contraction[np.isfinite(w.contraction)]
    text = f"{w.iterations.mean():.1f} iterations a window, {w.iterations.max()} at most"
    if len(known) and known.max() > 0.0:
        text += f", contraction of plain iteration up to {known.max():.3g}"
    at_max = int((w.verdict == "max iterations").sum())
    return text + (f"; {at_max} windows taken though they did not converge" if at_max else "")


def _recover(journal: Path, path: Path) -> None:
    """Make run.h5 from the journal of a killed run; nothing where somebody else has just done so."""
    with taken(journal) as mine:
        if mine and not path.exists():
            finish(journal, path)
        elif not path.exists():
            raise ResultsError(f"{path}: its run still goes on; the results file is made when it ends")
