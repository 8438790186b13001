"""Small scenes that begin, or are made, unevenly; solved in this process."""

from __future__ import annotations

import copy
import sys
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from coupler import Results, run
from coupler.scenario import Scenario, load_scenario

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.direct_half import without_fmus

STEEL = {"rho": 8000.0, "c": 500.0, "k": 40.0, "E": 2e11, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 300.0}
BAR: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL},
    "bodies": {"bar": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.1, 0.02], "cells": [10, 2]}},
                       "material": "steel", "T0": 300.0}},
    "thermal": {"half": "thermal"}, "mechanical": {"half": "rigid"},
    "coupling": {"scheme": "staggered", "end": 20.0, "windows": [{"until": 20.0, "size": 2.0}]},
    "output": {"fields": {"every": 1}, "checkpoint": None}}


def edited(doc: dict[str, Any], **values: Any) -> dict[str, Any]:
    """A copy with other values: dotted keys with __ for the dot; None removes the key."""
    doc = copy.deepcopy(doc)
    for key, value in values.items():
        *way, last = key.split("__")
        at = doc
        for step in way:
            at = at.setdefault(step, {})
        if value is None:
            at.pop(last, None)
        else:
            at[last] = copy.deepcopy(value)
    return doc


def written(folder: Path, doc: dict[str, Any], name: str = "s") -> Path:
    """Write a scenario; returns its path."""
    path = folder / f"{name}.yaml"
    yaml = YAML(typ="safe", pure=True)
    with path.open("w", encoding="utf-8") as f:
        yaml.dump(doc, f)
    return path


def loaded(folder: Path, doc: dict[str, Any], name: str = "s") -> Scenario:
    return load_scenario(written(folder, doc, name))


def solved(folder: Path, doc: dict[str, Any], name: str = "s") -> Results:
    """Run a scene with its halves in this process; its results are NAME.h5 in the folder."""
    scenario = loaded(folder, doc, name)
    with without_fmus():
        return run(scenario, folder / f"{name}.h5")


def temperatures(results: Results) -> np.ndarray:
    """(n_t, n_nodes) [K]."""
    return results.field("thermal.T")[1]


def linear(a: float, b: float) -> dict[str, Any]:
    """a + b x."""
    return {"terms": [{"t": a}, {"t": b, "x": {"polynomial": [0.0, 1.0]}}]}
