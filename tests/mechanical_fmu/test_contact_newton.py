"""B16 in contact: once nothing opens, closes, sticks or slips anew, Newton's method converges quadratically."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, blocks, done, elastic, hold, inputs_of

from contact.rpc.link import open_link
from mechanical_fmu.enforcement import ENFORCEMENTS

ROUND_OFF = 1e-14


@pytest.mark.parametrize(("mu", "two_pass"), [(0.0, False), (0.0, True), (0.2, False), (5.0, False)])
def test_the_last_residuals_fall_quadratically(mu, two_pass, monkeypatch):
    """Two blocks that do not match, squeezed by a tenth: faces bulge, cuts wander, normals turn, points slip."""
    histories = []

    def noted(*given):
        found = solve(*given)
        histories.append(found.history)
        return found

    solve = ENFORCEMENTS["penalty"]
    monkeypatch.setitem(ENFORCEMENTS, "penalty", noted)
    interface = blocks(4, 5)
    interface = replace(interface, pairs=tuple(replace(p, mu=mu, two_pass=two_pass) for p in interface.pairs))
    boundary = [hold("lower.bottom", 0), hold("lower.bottom", 1),
                hold("upper.top", 0, {"t": [0, 1, 2], "value": [0, 0, 0.01]}),
                hold("upper.top", 1, {"t": [0, 1, 2], "value": [0, -0.1, -0.2]})]
    half = elastic(interface, boundary, material={"alpha": 0.0}, tolerance=1e-10)
    half.settings = replace(half.settings, adopt=-1.0)
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for t in range(2):
            state, outputs = done(half.step(state, inputs_of(half), float(t), 1.0, link))
    assert outputs["contact.touching"] > 0
    last = [r for r in histories[-1] if r > ROUND_OFF][-3:]
    exponent = np.log(last[2] / last[1]) / np.log(last[1] / last[0])
    assert exponent >= EXPECTED["B16"]["exponent"], histories[-1]
