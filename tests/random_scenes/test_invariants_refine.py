"""Refinement: quiet on what is right, loud where errors are understated or answers have no limit."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import coupler.control.error_estimate as error_estimate
import coupler.schemes.sweep as sweep
from random_scenes import invariants_refine as refine_laws
from random_scenes.refine import finer_mesh, finer_windows, tightly_iterated, windows_along, with_scheme
from random_scenes.scene import Scene
from random_scenes.small import adaptive, pressed
from random_scenes.story import told

pytestmark = pytest.mark.usefixtures("unlooked")


def short() -> Scene:
    """The scene in windows of its own, in which contact closes at 4.2 s, not to its end."""
    return adaptive().edited(coupling__end=8)


def found(check, scene: Scene) -> list[str]:
    story = told(scene)
    assert story.outcome == "completed", story.message
    return [f.what for f in check(scene, story, np.random.default_rng(0))]


def test_windows_and_cells_are_divided():
    scene = finer_windows(finer_mesh(pressed()), 2)
    assert [row["size"] for row in scene.doc["coupling"]["windows"]] == [1.0]
    assert scene.recipes["a"]["cells"] == [8, 4]
    assert pressed().doc["coupling"]["windows"][0]["size"] == 2.0, "nothing is written into the scene"
    halved = finer_windows(adaptive(), 2).doc["coupling"]["adaptive"]
    assert halved["first"] == 0.25
    assert halved["tolerance"]["temperature"] == {"atol": 0.025, "rtol": 0.005}
    assert halved["tolerance"]["gap"] == {"rtol": 5e-3}, "those left out are divided too, and atol goes with rtol"


@pytest.mark.slow
def test_windows_follow_those_of_a_run_in_equal_pieces():
    story = told(adaptive())
    cut = told(windows_along(adaptive(), story.t, 4))
    assert len(cut.t) == 4 * (len(story.t) - 1) + 1
    np.testing.assert_allclose(cut.t[::4], story.t, rtol=1e-9)


@pytest.mark.slow
def test_another_scheme_and_method_run():
    for scene in (with_scheme(pressed(), "mechanical_first", "sdirk2"), tightly_iterated(pressed(), 0.01)):
        story = told(scene)
        assert story.outcome == "completed", story.message


def test_moved_meshes_are_not_refined():
    scene = Scene(pressed().doc, pressed().recipes, pressed().shapes)
    assert not refine_laws.SETTLES.applies(scene)
    with pytest.raises(ValueError, match="no recipe"):
        finer_mesh(scene)


# The narrowest tolerances, which cost most, by one scheme.
@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "shares"), [("staggered", refine_laws.SHARES), ("iterated", (1, 4))],
                         ids=["staggered", "iterated"])
def test_errors_are_as_estimated(scheme, shares, monkeypatch):
    monkeypatch.setattr(refine_laws, "SHARES", shares)
    scene = short().edited(coupling__scheme=scheme)
    assert refine_laws.ESTIMATE.applies(scene)
    assert found(refine_laws.check_estimate, scene) == []


def test_errors_understated_are_found(monkeypatch):
    told_less = {k: error_estimate.Doubling(d.whole / 30, d.halves / 30) for k, d in error_estimate.DOUBLING.items()}
    monkeypatch.setattr(error_estimate, "DOUBLING", told_less)
    monkeypatch.setattr(refine_laws, "SHARES", (1,))
    assert any("times what was estimated" in text for text in found(refine_laws.check_estimate, short()))


@pytest.mark.slow
def test_answers_settle():
    assert refine_laws.SETTLES.applies(pressed())
    assert found(refine_laws.check_settles, pressed()) == []
    assert found(refine_laws.check_settles, short()) == []


def test_nothing_is_asked_of_layers_that_no_mesh_sees(monkeypatch):
    scene = pressed().edited(materials__al__k=1e-3)  # 4e-5 m in 20 s, cells of 3 mm when halved three times
    monkeypatch.setattr(refine_laws, "told", pytest.fail)
    assert found(refine_laws.check_settles, scene) == []


@pytest.mark.slow
def test_heat_that_grows_with_every_window_and_cell_is_found(monkeypatch):
    right = sweep.share_of

    def more(*how):
        return {name: share + (100.0 if name == "E_M" else 0.0) for name, share in right(*how).items()}

    monkeypatch.setattr(sweep, "share_of", more)
    assert any("no limit" in text for text in found(refine_laws.check_settles, pressed()))
