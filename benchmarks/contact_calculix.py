"""CalculiX beside us on two closed forms of contact, on our meshes: Hertz's pressure, and a block beside a wall.

    python benchmarks/contact_calculix.py [--chart FILE.svg]      needs `ccx` on the path (Debian: calculix-ccx)

The scenes are those of the tests (tests/mechanical_fmu/test_hertz.py and test_corner_pairs.py): the same nodes, cells,
materials and motions.  CalculiX has elements CPE4 and contact SURFACE TO SURFACE with a linear spring; we have the
defaults.  It is run with the spring that a scene of ours has if it states none, and with one that is stiffer.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "mechanical_fmu"))

from contact_corner import EXACT, pressures  # noqa: E402
from mechanical_scenes import EXPECTED, done, hold, inputs_of  # noqa: E402  (of the tests)
from test_corner_pairs import DELTA, HOLDS, NAMES, E, corner  # noqa: E402
from test_hertz import R, by_default, scene  # noqa: E402

from contact.half.interface import Interface  # noqa: E402
from contact.rpc.link import open_link  # noqa: E402
from coupler.report.figures import COLOURS, INK, new_figure, styled  # noqa: E402
from mechanical_fmu.elastic_half import load  # noqa: E402

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
MM, MPA = 1e3, 1e-6
PER_LINE = 8
CELLS = (4, 8)  # along an edge of the corner's block; the first is drawn
DEPTH = 1.0  # mm, of the slice that CalculiX makes of plane elements
STEEL = EXPECTED["C3"]["steel"]


class NoAnswerError(RuntimeError):
    """CalculiX found no solution."""


def lines(numbers: Iterable[int]) -> list[str]:
    """Data lines of whole numbers."""
    rows = list(numbers)
    return [", ".join(map(str, rows[k:k + PER_LINE])) for k in range(0, len(rows), PER_LINE)]


def deck(interface: Interface, E_MPa: float, nu: float, conditions: list[dict[str, Any]], spring: float,
         increments: int) -> str:
    """The input of CalculiX in mm and MPa.

    conditions : as of the half, held, or driven to the last of their values.  spring : MPa/mm.
    """
    nodes, cells = MM * interface.nodes, interface.quads + 1
    text = ["*NODE, NSET=NALL", *(f"{k}, {x:.12g}, {y:.12g}, 0" for k, (x, y) in enumerate(nodes, 1)),
            "*ELEMENT, TYPE=CPE4, ELSET=EALL",
            *(f"{k}, {', '.join(map(str, cell))}" for k, cell in enumerate(cells, 1)),
            "*MATERIAL, NAME=STEEL", "*ELASTIC", f"{E_MPa:.9g}, {nu}",
            "*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL", f"{DEPTH}"]
    faces = {frozenset((int(cell[k]), int(cell[(k + 1) % 4]))): f"{e}, S{k + 1}"
             for e, cell in enumerate(cells, 1) for k in range(4)}
    surfaces = {name: f"SURF{k}" for k, name in
                enumerate({s: None for pair in interface.pairs for s in (pair.slave, pair.master)})}
    for name, short in surfaces.items():
        text += [f"*SURFACE, NAME={short}", *(faces[frozenset((int(a) + 1, int(b) + 1))]
                                             for a, b in interface.surfaces[name])]
    text += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{spring:.9g}"]
    for pair in interface.pairs:
        text += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE",
                 f"{surfaces[pair.slave]}, {surfaces[pair.master]}"]
    rows = {}
    for k, c in enumerate(conditions):
        text += [f"*NSET, NSET=HELD{k}", *lines(np.unique(interface.surfaces[c["on"]]) + 1)]
        key = "u_x" if "u_x" in c else "u_y"
        value = c[key]["value"][-1] if isinstance(c[key], Mapping) else c[key]
        rows[f"HELD{k}, {1 + (key == 'u_y')}, {1 + (key == 'u_y')}"] = MM * value
    text += [f"*STEP, NLGEOM, INC={20 * increments}", "*STATIC", f"{1.0 / increments:.9g}, 1.0", "*BOUNDARY",
             *(f"{place}, {value:.12g}" for place, value in rows.items()),
             "*CONTACT FILE", "CDIS, CSTR", "*NODE FILE", "U", "*END STEP"]
    return "\n".join(text) + "\n"


def pressed(text: str, at: Floats) -> Floats:
    """What CalculiX finds at places (n, 2) [mm] at the end: the pressure (n,) [Pa].  Raises NoAnswerError."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scene.inp").write_text(text)
        ran = subprocess.run([str(shutil.which("ccx")), "-i", "scene"], cwd=folder, capture_output=True, text=True,
                             check=False)
        if "Job finished" not in ran.stdout:
            words = [line.strip() for line in ran.stdout.splitlines() if "ERROR" in line.upper()]
            raise NoAnswerError("; ".join(words[-3:]) or ran.stdout[-300:])
        frd = (Path(folder) / "scene.frd").read_text()
    nodes = np.array([row for row in rows_of(frd[frd.index("    2C"):].partition("\n -3")[0])])
    last = frd[frd.rindex(" -4  CONTACT"):].partition("\n -3")[0]
    found = {int(row[0]): row[4] for row in rows_of(last)}
    where = np.array([xyz[1:3] for xyz in nodes if int(xyz[0]) in found])
    p = np.array([found[int(xyz[0])] for xyz in nodes if int(xyz[0]) in found])
    apart = np.linalg.norm(where[None] - at[:, None], axis=2)
    near = apart < 1e-6 * float(np.ptp(at, axis=0).max())
    # Nodes of the master lie at the same places, and have none.
    return np.asarray(np.where(near, p, 0.0).max(axis=1)) / MPA


def rows_of(block: str) -> list[list[float]]:
    """Numbers of the lines -1 of a block: the node's, then values of 12 characters."""
    return [[float(line[3:13]), *(float(v) for v in re.findall(r".{12}", line[13:]))]
            for line in block.splitlines() if line.startswith(" -1")]


def beside(interface: Interface, pair: str, conditions: list[dict[str, Any]], spring: float, increments: int,
           nu: float, modulus: float) -> Floats:
    """Pressures (n,) [Pa] of the slave's nodes of a pair by CalculiX.  spring : Pa/m."""
    own = next(side for side in interface.pair_sides if side.pair == pair and side.own)
    text = deck(interface, modulus * MPA, nu, conditions, spring * MPA / MM, increments)
    return pressed(text, MM * interface.nodes[own.nodes])


def ours(interface: Interface, conditions: list[dict[str, Any]]) -> Floats:
    """Pressures (n,) [Pa] of Hertz's slave by the half elastic with its defaults."""
    half = load(interface, {"half": "elastic", "format": 2, "tolerance": 1e-8,
                            "materials": {"steel": {"E": STEEL["E"], "nu": STEEL["nu"]}},
                            "bodies": {b: {"material": "steel"} for b in interface.bodies}, "boundary": conditions,
                            "pairs": {"interface": {"augmented": {}}}})
    with closing(open_link("direct")) as link:
        state, outputs = half.start(inputs_of(half), 0.0, link)
        for i in range(2):
            state, outputs = done(half.step(state, inputs_of(half), float(i), 1.0, link))
    return np.asarray(-outputs["contact.t_N"][next(side.at for side in interface.pair_sides if side.own)])


def hertz(x: Floats, p: Floats) -> tuple[float, float, Floats]:
    """Half the width a [m], largest pressure [Pa] and pressures (n,) [Pa] of Hertz for the force of pressures at x."""
    P = 2.0 * float(np.trapezoid(p, x))
    a = float(np.sqrt(8.0 * P * R * (1.0 - STEEL["nu"] ** 2) / (np.pi * STEEL["E"])))
    p0 = 2.0 * P / (np.pi * a)
    return a, p0, p0 * np.sqrt(np.maximum(1.0 - (x / a) ** 2, 0.0))


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chart", type=Path)
    options = parser.parse_args()

    roll = by_default(scene(False), STEEL["E"], STEEL["nu"])
    drive = {"t": [0.0, 2.0], "value": [0.0, -STEEL["push"]]}
    holds = [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0), hold("upper.top", 1, drive)]
    x = roll.nodes[roll.side_of("interface", "upper.bottom").nodes, 0]
    auto = roll.pairs[0].eps_N
    of_hertz = {"Slideline": ours(roll, holds)}
    for factor in (1, 5, 20):
        of_hertz[f"CalculiX, {factor} auto"] = beside(roll, "interface", holds, factor * auto, 4, STEEL["nu"],
                                                      STEEL["E"])
    rows = []
    for name, p in of_hertz.items():
        a, p0, exact = hertz(x, p)
        rows.append({"Hertz": name, "p0 / Hertz": f"{p.max() / p0:.4f}",
                     "off, rms %": f"{100 * np.sqrt(np.mean((p - exact)[x < a] ** 2)) / p0:.2g}"})
    print(table(rows))

    of_corner: dict[str, tuple[Floats, Floats]] = {}
    for n in CELLS:
        block, found = corner(n), pressures(n)
        driven = [*HOLDS, hold("block.top", 1, {"t": [0, 1], "value": [0.0, -DELTA]})]
        of_corner[f"Slideline, {n} cells"] = (found["floor"][1], found["wall"][1])
        for factor in (1, 10):
            spring = factor * block.pairs[0].eps_N
            try:
                floor, wall = (beside(block, pair, driven, spring, 1, 0.0, E) for pair in NAMES)
            except NoAnswerError as error:
                print(f"CalculiX, {n} cells, {factor} E/h: no solution: {error}", file=sys.stderr)
                continue
            of_corner[f"CalculiX, {n} cells, {factor} E/h"] = floor, wall
    print(table([{"corner": name, "floor / exact, least": f"{floor.min() / EXACT:.4f}",
                  "most": f"{floor.max() / EXACT:.4f}", "wall / floor, most": f"{np.abs(wall).max() / EXACT:.1e}"}
                 for name, (floor, wall) in of_corner.items()]))

    if options.chart:
        figure = new_figure(3.1)
        left, right = (styled(ax, label, "pressure [MPa]") for ax, label in
                       zip(figure.subplots(1, 2), ("x [mm]", "along the floor from the wall [mm]"), strict=True))
        a, p0, _ = hertz(x, of_hertz["Slideline"])
        fine = np.linspace(0.0, 1.1 * a, 400)
        left.plot(MM * fine, MPA * p0 * np.sqrt(np.maximum(1.0 - (fine / a) ** 2, 0.0)), color=INK, linewidth=1.0,
                  label="Hertz")
        for name, mark, colour in (("Slideline", "o", 0), ("CalculiX, 5 auto", "^", 1), ("CalculiX, 20 auto", "x", 2)):
            left.plot(MM * x, MPA * of_hertz[name], mark, color=COLOURS[colour], markersize=3.5, label=name)
        left.set_xlim(0.0, MM * 1.1 * a)
        block = corner(CELLS[0])
        place = block.nodes[block.side_of("floor", "block.bottom").nodes, 0]
        right.axhline(MPA * EXACT, color=INK, linewidth=1.0, label="closed form")
        for name, mark, colour in ((f"Slideline, {CELLS[0]} cells", "o", 0),
                                   (f"CalculiX, {CELLS[0]} cells, 1 E/h", "^", 1),
                                   (f"CalculiX, {CELLS[0]} cells, 10 E/h", "x", 2)):
            right.plot(MM * place, MPA * of_corner[name][0], mark, color=COLOURS[colour], markersize=4.5, label=name)
        right.set_ylim(0.0, None)
        for ax in (left, right):
            ax.legend(fontsize=6)
        figure.savefig(options.chart, metadata={"Date": None} if options.chart.suffix == ".svg" else None)


if __name__ == "__main__":
    main()
