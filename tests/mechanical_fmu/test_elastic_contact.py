"""Two blocks pressed, slid, released; what the state holds; factors used again."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from contact.half.state import frozen_copy
from contact.rpc.link import open_link
from mechanical_fmu import tangent
from mechanical_fmu.advance import Task, loading_of
from mechanical_fmu.enforcement import contact_query
from mechanical_fmu.tangent import StiffnessAnchor

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, STEEL, block, blocks, done, elastic, hold, inputs_of, press

E, NU = STEEL["E"], STEEL["nu"]
BELOW, ABOVE = hold("lower.bottom", 1), "upper.top"
SIDES = [hold("lower.left", 0), hold("upper.left", 0)]


@pytest.fixture
def link():
    link = open_link("direct")
    yield link
    link.close()


def squeezed(d, eps_N, L=1.0):
    """p of two blocks squeezed by d, their sides free, plane strain: the elastic energy written out for one F."""
    mu, kappa = E / (2 * (1 + NU)), E / (3 * (1 - 2 * NU))

    def stress(s1, s2):
        J, third = s1 * s2, (s1**2 + s2**2 + 1.0) / 3.0
        p = kappa * np.log(J) / J
        c = mu * J ** (-5 / 3)
        return c * (s1**2 - third) + p, c * (s2**2 - third) + p

    def pressure(s2):
        s1 = brentq(lambda s: stress(s, s2)[0], 0.9, 1.2, xtol=1e-15, rtol=1e-14)
        return -stress(s1, s2)[1]

    s2 = brentq(lambda s: d - 2 * L * (1 - s) - pressure(s) / eps_N, 1.0 - d / (2 * L), 1.0, xtol=1e-16, rtol=1e-14)
    return pressure(s2)


@pytest.mark.few("0.02-24-31", "1e-05-6-8")
@pytest.mark.parametrize(("lower", "upper"), [(4, 4), (6, 8), (24, 31)])
@pytest.mark.parametrize("d", [1e-5, 2e-2])
def test_two_blocks_squeezed_by_d_press_as_the_closed_form_says(link, lower, upper, d):
    interface = blocks(lower, upper)
    eps_N = interface.pairs[0].eps_N
    half = elastic(interface, [BELOW, *SIDES, hold(ABOVE, 1, {"t": [0, 1], "value": [0, -d]})], tolerance=1e-12)
    state, _ = half.start(inputs_of(half), 0.0, link)
    state, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    p = squeezed(d, eps_N)
    assert outputs["contact.t_N"] == pytest.approx(-p, rel=1e-8)
    assert outputs["contact.gap"] == pytest.approx(-p / eps_N, rel=1e-8)
    assert (outputs["contact.covered"] > 1.0 - 1e-9).all()
    up, down = outputs["reaction.upper"], outputs["reaction.lower"]
    # Internal forces are differences of stresses whose round-off is that of E.
    assert np.abs(up + down).max() <= max(1e-12 * np.abs(up).max(), 2e-15 * E)
    width = np.ptp(outputs["x"][interface.surfaces[ABOVE], 0])
    assert up[1] == pytest.approx(-p * width, rel=1e-8)
    # Frictionless flanks held by symmetry carry nothing: the block is free sideways.
    assert np.abs(up[0]) <= 1e-8 * np.abs(up[1])
    force = half.system.contact.tractions(link, outputs["x"], state.contact).force
    assert np.abs(force.sum(axis=0)).max() <= 1e-12 * np.abs(force).sum()
    assert np.abs(force).sum() == pytest.approx(2 * p * width, rel=1e-8)


@pytest.mark.parametrize("eps_L_over_E", [0.1, 1.0, 30.0])
def test_c4_penetration_of_a_penalty(link, eps_L_over_E):
    """Two blocks in a row are one bar of 2 L and, in plane strain, modulus E/(1 - nu2)."""
    modulus, length, delta = E / (1 - NU**2), 2.0, 1e-7
    eps_N = eps_L_over_E * modulus / length
    half = elastic(blocks(4, 4, eps_N=eps_N), [BELOW, *SIDES, hold(ABOVE, 1, {"t": [0, 1], "value": [0, -delta]})])
    state, _ = half.start(inputs_of(half), 0.0, link)
    _, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    expected = 1.0 / (1.0 + eps_L_over_E)
    assert -outputs["contact.gap"] / delta == pytest.approx(expected, rel=EXPECTED["C4"]["tolerance"])


@pytest.mark.parametrize("kinds", [("triangles", "quads"), ("quads", "triangles")])
def test_triangles_against_quads_press_evenly(link, kinds):
    interface = blocks(4, 5, kinds=kinds)
    half = elastic(interface, [BELOW, *SIDES, hold(ABOVE, 1, {"t": [0, 1], "value": [0, -1e-5]})])
    state, _ = half.start(inputs_of(half), 0.0, link)
    _, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    assert outputs["contact.t_N"] == pytest.approx(-squeezed(1e-5, interface.pairs[0].eps_N), rel=1e-7)


def test_rings_about_an_axis_press_as_bars(link):
    d = 1e-7
    interface = blocks(4, 5, geometry="axisymmetric", r0=0.5)
    half = elastic(interface, [BELOW, hold(ABOVE, 1, {"t": [0, 1], "value": [0, -d]})])
    state, _ = half.start(inputs_of(half), 0.0, link)
    _, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    p = d / (2.0 / E + 1.0 / interface.pairs[0].eps_N)
    assert outputs["contact.t_N"] == pytest.approx(-p, rel=1e-5)
    assert outputs["reaction.lower"][1] == pytest.approx(p * np.pi * (1.5**2 - 0.5**2), rel=1e-5)


def test_let_go_contact_opens_without_pull(link):
    stroke = {"t": [0, 1, 2, 3], "value": [0, -1e-4, 1e-6, 1e-3]}
    half = elastic(blocks(5, 7), [BELOW, *SIDES, hold(ABOVE, 1, stroke)])
    state, _ = half.start(inputs_of(half), 0.0, link)
    state, pressed = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    assert pressed["contact.t_N"].max() < -1e6
    assert pressed["contact.touching"] > 0
    for t, gap in ((1.0, 1e-6), (2.0, 1e-3)):
        state, free = done(half.step(state, inputs_of(half), t, 1.0, link))
        assert not free["contact.t_N"].any()
        assert free["contact.touching"] == 0
        assert free["contact.gap"] == pytest.approx(gap, rel=1e-6)
        assert np.abs(free["reaction.lower"]).max() <= 1e-8 * np.abs(pressed["reaction.lower"]).max()
        assert free["sigma_v"].max() <= 1e-7 * pressed["sigma_v"].max()


def test_a_body_held_by_contact_alone(link):
    """The upper block rests on the lower one under dead pressure; only its sideways motion is prescribed."""
    interface = blocks(4, 5)
    loads = [BELOW, *SIDES, press(ABOVE, {"t": [0, 1, 2], "value": [1e5, 1e6, 2e6]})]
    apart = elastic(blocks(4, 5, gap=1e-6), loads)
    _, outputs = apart.start(inputs_of(apart), 0.0, link)
    assert outputs["contact.t_N"] == pytest.approx(-1e5, rel=1e-3)
    sunk = np.where(interface.node_body == 1, 1e-7, 0.0)
    interface = replace(interface, nodes=interface.nodes - sunk[:, None] * [0, 1])
    states = {}
    for name, adopt in (("anchored", 0.002), ("fresh", -1.0)):
        half = elastic(interface, loads)
        half.settings = replace(half.settings, adopt=adopt)
        state, _ = half.start(inputs_of(half), 0.0, link)
        for t in (0.0, 1.0):
            state, outputs = done(half.step(state, inputs_of(half), t, 1.0, link))
            assert outputs["contact.t_N"] == pytest.approx(-1e6 * (1 + t), rel=1e-4)
        states[name] = state
    assert states["anchored"].anchored
    assert not states["fresh"].anchored
    assert np.abs(states["anchored"].u - states["fresh"].u).max() <= 1e-13


STROKE = {"t": [0, 1, 2], "value": [0.0, -1e-3, -1.01e-3]}
SLIDE = {"t": [0, 2, 3], "value": [0.0, 0.0, 1.1]}


def sliding(lower=8, upper=11):
    """F1 in small: brought to touch, pressed, slid off by 1.1 L."""
    return elastic(blocks(lower, upper, gap=1e-3), [BELOW, hold("lower.middle", 0), hold(ABOVE, 1, STROKE),
                                                    hold("upper.middle", 0, SLIDE)])


TIMES = np.concatenate([[0.0, 0.9, 1.0, 1.5], np.linspace(2.0, 3.0, 30)])


def drive(half, link, state=None, times=TIMES, keep=lambda state: state):
    if state is None:
        state, _ = half.start(inputs_of(half), times[0], link)
    out = []
    for t0, t1 in pairwise(times):
        state, outputs = done(half.step(state, inputs_of(half), t0, t1 - t0, link))
        state = keep(state)
        out.append((state, outputs))
    return out


def test_sliding_off_takes_few_iterations_and_never_pulls(link):
    run = drive(sliding(), link)
    assert max(o["iterations"] for _, o in run) <= 6
    assert np.median([o["iterations"] for _, o in run]) <= 3
    assert all((o["contact.t_N"] <= 0.0).all() for _, o in run)
    touching = [o["contact.touching"] for _, o in run]
    assert touching[2] > 0
    assert touching[-1] == 0
    before, after = run[2][1], run[-1][1]
    # Slipped off, the bodies are as they were: no stress, and the lower one where it began.
    assert after["sigma_v"].max() <= 1e-6 * before["sigma_v"].max()
    lower = after["x"][:81] - sliding().system.interface.nodes[:81]
    assert np.abs(lower).max() <= 1e-12


def test_sliding_with_old_factors_is_sliding_with_fresh_ones(link):
    old, fresh = sliding(), sliding()
    # What the two ways leave out of balance is not the same: both are told to leave little.
    old.settings = replace(old.settings, tolerance=1e-10)
    fresh.settings = replace(old.settings, adopt=-1.0)
    old_run, fresh_run = drive(old, link), drive(fresh, link)
    assert sum(s.anchored for s, _ in old_run) > 0.8 * len(old_run)
    assert not any(s.anchored for s, _ in fresh_run)
    for (_, a), (_, b) in zip(old_run, fresh_run, strict=True):
        assert np.abs(a["x"] - b["x"]).max() <= 1e-12
        assert np.abs(a["contact.t_N"] - b["contact.t_N"]).max() <= 1e-5 * max(1e7, np.abs(b["contact.t_N"]).max())


def test_directions_with_kept_responses_are_those_of_two_solves(link, monkeypatch):
    """W of an anchor, or a second solve with its factor: at places where contact has changed since, touching or not."""
    half = sliding()
    state, _ = drive(half, link)[6]
    anchor, system = half._anchor(state), half.system
    for shift in (0.0, -1e-4, 3e-4):
        u = np.array(state.u)
        u[system.interface.node_body == 1, 1] += shift
        drive_now = state.drive
        task = Task(drive_now, drive_now, 1.0, contact_query(system, link, state.contact), None)
        balance = system.balance(u, loading_of(system, task, 1.0, 1.0, np.empty(0)))
        gap = np.zeros(system.constraints.fixed.size)
        assert anchor.moved is not None
        kept = anchor.direction(balance, gap)
        with monkeypatch.context() as patch:
            patch.setattr(tangent, "MOST_ENTRIES", 0)
            again = StiffnessAnchor(system, anchor.u, anchor.moduli)
            assert again.moved is None
            solved_twice = again.direction(balance, gap)
        assert np.abs(kept - solved_twice).max() <= 1e-11 * np.abs(solved_twice).max()


def test_hot_and_cold_caches_give_the_same_bits(link):
    """Each step is repeated by a half that has done nothing before, from a copy of the state."""
    for (state, _), (after, outputs), t0, t1 in [
            (*pair, TIMES[i + 1], TIMES[i + 2]) for i, pair in enumerate(pairwise(drive(sliding(), link)))][::4]:
        cold_state, cold = done(sliding().step(frozen_copy(state), inputs_of(sliding()), t0, t1 - t0,
                                               open_link("direct")))
        assert cold_state.u.tobytes() == after.u.tobytes()
        assert cold_state.anchor_u.tobytes() == after.anchor_u.tobytes()
        for name, value in outputs.items():
            assert np.asarray(value).tobytes() == np.asarray(cold[name]).tobytes(), name


def test_step_restore_step_gives_the_same_bits(link):
    half = sliding()
    run = drive(half, link, keep=frozen_copy)
    state = run[9][0]
    t0, t1 = TIMES[10], TIMES[11]
    done(half.step(state, inputs_of(half), t0, 0.3 * (t1 - t0), link))
    again, outputs = done(half.step(state, inputs_of(half), t0, t1 - t0, link))
    assert again.u.tobytes() == run[10][0].u.tobytes()
    assert outputs["contact.t_N"].tobytes() == run[10][1]["contact.t_N"].tobytes()


def test_the_factor_in_use_is_the_one_the_state_names():
    """Stretched far, the block takes its stiffness anew; crept on, it keeps that one: hot and cold, same bits."""
    stretch = {"t": [0, 1, 2, 3], "value": [0, 0.3, 0.3001, 0.3002]}
    boundary = [hold("block.left", 0), hold("block.left", 1), hold("block.right", 0, stretch)]

    def half():
        return elastic(block(np.linspace(0, 1, 5), np.linspace(0, 1, 4)), boundary)

    run = drive(half(), None, times=np.array([0.0, 1.0, 2.0, 3.0]))
    assert [s.anchored for s, _ in run] == [False, True, True]
    for (state, _), (after, _) in pairwise(run):
        cold, _ = done(half().step(frozen_copy(state), inputs_of(half()), state.t, 1.0, None))
        assert cold.u.tobytes() == after.u.tobytes()
