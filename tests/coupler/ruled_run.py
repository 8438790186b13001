"""Two fake halves under rules: a body that heats by itself, and one that is pressed and creeps."""

from __future__ import annotations

import math

import numpy as np
from coupled_run import start
from fake_halves import T_IN, T_OUT, X_IN, X_OUT, FakeHalf, blocks_of

from coupler.control.loop import Plan, Tried, windows
from coupler.fmu.half import Block
from coupler.rules.engine import Rule, wanted
from coupler.scenario.options import Iteration, Scheme, WindowRange
from coupler.schemes.schedule import schedule
from coupler.schemes.state import wanted_outputs


def scalar(name: str, causality: str, unit: str = "1") -> Block:
    return Block(name, (), unit, causality, "Real")


def heating(rate=lambda t: 10.0, h_max: float = math.inf) -> FakeHalf:
    """dT/dt = rate(t) load.lamp [K/s], taken at the middle of the step; writes down the methods it was given."""

    def rule(state, inputs, t, h):
        dT = rate(t + 0.5 * h) * float(inputs.get("load.lamp", 1.0)) * h
        methods.append(int(inputs.get("control.method", 0)))
        return state + dT, {"T": state + dT, "max_dT": np.array(abs(dT)), "iterations": np.array(2.0)}

    methods: list[int] = []
    half = FakeHalf("heating", blocks_of(
        T_OUT, X_IN, scalar("max_dT", "output", "K"), scalar("iterations", "output"), scalar("load.lamp", "input"),
        Block("control.method", (), "1", "input", "Integer")), rule, np.array([300.0]), h_max)
    half.methods = methods
    return half


def still(h_max: float = math.inf, iterations=lambda t: 1.0) -> FakeHalf:
    """A body that does not move."""
    return FakeHalf("still", blocks_of(T_IN, X_OUT, scalar("iterations", "output")), lambda s, i, t, h: (
        s, {"x": np.zeros((1, 2)), "iterations": np.array(iterations(t))}), np.zeros(1), h_max)


def ruled(rules: list[Rule], halves: tuple, time: tuple[float, int], scheme: Scheme = Scheme.STAGGERED,
          plan: dict | None = None) -> list[Tried]:
    """time : (end [s], number of windows).  Every window tried; the probe `body.T` is the temperature."""
    end, n = time
    whole = Plan(schedule(end, [WindowRange(end, end / n, end / n)], ()), scheme, {"thermal": 1, "mechanical": 1},
                 Iteration(), rules=tuple(rules), probed=lambda level: {"body.T": float(level.T[0])}, **(plan or {}))
    return list(windows(wanted_outputs(*halves, wanted(rules)), start(300.0, 0.0), whole))
