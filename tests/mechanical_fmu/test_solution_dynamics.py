"""Inertia: B15, numerical damping, free flight, explicit steps; energy where it must stay."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from contact.half.model import Discard
from contact.half.state import from_bytes, frozen_copy, to_bytes
from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, NoLink, block, blocks, done, elastic, hold, inputs_of

E, RHO = 1e6, 1000.0
# One cell, nu = 0, held below and at its sides: u(top) is one degree of freedom, k = E, m = rho/2 when lumped.
W = np.sqrt(E / (RHO / 2.0))
SMALL = 1e-7


def oscillator(v0=SMALL * W, **more):
    interface = block([0.0, 1.0], [0.0, 1.0])
    held = [hold(f"block.{side}", 0) for side in ("left", "right")] + [hold("block.bottom", 1)]
    return elastic(interface, held, {"E": E, "nu": 0.0, "alpha": 0.0, "rho": RHO}, tolerance=1e-12,
                   bodies={"block": {"material": "m", "v0": [0.0, v0]}}, **more)


def path(half, dt, n, **inputs):
    """u and v of the top at every step."""
    state, _ = half.start(inputs_of(half) | inputs, 0.0, NoLink())
    out = [(state.u[1, 1], state.v[1, 1])]
    for i in range(n):
        state, _ = done(half.step(state, inputs_of(half) | inputs, i * dt, dt, NoLink()))
        out.append((state.u[1, 1], state.v[1, 1]))
    return np.array(out)


def amplitude(found):
    """Of u, scaled: from the energy of the oscillator, exact for any phase."""
    return np.hypot(found[:, 0], found[:, 1] / W) / SMALL


def phase(found):
    """Total angle gone through."""
    return -np.unwrap(np.arctan2(found[:, 1] / W, found[:, 0]))[-1] + np.arctan2(found[0, 1] / W, found[0, 0])


def test_b15_newmark_keeps_the_amplitude_and_lengthens_the_period():
    row = EXPECTED["B15"]
    half = oscillator(dynamics={"mass": "lumped"})
    errors = []
    for per_period in (20, 40):
        dt = 2.0 * np.pi / W / per_period
        found = path(half, dt, 2 * per_period)
        assert np.abs(amplitude(found) - 1.0).max() <= row["amplitude_decay"]
        elongation = 4.0 * np.pi / phase(found) - 1.0
        assert elongation == pytest.approx((W * dt) ** 2 * row["elongation_over_wdt2"], rel=row["elongation_tolerance"])
        errors.append(np.abs(found[-1, 0] / SMALL))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(row["order"], abs=row["order_tolerance"])


@pytest.mark.parametrize("how", [{"rho_inf": 0.5}, {"alpha": -0.1}])
def test_numerical_damping_takes_the_fast_and_leaves_the_slow(how):
    half = oscillator(dynamics={"mass": "lumped", **how})
    slow = amplitude(path(half, 2.0 * np.pi / W / 100, 100))[-1]
    fast = amplitude(path(half, 100.0 / W, 20))[-1]
    assert slow > 0.999
    assert fast < 0.3
    assert amplitude(path(oscillator(dynamics={"mass": "lumped"}), 100.0 / W, 20))[-1] == pytest.approx(1.0, abs=1e-6)


def test_damped_methods_keep_the_second_order():
    half = oscillator(dynamics={"mass": "lumped", "rho_inf": 0.3})
    errors = [np.abs(path(half, 2.0 * np.pi / W / n, n)[-1, 0] / SMALL) for n in (40, 80)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_central_differences_are_of_order_two_and_shorten_the_period():
    half = oscillator(method="explicit")
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    answer = half.step(state, inputs_of(half), 0.0, 1e-6, NoLink())
    # A cell's own frequency with all its nodes free is what bounds; the mesh's is lower.
    assert 0.3 * 2.0 / W <= answer.dt_stable <= 2.0 / W
    dt = 2.0 * np.pi / W / 20
    found = path(half, dt, 40)
    assert amplitude(found)[-1] == pytest.approx(1.0, abs=2e-2)
    assert phase(found) / (4.0 * np.pi) - 1.0 == pytest.approx((W * dt) ** 2 / 24.0, rel=0.1)


def test_an_explicit_step_agrees_with_small_implicit_ones():
    half = oscillator(method="explicit", dynamics={"mass": "lumped"})
    dt = 2.0 * np.pi / W / 64
    explicit = path(half, dt, 64)
    implicit = path(half, dt, 64, **{"control.method": 1})
    assert np.abs(explicit - implicit)[:, 0].max() / SMALL <= 2e-2


def test_a_free_body_flies_and_turns_and_keeps_its_energy():
    interface = block(np.linspace(0, 1, 4), np.linspace(0, 1, 4))
    half = elastic(interface, [], {"E": 1e9, "rho": RHO}, dynamics={}, tolerance=1e-10, gravity={"y": -10.0},
                   bodies={"block": {"material": "m", "v0": [2.0, 1.0], "omega0": 3.0}})
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    dt, n = 2e-3, 50
    for i in range(n):
        state, _ = done(half.step(state, inputs_of(half), i * dt, dt, NoLink()))
    t, M = dt * n, half.system.masses.matrix(False)
    momentum = (M @ state.v.ravel()).reshape(-1, 2).sum(axis=0)
    assert momentum == pytest.approx([2.0 * RHO, (1.0 - 10.0 * t) * RHO], rel=1e-8, abs=1e-6)
    spin = state.v - momentum / RHO
    assert 0.5 * spin.ravel() @ (M @ spin.ravel()) == pytest.approx(0.5 * RHO / 6.0 * 9.0, rel=2e-2)


def test_a_rigid_body_with_a_moment_turns_as_its_inertia_says():
    """J = rho (a2 + b2)/12 per area; theta = M t2/(2 J) without bound, the centre as a point mass."""
    interface = block([0.0, 0.3, 2.0], [0.0, 1.0])
    half = elastic(interface, [{"on": "block", "moment": 1e4},
                               {"on": "block", "f_x": 2e3}],
                   {"rho": RHO}, dynamics={}, bodies={"block": {"material": "m", "rigid": True, "v0": [0, 1.0],
                                                                "omega0": 2.0}})
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    for i in range(10):
        state, outputs = done(half.step(state, inputs_of(half), 0.1 * i, 0.1, NoLink()))
    J, m = RHO * 2.0 * (4.0 + 1.0) / 12.0, RHO * 2.0
    assert outputs["motion.block"] == pytest.approx([2e3 / (2 * m), 1.0, 2.0 + 1e4 / (2 * J)], rel=1e-8)


@pytest.mark.parametrize(("spec", "text"), [({"rho_inf": 1.5}, "rho_inf: must lie between 0 and 1, not 1.5"),
                                            ({"alpha": 0.2}, "alpha: must lie between"),
                                            ({"beta": 0.1}, "stable for small steps only"),
                                            ({"beta": 0.25, "rho_inf": 1.0},
                                             "one of beta and gamma, rho_inf, alpha is enough"),
                                            ({"mass": "heavy"},
                                             "mass: not known here, not 'heavy'.*consistent, lumped")])
def test_bad_dynamics_are_refused(spec, text):
    with pytest.raises(ValueError, match=text):
        elastic(block([0, 1], [0, 1]), material={"rho": 1.0}, dynamics=spec)


def test_what_inertia_needs_is_asked_for():
    with pytest.raises(ValueError, match=r"materials\.m: material 'm' lacks rho, .* \(inertia needs rho\)"):
        elastic(block([0, 1], [0, 1]), dynamics={})
    with pytest.raises(ValueError, match="without dynamics a body has no velocity"):
        elastic(block([0, 1], [0, 1]), bodies={"block": {"material": "m", "v0": [1, 0]}})
    half = elastic(block([0, 1], [0, 1]), [hold("block.bottom", 0), hold("block.bottom", 1)])
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    answer = half.step(state, inputs_of(half) | {"control.method": 4}, 0.0, 1.0, NoLink())
    assert isinstance(answer, Discard)
    assert "explicit needs dynamics" in answer.message


def test_explicit_steps_refuse_pressures_that_settle():
    """A master that switches the method is told what model.json is: they would press by their penalty alone."""
    held = [hold("lower.bottom", 0), hold("lower.bottom", 1)]
    half = elastic(blocks(1, 1), held, {"rho": RHO}, dynamics={}, pairs={"interface": {"augmented": {}}})
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        answer = half.step(state, inputs_of(half) | {"control.method": 4}, 0.0, 1e-6, link)
    assert isinstance(answer, Discard)
    assert "pairs.interface must not be augmented" in answer.message


def test_a_state_with_velocities_restores_the_same_bits_in_another_half():
    held = [hold("block.left", 0), hold("block.left", 1)]

    def made():
        return elastic(block(np.linspace(0, 4, 6), [0, 1]), held, {"E": 1e7, "rho": RHO}, dynamics={"rho_inf": 0.8},
                       gravity={"y": -10.0})

    first, second = made(), made()
    state, _ = first.start(inputs_of(first), 0.0, NoLink())
    state, _ = done(first.step(state, inputs_of(first), 0.0, 0.01, NoLink()))
    data = to_bytes(frozen_copy(state))
    warm, _ = done(first.step(state, inputs_of(first), 0.01, 0.02, NoLink()))
    again = from_bytes(data, {"contact", "mechanical_fmu"})
    cold, _ = done(second.step(again, inputs_of(second), 0.01, 0.02, NoLink()))
    assert to_bytes(frozen_copy(warm)) == to_bytes(frozen_copy(cold))
    assert np.abs(warm.v).max() > 1e-2
