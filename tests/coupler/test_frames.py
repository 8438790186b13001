"""Which window ends become frames: where much changes, at events, within the budget; never by looking ahead."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.record.frames import EVENT, frame_choice, thinned
from coupler.record.gathered import gathered
from coupler.record.journal import JournalRecord
from coupler.record.results import Results
from coupler.record.tables import WINDOW_FIELDS
from coupler.schemes.levels import Level

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, blocks, header, level, probes_at

from coupler.record.recorder import Recorder

X = np.array([[0.0, 0.0], [1.0, 0.0]])
NONE = np.empty(0)


def at(t: float, T: float, shift: float = 0.0) -> Level:
    return Level(t, np.array([300.0, T]), X + shift, NONE, NONE, NONE)


def chosen(levels: list[Level], most: int, events: tuple[int, ...] = ()) -> tuple[list[int], int]:
    """The windows that are kept after thinning, and how often it was thinned."""
    choice, frames, times = frame_choice(most, levels[-1].t, 2, ()).begun(levels[0]), {}, 0
    for k, now in enumerate(levels[1:], 1):
        choice, keep, thin = choice.after(now, k in events, False)
        if thin:
            frames, times = thinned(frames, sorted(frames)), times + 1
        if keep:
            frames[k] = now.t
    return sorted(frames), times


def test_frames_are_where_temperatures_change() -> None:
    t = np.linspace(0.0, 1.0, 1001)
    kept, _ = chosen([at(s, 300.0 + 100.0 * np.clip((s - 0.4) / 0.1, 0, 1)) for s in t], 50)
    assert len(kept) <= 50
    inside = [k for k in kept if 400 <= k <= 500]
    assert len(inside) > 0.6 * len(kept)
    # After one thinning: twice 1.5 / 50 of change, of which plain time is a half.
    assert max(np.diff([0, *kept, 1000])) <= 120, "a rest has frames too"


def test_frames_are_where_bodies_move() -> None:
    t = np.linspace(0.0, 1.0, 1001)
    kept, _ = chosen([at(s, 400.0, float(np.clip((s - 0.4) / 0.1, 0, 1))) for s in t], 50)
    assert len([k for k in kept if 400 <= k <= 500]) > 0.6 * len(kept)


@pytest.mark.parametrize("most", [2, 7, 50])
def test_the_budget_holds_however_much_happens(most: int) -> None:
    rng = np.random.default_rng(1)
    kept, times = chosen([at(s, 300.0 + 100.0 * rng.random()) for s in np.linspace(0.0, 1.0, 3000)], most)
    assert most // 2 <= len(kept) <= most
    assert times > 3


def test_an_event_makes_a_frame_sooner_but_not_each_time() -> None:
    levels = [at(s, 400.0) for s in np.linspace(0.0, 1.0, 1001)]
    plain, _ = chosen(levels, 50)
    first = int(EVENT * plain[0]) + 2
    assert first < plain[0]
    assert chosen(levels, 50, (first,))[0][0] == first
    # Contact that changes in every window would have a frame in each.
    assert len(chosen(levels, 50, tuple(range(1001)))[0]) <= 50


def test_no_budget_no_choice_and_a_large_mesh_has_fewer() -> None:
    choice = frame_choice(0, 1.0, 2, ()).begun(at(0.0, 400.0))
    assert choice.after(at(1.0, 900.0), True, False)[1:] == (False, False)
    assert choice.after(at(1.0, 900.0), False, True)[1:] == (True, False)
    assert frame_choice(50, 1.0, 1_000_000, ()).most < 50 == frame_choice(50, 1.0, 1000, ()).most


def test_what_was_asked_for_stays_when_the_others_are_thinned(tmp_path: Path) -> None:
    case = replace(Case(), probes=False)
    scene = blocks(case.n)
    r = Recorder(tmp_path / "run.h5", header(case), scene)
    now = level(scene, 0.0)
    cells = len(scene.quads) + len(scene.triangles)
    r.start(now, probes_at(now, case.n)[:0])
    for k in range(8):
        r.frame(level(scene, 100.0 * k), {"sigma_v": np.zeros(cells)}, chosen=k not in (0, 3))
    r.thin()
    r.frame(level(scene, 900.0), {"sigma_v": np.zeros(cells)}, chosen=True)
    r.end("completed", "", {"seconds": 1.0})
    # Chosen 100, 200, 400 to 700: each second goes.
    assert Results(r.out).field("thermal.T")[0].tolist() == [0.0, 100.0, 300.0, 400.0, 600.0, 900.0]


def test_a_rewind_behind_a_thinning_brings_back_the_frames_from_before_it(tmp_path: Path) -> None:
    """Snapshot with frames 0 to 5, on to 19 with three thinnings, back to 5: as if nothing after it had been."""
    def row(k: int) -> JournalRecord:
        zero = {n: "" if kind.startswith("S") else 0 for n, kind in WINDOW_FIELDS}
        return JournalRecord("window", {**zero, "taken": True, "t_now": float(k), "terms": {}}, {"probes": NONE})

    def frame(k: int) -> JournalRecord:
        return JournalRecord("frame", {"t_now": float(k), "chosen": k > 0}, {})

    records = [JournalRecord("start", {"t_now": 0.0, "terms": {}}, {"probes": NONE}), frame(0)]
    for k in range(1, 20):
        records += [row(k), *[JournalRecord("thin", {}, {})] * (k in (8, 12, 16)), frame(k)]
    assert len(gathered(records).frames) < 10
    back = JournalRecord("rewind", {"t_now": 5.0, "rows": 5}, {})
    assert list(gathered([*records, back]).frames.values()) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    # One behind a thinning keeps that one, and undoes those after it.
    at_9 = list(gathered(records[:2 + 2 * 9 + 1]).frames.values())
    behind = JournalRecord("rewind", {"t_now": 9.0, "rows": 9}, {})
    assert list(gathered([*records, behind]).frames.values()) == at_9
    assert at_9 == [0.0, 1.0, 3.0, 5.0, 7.0, 8.0, 9.0]
