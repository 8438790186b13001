"""A canister in a fire: its contents lift the lid off, and what a run without motion says instead."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.report.comparison import compare, sentence

pytestmark = pytest.mark.slow

SCENE = Path(__file__).resolve().parents[2] / "scenarios/sealed_container_fire.yaml"
# The fire is out at 1200 s, the air cold at 1260 s, the gap at its widest at 1350 s; what follows is cooling.
END, OUT = 1440.0, 1200.0
ALPHA_SALT, ALPHA_STEEL, HEIGHT, ROOM = 4.2e-5, 1.35e-5, 0.12, 0.5e-3


@pytest.fixture(scope="module")
def coupled(tmp_path_factory) -> Results:
    return run(load_scenario(SCENE, overrides={"coupling.end": END}), tmp_path_factory.mktemp("fire") / "coupled.h5")


@pytest.fixture(scope="module")
def rigid(tmp_path_factory) -> Results:
    changes = {"coupling.end": END, "mechanical.half": "rigid"}
    return run(load_scenario(SCENE, overrides=changes), tmp_path_factory.mktemp("rigid") / "rigid.h5")


def at(results: Results, name: str, t: float) -> float:
    return float(np.interp(t, *results.probe(name)))


def test_it_is_to_be_trusted(coupled: Results) -> None:
    assert coupled.outcome == "completed", coupled.message
    assert [f"{c.name}: {c.what}" for c in coupled.broken] == []


def test_the_lid_is_lifted_and_the_gap_is_widest_after_the_fire(coupled: Results) -> None:
    t, gap = coupled.probe("seat.gap")
    assert np.abs(gap[t <= 480]).max() < 1e-5  # closed but for the tilt of the rim, 2 um
    assert 480 < t[np.flatnonzero(gap > 5e-5)[0]] <= 600
    # Windows of a quarter of the size: 1.3403 mm at 1200 s, 1.6374 mm at 1350 s; half a per cent for what they differ.
    assert at(coupled, "seat.gap", OUT) == pytest.approx(1.3403e-3, rel=0.005)
    assert gap.max() == pytest.approx(1.6374e-3, rel=0.005)
    assert OUT + 60 < t[gap.argmax()] < OUT + 240
    lift = coupled.probe("lid.lift")[1] - coupled.probe("rim.lift")[1]
    # Of the lid's middle and of its seat: they differ by the lid's own bow, a tenth of a millimetre.
    assert np.abs(lift - gap)[t > 600].max() < 0.15e-3


def test_the_gap_is_what_a_sheet_of_paper_says(coupled: Results) -> None:
    """Growth of the salt less that of the wall less the room above it; 10 %, for ends that are not flat."""
    for t in (900.0, OUT, 1350.0):
        salt = ALPHA_SALT * (at(coupled, "salt.mean", t) - 293.15) * HEIGHT
        wall = ALPHA_STEEL * (at(coupled, "wall.mean", t) - 293.15) * (HEIGHT + ROOM)
        assert at(coupled, "seat.gap", t) == pytest.approx(salt - wall - ROOM, rel=0.1)


def test_without_motion_there_is_no_leak_and_heat_takes_another_way(coupled: Results, rigid: Results) -> None:
    assert np.abs(rigid.probe("seat.gap")[1]).max() < 1e-12
    c = compare(coupled, rigid)
    by = {d.curves.name: d for d in c.differences}
    # Of windows of a quarter of the size; 5 % for what they change.
    assert by["salt.side.T"].by == pytest.approx(-44.32, rel=0.05)
    # A lid that stays on the hot rim is heated by it.
    assert by["lid.edge.T"].by == pytest.approx(104.9, rel=0.05)
    assert by["seat.gap"].by == pytest.approx(-1.6374e-3, rel=0.005)
    told = sentence(c, ("coupled.h5", "rigid.h5"), "degC")
    assert told.startswith("rigid.h5 differs from coupled.h5 by up to 10")
    assert "1.64 mm in gap (seat.gap at vessel at (0.043, 0.1265), t = 13" in told


def test_no_heat_is_lost(coupled: Results, rigid: Results) -> None:
    assert coupled.heat_imbalance < 1e-10
    assert rigid.heat_imbalance < 1e-10
