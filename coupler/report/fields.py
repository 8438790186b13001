"""Fields on the deformed bodies: temperature at chosen frames, von Mises stress where it is highest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from coupler.errors import ResultsError
from coupler.fmu.outputs import On, OutputField
from coupler.record.results import Results
from coupler.record.vtkhdf import FieldReader
from coupler.report.curves import kinks_of
from coupler.report.figures import (
    INK,
    PageFigure,
    Picture,
    Shown,
    axis_names,
    choose,
    named,
    number,
    page_figure,
    png,
    progress,
    shown,
)
from coupler.report.player import title_of

Array = NDArray[np.float64]
Ints = NDArray[np.integer]

MARGIN = 0.04
# Inches: beside and between panels, and the tallest of them.
LEFT, RIGHT, TOP, BOTTOM, BETWEEN, TALLEST = 0.65, 1.0, 0.32, 0.5, (0.2, 0.32), 5.0
WIDE, NARROW = 10.6, 6.0  # figures of several panels and of one
# Without the black end, on which no outline is seen.
COLD_TO_HOT = ListedColormap(colormaps["inferno"](np.linspace(0.12, 1.0, 256)))
ARROWS = 150  # more are a blur
ARROW = 0.75  # their length, of their mean distance
FAINT = 1e-3  # share of the largest flux below which a direction says nothing
LOUDEST = 0.98  # share of cells whose flux the colours tell apart
EVEN = 1.01  # times what the colours tell apart: no more than that is not beyond them
# Labels of fields that have pictures of their own; the size of more components than three says nothing.
DRAWN, MOST_COMPONENTS = frozenset(("T", "f_s", "q", "sigma_v", "u", "p", "gap")), 3
SMOOTH_UP_TO = 40_000  # triangles; a smooth picture of more takes seconds and shows no more


def field_pictures(results: Results) -> tuple[list[Picture], list[str]]:
    """Pictures of fields, and remarks on what cannot be shown."""
    pictures: list[Picture] = []
    remarks: list[str] = []
    for half, draw in (("thermal", _temperatures), ("mechanical", _stress)):
        if half not in results.field_files:
            continue
        try:
            with FieldReader(results.field_files[half]) as file:
                if len(file.times):
                    pictures += draw(results, file) + _other_fields(results, file, half)
                elif half == "thermal":
                    # fault: a run that goes on is told to have ended -> going = False | coupler/test_watch
                    going = results.outcome == "running"
                    remarks.append("There is no frame of fields yet." if going
                                   else "The run ended before its first frame of fields.")
        except ResultsError as exc:
            remarks.append(f"No pictures of the {half} fields: {exc}")
    return pictures, remarks


def _temperatures(results: Results, file: FieldReader) -> list[Picture]:
    if "T" not in file.point_fields:
        return []
    picks = choose(file.times, progress(file), kinks_of(results))
    T = [file.point_field("T", k) for k in picks]
    scale = shown("K", 0.0, results.header["temperature_unit"])
    low, high = min(float(v.min()) for v in T), max(float(v.max()) for v in T)
    limits = (float(scale(np.array(low))), float(scale(np.array(high))))
    axes = axis_names(str(results.header["geometry"]))
    figure = _frames(file, picks, [scale(v) for v in T], limits, f"temperature [{scale.unit}]", axes)
    narrow = figure.get_figwidth() <= NARROW
    times = ", ".join(f"{number(float(file.times[k]), 6)} s" for k in picks)
    near = ", those nearest to the breakpoints," if kinks_of(results) else ""
    pictures = [png(figure, f"Temperature of the bodies at t = {times}, from {scale.text(low)} to {scale.text(high)}.",
                    "Temperature on the deformed bodies (not magnified), one colour scale for all. "
                    f"Shown: the first and the last frame{near} and frames with the largest changes.", narrow)]
    if "f_s" in file.point_fields:
        f_s = [file.point_field("f_s", k) for k in picks]
        figure = _frames(file, picks, f_s, (0.0, 1.0), "solid fraction", axes)
        pictures.append(png(figure, f"Solid fraction of the bodies at t = {times}.",
                            "Solid fraction at the same times: 1 is solid (also bodies that do not melt).",
                            narrow))
    return pictures + _flux(file, axes)


def _frames(file: FieldReader, picks: Sequence[int], values: Sequence[Array], limits: tuple[float, float],
            label: str, axes: tuple[str, str]) -> PageFigure:
    """Values on the bodies at some frames, with one colour scale."""
    points = [file.points(k) for k in picks]
    panels = _panels(points, axes)
    for ax, x, value, k in zip(panels.axes, points, values, picks, strict=True):
        image = _paint(ax, panels.length(x), file, value, limits)
        ax.set_title(f"t = {number(float(file.times[k]), 4)} s", fontsize=10, color=INK)
    _bar(panels, image, label)
    return panels.figure


def _flux(file: FieldReader, axes: tuple[str, str]) -> list[Picture]:
    """The heat flux where it is largest in the mean: its size in colour, its direction in arrows."""
    if "q" not in file.cell_fields:
        return []
    # fault: flux pictured by one component -> sizes = [np.abs(file.cell_field("q", k)[:, 0]) for k in
    #   range(len(file.times))] | coupler/test_report
    sizes = [np.linalg.norm(file.cell_field("q", k), axis=1) for k in range(len(file.times))]
    k = int(np.argmax([size.mean() for size in sizes]))
    if not sizes[k].max() > 0:
        return []
    # A corner or a first contact may be a hundred times hotter than all else and would leave the rest dark.
    top = float(np.quantile(sizes[k], LOUDEST)) or float(sizes[k].max())
    scale = shown("W/m2", top)
    x = file.points(k)
    panels = _panels([x], axes)
    ax, x = panels.axes[0], panels.length(x)
    image = _paint(ax, x, file, scale(sizes[k]), (0.0, float(scale(np.array(top)))))
    _arrows(ax, x, file, file.cell_field("q", k)[:, :2])
    beyond = float(sizes[k].max()) > EVEN * top
    _bar(panels, image, f"heat flux [{scale.unit}]", extend="max" if beyond else "neither")
    t = number(float(file.times[k]), 6)
    text = f"Heat flux, mean of each cell, at t = {t} s, the frame where it is largest in the mean"
    return [png(panels.figure, f"{text}: up to {scale.text(float(sizes[k].max()))}.",
                  f"{text} (up to {scale.text(float(sizes[k].max()))}). Arrows: its direction.", narrow=True)]


def _arrows(ax: Axes, x: Array, file: FieldReader, q: Array) -> None:
    """Arrows of one length in at most some ARROWS cells; none where nothing flows."""
    centres = np.concatenate([x[file.quads].mean(axis=1), x[file.triangles].mean(axis=1)])
    size = np.linalg.norm(q, axis=1)
    step = max(1, math.ceil(len(q) / ARROWS))
    at = np.flatnonzero(size > FAINT * size.max())[::step]
    u, v = (q[at] / size[at, None]).T
    # As long as a cell of those shown: on a slender body arrows of a share of the width would be specks.
    apart = ARROW * float(np.sqrt(_area(x, file) / len(at)))
    ax.quiver(centres[at, 0], centres[at, 1], u, v, color="white", pivot="mid", angles="xy", units="xy",
              scale_units="xy", scale=1.0 / apart, width=0.09 * apart, edgecolor=INK, linewidth=0.4)


def _area(x: Array, file: FieldReader) -> float:
    """Of all cells together."""
    total = 0.0
    for cells in (file.quads, file.triangles):
        X, Y = x[cells, 0], x[cells, 1]
        total += 0.5 * float(np.abs((X * np.roll(Y, -1, axis=1) - Y * np.roll(X, -1, axis=1)).sum(axis=1)).sum())
    return total


def _stress(results: Results, file: FieldReader) -> list[Picture]:
    if "sigma_v" not in file.cell_fields:
        return []
    highest = [float(file.cell_field("sigma_v", k).max()) for k in range(len(file.times))]
    k = int(np.argmax(highest))
    if not highest[k] > 0:
        return []
    scale = shown("Pa", highest[k])
    panels = _panels([file.points(k)], axis_names(str(results.header["geometry"])))
    stress = scale(file.cell_field("sigma_v", k))
    image = _paint(panels.axes[0], panels.length(file.points(k)), file, stress, (0.0, float(stress.max())))
    _bar(panels, image, f"von Mises stress [{scale.unit}]")
    t = number(float(file.times[k]), 6)
    text = f"Von Mises stress, mean of each cell, at t = {t} s, the frame where it is highest"
    return [png(panels.figure, f"{text}: up to {scale.text(highest[k])}.", f"{text} ({scale.text(highest[k])}).",
                narrow=True)]


def _other_fields(results: Results, file: FieldReader, half: str) -> list[Picture]:
    """Every field of a half's own that has no picture yet: numbers, or the size of vectors, where they are largest."""
    pictures = []
    for field in results.fields.values():
        drawn = field.label in DRAWN or field.exchanged or field.components > MOST_COMPONENTS
        if field.half == half and not drawn and field.on in (On.NODES, On.CELLS):
            pictures += _largest(results, file, field)
    return pictures


def _largest(results: Results, file: FieldReader, field: OutputField) -> list[Picture]:
    """A field at the frame where it is largest; nothing of one that is 0 everywhere, always."""
    read = file.cell_field if field.on is On.CELLS else file.point_field

    def values(k: int) -> Array:
        value = read(field.label, k)
        return value if value.ndim == 1 else np.asarray(np.linalg.norm(value, axis=1))

    most = [float(np.nan_to_num(np.abs(values(k))).max()) for k in range(len(file.times))]
    k = int(np.argmax(most))
    if not most[k] > 0 or not np.isfinite(values(k)).all():
        return []
    scale = shown(field.unit, most[k], results.header["temperature_unit"])
    panels = _panels([file.points(k)], axis_names(str(results.header["geometry"])))
    value = scale(values(k))
    limits = (min(float(value.min()), 0.0), max(float(value.max()), 0.0)) if field.unit != "K" else (
        float(value.min()), float(value.max()))
    _bar(panels, _paint(panels.axes[0], panels.length(file.points(k)), file, value, limits),
         named(title_of(field), scale.unit))
    what = field.description or field.label
    text = (f"{what[0].upper()}{what[1:]} ({field.full_name}{', its size' if field.components > 1 else ''}) at "
            f"t = {number(float(file.times[k]), 6)} s, the frame where it is largest")
    return [png(panels.figure, f"{text}: {scale.text(float(values(k).min()))} to {scale.text(float(values(k).max()))}.",
                f"{text}.", narrow=True)]


@dataclass(frozen=True)
class Panels:
    """A figure of panels with one pair of limits, and room for one bar of colours.  length : how lengths are shown."""

    figure: PageFigure
    axes: list[Axes]
    bar: Axes
    length: Shown


def _panels(points: Sequence[Array], names: tuple[str, str]) -> Panels:
    """Panels of one size for all frames, a metre as long upright as across.  names : of the coordinates.

    They are put in their places here: a layout engine measures every number beside every panel, three times.
    """
    everything = np.concatenate(points)
    low, high = everything.min(axis=0), everything.max(axis=0)
    length = shown("m", float(max(np.abs(low).max(), np.abs(high).max(), 1e-3)))
    wide, tall = high - low + 2 * MARGIN * float((high - low).max())
    columns = min(len(points), 4 if tall >= 0.6 * wide else 2)
    rows = math.ceil(len(points) / columns)
    # A flat body alone in its picture leaves room for the words that stand upright beside its colours.
    width, least = (WIDE, 0.9) if columns > 1 else (NARROW, 1.5)
    across = (width - LEFT - RIGHT - (columns - 1) * BETWEEN[0]) / columns
    up = min(max(across * tall / wide, least), TALLEST)
    across = min(across, up * wide / tall)
    # Slender bodies do not need it all, and words in a wide picture are small.
    if LEFT + RIGHT + columns * across + (columns - 1) * BETWEEN[0] <= NARROW:
        width = NARROW
    height = TOP + BOTTOM + rows * up + (rows - 1) * BETWEEN[1]
    left = LEFT + 0.5 * (width - LEFT - RIGHT - columns * across - (columns - 1) * BETWEEN[0])
    figure = page_figure(height, width)
    half = 0.5 * np.array([max(wide, tall * across / up), max(tall, wide * up / across)])
    middle, axes = 0.5 * (low + high), []
    for k in range(len(points)):
        row, column = divmod(k, columns)
        x, y = left + column * (across + BETWEEN[0]), height - TOP - (row + 1) * up - row * BETWEEN[1]
        ax = figure.add_axes((x / width, y / height, across / width, up / height))
        ax.set_xlim(*length(middle[0] + np.array([-half[0], half[0]])))
        ax.set_ylim(*length(middle[1] + np.array([-half[1], half[1]])))
        _ticks(ax, (k + columns >= len(points), column == 0), names, length)
        axes.append(ax)
    end, most = left + columns * across + (columns - 1) * BETWEEN[0], height - TOP - BOTTOM
    tall_bar = min(most, 4.0)
    bar = figure.add_axes(((end + 0.15) / width, (BOTTOM + 0.5 * (most - tall_bar)) / height, 0.16 / width,
                           tall_bar / height))
    return Panels(figure, axes, bar, length)


def _ticks(ax: Axes, outer: tuple[bool, bool], names: tuple[str, str], length: Shown) -> None:
    """outer : whether the panel has no other below it, and none on its left: only there are scales."""
    ax.tick_params(labelsize=8, colors=INK)
    for axis, name, shows, parts in zip((ax.xaxis, ax.yaxis), names, outer, (4, 6), strict=True):
        if shows:
            axis.set_major_locator(MaxNLocator(parts))
            axis.set_label_text(f"{name} [{length.unit}]", fontsize=9, color=INK)
        else:
            axis.set_visible(False)  # drawing scales takes longer than drawing all else


def _bar(panels: Panels, image: Any, label: str, **look: Any) -> None:
    """The bar of colours and what they mean."""
    panels.figure.colorbar(image, cax=panels.bar, **look).set_label(label, fontsize=9, color=INK)
    panels.bar.tick_params(labelsize=8, colors=INK)


def _paint(ax: Axes, x: Array, file: FieldReader, value: Array, limits: tuple[float, float]) -> Any:
    """Paint nodal or cell values on the cells, with the bodies' outlines; returns what a colour bar needs."""
    q = file.quads
    cells = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]], file.triangles])
    low, high = limits if limits[1] > limits[0] else (limits[0] - 0.5, limits[1] + 0.5)
    look: dict[str, Any] = {"cmap": COLD_TO_HOT, "vmin": low, "vmax": high}
    mesh = Triangulation(x[:, 0], x[:, 1], cells)
    if len(value) == len(x) and len(cells) <= SMOOTH_UP_TO:
        image: Any = ax.tripcolor(mesh, value, shading="gouraud", **look)
    else:
        if len(value) == len(x):
            flat = value[cells].mean(axis=1)
        else:
            flat = np.concatenate([value[: len(q)], value[: len(q)], value[len(q):]])
        image = ax.tripcolor(mesh, facecolors=flat, **look)
    ax.add_collection(LineCollection(list(x[outline(q, file.triangles)]), colors=INK, linewidths=0.9, capstyle="round"),
                      autolim=False)
    return image


def outline(quads: Ints, triangles: Ints) -> Ints:
    """Return the edges (n, 2) that belong to one cell only, as ascending node numbers: the bodies' outlines.

    quads : (n_quads, 4) and triangles : (n_triangles, 3) node numbers.
    """
    edges = np.concatenate([cells[:, [i, (i + 1) % cells.shape[1]]]
                            for cells in (quads, triangles) for i in range(cells.shape[1])])
    unique, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return np.asarray(unique[count == 1])
