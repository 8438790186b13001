"""Ties: points that faced each other stay together; their forces, derivatives, and what no rigid motion changes."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, ask, curved, flat, push

from contact.messages import Coupling, Couplings, Floats, Refused, Register, Registered
from contact.pair_nodes import pair_layout_of
from contact.service import ContactService
from contact.surfaces import surfaces_of

SIZE = 1e7  # Pa, of multipliers


def tied(register: Register, x: Floats) -> Register:
    """The same surfaces, bonded as they are at x."""
    return replace(register, passes=replace(register.passes, tied=np.array([1], np.int32)), x=x)


def scenes() -> dict[str, tuple[Register, Floats]]:
    """Flat in touch, flat apart, and an arc in a bowl whose facets overlap in part; all with ends that overhang."""
    made = {"in touch": flat(4, 5, gap=0.0, slide=0.1), "apart": flat(4, 5, gap=0.05, slide=0.1),
            "curved": curved(6, 9), "overlapping": curved(5, 7, gap=-0.01),
            "ring": flat(4, 5, gap=0.01, slide=0.1, axisymmetric=True)}
    return {name: (tied(*scene), scene[1]) for name, scene in made.items()}


def turned(x: Floats, angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return x @ np.array([[c, s], [-s, c]])


def moved(register: Register, x: Floats, seed: int = 1, by: float = 0.01) -> tuple[Floats, Floats]:
    """Nodes moved at random by up to `by` [m], and random multipliers of the ties."""
    random = np.random.default_rng(seed)
    layout = pair_layout_of(register)
    multipliers = np.zeros(layout.n_multipliers)
    multipliers[layout.size:] = SIZE * random.uniform(-1.0, 1.0, 2 * layout.tied.size)
    return x + by * random.uniform(-1.0, 1.0, x.shape), multipliers


def stiffness(reply, n: int) -> Floats:
    K = np.zeros((n, 2, n, 2))
    for s in range(n):
        for k in range(reply.starts[s], reply.starts[s + 1]):
            K[s, :, reply.columns[k]] = reply.blocks[k]
    return K.reshape(2 * n, 2 * n)


@pytest.mark.few("curved", "overlapping")
@pytest.mark.parametrize("name", scenes())
def test_the_stiffness_is_the_derivative_of_the_forces(name):
    register, x = scenes()[name]
    x, multipliers = moved(register, x)
    K, h = stiffness(push(register, x, multipliers), len(x)), 1e-6
    for s in range(len(x)):
        for k in range(2):
            d = np.zeros_like(x)
            d[s, k] = h
            up, down = push(register, x + d, multipliers).force, push(register, x - d, multipliers).force
            np.testing.assert_allclose(-((up - down) / (2 * h)).ravel(), K[:, 2 * s + k], rtol=0.0,
                                       atol=1e-7 * np.abs(K).max())
    np.testing.assert_allclose(K, K.T, rtol=0.0, atol=1e-12 * np.abs(K).max())


def coupled(register: Register, x: Floats, multipliers: Floats) -> Couplings:
    service, layout = ContactService(), pair_layout_of(register)
    registered = service.handle(register)
    assert isinstance(registered, Registered), registered
    reply = service.handle(Coupling(registered.surfaces, x, multipliers, x, multipliers, np.zeros(layout.size)))
    assert isinstance(reply, Couplings), reply
    return reply


@pytest.mark.few("curved", "ring")
@pytest.mark.parametrize("name", scenes())
def test_forces_and_residuals_answer_to_multipliers_and_places_as_told(name):
    register, x = scenes()[name]
    x, multipliers = moved(register, x)
    reply, n, m = coupled(register, x, multipliers), len(x), multipliers.size
    B, C = np.zeros((n, 2, m)), np.zeros((m, n, 2))
    for nodes, ends, values in zip(reply.nodes, reply.ends, reply.values, strict=True):
        for i in range(6):
            for j in range(4):
                B[nodes[i], :, ends[j]] += values[i, j, :2]
                C[ends[j], nodes[i]] += values[i, j, 2:4]
    by_lambda = np.zeros_like(B)
    for j in range(pair_layout_of(register).size, m):
        more = multipliers.copy()
        more[j] += SIZE
        by_lambda[:, :, j] = (push(register, x, more).force - push(register, x, multipliers).force) / SIZE
    np.testing.assert_allclose(B, by_lambda, rtol=0.0, atol=1e-9 * np.abs(B).max())
    h, by_place = 1e-6, np.zeros_like(C)
    for s in range(n):
        for k in range(2):
            d = np.zeros_like(x)
            d[s, k] = h
            by_place[:, s, k] = (coupled(register, x + d, multipliers).residual
                                 - coupled(register, x - d, multipliers).residual) / (2 * h)
    np.testing.assert_allclose(C, by_place, rtol=0.0, atol=1e-7 * np.abs(C).max())
    # What the new multipliers are: lambda less R over W.
    told, layout = push(register, x, multipliers).multipliers, pair_layout_of(register)
    held = reply.weight[layout.size:] > 0.0
    np.testing.assert_allclose((multipliers - told)[layout.size:][held],
                               (reply.residual[layout.size:] / np.where(held, reply.weight[layout.size:], 1.0))[held],
                               rtol=1e-9, atol=1e-9 * SIZE)


@pytest.mark.parametrize("name", [n for n in scenes() if n != "ring"])
@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, np.pi])
def test_no_rigid_motion_of_both_makes_a_force(name, angle):
    register, x = scenes()[name]
    reply = push(register, turned(x, angle) + [0.3, -0.2])
    assert np.abs(reply.force).max() <= 1e-9 * EPS * 0.01
    assert abs(reply.stored) <= 1e-9 * EPS * 0.01**2
    np.testing.assert_array_equal(ask(register, turned(x, angle)).gap, 0.0)
    np.testing.assert_array_equal(ask(register, turned(x, angle)).xi_m, ask(register, x).xi_m)


@pytest.mark.parametrize("name", [n for n in scenes() if n != "ring"])
@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_forces_turn_with_a_superposed_motion(name, angle):
    register, x = scenes()[name]
    x, multipliers = moved(register, x)
    n_q = pair_layout_of(register).size
    by = np.concatenate([multipliers[:n_q], turned(multipliers[n_q:].reshape(-1, 2), angle).ravel()])
    here, there = push(register, x, multipliers), push(register, turned(x, angle), by)
    np.testing.assert_allclose(there.force, turned(here.force, angle), rtol=0.0, atol=1e-9 * np.abs(here.force).max())
    np.testing.assert_allclose(there.t_N, here.t_N, rtol=0.0, atol=1e-9 * np.abs(here.t_N).max())
    np.testing.assert_allclose(there.shear, here.shear, rtol=0.0, atol=1e-9 * np.abs(here.shear).max())
    assert there.stored == pytest.approx(here.stored, rel=1e-9)


@pytest.mark.parametrize("name", [n for n in scenes() if n != "ring"])
def test_springs_alone_balance_forces_and_moments(name):
    register, x = scenes()[name]
    x, _ = moved(register, x)
    f = push(register, x).force
    assert np.abs(f.sum(axis=0)).max() <= 1e-12 * np.abs(f).max()
    assert abs((x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]).sum()) <= 1e-12 * np.abs(f).max()


def test_they_pull_shear_and_press_alike():
    """Two flats drawn apart by one length in any direction are drawn back by one force, eps times it a metre."""
    register, x = flat(4, 5, gap=0.02)
    register = tied(register, x)
    upper = np.arange(len(x)) < 5
    for way in ([0.0, 0.003], [0.0, -0.003], [0.003, 0.0], [-0.002, 0.001]):
        reply = push(register, x + np.where(upper[:, None], way, 0.0))
        np.testing.assert_allclose(reply.force[upper].sum(axis=0), -EPS * np.array(way), rtol=1e-9, atol=1e-3)
        # The slave looks down: its normal is -y, and that turned to the left is x.
        slave = pair_layout_of(register).searched == 1
        np.testing.assert_allclose(reply.t_N[slave], EPS * way[1], rtol=1e-9, atol=1e-3)
        np.testing.assert_allclose(reply.t_N[~slave], EPS * way[1], rtol=1e-9, atol=1e-3)
        np.testing.assert_allclose(reply.shear[slave], -EPS * way[0], rtol=1e-9, atol=1e-3)
        assert reply.stored == pytest.approx(0.5 * EPS * (way[0] ** 2 + way[1] ** 2), rel=1e-9)


def test_what_is_not_faced_at_the_start_is_not_tied():
    register, x = flat(4, 5, gap=0.0, slide=0.6)
    facing = ask(tied(register, x), x)
    assert facing.area.sum() == pytest.approx(0.4)
    layout = pair_layout_of(tied(register, x))
    q = layout.tied[x[layout.node[layout.tied], 0] > 1.3]
    assert q.size
    assert (facing.node_covered[q] == 0.0).all()
    # Nor is what comes to face it later.
    back = x - np.where(np.arange(len(x))[:, None] < 5, [0.6, 0.0], [0.0, 0.0])
    assert ask(tied(register, x), back).area.sum() == pytest.approx(0.4)


def test_where_it_was_drawn_is_part_of_its_name():
    register, x = flat(4, 5)
    assert surfaces_of(tied(register, x)).key != surfaces_of(tied(register, x + [0.0, 1e-9])).key


@pytest.mark.parametrize(("change", "why"), [({"x": None}, "x, where its sides faced"),
                                             ({"mu": np.array([0.3])}, "without friction"),
                                             ({"by_node": np.array([1], np.int32)}, "by edges"),
                                             ({"tied": np.array([2], np.int32)}, "must be 0 or 1")])
def test_ties_that_cannot_be_are_refused(change, why):
    register, x = flat(4, 5)
    register = tied(register, x)
    if "x" in change:
        register = replace(register, **change)
    else:
        register = replace(register, passes=replace(register.passes, **change))
    reply = ContactService().handle(register)
    assert isinstance(reply, Refused)
    assert why in reply.message
