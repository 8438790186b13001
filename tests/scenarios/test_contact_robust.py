"""C9, contact by itself: forces, pressures and gaps where the projection has a choice.

Concave and convex vertices, a node over the place where two segments meet, two branches one above the other, surfaces
that touch at the start, ends above ends; edges told in reverse order; one side 1e6 times as stiff. Each scene is moved,
turned by 90 degrees, mirrored and renumbered, and the answer must go with it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "contact"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "mechanical_fmu"))
from contact_scenes import EXPECTED, mirrored, passes, push, renumbered, scene
from mechanical_scenes import STEEL, blocks, done, hold, inputs_of

from contact.messages import Floats, Register
from contact.pair_nodes import pair_layout_of
from contact.rpc.link import open_link
from mechanical_fmu.elastic_half import load

CLOSE = 1e-9
Scene = tuple[Register, Floats]


def block(n: int, low: float = -0.5, high: float = 0.5, y: float = -1e-3) -> Floats:
    """The flat underside of a slave block."""
    return np.column_stack([np.linspace(low, high, n + 1), np.full(n + 1, y)])


def line(*points: tuple[float, float]) -> Floats:
    return np.array(points, dtype=float)


SCENES: dict[str, Callable[[], Scene]] = {
    "convex vertex": lambda: scene(block(6, y=-0.02), line((0.8, -0.2), (0.0, 0.0), (-0.8, -0.2))),
    "concave vertex": lambda: scene(line((-0.5, 0.12), (0.0, -1e-3), (0.5, 0.12)),
                                    line((0.8, 0.2), (0.0, 0.0), (-0.8, 0.2))),
    "node over a vertex": lambda: scene(block(4), line((0.9, 0.0), (0.25, 0.0), (0.0, 0.0), (-0.25, 0.0),
                                                       (-0.9, 0.0))),
    # A shelf above a floor: both face up.
    "two candidates": lambda: scene(block(5), line((0.9, 0.0), (-0.9, 0.0), (-0.9, -0.05), (0.9, -0.05), (0.9, -0.3),
                                                   (-0.9, -0.3))),
    "touching at the start": lambda: scene(block(5, y=0.0), line((0.9, 0.0), (0.1, 0.0), (-0.9, 0.0))),
    "ends above ends": lambda: scene(block(5), line((0.5, 0.0), (0.1, 0.0), (-0.5, 0.0))),
    "end above a node": lambda: scene(block(5, low=-0.1), line((0.7, 0.0), (-0.1, 0.0), (-0.7, 0.0))),
}
SCENE = pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)


def at_nodes(scene: Scene, values: Floats) -> Floats:
    """(n_s,) values of pair nodes at their nodes; of one pair, which has each node once."""
    told = np.zeros(len(scene[1]))
    told[pair_layout_of(scene[0]).node] = values
    return told


def assert_same(before: Scene, after: Scene, node: Floats, turn: Floats) -> None:
    """The scene after is the one before with its nodes renumbered (old -> new) and its vectors turned."""
    one, other = push(*before), push(*after)
    scale = max(np.abs(one.force).max(), 1.0)
    assert np.abs(other.force[node] - one.force @ turn.T).max() <= CLOSE * scale
    for name in ("t_N", "node_gap", "node_covered"):
        a, b = at_nodes(before, getattr(one, name)), at_nodes(after, getattr(other, name))[node]
        assert np.abs(a - b).max() <= CLOSE * max(np.abs(a).max(), 1.0), name
    assert one.n_touching == other.n_touching


@SCENE
@pytest.mark.parametrize("change", ["moved", "turned", "mirrored", "renumbered"])
def test_the_answer_goes_with_the_scene(make: Callable[[], Scene], change: str) -> None:
    register, x = make()
    node, turn = np.arange(len(x)), np.eye(2)
    if change == "moved":
        other = register, x + [0.37, -1.9]
    elif change == "turned":
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        other = register, x @ turn.T
    elif change == "mirrored":
        turn = np.diag([-1.0, 1.0])
        other = mirrored(register, x)
    else:
        new, x_new, node, _ = renumbered(register, x)
        other = new, x_new
    assert_same((register, x), other, node, turn)


@SCENE
def test_edges_in_reverse_order_are_the_same_surface(make: Callable[[], Scene]) -> None:
    register, x = make()
    p = register.passes
    reverse = replace(register, edges=np.ascontiguousarray(register.edges[::-1]),
                      edge_surface=1 - register.edge_surface[::-1],
                      passes=replace(p, slave=1 - p.slave, master=1 - p.master))
    assert_same((register, x), (reverse, x), np.arange(len(x)), np.eye(2))


@SCENE
def test_forces_balance_and_nobody_pulls(make: Callable[[], Scene]) -> None:
    made = make()
    reply = push(*made)
    assert np.abs(reply.force.sum(axis=0)).max() <= 1e-12 * max(np.abs(reply.force).sum(), 1.0)
    assert (reply.t_N <= 0.0).all()
    slave = reply.force[at_nodes(made, reply.multipliers) < 0.0]
    assert (slave[:, 1] >= -CLOSE * np.abs(reply.force).max()).all(), "the slave lies above and is pushed up"


def test_what_each_scene_must_give() -> None:
    """By hand, with eps_N = 1e9 Pa/m: 1 mm deep is 1 MPa."""
    assert push(*SCENES["ends above ends"]()).force[:6].sum(axis=0) == pytest.approx([0.0, 1e6])
    assert push(*SCENES["end above a node"]()).force[:6].sum(axis=0) == pytest.approx([0.0, 0.6e6])
    # Of two branches one above the other the nearer one is faced, and it alone.
    two = push(*SCENES["two candidates"]())
    assert two.force[:6].sum(axis=0) == pytest.approx([0.0, 1e6])
    assert not two.force[8:].any()
    touching = push(*SCENES["touching at the start"]())
    assert not touching.force.any()
    assert touching.node_covered[:6] == pytest.approx(1.0)
    # The tip is 20 mm deep and its flanks rise by 1 in 4: 1.6e-3 m2 of depth; at Gauss points, within 20 %.
    # A tip sunk in by less than a fifth of an edge times that slope is between them, and not felt.
    tip = push(*SCENES["convex vertex"]())
    assert tip.force[:7].sum(axis=0) == pytest.approx([0.0, 1.6e6], rel=0.2)


@pytest.mark.parametrize("slope", [0.05, 0.25, 1.0])
@pytest.mark.parametrize("aside", [0.0, 0.3, 0.9])
def test_how_deep_a_tip_may_go_unfelt(slope: float, aside: float) -> None:
    """Edges are cut at the tip; the Gauss points beside it are (1 - 1/sqrt 3)/2 of a piece away, at most of an edge."""
    edge, share = 1.0 / 6.0, 0.5 - 0.5 / np.sqrt(3.0)
    tip = aside * edge
    master = line((0.9, -(0.9 - tip) * slope), (tip, 0.0), (-0.9, -(0.9 + tip) * slope))
    piece = edge * max(aside, 1.0 - aside)
    least = min(edge - piece, piece) or edge  # the tip stands at `aside` of an edge: the shorter piece feels it first
    for depth, felt in ((0.99 * share * least * slope, False), (1.01 * share * least * slope, True)):
        assert (push(*scene(block(6, y=-depth), master)).n_touching > 0) == felt


def test_sliding_over_many_segments_has_no_ripple_and_no_chatter() -> None:
    """C7, the surfaces alone: 1 mm deep over 12 segments that no edge of the block matches, mu = .3."""
    segments, mu, step = 12, 0.3, 0.013
    assert segments > EXPECTED["C7"]["segments"]
    ends = 0.9 - 0.1 * np.arange(segments + 7)
    register, x = scene(block(7, -0.9, -0.3), np.column_stack([ends, np.zeros(ends.size)]))
    register = replace(register, passes=passes((0, 1), mu=mu))
    mobilised, before, replies = (np.zeros(len(x)), np.zeros((0, 3))), x, []
    while x[7, 0] < 0.9 - step:
        x = before + np.where(np.arange(len(x))[:, None] < 8, [step, 0.0], 0.0)
        replies.append(push(register, x, x_before=before, mobilised=mobilised[0], mobilised_at=mobilised[1]))
        before, mobilised = x, (replies[-1].mobilised, replies[-1].mobilised_at)
    assert x[0, 0] + 0.9 > 0.1 * EXPECTED["C7"]["segments"]
    assert len(replies) > 80
    N, steady = 1e6 * 0.6, replies[1:]  # eps_N = 1e9 Pa/m
    force = np.array([r.force[:8].sum(axis=0) for r in steady])
    assert np.abs(force[:, 1] / N - 1.0).max() <= 1e-11
    assert np.abs(force[:, 0] / (-mu * N) - 1.0).max() <= 1e-11
    assert np.abs([r.E_friction.sum() / (mu * N * step) - 1.0 for r in steady]).max() <= 1e-9
    assert np.abs(np.array([r.t_N[:8] for r in steady]) / -1e6 - 1.0).max() <= 1e-11
    assert all(r.n_slipping == r.n_touching for r in replies[1:])


@pytest.mark.parametrize("soft", ["upper", "lower"])
def test_one_side_a_million_times_as_stiff(soft: str) -> None:
    """The soft block takes the whole stroke, as slave and as master: springs in a row, plane strain, free sides."""
    E, d, cells = 2e5, 1e-5, 5
    eps_N = E * cells
    hard = {**STEEL, "E": 1e6 * E}
    half = load(blocks(4, cells, eps_N=eps_N), {
        "half": "elastic", "format": 2, "materials": {"soft": {**STEEL, "E": E}, "hard": hard},
        "bodies": {name: {"material": "soft" if name == soft else "hard"} for name in ("lower", "upper")},
        "boundary": [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0),
                     hold("upper.top", 1, {"t": [0, 1], "value": [0, -d]})]})
    link = open_link("direct")
    state, _ = half.start(inputs_of(half), 0.0, link)
    _, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    p = d / ((1.0 - STEEL["nu"]**2) * (1.0 + 1e-6) / E + 1.0 / eps_N)
    pressed = outputs["contact.t_N"][outputs["contact.t_N"] < 0.0]
    # Strains of 1e-5; and what 1e6 to 1 leaves of the digits.
    assert pressed == pytest.approx(-p, rel=1e-4)
    assert outputs["iterations"] <= 6
