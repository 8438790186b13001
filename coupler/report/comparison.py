"""Two runs side by side: by how much each probe differs, when and where, and the page that shows it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.errors import ResultsError
from coupler.record.results import Results
from coupler.report.curves import name_of
from coupler.report.figures import (
    COLOURS,
    PageFigure,
    Picture,
    Shown,
    counted,
    legend_below,
    number,
    page_figure,
    plain,
    shown,
    styled,
    svg,
)
from coupler.report.page import put_page, template_of
from coupler.schemes.ledger import PREFIX, mechanism

Array = NDArray[np.float64]


# Two runs side by side: by how much each probe differs, when and where.  Values in, values out; no figures here.

@dataclass(frozen=True)
class ProbeCurves:
    """One probe of both runs at the same times.

    t : (n,) [s], every end of a window of either run, up to the earlier end.  a, b : (n,) in `unit` (SI), linear in
    between; not a number where a gap faces nothing.  place : where it is taken, in the scenario's words; where the
    two runs take it at different places, both.
    told : (n,) True where both runs tell something: see `told_by_both`.
    line : (n,) in `unit`, how far the straight lines of both may be off there.
    """

    name: str
    quantity: str
    unit: str
    place: str
    t: Array
    a: Array
    b: Array
    told: NDArray[np.bool_]
    line: Array


@dataclass(frozen=True)
class Difference:
    """Where b is farthest from a, of what both tell: at t [s], b - a = by (SI)."""

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
            # Of two that differ by round-off the first is told, on every machine.
            if known is None or abs(d.by) > abs(known.by) * (1.0 + TIE):
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
    told = told_by_both(a.t, b.t, t)
    found = {n: _difference(_curves(a, b, n, t, told)) for n in a.probe_names if _alike(a, b, n)}
    differences = {n: d for n, d in found.items() if d is not None}
    if not differences:
        raise ResultsError(f"{a.path} and {b.path} have no probe in common: {', '.join(a.probe_names) or 'none'} "
                           f"against {', '.join(b.probe_names) or 'none'}. Give two runs of one scene")
    only = [tuple(n for n in run.probe_names if n not in differences) for run in (a, b)]
    return Comparison(until, tuple(differences.values()), only[0], only[1], _heats(a, b, until))


def _alike(a: Results, b: Results, name: str) -> bool:
    return name in b.probe_names and a.quantity(name) == b.quantity(name)


def told_by_both(of_a: Array, of_b: Array, t: Array) -> NDArray[np.bool_]:
    """(n,) which of the times t [s] tell two runs apart: ends of both, else of the longer of the two windows there.

    of_a, of_b : (n_a,), (n_b,) [s] ends of windows, ascending.  Inside a window a run says nothing: the straight line
    through one is off by its curvature, which is no difference of the runs.  The line through the shorter is the better
    one, so the end of a window is held against the line through one that is no longer, never the other way round.
    """
    return _held(of_a, of_b, t) | _held(of_b, of_a, t)


def _held(own: Array, other: Array, t: Array) -> NDArray[np.bool_]:
    """(n,) whether t is an end of `own`, and the window of `other` around it none or no longer than own's beside it."""
    def sides(ends: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        first = np.searchsorted(ends, t, side="left").clip(max=len(ends) - 1)
        at = ends[first] == t
        return ends[np.maximum(first - 1, 0)], ends[np.where(at, np.minimum(first + 1, len(ends) - 1), first)], at

    (before, after, is_own), (left, right, is_other) = sides(own), sides(other)
    # fault: compare: inside a long window its straight line counts -> return is_own | coupler/test_compare
    return is_own & (is_other | (right - left <= np.maximum(t - before, after - t) * (1.0 + TIE)))


def _curves(a: Results, b: Results, name: str, t: Array, told: NDArray[np.bool_]) -> ProbeCurves:
    places = dict.fromkeys(p for p in (place_of(a, name), place_of(b, name)) if p)
    return ProbeCurves(name, a.quantity(name), a.unit(name), " / ".join(places), t, _at(a, name, t), _at(b, name, t),
                       told, off_line(*a.probe(name), t) + off_line(*b.probe(name), t))


def off_line(own: Array, value: Array, t: Array) -> Array:
    """How far the straight line between two of own : (m,) [s] may be off at t : (n,) [s]; 0 at both.

    value : (m,) there.  By the second difference over the window and one beside it, of the two the lesser: a kink at an
    end of a window bends nothing inside.
    """
    if len(own) < 3:
        return np.zeros(len(t))
    steps = np.diff(own)
    slope = np.diff(value) / steps
    # fault: compare: a straight line is taken for the curve -> bend = np.zeros(len(own) - 2) | coupler/test_compare
    #   coupler/test_verdict
    bend = np.abs(np.diff(slope)) / (own[2:] - own[:-2])
    window = (np.searchsorted(own, t, side="right") - 1).clip(0, len(steps) - 1)
    lesser = np.minimum(bend[(window - 1).clip(0)], bend[window.clip(max=len(bend) - 1)])
    return np.nan_to_num(lesser * np.maximum((t - own[window]) * (own[window + 1] - t), 0.0), nan=0.0)


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
    """Where |b - a| is largest of what both tell, the first time; None where there are never two values."""
    off = np.where(c.told, np.abs(c.b - c.a), np.nan)
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


# The page of two runs side by side: one sentence, a chart a quantity with the difference below it, two tables.

TEMPLATE = "comparison.html.j2"
HEIGHT = 6.0  # inches, curves and their difference together
FILE = "as in the file"
TIE = 1e-9
ROUND_OFF = 1e-12  # of the largest value: what is less is not called a difference in the sentence


@dataclass(frozen=True)
class DifferenceText:
    """A row of the table: a probe, its largest difference and where it is."""

    name: str
    place: str
    by: str
    t: str
    a: str
    b: str


def write_comparison(a: Results, b: Results, path: Path) -> tuple[Path, str]:
    """Write the page that holds run b against run a to `path`; return it with the sentence it begins with.

    Raises ResultsError where the runs have nothing in common, or the page cannot be written.
    """
    c = compare(a, b)
    names, unit = short_names(a, b), a.header["temperature_unit"]
    told = sentence(c, names, unit, str(a.header["geometry"]))
    # fault: a comparison keeps to itself that a run is not to be trusted -> words = "" | coupler/test_compare
    words = "".join(f"\n  do not trust {n}: {text}" for n, text in distrusted(a, b))
    return put_page(path, lambda: _render(c, (a, b), told), a, b), told + words


def distrusted(a: Results, b: Results) -> list[tuple[str, str]]:
    """Return (name, what is broken in words) of each run that is not to be trusted (docs/trust.md)."""
    return [(n, "; ".join(f"{c.name}: {c.what}" for c in run.broken))
            for n, run in zip(short_names(a, b), (a, b), strict=True) if run.broken]


def short_names(a: Results, b: Results) -> tuple[str, str]:
    """What to call the runs: their files' names, with the folders where these are the same."""
    return (a.path.name, b.path.name) if a.path.name != b.path.name else (str(a.path), str(b.path))


def sentence(c: Comparison, names: tuple[str, str], temperature_unit: str, geometry: str = "plane") -> str:
    """The largest difference of each quantity, with probe, time and both values, in one sentence."""
    a, b = names
    apart = [d for d in c.largest() if abs(d.by) > ROUND_OFF * max(abs(d.a), abs(d.b))]
    if not apart:
        return f"{b} agrees with {a} in {counted(len(c.differences), 'probe')} up to t = {number(c.until, 6)} s."
    parts = []
    for d in apart:
        row = told_of(d, temperature_unit)
        where = f" at {row.place}" if row.place not in ("", row.name) else ""
        # fault: compare: an axisymmetric scene in x and y -> what = name_of(d.curves.quantity, "plane") |
        #   coupler/test_compare
        what = name_of(d.curves.quantity, geometry)
        parts.append(f"{row.by} in {what} ({row.name}{where}, t = {row.t}: {row.b} against {row.a})")
    listed = parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
    return f"{b} differs from {a} by up to {listed}."


def told_of(d: Difference, temperature_unit: str) -> DifferenceText:
    """A difference in words.  Of temperatures the difference is in K, whatever the unit of the values."""
    values, apart = scales([d], temperature_unit)
    return DifferenceText(d.curves.name, d.curves.place, apart.text(abs(d.by), 3), f"{number(d.t, 6)} s",
                          values.text(d.a), values.text(d.b))


def scales(ds: Sequence[Difference], temperature_unit: str) -> tuple[Shown, Shown]:
    """How to show the values of curves of one quantity, and how their differences."""
    unit = ds[0].curves.unit
    largest = max(float(np.nanmax(np.abs([d.curves.a, d.curves.b]))) for d in ds)
    return shown(unit, largest, temperature_unit), replace(shown(unit, max(abs(d.by) for d in ds)), shift=0.0)


def _render(c: Comparison, runs: tuple[Results, Results], told: str) -> str:
    a, b = runs
    names, unit, geometry = short_names(a, b), a.header["temperature_unit"], str(a.header["geometry"])
    heat = shown("J", max((abs(v) for both in c.heats.values() for v in both), default=0.0))
    heats = [(mechanism(PREFIX + n), *(number(float(heat(np.array(v)))) for v in (x, y, y - x)))
             for n, (x, y) in c.heats.items()]
    return template_of(TEMPLATE).render(
        title=a.header["title"], names=names, sentence=told, until=number(c.until, 6),
        rows=[told_of(d, unit) for d in c.differences], pictures=_pictures(c, names, unit, geometry),
        heats=heats, heat_unit=heat.unit, only=((names[0], c.only_a), (names[1], c.only_b)), changes=changes(a, b),
        outcomes=[(n, run.outcome) for n, run in zip(names, runs, strict=True) if run.outcome != "completed"],
        distrusted=distrusted(*runs))


def changes(a: Results, b: Results) -> list[tuple[str, str, str]]:
    """What was asked for on the command line of each run beyond its file, where they differ: (key, a, b)."""
    of_a, of_b = (dict(run.header["scenario"].get("overrides") or {}) for run in (a, b))
    keys = [k for k in dict.fromkeys((*of_a, *of_b)) if of_a.get(k) != of_b.get(k)]
    return [(k, str(of_a.get(k, FILE)), str(of_b.get(k, FILE))) for k in keys]


def _pictures(c: Comparison, names: tuple[str, str], temperature_unit: str, geometry: str) -> list[Picture]:
    by_quantity: dict[str, list[Difference]] = {}
    for d in c.differences:
        by_quantity.setdefault(d.curves.quantity, []).append(d)
    return [_picture(ds, names, temperature_unit, name_of(ds[0].curves.quantity, geometry))
            for _, ds in sorted(by_quantity.items(), key=lambda item: item[0] != "T")]


def _picture(ds: list[Difference], names: tuple[str, str], temperature_unit: str, what: str) -> Picture:
    """Above, the curves: a solid, b dashed, a colour a probe.  Below, b - a, with its largest value marked."""
    values, apart = scales(ds, temperature_unit)
    figure = difference_figure(ds, values, apart, what)
    said = "; ".join(f"{d.curves.name} {apart.text(d.by, 3)} at {number(d.t, 6)} s" for d in ds[:6])
    caption = (f"{what[0].upper()}{what[1:]}: {names[0]} in full lines, {names[1]} dashed; below, {names[1]} minus "
               f"{names[0]}, at the times that both tell, its largest value marked.")
    return svg(figure, f"{caption} {said}.", caption)


def difference_figure(ds: list[Difference], values: Shown, apart: Shown, what: str) -> PageFigure:
    """Draw the curves and, below them, their differences.  values, apart : how both are shown.  what : the quantity."""
    figure = page_figure(HEIGHT)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    styled(above, "", f"{what} [{values.unit}]")
    styled(below, "time [s]", f"difference [{apart.unit}]")
    below.ticklabel_format(axis="y", scilimits=(-2, 4))  # -0.00025 beside an axis lies across its name
    for k, d in enumerate(ds):
        c, colour = d.curves, COLOURS[k % len(COLOURS)]
        above.plot(c.t, values(c.a), color=colour, linewidth=2.0, label=plain(c.name))
        above.plot(c.t, values(c.b), color=colour, linewidth=1.6, linestyle="--")
        # Between the ends of its windows a run says nothing: there a straight line differs from a curve.
        # fault: the difference is drawn between the ends of windows too -> t, off = c.t, c.b - c.a |
        #   coupler/test_compare
        t, off = c.t[c.told], (c.b - c.a)[c.told]
        below.plot(t, apart(off), color=colour, linewidth=1.6)
        below.plot([d.t], [float(apart(np.array(d.by)))], color=colour, marker="o", markersize=5)
    below.set_xlim(float(ds[0].curves.t[0]), float(ds[0].curves.t[-1]))
    legend_below(figure, above)
    return figure
