"""A half without inertia whose inputs stay as they are stands still from its first converged step on."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import blocks, done, elastic, hold, inputs_of

from contact.half.interface import Pair
from contact.rpc.link import open_link

TOLERANCE = 1e-9
STILL = 10.0 * TOLERANCE  # of what the jump moved: a residual of `TOLERANCE`, and little else
ENFORCED = {"penalty": None, "uzawa": {"method": "uzawa"}, "semi_smooth": {"method": "semi_smooth"}}


def courses(scene, enforced, mu=0.3, **pair):
    """Displacements after each of six steps: a jump of all loads, then five steps of the same inputs; and the last."""
    lower, upper, slave = scene
    interface = blocks(lower, upper)
    sides = ("upper.bottom", "lower.top") if slave == "upper" else ("lower.top", "upper.bottom")
    eps = 2.0e11 * upper
    interface = replace(interface, pairs=(Pair("interface", *sides, 0.5, eps, mu=mu, **pair),))
    jump = {"t": [0.0, 1.0, 10.0], "value": [0.0, 1.0, 1.0]}
    boundary = [hold("lower.bottom", 0), hold("lower.bottom", 1),
                *(hold("upper.top", i, {**jump, "value": [0.0, v, v]}) for i, v in ((0, 2.5e-7), (1, -1e-6)))]
    more = {} if enforced is None else {"pairs": {"interface": {"augmented": enforced}}}
    half = elastic(interface, boundary, tolerance=TOLERANCE, **more)
    # The upper block is warmer to one side: its surface slips outwards, unevenly.
    warm = 300.0 + 40.0 * np.where(interface.node_body == 1, interface.nodes[:, 0], 0.0)
    moved, outputs = [np.zeros_like(interface.nodes)], []
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for i in range(6):
            state, out = done(half.step(state, inputs_of(half, warm), float(i), 1.0, link))
            moved.append(np.array(state.u))
            outputs.append(out)
    return moved, outputs


SCENES = {"upper on finer": (4, 3, "upper"), "lower on coarser": (4, 3, "lower"), "like": (4, 4, "upper"),
          "unlike": (9, 5, "upper"), "unlike, the other slave": (9, 5, "lower")}


@pytest.mark.few(
    "unlike, the other slave-uzawa-nodes", "like-uzawa-two passes", "upper on finer-uzawa-two passes",
    "unlike-uzawa-edges")
@pytest.mark.parametrize("form", ["edges", "nodes", "two passes"])
@pytest.mark.parametrize("enforced", ENFORCED)
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_friction_does_not_creep(scene, form, enforced):
    """Part of the surface slips in the jump, part of it sticks: where the two meet nothing may slip again."""
    moved, outputs = courses(scene, ENFORCED[enforced], two_pass=form == "two passes", by_node=form == "nodes")
    first = np.abs(moved[1] - moved[0]).max()
    assert 0.0 < outputs[0]["contact.slipping"] < outputs[0]["contact.touching"]
    steps = [np.abs(b - a).max() for a, b in pairwise(moved[1:])]
    assert max(steps) <= STILL * first, (steps, first)
    heat = outputs[0]["contact.E_friction"].sum()
    assert heat > 0.0
    assert sum(out["contact.E_friction"].sum() for out in outputs[1:]) <= STILL * heat
