"""The moving picture of the README: `python docs/images/make_moving.py run.h5`, from a run of the sliding blocks."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from coupler import Results
from coupler.record.vtkhdf import FieldReader

SIZE, DPI = (7.6, 3.4), 100  # inches, pixels an inch
SHOWN = 44  # pictures
COLOURS = 256  # of the palette they share
MS, REST = 110, 1200  # of one picture, and of the last
CURVES = (("lower.top.left", "#0072B2", "lower block, left"), ("lower.top.right", "#009E73", "lower block, right"),
          ("upper.bottom.centre", "#D55E00", "upper block"))


def main(run: str) -> None:
    """Draw the blocks and the temperatures of their faces at SHOWN times, and write them beside this file."""
    results = Results(run)
    with FieldReader(results.field_files["thermal"]) as reader:
        # Most happens between the approach and the parting.
        wanted = np.concatenate([np.linspace(2500, 9800, 8), np.linspace(9900, 12500, 12),
                                 np.linspace(12600, 15600, 24)])
        frames = sorted({int(np.abs(reader.times - t).argmin()) for t in wanted})[:SHOWN]
        pictures = [drawn(results, reader, k) for k in frames]
    # Curves are few pixels: of one picture alone they would get no colour of their own.
    first = pictures[len(pictures) // 2].quantize(COLOURS, method=Image.Quantize.FASTOCTREE)
    same = [p.quantize(palette=first, dither=Image.Dither.NONE) for p in pictures]
    out = Path(__file__).with_name("sliding_blocks.gif")
    same[0].save(out, save_all=True, append_images=same[1:], duration=[MS] * (len(same) - 1) + [REST], loop=0,
                 optimize=True)
    print(f"{out}: {len(same)} pictures, {out.stat().st_size / 1e3:.0f} kB")


def drawn(results: Results, reader: FieldReader, k: int) -> Image.Image:
    """One picture."""
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained", facecolor="white")
    canvas = FigureCanvasAgg(figure)
    bodies, curves = figure.subplots(1, 2, width_ratios=[0.85, 1.0])
    x, T = 1e3 * reader.points(k), reader.point_field("T", k) - 273.15
    cells = PolyCollection(list(x[reader.quads]), array=T[reader.quads].mean(axis=1), cmap="inferno", antialiased=False,
                           edgecolors="face", linewidths=0.3)
    cells.set_clim(0, 1000)
    bodies.add_collection(cells)
    bodies.set(xlim=(-8, 172), ylim=(-4, 208), aspect="equal", xticks=[], yticks=[])
    bodies.set_title(f"t = {reader.times[k]:.0f} s", fontsize=11)
    for side in bodies.spines.values():
        side.set_visible(False)
    figure.colorbar(cells, ax=bodies, shrink=0.85, location="left").set_label("temperature [°C]", fontsize=9)
    for name, colour, label in CURVES:
        t, values = results.probe(name, unit="degC")
        curves.plot(t, values, color=colour, linewidth=1.6, label=label)
        curves.plot(reader.times[k], np.interp(reader.times[k], t, values), "o", color=colour, markersize=5)
    curves.axvline(reader.times[k], color="0.7", linewidth=0.8, zorder=0)
    curves.set(xlim=(8000, 16500), ylim=(0, 1000), xlabel="time [s]")
    curves.set_title("faces in contact [°C]", fontsize=11)
    curves.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(0.1, 0.86))
    for side in ("top", "right"):
        curves.spines[side].set_visible(False)
    canvas.draw()
    return Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba()).convert("RGB")


if __name__ == "__main__":
    main(sys.argv[1])
