"""A corner of two pairs in a whole run: a wall that presses nothing passes neither force nor heat, in any order."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

NAMES = {"floor": ("block.bottom", "ground.top"), "wall": ("block.left", "post.right")}
OFF = 2e-7  # m, the wall from the block, less than 1e-4 of gap_max


def corner(n: int, order: tuple[str, str] = ("floor", "wall"), off: float = OFF, mu: float = 0.0) -> Scene:
    """A hot block pressed on the ground by its top, a post beside it that conducts only where it is pressed."""
    conduction = {"closed": {"law": "constant", "h": 2.0e4}, "open": None}
    pairs: dict[str, Any] = {name: {"slave": NAMES[name][0], "master": NAMES[name][1], "gap_max": 0.01,
                                    "conduction": conduction, **({"friction": {"mu": mu}} if mu else {})}
                             for name in order}
    boundary = [{"on": "ground.bottom", "u_x": 0, "u_y": 0}, {"on": "post.left", "u_x": 0, "u_y": 0},
                {"on": "block.top", "u_x": {"t": [0, 1, 3], "value": [0, 0, 1e-6 if mu else 0]},
                 "u_y": {"t": [0, 1], "value": [0, -2e-6]}}]
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
           "materials": {"m": {"rho": 7800, "c": 480, "k": 45, "E": 2e11, "nu": 0.0, "alpha": 0, "T_ref": 300}},
           "bodies": {b: {"material": "m", "T0": 400 if b == "block" else 300} for b in ("ground", "post", "block")},
           "contact": pairs, "thermal": {"half": "thermal", "method": "backward_euler"},
           "mechanical": {"half": "elastic", "elastic": {"boundary": boundary}},
           "coupling": {"end": 3, "windows": [{"until": 3, "size": 1}]},
           "probes": {"beside": {"p": {"max": "block.left"}}, "below": {"p": {"min": "block.bottom"}}}}
    L = 0.04
    return Scene(doc, {"ground": {"patch": [[0, -L], [L, -L], [L, 0], [0, 0]], "cells": [n, n]},
                       "post": {"patch": [[-L, 0], [-off, 0], [-off, L], [-L, L]], "cells": [n, n + 1]},
                       "block": {"patch": [[0, 0], [L, 0], [L, L], [0, L]], "cells": [n, n]}})


def completed(scene: Scene) -> Story:
    story = told(scene)
    assert story.outcome == COMPLETED, story.message
    return story


@pytest.mark.parametrize("n", [3, 6])
def test_a_wall_that_presses_nothing_passes_neither_force_nor_heat(n: int) -> None:
    story = completed(corner(n))
    post = story.interface.bodies.index("post")
    assert np.abs(story.extra["mechanical.reaction.post"]).max() < 1e-11 * 2e5  # N, round-off of the load
    of_post = story.interface.node_body == post
    assert np.abs(story.T[:, of_post] - 300.0).max() < 1e-9
    assert story.T[-1][story.interface.node_body == story.interface.bodies.index("ground")].max() > 301.0
    beside, below = (np.asarray(story.probes[name]) for name in ("beside", "below"))
    assert not beside.any()
    assert below[-1] > 4e6


def test_the_order_of_the_pairs_changes_nothing() -> None:
    """In a whole run, with friction at Coulomb's bound and the wall closed and opened on the way."""
    one, other = (completed(corner(4, order, off=0.0, mu=0.1)) for order in (("floor", "wall"), ("wall", "floor")))
    assert np.abs(one.T - other.T).max() < 1e-9 * np.ptp(one.T)
    assert np.abs(one.x - other.x).max() < 1e-9 * np.abs(one.x - one.x[0]).max()
    for name, at in NAMES.items():
        a, b = (story.t_N[:, story.interface.side_of(name, at[0]).at] for story in (one, other))
        assert np.abs(a - b).max() < 1e-6 * np.abs(one.t_N).max()
    for name, J in one.ledger.items():
        assert np.abs(J - other.ledger[name]).max() <= 1e-8 * max(np.abs(v).max() for v in one.ledger.values()), name
    assert one.ledger["friction.slave"][-1] > 0.0
