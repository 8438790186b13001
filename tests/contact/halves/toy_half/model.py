"""dT/dt = rate (drive - T) + memory, solved by backward Euler; memory is hidden state no output shows."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half import Discard, Done, Interface, Link, SingularMatrixError, Values, Variable

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Toy:
    """T : (n,) [K].  memory : (n, 2), hidden.  steps : how many were made."""

    T: Array
    memory: Array
    steps: int
    note: str


class ToyHalf:
    """The half.  bugs(1..) by control.method make a step go wrong in a chosen way.

    leak : what every step ever made adds to T [K]: memory beside the state, which no restore brings back.
    ends : how the third step ends: `exit`, `crash`, `hang`; "" well.
    """

    def __init__(self, interface: Interface, rate: float, h_max: float, leak: float = 0.0, ends: str = "") -> None:
        n = len(interface.nodes)
        self.ends = ends
        self.n, self.rate, self.h_max = n, rate, h_max
        self.leak, self.made = leak, 0
        self.variables = (
            Variable("T", (n,), "output", "K"),
            Variable("x", (n, 2), "input", "m", start=interface.nodes),
            Variable("drive", (n,), "input", "K", start=300.0),
            Variable("gain", (), "input", "W/m2K", start=1.0),
            Variable("sum", (), "output", "K"),
            Variable("iterations", kind="Integer", start=0),
        )

    def start(self, inputs: Values, t: float, link: Link) -> tuple[Toy, dict[str, Any]]:
        if inputs["control.method"] == 9:
            raise RuntimeError("cannot start: 100%s of it")
        if inputs["control.method"] == 8:
            raise SingularMatrixError("nothing holds it")
        state = Toy(np.full(self.n, 273.15), np.zeros((self.n, 2), order="F"), 0, "begun")
        return state, self._outputs(state)

    def step(self, state: Toy, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        if h > self.h_max:
            return Discard(f"step of {h} s is more than {self.h_max} s, 100% too much", self.h_max)
        method = inputs["control.method"]
        if method == 1:
            raise RuntimeError("a bug with 100%n in its text")
        if method == 2:
            raise ZeroDivisionError("nothing to divide by")
        if method == 3:
            raise SystemExit(3)
        if method == 4:
            raise KeyboardInterrupt
        if method == 5:
            state.T[0] = 0.0
        if method == 7:
            os._exit(7)
        drive, gain = np.asarray(inputs["drive"]), float(inputs["gain"])
        T = (state.T + h * self.rate * gain * (drive + 0.01 * state.memory.sum(axis=1))) / (
            1 + h * self.rate * gain)
        memory = 0.9 * state.memory + np.stack([T - state.T, inputs["x"][:, 0]], axis=1)
        if method == 6:
            T[-1] = np.nan
        self.made += 1
        if self.made == 3:
            if self.ends == "exit":
                os._exit(0)
            if self.ends == "crash":
                os.kill(os.getpid(), signal.SIGSEGV)
            if self.ends == "hang":
                time.sleep(1000.0)
        T += self.leak * self.made
        new = Toy(T, memory, state.steps + 1, state.note)
        return Done(new, self._outputs(new), dt_stable=2.0)

    def _outputs(self, state: Toy) -> dict[str, Any]:
        return {"T": state.T, "sum": state.T.sum(), "iterations": state.steps}


def load(interface: Interface, model: Mapping[str, Any]) -> ToyHalf:
    """The half of a directory."""
    if model.get("half") != "toy":
        raise ValueError(f"model.json: half is {model.get('half')!r}, not 'toy'")
    return ToyHalf(interface, float(model["rate"]), float(model.get("h_max", 1.0)), float(model.get("leak", 0.0)),
                   str(model.get("ends", "")))
