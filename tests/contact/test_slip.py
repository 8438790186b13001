"""Slip along surfaces: nothing of it is a turn, its length is that of the surface, and its derivative is exact."""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import bsr_matrix

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, curved, flat, passes, push, scene

from contact.messages import Coupling, Couplings, Floats, Register, Registered
from contact.service import ContactService

EXACT = 1e-9
MU = 0.3
FORMS = {"edges": ([(0, 1)], False), "nodes": ([(0, 1)], True), "two passes": ([(0, 1), (1, 0)], False)}


def turned(x: Floats, angle: float) -> Floats:
    """x : (n, 2) [m] about the origin, anticlockwise by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return x @ np.array([[c, s], [-s, c]])


def rubbing(kind: str, form: str, mu: float = MU) -> tuple[Register, Floats]:
    """A pressed pair with friction: flat blocks, or a disc in a bowl."""
    sides, by_node = FORMS[form]
    register, x = flat(5, 7, gap=-1e-4) if kind == "flat" else curved(24, 31, gap=0.0)
    if kind == "curved":
        x[:25, 0] += 0.06
    return replace(register, passes=passes(*sides, weight=1.0 / len(sides), by_node=by_node, mu=mu)), x


@pytest.mark.parametrize("augmented", [False, True], ids=["penalty", "augmented"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["flat", "curved"])
@pytest.mark.parametrize("angle", [0.01, 0.1, 0.5, np.pi / 2])
def test_a_turn_of_both_is_no_slip(angle: float, kind: str, form: str, augmented: bool) -> None:
    """With what stuck before: forces turn, pressures, shear and what is remembered stay, nothing slips or heats."""
    register, x = rubbing(kind, form)
    multipliers = np.minimum(0.7 * push(register, x).multipliers, 0.0) if augmented else np.zeros(len(x))
    random = np.random.default_rng(1)
    mobilised = np.where(push(register, x, multipliers).multipliers < 0.0, random.uniform(-0.9, 0.9, len(x)) * MU, 0.0)
    first = push(register, x, multipliers, x, mobilised)
    here, there = (push(register, at, multipliers, x, first.mobilised, mobilised_at=first.mobilised_at)
                   for at in (x, turned(x, angle)))
    p = np.abs(here.t_N).max()
    assert np.abs(here.shear).max() > 0.05 * p
    assert here.n_slipping == there.n_slipping == 0
    np.testing.assert_allclose(there.force, turned(here.force, angle), rtol=0.0, atol=EXACT * np.abs(here.force).max())
    np.testing.assert_allclose(there.t_N, here.t_N, rtol=0.0, atol=EXACT * p)
    np.testing.assert_allclose(there.shear, here.shear, rtol=0.0, atol=EXACT * p)
    np.testing.assert_allclose(there.mobilised, first.mobilised, rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(there.mobilised_at, first.mobilised_at, rtol=0.0, atol=EXACT)
    assert not there.E_friction.any()


def test_the_derivative_turns_along() -> None:
    """Of multipliers too: residual and derivatives of a semi-smooth solve."""
    register, x = rubbing("curved", "edges")
    mobilised = np.where(push(register, x).multipliers < 0.0, 0.1, 0.0)
    multipliers = 0.5 * push(register, x).multipliers
    here, there = (couplings(register, at, multipliers, x, mobilised) for at in (x, turned(x, 0.5)))
    np.testing.assert_allclose(there.residual, here.residual, rtol=0.0, atol=EXACT * np.abs(here.residual).max())
    for part in (slice(0, 2), slice(2, 4)):
        np.testing.assert_allclose(there.values[..., part], turned(here.values[..., part], 0.5), rtol=0.0,
                                   atol=1e-8 * np.abs(here.values[..., part]).max())


def couplings(register: Register, x: Floats, multipliers: Floats, before: Floats, mobilised: Floats) -> Couplings:
    service = ContactService()
    registered = service.handle(register)
    assert isinstance(registered, Registered), registered
    reply = service.handle(Coupling(registered.surfaces, x, multipliers, before, multipliers, mobilised))
    assert isinstance(reply, Couplings), reply
    return reply


@pytest.mark.parametrize("angle", [0.02, 0.2, -0.3])
@pytest.mark.parametrize("also", [0.0, 1.0])
def test_slip_is_the_length_of_the_surface(angle: float, also: float) -> None:
    """A disc turned in its bowl, and both turned on: the way of a point is the polygon the bowl is drawn as."""
    register, x = curved(24, 400, gap=-1e-3)
    register = replace(register, passes=passes((0, 1), mu=1e9))
    after = x.copy()
    after[:25] = turned(x[:25], angle)
    reply = push(register, turned(after, also), x_before=x)
    wholly = np.flatnonzero(reply.node_covered[1:24] > 1.0 - 1e-9) + 1
    # Slip is -tau/eps_T: the bowl has a radius of .999, and chords of it are short by 1e-6 of themselves.
    slip = -reply.shear[wholly] / EPS
    np.testing.assert_allclose(slip, 0.999 * angle, rtol=2e-3)
    assert np.ptp(slip) <= 2e-3 * abs(angle)


def test_where_the_master_ended_before_the_rest_is_straight() -> None:
    """A block drawn onto the end of a flat floor: the part that faced nothing has slipped as far as the rest."""
    slave = np.column_stack([np.linspace(0.0, 1.0, 6), np.full(6, -1e-4)])
    register, x = scene(slave, np.column_stack([np.linspace(1.5, 0.5, 5), np.zeros(5)]))
    register = replace(register, passes=passes((0, 1), mu=1e9))
    after = x + np.where(np.arange(len(x)) < 6, 0.3, 0.0)[:, None] * [1.0, 0.0]
    np.testing.assert_allclose(push(register, after, x_before=x).shear[2:6], -0.3 * EPS, rtol=1e-12)


@pytest.mark.parametrize("way", [0.01, -0.01, 1e-4])
@pytest.mark.parametrize("form", FORMS)
def test_what_is_told_to_slip_is_the_way_less_what_strains_the_spring(form: str, way: float) -> None:
    """With p = EPS 1e-3 the spring takes mu 1e-3 m of the way, or all of it; its sign is that along the edges."""
    sides, by_node = FORMS[form]
    register, x = flat(5, 7, gap=-1e-3)
    register = replace(register, passes=passes(*sides, weight=1.0 / len(sides), by_node=by_node, mu=MU))
    before = x.copy()
    before[:6, 0] -= way
    reply = push(register, x, x_before=before)
    slip = max(abs(way) - MU * 1e-3, 0.0) * np.sign(way)
    own = np.arange(6) if form != "two passes" else np.arange(14)
    touches = own[reply.t_N[own] < 0.0]
    np.testing.assert_allclose(reply.slip[touches], slip, rtol=0.0, atol=1e-12)
    assert not reply.slip[6:].any() or form == "two passes"
    assert reply.E_friction.sum() == pytest.approx(
        MU * EPS * 1e-3 * abs(slip) * float(np.diff(x[:6, 0]).sum()), rel=0.03, abs=1e-9)


def differences(register: Register, x: Floats, multipliers: Floats, before: Floats, mobilised: Floats,
                mobilised_at: Floats | None = None) -> Floats:
    """-d(force)/dx by central differences of fourth order."""
    K, h = np.zeros((x.size, x.size)), 5e-7
    for j in range(x.size):
        d = np.eye(x.size)[j].reshape(x.shape) * h
        for steps, weight in ((1, 8.0), (2, -1.0)):
            up, down = (push(register, x + s * steps * d, multipliers, before, mobilised,
                             mobilised_at=mobilised_at).force for s in (1, -1))
            K[:, j] -= weight * (up - down).ravel() / (12.0 * h)
    return K


@pytest.mark.few(
    "near-both-True-two passes-points", "over edges-both-True-two passes-nodes", "near-both-True-edges-points",
    "near-both-False-two passes-nodes")
@pytest.mark.parametrize("remembers", ["nodes", "points"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize("state", [*(pytest.param(s, marks=pytest.mark.slow) for s in ("sticks", "slips")), "both"])
@pytest.mark.parametrize("far", [3e-3, 0.3], ids=["near", "over edges"])
def test_the_stiffness_is_the_derivative(state: str, far: float, axisymmetric: bool, form: str,
                                         remembers: str) -> None:
    """Two bent surfaces that overlap and were elsewhere, with an uneven history: in slip too."""
    register, x = flat(3, 4, slide=1.2, gap=-0.02, axisymmetric=axisymmetric)
    x[4:, 0] += 1.0
    x[:, 1] += 0.02 * np.sin(3.0 * x[:, 0])
    random = np.random.default_rng(2)
    mobilised = np.where(np.arange(len(x)) < (4 if form != "two passes" else 9), random.uniform(-0.4, 0.4, len(x)), 0.0)
    before = turned(x, 0.7) + [0.3, 0.1]
    before[:4] += far * random.uniform(0.5, 1.0) * turned(np.array([[1.0, 0.0]]), 0.7)
    before += 1e-3 * random.random(x.shape)
    sides, by_node = FORMS[form]
    multipliers = np.where(mobilised != 0.0, -1e5 * random.random(len(x)), 0.0)

    def rubbed(mu: float) -> Register:
        return replace(register, passes=passes(*sides, weight=1.0 / len(sides), by_node=by_node, mu=mu))

    reply = push(rubbed(1e9), x, multipliers, before, mobilised)
    at = None
    if remembers == "points":
        # Of points that lie elsewhere now, unevenly.
        at = reply.mobilised_at.copy()
        at[:, 1] = 0.97 * at[:, 1] + 0.01
        at[:, 2] = random.uniform(-0.4, 0.4, len(at))
        reply = push(rubbed(1e9), x, multipliers, before, mobilised, mobilised_at=at)
    on = np.flatnonzero(reply.t_N[:4])
    between = float(np.quantile(np.abs(reply.shear[on] / reply.t_N[on]), 0.6))
    mu = {"sticks": 1e9, "slips": 1e-3, "both": between}[state]
    register = rubbed(mu)
    reply = push(register, x, multipliers, before, mobilised, mobilised_at=at)
    assert {"sticks": reply.n_slipping == 0, "slips": reply.n_slipping == reply.n_touching,
            "both": 0 < reply.n_slipping < reply.n_touching}[state]
    K = differences(register, x, multipliers, before, mobilised, at)
    dense = bsr_matrix((reply.blocks, reply.columns, reply.starts), shape=K.shape).toarray()
    assert np.abs(dense - K).max() <= 1e-9 * np.abs(K).max()


@pytest.mark.parametrize("mu", [1e9, 0.2])
def test_the_stiffness_where_the_master_ended_before(mu: float) -> None:
    """The way ends at the end of the master, or at a side of it that looks away."""
    slave = np.column_stack([np.linspace(0.0, 1.0, 4), [-0.02, -0.021, -0.019, -0.02]])
    corner = np.array([[1.5, 0.01], [1.1, 0.0], [0.5, 0.005], [0.45, -0.6]])
    for master in (corner[:3], corner):
        register, x = scene(slave, master)
        register = replace(register, passes=passes((0, 1), mu=mu))
        before = x.copy()
        before[:4] -= [0.31, 0.002]
        reply = push(register, x, x_before=before)
        assert reply.n_touching > 0
        K = differences(register, x, np.zeros(len(x)), before, np.zeros(len(x)))
        dense = bsr_matrix((reply.blocks, reply.columns, reply.starts), shape=K.shape).toarray()
        assert np.abs(dense - K).max() <= 1e-9 * np.abs(K).max()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("share", [1e-6, 0.03, 1.0])
def test_to_stick_by_a_share_is_to_stick_by_a_softer_penalty(form: str, share: float) -> None:
    register, x = rubbing("curved", form)
    random = np.random.default_rng(4)
    mobilised = random.uniform(-0.9, 0.9, len(x)) * MU
    before = turned(x, 0.02) + 3e-3
    stated = replace(register, passes=replace(register.passes, eps_T=np.full_like(register.passes.eps_N, share * EPS)))
    soft, same = push(register, x, None, before, mobilised, sticking=share), push(stated, x, None, before, mobilised)
    for field in fields(same):
        told = np.asarray(getattr(same, field.name))
        most = np.abs(told).max(initial=0.0)
        np.testing.assert_allclose(getattr(soft, field.name), told, rtol=1e-12, atol=1e-12 * most)


def test_what_is_held_at_the_bound_stays_there() -> None:
    """Uneven pressure, all of it slipped, then held: to the bit, and without heat, however often it is asked."""
    register, x = rubbing("curved", "edges")
    before = x.copy()
    before[:25] = turned(x[:25], -2e-2)
    reply = push(register, x, x_before=before)
    assert reply.n_slipping == reply.n_touching
    held = [reply]
    for _ in range(20):
        last = held[-1]
        held.append(push(register, x, x_before=x, mobilised=last.mobilised, mobilised_at=last.mobilised_at))
    np.testing.assert_allclose(held[1].force, reply.force, rtol=0.0, atol=1e-12 * np.abs(reply.force).max())
    # mu p/p may round once.
    assert all(h.mobilised_at.tobytes() == held[1].mobilised_at.tobytes() for h in held[2:])
    assert all(h.mobilised.tobytes() == held[1].mobilised.tobytes() for h in held[2:])
    assert not any(h.E_friction.any() for h in held[1:])


def test_what_was_open_brings_no_shear() -> None:
    """A point that touched nothing before has none of the shear its nodes remember, however hard it is pressed now."""
    register, x = rubbing("flat", "edges")
    lifted = x.copy()
    lifted[:6, 1] += 2e-4
    reply = push(register, x, x_before=lifted, mobilised=np.where(np.arange(len(x)) < 6, 0.2, 0.0))
    assert np.abs(reply.shear).max() <= 1e-12 * np.abs(reply.t_N).max()
