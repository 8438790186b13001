"""Hertz's and Cattaneo-Mindlin's contact beside their closed forms: a picture of docs/contact.md.

    python benchmarks/contact_closed_forms.py [--chart FILE.svg]

The scenes are those of the tests (tests/mechanical_fmu): a steel cylinder of 50 mm on a half-space of its own steel,
pressed, then dragged along with friction 0.3 until 0.35 and 0.68 of what would slide.  Closed forms by the force found.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "mechanical_fmu"))

from mechanical_scenes import EXPECTED  # noqa: E402  (of the tests)
from test_cattaneo import MU, at_slave, dragged_along  # noqa: E402
from test_hertz import R  # noqa: E402

from coupler.report.figures import COLOURS, INK, new_figure, styled  # noqa: E402

Floats = NDArray[np.float64]


def runs() -> list[tuple[Floats, Floats, Floats, float, float]]:
    """x [m], pressure and shear [Pa] of the slave's nodes, force and drag [N/m]: pressed, and dragged twice."""
    return [(*at_slave(out), *(float(f) for f in np.abs(out["reaction.upper"])[::-1]))
            for out in dragged_along(augmented={})[1:]]


def hertz(P: float) -> tuple[float, float]:
    """Half the width a [m] and the largest pressure [Pa] under P [N/m]."""
    steel = EXPECTED["C3"]["steel"]
    a = float(np.sqrt(8.0 * P * R * (1.0 - steel["nu"] ** 2) / (np.pi * steel["E"])))
    return a, 2.0 * P / (np.pi * a)


def ellipse(x: Floats, a: float) -> Floats:
    return np.sqrt(np.maximum(1.0 - (x / a) ** 2, 0.0))


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--chart", type=Path)
    options = parser.parse_args()
    found, rows, lines = runs(), [], []
    for x, p, q, P, Q in found:
        a, p0 = hertz(P)
        stuck = a * np.sqrt(1.0 - Q / (MU * P))
        lines.append((a, p0, stuck))
        shear = MU * p0 * (ellipse(x, a) - stuck / a * ellipse(x, stuck))
        rows.append({"Q/(mu P)": f"{Q / (MU * P):.3f}", "p0 / Hertz": f"{p.max() / p0:.4f}",
                     "p off, rms %": f"{100 * np.sqrt(np.mean((p - p0 * ellipse(x, a))[np.abs(x) < a] ** 2)) / p0:.2g}",
                     "q off, rms % of mu p0":
                         f"{100 * np.sqrt(np.mean((q - shear)[np.abs(x) < a] ** 2)) / (MU * p0):.2g}"})
    print(table(rows))
    if options.chart:
        figure = new_figure(3.1)
        left, right = (styled(ax, "x [mm]", label) for ax, label in
                       zip(figure.subplots(1, 2), ("pressure [MPa]", "shear [MPa]"), strict=True))
        fine = np.linspace(-1.05, 1.05, 801) * lines[0][0]
        left.plot(1e3 * fine, 1e-6 * lines[0][1] * ellipse(fine, lines[0][0]), color=INK, linewidth=1.0, label="Hertz")
        left.plot(1e3 * found[0][0], 1e-6 * found[0][1], "o", color=COLOURS[0], markersize=3.5, label="Slideline")
        for k in (1, 2):
            x, _, q, P, Q = found[k]
            a, p0, c = lines[k]
            right.plot(1e3 * fine, 1e-6 * MU * p0 * (ellipse(fine, a) - c / a * ellipse(fine, c)), color=INK,
                       linewidth=1.0, label="Cattaneo, Mindlin" if k == 1 else None)
            right.plot(1e3 * x, 1e-6 * q, "o", color=COLOURS[k - 1], markersize=3.5,
                       label=f"Q = {Q / (MU * P):.2f} mu P")
        for ax in (left, right):
            ax.set_xlim(1e3 * fine[0], 1e3 * fine[-1])
            ax.legend(fontsize=7)
        figure.savefig(options.chart, metadata={"Date": None} if options.chart.suffix == ".svg" else None)


if __name__ == "__main__":
    main()
