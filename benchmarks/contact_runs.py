"""Runs of the elastic half alone, in this process, on the scenes of docs/contact.md."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ruamel.yaml import YAML
from thermal_page import merged, scenes

from contact.half.model import Done
from contact.rpc.link import DirectLink
from contact.service import ContactService
from coupler.scenario import Scenario, load_scenario
from mechanical_fmu.elastic_half import load

Array = NDArray[np.float64]
PAGE = Path(__file__).resolve().parents[1] / "docs" / "contact.md"


@dataclass(frozen=True)
class Ran:
    """t : (m,) [s], ends of steps.  outputs : of each of the m steps."""

    t: Array
    outputs: tuple[Mapping[str, Any], ...]

    def of(self, name: str) -> Array:
        """(m, ...) an output of every step."""
        return np.array([o[name] for o in self.outputs])


def scenario(name: str, **changes: Any) -> Scenario:
    """The scenario of a block of the page, with changes at its top-level keys."""
    with tempfile.TemporaryDirectory(prefix="contact.") as folder:
        path = Path(folder) / "scene.yaml"
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(merged(scenes(PAGE)[name], changes), file)
        return load_scenario(path)


def drive(scene: Scenario, steps: int) -> Ran:
    """Step the elastic half of a scene, alone and in this process, to its end by equal steps."""
    half = load(scene.interface, scene.models["mechanical"])
    link = DirectLink(ContactService().handle)
    inputs = {v.name: v.start for v in half.variables if v.causality == "input"}
    inputs["T"] = np.full(np.shape(inputs["T"]), 300.0)
    ends = np.linspace(0.0, scene.coupling.end, steps + 1)
    state, _ = half.start(inputs, 0.0, link)
    outputs = []
    for t, h in zip(ends, np.diff(ends), strict=False):
        done = half.step(state, inputs, float(t), float(h), link)
        assert isinstance(done, Done), done
        state = done.state
        outputs.append(dict(done.outputs))
    return Ran(ends[1:], tuple(outputs))
