"""The picture of the README: `python docs/images/make_sliding_blocks.py run.h5`, from a run of the sliding blocks."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from coupler import Results
from coupler.record.vtkhdf import FieldReader

SNAPSHOTS = (2500.0, 12500.0, 13636.0, 15000.0)  # s: far apart, pressed, half way off, parted
COLOURS = {"left": "#0072B2", "centre": "#D55E00", "right": "#009E73"}


def main(run: str) -> None:
    """Draw the curves and four snapshots beside this file."""
    results = Results(run)
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplot_mosaic([["curves"] * 4, ["0", "1", "2", "3"]], height_ratios=[1.0, 1.15])
    curves = axes["curves"]
    for name, colour in COLOURS.items():
        t, T = results.probe(f"lower.top.{name}", unit="degC")
        curves.plot(t, T, color=colour, label=f"{name}, top of the lower block")
    t, T = results.probe("upper.bottom.centre", unit="degC")
    curves.plot(t, T, color="0.45", linestyle="--", label="centre, bottom of the upper block")
    curves.set(xlim=(9000, 16000), ylim=(0, 1000), xlabel="time [s]", ylabel="temperature [°C]")
    for at, what in ((10000, "touch"), (12500, "slide"), (14772.7, "part")):
        curves.axvline(at, color="0.8", linewidth=0.8, zorder=0)
        curves.text(at + 30, 960, what, color="0.4", fontsize=9, va="top")
    figure.legend(*curves.get_legend_handles_labels(), frameon=False, fontsize=9, loc="outside upper center", ncols=4)
    reader = FieldReader(results.field_files["thermal"])
    for i, wanted in enumerate(SNAPSHOTS):
        k = int(np.abs(reader.times - wanted).argmin())
        x, T = 1e3 * reader.points(k), reader.point_field("T", k) - 273.15
        cells = PolyCollection(x[reader.quads], array=T[reader.quads].mean(axis=1), cmap="inferno", antialiased=False)
        cells.set_clim(0, 1000)
        frame = axes[str(i)]
        frame.add_collection(cells)
        frame.set(xlim=(-8, 170), ylim=(-8, 212), aspect="equal", title=f"t = {reader.times[k]:.0f} s", xlabel="x [mm]")
    axes["0"].set_ylabel("y [mm]")
    figure.colorbar(cells, ax=[axes[str(i)] for i in range(4)], label="temperature [°C]", shrink=0.8)
    figure.savefig(Path(__file__).with_name("sliding_blocks.png"), dpi=110)


if __name__ == "__main__":
    main(sys.argv[1])
