"""The pictures of the casting in its can: gap and conductance over time, the way of the heat, and what decides."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from can_readings import CanRun
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from coupler import Results
from coupler.record.vtkhdf import FieldReader
from coupler.report.figures import COLOURS, INK, line_style, new_figure, styled

HEIGHTS = (0.01, 0.05, 0.1, 0.14)
# What experiments on aluminium in steel moulds found: gaps [mm], and h [W/m2K] at first and at the end.
MEASURED_GAP, MEASURED_FIRST, MEASURED_LAST = (0.1, 1.2), (1e3, 6e3), (1e2, 5e2)
MAGNIFIED = 2.0
SHADES = 16  # colours of the cells in the picture of the flux: a quarter of the bytes, and nothing to be seen of it
DPI = 150
FAINT = 0.04  # share of the longest arrow: less is a dot
ARROWS = 110  # cells with an arrow, about, in the casting


PLAIN = {"svg.fonttype": "none", "svg.hashsalt": "slideline", "font.family": "sans-serif"}


def draw_variants(runs: Mapping[str, CanRun], folder: Path) -> None:
    """Writes can_variants.svg."""
    mpl.rcParams |= PLAIN
    variants_figure(runs).savefig(folder / "can_variants.svg", dpi=DPI, metadata={"Date": None})


def draw(can: CanRun, results: Results, folder: Path) -> None:
    """Writes can_gap.svg and can_flux.svg."""
    mpl.rcParams |= PLAIN
    times = [5.0, 50.0, 250.0, can.solid_at]
    for name, figure in (("can_gap", gap_figure(can)), ("can_flux", flux_figure(results, times))):
        figure.savefig(folder / f"{name}.svg", dpi=DPI, metadata={"Date": None})
    lighten(folder / "can_flux.svg")


def lighten(path: Path) -> None:
    """Store the pixels inside an SVG in a palette of SHADES colours, and its lines to a hundredth of a point."""
    def lighter(found: re.Match[str]) -> str:
        image = Image.open(io.BytesIO(base64.b64decode(found[1]))).convert("RGBA")
        paper = Image.new("RGBA", image.size, "white")
        file = io.BytesIO()
        Image.alpha_composite(paper, image).convert("RGB").quantize(SHADES).save(file, "png", optimize=True)
        return f'"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"'

    text = re.sub(r'"data:image/png;base64,\s*([^"]*)"', lighter, path.read_text("utf-8"))
    text = re.sub(r'(?<= d=")[^"]*', lambda d: re.sub(r"\s*([A-Z])\s*", r"\1", re.sub(
        r"-?\d+\.\d+", _hundredths, d[0])).strip(), text)
    path.write_text(text, "utf-8")


def _hundredths(found: re.Match[str]) -> str:
    return f"{float(found[0]):.2f}".rstrip("0").rstrip(".")


def gap_figure(can: CanRun) -> Figure:
    """Gap and conductance against time at four heights, and the ranges of the experiments."""
    figure = new_figure(3.6)
    left, right = (styled(ax, "time [s]", label) for ax, label in zip(
        figure.subplots(1, 2), ("gap [mm]", r"$h_{CI}$ [W/m$^2$K]"), strict=True))
    end = can.t[-1]
    left.axhspan(*MEASURED_GAP, color=INK, alpha=0.08, linewidth=0)
    left.text(0.25, 0.98 * MEASURED_GAP[1], "measured", color=INK, fontsize=8.5, va="top")
    for (a, b), (low, high), text in (((0.2, 3.0), MEASURED_FIRST, "measured at first"),
                                      ((can.solid_at / 3, end), MEASURED_LAST, "measured at the end")):
        right.fill_between([a, b], low, high, color=INK, alpha=0.08, linewidth=0)
        right.text(a if a < 1 else b, 1.05 * high, text, color=INK, fontsize=8.5, ha="left" if a < 1 else "right")
    after = can.t > 0.15
    for k, z in enumerate(HEIGHTS):
        i = int(np.argmin(abs(can.z - z)))
        left.plot(can.t[after], 1e3 * np.maximum(can.gap[after, i], 0.0), label=f"{1e3 * can.z[i]:.0f} mm",
                  **line_style(k))
        right.plot(can.t[after], can.h[after, i], **line_style(k))
    for ax in (left, right):
        ax.set_xscale("log")
        ax.set_xlim(0.2, end)
        ax.axvline(can.solid_at, color=INK, linewidth=0.8, linestyle=":")
    right.set_yscale("log")
    right.set_ylim(30, 1e4)
    left.text(can.solid_at, 0.02, "all solid ", color=INK, fontsize=8.5, rotation=90, ha="right", va="bottom")
    left.legend(frameon=False, fontsize=8.5, labelcolor=INK, title="height", title_fontsize=8.5, loc="center left")
    return figure


def variants_figure(runs: Mapping[str, CanRun]) -> Figure:
    """Gaps when all is solid, up the wall and outwards along the base: one line a variant, by its name."""
    figure = new_figure(4.2)
    ends = {name: int(np.argmin(abs(can.t - can.solid_at))) for name, can in runs.items()}
    wall, base = (styled(ax, label, "gap [um]") for ax, label in zip(
        figure.subplots(1, 2), ("height on the wall [mm]", "radius on the base [mm]"), strict=True))
    for n, (name, can) in enumerate(runs.items()):
        wall.plot(1e3 * can.z, 1e6 * np.maximum(can.gap[ends[name]], 0.0), label=f"{name}, {can.solid_at:.0f} s",
                  **line_style(n))
        base.plot(1e3 * can.base_r, 1e6 * np.maximum(can.base_gap[ends[name]], 0.0), **line_style(n))
    wall.set_ylim(0.0, None)
    base.set_ylim(0.0, None)
    figure.legend(frameon=False, fontsize=8.5, labelcolor=INK, loc="outside lower center", ncols=3,
                  title="variant, and when all of it is solid", title_fontsize=8.5)
    return figure


def flux_figure(results: Results, times: list[float]) -> Figure:
    """Heat flux as arrows on the deformed mesh, its displacements magnified, at four times."""
    figure = new_figure(4.6)
    with (FieldReader(results.field_files["mechanical"]) as mechanical,
          FieldReader(results.field_files["thermal"]) as thermal):
        for ax, t in zip(figure.subplots(1, len(times), sharey=True), times, strict=True):
            k = int(np.argmin(abs(mechanical.times - t)))
            _panel(ax, mechanical, thermal, k)
            ax.set_title(f"{mechanical.times[k]:.3g} s", color=INK, fontsize=10)
        figure.axes[0].set_ylabel("z [mm]", color=INK, fontsize=9)
    return figure


def _panel(ax: Axes, mechanical: FieldReader, thermal: FieldReader, k: int) -> None:
    """One time: liquid light, mush and solid darker, the can grey; the longest arrow of each panel is alike."""
    x = mechanical.points(k) + (MAGNIFIED - 1) * mechanical.point_field("u", k)[:, :2]
    cells, body = 1e3 * x[mechanical.quads], mechanical.cell_field("body", k)
    solid = thermal.point_field("f_s", k)[mechanical.quads].mean(axis=1)
    colours = [mpl.colors.to_rgba(COLOURS[0], 0.10 + 0.25 * s) if b == 0 else mpl.colors.to_rgba(INK, 0.12)
               for b, s in zip(body, solid, strict=True)]
    ax.add_collection(PolyCollection(list(cells), facecolors=colours, edgecolors=(*mpl.colors.to_rgb(INK), 0.15),
                                     linewidths=0.3, rasterized=True))
    q, middle = thermal.cell_field("q", k)[:, :2], cells.mean(axis=1)
    shown = _thinned(middle, int((body == 0).sum()))
    top = np.quantile(np.linalg.norm(q, axis=1), 0.98)
    shown = shown[np.linalg.norm(q[shown], axis=1) > FAINT * top]
    arrows = ax.quiver(*middle[shown].T, *np.clip(q[shown] / top, -1, 1).T, color=COLOURS[1], scale=9, width=0.009,
                       headwidth=3.5, clip_on=False)
    arrows.set_in_layout(False)  # what is not clipped would ask for room without end
    ax.set_aspect("equal")
    ax.set_xlim(-1, 62)
    ax.set_ylim(-14, 175)
    ax.set_xlabel(f"r [mm]\nlongest {top / 1e3:.0f} kW/m$^2$", color=INK, fontsize=9)
    ax.tick_params(colors=INK, labelsize=8)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def _thinned(middle: np.ndarray, in_casting: int) -> np.ndarray:
    """Cells for arrows: of each box of a grid the one nearest to its middle."""
    size = np.sqrt(50.0 * 150.0 / min(ARROWS, in_casting))
    box = np.floor(middle / size).astype(int)
    far = np.linalg.norm(middle - (box + 0.5) * size, axis=1)
    order = np.argsort(far, kind="stable")
    return order[np.unique(box[order], axis=0, return_index=True)[1]]
