"""Runs of the thermal half alone, in this process, on the scenes of docs/thermal.md."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ruamel.yaml import YAML
from thermal_cases import first_inputs
from thermal_page import merged, scenes

from contact.half.model import Done
from contact.rpc.link import DirectLink
from contact.service import ContactService
from coupler.scenario import Scenario, load_scenario
from thermal_fmu.half import ThermalHalf

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ran:
    """X : (n, 2) [m].  t : (m + 1,) [s].  T : (m + 1, n) [K].  outputs : of each of the m steps."""

    X: Array
    t: Array
    T: Array
    outputs: tuple[Mapping[str, Any], ...]

    def along(self, t: float, y: float = 0.0) -> tuple[Array, Array]:
        """(x, T) on the line y [m] at the step end nearest to t."""
        row = np.flatnonzero(np.isclose(self.X[:, 1], y))
        row = row[np.argsort(self.X[row, 0], kind="stable")]
        return self.X[row, 0], self.T[int(np.abs(self.t - t).argmin()), row]

    def at(self, x: float, y: float = 0.0) -> Array:
        """(m + 1,) T at the node nearest to (x, y)."""
        return self.T[:, int(np.linalg.norm(self.X - [x, y], axis=1).argmin())]

    def of(self, name: str) -> Array:
        """(m, ...) an output of every step."""
        return np.array([o[name] for o in self.outputs])


def scenario(name: str, **changes: Any) -> Scenario:
    """The scenario of a block of the page, with changes at its top-level keys."""
    with tempfile.TemporaryDirectory(prefix="thermal.") as folder:
        path = Path(folder) / "scene.yaml"
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(merged(scenes()[name], changes), file)
        return load_scenario(path)


def drive(scene: Scenario, dt: float | Sequence[float] | None = None, **given: Any) -> Ran:
    """Step the thermal half of a scene to its end by steps dt [s] (None: the size of its windows).

    given : inputs of each step, say contact_t_N or contact_E_friction (the first _ is a dot), x.
    """
    half = ThermalHalf(scene.interface, scene.models["thermal"])
    link = DirectLink(ContactService().handle)
    inputs = first_inputs(half.variables)
    for key, value in given.items():
        name = key.replace("_", ".", 1) if key.startswith("contact") else key
        inputs[name] = np.broadcast_to(value, np.shape(inputs[name])).copy()
    size = scene.coupling.windows[0].first if dt is None else dt
    steps = np.full(round(scene.coupling.end / size), size) if np.isscalar(size) else np.asarray(size)
    state, first = half.start(inputs, 0.0, link)
    t, T, outputs = [0.0], [np.array(first["T"])], []
    for h in steps:
        done = half.step(state, inputs, t[-1], float(h), link)
        assert isinstance(done, Done), done
        state = done.state
        t.append(t[-1] + float(h))
        T.append(np.array(done.outputs["T"]))
        outputs.append(dict(done.outputs))
    return Ran(scene.interface.nodes, np.array(t), np.array(T), tuple(outputs))
