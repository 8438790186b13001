"""Loads far below what bends steel: a residual is small against the forces there are, whatever bears them.

Two blocks of 1 m, pressed together: what one bears on the other is the load, 1 Pa to 1 MPa, and goes with it.
"""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import blocks, done, elastic, hold, inputs_of, press

HELD = [hold("lower.bottom", 0), hold("lower.bottom", 1), hold("upper.left", 0)]
NEARLY = 2e-5  # a residual is at most 1e-8 of 1000 times the forces
ROUND_OFF = 3.3e-4  # [N] of what cells bear, 2e-15 of the bulk modulus and 1 m: what may be left of 1 Pa
LOADS = [1.0, 1e2, 1e4, 1e6]


def borne(p, method="newton", augmented=True, steps=(1.0,), away=0.0):
    """The pressures that p [Pa] on top makes between the blocks, put on in such parts, and the force below [N].

    away [m] : from the origin, in x and in y.
    """
    near = blocks(4, 5)
    interface = replace(near, nodes=near.nodes + away)
    pairs = {"interface": {"augmented": {"tolerance": 1e-9, "method": "semi_smooth"}}} if augmented else {}
    load = {"t": [0.0, *np.arange(1.0, len(steps) + 1.0)], "value": [0.0, *(p * s for s in steps)]}
    half = elastic(interface, [*HELD, press("upper.top", load)], pairs=pairs, method=method)
    with closing(open_link("direct")) as service:
        state, outputs = half.start(inputs_of(half), 0.0, service)
        for i in range(len(steps)):
            state, outputs = done(half.step(state, inputs_of(half), float(i), 1.0, service))
    side = interface.pair_sides[0]
    return -outputs["contact.t_N"][side.at], float(outputs["reaction.lower"][1])


@pytest.mark.parametrize("method", ["newton", "modified_newton", "bfgs"])
@pytest.mark.parametrize("p", LOADS)
def test_what_is_borne_is_the_load(p, method):
    """Of 1 Pa the blocks told 0.3 mPa, and of 100 Pa 98: the residual was held against 1e-4 of E L."""
    _, force = borne(p, method)
    assert force == pytest.approx(p * 1.0, rel=NEARLY)


def test_pressures_go_with_the_load():
    """A linear scene, but for strain of second order: its pattern is that of a load of any size."""
    patterns = [borne(p)[0] / p for p in LOADS]
    for pattern in patterns[:-1]:
        np.testing.assert_allclose(pattern, patterns[-1], rtol=0.0, atol=ROUND_OFF)


def test_a_small_change_of_a_load_is_followed():
    """Not only once it adds up to more than the tolerance: a part of a thousandth, put on in one step."""
    _, force = borne(100.0, steps=(1.0, 1.001))
    assert force == pytest.approx(100.1, rel=NEARLY)


@pytest.mark.parametrize("augmented", [False, True], ids=["penalty", "multipliers"])
def test_far_from_the_origin_nothing_is_asked_that_numbers_cannot_tell(augmented):
    """At 100 m gaps are good to 1e-14 m, pressures of the penalty to 0.01 Pa: what is left of 100 Pa is round-off."""
    _, force = borne(100.0, augmented=augmented, away=100.0)
    assert force == pytest.approx(100.0, rel=1e-3)
