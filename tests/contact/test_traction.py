"""Contact forces: exact resultants on non-matching meshes, balance to round-off, stiffness against differences."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import bsr_matrix

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, ask, curved, flat, passes, push, scene

from contact.messages import Floats, Register, Tractions

ROUND_OFF = 1e-12
MESHES = [(3, 4), (5, 7), (24, 31)]


def imbalance(reply: Tractions, x: Floats) -> tuple[float, float]:
    """|sum of forces| and |sum of moments about the mean point|, relative to the sums of their terms' sizes."""
    arm = x - x.mean(axis=0)
    moments = np.concatenate([arm[:, 0] * reply.force[:, 1], -arm[:, 1] * reply.force[:, 0]])
    return (float(abs(reply.force.sum(axis=0)).max() / abs(reply.force).sum()),
            float(abs(moments.sum()) / abs(moments).sum()))


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("slide", [0.0, 0.37])
def test_uniform_penetration_gives_exact_resultants(mesh: tuple[int, int], slide: float) -> None:
    """C1: uniform p over the overlap w: force p w through its middle, on both sides, whatever the meshes."""
    register, x = flat(*mesh, slide=slide, gap=-1e-4)
    reply = push(register, x)
    p, w = 1e-4 * EPS, 1.0 - slide
    for side, sign in ((0, 1.0), (1, -1.0)):
        mine = np.unique(register.edges[register.edge_surface == side])
        force = reply.force[mine].sum(axis=0)
        moment = x[mine, 0] @ reply.force[mine, 1]
        np.testing.assert_allclose(force, [0.0, sign * p * w], rtol=0, atol=p * ROUND_OFF)
        assert moment == pytest.approx(sign * p * w * (1.0 + slide) / 2, rel=1e-11)
    faced = reply.node_covered > 0
    np.testing.assert_allclose(reply.t_N[faced], -p, rtol=1e-11)
    assert (reply.t_N[~faced] == 0).all()
    np.testing.assert_array_equal(reply.multipliers, np.where(np.arange(len(x)) <= mesh[0], reply.t_N, 0.0))


@pytest.mark.parametrize("mesh", MESHES)
def test_nodal_forces_are_those_of_the_shape_functions(mesh: tuple[int, int]) -> None:
    """C1, segment to segment: full contact at uniform p loads every node of both sides with p times its share."""
    register, x = flat(*mesh, gap=-1e-4)
    reply = push(register, x)
    L = abs(x[register.edges[:, 1], 0] - x[register.edges[:, 0], 0])
    share = np.bincount(register.edges.ravel(), np.repeat(L / 2, 2))
    sign = np.where(np.arange(len(x)) <= mesh[0], 1.0, -1.0)
    np.testing.assert_allclose(reply.force[:, 1], sign * 1e-4 * EPS * share, rtol=1e-10)


@pytest.mark.parametrize("mesh", [(5, 7), (24, 31), (40, 3)])
def test_forces_and_moments_balance_on_curves(mesh: tuple[int, int]) -> None:
    """Slave and master points of one force lie on one ray, so moments balance too; partly open on purpose."""
    register, x = curved(*mesh, gap=0.0)
    x[: mesh[0] + 1, 0] += 0.06
    reply = push(register, x)
    assert 0 < reply.n_touching < ask(register, x).area.size
    assert max(imbalance(reply, x)) <= ROUND_OFF
    assert (reply.t_N <= 0).all()


def test_nothing_pulls() -> None:
    """An open gap carries nothing; multipliers alone push, until the gap eats them up."""
    register, x = flat(5, 7, gap=1e-4)
    reply = push(register, x)
    assert reply.n_touching == 0
    assert not reply.force.any()
    assert not reply.t_N.any()
    assert reply.blocks.shape == (0, 2, 2)
    lagrange = np.where(np.arange(len(x)) <= 5, -3e5, 0.0)
    np.testing.assert_allclose(push(register, x, lagrange).t_N, -(3e5 - 1e-4 * EPS), rtol=1e-9)
    assert push(register, x, lagrange / 4).n_touching == 0


def test_augmentation_ends_in_the_load_without_penetration() -> None:
    """C4's idea on a rigid scene: repeated requests raise the multipliers by eps_N |g| each time."""
    register, x = flat(3, 4, gap=-1e-4)
    multipliers = np.zeros(len(x))
    for k in range(1, 4):
        multipliers = push(register, x, multipliers).multipliers
        np.testing.assert_allclose(multipliers[:4], -k * 1e-4 * EPS, rtol=1e-9)
        assert not multipliers[4:].any()


def test_axisymmetric_forces_are_on_whole_rings() -> None:
    """Uniform p on a disc of radius 1: p pi."""
    register, x = flat(5, 7, gap=-1e-4, axisymmetric=True)
    reply = push(register, x)
    assert reply.force[:6, 1].sum() == pytest.approx(1e-4 * EPS * np.pi, rel=ROUND_OFF)
    assert max(imbalance(reply, x)) <= ROUND_OFF


def dense(reply: Tractions, n: int) -> Floats:
    """The rows as one matrix : (2 n, 2 n)."""
    return bsr_matrix((reply.blocks, reply.columns, reply.starts), shape=(2 * n, 2 * n)).toarray()


def differences(register: Register, x: Floats, step: float, before: Floats | None = None,
                mobilised: Floats | None = None) -> Floats:
    """-d(force)/dx by central differences of fourth order."""
    K = np.zeros((x.size, x.size))
    for j in range(x.size):
        d = np.eye(x.size)[j].reshape(x.shape) * step
        for steps, weight in ((1, 8.0), (2, -1.0)):
            up, down = (push(register, x + s * steps * d, x_before=before, mobilised=mobilised).force for s in (1, -1))
            K[:, j] -= weight * (up - down).ravel() / (12.0 * step)
    return K


def bent(slide: float = 0.2, axisymmetric: bool = False) -> tuple[Register, Floats]:
    """Two surfaces that overlap, both bent, so that nothing is parallel."""
    register, x = flat(3, 4, slide=slide + 1.0, gap=-0.02, axisymmetric=axisymmetric)
    x[4:, 0] += 1.0
    x[:, 1] += 0.02 * np.sin(3.0 * x[:, 0])
    return register, x


@pytest.mark.parametrize("slide", [0.2, -0.55])
@pytest.mark.parametrize("axisymmetric", [False, True])
def test_stiffness_is_the_derivative_of_the_forces(slide: float, axisymmetric: bool) -> None:
    """Normals, cuts and areas move too."""
    register, x = bent(slide, axisymmetric)
    K, B = differences(register, x, 5e-7), dense(push(register, x), len(x))
    assert abs(B - K).max() <= 1e-9 * abs(K).max()


@pytest.mark.few("True-10.0-0", "False-0.05-12")
@pytest.mark.parametrize(("mu", "slipping"), [(10.0, 0), (0.05, 12)])
@pytest.mark.parametrize("axisymmetric", [False, True])
def test_stiffness_of_friction_is_the_derivative_of_the_forces(mu: float, slipping: int, axisymmetric: bool) -> None:
    """Sticking (with a shear from before) and slipping; the second is not symmetric."""
    register, x = bent(axisymmetric=axisymmetric)
    register = replace(register, passes=passes((0, 1), mu=mu))
    before, mobilised = x.copy(), np.where(np.arange(len(x)) < 4, 0.04, 0.0)
    before[:4] += [3e-3, 1e-3]
    reply = push(register, x, x_before=before, mobilised=mobilised)
    assert reply.n_slipping == slipping
    assert reply.slipping[:4].tolist() == [float(slipping > 0)] * 4
    assert not reply.slipping[4:].any()
    K, B = differences(register, x, 5e-7, before, mobilised), dense(reply, len(x))
    assert abs(B - K).max() <= 1e-9 * abs(K).max()


@pytest.mark.parametrize("by_node", [False, True])
def test_stiffness_of_one_point_a_node(by_node: bool) -> None:
    register, x = bent()
    register = replace(register, passes=passes((0, 1), by_node=by_node))
    K, B = differences(register, x, 5e-7), dense(push(register, x), len(x))
    assert abs(B - K).max() <= 1e-9 * abs(K).max()


@pytest.mark.parametrize("angle", [10.0, 40.0, -40.0])
def test_stiffness_of_tilted_edges(angle: float) -> None:
    """A point slides along its tilted master edge; one Gauss point touches, the other is open."""
    slope = np.tan(np.radians(angle))
    touching = 0.5 - np.sign(slope) * np.sqrt(1 / 12)
    slave = np.array([[0.0, 0.0], [1.0, 0.0]])
    ends = np.array([1.2, -0.2])
    master = np.column_stack([ends, 1e-4 - slope * (ends - touching)])
    register, x = scene(slave, master)
    reply = push(register, x)
    assert reply.n_touching == 1
    K, B = differences(register, x, 5e-7), dense(reply, len(x))
    assert abs(B - K).max() <= 1e-9 * abs(K).max()


def test_a_dragged_block_sticks_then_slips_and_heats() -> None:
    """C6: below mu N it holds, at mu N it slides, and mu N s becomes heat; history goes in and comes out."""
    mu, p, step = 0.3, 1e-4 * EPS, 1e-5
    register, x = flat(5, 7, gap=-1e-4)
    register = replace(register, passes=passes((0, 1), mu=mu))
    mobilised, drag, heat = np.zeros(len(x)), [], []
    slave = np.arange(len(x)) < 6
    for _ in range(10):
        moved = x + np.where(slave, step, 0.0)[:, None] * [1.0, 0.0]
        reply = push(register, moved, x_before=x, mobilised=mobilised)
        drag.append(reply.force[slave, 0].sum())
        heat.append(reply.E_friction.sum())
        x, mobilised = moved, reply.mobilised
        assert not reply.E_friction[~slave].any()
        assert np.array_equal(reply.slipping > 0.0, reply.E_friction > 0.0)
    width = 1.0 - np.arange(1, 11) * step  # covered
    sticks = np.array(drag[:3])
    np.testing.assert_allclose(sticks, -EPS * step * np.arange(1, 4) * width[:3], rtol=2e-5)
    np.testing.assert_allclose(drag[3:], -mu * p * width[3:], rtol=1e-9)
    # The fourth step slips what the spring of sticking does not take; then every step slips its whole length.
    np.testing.assert_allclose(heat[4:], mu * p * step * width[4:], rtol=1e-9)
    np.testing.assert_allclose(sum(heat), mu * p * (10 * step - mu * p / EPS), rtol=1e-4)


def test_a_common_motion_is_no_slip() -> None:
    """Both bodies turned by 30 degrees and moved away: no shear, no heat."""
    register, x = bent()
    register = replace(register, passes=passes((0, 1), mu=1e3))
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    reply = push(register, x @ np.array([[c, s], [-s, c]]) + [3.0, -1.0], x_before=x)
    still = push(register, x)
    assert abs(reply.shear).max() <= 1e-9 * abs(still.t_N).max()
    assert reply.E_friction.sum() == 0.0


@pytest.mark.parametrize("mesh", MESHES)
def test_two_passes_press_as_one_where_the_pressure_is_uniform(mesh: tuple[int, int]) -> None:
    """Half the weight from either side: the same resultants, and every node wholly covered."""
    register, x = flat(*mesh, gap=-1e-4)
    both = replace(register, passes=passes((0, 1), (1, 0), weight=0.5))
    one, two = push(register, x), push(both, x)
    np.testing.assert_allclose(two.force, one.force, atol=1e-10 * abs(one.force).max())
    np.testing.assert_allclose(two.node_covered, 1.0, rtol=1e-12)
    np.testing.assert_allclose(two.t_N, one.t_N, rtol=1e-10)
    assert ask(both, x).area.sum() == pytest.approx(ask(register, x).area.sum(), rel=1e-12)


def test_a_surface_that_folds_meets_itself() -> None:
    """A slit closed from both sides: each lip pushes the other, once in all, and its neighbours do not count."""
    lower = np.column_stack([np.linspace(1.0, 0.0, 6), np.zeros(6)])
    upper = np.column_stack([np.linspace(0.0, 1.0, 8), np.full(8, -1e-4)])
    tip = np.array([[-0.05, 0.0]])
    x = np.concatenate([lower, tip, upper])
    n = len(x) - 1
    edges = np.column_stack([np.arange(n), np.arange(1, n + 1)]).astype(np.int32)
    register = Register(n + 1, edges, np.zeros(n, dtype=np.int32), False, passes((0, 0), weight=0.5, gap_max=0.2))
    reply = push(register, x)
    up, down = reply.force[:6].sum(axis=0), reply.force[7:].sum(axis=0)
    np.testing.assert_allclose(abs(up[1]), 1e-4 * EPS, rtol=0.1)
    assert abs(up + down + reply.force[6]).max() <= 1e-9 * abs(up[1])
