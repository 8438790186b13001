"""Corners that press askew on faces that deform: a line of the trust table."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "mechanical_fmu"))

from test_bounce_on_a_corner import ABOVE, drawn

from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.surfaces.askew import NAME, Askew, AskewLog

DEEP = 2e-6  # [m] of the corner


def row(tilt: float, *, swapped: bool = False, rigid: tuple[str, ...] = (), augmented: bool = False,
        depths: tuple[float, ...] = (DEEP,), tilts: tuple[float, ...] | None = None,
        at_node: bool = False, dent: float = 0.0) -> Check | None:
    """The row of a block that stands on its corner, so deep in the floor at the ends of windows.

    at_node : the corner is beside a node of the floor, which it presses.  dent : how deep that node lies [m].
    """
    log, askew = AskewLog(), None
    for k, deep in enumerate(depths):
        interface, _ = drawn(tilt if tilts is None else tilts[k], swapped, split=False)
        bodies = {name: {"rigid": name in rigid} for name in interface.bodies}
        pairs = {pair.name: {"augmented": {} if augmented else None} for pair in interface.pairs}
        # As drawn each block is another mesh, of the same numbers.
        askew = Askew(interface, {"half": "elastic", "bodies": bodies, "pairs": pairs}) if k == 0 else askew
        x = interface.nodes.copy()
        x[interface.node_body == 1, 1] -= ABOVE + deep
        if at_node:
            floor = x[interface.surfaces["floor.top"].ravel(), 0]
            corner = x[interface.node_body == 1][x[interface.node_body == 1, 1].argmin(), 0]
            x[interface.node_body == 1, 0] += floor[np.abs(floor - corner).argmin()] - corner - deep
            x[interface.surfaces["floor.top"].ravel()[np.abs(floor - corner).argmin()], 1] -= dent
            x[interface.node_body == 1, 1] -= dent
        n_q = interface.pair_nodes.size
        level = Level(float(k + 1), np.full(len(x), 300.0), x, np.full(n_q, -1.0), np.zeros(n_q), np.ones(n_q))
        log = askew.watched(log, level)
    rows = askew.checks(log)
    assert all(one.name == NAME for one in rows)
    return rows[0] if rows else None


@pytest.mark.parametrize("tilt", [0.02, -0.17, 0.6])
def test_a_corner_that_stands_askew_is_told_by_its_sine(tilt: float) -> None:
    """Of one pressing edge the sine of its tilt; of two what both give: their forces are as 1/tan and tan."""
    told = row(tilt)
    assert told is not None
    sine, cosine = np.sin(abs(tilt)), np.cos(tilt)
    # By their normals both edges are as deep as depth/cos and depth/sin; steeper than 78 degrees one is not searched.
    loads = np.array([1.0 / (sine * cosine), 1.0 / (sine * cosine) if sine > 0.2 else 0.0])
    assert told.number == pytest.approx(abs(loads @ [sine, -cosine]) / loads.sum(), rel=1e-2)
    assert told.verdict is (TrustVerdict.NOTED if tilt == 0.02 else TrustVerdict.BROKEN)
    assert "Exchange slave and master" in told.remedy


@pytest.mark.parametrize("how", [{"swapped": True}, {"swapped": True, "at_node": True},
                                 {"rigid": ("floor",)}, {"rigid": ("floor", "block")}])
def test_what_pushes_along_the_face_is_not_told(how: dict[str, object]) -> None:
    told = row(0.17, **how)
    assert told is not None
    assert told.verdict is TrustVerdict.HOLDS
    assert told.number < 1e-3


@pytest.mark.parametrize(("swapped", "verdict"), [(False, TrustVerdict.BROKEN), (True, TrustVerdict.HOLDS)])
@pytest.mark.parametrize("depths", [(DEEP,), (0.0,)])
def test_pairs_with_multipliers_are_held_by_their_pressures(swapped: bool, verdict: TrustVerdict,
                                                            depths: tuple[float, ...]) -> None:
    """A steel wedge pressed on a steel floor by default was pushed aside by 0.18 of its load; their gap is about 0."""
    told = row(0.17, swapped=swapped, augmented=True, depths=depths)
    assert told is not None
    assert told.verdict is verdict


@pytest.mark.parametrize("augmented", [False, True])
def test_the_print_of_a_punch_is_no_corner(augmented: bool) -> None:
    """A plastic block kept the print of a punch's edge, and a right run had a broken row: what goes in is no corner."""
    told = row(0.17, swapped=True, augmented=augmented, at_node=True, dent=0.01)
    assert told is not None
    assert told.verdict is TrustVerdict.HOLDS


def test_a_faint_touch_counts_by_its_load() -> None:
    """What lands on its corner, and then lies flat on its side with all of its weight, is right where it counts."""
    told = row(0.17, depths=(DEEP, 100.0 * DEEP), tilts=(0.17, 0.0))
    assert told is not None
    assert told.verdict is TrustVerdict.HOLDS
    assert told.number < 1e-4
