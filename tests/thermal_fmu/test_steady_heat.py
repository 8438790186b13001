"""Heat between steady states: by the mean of what flows at both ends of a step, but not across a jump."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, FlatContact, inputs_of, run, scene, spec

from thermal_fmu.half import load

BAR = scene(Box(0, 2, 0, 1, 4))  # 2 m long, 1 W/(m K)


def heated(right):
    return spec([{"on": "a.left", "temperature": 0.0}, {"on": "a.right", "temperature": right}], method="steady")


@pytest.mark.parametrize("dt", [1.0, 3.0, 6.0])
def test_heat_of_a_ramp_is_exact_at_any_step(dt):
    """T rises by 10 K/s from 40 K on, so (40 t + 5 t^2)/2 J go through the bar; by the flow at the end 540 J in 6 s."""
    ramp = {"t": [0, 100], "value": [40, 1040]}
    # A first step to where all is steady: what came before it is not known.
    ran = run(BAR, heated(ramp), np.array([1e-9, *np.full(round(6.0 / dt), dt)]))
    through = sum(o["heat.temperature.in"] for o in ran.outputs)
    assert through == pytest.approx((40 * 6 + 5 * 36) / 2, rel=1e-6)
    assert ran.imbalance() < 1e-12


def test_heat_of_a_wave_is_of_second_order():
    t = np.linspace(0.0, 3.0, 3001)
    wave = {"t": t.tolist(), "value": (100.0 * np.sin(t)).tolist()}

    def error(n):
        ran = run(BAR, heated(wave), np.array([1e-9, *np.full(n, 2.0 / n)]))
        return sum(o["heat.temperature.in"] for o in ran.outputs) - 50.0 * (1.0 - np.cos(2.0))

    assert error(10) / error(20) == pytest.approx(4.0, rel=0.01)


def test_heat_after_a_jump_is_none_of_what_flowed_before_it():
    """From 10 to 50 K at 1 s: 5 W in the first second, 25 W in the next; by the mean it would be 15 W."""
    jump = {"t": [0, 1, 1, 9], "value": [10, 10, 50, 50]}
    ran = run(BAR, heated(jump), 1.0, 2)
    assert [o["heat.temperature.in"] for o in ran.outputs] == pytest.approx([5.0, 25.0])


def test_heat_after_a_load_was_set_is_none_of_what_flowed_before_it():
    model = spec([{"on": "a.left", "temperature": 0.0}, {"on": "a.right", "flux": 10.0, "name": "lamp"}],
                 method="steady")
    half, link = load(BAR, model), FlatContact()
    state, _ = half.start(inputs_of(BAR, half), 0.0, link)
    told = []
    for k, factor in enumerate((1.0, 1.0, 3.0)):
        done = half.step(state, inputs_of(BAR, half, load_lamp=factor), float(k), 1.0, link)
        state = done.state
        told.append(done.outputs["heat.flux"])
    assert told == pytest.approx([10.0, 10.0, 30.0])


def test_heat_that_mechanics_make_is_given_whole():
    """3 J in the second step and none in the third: each is that of its own step, and so is what carries it off."""
    half, link = load(BAR, heated(0.0)), FlatContact()
    state, _ = half.start(inputs_of(BAR, half), 0.0, link)
    told = []
    for k, joule in enumerate((0.0, 3.0, 0.0)):
        done = half.step(state, inputs_of(BAR, half, E_M=np.full(4, 0.25 * joule)), float(k), 1.0, link)
        state = done.state
        told.append((done.outputs["heat.mechanical"], done.outputs["heat.temperature.out"]))
    assert told == [pytest.approx(pair, abs=1e-12) for pair in ((0.0, 0.0), (3.0, -3.0), (0.0, 0.0))]
