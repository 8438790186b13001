"""What is said of contact unasked: nothing faced, folds, stiff penalties; nodes slid off or pushed through."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from contact.half.diagnostics import (
    ContactLog,
    ContactMonitor,
    ContactSample,
    behind,
    facing_at,
    gaps_at_start,
    start_notes,
)
from contact.half.interface import Interface, Pair
from contact.messages import Floats

E, H = 1e9, 0.25
N = 5  # nodes along each face


def strips(gap: float = 0.0, slide: float = 0.0, **pair: object) -> Interface:
    """The faces of two bodies, one above the other; slave above."""
    s = np.linspace(0.0, 1.0, N)
    nodes = np.concatenate([np.column_stack([s + slide, np.full(N, gap)]), np.column_stack([1.0 - s, np.zeros(N)])])
    chain = np.column_stack([np.arange(N - 1), np.arange(1, N)]).astype(np.int32)
    none = np.empty(0, np.int32)
    given = Pair("p", "upper.bottom", "lower.top", 0.5, E / H)
    return Interface("plane", nodes, none.reshape(0, 4), none.reshape(0, 3), none, none, ("lower", "upper"), ("m", "m"),
                     {"upper.bottom": chain, "lower.top": chain + N}, {}, (replace(given, **pair),))


def test_nothing_is_said_of_a_pair_that_is_as_it_should_be() -> None:
    assert start_notes(strips(0.1), {"upper": E, "lower": 2 * E}) == []
    assert start_notes(replace(strips(), pairs=()), {}) == []


def test_a_pair_too_far_apart_is_named_with_its_distance() -> None:
    note, = start_notes(strips(0.75), {})
    assert "pair p: nothing of upper.bottom faces anything of lower.top" in note
    assert "0.75 m apart, gap_max is 0.5 m" in note


def test_a_pair_beside_each_other_is_told_from_one_too_far_apart() -> None:
    note, = start_notes(strips(0.0, slide=1.3), {})
    assert "0.3 m apart" in note
    assert "beside each other" in note


@pytest.mark.parametrize(("gap", "more", "told"), [
    (-0.02, {}, True), (-1e-5, {}, False), (0.0, {}, False), (-0.02, {"tied": True}, False)])
def test_bodies_drawn_into_each_other_are_told_with_depth_and_place(gap: float, more: dict[str, bool],
                                                                    told: bool) -> None:
    """Less than a rounding of coordinates is no news, and a tie leaves the drawn gap aside."""
    interface = strips(gap, **more)
    x = interface.nodes.copy()
    x[1, 1] += 0.5 * gap
    notes = start_notes(replace(interface, nodes=x), {})
    assert len(notes) == told
    if told:
        assert "pair p: upper.bottom and lower.top are drawn 0.03 m into each other" in notes[0]
        assert "deepest at (0.25, -0.03) m" in notes[0]
        assert "`clearance: 0`" in notes[0]


@pytest.mark.parametrize(("gap", "deep"), [(-0.25, True), (-0.02, False)])
def test_bodies_deep_in_each_other_are_asked_for_their_place(gap: float, deep: bool) -> None:
    """A tenth of what is thick is no fit that is meant."""
    note, = start_notes(strips(gap, gap_max=0.01), {})
    assert "that is a press fit" in note
    assert note.endswith("is a body in the wrong place?") is deep


@pytest.mark.parametrize(("gap", "told"), [
    (0.1, (0.1, 0.1)), (0.0, (0.0, 0.0)), (1e-9, (0.0, 0.0)), (-0.02, (-0.02, -0.02)), (0.75, None)])
def test_gaps_at_the_start_are_as_drawn(gap: float, told: tuple[float, float] | None) -> None:
    assert gaps_at_start(strips(gap)).get("p") == (None if told is None else pytest.approx(told, rel=1e-9))


def test_gaps_at_the_start_know_fits_and_tips() -> None:
    interface = strips(0.1)
    fit = replace(interface, offset={"p": np.full(2 * N, -0.1)})
    assert gaps_at_start(fit) == {"p": (0.0, 0.0)}
    x = interface.nodes.copy()
    x[2, 1] = 0.01
    least, most = gaps_at_start(replace(interface, nodes=x))["p"]
    assert least == pytest.approx(0.01, rel=1e-9)
    assert 0.1 <= most < 0.11, "gaps are along normals, which the tip tilts"


def test_a_pair_that_states_its_fit_is_not_told_of_the_drawing() -> None:
    interface = strips(-0.02)
    assert len(start_notes(interface, {})) == 1
    assert start_notes(replace(interface, offset={"p": np.full(2 * N, 0.01)}), {}) == []


def rings(gap: float, smooth: bool) -> Interface:
    """A quarter of a shaft of radius 1 in a hub, with edges whose nodes do not face each other."""
    counts = (7, 9)
    turn = [np.linspace(0.0, np.pi / 2, n) for n in counts]
    nodes = np.concatenate([r * np.column_stack([np.cos(a), np.sin(a)])
                            for r, a in ((1.0, turn[0]), (1.0 + gap, turn[1][::-1]))])
    shaft, hub = (np.column_stack([np.arange(n - 1), np.arange(1, n)]).astype(np.int32) for n in counts)
    return replace(strips(smooth=smooth), nodes=nodes,
                   surfaces={"upper.bottom": shaft, "lower.top": (hub + counts[0]).astype(np.int32)})


@pytest.mark.parametrize(("gap", "smooth", "told"), [
    (1e-3, True, ""), (1e-3, False, "arcs of which they are chords do not overlap"),
    (-4e-3, False, "that is a press fit"), (-4e-3, True, "are drawn 0.004 m into each other")])
def test_arcs_are_told_from_their_chords_that_overlap(gap: float, smooth: bool, told: str) -> None:
    """Edges of 0.2 lie 5e-3 inside their arcs: chords overlap, which presses nothing of a pair that is smooth."""
    notes = start_notes(rings(gap, smooth), {})
    assert len(notes) == bool(told)
    assert told in "".join(notes)


@pytest.mark.parametrize("smooth", [True, False])
def test_a_round_body_that_is_drawn_on_one_of_its_edges_is_told(smooth: bool) -> None:
    """A smooth roller of 24 edges, one of them on the floor, was shot up by 40 mm: its crown is 9e-3 in, no node is."""
    turn = -0.5 * np.pi + (np.arange(N + 1) - 0.5 * N) * np.pi / 12.0
    round_side = np.column_stack([np.cos(turn), np.sin(turn) + np.cos(np.pi / 24.0)])
    floor = np.column_stack([1.0 - 2.0 * np.linspace(0.0, 1.0, 4), np.zeros(4)])
    own = np.column_stack([np.arange(N), np.arange(1, N + 1)]).astype(np.int32)
    interface = replace(strips(smooth=smooth), nodes=np.concatenate([round_side, floor]),
                        surfaces={"upper.bottom": own, "lower.top": own[:3] + N + 1})
    notes = start_notes(interface, {})
    assert len(notes) == smooth
    if smooth:
        assert "into each other, deepest at (" in notes[0]


def test_a_surface_that_faces_itself_says_what_it_leaves_out() -> None:
    interface = strips(master="upper.bottom")
    notes = start_notes(interface, {})
    assert len(notes) == 2, "it faces nothing at the start either: it is flat"
    assert "overlaps by more than 0.25 of an edge (0.0625 m at the shortest)" in notes[1]


@pytest.mark.parametrize(("factor", "said"), [(0.9e4, False), (1.1e4, True)])
def test_a_penalty_that_spoils_the_matrix_is_named(factor: float, said: bool) -> None:
    """Against the softer of the two: 1e6 to 1 is no reason to take the harder one's."""
    notes = start_notes(strips(eps_N=factor * E / H), {"upper": 1e6 * E, "lower": E})
    assert len(notes) == said
    if said:
        assert "1.1e+04 times E/h (E of lower, h = 0.25 m)" in notes[0]
        assert "4e+10 to 4e+11 Pa/m" in notes[0]


def contact(interface: Interface, move: Floats | None = None, pressed: bool = False) -> ContactSample:
    """Upper face moved; pressed : every node was under pressure."""
    x = interface.nodes.copy()
    x[:N] += 0.0 if move is None else move
    t_N = np.full(2 * N, -1.0 if pressed else 0.0)
    facing = facing_at(interface, x)
    return ContactSample(x, t_N, facing.node_covered, facing.node_gap)


def after(interface: Interface, *moves: Floats, crosses: dict[str, float] | None = None,
          torn: dict[str, tuple[float, float]] | None = None, pressed: bool = False) -> tuple[ContactLog, list[str]]:
    """pressed : at the end of the first window, too."""
    watch, seen, said = ContactMonitor(interface, crosses, torn), ContactLog(), []
    for k, move in enumerate(moves):
        now = contact(interface, move, pressed and k == 0)
        seen, notes = watch.after_window(seen, float(k + 1), contact(interface, pressed=True), now)
        said += notes
    return seen, said + watch.at_end(seen, contact(interface, moves[-1]).x)


def test_pushed_deeper_than_the_search_looks_is_not_silent() -> None:
    interface = strips()
    seen, said = after(interface, np.array([0.0, -0.2]), np.array([0.0, -0.3]), np.array([0.0, -0.4]))
    assert seen.lost == {"p"}
    assert len(said) == 1, "once a pair"
    assert "by t = 2 s 5 nodes of upper.bottom went through lower.top, up to 0.3 m deep" in said[0]
    assert "(it looks 0.25 m deep)" in said[0]


def test_lifted_off_is_no_news() -> None:
    assert after(strips(), np.array([0.0, 0.2]), np.array([0.0, 0.8]))[1] == []


def test_heat_that_ends_beyond_gap_max_is_told() -> None:
    """Lifted within reach, beyond it, and slid off: only what goes beyond it leaves heat out."""
    gap_max = strips().pairs[0].gap_max
    up = np.array([0.0, 1.0])
    for moves, told in (((0.2 * up, 0.9 * gap_max * up), False), ((0.2 * up, 1.5 * gap_max * up), True),
                        ((np.array([0.6, 0.0]),), False)):
        seen, said = after(strips(), *moves, crosses={"p": 45.0})
        assert ("p" in seen.far) is told
        assert any("than gap_max" in note for note in said) is told
        if told:
            assert said == [f"pair p: 5 nodes of upper.bottom went farther from lower.top than gap_max, {gap_max:.3g} "
                            "m, the first by t = 2 s: no heat crosses there, though at that gap 45 W/m2K would. State "
                            "a larger gap_max"]


@pytest.mark.parametrize(("gaps", "laws", "pressed", "told"), [
    ((0.0, 0.0), (0.0, 1500.0), False, True), ((0.0, 1e-8), (20.0, 1500.0), False, True),
    ((0.0, 0.0), (0.0, 1500.0), True, False), ((0.0, 1e-3), (0.0, 1500.0), False, False),
    ((0.0, 0.0), (1500.0, 20.0), False, False), ((0.0, 0.0), None, False, False)])
def test_surfaces_that_touch_but_never_press_are_told(gaps: tuple[float, float], laws: tuple[float, float] | None,
                                                      pressed: bool, told: bool) -> None:
    """Two bars drawn in touch, half rigid, `closed` of 1500 W/m2K, `open: null`: no heat crossed, with exit 0."""
    moves = [np.array([0.0, gap]) for gap in gaps]
    said = after(strips(), *moves, torn=laws and {"p": laws}, pressed=pressed)[1]
    assert len(said) == told
    if told:
        assert laws is not None
        assert f"they conducted {laws[0]:g} W/m2K as if they were apart, and not the 1.5e+03 W/m2K of" in said[0]
        assert "mechanical.rigid.pressure.p" in said[0]


@pytest.mark.parametrize("sink", [0.0, 1e-3])
def test_slid_off_the_end_is_told_at_the_end(sink: float) -> None:
    """A block on a penalty sinks in a little: its corner past the end is beside the other, not through it.

    The third node has left too, but its edge still faces something.
    """
    seen, said = after(strips(), np.array([0.6, -sink]))
    assert not seen.lost
    assert said == ["pair p: 2 nodes of upper.bottom slid off the end of lower.top, the first by t = 1 s"]


def test_a_pair_that_never_faced_is_named_at_the_end() -> None:
    interface = strips(2.0)
    seen, said = after(interface, np.array([0.0, -1.0]))
    assert not seen.faced
    assert "upper.bottom and lower.top never faced each other; in the end their nearest nodes are 1 m apart" in said[0]
    assert after(interface, np.array([0.0, -1.0]), np.array([0.0, -1.9]), np.array([0.0, 0.0]))[1] == []


def test_behind_a_corner() -> None:
    """An L of two edges, the body below and to its left; points before, behind, and beyond its ends."""
    edges = np.array([[[1.0, -1.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]]])
    depth, beside = behind(edges, np.array([[0.5, 0.1], [0.5, -0.1], [0.9, -0.5], [-0.2, -0.1], [1.1, -1.5]]))
    assert depth == pytest.approx([-0.1, 0.1, 0.1, 0.1, -0.1])
    assert beside.tolist() == [False, False, False, True, True]
