"""Figures as text for a page: SVG for curves, PNG for fields, one palette, no state shared between figures."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart with every common colour blindness; their yellow is too pale for a line.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444")
DASHES = ("-", "--", ":", "-.")
INK, GRID = "#333333", "#dddddd"
WIDTH = 9.0  # inches; a page shows it some 900 px wide, so a point of type is about 1.4 px
PNG_DPI = 130


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
    """An empty figure [inches] that keeps its labels inside."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def axes_of(figure: Figure, xlabel: str, ylabel: str) -> Axes:
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


def legend_below(figure: Figure, ax: Axes, columns: int = 4) -> None:
    """The legend under the axes, where it covers no curve."""
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=min(columns, len(handles)), frameon=False,
                      fontsize=9)


def svg(figure: Figure, alt: str, caption: str = "") -> Picture:
    """A figure as a picture of lines.  It is a data URI and not inline: the ids of two figures would collide."""
    return _picture(figure, "svg", "image/svg+xml", alt, caption)


def png(figure: Figure, alt: str, caption: str = "") -> Picture:
    """A figure as a picture of pixels."""
    return _picture(figure, "png", "image/png", alt, caption)


def _picture(figure: Figure, kind: str, mime: str, alt: str, caption: str) -> Picture:
    file = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else {}
    figure.savefig(file, format=kind, dpi=PNG_DPI, metadata=metadata)
    figure.clear()
    return Picture(f"data:{mime};base64,{base64.b64encode(file.getvalue()).decode()}", alt, caption)
