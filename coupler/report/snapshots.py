"""Fields on the deformed bodies: temperature at chosen frames, von Mises stress where it is highest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from coupler.errors import ResultsError
from coupler.report.curves import kinks_of
from coupler.report.frames import choose, progress
from coupler.report.picture import INK, Picture, new_figure, png
from coupler.report.units import Shown, number, shown
from coupler.results import Results
from coupler.vtkhdf import FieldReader

Array = NDArray[np.float64]
Ints = NDArray[np.integer]

MARGIN = 0.04
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
                    pictures += draw(results, file)
                elif half == "thermal":
                    remarks.append("The run ended before its first frame of fields.")
        except ResultsError as exc:
            remarks.append(f"No pictures of the {half} fields: {exc}")
    return pictures, remarks


def _temperatures(results: Results, file: FieldReader) -> list[Picture]:
    if "T" not in file.point_fields:
        return []
    picks = choose(file.times, progress(file), kinks_of(results))
    points, T = [file.points(k) for k in picks], [file.point_field("T", k) for k in picks]
    scale = shown("K", 0.0, results.header["temperature_unit"])
    low, high = min(float(v.min()) for v in T), max(float(v.max()) for v in T)
    figure, panels, length = _panels(points)
    for ax, x, value, k in zip(panels, points, T, picks, strict=False):
        image = _paint(ax, length(x), file, scale(value), (float(scale(np.array(low))), float(scale(np.array(high)))))
        ax.set_title(f"t = {number(float(file.times[k]), 6)} s", fontsize=10, color=INK)
    figure.colorbar(image, ax=panels, label=f"temperature [{scale.unit}]", shrink=0.85, pad=0.01)
    times = ", ".join(f"{number(float(file.times[k]), 6)} s" for k in picks)
    return [png(figure, f"Temperature of the bodies at t = {times}, from {scale.text(low)} to {scale.text(high)}.",
                "Temperature on the bodies as they stand (deformed, not magnified), one colour scale for all. "
                "Shown: the first and the last frame, those nearest to the kinks, and where most changes.")]


def _stress(results: Results, file: FieldReader) -> list[Picture]:
    if "sigma_v" not in file.cell_fields:
        return []
    highest = [float(file.cell_field("sigma_v", k).max()) for k in range(len(file.times))]
    k = int(np.argmax(highest))
    if not highest[k] > 0:
        return []
    scale = shown("Pa", highest[k])
    figure, panels, length = _panels([file.points(k)])
    stress = scale(file.cell_field("sigma_v", k))
    image = _paint(panels[0], length(file.points(k)), file, stress, (0.0, float(stress.max())))
    figure.colorbar(image, ax=panels, label=f"von Mises stress [{scale.unit}]", pad=0.02)
    t = number(float(file.times[k]), 6)
    text = f"Von Mises stress, mean of each cell, at t = {t} s, the frame where it is highest"
    picture = png(figure, f"{text}: up to {scale.text(highest[k])}.", f"{text} ({scale.text(highest[k])}).")
    return [replace(picture, narrow=True)]


def _panels(points: Sequence[Array]) -> tuple[Figure, list[Axes], Shown]:
    """Axes of one size and one pair of limits for all frames; lengths in a fitting unit."""
    everything = np.concatenate(points)
    low, high = everything.min(axis=0), everything.max(axis=0)
    length = shown("m", float(max(np.abs(low).max(), np.abs(high).max(), 1e-3)))
    pad = MARGIN * float((high - low).max())
    wide, tall = high - low + 2 * pad
    columns = min(len(points), 4 if tall >= 0.6 * wide else 2)
    rows = math.ceil(len(points) / columns)
    panel = 8.9 / columns if columns > 1 else 4.5
    height = min(max(panel * tall / wide, 0.9), 5.0)
    figure = new_figure(rows * (height + 0.35) + 0.5, 10.6 if columns > 1 else 6.0)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.ravel())
    for ax in panels[len(points):]:
        ax.set_visible(False)
    ax = panels[0]
    ax.set_xlim(*length(np.array([low[0] - pad, high[0] + pad])))
    ax.set_ylim(*length(np.array([low[1] - pad, high[1] + pad])))
    for k, ax in enumerate(panels[: len(points)]):
        ax.set_aspect("equal", adjustable="box")
        ax.tick_params(labelsize=8, colors=INK)
        ax.xaxis.set_major_locator(MaxNLocator(4))
        if k + columns >= len(points):
            ax.set_xlabel(f"x [{length.unit}]", fontsize=9, color=INK)
            ax.tick_params(labelbottom=True)
        if k % columns == 0:
            ax.set_ylabel(f"y [{length.unit}]", fontsize=9, color=INK)
    return figure, panels[: len(points)], length


def _paint(ax: Axes, x: Array, file: FieldReader, value: Array, limits: tuple[float, float]) -> Any:
    """Paint nodal or cell values on the cells, with the bodies' outlines; returns what a colour bar needs."""
    q = file.quads
    cells = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]], file.triangles])
    low, high = limits if limits[1] > limits[0] else (limits[0] - 0.5, limits[1] + 0.5)
    look: dict[str, Any] = {"cmap": "inferno", "vmin": low, "vmax": high}
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
    """(n, 2) the edges that belong to one cell only: the bodies' outlines."""
    edges = np.concatenate([cells[:, [i, (i + 1) % cells.shape[1]]]
                            for cells in (quads, triangles) for i in range(cells.shape[1])])
    unique, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return np.asarray(unique[count == 1])
