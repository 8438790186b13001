"""Pressures of scenes that say nothing of how contact is enforced, against closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from coupler import load_scenario, run

pytestmark = pytest.mark.usefixtures("unlooked")

E, NU = 2.0e11, 0.3
ROOT = Path(__file__).resolve().parents[2]


def pressures(folder: Path, scene: dict[str, Any]) -> np.ndarray:
    """Pressures (n,) [Pa] of the slave's nodes in the end, along the surface."""
    file = folder / "scene.yaml"
    with file.open("w", encoding="utf-8") as f:
        YAML().dump(scene, f)
    results = run(load_scenario(file), out=folder / "run.h5")
    return -results.contact["face"].t_N[-1]


def scene_of(geometry: str, bodies: dict[str, Any], face: dict[str, Any], boundary: list[Any],
             E_other: tuple[float, float] = (E, NU)) -> dict[str, Any]:
    """Two bodies, `inner` of another E and nu perhaps, brought on within 1 s."""
    steel = {"rho": 7800, "k": 45, "c": 480, "E": E, "nu": NU, "alpha": 0}
    return {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": geometry,
        "materials": {"steel": steel, "other": {**steel, "E": E_other[0], "nu": E_other[1]}},
        "bodies": {name: {"mesh": {"rectangle": mesh}, "material": material, "T0": 300}
                   for name, (mesh, material) in bodies.items()},
        "contact": {"face": {"gap_max": 0.01, **face}},
        "thermal": {}, "mechanical": {"half": "elastic", "elastic": {"boundary": boundary}},
        "coupling": {"end": 1, "windows": [{"until": 1, "size": 0.25}]}}


@pytest.mark.slow
def test_rubber_squeezed_by_a_plate(tmp_path: Path) -> None:
    """A nearly incompressible block: p = E/(1 - nu2) d/L.  By the penalty alone of E/h it was a fifth less."""
    E_r, nu, L, d = 1.0e6, 0.4999, 0.05, 1.0e-5
    boundary = [{"on": "rubber.bottom", "u_y": 0}, {"on": "rubber.left", "u_x": 0}, {"on": "plate.left", "u_x": 0},
                {"on": "plate.top", "u_y": {"t": [0, 1], "value": [0, -d]}}]
    p = pressures(tmp_path, scene_of("plane", {
        "rubber": ({"origin": [0, 0], "size": [L, L], "cells": [5, 5]}, "other"),
        "plate": ({"origin": [0, L], "size": [L, 0.02], "cells": [4, 2]}, "steel")},
        {"slave": "rubber.top", "master": "plate.bottom"}, boundary, (E_r, nu)))
    np.testing.assert_allclose(p, E_r / (1.0 - nu**2) * d / L, rtol=4e-3)


def shrink_fit(delta: float, a: float, b: float, c: float) -> float:
    """Lame: the pressure of a ring b..c shrunk on a tube a..b by the radial interference delta, plane strain."""
    E_, nu = E / (1.0 - NU**2), NU / (1.0 - NU)
    return delta / (b / E_) / ((c**2 + b**2) / (c**2 - b**2) + nu + (b**2 + a**2) / (b**2 - a**2) - nu)


@pytest.mark.few("8")
@pytest.mark.parametrize("cells", [4, 8])
def test_a_shrink_fit_as_drawn(cells: int, tmp_path: Path) -> None:
    """An overlap as drawn is the interference.  By a penalty alone of E/h the pressure was 1.9 % low."""
    a, b, c, delta = 0.02, 0.03, 0.04, 1.0e-5
    boundary = [{"on": f"{body}.{side}", "u_y": 0} for body in ("tube", "ring") for side in ("bottom", "top")]
    p = pressures(tmp_path, scene_of("axisymmetric", {
        "tube": ({"origin": [a, 0], "size": [b + 0.5 * delta - a, 0.01], "cells": [cells, 4]}, "steel"),
        "ring": ({"origin": [b - 0.5 * delta, 0], "size": [c - b + 0.5 * delta, 0.01], "cells": [cells, 3]}, "steel")},
        {"slave": "ring.left", "master": "tube.right"}, boundary))
    # The mesh itself: 4 and 8 cells through the wall are 0.09 and 0.05 % too stiff.
    np.testing.assert_allclose(p, shrink_fit(delta, a, b, c), rtol=0.002 * (4.0 / cells))


def test_the_stroke_of_the_sliding_blocks_presses_as_it_says(tmp_path: Path) -> None:
    """10 MPa, without a term for the penalty in the stroke: by the penalty alone of the scenario 9.78 MPa.

    Blocks of 6 and 7 cells without heat; what presses one into the other is a strain of 4.6e-5.
    """
    blocks = {f"bodies.{body}.mesh.rectangle.cells": [n, n] for body, n in (("lower", 6), ("upper", 7))}
    windows = [{"until": 10000, "size": 2500}, {"until": 12500, "size": 625}]
    results = run(load_scenario(ROOT / "scenarios" / "sliding_blocks.yaml", overrides={
        **blocks, "coupling.end": 12500, "coupling.kinks": [], "coupling.windows": windows}), out=tmp_path / "run.h5")
    np.testing.assert_allclose(-results.contact["interface"].t_N[-1], 1.0e7, rtol=1e-4)
