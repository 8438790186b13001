"""Figures as text for a page: SVG for curves, PNG for fields, one palette, no state shared between figures."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from numpy.typing import NDArray

from coupler.record.vtkhdf import FieldReader
from coupler.report.pack import Chart

# Where axes stand in a figure of a page: margins by what stands in them, with no measuring.
#
# matplotlib's own layout measures each number beside each axis several times over, and a page has no use for that:
# numbers beside axes are of known length, so the margins can be said.

# Inches: numbers beside an axis, a line of words, the other margins, below an axis with words and without.
NUMBERS, LINE, RIGHT, TOP, WORDS, BARE = 0.62, 0.2, 0.3, 0.14, 0.55, 0.15
UPRIGHT, LETTER = 0.2, 0.062  # the small print above the axes: where it begins, and a letter of it
BAR, BAR_GAP, BAR_WIDTH = 1.0, 0.12, 0.15  # a bar of colours with its words
ENTRIES = 0.23  # a row of the legend


class PageFigure(Figure):
    """A figure whose axes stand one below the other; axes added by hand are bars of colours, or all are by hand.

    legend_rows : of the legend under them.
    """

    legend_rows: int = 0


def place(figure: PageFigure) -> None:
    """Put the axes of a figure in their places; its legend stands at its lower end.  By hand alone: nothing is done."""
    stacked = [ax for ax in figure.axes if ax.get_subplotspec() is not None]
    if not stacked:
        return
    bars = [ax for ax in figure.axes if ax not in stacked]
    width, height = (float(v) for v in figure.get_size_inches())
    left = NUMBERS + LINE * max(ax.get_ylabel().count("\n") + 1 for ax in stacked)
    right = width - (BAR if bars else RIGHT)
    bottom, top = below(stacked[-1]) + ENTRIES * figure.legend_rows, height - above(stacked[0])
    whole = top - bottom - sum(below(a) + above(b) for a, b in pairwise(stacked))
    shares = [_share(ax) for ax in stacked]
    high = top
    for k, ax in enumerate(stacked):
        tall = whole * shares[k] / sum(shares)
        ax.set_position((left / width, (high - tall) / height, (right - left) / width, tall / height))
        high -= tall + below(ax) + (above(stacked[k + 1]) if k + 1 < len(stacked) else 0.0)
    for ax in bars:
        ax.set_position(((right + BAR_GAP) / width, bottom / height, BAR_WIDTH / width, (top - bottom) / height))


def below(ax: Axes) -> float:
    """Inches under the axes."""
    return WORDS if ax.get_xlabel() else BARE


def above(ax: Axes) -> float:
    """Inches over the axes: there may be times, upright."""
    longest = max((len(text.get_text()) for text in ax.texts if text.get_rotation() == 90.0), default=0)
    return max(TOP, UPRIGHT + LETTER * longest if longest else 0.0)


def rows_of(entries: int, columns: int) -> int:
    """Of a legend."""
    return math.ceil(entries / columns)


def _share(ax: Axes) -> float:
    spec = ax.get_subplotspec()
    if spec is None:
        return 1.0
    return float(np.asarray(spec.get_gridspec().get_height_ratios(), dtype=float)[spec.rowspan.start])


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

    narrow : not for the whole width of the page.  dark : on a dark page its greys are turned round.
    chart : the same as curves for the page's script.
    still : not needed where the script runs, but on paper (fields) or nowhere (a closer look at a chart).
    """

    src: str
    alt: str
    caption: str
    narrow: bool = False
    dark: bool = False
    chart: Chart | None = None
    still: bool = False


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure [inches] that keeps its labels inside, for the pictures of the docs; a page has `page_figure`."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def page_figure(height: float, width: float = WIDTH) -> PageFigure:
    """An empty figure [inches] for a page; see coupler.report.figures."""
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
    return replace(_picture(file, "image/svg+xml", alt, caption), dark=True)


def png(figure: PageFigure, alt: str, caption: str = "", narrow: bool = False, dark: bool = False) -> Picture:
    """A figure as a picture of pixels.  dark : as in Picture, for colours that say what and not how much."""
    file = io.BytesIO()
    place(figure)
    figure.set_dpi(PNG_DPI)
    # Runs of equal pixels are most of what there is: finding no more than those takes a third of the time.
    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(file, pil_kwargs={"compress_type": RUN_LENGTHS})
    return replace(_picture(file, "image/png", alt, caption), narrow=narrow, dark=dark)


def _picture(file: io.BytesIO, mime: str, alt: str, caption: str) -> Picture:
    return Picture(f"data:{mime};base64,{base64.b64encode(file.getvalue()).decode()}", alt, caption)


# Numbers and units as a reader wants them: SI inside, a fitting multiple on the page.

Array = NDArray[np.float64]

# For each SI unit: multiples from small to large; the largest with which the greatest value is still >= 1 is used.
MULTIPLES = {
    "Pa": ((1.0, "Pa"), (1e-3, "kPa"), (1e-6, "MPa"), (1e-9, "GPa")),
    "J": ((1.0, "J"), (1e-3, "kJ"), (1e-6, "MJ"), (1e-9, "GJ")),
    "N": ((1.0, "N"), (1e-3, "kN"), (1e-6, "MN"), (1e-9, "GN")),
    "W/m2": ((1.0, "W/m²"), (1e-3, "kW/m²"), (1e-6, "MW/m²")),
}
MICROMETRES_TO, METRES_FROM = 1e-3, 2.0  # m: between them engineers read lengths in mm


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown: (value + shift) * factor in `unit`."""

    factor: float
    shift: float
    unit: str

    def __call__(self, value: Array) -> Array:
        """Return the values in `unit`, same shape.

        value : any shape, in the SI unit.
        """
        return (np.asarray(value, dtype=float) + self.shift) * self.factor

    def text(self, value: float, digits: int = 4) -> str:
        """One value with its unit; a share or a count has none."""
        said = number(float(self(np.array(value))), digits)
        # fault: the unit 1 stands behind a number -> return f"{said} {self.unit}" | coupler/test_report
        return said if self.unit == "1" else f"{said} {self.unit}"


def shown(unit: str, largest: float, temperature_unit: str = "K") -> Shown:
    """How to show values of an SI unit whose greatest magnitude is `largest`."""
    if unit == "K":
        return Shown(1.0, -273.15, "°C") if temperature_unit == "degC" else Shown(1.0, 0.0, "K")
    if unit == "m":
        factor, name = (1e6, "µm") if 0 < largest < MICROMETRES_TO else (1e3, "mm")
        return Shown(factor, 0.0, name) if largest < METRES_FROM else Shown(1.0, 0.0, "m")
    multiples = MULTIPLES.get(unit, ((1.0, unit),))
    factor, name = [m for m in multiples if largest * m[0] >= 1.0 or m is multiples[0]][-1]
    return Shown(factor, 0.0, name)


def named(what: str, unit: str) -> str:
    """A quantity beside an axis, with its unit; a share or a count has none."""
    # fault: the unit 1 stands beside an axis -> return f"{what} [{unit}]" | coupler/test_report
    return what if unit == "1" else f"{what} [{unit}]"


def axis_names(geometry: str) -> tuple[str, str]:
    """What the two coordinates of a scene are called."""
    return ("r", "z") if geometry == "axisymmetric" else ("x", "y")


def number(value: float, digits: int = 4) -> str:
    """A number for reading: no exponent where none is needed.

    >>> number(25000.0), number(14772.7272, 6), number(3.2e-15, 2)
    ('25000', '14772.7', '3.2e-15')
    """
    if value != 0.0 and 1e-4 <= abs(value) < 1e6:
        decimals = max(digits - 1 - int(np.floor(np.log10(abs(value)))), 0)
        text = f"{value:.{decimals}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{value:.{digits}g}"


def duration(seconds: float) -> str:
    """Wall-clock time: "1.25 s", "3 min 5 s", "2 h 10 min"."""
    if seconds < 60:
        return f"{number(seconds, 3)} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def counted(n: int, noun: str) -> str:
    """ "1 window", "2 windows"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


# Kinks as thin vertical lines with their times above, spread so that none covers another.

LABELLED_AT_MOST = 24  # more times than this are lines without numbers
GAP = 0.024  # least distance of two labels, in widths of the axes: the height of their letters


def draw_kinks(ax: Axes, kinks: Sequence[float]) -> None:
    """Lines at the kinks [s] inside the limits of the axes; call it after the limits are set."""
    low, high = ax.get_xlim()
    inside = sorted(k for k in kinks if low < k < high)
    for k in inside:
        ax.axvline(k, color="#999999", linewidth=0.7, zorder=1)
    if not inside or len(inside) > LABELLED_AT_MOST:
        return
    at = (np.array(inside) - low) / (high - low)
    across = ax.get_xaxis_transform()
    for k, place in zip(inside, spread(at, GAP), strict=True):
        x = low + place * (high - low)
        ax.plot([k, x], [1.0, 1.03], transform=across, color="#999999", linewidth=0.7, clip_on=False)
        ax.text(x, 1.04, f"{number(k, 6)} s", transform=across, rotation=90, ha="center", va="bottom", fontsize=7.5,
                color="#666666")


def spread(at: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """Return places (n,) [1] near those given, at least `gap` apart and not beyond 1; too many begin below 0.

    at : (n,) in [0, 1], shares of an axis, ascending [1].  gap : a share too [1].
    """
    places = at.copy()
    for i in range(1, len(places)):
        places[i] = max(places[i], places[i - 1] + gap)
    if len(places):
        places[-1] = min(places[-1], 1.0)
    for i in range(len(places) - 2, -1, -1):
        places[i] = min(places[i], places[i + 1] - gap)
    return places


# Which frames of a run to show.

AT_MOST = 8
TIME_COUNTS = 0.25  # weight of plain time against change: a long rest deserves a picture too


def progress(file: FieldReader) -> Array:
    """Return how far the story has gone at each frame, (n_frames,) [1]: change of T and of place, and a little time."""
    n = len(file.times)
    T, x = file.point_field("T", 0), file.points(0)
    size, warmth = float(np.ptp(x, axis=0).max()) or 1.0, 0.0
    change = np.zeros((2, n))
    for k in range(1, n):
        T_new, x_new = file.point_field("T", k), file.points(k)
        change[:, k] = np.abs(T_new - T).max(), np.abs(x_new - x).max() / size
        warmth = max(warmth, float(np.ptp(T_new)))
        T, x = T_new, x_new
    change[0] /= warmth or 1.0
    told = np.cumsum(change.sum(axis=0))
    time = (file.times - file.times[0]) / (float(np.ptp(file.times)) or 1.0)
    return np.asarray(told / (told[-1] or 1.0) + TIME_COUNTS * time)


def choose(times: Array, told: Array, marks: Sequence[float], most: int = AT_MOST) -> list[int]:
    """Return the numbers of the frames to show: first, last, the nearest to the marks, then where most is left untold.

    times : (n,) [s], ascending.  told : (n,) [1], ascending, as from `progress`.  marks : times [s].
    """
    n = len(times)
    picks = {0, n - 1} | {int(np.abs(times - m).argmin()) for m in marks if times[0] <= m <= times[-1]}
    while len(picks) > most:
        order = sorted(picks)
        inner = range(1, len(order) - 1)
        picks.remove(order[min(inner, key=lambda i: told[order[i + 1]] - told[order[i - 1]])])
    while len(picks) < min(most, n):
        order = sorted(picks)
        free = [k for k in range(n) if k not in picks]
        picks.add(max(free, key=lambda k: np.abs(told[order] - told[k]).min()))
    return sorted(picks)
