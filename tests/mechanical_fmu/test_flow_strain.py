"""flow and flow_rate: the equivalent inelastic strain of a bar drawn out without change of volume, and its rate."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, done, elastic, hold, inputs_of

RATE, K, M, E, NU, DT = 1e-3, 1e9, 0.5, 70e9, 0.3, 5.0


def drawn(steps: int, **material: object) -> list[dict]:
    """Outputs, step by step, of a plane bar drawn at the logarithmic rate RATE.  Two cells of unequal size."""
    t = np.arange(steps + 1) * DT
    draw = {"t": list(t), "value": list(np.expm1(RATE * t))}
    half = elastic(block([0.0, 0.4, 1.0], [0.0, 0.5]),
                   [hold("block.left", 0), hold("block.bottom", 1), hold("block.right", 0, draw)],
                   {"E": E, "nu": NU, "alpha": 0.0, **material}, element="enhanced")
    state, outputs = half.start(inputs_of(half), 0.0, NoLink())
    told = [outputs]
    for i in range(steps):
        state, outputs = done(half.step(state, inputs_of(half), i * DT, DT, NoLink()))
        told.append(outputs)
    return told


def elastic_share(q: float) -> float:
    return q * (1.0 + NU) / (1.5 * E) + q / 3.0 * 3.0 * (1.0 - 2.0 * NU) / E


def test_it_is_the_strain_less_the_elastic_part() -> None:
    """Plane strain: e = 2/sqrt3 (RATE t), less what is elastic once the stress stands, q = K (de/dt)^M:

    q/(3 G), and (tr E)/sqrt3 of the change of volume under the mean stress q/sqrt3.
    """
    told = drawn(12, creep={"K": K, "m": M})
    e = 2.0 / np.sqrt(3.0) * RATE * DT * np.arange(13)
    elastic_part = elastic_share(K * (2.0 / np.sqrt(3.0) * RATE) ** M)
    assert told[0]["flow.block"] == told[0]["flow_rate.block"] == 0.0
    assert [o["flow.block"] for o in told[4:]] == pytest.approx(e[4:] - elastic_part, rel=1e-3)
    for before, o in pairwise(told):
        assert o["flow_rate.block"] == pytest.approx((o["flow.block"] - before["flow.block"]) / DT, rel=1e-12)
    assert told[-1]["flow_rate.block"] == pytest.approx(2.0 / np.sqrt(3.0) * RATE, rel=1e-3)


def test_plastic_strain_counts_too() -> None:
    (*_, last) = drawn(6, plastic={"s_y": 50e6})
    e = 2.0 / np.sqrt(3.0) * RATE * DT * 6 - elastic_share(50e6)
    assert last["flow.block"] == pytest.approx(e, rel=2e-3)


def test_what_cannot_flow_tells_nothing() -> None:
    (_, last) = drawn(1)
    assert not [name for name in last if name.startswith("flow")]
