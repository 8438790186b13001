"""Laws that jump at touch, joined over a small gap: what lies within it conducts in part as in touch."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Pair

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, Ran, run, scene, spec

JOIN = "contact.join"
OPEN = {"law": "constant", "h": 400.0}


def conducted(gap: float, join: float, opened: dict | None, p: float = 0.0) -> tuple[Ran, float]:
    """Two blocks at 500 and 300 K that face each other over 0.1 m2 a gap apart, for a moment."""
    mesh = scene(Box(0.0, 0.1, 0.0, 0.1, 3, 4), Box(0.0, 0.1, 0.1 + gap, 0.15 + gap, 4, 3),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 1e9),))
    model = spec([]) | {"materials": {"m": {"rho": 1000.0, "k": 45.0, "c": 3000.0}},
                        "bodies": {"a": {"material": "m", "T0": 500.0}, "b": {"material": "m", "T0": 300.0}},
                        "pairs": {"p": {"conduction": {"closed": {"law": "constant", "h": 2000.0}, "open": opened}}}}
    ran = run(mesh, model, 1e-6, 1, t_N=np.full(len(mesh.pair_nodes), -p), **{JOIN: join})
    out = ran.outputs[0]
    heat = {name: out[f"heat.{name}.slave"] for name in ("contact", "gap")}
    return ran, sum(heat.values()) / (1e-6 * 0.1 * 200.0)


@pytest.mark.parametrize("opened", [None, OPEN])
def test_conductance_fades_within_the_gap(opened: dict | None) -> None:
    apart = 400.0 if opened else 0.0
    for share in (1.0, 0.75, 0.25, 1e-3):
        _, h = conducted((1.0 - share) * 1e-7, 1e-7, opened)
        assert h == pytest.approx(share * 2000.0 + (1.0 - share) * apart, rel=1e-6)
    for gap in (1e-7, 2e-7, 1e-3):
        assert conducted(gap, 1e-7, opened)[1] == pytest.approx(apart, rel=1e-6)


def test_without_it_conductance_jumps_and_in_touch_nothing_changes() -> None:
    assert conducted(1e-12, 0.0, None)[1] == 0.0
    assert conducted(1e-12, -1.0, None)[1] == 0.0
    with_it, without = conducted(0.0, 1e-7, OPEN, p=1e6)[0], conducted(0.0, 0.0, OPEN, p=1e6)[0]
    np.testing.assert_array_equal(with_it.T, without.T)
    apart, before = conducted(1e-4, 1e-7, OPEN)[0], conducted(1e-4, 0.0, OPEN)[0]
    np.testing.assert_array_equal(apart.T, before.T)
