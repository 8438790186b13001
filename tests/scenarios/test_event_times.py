"""C9, when things happen: events of the sliding blocks, and of copies of them, at the same times.

The scene is short here, and told without the times of touch and slip-off, which are then no kinks: the upper block
comes down at an even pace, touches, is pressed, and slides off.  Times agree to 1e-6 of themselves.
"""

from __future__ import annotations

import copy
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_same_scene import ROOT, in_inches, mirrored, moved, renumbered, scene, solve, turned

import coupler.scenario.load as loading
from coupler import Results

pytestmark = pytest.mark.usefixtures("unlooked")

CASE = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["C9"]
HIGH, GAP, DEEP, WIDTH = 0.05, 0.0508, 0.0508069342, 0.0762  # m: stroke at first, at touch, pressed; of the blocks
DOWN, END = 600.0, 1200.0  # s: pressed, and from then on sliding; the end
TOUCH = DOWN * (GAP - HIGH) / (DEEP - HIGH)
Tree = dict[str, Any]


def uneven() -> Tree:
    """The scene with a coarser mesh still, touch and slip-off between the ends of windows."""
    tree = scene()
    for body, cells in (("lower", [4, 2]), ("upper", [5, 2])):
        tree["bodies"][body]["mesh"]["rectangle"]["cells"] = cells
    tree["signals"] |= {"stroke": {"t": [0, DOWN], "value": [-HIGH, -DEEP]},
                        "slide": {"t": [0, DOWN, END], "value": [0, 0, 1.1 * WIDTH]},
                        "squeeze": {"t": [0, END], "value": [1e7, 1e7]}, "gap_gas": 1}
    tree["coupling"] = {"scheme": "extrapolated", "end": END, "events": {"locate": True},
                        "windows": [{"until": DOWN, "size": 50}, {"until": END, "size": 40}]}
    return tree


def happened(results: Results) -> list[tuple[str, float]]:
    """What happened, and when [s]."""
    w = results.windows
    return [(text, float(w.t[k] + w.H[k])) for k, text in results.events.items() if w.taken[k]]


def assert_same_times(one: Results, other: Results) -> None:
    first, second = happened(one), happened(other)
    assert [text for text, _ in second] == [text for text, _ in first]
    assert [t for _, t in second] == pytest.approx([t for _, t in first], rel=CASE["event_times"])


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Results:
    return solve(tmp_path_factory.mktemp("original"), uneven(), "elastic")


def test_touch_and_slip_off_are_found_where_they_are(original):
    (closes, touch), (opens, off) = happened(original)
    assert (closes, opens) == ("pair interface closes", "pair interface opens")
    assert touch == pytest.approx(TOUCH, abs=1e-4)  # 1e-6 of 50 s behind it
    # Where the upper block's lower left corner passes the lower one's right end; pressed blocks are a little wider.
    assert off == pytest.approx(DOWN + (END - DOWN) / 1.1, abs=0.2)
    w = original.windows
    assert (~w.taken).sum() <= 5
    # One window more for each event.
    assert w.taken.sum() == 12 + 15 + 2


@pytest.mark.few("mirrored in_inches")
@pytest.mark.parametrize("changes", [(moved, turned), (mirrored, in_inches)],
                         ids=lambda some: " ".join(change.__name__ for change in some))
def test_a_copy_has_its_events_at_the_same_times(original, changes: tuple[Callable[[Tree], Tree], ...], tmp_path):
    tree = copy.deepcopy(uneven())
    for change in changes:
        tree = change(tree)
    assert_same_times(original, solve(tmp_path, tree, "elastic"))


def test_renumbered(original, monkeypatch, tmp_path):
    scene_of = loading.scene_of

    def other(*given: Any) -> Any:
        found = scene_of(*given)
        return replace(found, interface=renumbered(found.interface))

    monkeypatch.setattr(loading, "scene_of", other)
    assert_same_times(original, solve(tmp_path, uneven(), "elastic"))


@pytest.mark.slow
@pytest.mark.parametrize("half", ["rigid", "elastic"])
def test_what_the_schedule_has_as_a_kink_is_not_cut_again(half: str, tmp_path):
    """The scene as it is told: touch at 10000 s and, of rigid blocks, slip-off at 14772.7 s are kinks."""
    tree = scene()
    tree["coupling"]["events"] = {"locate": True}
    located = solve(tmp_path, tree, half)
    if half == "rigid":
        assert located.windows.taken.all()
        assert len(located.windows.t) == 113
        return
    # Elastic blocks spread, and part when they do: that is found, and nothing else.
    put_back = located.windows.t[~located.windows.taken]
    assert ((put_back > 14772.0) & (put_back < 14777.0)).all(), put_back
