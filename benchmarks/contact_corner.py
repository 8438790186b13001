"""The corner of a block on a floor, beside a wall that it only touches: a picture of docs/contact.md.

    python benchmarks/contact_corner.py [--chart FILE.svg]

The scene is that of tests/mechanical_fmu/test_corner_pairs.py, augmented, at 4, 8 and 16 cells along an edge.  Without
Poisson's ratio block and ground are bars in a row: the floor has E delta/(2 L), the wall nothing.
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

from test_corner_pairs import DELTA, NAMES, E, L, corner, pressed  # noqa: E402  (of the tests)

from coupler.report.figures import COLOURS, INK, new_figure, styled  # noqa: E402

Floats = NDArray[np.float64]
EXACT = E * DELTA / (2.0 * L)
CELLS = (4, 8, 16)


def pressures(n: int) -> dict[str, tuple[Floats, Floats]]:
    """Pair -> place along the block's side from the corner [m] and pressure [Pa] of its nodes, (n + 1,) each."""
    interface = corner(n)
    _, _, out = pressed(interface, ("floor", "wall"))
    found = {}
    for component, (pair, (slave, _)) in enumerate(NAMES.items()):
        side = interface.side_of(pair, slave)
        found[pair] = interface.nodes[side.nodes, component], -out["contact.t_N"][side.at]
    return found


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chart", type=Path)
    options = parser.parse_args()
    found = {n: pressures(n) for n in CELLS}
    print(table([{"cells": str(n), "floor off, most": f"{np.abs(of['floor'][1] / EXACT - 1.0).max():.1e}",
                  "wall / floor, most": f"{np.abs(of['wall'][1]).max() / EXACT:.1e}"} for n, of in found.items()]))
    if options.chart:
        figure = new_figure(2.6)
        ax = styled(figure.subplots(), "from the corner, along the floor and up the wall [mm]", "pressure [MPa]")
        for value, label in ((EXACT, "floor, closed form"), (0.0, "wall, closed form")):
            ax.axhline(1e-6 * value, color=INK, linewidth=1.0, linestyle="-" if value else "--", label=label)
        for k, n in enumerate(CELLS):
            for pair, mark in (("floor", "o"), ("wall", "^")):
                x, p = found[n][pair]
                ax.plot(1e3 * x, 1e-6 * p, mark, color=COLOURS[k], markersize=7 - 2 * k, label=f"{pair}, {n} cells")
        ax.legend(fontsize=6, ncol=2)
        figure.savefig(options.chart, metadata={"Date": None} if options.chart.suffix == ".svg" else None)


if __name__ == "__main__":
    main()
