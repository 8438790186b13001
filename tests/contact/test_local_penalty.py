"""A penalty that is that of both cells in a row, at each place its own."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import flat, passes, push
from test_traction import bent, dense, differences

from contact.messages import Floats, Register

DEPTH = 0.01


def local(register: Register, mu: float = 0.0, seed: int = 3) -> Register:
    """The scene without a stated penalty, each edge as stiff as may be."""
    stiffness = 1e9 * 10.0 ** np.random.default_rng(seed).uniform(-1.0, 1.0, len(register.edges))
    told = passes((0, 1), mu=mu)
    none = np.zeros(1)
    return replace(register, passes=replace(told, eps_N=none, eps_T=none), stiffness=stiffness)


def exact(register: Register, x: Floats) -> float:
    """The force [N] on flat overlapping surfaces, by hand: edge over edge."""
    assert register.stiffness is not None
    total = 0.0
    for (a, b), k in zip(register.edges, register.stiffness, strict=True):
        for (c, d), other in zip(register.edges, register.stiffness, strict=True):
            if x[a, 1] == -DEPTH and x[c, 1] == 0.0:
                common = min(x[b, 0], x[c, 0]) - max(x[a, 0], x[d, 0])
                total += max(common, 0.0) * DEPTH / (1.0 / k + 1.0 / other)
    return total


@pytest.mark.parametrize("slide", [0.0, 0.3])
def test_each_piece_presses_as_its_two_cells_do(slide: float) -> None:
    register, x = flat(3, 5, slide=slide, gap=-DEPTH)
    register = local(register)
    force = push(register, x).force
    assert force[:4, 1].sum() == pytest.approx(exact(register, x), rel=1e-12)
    assert force.sum(axis=0) == pytest.approx(np.zeros(2), abs=1e-9 * np.abs(force).max())


def test_roles_may_be_exchanged() -> None:
    register, x = flat(3, 5, slide=0.3, gap=-DEPTH)
    register = local(register)
    there = replace(register, passes=replace(register.passes, slave=register.passes.master,
                                             master=register.passes.slave))
    np.testing.assert_allclose(push(there, x).force, push(register, x).force, rtol=0.0,
                               atol=1e-12 * np.abs(push(register, x).force).max())


@pytest.mark.few("False-0.05", "True-10.0")
@pytest.mark.parametrize("mu", [0.0, 0.05, 10.0])
@pytest.mark.parametrize("axisymmetric", [False, True])
def test_the_stiffness_is_the_derivative(mu: float, axisymmetric: bool) -> None:
    register, x = bent(axisymmetric=axisymmetric)
    register = local(register, mu)
    before, mobilised = x.copy(), np.where(np.arange(len(x)) < 4, 0.04, 0.0)
    before[:4] += [3e-3, 1e-3]
    reply = push(register, x, x_before=before, mobilised=mobilised)
    assert (reply.n_slipping > 0) is (mu == 0.05)
    K, B = differences(register, x, 5e-7, before, mobilised), dense(reply, len(x))
    assert abs(B - K).max() <= 1e-9 * abs(K).max()


def test_a_side_without_stiffness_has_no_penalty() -> None:
    register, x = flat(3, 5, gap=-DEPTH)
    register = local(register)
    assert register.stiffness is not None
    soft = replace(register, stiffness=np.where(np.arange(8) < 3, 0.0, register.stiffness))
    assert not push(soft, x).force.any()
