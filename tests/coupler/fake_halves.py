"""Two tiny halves in Python for tests of the coupler: a lumped body (case E4) and the gap its shrinkage opens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from coupler.half import Advance, Block, Status

C, G, T_S, T_W, K_G, G_M = 82500.0, 5000.0, 933.0, 400.0, 0.06, 10e-6


def gap_of(T: float) -> float:
    """g = 3 alpha L (850 - T), alpha 2.5e-5, L .03 m."""
    return 3 * 2.5e-5 * 0.03 * (850.0 - T)


@dataclass
class FakeHalf:
    """State is one array; `rule(state, inputs, t, h) -> (state, outputs)`; discards steps longer than h_max."""

    name: str
    blocks: Mapping[str, Block]
    rule: object
    state: np.ndarray
    h_max: float = np.inf
    can_save: bool = True
    strings: Mapping[str, str] = field(default_factory=dict)
    inputs: dict = field(default_factory=dict)
    saved: dict = field(default_factory=dict)
    calls: list = field(default_factory=list)

    def initialise(self, t_start, t_end, parameters, inputs, outputs):
        self.inputs.update(inputs)
        return {}

    def advance(self, t: float, h: float, inputs, outputs: Sequence[str]) -> Advance:
        self.inputs.update({k: np.array(v) for k, v in inputs.items()})
        self.calls.append((t, h, set(inputs)))
        if h > self.h_max:
            return Advance(Status.DISCARD, f"step {h} is longer than {self.h_max}", {}, 0.0)
        self.state, out = self.rule(self.state, self.inputs, t, h)
        return Advance(Status.OK, "", out, 0.0)

    def read(self, names):
        return {}

    def save(self) -> int:
        self.saved[len(self.saved)] = (self.state.copy(), dict(self.inputs))
        return len(self.saved) - 1

    def restore(self, token: int) -> None:
        state, inputs = self.saved[token]
        self.state, self.inputs = state.copy(), dict(inputs)

    def release(self, token: int) -> None: ...

    def log_tail(self) -> str:
        return ""

    def close(self) -> None: ...


def lumped(T0: float, method: str = "midpoint", h_max: float = np.inf) -> FakeHalf:
    """C dT/dt = G (T_s - T) - h(g) (T - T_w), gap in x[0, 1]; takes heat E_M too."""

    def rule(state, inputs, t, h):
        T = float(state[0])
        conductance = K_G / (max(float(inputs["x"][0, 1]), 0.0) + G_M)
        theta = 0.5 if method == "midpoint" else 1.0
        E = float(np.sum(inputs.get("E_M", 0.0)))

        def residual(new: float) -> float:
            stage = (1 - theta) * T + theta * new
            return C * (new - T) - h * (G * (T_S - stage) - conductance * (stage - T_W)) - E

        new = brentq(residual, 0.0, 5000.0, xtol=1e-13, rtol=8.9e-16)
        stage = (1 - theta) * T + theta * new
        return np.array([new]), {"T": np.array([new]), "heat.stored.body": np.array(C * (new - T)),
                                 "heat.convection": np.array(h * (G * (T_S - stage) - conductance * (stage - T_W))),
                                 "heat.mechanical": np.array(E)}

    blocks = {b.name: b for b in (Block("T", (1,), "K", "output", "Real"), Block("x", (1, 2), "m", "input", "Real"),
                                  Block("E_M", (1,), "J", "input", "Real"),
                                  Block("heat.stored.body", (), "J", "output", "Real"),
                                  Block("heat.convection", (), "J", "output", "Real"),
                                  Block("heat.mechanical", (), "J", "output", "Real"))}
    return FakeHalf("lumped", blocks, rule, np.array([T0]), h_max)


def shrinking(T0: float, heat: float = 0.0, h_max: float = np.inf) -> FakeHalf:
    """x[0, 1] = gap of the temperature at the end of the step; makes `heat` watts."""

    def rule(state, inputs, t, h):
        x = np.array([[0.0, gap_of(float(inputs["T"][0]))]])
        return x, {"x": x, "E_M": np.array([heat * h])}

    blocks = {b.name: b for b in (Block("T", (1,), "K", "input", "Real"), Block("x", (1, 2), "m", "output", "Real"),
                                  Block("E_M", (1,), "J", "output", "Real"))}
    return FakeHalf("shrinking", blocks, rule, np.array([[0.0, gap_of(T0)]]), h_max)
