"""Smooth pairs: forces see round surfaces through the nodes.  Even gaps are even, and all that holds of edges holds."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, curved, flat, passes, push, scene
from test_coupling import answer
from test_coupling import dense as coupled
from test_slip import differences, turned
from test_traction import dense

from contact.facing import Cut, cut_surfaces
from contact.half.interface import Interface, Pair, read_interface, write_interface
from contact.messages import Floats, Refused, Register
from contact.service import ContactService
from contact.surfaces import surfaces_of

FORMS = {"edges": (((0, 1),), False), "nodes": (((0, 1),), True), "two passes": (((0, 1), (1, 0)), False)}


def smooth(register: Register, x: Floats, form: str = "edges", mu: float = 0.0, on: bool = True) -> Register:
    """The scene as drawn at x : (n_s, 2) [m], its pair smooth."""
    sides, by_node = FORMS[form]
    p = passes(*sides, weight=1.0 / len(sides), by_node=by_node, mu=mu)
    return replace(register, x=x, passes=replace(p, smooth=np.full(len(sides), int(on), np.int32)))


def cut(register: Register, x: Floats) -> Cut:
    return cut_surfaces(surfaces_of(register), x)


def shaken(size: float = 2e-3) -> tuple[Register, Floats, Floats]:
    """A disc pressed into a bowl, coarse: as drawn, and bent so that nothing is even."""
    register, drawn = curved(7, 9, gap=-0.03)
    drawn = drawn + [3.0, 0.0]
    return register, drawn, drawn + size * np.random.default_rng(3).standard_normal(drawn.shape)


# What it is for

@pytest.mark.parametrize(("n_s", "n_m"), [(6, 8), (8, 6), (7, 7), (16, 20)])
@pytest.mark.parametrize("gap", [0.01, -0.01])
def test_the_gap_of_concentric_circles_is_even(n_s: int, n_m: int, gap: float) -> None:
    """Edges of 0.17 rad have gaps that differ by 6.6e-3 of the radius."""
    register, x = curved(n_s, n_m, gap=gap)
    found = cut(smooth(register, x), x).values[:, 2]
    edges = cut(smooth(register, x, on=False), x).values[:, 2]
    h = max(1.0 / n_s, 1.5 / n_m)  # rad
    np.testing.assert_allclose(found, gap, rtol=0.0, atol=5e-3 * h**2)
    assert np.ptp(edges) > 0.1 * h**2


@pytest.mark.parametrize("exchanged", [False, True])
def test_an_even_pressure_pushes_with_its_area(exchanged: bool) -> None:
    """Of an arc of 1 rad that presses with EPS 0.01 the resultant is p times its chord; and either way round."""
    a, b = np.linspace(np.pi + 1.07, np.pi + 2.07, 8), np.linspace(np.pi + 2.37, np.pi + 0.77, 10)
    disc, bowl = (r * np.column_stack([np.cos(t), np.sin(t)]) for r, t in ((1.0, a), (0.99, b)))
    register, x = scene(bowl, disc) if exchanged else scene(disc, bowl)
    reply = push(smooth(register, x), x)
    pushed = reply.force[10:] if exchanged else reply.force[:8]
    exact = EPS * 0.01 * 2.0 * np.sin(0.5) * np.array([np.cos(1.57), np.sin(1.57)])
    np.testing.assert_allclose(pushed.sum(axis=0), exact, rtol=0.0, atol=0.025 * np.linalg.norm(exact))
    np.testing.assert_allclose(reply.t_N[reply.node_covered > 0.99], -EPS * 0.01, rtol=0.03)


def test_a_full_ring_is_pressed_as_its_arc() -> None:
    """All of a circle of 16 edges: the force of a node is p N ds along its arc, and nowhere is less pressure."""
    a, b = (np.linspace(0.0, 2.0 * np.pi, n + 1)[:-1] for n in (16, 20))
    x = np.vstack([np.column_stack([np.cos(a), np.sin(a)]), 0.99 * np.column_stack([np.cos(-b), np.sin(-b)])])
    edges = np.array([*([i, (i + 1) % 16] for i in range(16)), *([16 + i, 16 + (i + 1) % 20] for i in range(20))],
                     np.int32)
    register = Register(36, edges, np.repeat([0, 1], [16, 20]).astype(np.int32), False, passes((0, 1)))
    reply = push(smooth(register, x), x)
    outward = np.linalg.norm(reply.force[:16], axis=1)
    t = np.pi / 8
    np.testing.assert_allclose(outward, EPS * 0.01 * 2.0 * (1.0 - np.cos(t)) / t, rtol=2e-3)
    np.testing.assert_allclose(reply.t_N, -EPS * 0.01, rtol=5e-3)
    edges_alone = push(smooth(register, x, on=False), x).t_N
    assert edges_alone.min() > -0.7 * EPS * 0.01


def test_a_side_that_ends_at_a_plane_of_symmetry_faces_to_its_end() -> None:
    """Quarters of circles: with the normal of the last edge rays leave the plane, and nothing faces them, or all."""
    a, b = np.linspace(0.0, 0.5 * np.pi, 7), np.linspace(0.5 * np.pi, 0.0, 9)
    register, x = scene(*(r * np.column_stack([np.cos(t), np.sin(t)]) for r, t in ((1.0, a), (0.9, b))))
    reply = push(smooth(register, x), x)
    force = reply.force[:7]
    np.testing.assert_allclose(force[0], force[-1, ::-1], rtol=1e-9)
    assert abs(force[0, 1]) < 0.1 * abs(force[0, 0])
    np.testing.assert_allclose(reply.node_covered[:7], 1.0, rtol=0.0, atol=2e-3)
    edges = push(smooth(register, x, on=False), x)
    assert edges.node_covered[0] < 0.99


@pytest.mark.parametrize("form", FORMS)
def test_straight_surfaces_are_what_they_were(form: str) -> None:
    register, x = flat(3, 5, slide=0.2, gap=-0.01)
    for name in ("force", "blocks", "t_N", "node_gap"):
        one, other = (getattr(push(smooth(register, x, form, on=on), x), name) for on in (True, False))
        np.testing.assert_array_equal(one, other)


def test_corners_stay_corners() -> None:
    """A square in a square hole, told smooth: nothing of it is round."""
    square = np.array([[-1.0, 0.3], [-1.0, -1.0], [1.0, -1.0], [1.0, 0.3]])
    hole = 0.999 * square[::-1]
    register, x = scene(np.vstack([square[:2], [[0.0, -1.0]], square[2:]]), hole)
    one, other = (push(smooth(register, x, on=on), x) for on in (True, False))
    np.testing.assert_array_equal(one.force, other.force)
    assert np.abs(one.force).max() > 0.0


# Laws

@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("form", FORMS)
def test_forces_balance_and_turn_along(form: str, mu: float) -> None:
    register, drawn, x = shaken()
    scene_ = smooth(register, drawn, form, mu)
    before = x.copy()
    before[:8] += 0.02
    here, there = push(scene_, x, x_before=before), push(scene_, turned(x, 0.7), x_before=before)
    size = np.abs(here.force).max()
    assert np.abs(here.force.sum(axis=0)).max() <= 1e-12 * size
    if mu == 0.0:  # two drags stand the gap apart (contact.traction)
        moment = x[:, 0] * here.force[:, 1] - x[:, 1] * here.force[:, 0]
        assert abs(moment.sum()) <= 1e-12 * np.abs(moment).max()
    np.testing.assert_allclose(there.force, turned(here.force, 0.7), rtol=0.0, atol=1e-9 * size)
    np.testing.assert_allclose(there.shear, here.shear, rtol=0.0, atol=1e-9 * np.abs(here.t_N).max())


@pytest.mark.few("edges-True-1000000000.0", "nodes-True-0.05", "two passes-False-1000000000.0")
@pytest.mark.parametrize("mu", [0.0, 0.05, 1e9])
@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize("form", FORMS)
def test_the_stiffness_is_the_derivative(form: str, axisymmetric: bool, mu: float) -> None:
    register, drawn, x = shaken()
    scene_ = smooth(replace(register, axisymmetric=axisymmetric), drawn, form, mu)
    random = np.random.default_rng(1)
    before = x + 4e-3 * random.random(x.shape)
    mobilised = np.where(push(scene_, x).multipliers < 0.0, 0.04, 0.0)
    multipliers = np.where(mobilised > 0.0, -1e5 * random.random(len(x)), 0.0)
    reply = push(scene_, x, multipliers, before, mobilised)
    assert reply.n_touching > 0
    assert (reply.n_slipping > 0) is (mu == 0.05)
    K = differences(scene_, x, multipliers, before, mobilised)
    assert abs(dense(reply, len(x)) - K).max() <= 1e-9 * abs(K).max()


@pytest.mark.few("two passes")
@pytest.mark.parametrize("form", FORMS)
def test_the_equation_of_multipliers_follows(form: str) -> None:
    register, drawn, x = shaken()
    scene_ = smooth(register, drawn, form, 0.2)
    on = push(scene_, x, np.full(len(x), -1e8)).multipliers < 0.0
    multipliers = np.where(on, -1e6 * np.random.default_rng(1).random(len(x)), 0.0)
    before, h = x + 1e-2, 5e-7
    _, C, _ = coupled(answer(scene_, x, multipliers, before))
    for k in range(x.size):
        step = h * np.eye(x.size)[k].reshape(x.shape)
        near, far = (answer(scene_, x + s * step, multipliers, before).residual
                     - answer(scene_, x - s * step, multipliers, before).residual for s in (1, 2))
        np.testing.assert_allclose(C[on, k], ((8.0 * near - far) / (12.0 * h))[on], rtol=0.0,
                                   atol=1e-9 * np.abs(C).max())


@pytest.mark.parametrize("angle", [0.15, 0.3, -0.3])
def test_slip_is_the_length_of_the_arc(angle: float) -> None:
    """A disc turned in a bowl of edges of 0.15 rad: along the arc, where along the polygon 9e-4 are lacking."""
    register, x = curved(24, 10, gap=-1e-3)
    register = smooth(register, x, mu=1e9)
    after = x.copy()
    after[:25] = turned(x[:25], angle)
    reply = push(register, after, x_before=x)
    wholly = np.flatnonzero(reply.node_covered[1:24] > 1.0 - 1e-9) + 1
    slip = -reply.shear[wholly] / EPS
    assert slip == pytest.approx(0.999 * angle, rel=1e-5)


# What it is told, and refuses

def test_what_contradicts_is_refused() -> None:
    register, x = curved(7, 9)
    told = smooth(register, x)
    for wrong, what in ((replace(told, x=None), "how round its sides are drawn"),
                        (replace(told, passes=replace(told.passes, smooth=np.array([2], np.int32))), "must be 0 or 1"),
                        (replace(told, passes=replace(told.passes, tied=np.ones(1, np.int32))), "smooth and tied")):
        reply = ContactService().handle(wrong)
        assert isinstance(reply, Refused)
        assert what in reply.message


def test_who_knows_no_smooth_pairs_is_told_so_by_the_version(tmp_path: Path) -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    plain = Interface("plane", np.vstack([square, square + [0.0, 1.0]]), np.arange(8, dtype=np.int32).reshape(2, 4),
                      np.empty((0, 3), np.int32), np.array([0, 1], np.int32), np.empty(0, np.int32), ("low", "high"),
                      ("m", "m"), {"low.top": np.array([[2, 3]]), "high.bottom": np.array([[4, 5]])}, {},
                      (Pair("face", "high.bottom", "low.top", 0.5, 1e9),))
    for on, version in ((False, 3), (True, 5)):
        interface = replace(plain, pairs=(replace(plain.pairs[0], smooth=on),))
        write_interface(interface, tmp_path / "interface.h5")
        with h5py.File(tmp_path / "interface.h5") as f:
            assert f.attrs["version"] == version
            assert ("smooth" in f.attrs["pairs"]) is on
        assert read_interface(tmp_path / "interface.h5").pairs == interface.pairs
    assert plain.surfaces_hash != interface.surfaces_hash
