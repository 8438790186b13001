"""The page of two runs side by side: one sentence, a chart a quantity with the difference below it, two tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from coupler.record.results import Results
from coupler.report.compare import Comparison, Difference, compare
from coupler.report.curves import name_of
from coupler.report.figures import (
    COLOURS,
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
from coupler.schemes.state import PREFIX, mechanism

TEMPLATE = "comparison.html.j2"
HEIGHT = 6.0  # inches, curves and their difference together
FILE = "as in the file"
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
    return put_page(path, lambda: _render(c, (a, b), told), a, b), told


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
        outcomes=[(n, run.outcome) for n, run in zip(names, runs, strict=True) if run.outcome != "completed"])


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
    figure = page_figure(HEIGHT)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    styled(above, "", f"{what} [{values.unit}]")
    styled(below, "time [s]", f"difference [{apart.unit}]")
    for k, d in enumerate(ds):
        c, colour = d.curves, COLOURS[k % len(COLOURS)]
        above.plot(c.t, values(c.a), color=colour, linewidth=2.0, label=plain(c.name))
        above.plot(c.t, values(c.b), color=colour, linewidth=1.6, linestyle="--")
        below.plot(c.t, apart(c.b - c.a), color=colour, linewidth=1.6)
        below.plot([d.t], [float(apart(np.array(d.by)))], color=colour, marker="o", markersize=5)
    below.set_xlim(float(ds[0].curves.t[0]), float(ds[0].curves.t[-1]))
    legend_below(figure, above)
    said = "; ".join(f"{d.curves.name} {apart.text(d.by, 3)} at {number(d.t, 6)} s" for d in ds[:6])
    caption = (f"{what[0].upper()}{what[1:]}: {names[0]} in full lines, {names[1]} dashed; below, {names[1]} minus "
               f"{names[0]}, its largest value marked.")
    return svg(figure, f"{caption} {said}.", caption)
