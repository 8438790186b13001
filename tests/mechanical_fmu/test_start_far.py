"""A scene that begins far from its drawing: what it begins in is what it comes to step by step."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import block, done, elastic, hold, inputs_of, press

from contact.rpc.link import open_link

RUBBER = {"E": 5e6, "nu": 0.4999, "alpha": 5e-5, "T_ref": 300.0}


def rubber(*loads):
    """A block of 10 x 5 mm whose nodes inside are a little astray, held at its bottom."""
    def astray(X):
        inside = (X[:, 0] > 1e-6) & (X[:, 0] < 0.00999) & (X[:, 1] > 1e-6) & (X[:, 1] < 0.00499)
        return X + 3e-4 * inside[:, None] * np.random.default_rng(5).uniform(-1.0, 1.0, X.shape)

    interface = block(np.linspace(0.0, 0.01, 5), np.linspace(0.0, 0.005, 4), move=astray)
    body = interface.bodies[0]
    return elastic(interface, [hold(f"{body}.bottom", 0), hold(f"{body}.bottom", 1),
                               *(press(f"{body}.top", p) for p in loads)], RUBBER)


@pytest.mark.parametrize(("T", "loads"), [(350.0, ()), (450.0, ()), (220.0, ()), (350.0, (-3e6,))])
def test_rubber_that_begins_warmer_than_it_was_drawn_is_in_balance(T, loads) -> None:
    """It keeps its volume but for three times its strain of heat: one step of Newton's turned cells inside out."""
    half = rubber(*loads)
    factor = {f"load.{v.name.removeprefix('load.')}": 1.0 for v in half.variables if v.name.startswith("load.")}
    with closing(open_link("direct")) as link:
        began, _ = half.start(inputs_of(half, T) | factor, 0.0, link)
        state, _ = rubber(*loads).start(inputs_of(half, 300.0) | factor, 0.0, link)
        for k in range(1, 11):
            inputs = inputs_of(half, 300.0 + (T - 300.0) * k / 10.0) | factor
            state, _ = done(half.step(state, inputs, k - 1.0, 1.0, link))
    u = np.array(state.u)
    assert np.abs(np.array(began.u) - u).max() < 1e-6 * np.abs(u).max()
