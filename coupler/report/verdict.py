"""Whether two runs of one scene say the same: the scene first, then probes and fields against what is allowed.

What is allowed is what was asked for, or what both runs say they may be off by (coupler.trust.in_time.errors), but
never less than a part of the values that no estimate of windows sees: tolerances of solvers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.problem.values import did_you_mean
from coupler.errors import ResultsError, ScenarioError
from coupler.fmu.units import COMMON
from coupler.record.results import Results
from coupler.report.comparison import Comparison, compare
from coupler.report.curves import NAMES
from coupler.report.figures import number

# fault: who compares two runs waits for what reads a scenario -> from coupler.scenario.probes import step_output |
#   coupler/test_cli_start
from coupler.scenario.of_a_step import step_output

Array = NDArray[np.float64]

UNSEEN = 1e-5  # of the size of what is solved for: what solvers leave over, which no error of windows tells
# Keys of a scenario that say how it is solved, not what: halves and their settings, meshes, windows, what is recorded.
HOW = ("title", "coupling", "output", "probes", "rules", "thermal.half", "thermal.options", "thermal.ignore",
       "thermal.meshes", "thermal.method", "thermal.theta", "thermal.adaptive", "thermal.increments",
       "thermal.tolerance",
       "mechanical.half", "mechanical.options", "mechanical.ignore", "mechanical.meshes", "mechanical.elastic.method",
       "mechanical.elastic.tolerance", "mechanical.elastic.cuts", "mechanical.elastic.element",
       "mechanical.elastic.skip")
MESH = ".mesh.rectangle.cells"
# Recorded fields that are judged: name -> the quantity whose bounds they take.
FIELDS = {"thermal.T": "T", "mechanical.u": "u", "mechanical.p": "p", "mechanical.gap": "gap"}


@dataclass(frozen=True)
class Bound:
    """How far apart two runs may be: value in SI, or as a part of the range."""

    value: float
    of_range: bool = False

    def of(self, low: float, high: float) -> float:
        """Return it in SI for values that lie between low and high."""
        return self.value * (high - low) if self.of_range else self.value


def bounds_of(text: str) -> dict[str, Bound]:
    """Return the bounds of `T=1K,p=1%,u_y=2mm` by quantity or probe.  Raises ScenarioError for what is no such text."""
    found = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        name, _, value = part.partition("=")
        numeric = next((value[:k] for k in range(len(value), 0, -1) if _is_number(value[:k])), "")
        unit = value[len(numeric):].strip()
        factor = {"%": 1e-2, "": 1.0, "K": 1.0, "m": 1.0, "Pa": 1.0, "J": 1.0, "s": 1.0}.get(unit)
        if factor is None and unit in COMMON:
            factor = COMMON[unit][1].factor  # of a difference: no offset
        if not name or not numeric or factor is None or float(numeric) < 0.0:
            raise ScenarioError("a bound is QUANTITY=NUMBER with a unit or %", key="--within", value=part,
                                remedy="Write --within T=1K,p=1%, quantities or names of probes")
        found[name.strip()] = Bound(float(numeric) * factor, unit == "%")
    return found


def _is_number(text: str) -> bool:
    try:
        return np.isfinite(float(text)).item()
    except ValueError:
        return False


@dataclass(frozen=True)
class Judged:
    """One probe or field held against its bound.

    name : of it.  off : how far apart the runs are (of a field the root mean square over its nodes), at t [s], where.
    most : of a field the largest difference of a node.  allowed : the bound.  All in `unit`.  first : the time [s]
    from which on it is more than allowed, None where it never is.
    """

    name: str
    unit: str
    off: float
    t: float
    allowed: float
    first: float | None
    where: str = ""
    most: float | None = None

    @property
    def share(self) -> float:
        """off as a part of what is allowed."""
        return self.off / self.allowed if self.allowed > 0.0 else (0.0 if self.off == 0.0 else np.inf)


@dataclass(frozen=True)
class Verdict:
    """What became of a comparison.

    changed : keys of the scene that differ, with both values: then nothing is judged.  judged : in order.
    unjudged : names of which nobody knows how far they may be off.  meshes : whether both runs have one mesh.
    """

    changed: tuple[tuple[str, str, str], ...]
    judged: tuple[Judged, ...]
    unjudged: tuple[str, ...]
    meshes: bool

    @property
    def apart(self) -> tuple[Judged, ...]:
        """What is farther apart than allowed, the earliest first."""
        return tuple(sorted((j for j in self.judged if j.first is not None), key=lambda j: j.first or 0.0))

    @property
    def differs(self) -> bool:
        """Whether two runs of one scene say different things."""
        # fault: runs that differ are the same -> return False | coupler/test_verdict
        return bool(self.apart)

    def text(self, names: tuple[str, str]) -> str:
        """The verdict in a sentence or two.  names : of the runs."""
        a, b = names
        if self.changed:
            listed = "; ".join(f"{key}: {x} against {y}" for key, x, y in self.changed[:5])
            more = f" and {len(self.changed) - 5} more" if len(self.changed) > 5 else ""
            return f"no verdict: {a} and {b} are of two scenes ({listed}{more})."
        left = f"; not judged, for no error of it is known: {', '.join(self.unjudged)} (give --within)" \
            if self.unjudged else ""
        left += "" if self.meshes else "; the meshes differ, so probes alone were compared"
        if not self.judged:
            return f"no verdict{left}."
        if not self.differs:
            worst = max(self.judged, key=lambda j: j.share)
            n = len(self.judged)
            return (f"{b} and {a} say the same within error: {n} of {n} probes and fields, at most "
                    f"{100 * worst.share:.2g} % of what is allowed ({_told(worst)}){left}.")
        first = self.apart[0]
        others = f"; so do {', '.join(j.name for j in self.apart[1:])}" if len(self.apart) > 1 else ""
        return (f"{b} differs from {a}, first at t = {number(first.first or 0.0, 6)} s, at {first.name}: "
                f"{_told(first)}{others}{left}.")


def _told(j: Judged) -> str:
    most = "" if j.most is None else f" (root mean square; {number(j.most, 3)} {j.unit} at most)"
    return (f"{j.name} {number(j.off, 3)} {j.unit}{most} at t = {number(j.t, 6)} s{j.where}, "
            f"{number(j.allowed, 3)} {j.unit} allowed")


def verdict(a: Results, b: Results, within: Mapping[str, Bound]) -> Verdict:
    """Hold run b against run a.  Raises ResultsError where they have nothing in common."""
    meshes = not _mesh_keys(a, b)
    if changed := tuple(_changed(a, b)):
        return Verdict(changed, (), (), meshes)
    comparison = compare(a, b)
    demand_names(within, {d.curves.name: d.curves.quantity for d in comparison.differences})
    judged, unjudged = _probes(a, b, comparison, within)
    if meshes:
        judged += _fields(a, b, within, judged)
    return Verdict((), tuple(judged), tuple(unjudged), meshes)


def demand_names(within: Mapping[str, Bound], probes: Mapping[str, str]) -> None:
    """Raise ScenarioError for a bound of what is no quantity, probe or field: it would be left out in silence.

    probes : their quantities by name.
    """
    known = dict.fromkeys([*NAMES, *FIELDS.values(), *probes.values(), *probes, *FIELDS])
    for name in within:
        # fault: a bound of nothing that there is is left out -> if False: | coupler/test_verdict
        if name not in known:
            raise ScenarioError("there is no quantity, probe or field of this name", key="--within", value=name,
                                remedy=did_you_mean(name, known))


# The scene

def _changed(a: Results, b: Results) -> Iterator[tuple[str, str, str]]:
    """Keys of the scene, not of how it is solved, that differ: (key, a, b)."""
    of_a, of_b = (dict(_flat(run.header["scenario"].get("resolved") or {})) for run in (a, b))
    for key in dict.fromkeys((*of_a, *of_b)):
        how = key.endswith(MESH) or any(key == h or key.startswith(f"{h}.") for h in HOW)
        # fault: two scenes are judged as one -> if False: | coupler/test_verdict
        if not how and of_a.get(key) != of_b.get(key):
            yield key, str(of_a.get(key, "not there")), str(of_b.get(key, "not there"))


def _mesh_keys(a: Results, b: Results) -> list[str]:
    of_a, of_b = (dict(_flat(run.header["scenario"].get("resolved") or {})) for run in (a, b))
    return [key for key in of_a if key.endswith(MESH) and of_a[key] != of_b.get(key)]


def _flat(tree: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(tree, Mapping):
        for name, inner in tree.items():
            yield from _flat(inner, f"{key}.{name}" if key else str(name))
    elif isinstance(tree, list) and any(isinstance(one, Mapping) for one in tree):
        for i, inner in enumerate(tree):
            yield from _flat(inner, f"{key}.{i}")
    else:
        yield key, tree


# Probes and fields

def _probes(a: Results, b: Results, c: Comparison, within: Mapping[str, Bound]) -> tuple[list[Judged], list[str]]:
    judged, unjudged = [], []
    temperatures = [d.curves.a for d in c.differences if d.curves.quantity == "T"]
    for d in c.differences:
        curve, name = d.curves, d.curves.name
        low, high = float(np.nanmin(curve.a)), float(np.nanmax(curve.a))
        unseen = UNSEEN * _size(curve.quantity, temperatures if curve.quantity == "T" else [curve.a])
        bound = within.get(name) or within.get(curve.quantity)
        known = [run.probe_errors[name].error for run in (a, b) if name in run.probe_errors]
        # fault: what one step moved is held against what another moved -> of_a_step = "" | coupler/test_verdict
        of_a_step = step_output(curve.quantity)
        if bound is None and (len(known) < 2 or of_a_step):
            unjudged.append(name)
            continue
        # fault: what both runs may be off by is not allowed -> allowed = max(0.0 * sum(known), unseen) |
        #   coupler/test_verdict
        allowed = bound.of(low, high) if bound is not None else max(sum(known), unseen)
        off = np.where(curve.told, np.maximum(np.abs(curve.b - curve.a) - curve.line, 0.0), np.nan)
        beyond, worst = off > allowed, int(np.nanargmax(off))
        first = float(curve.t[int(np.argmax(beyond))]) if beyond.any() else None
        judged.append(Judged(name, curve.unit, float(off[worst]), float(curve.t[worst]), allowed, first))
    return judged, unjudged


def _size(quantity: str, values: list[Array]) -> float:
    """How large what is solved for is, of which solvers leave a part: of temperatures their span, else of zero too.

    A pressure of 1 MPa that is held has no range, and is solved for to a part of 1 MPa all the same; 300 K and 0 degC
    are no zero of temperature, so of it all that run at once tell the span.
    """
    low, high = (float(f([f(v) for v in values])) for f in (np.nanmin, np.nanmax))
    # fault: what solvers leave of a pressure that is held is a difference -> return high - low | coupler/test_verdict
    return high - low if quantity == "T" else max(high, 0.0) - min(low, 0.0)


def _fields(a: Results, b: Results, within: Mapping[str, Bound], probes: list[Judged]) -> list[Judged]:
    """The exchanged fields, on contact surfaces where there are any, at the frames both have."""
    judged = []
    for name, quantity in FIELDS.items():
        if name not in a.fields or name not in b.fields:
            continue
        try:
            (ta, va), (tb, vb) = a.field(name), b.field(name)
        except ResultsError:
            continue  # a run without its field files is compared by its probes
        ia, ib = np.nonzero(np.abs(np.subtract.outer(ta, tb)) <= 1e-9 * max(abs(float(ta[-1])), 1e-300))
        if not len(ia) or va.shape[1:] != vb.shape[1:]:
            continue
        at = _surface_nodes(a)
        one, other = (v[i][:, at] if at is not None else v[i] for v, i in ((va, ia), (vb, ib)))
        one, other = (_faced(a, quantity, v).reshape(len(ia), -1) for v in (one, other))
        known = [j.allowed for j in probes if a.quantity(j.name).startswith(quantity)]
        bound = within.get(name) or within.get(quantity)
        if bound is None and not known:
            continue
        off = np.abs(other - one)
        some = ~np.isnan(off)
        if not some.any():
            continue
        low, high = float(np.nanmin(one)), float(np.nanmax(one))
        allowed = bound.of(low, high) if bound is not None else max(*known, UNSEEN * _size(quantity, [one]))
        count = np.maximum(some.sum(axis=1), 1)
        rms = np.sqrt((np.where(some, off, 0.0) ** 2).sum(axis=1) / count)
        k = int(np.argmax(rms))
        beyond = rms > allowed
        judged.append(Judged(name, a.fields[name].unit, float(rms[k]), float(ta[ia[k]]), allowed,
                             float(ta[ia[int(np.argmax(beyond))]]) if beyond.any() else None,
                             " on contact surfaces" if at is not None else "", float(np.nanmax(off))))
    return judged


def _surface_nodes(run: Results) -> NDArray[np.intp] | None:
    """Nodes that have a value of contact in some frame; None where there are none."""
    if "mechanical.p" not in run.fields or not run.header["pairs"]:
        return None
    _, p = run.field("mechanical.p")
    nodes = np.flatnonzero(~np.isnan(p).all(axis=0))
    return nodes if nodes.size else None


def _faced(run: Results, quantity: str, values: Array) -> Array:
    """Values without the gaps of what faces nothing."""
    if quantity != "gap":
        return values
    most = [float(pair["gap_max"]) for pair in run.header["pairs"]]
    return np.where(np.isin(values, most), np.nan, values)
