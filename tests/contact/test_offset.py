"""What is added to a gap: as if the surfaces were so much farther apart, and everything follows."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import ask, flat, passes, push
from test_slip import differences, turned
from test_traction import bent, dense

from contact.messages import Coupling, Couplings, Floats, Register, Registered
from contact.service import ContactService


def with_offset(register: Register, offset: Floats, mu: float = 0.0, by_node: bool = False) -> Register:
    return replace(register, passes=passes((0, 1), mu=mu, by_node=by_node), offset=offset)


@pytest.mark.parametrize("by_node", [False, True])
def test_an_even_offset_is_a_gap_drawn_otherwise(by_node: bool) -> None:
    """Flat blocks 0.01 apart, told 0.03 less: as if drawn 0.02 into each other."""
    register, x = flat(3, 5, slide=0.2, gap=0.01)
    _, deep = flat(3, 5, slide=0.2, gap=-0.02)
    plain = replace(register, passes=passes((0, 1), by_node=by_node))
    told, drawn = with_offset(register, np.full(10, -0.03), by_node=by_node), push(plain, deep)
    found = push(told, x)
    for name in ("force", "t_N", "node_gap", "node_covered"):
        np.testing.assert_allclose(getattr(found, name), getattr(drawn, name), rtol=1e-12, atol=1e-12 * 1e7)
    np.testing.assert_allclose(ask(told, x).gap, ask(plain, deep).gap, rtol=1e-12)


@pytest.mark.parametrize("far", [-0.6, 0.6])
def test_it_reaches_as_far_as_it_is(far: float) -> None:
    """Beyond gap_max, and deeper than an edge, where the gap as told is neither."""
    register, x = flat(4, 6, gap=far - 0.01)
    found = push(with_offset(register, np.full(12, -far)), x)
    np.testing.assert_allclose(found.node_gap, -0.01, rtol=1e-9)
    assert found.t_N.max() < 0.0


def test_a_turn_of_both_changes_nothing() -> None:
    register, x = bent()
    register = with_offset(register, np.linspace(-0.02, 0.01, 9))
    here, there = push(register, x), push(register, turned(x, 0.7))
    np.testing.assert_allclose(there.force, turned(here.force, 0.7), rtol=0.0, atol=1e-9 * np.abs(here.force).max())
    np.testing.assert_allclose(there.node_gap, here.node_gap, rtol=0.0, atol=1e-12)


def test_forces_balance() -> None:
    register, x = bent()
    force = push(with_offset(register, np.linspace(-0.02, 0.01, 9)), x).force
    moment = x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]
    assert np.abs(force).max() > 0.0
    assert np.abs(force.sum(axis=0)).max() <= 1e-12 * np.abs(force).max()
    assert abs(moment.sum()) <= 1e-12 * np.abs(moment).max()


@pytest.mark.few("False-0.05", "True-10.0")
@pytest.mark.parametrize("mu", [0.0, 0.05, 10.0])
@pytest.mark.parametrize("axisymmetric", [False, True])
def test_the_stiffness_is_the_derivative(mu: float, axisymmetric: bool) -> None:
    register, x = bent(axisymmetric=axisymmetric)
    register = with_offset(register, np.array([-0.02, 0.004, -0.03, -0.01, 0, 0, 0, 0, 0]), mu)
    before, mobilised, none = x.copy(), np.where(np.arange(len(x)) < 4, 0.04, 0.0), np.zeros(len(x))
    before[:4] += [3e-3, 1e-3]
    reply = push(register, x, x_before=before, mobilised=mobilised)
    assert reply.n_touching > 0
    assert (reply.n_slipping > 0) is (mu == 0.05)
    K = differences(register, x, none, before, mobilised)
    assert abs(dense(reply, len(x)) - K).max() <= 1e-9 * abs(K).max()


def test_the_equation_of_multipliers_follows() -> None:
    """dR/dx of the augmented Lagrangian, where the offset changes along the edges."""
    register, x = bent()
    register = with_offset(register, np.array([-0.02, 0.004, -0.03, -0.01, 0, 0, 0, 0, 0]))
    multipliers = np.where(np.arange(len(x)) < 4, -1e6 * (1.0 + np.arange(len(x))), 0.0)

    def couplings(at: Floats) -> Couplings:
        service, zeros = ContactService(), np.zeros(len(x))
        registered = service.handle(register)
        assert isinstance(registered, Registered)
        reply = service.handle(Coupling(registered.surfaces, at, multipliers, at, zeros, zeros))
        assert isinstance(reply, Couplings)
        return reply

    here, told = couplings(x), np.zeros((len(x), x.size))
    for nodes, ends, values in zip(here.nodes, here.ends, here.values, strict=True):
        for i, node in enumerate(nodes):
            for j, end in enumerate(ends):
                told[end, 2 * node:2 * node + 2] += values[i, j, 2:4]
    C = np.empty_like(told)
    for k in range(x.size):
        d = 5e-7 * np.eye(x.size)[k].reshape(x.shape)
        near, far = (couplings(x + s * d).residual - couplings(x - s * d).residual for s in (1, 2))
        C[:, k] = (8.0 * near - far) / (12.0 * 5e-7)
    assert np.abs(told - C).max() <= 1e-9 * np.abs(C).max()
