"""Meshes of the can in aluminium_can.yaml: `python aluminium_can_mesh.py` writes them beside itself."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

RADIUS, OUTER, FLOOR, MELT, TOP = 0.05, 0.056, -0.008, 0.15, 0.17
NAMES = ("can", "floor", "wall", "rim", "outside", "bottom", "axis")


def can(k: int) -> str:
    """Text of a Gmsh 2.2 file; k : 1 coarse, 2, 4.  Cells do not meet those of the melt, which has 8 k x 24 k."""
    r = np.concatenate([np.linspace(0, RADIUS, 5 * k + 2), np.linspace(RADIUS, OUTER, k + 2)[1:]])
    z = np.concatenate([np.linspace(FLOOR, 0, k + 2), np.linspace(0, MELT, 15 * k + 4)[1:],
                        np.linspace(MELT, TOP, 2 * k + 1)[1:]])
    i_wall, j_floor = 5 * k + 1, k + 1
    number = {(i, j): 0 for j in range(len(z)) for i in range(len(r)) if j <= j_floor or i >= i_wall}
    number = {at: n + 1 for n, at in enumerate(number)}
    last_r, last_z = len(r) - 1, len(z) - 1
    lines = {"floor": [(i, j_floor) for i in range(i_wall + 1)],
             "wall": [(i_wall, j) for j in range(j_floor, last_z + 1)],
             "rim": [(i, last_z) for i in range(i_wall, last_r + 1)],
             "outside": [(last_r, j) for j in range(last_z + 1)],
             "bottom": [(i, 0) for i in range(last_r + 1)],
             "axis": [(0, j) for j in range(j_floor + 1)]}
    corners = [[number.get(at, 0) for at in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
               for j in range(last_z) for i in range(last_r)]
    cells = [(3, 1, c) for c in corners if all(c)]
    cells += [(1, NAMES.index(name) + 1, [number[a], number[b]]) for name, ats in lines.items()
              for a, b in pairwise(ats)]
    return "\n".join([*_head(), "$Nodes", str(len(number)),
                      *(f"{n} {r[i]:.9g} {z[j]:.9g} 0" for (i, j), n in number.items()), "$EndNodes",
                      "$Elements", str(len(cells)),
                      *(f"{n} {kind} 2 {tag} {tag} {' '.join(map(str, c))}"
                        for n, (kind, tag, c) in enumerate(cells, 1)), "$EndElements", ""])


def _head() -> Iterator[str]:
    yield from ("$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(NAMES)))
    yield from (f'{2 if name == "can" else 1} {n} "{name}"' for n, name in enumerate(NAMES, 1))
    yield "$EndPhysicalNames"


if __name__ == "__main__":
    for name, k in (("coarse", 1), ("medium", 2), ("fine", 4)):
        Path(__file__).with_name(f"aluminium_can_{name}.msh").write_text(can(k), encoding="utf-8")
