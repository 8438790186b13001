"""What friction remembers: a surface that is held keeps its shear to the bit, however often it is asked."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import flat, passes, push

from contact.half.register import register_message
from contact.messages import Registered, Traction, Tractions
from contact.service import ContactService

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from contact_ripple import DEPTH, interface_of

MU = 0.3


@pytest.mark.parametrize("two_pass", [False, True])
@pytest.mark.parametrize("by_node", [False, True])
def test_held_still_shear_stays_and_makes_no_heat(two_pass, by_node):
    """Uneven along the surface, of points that slip and points that stick: a mean would smooth it at every request."""
    slave = np.column_stack([np.linspace(0.0, 1.0, 8), np.full(8, -DEPTH)])
    master = np.column_stack([np.linspace(1.2, -0.2, 12), np.zeros(12)])
    interface = interface_of(slave, master, by_node=by_node)
    interface = replace(interface, pairs=tuple(replace(p, mu=MU, two_pass=two_pass) for p in interface.pairs))
    service = ContactService()
    known = service.handle(register_message(interface))
    assert isinstance(known, Registered)
    x, nothing = interface.nodes, np.zeros(len(interface.nodes))
    mobilised = np.zeros(len(x))
    mobilised[:8] = 0.9 * MU * np.random.default_rng(1).uniform(-1.0, 1.0, 8)
    before = x.copy()
    before[:8, 0] -= 0.8 * MU * DEPTH
    reply = service.handle(Traction(known.surfaces, x, nothing, before, nothing, mobilised))
    assert isinstance(reply, Tractions)
    assert 0 < reply.n_slipping < reply.n_touching
    assert len(reply.mobilised_at) == reply.n_touching
    for _ in range(3):
        again = service.handle(Traction(known.surfaces, x, nothing, x, nothing, reply.mobilised, reply.mobilised_at))
        assert isinstance(again, Tractions)
        np.testing.assert_allclose(again.mobilised_at, reply.mobilised_at, rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(again.mobilised, reply.mobilised, rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(again.force, reply.force, rtol=0.0, atol=1e-13 * np.abs(reply.force).max())
        assert again.E_friction.sum() <= 1e-12 * max(float(reply.E_friction.sum()), 1.0)
        reply = again


def test_it_is_linear_between_points_and_where_there_are_none_between_nodes():
    """Of a trial that sticks with no slip, tau = r p: r where the points of unlike meshes lie."""
    register, x = flat(4, 5, gap=-1e-3)
    register = replace(register, passes=passes((0, 1), mu=1e9))
    mobilised = np.where(np.arange(len(x)) < 5, [*np.linspace(0.1, 0.5, 5), *[0.0] * (len(x) - 5)], 0.0)
    points = np.array([[0.0, 0.3, 0.7], [0.0, 0.6, -0.2], [2.0, 0.0, 0.4], [2.0, 1.0, 0.9]])
    reply = push(register, x, mobilised=mobilised, mobilised_at=points)
    assert len({row[0] for row in reply.mobilised_at}) == 4
    for q, xi, r in reply.mobilised_at:
        known = {0.0: ([0.3, 0.6], [0.7, -0.2]), 2.0: ([0.0, 1.0], [0.4, 0.9])}
        at, values = known.get(q, ([0.0, 1.0], [mobilised[int(q)], mobilised[int(q) + 1]]))
        assert r == pytest.approx(np.interp(xi, at, values), rel=1e-12)


@pytest.mark.parametrize(("points", "why"), [
    ([[0.0, 0.5, 0.1], [0.0, 0.4, 0.1]], "comes before the row above it"),
    ([[1.0, 0.5, 0.1], [0.0, 0.4, 0.1]], "comes before the row above it"),
    ([[0.5, 0.5, 0.1]], "no place on an edge"), ([[99.0, 0.5, 0.1]], "no place on an edge"),
    ([[-1.0, 0.5, 0.1]], "no place on an edge"), ([[0.0, 1.5, 0.1]], "no place on an edge"),
    ([[0.0, 0.5, np.nan]], "not finite"), ([[0.0, 0.5]], "shape")])
def test_what_cannot_be_remembered_is_refused(points, why):
    register, x = flat(4, 5, gap=-1e-3)
    service = ContactService()
    known = service.handle(replace(register, passes=passes((0, 1), mu=MU)))
    assert isinstance(known, Registered)
    nothing = np.zeros(len(x))
    reply = service.handle(Traction(known.surfaces, x, nothing, x, nothing, nothing, np.array(points)))
    assert why in getattr(reply, "message", "")
