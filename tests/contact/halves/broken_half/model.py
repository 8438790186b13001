"""Wraps a half of ours: a rule on all that it gives out, what it takes for h, and what it takes its inputs for.

model.json is that of our half, with the name of the case beside.  The folder of broken_halves.py is in PYTHONPATH.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from broken_halves import CASES, Case, Forgetful

from contact.half import Discard, Done, HalfModel, Interface, Link, Values
from contact.half.state import to_bytes

LOADS = {"thermal": "thermal_fmu.half", "mechanical": "mechanical_fmu.elastic_half"}


class WrongHalf:
    """A half (contact.half.HalfModel) that is another one but for what a case does to it.

    made : substeps so far, which no restore takes back; but those of Forgetful, which go with each state that this
    instance has made, and are lost to another one that reads it.  X : (n_nodes, 2) the mesh [m].
    """

    def __init__(self, half: HalfModel, case: Case, X: np.ndarray) -> None:
        self.half, self.case, self.X = half, case, X
        self.variables = half.variables
        self.made, self.random = 0, np.random.default_rng()
        self._counts: dict[bytes, int] = {}  # of the states that this instance has made

    def start(self, inputs: Values, t: float, link: Link) -> tuple[Any, Mapping[str, Any]]:
        state, outputs = self.half.start(self._heard(inputs), t, link)
        return state, self.case.rule(self, dict(outputs), 0.0)

    def step(self, state: Any, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        if self.case.kind is Forgetful:
            self.made = self._counts.get(to_bytes(state), 0)
        done = self.half.step(state, self._heard(inputs), t, self.case.takes(h), link)
        if isinstance(done, Discard):
            return done
        self.made += 1
        if self.case.kind is Forgetful:
            self._counts[to_bytes(done.state)] = self.made
        return Done(done.state, self.case.rule(self, dict(done.outputs), h), done.dt_stable)

    def _heard(self, inputs: Values) -> Values:
        return {name: self.case.hears(self, name, value) for name, value in inputs.items()}


def load(interface: Interface, model: Mapping[str, Any]) -> WrongHalf:
    """The half of a directory."""
    case = CASES[model["case"]]
    ours = import_module(LOADS[case.role]).load(interface, {n: v for n, v in model.items() if n != "case"})
    return WrongHalf(ours, case, interface.nodes)
