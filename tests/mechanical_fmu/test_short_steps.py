"""Steps so short that places are not known well enough: inertia makes their rounding a force, m du/dt2."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.model import Done
from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import inputs_of
from test_free_fall import G, falling

FALL = 0.5  # s


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("h", [1e-4, 1e-6, 1e-8, 1e-10])
def test_a_short_step_after_a_long_way_is_solved(h: float, rigid: bool) -> None:
    """After 1.2 m of fall rounding is 1e-16 m: 4e-5 N of a body of 1 kg in a step of 2 us, 0.4 N in one of 20 ns."""
    half, link = falling(rigid=rigid), open_link("direct")
    state, _ = half.start(inputs_of(half), 0.0, link)
    t = 0.0
    for step in (FALL, h, h, h):
        done = half.step(state, inputs_of(half), t, step, link)
        assert isinstance(done, Done), done
        state, t = done.state, t + step
    link.close()
    nodes = half.system.interface.node_body >= 0  # not the rows by which a rigid body turns
    # A rounded place is a rounded speed, du/dt of it; nothing worse comes of it.
    assert np.abs(np.array(state.v)[nodes, 1] - G[1] * t).max() < 1e-9 + 4e-15 / h
    assert np.abs(np.array(state.u)[nodes, 1] - 0.5 * G[1] * t**2).max() < 1e-9
