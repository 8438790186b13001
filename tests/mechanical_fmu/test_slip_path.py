"""How far surfaces have slipped: of the step, and to and fro since the start."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.by_hand import HELD, two_blocks
from random_scenes.change import sides_swapped, turned
from random_scenes.scene import Scene
from random_scenes.story import Story, told

from coupler import load_scenario, run

MU, FAR, STICK = 0.2, 1e-3, 1e14


def dragged(**values: object) -> Scene:
    """A block pressed on another from the start, drawn aside by 1 mm in 4 s, back by half of it in 2 s, then held."""
    return two_blocks(gap=-1e-6, end=8.0, size=0.5, pair={"friction": {"mu": MU, "stick": STICK}},
                      mechanical__elastic__boundary=[
                          {"on": "lower.bottom", **HELD}, {"on": "upper.top", "u_y": 0, "u_x": {
                              "t": [0, 4, 6], "value": [0, FAR, 0.5 * FAR]}}],
                      materials__steel__alpha=0, materials__steel__nu=0, **values)


def on_slave(story: Story, name: str) -> np.ndarray:
    """(n_t, n) of the slave's nodes."""
    return np.array(story.extra[f"mechanical.contact.{name}"])[:, story.interface.pair_sides[0].at]


@pytest.fixture(scope="module")
def story() -> Story:
    found = told(dragged())
    assert found.outcome == "completed", found.message
    return found


def test_the_path_is_what_was_moved_less_what_bent(story: Story) -> None:
    """Blocks shear and the spring of sticking strains, at either turn: all else of 1.5 mm is slip."""
    path, slip = on_slave(story, "slip_path"), on_slave(story, "slip")
    np.testing.assert_allclose(path, np.abs(slip).cumsum(axis=0), rtol=1e-12, atol=1e-15)
    x = story.x[:, story.interface.pair_sides[0].nodes, 0]
    own = np.abs(np.diff(x, axis=0, prepend=x[:1])).sum(axis=0)
    assert path[-1].max() < own.max()
    np.testing.assert_allclose(path[-1], 1.5 * FAR, rtol=0.03)
    back = story.t > 4.1
    assert slip[~back].sum() * slip[back].sum() < 0.0
    np.testing.assert_allclose(np.abs(slip.sum(axis=0)), 0.5 * FAR, rtol=0.05)


def test_the_heat_is_the_shear_times_the_slip(story: Story) -> None:
    """Where all slips in one direction, node by node to what a node's mean leaves."""
    heat, p = on_slave(story, "E_friction").sum(axis=1), -story.t_N[:, story.interface.pair_sides[0].at]
    at = np.flatnonzero(np.isclose(story.t, 3.0))[0]
    reach = np.full(6, 0.006)
    reach[[0, -1]] = 0.003
    assert heat[at] == pytest.approx((MU * p[at] * np.abs(on_slave(story, "slip")[at]) * reach).sum(), rel=0.02)
    assert heat[at] > 0.0


def test_what_is_held_slips_no_more(story: Story) -> None:
    held = story.t > 6.1
    assert np.abs(on_slave(story, "slip")[held]).max() < 1e-6 * FAR
    assert np.ptp(on_slave(story, "slip_path")[held], axis=0).max() < 1e-6 * FAR


def test_steps_that_are_skipped_rub_nothing(story: Story) -> None:
    """At rest the half skips: it told the heat of the last step it solved once more in each of them."""
    skips = told(dragged(mechanical__elastic__skip={"u": 1e-9, "most": 100}))
    assert skips.outcome == "completed", skips.message
    heats = [on_slave(s, "E_friction").sum() for s in (skips, story)]
    assert heats[0] == pytest.approx(heats[1], rel=1e-6)
    np.testing.assert_allclose(on_slave(skips, "slip_path")[-1], on_slave(story, "slip_path")[-1], rtol=1e-6)


@pytest.mark.slow
def test_a_turned_scene_slips_alike(story: Story) -> None:
    other = told(turned(dragged(), 90.0).scene)
    np.testing.assert_allclose(on_slave(other, "slip"), on_slave(story, "slip"), rtol=0.0, atol=1e-6 * FAR)


@pytest.mark.slow
def test_either_side_tells_as_much() -> None:
    for scene in (dragged(), sides_swapped(dragged()).scene):
        assert on_slave(told(scene), "slip_path")[-1].mean() == pytest.approx(1.5 * FAR, rel=0.03)


def test_it_is_recorded_and_probed(tmp_path: Path) -> None:
    """In run.h5 and ParaView's file by pair node, and as a probe."""
    scene = dragged(probes={"worn": {"mechanical.contact.slip_path": {"max": "upper.bottom"}}},
                    output={"fields": {"every": 1}})
    results = run(load_scenario(scene.written(tmp_path)), out=tmp_path / "run.h5")
    _, worn = results.probe("worn")
    t, path = results.field("mechanical.contact.slip_path")
    assert t[-1] == 8.0
    assert worn[-1] == pytest.approx(np.nanmax(path[-1]), rel=1e-6)
    assert worn[-1] == pytest.approx(1.5 * FAR, rel=0.03)
    assert (np.diff(worn) >= 0.0).all()
    with h5py.File(tmp_path / "run.mechanical.vtkhdf") as file:
        assert "contact.slip_path" in file["VTKHDF/PointData"]
