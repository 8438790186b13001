"""How contact answers to its multipliers: every derivative against differences, and what is asked wrongly."""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import curved, passes, push

from contact.messages import Coupling, Couplings, Floats, Refused, Register, Registered, Traction
from contact.multipliers import ENDS
from contact.pair_nodes import pair_layout_of
from contact.service import ContactService


def answer(register: Register, x: Floats, multipliers: Floats, before: Floats) -> Couplings:
    """Couplings of a scene without remembered shear."""
    service = ContactService()
    registered = service.handle(register)
    assert isinstance(registered, Registered), registered
    reply = service.handle(Coupling(registered.surfaces, x, multipliers, before, multipliers, np.zeros(len(x))))
    assert isinstance(reply, Couplings), reply
    return reply


def dense(c: Couplings) -> tuple[Floats, Floats, Floats]:
    """df/dlambda : (2 n_s, n_s), dR/dx : (n_s, 2 n_s) and dR/dlambda : (n_s, n_s)."""
    n = c.weight.size
    B, C, D = np.zeros((2 * n, n)), np.zeros((n, 2 * n)), np.diag(c.weight)
    for nodes, values in zip(c.nodes, c.values, strict=True):
        for i, row in enumerate(nodes):
            for j, end in enumerate(ENDS):
                B[2 * row : 2 * row + 2, nodes[end]] += values[i, j, :2]
                C[nodes[end], 2 * row : 2 * row + 2] += values[i, j, 2:4]
                D[row, nodes[end]] += values[i, j, 4]
    return B, C, D


@pytest.mark.few("0.2-sides2-False-False-pressed", "0.2-sides1-False-True-let go", "0.0-sides0-False-False-pressed")
@pytest.mark.parametrize("gap", [-0.03, 0.02], ids=["pressed", "let go"])
@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize(("mu", "sides", "by_node"), [(0.0, ((0, 1),), False), (0.2, ((0, 1),), False),
                                                      (0.2, ((0, 1), (1, 0)), False), (0.2, ((0, 1),), True)])
def test_derivatives_against_differences(mu, sides, by_node, axisymmetric, gap):
    """A disc pressed into a bowl, or drawn out with what pressed it: cuts wander, normals turn, points slip."""
    register, x = curved(7, 9, gap=gap)
    register = replace(register, axisymmetric=axisymmetric,
                       passes=passes(*sides, weight=1.0 / len(sides), mu=mu, by_node=by_node))
    x = x + [3.0, 0.0]
    random = np.random.default_rng(1)
    on = push(register, x, np.full(len(x), -1e8)).multipliers < 0.0
    multipliers = np.where(on, -1e6 * random.random(len(x)), 0.0)
    before = x + 1e-2 * random.random(x.shape)
    B, C, D = dense(answer(register, x, multipliers, before))
    for j in np.flatnonzero(on):
        less = multipliers - 100.0 * np.eye(len(x))[j]
        df = (push(register, x, multipliers, before).force - push(register, x, less, before).force) / 100.0
        np.testing.assert_allclose(B[:, j], df.ravel(), rtol=0.0, atol=1e-8 * np.abs(df).max())
        dR = (answer(register, x, multipliers, before).residual - answer(register, x, less, before).residual) / 100.0
        np.testing.assert_allclose(D[:, j], dR, rtol=0.0, atol=1e-8 * np.abs(D).max())
    h = 5e-7
    for k in range(x.size):
        step = h * np.eye(x.size)[k].reshape(x.shape)
        near, far = (answer(register, x + s * step, multipliers, before).residual
                     - answer(register, x - s * step, multipliers, before).residual for s in (1, 2))
        np.testing.assert_allclose(C[on, k], ((8.0 * near - far) / (12.0 * h))[on], rtol=0.0,
                                   atol=1e-9 * np.abs(C).max())


def test_the_residual_is_what_the_pressures_lack():
    """R = W (lambda - t_N), so it is 0 where nodes have the pressure they make; t_N of a master is of the slave's."""
    register, x = curved(7, 9, gap=-0.03)
    multipliers = np.where(push(register, x).multipliers < 0.0, -2e5, 0.0)
    c, t_N = answer(register, x, multipliers, x), push(register, x, multipliers).t_N
    own = pair_layout_of(register).searched == 1
    lacks = c.weight * (multipliers - t_N)
    np.testing.assert_allclose(c.residual[own], lacks[own], atol=1e-12 * np.abs(t_N).max())
    # What both sides press in sum is the same.
    assert (c.weight * t_N)[~own].sum() == pytest.approx((c.weight * t_N)[own].sum(), rel=1e-3)
    assert np.abs(c.residual).max() > 0.0


@pytest.mark.parametrize("change", ["x", "multipliers", "x_before", "multipliers_before", "mobilised", "mobilised_at",
                                    "sticking", None])
def test_an_answer_knows_nothing_of_the_one_before(change):
    """What forces and equations share is kept from request to request: for the same numbers only."""
    register, x = curved(7, 9, gap=-0.03)
    register = replace(register, passes=passes((0, 1), mu=0.2))
    pressed = np.where(push(register, x).multipliers < 0.0, -2e5, 0.0)
    asked = {"x": x, "multipliers": pressed, "x_before": x - [1e-4, 0.0], "multipliers_before": pressed,
             "mobilised": np.full(len(x), 0.01), "mobilised_at": np.array([[2.0, 0.3, 0.01], [2.0, 0.6, 0.02]]),
             "sticking": 0.5}
    other = asked if change is None else {**asked, change: asked[change] * 1.001}
    if change == "mobilised_at":
        other[change][:, :2] = asked[change][:, :2]
    services = [ContactService(), ContactService()]
    names = [registered.surfaces for service in services
             if isinstance(registered := service.handle(register), Registered)]
    services[0].handle(Traction(names[0], **asked))
    for request in (Coupling, Traction):
        replies = [service.handle(request(name, **other)) for service, name in zip(services, names, strict=True)]
        for field in fields(replies[1]):
            np.testing.assert_array_equal(getattr(replies[0], field.name), getattr(replies[1], field.name))


def test_a_wrong_request_is_refused():
    service = ContactService()
    register, x = curved(7, 9, gap=-0.03)
    registered = service.handle(register)
    assert isinstance(registered, Registered)
    reply = service.handle(Coupling(registered.surfaces, x, np.ones(len(x)), x, np.zeros(len(x)), np.zeros(len(x))))
    assert isinstance(reply, Refused)
    assert "multipliers must be <= 0" in reply.message
