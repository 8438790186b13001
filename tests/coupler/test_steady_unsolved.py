"""A steady problem without a solution is told once: no window is halved that it does not depend on."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from random_scenes.direct_half import without_fmus

from coupler import CouplingError, Results, load_scenario, run

pytestmark = pytest.mark.usefixtures("unlooked")


def failed(path: Path, T_inf: Any, mechanical: dict[str, Any] | None = None) -> tuple[str, int]:
    """What a run says to a conductivity that turns negative at 500 K, and how many windows it tried."""
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
           "materials": {"m": {"rho": 1000, "c": 500, "k": {"polynomial": [50.0, -0.1]}, "E": 2e11, "nu": 0.3,
                                "alpha": 1e-5, "T_ref": 300}},
           "bodies": {"a": {"mesh": {"rectangle": {"origin": [0, 0], "size": [1, 1], "cells": [10, 1]}},
                            "material": "m", "T0": 350}},
           "thermal": {"method": "steady", "boundary": [
               {"on": "a.left", "temperature": 300}, {"on": "a.right", "radiation": {"emissivity": 1.0, "T": T_inf}}]},
           "mechanical": mechanical or {"half": "rigid"},
           "coupling": {"end": 10, "scheme": "staggered", "windows": [{"until": 10, "size": 5}]}}
    with (path / "scene.yaml").open("w", encoding="utf-8") as f:
        YAML(typ="safe", pure=True).dump(doc, f)
    with without_fmus(), pytest.raises(CouplingError) as said:
        run(load_scenario(path / "scene.yaml"), out=path / "run.h5")
    return str(said.value), len(Results(path / "run.h5").windows.H)


def test_it_is_told_once(tmp_path: Path) -> None:
    said, windows = failed(tmp_path, 2000.0)
    assert "the same in a window of any length" in said
    assert "conductivity of body a" in said
    assert "smaller windows" not in said
    assert windows <= 1


def test_it_is_told_once_where_bodies_are_warm_too(tmp_path: Path) -> None:
    """An elastic body at 350 K that was drawn at 300 K is not where it was drawn, and rests."""
    held = [{"on": "a.left", "u_x": 0}, {"at": "a.bottom.left", "u_y": 0}]
    said, windows = failed(tmp_path, 2000.0, {"half": "elastic", "elastic": {"boundary": held}})
    assert "the same in a window of any length" in said
    assert windows <= 2


def test_where_loads_change_shorter_windows_go_as_far_as_there_is_an_answer(tmp_path: Path) -> None:
    said, windows = failed(tmp_path, {"t": [0, 10], "value": [300, 2000]})
    assert "the window was halved 10 times" in said
    assert windows > 10
