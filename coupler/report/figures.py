"""Figures as text for a page: SVG for curves, PNG for fields, one palette, no state shared between figures."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from coupler.report.places import PageFigure, place, rows_of

# Okabe and Ito's colours, told apart with every common colour blindness; their yellow is too pale for a line.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444")
DASHES = ("-", "--", ":", "-.")
INK, GRID = "#333333", "#dddddd"
WIDTH = 9.0  # inches; a page shows it some 900 px wide, so a point of type is about 1.4 px
PNG_DPI = 130
RUN_LENGTHS = 3  # as zlib calls it


@dataclass(frozen=True)
class Picture:
    """An image for the page.  src : data URI.  alt : what it shows, in words.  caption : stands below it.

    narrow : not for the whole width of the page.
    """

    src: str
    alt: str
    caption: str
    narrow: bool = False


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure [inches] that keeps its labels inside, for the pictures of the docs; a page has `page_figure`."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def page_figure(height: float, width: float = WIDTH) -> PageFigure:
    """An empty figure [inches] for a page; see coupler.report.places."""
    return PageFigure(figsize=(width, height), facecolor="white")


def axes_of(figure: PageFigure, xlabel: str, ylabel: str) -> Axes:
    """One set of axes in the house style."""
    return styled(figure.subplots(), xlabel, ylabel)


def styled(ax: Axes, xlabel: str, ylabel: str) -> Axes:
    """Axes in the house style: light grid, no box, units in the labels."""
    ax.set_xlabel(xlabel, color=INK)
    ax.set_ylabel(ylabel, color=INK)
    ax.grid(True, color=GRID, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(colors=INK, labelsize=9)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    return ax


def line_style(k: int) -> dict[str, Any]:
    """Colour, dash and width of the k-th curve: of equal curves each is still seen under the next."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)],
            "linewidth": 2.6 if k % len(DASHES) == 0 else 1.7}


def plain(label: str) -> str:
    """A user's name as matplotlib draws it letter by letter: `$` begins no formula, `_` does not hide it."""
    label = label.replace("$", r"\$")
    return f" {label}" if label.startswith("_") else label


def legend_below(figure: PageFigure, axes: Axes | Sequence[Axes], columns: int = 4,
                 more: Sequence[Artist] = ()) -> None:
    """The legend under all axes, where it covers no curve.  more : what no axes have."""
    handles = list(more)
    for ax in [axes] if isinstance(axes, Axes) else axes:
        handles += ax.get_legend_handles_labels()[0]
    if handles:
        columns = min(columns, len(handles))
        figure.legend(handles=handles, loc="lower center", ncols=columns, frameon=False, fontsize=9, borderaxespad=0.2)
        figure.legend_rows = rows_of(len(handles), columns)


def svg(figure: PageFigure, alt: str, caption: str = "") -> Picture:
    """A figure as a picture of lines.  It is a data URI and not inline: the ids of two figures would collide."""
    file = io.BytesIO()
    place(figure)
    # Not savefig: it draws everything once more before, for layouts that measure.  (Canvases have no types.)
    canvas: Any = FigureCanvasSVG(figure)
    canvas.print_svg(file, metadata={"Date": None})
    return _picture(file, "image/svg+xml", alt, caption)


def png(figure: PageFigure, alt: str, caption: str = "", narrow: bool = False) -> Picture:
    """A figure as a picture of pixels."""
    file = io.BytesIO()
    place(figure)
    figure.set_dpi(PNG_DPI)
    # Runs of equal pixels are most of what there is: finding no more than those takes a third of the time.
    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(file, pil_kwargs={"compress_type": RUN_LENGTHS})
    return replace(_picture(file, "image/png", alt, caption), narrow=narrow)


def _picture(file: io.BytesIO, mime: str, alt: str, caption: str) -> Picture:
    return Picture(f"data:{mime};base64,{base64.b64encode(file.getvalue()).decode()}", alt, caption)
