"""Heat and force of the named conditions: tables, and curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.record.conditions import by_kind, kind_of, not_named, short_name
from coupler.record.results import ConditionSeries, Results, depth_of
from coupler.report.curves import LOW, kinks_of
from coupler.report.figures import (
    Picture,
    axes_of,
    axis_names,
    draw_kinks,
    legend_below,
    line_style,
    number,
    page_figure,
    plain,
    shown,
    svg,
)
from coupler.report.pack import Chart, Curve

Array = NDArray[np.float64]
CURVES = 8  # of a figure


@dataclass(frozen=True)
class ConditionRow:
    """A condition in words: name, kind, where it acts, and its numbers."""

    name: str
    kind: str
    place: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class ConditionTables:
    """unit : of heat.  heats : since the start.  pairs : into slave, into master.  unnamed : the rest, empty if none.

    along : names of the two axes.  forces : at the end along either, and the largest with its time.
    moments : likewise.
    """

    unit: str
    heats: list[ConditionRow]
    pairs: list[ConditionRow]
    unnamed: str
    along: tuple[str, str]
    forces: list[ConditionRow]
    moments: list[ConditionRow]
    depth: str


def condition_tables(results: Results) -> ConditionTables | None:
    """The conditions with a name, None where there is none, nor a source or a pair that gave heat."""
    heats, pairs, forces, moments = by_kind(results)
    pairs = [c for c in pairs if np.any(c.values)]
    if not (heats or pairs or forces or moments) or not len(results.t):
        return None
    scale = shown("J", max((float(np.abs(c.values[-1]).max()) for c in (*heats, *pairs)), default=0.0))

    def joules(value: float) -> str:
        return number(float(scale(np.array(value))), 6)

    rest = not_named(results)
    return ConditionTables(
        scale.unit, [_row(c, (joules(float(c.values[-1])),)) for c in heats],
        [_row(c, tuple(joules(float(v)) for v in c.values[-1])) for c in pairs],
        joules(rest) if rest else "", axis_names(str(results.header["geometry"])),
        [_row(c, (*(number(float(v), 6) for v in c.values[-1]), *_largest(results, c))) for c in forces],
        [_row(c, (number(float(c.values[-1]), 6), *_largest(results, c))) for c in moments], depth_of(results))


def _row(series: ConditionSeries, values: tuple[str, ...]) -> ConditionRow:
    return ConditionRow(short_name(series), kind_of(series), series.of.place, values)


def _largest(results: Results, series: ConditionSeries) -> tuple[str, str]:
    """The largest size of a force or moment, and when."""
    size = np.abs(series.values) if series.values.ndim == 1 else np.linalg.norm(series.values, axis=1)
    at = int(np.argmax(size))
    return number(float(size[at]), 6), number(float(results.t[at]), 6)


def condition_pictures(results: Results) -> list[Picture]:
    """Heat by condition, and force by condition, over time; [] where there is none."""
    heats, pairs, forces, _ = by_kind(results)
    if len(results.t) < 2:
        return []
    along = axis_names(str(results.header["geometry"]))
    curves = [(c.of.name.partition(".")[2], c.values) for c in heats]
    curves += [(f"{c.of.name.partition('.')[2]}, into the slave", c.values[:, 0]) for c in pairs]
    found = [_picture(results, "J", "heat into the body so far", curves)]
    curves = [(f"{c.of.name.partition('.')[2]}, {along[i]}", c.values[:, i]) for c in forces for i in range(2)]
    found.append(_picture(results, "N", "force on the body", curves))
    return [picture for picture in found if picture is not None]


def _picture(results: Results, unit: str, what: str, curves: Sequence[tuple[str, Array]]) -> Picture | None:
    curves = [(name, values) for name, values in curves if np.any(values)]
    if not curves:
        return None
    drawn = sorted(curves, key=lambda c: -float(np.abs(c[1]).max()))[:CURVES]
    scale = shown(unit, float(np.abs(drawn[0][1]).max()))
    figure = page_figure(LOW)
    ax = axes_of(figure, "time [s]", f"{what} [{scale.unit}]\n{depth_of(results)}")
    for k, (name, values) in enumerate(drawn):
        ax.plot(results.t, scale(values), label=plain(name), **line_style(k))
    ax.set_xlim(float(results.t[0]), float(results.t[-1]))
    draw_kinks(ax, kinks_of(results))
    legend_below(figure, ax, columns=3)
    ends = "; ".join(f"{name} {scale.text(float(values[-1]))} at last" for name, values in drawn)
    more = f" The {CURVES} largest of {len(curves)}; all are in the table." if len(curves) > CURVES else ""
    alt = f"{what[0].upper()}{what[1:]} by named condition against time: {ends}."
    caption = f"{what[0].upper()}{what[1:]} through each named condition, {depth_of(results)}.{more}"
    return replace(svg(figure, alt, caption),
                   chart=Chart(f"{what} [{scale.unit}]", alt, results.t, [Curve(n, scale(v)) for n, v in drawn], 230))

