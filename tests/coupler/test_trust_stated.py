"""Pressures that a scenario states, on surfaces that are not in touch: a line of the trust table."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "mechanical_fmu"))

from mechanical_scenes import blocks

from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.surfaces.stated import NAME, Stated, StatedLog

RIGID = {"half": "rigid", "pressure": {"interface": 1e6}}


def row(gap_of, mechanical=RIGID, pressed: float = 1.0, cells: int = 8) -> Check | None:
    """The row of two blocks whose gap is gap_of(place along the slave from 0 to 1) [m]."""
    interface = blocks(cells, cells, gap=0.0)
    side = next(side for side in interface.pair_sides if side.own)
    s = interface.nodes[side.nodes, 0]
    n_q = interface.pair_nodes.size
    gap = np.zeros(n_q)
    gap[side.at] = [gap_of(one) for one in (s - s.min()) / np.ptp(s)]
    now = Level(2.0, np.full(len(interface.nodes), 300.0), interface.nodes, np.full(n_q, -pressed), gap, np.ones(n_q))
    stated = Stated(interface, mechanical)
    rows = stated.checks(stated.watched(StatedLog(), now))
    assert all(one.name == NAME for one in rows)
    return rows[0] if rows else None


@pytest.mark.parametrize("cells", [4, 8])
def test_what_is_pressed_across_a_gap_is_told_by_its_share(cells: int) -> None:
    """A block that stands on its first quarter: the rest is pressed through air.  A node stands for half of its edges.
    """
    told = row(lambda s: max(s - 0.25, 0.0), cells=cells)
    assert told is not None
    assert told.number == pytest.approx(0.75 - 0.5 / cells, abs=1e-9)
    assert told.verdict is TrustVerdict.BROKEN
    assert "rigid.pressure" in told.what
    assert told.t == 2.0


@pytest.mark.parametrize(("gap_of", "pressed"), [(lambda _: 0.0, 1.0), (lambda s: 1e-9 * s, 1.0), (lambda s: s, 0.0)])
def test_flat_sides_hold_and_so_does_what_presses_nothing(gap_of, pressed: float) -> None:
    told = row(gap_of, pressed=pressed)
    assert told is not None
    assert told.verdict is TrustVerdict.HOLDS
    assert told.number == 0.0


def test_other_halves_have_no_row() -> None:
    assert row(lambda s: s, {"half": "elastic", "pairs": {}}) is None
