"""One point a slave node at an end of the master: what a node presses goes on where its edge still faces something."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, ask, flat, passes, push, scene
from test_coupling import answer
from test_coupling import dense as couplings
from test_traction import dense, differences

from contact.messages import Floats, Register, Tractions

MESHES = [(1, 1), (3, 4), (7, 5), (1, 9), (2, 7)]


def nodal(register: Register, mu: float = 0.0) -> Register:
    return replace(register, passes=passes((0, 1), mu=mu, by_node=True))


@pytest.mark.few("mesh0", "mesh3")
@pytest.mark.parametrize("mesh", MESHES)
def test_force_and_area_are_those_of_what_is_faced_at_every_place(mesh: tuple[int, int]) -> None:
    """A block that slides off on either side, a hair and almost wholly: no force is let go of at once."""
    for slide in np.concatenate([np.linspace(-0.98, 0.98, 57), [1e-9, -1e-9, 1e-6, -1e-6]]):
        register, x = flat(*mesh, slide=float(slide), gap=-1e-4)
        register = nodal(register)
        w = 1.0 - abs(slide)
        assert ask(register, x).area.sum() == pytest.approx(w, abs=1e-12)
        force = push(register, x).force
        assert force[: mesh[0] + 1, 1].sum() == pytest.approx(1e-4 * EPS * w, abs=1e-4 * EPS * 1e-9)
        assert np.abs(force.sum(axis=0)).max() <= 1e-12 * np.abs(force).sum()


def test_a_narrow_master_between_two_slave_nodes_is_pressed() -> None:
    """Neither of its nodes, nor of the slave's, faces a node: both halves of the one edge press where it ends."""
    register, x = flat(1, 2, gap=-1e-4)
    x[2:, 0] = 0.4 + 0.3 * x[2:, 0]
    reply = push(nodal(register), x)
    assert reply.force[:2, 1].sum() == pytest.approx(0.3 * 1e-4 * EPS, rel=1e-9)
    assert (reply.t_N[:2] < 0.0).all()
    middle = x[:2, 0] @ reply.force[:2, 1] / reply.force[:2, 1].sum()
    assert 0.4 < middle < 0.7


def beside(slide: float, axisymmetric: bool) -> tuple[Register, Floats]:
    """A slave of two edges on a master of one that begins and ends beside its nodes; nothing is parallel."""
    register, x = flat(2, 1, gap=-0.02, axisymmetric=axisymmetric)
    x[:3, 0] = [0.0, 0.45, 1.1]
    x[3:, 0] = [0.97, 0.07]
    x[:, 0] += 2.0 + np.where(np.arange(5) < 3, slide, 0.0)
    x[:, 1] += 0.02 * np.sin(3.0 * x[:, 0])
    return register, x


@pytest.mark.few("0.05-True-0.12", "10.0-False-0.0", "0.05-False--0.1", "10.0-True-0.12")
@pytest.mark.parametrize("slide", [0.0, 0.12, -0.1])
@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize("mu", [0.0, 0.05, 10.0])
def test_the_stiffness_is_the_derivative(slide: float, axisymmetric: bool, mu: float) -> None:
    """The point moves with the end of the master, and its share with it; sticking, slipping and smooth."""
    register, x = beside(slide, axisymmetric)
    register = nodal(register, mu)
    before, mobilised = x.copy(), np.where(np.arange(5) < 3, 0.04 if mu else 0.0, 0.0)
    before[:3] += [3e-3, 1e-3]
    reply = push(register, x, x_before=before, mobilised=mobilised)
    assert (reply.force[:3, 1] > 0.0).all()
    K, B = differences(register, x, 5e-7, before, mobilised), dense(reply, len(x))
    assert abs(B - K).max() <= 1e-9 * abs(K).max()


@pytest.mark.parametrize("axisymmetric", [False, True])
def test_multipliers_follow_too(axisymmetric: bool) -> None:
    register, x = beside(0.0, axisymmetric)
    register = nodal(register)
    multipliers = np.where(np.arange(5) < 3, -1e5 * np.array([1.0, 2.0, 3.0, 0.0, 0.0]), 0.0)
    _, C, _ = couplings(answer(register, x, multipliers, x))
    h, wanted = 5e-7, np.zeros_like(C)
    for k in range(x.size):
        step = h * np.eye(x.size)[k].reshape(x.shape)
        near, far = (answer(register, x + s * step, multipliers, x).residual
                     - answer(register, x - s * step, multipliers, x).residual for s in (1, 2))
        wanted[:, k] = (8.0 * near - far) / (12.0 * h)
    assert np.abs(C[:3] - wanted[:3]).max() <= 1e-9 * np.abs(C).max()


def aligned(turn: float, tilt: float = 0.0) -> Tractions:
    """A slave whose nodes lie on two of the master's four, which goes on at either side; turned by an angle [rad]."""
    slave = np.array([[1.0, -1e-4], [2.0, -1e-4 + tilt]])
    master = np.column_stack([np.arange(3.0, -1.0, -1.0), np.zeros(4)])
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    register, x = scene(slave @ R.T, master @ R.T)
    return push(nodal(register), x)


def test_nodes_that_lie_on_each_other_do_so_whatever_round_off_says() -> None:
    """Of the master's nodes those press that are met, and those beside them do not, in whatever frame."""
    for turn in np.linspace(0.0, 2.0 * np.pi, 181):
        reply = aligned(float(turn))
        assert -reply.t_N[2:] == pytest.approx([0.0, 1e-4 * EPS, 1e-4 * EPS, 0.0], rel=1e-6)
        assert reply.node_covered[2:] == pytest.approx([0.0, 0.5, 0.5, 0.0])


def test_a_master_is_told_no_jump_as_a_first_point_comes_to_press() -> None:
    """A slave of one edge that comes down aslant on a master of ten: node after node begins to face what presses."""
    def told(down: float) -> Floats:
        slave, master = np.array([[0.0, 5e-3 - down], [1.0, -1e-3]]), np.linspace([1.0, 0.0], [0.0, 0.0], 11)
        register, x = scene(slave, master)
        return push(register, x).t_N

    t_N = np.array([told(down) for down in np.linspace(0.0, 5e-3, 501)])
    assert (t_N[-1, 2:] < 0.0).all()
    assert np.abs(np.diff(t_N, axis=0)).max() < 0.01 * np.abs(t_N).max()
