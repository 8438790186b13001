"""Pairs that share a node: each has its own pressure, shear, gap and share there, and their order is nothing."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import bsr_matrix

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import GAP_MAX, ask, chain, flat, passes, push

from contact.half.interface import Interface, Pair
from contact.half.register import register_message
from contact.messages import Coupling, Couplings, Floats, Refused, Register, Registered, Tractions
from contact.multipliers import ENDS
from contact.pair_nodes import pair_layout_of
from contact.service import ContactService

DEPTH, SIDE = 0.01, -1e-3  # how deep the block stands in the floor, and how far the wall is from it
BLOCK, FLOOR, WALL = 7, 5, 4  # edges of the block's bottom and left, of floor and wall
EXACT = 1e-12


def corner(order: tuple[int, int] = (0, 1), mu: float = 0.0, side: float = SIDE) -> tuple[Register, Floats]:
    """A block that stands in a floor, beside a wall.  order : of the pairs floor (0) and wall (1)."""
    bottom = np.column_stack([np.linspace(0.0, 1.0, BLOCK + 1) ** 1.1, np.full(BLOCK + 1, -DEPTH)])
    left = np.column_stack([np.zeros(BLOCK), np.linspace(1.0, 0.0, BLOCK + 1)[:-1] ** 1.2 - DEPTH])
    floor = np.column_stack([np.linspace(1.37, -0.2, FLOOR + 1), np.zeros(FLOOR + 1)])
    wall = np.column_stack([np.full(WALL + 1, side), np.linspace(-0.3, 1.2, WALL + 1)])
    x = np.concatenate([left, bottom, floor, wall])
    edges = [chain(BLOCK, BLOCK), chain(BLOCK, 0), chain(FLOOR, 2 * BLOCK + 1), chain(WALL, 2 * BLOCK + FLOOR + 2)]
    number = np.repeat(np.arange(4), [len(e) for e in edges])
    both = ((0, 2), (1, 3))
    told = passes(*(both[k] for k in order), mu=mu)
    return Register(len(x), np.concatenate(edges).astype(np.int32), number.astype(np.int32), False,
                    replace(told, pair=np.arange(2, dtype=np.int32))), x


def sides(order: tuple[int, int] = (0, 1)) -> tuple[slice, slice]:
    """The pair nodes of the block's bottom and of its left."""
    sizes = {0: (BLOCK + 1, FLOOR + 1), 1: (BLOCK + 1, WALL + 1)}
    found, n = {}, 0
    for k in order:
        found[k] = slice(n, n + sizes[k][0])
        n += sum(sizes[k])
    return found[0], found[1]


def answer(register: Register, x: Floats, multipliers: Floats) -> Couplings:
    service = ContactService()
    registered = service.handle(register)
    assert isinstance(registered, Registered), registered
    reply = service.handle(Coupling(registered.surfaces, x, multipliers, x, multipliers, np.zeros(multipliers.size)))
    assert isinstance(reply, Couplings), reply
    return reply


def test_pair_nodes_are_numbered_as_the_interface_numbers_them() -> None:
    """Pair by pair, slave before master, each side ascending; a surface that folds onto itself once."""
    edges = {"a.top": [[4, 2], [2, 7]], "b.left": [[7, 1]], "c.in": [[9, 8], [8, 5]]}
    none = np.empty((0, 4), dtype=np.int32)
    pairs = (Pair("p", "b.left", "a.top", 0.1, 1e9, two_pass=True), Pair("q", "c.in", "c.in", 0.1, 1e9),
             Pair("r", "a.top", "c.in", 0.1, 1e9))
    interface = Interface("plane", np.zeros((10, 2)), none, none[:, :3], none[:, 0], none[:, 0], (), (),
                          {n: np.array(e, dtype=np.int32) for n, e in edges.items()}, pairs=pairs)
    assert interface.pair_nodes.tolist() == [1, 7, 2, 4, 7, 5, 8, 9, 2, 4, 7, 5, 8, 9]
    register = register_message(interface)
    layout = pair_layout_of(register)
    assert np.array_equal(interface.contact_nodes[layout.node], interface.pair_nodes)
    assert layout.pair.tolist() == [0] * 5 + [1] * 3 + [2] * 6
    assert layout.searched.tolist() == [1] * 8 + [1] * 3 + [0] * 3
    assert layout.first.tolist() == [[0, 2], [2, 0], [5, 5], [8, 11]]
    for pair, surface in (("p", "a.top"), ("q", "c.in"), ("r", "c.in")):
        side = interface.side_of(pair, surface)
        assert np.array_equal(interface.pair_nodes[side.at], np.unique(interface.surfaces[surface]))
        assert side.own == (surface != {"p": "a.top", "r": "c.in"}.get(pair))
    with pytest.raises(KeyError, match=r"pair q has no surface a.top"):
        interface.side_of("q", "a.top")


def test_passes_of_one_pair_between_other_surfaces_are_refused() -> None:
    register, _ = corner()
    reply = ContactService().handle(replace(register, passes=replace(register.passes, pair=np.zeros(2, np.int32))))
    assert isinstance(reply, Refused)
    assert "the passes of pair 0 are not all between surfaces [0, 2]" in reply.message


def test_what_a_corner_presses_on_one_side_is_nothing_to_the_other() -> None:
    """Uniform to the corner below, nothing at all beside; with multipliers too."""
    register, x = corner()
    below, beside = sides()
    eps_N = register.passes.eps_N[0]
    for multiplier in (0.0, -2e5):
        given = np.zeros(pair_layout_of(register).size)
        given[below] = multiplier
        found = push(register, x, given)
        np.testing.assert_allclose(found.t_N[below], multiplier - eps_N * DEPTH, rtol=EXACT)
        assert not found.t_N[beside].any()
        assert not found.force[-WALL - 1:].any()
        assert np.abs(found.force[:, 0]).max() <= EXACT * np.abs(found.force).max()
        assert found.n_touching == np.count_nonzero(ask(register, x).pair == 0)
    gap = found.node_gap
    assert gap[below] == pytest.approx(-DEPTH)
    assert gap[beside][1:] == pytest.approx(-SIDE)  # all but the corner, whose ray begins below the wall's face
    assert found.node_covered[below] == pytest.approx(1.0)


def test_gaps_of_what_faces_nothing_are_the_pairs_own() -> None:
    register, x = corner(side=-2.0 * GAP_MAX)
    register = replace(register, passes=replace(register.passes, gap_max=np.array([GAP_MAX, 0.5 * GAP_MAX])))
    facing = ask(register, x)
    assert facing.node_gap[sides()[1]] == pytest.approx(0.5 * GAP_MAX)
    assert not facing.node_covered[sides()[1]].any()


def test_the_order_of_the_pairs_changes_nothing() -> None:
    """With friction, a history and both sides pressed: forces, stiffness and what is told, to round-off."""
    random = np.random.default_rng(2)
    given = {k: -1e5 * random.random(BLOCK + 1) for k in range(2)}
    remembered = {k: 0.1 * random.random(BLOCK + 1) for k in range(2)}
    found: list[Tractions] = []
    for order in ((0, 1), (1, 0)):
        register, x = corner(order, mu=0.2, side=2e-3)
        n = pair_layout_of(register).size
        multipliers, mobilised = np.zeros(n), np.zeros(n)
        for k, at in enumerate(sides(order)):
            multipliers[at], mobilised[at] = given[k], remembered[k]
        before = x + 1e-3 * np.sin(7.0 * x)
        found.append(push(register, x, multipliers, before, mobilised))
    one, other = found
    np.testing.assert_allclose(other.force, one.force, rtol=0.0, atol=EXACT * np.abs(one.force).max())
    assert np.array_equal(one.columns, other.columns)
    np.testing.assert_allclose(other.blocks, one.blocks, rtol=0.0, atol=EXACT * np.abs(one.blocks).max())
    for name in ("t_N", "multipliers", "mobilised", "shear", "E_friction", "slipping", "node_gap", "node_covered"):
        a, b = getattr(one, name), getattr(other, name)
        for first, second in zip(sides(), sides((1, 0)), strict=True):
            np.testing.assert_allclose(b[second], a[first], rtol=0.0, atol=EXACT * np.abs(a).max(), err_msg=name)
    assert one.shear[sides()[0]].any()
    assert one.shear[sides()[1]].any()


def test_a_multiplier_of_one_pair_is_felt_by_that_pair_alone() -> None:
    """df/dlambda, dR/dx and dR/dlambda of the corner's two multipliers, against differences; each is 0 in the other."""
    register, x = corner(side=2e-3)
    layout, random = pair_layout_of(register), np.random.default_rng(4)
    n, n_s = layout.size, len(x)
    multipliers = np.where(layout.searched == 1, -1e6 * random.random(n), 0.0)
    c = answer(register, x, multipliers)
    B, C, D = np.zeros((n_s, 2, n)), np.zeros((n, n_s, 2)), np.diag(c.weight)
    for nodes, ends, values in zip(c.nodes, c.ends, c.values, strict=True):
        for j, q in enumerate(ends):
            np.add.at(B[:, :, q], nodes, values[:, j, :2])
            np.add.at(C[q], nodes, values[:, j, 2:4])
            for i, end in enumerate(ENDS):
                D[ends[i], q] += values[end, j, 4]
    for q in np.flatnonzero(layout.searched):
        less = multipliers - np.eye(n)[q]
        df = push(register, x, multipliers).force - push(register, x, less).force
        np.testing.assert_allclose(B[:, :, q], df, atol=1e-7 * np.abs(B).max())
        dR = c.residual - answer(register, x, less).residual
        np.testing.assert_allclose(D[:, q], dR, atol=1e-7 * np.abs(D).max())
        assert not D[layout.pair != layout.pair[q], q].any()
    h = 1e-7
    searched = layout.searched == 1
    for k in range(x.size):
        step = h * np.eye(x.size)[k].reshape(x.shape)
        near, far = (answer(register, x + s * step, multipliers).residual
                     - answer(register, x - s * step, multipliers).residual for s in (1, 2))
        np.testing.assert_allclose(C.reshape(n, -1)[searched, k], (8.0 * near - far)[searched] / (12.0 * h),
                                   rtol=0.0, atol=1e-9 * np.abs(C).max())


def test_the_stiffness_of_a_corner_is_the_derivative_of_its_forces() -> None:
    """With multipliers and remembered shear of either pair, along random directions: 1e-7 of the largest."""
    register, x = corner(mu=0.2, side=2e-3)
    layout, random = pair_layout_of(register), np.random.default_rng(6)
    multipliers = np.where(layout.searched == 1, -1e6 * random.random(layout.size), 0.0)
    mobilised = np.where(layout.searched == 1, 0.1 * random.random(layout.size), 0.0)
    before = x + 3e-3 * np.sin(7.0 * x)  # some stick, some slip
    found = push(register, x, multipliers, before, mobilised, multipliers)
    assert 0 < found.n_slipping < found.n_touching
    n, h = len(x), 1e-7
    K = bsr_matrix((found.blocks, found.columns, found.starts), shape=(2 * n, 2 * n))
    for _ in range(5):
        way = random.standard_normal((n, 2))
        ends = [push(register, x + s * h * way, multipliers, before, mobilised, multipliers) for s in (1.0, -1.0)]
        assert {(end.n_touching, end.n_slipping) for end in ends} == {(found.n_touching, found.n_slipping)}
        df = (ends[0].force - ends[1].force).ravel() / (2.0 * h)
        np.testing.assert_allclose(-K @ way.ravel(), df, rtol=0.0, atol=1e-7 * np.abs(df).max())


def test_one_pair_without_shared_nodes_is_told_as_before() -> None:
    """Its pair nodes are its nodes, slave first."""
    register, x = flat(3, 4, gap=-0.01)
    assert pair_layout_of(register).node.tolist() == list(range(len(x)))
    told = push(register, x)
    assert told.t_N == pytest.approx(-register.passes.eps_N[0] * 0.01)


def test_two_passes_share_the_pair_nodes_of_their_pair() -> None:
    register, _ = flat(3, 4)
    layout = pair_layout_of(replace(register, passes=passes((0, 1), (1, 0), weight=0.5)))
    assert layout.first.tolist() == [[0, 4], [4, 0]]
    assert layout.sides.tolist() == [[0, 0], [1, 4]]
    assert (layout.searched == 1).all()
