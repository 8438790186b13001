"""Heat across a gap that the edges of round surfaces do not tell ends in the trust table."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from random_scenes.scene import Scene
from random_scenes.story import Story, told

from coupler.trust.surfaces.round_gaps import NAME, RoundGapLog, RoundGaps

R, GAP, K_G, G_M = 0.02, 2.0e-6, 0.03, 1.0e-6


def roller(edges: int, opened: dict[str, Any]) -> Story:
    """The lower quarter of a hot roller with so many edges, close above a cold plate, gas between them."""
    doc = {"slideline": 2, "title": "roller", "units": {"temperature": "K"}, "geometry": "plane",
           "materials": {"steel": {"rho": 7800, "k": 45, "c": 480}},
           "bodies": {"roller": {"material": "steel", "T0": 400}, "plate": {"material": "steel", "T0": 300}},
           "contact": {"gap": {"slave": "plate.top", "master": "roller.outer", "gap_max": 0.03,
                               "conduction": {"closed": {"law": "constant", "h": 3.0e4}, "open": opened}}},
           "thermal": {"half": "thermal", "boundary": [{"body": "roller", "temperature": 400},
                                                       {"body": "plate", "temperature": 300}]},
           "mechanical": {"half": "rigid", "rigid": {"motion": {"roller": {}}}},
           "probes": {"q": {"heat.pair.gap[1]": "value"}},
           "coupling": {"scheme": "staggered", "end": 1, "windows": [{"until": 1, "size": 0.5}]}}
    top = -R - GAP
    plate = {"patch": [[-0.015, top - 0.01], [0.015, top - 0.01], [0.015, top], [-0.015, top]], "cells": [17, 2]}
    return told(Scene(doc, {"roller": {"ring": [0.006, R], "angles": [225, 315], "cells": [2, edges]}, "plate": plate}))


def row(story: Story) -> tuple[float, str]:
    watch, log = RoundGaps(story.interface, story.scenario.models["thermal"]), RoundGapLog()
    for before, now in itertools.pairwise(story.levels):
        log = watch.watched(log, now, now.t - before.t)
    (check,) = watch.checks(log)
    return check.number, check.verdict.value


def missed(story: Story) -> float:
    """The share of what crosses between the arcs, over a second, that did not cross."""
    x = np.linspace(-R / np.sqrt(2.0), R / np.sqrt(2.0), 2_000_001)
    h = K_G / (G_M + GAP + R - np.sqrt(R**2 - x**2))
    return 1.0 - float(story.probes["q"][-1]) / float(100.0 * np.trapezoid(h, x))


GAS = {"law": "gas", "k_g": K_G, "g_m": G_M}


@pytest.mark.parametrize(("edges", "verdict"), [(6, "broken"), (12, "noted"), (24, "holds")])
def test_a_roller_whose_edges_do_not_tell_its_gap(edges: int, verdict: str) -> None:
    """32, 6.6 and -0.2 % of the heat do not cross: the run says so, at most 1.6 times as much."""
    story = roller(edges, GAS)
    share = missed(story) / (1.0 - missed(story))
    number, found = row(story)
    assert found == verdict
    if verdict == "holds":
        assert abs(share) < 3e-3
        assert number == 0.0
    else:
        assert share < number < 1.6 * share
        assert story.says(NAME)


def test_where_the_gap_does_not_matter_there_is_no_row() -> None:
    story = roller(6, {"law": "constant", "h": 500.0})
    assert RoundGaps(story.interface, story.scenario.models["thermal"]).checks(RoundGapLog()) == ()
    assert not story.says(NAME)
