"""Two tiny halves in Python for tests of the coupler: a lumped body (case E4) and the gap its shrinkage opens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from coupler.fmu.half import Advance, Block, Status

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

    def read(self, names, finite=True):
        return {}

    def save(self) -> int:
        # Tokens count all saves, so that a test can.
        self.saved[len(self.saved)] = (self.state.copy(), dict(self.inputs))
        return len(self.saved) - 1

    def restore(self, token: int) -> None:
        state, inputs = self.saved[token]
        self.state, self.inputs = state.copy(), dict(inputs)

    def release(self, token: int) -> None: ...

    def log_tail(self) -> str:
        return ""

    def close(self) -> None: ...


@dataclass
class Bytes(FakeHalf):
    """A FakeHalf whose states are bytes, too."""

    can_serialise: bool = True

    def serialise(self, token: int) -> bytes:
        return bytes([token])

    def deserialise(self, data: bytes) -> int:
        return data[0]


def lumped(T0: float, method: str = "midpoint", h_max: float = np.inf,
           body: tuple[float, float] = (C, G)) -> FakeHalf:
    """C dT/dt = G (T_s - T) - h(g) (T - T_w), gap in x[0, 1]; takes heat E_M too.  body : C, G."""
    C, G = body

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


def blocks_of(*blocks: Block) -> dict[str, Block]:
    return {b.name: b for b in blocks}


T_OUT, T_IN = Block("T", (1,), "K", "output", "Real"), Block("T", (1,), "K", "input", "Real")
X_OUT, X_IN = Block("x", (1, 2), "m", "output", "Real"), Block("x", (1, 2), "m", "input", "Real")
P_OUT, P_IN = (Block("contact.t_N", (1,), "Pa", c, "Real") for c in ("output", "input"))


def pressed(T0: float, seen: list) -> FakeHalf:
    """C dT/dt = G (T_s - T) - h1 p (T - T_w), backward Euler; writes down every t_N it is given."""

    def rule(state, inputs, t, h):
        t_N = float(inputs["contact.t_N"][0])
        seen.append(t_N)
        new = (C * state[0] + h * (G * T_S - H_1 * t_N * T_W)) / (C + h * (G - H_1 * t_N))
        return np.array([new]), {"T": np.array([new])}

    return FakeHalf("pressed", blocks_of(T_OUT, X_IN, P_IN), rule, np.array([T0]))


H_1 = 2e-3  # W/m2K per Pa
E_ALPHA = 70e9 * 2.5e-5  # Pa/K


def pressing() -> FakeHalf:
    """p = E alpha (T - 600) where that presses; open below, t_N = 0."""

    def rule(state, inputs, t, h):
        p = max(E_ALPHA * (float(inputs["T"][0]) - 600.0), 0.0)
        return state, {"x": np.zeros((1, 2)), "contact.t_N": np.array([-p])}

    return FakeHalf("pressing", blocks_of(T_IN, X_OUT, P_OUT), rule, np.zeros(1))


def mass(name: str, u0: float, given: str, told: Block) -> FakeHalf:
    """E6: u'' = -(k + k12) u + k12 u_other, exact for a constant u_other.

    given "x": u_other = x[0, 1], told as T = 1000 + u.  given "T": u_other is the mean of T - 1000 at both ends of the
    step, told as x[0, 1] = u.
    """
    k, k12 = 4 * np.pi**2, 16 * np.pi**2
    w = np.sqrt(k + k12)

    def rule(state, inputs, t, h):
        u, v, last = state
        now = float(inputs["x"][0, 1]) if given == "x" else float(inputs["T"][0]) - 1000.0
        rest = k12 / w**2 * (now if given == "x" else 0.5 * (last + now))
        new = rest + (u - rest) * np.cos(w * h) + v / w * np.sin(w * h)
        speed = -(u - rest) * w * np.sin(w * h) + v * np.cos(w * h)
        out = {"T": np.array([1000.0 + new])} if told.name == "T" else {"x": np.array([[0.0, new]])}
        return np.array([new, speed, now]), out

    return FakeHalf(name, blocks_of(X_IN if given == "x" else T_IN, told), rule, np.array([u0, 0.0, 1.0]))


def table(rule) -> FakeHalf:
    """A thermal half whose T at the end of a step is a function of x[0, 1]."""
    return FakeHalf("table", blocks_of(T_OUT, X_IN), lambda s, i, t, h: (s, {"T": np.array([rule(i["x"][0, 1])])}),
                    np.zeros(1))


def echo() -> FakeHalf:
    """x[0, 1] = T."""
    return FakeHalf("echo", blocks_of(T_IN, X_OUT),
                    lambda s, i, t, h: (s, {"x": np.array([[0.0, float(i["T"][0])]])}), np.zeros(1))


# Of E4 at its steady state: dT'/dt = -a dT - b dT_lagged, a = (G + h)/C, b = (T - T_w)|dh/dg| 3 alpha L/C.
T_STAR, G_STAR = 831.712463, 41.14696e-6
A_LAG = (G + K_G / (G_STAR + G_M)) / C
B_LAG = (T_STAR - T_W) * K_G / (G_STAR + G_M) ** 2 * 3 * 2.5e-5 * 0.03 / C
