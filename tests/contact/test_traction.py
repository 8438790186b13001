"""Contact forces: exact resultants on non-matching meshes, balance to round-off, stiffness against differences."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, ask, curved, flat, mirrored, push, renumbered, scene

from contact.wire import Floats, Tractions

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
    assert reply.blocks.shape == (0, 8, 8)
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
    """The blocks as one matrix : (2 n, 2 n)."""
    K = np.zeros((2 * n, 2 * n))
    for nodes, block in zip(reply.block_nodes, reply.blocks, strict=True):
        dofs = (2 * nodes[:, None] + np.arange(2)).ravel()
        K[np.ix_(dofs, dofs)] += block
    return K


def differences(register: object, x: Floats, step: float) -> Floats:
    """-d(force)/dx by central differences."""
    K = np.empty((x.size, x.size))
    for j in range(x.size):
        d = np.zeros(x.size)
        d[j] = step
        d = d.reshape(x.shape)
        K[:, j] = -(push(register, x + d).force - push(register, x - d).force).ravel() / (2 * step)
    return K


@pytest.mark.parametrize("slide", [0.2, -0.55])
def test_stiffness_of_flat_contact_agrees_with_differences_to_order_gap(slide: float) -> None:
    """What is left out is of order p_N: the disagreement is g/L of the whole, no more, and falls with g."""
    for g in (1e-3, 1e-4, 1e-5):
        register, x = flat(3, 4, slide=slide, gap=-g)
        K, B = differences(register, x, 1e-8), dense(push(register, x), len(x))
        assert abs(B - K).max() <= 5 * g * abs(K).max()
        np.testing.assert_allclose(B, B.T, atol=1e-9 * abs(B).max())


@pytest.mark.parametrize("angle", [10.0, 40.0, -40.0])
def test_stiffness_of_tilted_edges_agrees_with_differences(angle: float) -> None:
    """A point slides along its tilted master edge: an error of order eps_N tan(angle) if that is forgotten.

    One Gauss point touches by 1e-6, the other is open, so what is left out is of order 1e-6.
    """
    slope = np.tan(np.radians(angle))
    touching = 0.5 - np.sign(slope) * np.sqrt(1 / 12)
    slave = np.array([[0.0, 0.0], [1.0, 0.0]])
    ends = np.array([1.2, -0.2])
    master = np.column_stack([ends, 1e-6 - slope * (ends - touching)])
    register, x = scene(slave, master)
    reply = push(register, x)
    assert reply.n_touching == 1
    K, B = differences(register, x, 1e-9), dense(reply, len(x))
    assert abs(B - K).max() <= 1e-5 * abs(K).max()


@pytest.mark.parametrize("make", [lambda: flat(5, 7, slide=0.3, gap=-1e-3), lambda: curved(24, 31, gap=-0.01)])
class TestInvariance:
    """Forces turn, move, mirror and renumber with the scene, to 1e-12."""

    def close(self, one: Floats, other: Floats) -> None:
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-11 * abs(one).max())

    def test_quarter_turn_and_translation(self, make: object) -> None:
        register, x = make()
        x_turned = np.column_stack([0.5 - x[:, 1], x[:, 0] - 0.25])
        reply, turned = push(register, x), push(register, x_turned)
        self.close(np.column_stack([-reply.force[:, 1], reply.force[:, 0]]), turned.force)
        self.close(reply.t_N, turned.t_N)

    def test_mirror(self, make: object) -> None:
        register, x = make()
        reply, other = push(register, x), push(*mirrored(register, x))
        self.close(reply.force * [-1.0, 1.0], other.force)
        self.close(reply.t_N, other.t_N)

    def test_renumbering(self, make: object) -> None:
        register, x = make()
        register_new, x_new, node, _ = renumbered(register, x)
        reply, other = push(register, x), push(register_new, x_new)
        self.close(reply.force, other.force[node])
        self.close(reply.t_N, other.t_N[node])

    def test_same_input_same_bits(self, make: object) -> None:
        register, x = make()
        one, other = push(register, x), push(register, x.copy())
        assert all(np.asarray(a).tobytes() == np.asarray(b).tobytes()
                   for a, b in zip(vars(one).values(), vars(other).values(), strict=True))


def test_a_common_motion_changes_no_force() -> None:
    """Blocks have no force against moving both sides alike: rows and columns of the stiffness add up to zero."""
    register, x = curved(24, 31, gap=-0.01)
    B = dense(push(register, x), len(x))
    for axis in (0, 1):
        together = np.zeros(2 * len(x))
        together[axis::2] = 1.0
        assert abs(B @ together).max() <= ROUND_OFF * abs(B).max()
        assert abs(together @ B).max() <= ROUND_OFF * abs(B).max()


def test_random_rough_surfaces_never_upset_the_service() -> None:
    """Crumpled, interpenetrating, turned at random: finite replies, areas >= 0, balance to round-off."""
    random = np.random.default_rng(0)
    touched = 0
    for _ in range(150):
        n_s, n_m = random.integers(1, 30, 2)
        rough, turn = random.choice([1e-3, 0.05, 0.3]), random.random() * 2 * np.pi
        slave = np.column_stack([np.sort(random.random(n_s + 1)), rough * random.standard_normal(n_s + 1)])
        master = np.column_stack([np.sort(random.random(n_m + 1))[::-1], rough * random.standard_normal(n_m + 1)])
        register, x = scene(slave, master)
        x = x @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        facing, reply = ask(register, x), push(register, x)
        for value in (*vars(facing).values(), *vars(reply).values()):
            assert np.isfinite(value).all()
        assert (facing.area > 0).all()
        assert (facing.area_m >= 0).all()
        assert ((facing.xi_m >= 0) & (facing.xi_m <= 1)).all()
        if reply.n_touching:
            touched += 1
            assert max(imbalance(reply, x)) <= ROUND_OFF
    assert touched > 50
