"""Two runs side by side: by how much each probe differs, when and where.  Values in, values out; no figures here."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.errors import ResultsError
from coupler.record.results import Results

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ProbeCurves:
    """One probe of both runs at the same times.

    t : (n,) [s], every end of a window of either run, up to the earlier end.  a, b : (n,) in `unit` (SI), linear in
    between; not a number where a gap faces nothing.  place : where it is taken, in the scenario's words; where the
    two runs take it at different places, both.
    """

    name: str
    quantity: str
    unit: str
    place: str
    t: Array
    a: Array
    b: Array


@dataclass(frozen=True)
class Difference:
    """Where b is farthest from a: at t [s], b - a = by (SI)."""

    curves: ProbeCurves
    t: float
    a: float
    b: float

    @property
    def by(self) -> float:
        # fault: two runs compared the wrong way round -> return self.a - self.b | coupler/test_compare
        return self.b - self.a


@dataclass(frozen=True)
class Comparison:
    """Two runs against each other: differences by probe, in the first run's order; heats: mechanism -> (a, b) [J].

    only_a, only_b : probes that just one run has, or that measure something else in the other, or that never have a
    value in both at once.  until : the earlier of the two ends [s].
    """

    until: float
    differences: tuple[Difference, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    heats: dict[str, tuple[float, float]]

    def largest(self) -> tuple[Difference, ...]:
        """The largest difference of each quantity, in the order in which quantities come."""
        best: dict[str, Difference] = {}
        for d in self.differences:
            known = best.get(d.curves.quantity)
            if known is None or abs(d.by) > abs(known.by):
                best[d.curves.quantity] = d
        return tuple(best.values())


def compare(a: Results, b: Results) -> Comparison:
    """Hold run b against run a, probe by probe, over the time that both cover, and heat by heat.

    Heats are those at `until`.  Raises ResultsError where they have no probe in common, or no time.
    """
    if not len(a.t) or not len(b.t):
        raise ResultsError(f"{(b if len(a.t) else a).path}: the run ended before its first window; nothing to compare")
    low, until = max(float(a.t[0]), float(b.t[0])), min(float(a.t[-1]), float(b.t[-1]))
    # fault: two runs compared at the times of one -> t = a.t | coupler/test_compare
    t = np.union1d(a.t, b.t)
    t = t[(t >= low) & (t <= until)]
    if not len(t):
        raise ResultsError(f"{a.path} and {b.path} have no time in common")
    found = {n: _difference(_curves(a, b, n, t)) for n in a.probe_names if _alike(a, b, n)}
    differences = {n: d for n, d in found.items() if d is not None}
    if not differences:
        raise ResultsError(f"{a.path} and {b.path} have no probe in common: {', '.join(a.probe_names) or 'none'} "
                           f"against {', '.join(b.probe_names) or 'none'}")
    only = [tuple(n for n in run.probe_names if n not in differences) for run in (a, b)]
    return Comparison(until, tuple(differences.values()), only[0], only[1], _heats(a, b, until))


def _alike(a: Results, b: Results, name: str) -> bool:
    return name in b.probe_names and a.quantity(name) == b.quantity(name)


def _curves(a: Results, b: Results, name: str, t: Array) -> ProbeCurves:
    places = dict.fromkeys(p for p in (place_of(a, name), place_of(b, name)) if p)
    return ProbeCurves(name, a.quantity(name), a.unit(name), " / ".join(places), t, _at(a, name, t), _at(b, name, t))


def _at(run: Results, name: str, t: Array) -> Array:
    """(n,) a probe at times t; a gap of gap_max faces nothing, and between it and a true gap there is no line."""
    own, value = run.probe(name)
    if run.quantity(name) == "gap":
        nothing = np.isin(value, [float(p["gap_max"]) for p in run.header["pairs"]])
        # fault: a surface that faces nothing has a gap of gap_max -> value = np.where(nothing, value, value) |
        #   coupler/test_compare
        value = np.where(nothing, np.nan, value)
    exact = np.searchsorted(own, t).clip(max=len(own) - 1)
    # np.interp at a node next to one without a value would lose it too: 0 times nothing is nothing.
    return np.where(own[exact] == t, value[exact], np.interp(t, own, value))


def _difference(c: ProbeCurves) -> Difference | None:
    """Where |b - a| is largest, the first time; None where there are never two values."""
    off = np.abs(c.b - c.a)
    if np.isnan(off).all():
        return None
    k = int(np.nanargmax(off))
    return Difference(c, float(c.t[k]), float(c.a[k]), float(c.b[k]))


def _heats(a: Results, b: Results, until: float) -> dict[str, tuple[float, float]]:
    """mechanism -> heat so far of either run [J] at `until`; what moved none in either is left out."""
    (ta, of_a), (tb, of_b) = a.ledger_history(), b.ledger_history()

    def at(t: Array, terms: dict[str, Array], name: str) -> float:
        return float(np.interp(until, t, terms[name])) if name in terms and len(terms[name]) else 0.0

    both = {n: (at(ta, of_a, n), at(tb, of_b, n)) for n in dict.fromkeys((*of_a, *of_b))}
    return {n: heats for n, heats in both.items() if any(heats)}


def place_of(run: Results, name: str) -> str:
    """Where a probe is taken, as its scenario says it: "lid.top.centre", "max of lid.bottom"; "" if unknown."""
    resolved: dict[str, Any] = run.header["scenario"].get("resolved") or {}
    place = resolved.get("probes", {}).get(name, {}).get(run.quantity(name), "")
    if isinstance(place, str):
        return place
    if "at" in place:
        return f"{place.get('body', '')} at ({', '.join(f'{v:g}' for v in place['at'])})".strip()
    kind, of = next(iter(place.items()))
    return f"{kind} of {of if isinstance(of, str) else json.dumps(of)}"
