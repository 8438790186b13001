"""Points that flow: consistent tangents, closed forms, energy, any size of step."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from mechanical_fmu.laws.law import has_skew_tangent, history_size
from mechanical_fmu.point import deviator, update

sys.path.insert(0, str(Path(__file__).parent))
from point_driver import material, parameters, strained, uniaxial, virgin

NORTON = {"A": 1e-40, "n": 4.0}
VOCE = {"s_y": 250e6, "hardening": {"law": "voce", "Q": 265e6, "b": 16.93, "H": 129e6}}
AF = {"kinematic": {"C": 50e9, "gamma": 300.0}}
OVER = {"overstress": {"K": 50e6, "m": 0.1}}
TABLE = {"law": "table", "strain": [0.0, 0.01, 0.1, 1.0], "stress": [2e8, 2.5e8, 3e8, 3.1e8]}
LIQUID = {"eta": 1e6, "bulk": 1e11, "T_s": 1000.0, "T_l": 1100.0}
KINDS = {
    "perfect": {"plastic": {"s_y": 250e6}},
    "linear": {"plastic": {"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}}},
    "softening": {"plastic": {"s_y": 250e6, "hardening": {"law": "linear", "H": -1e8}, "softening": True}},
    "voce": {"plastic": VOCE},
    "table": {"plastic": {"hardening": TABLE}},
    "cubic table": {"plastic": {"hardening": {**TABLE, "form": "cubic", "beyond": "slope"}}},
    "Prager": {"plastic": {"s_y": 250e6, "kinematic": {"C": 5e9}}},
    "Armstrong-Frederick": {"plastic": {**VOCE, **AF}},
    "overstress": {"plastic": {**VOCE, **OVER}},
    "overstress, backstress": {"plastic": {**VOCE, **AF, **OVER}},
    "creep": {"creep": NORTON},
    "superplastic": {"creep": {"K": 1e9, "m": 0.5}},
    "creep, plastic": {"plastic": VOCE, "creep": NORTON},
    "creep, overstress": {"plastic": {**VOCE, **OVER}, "creep": NORTON},
    "liquid": {"liquid": {**LIQUID, "T_l": 1000.0}, "plastic": {"s_y": 1e7}},
    "mush": {"liquid": LIQUID, "plastic": {**VOCE, **AF, **OVER}},
    "creeping mush": {"liquid": LIQUID, "plastic": VOCE, "creep": NORTON},
}
W = np.diag([1.0, 1.0, 2.0, 1.0])
STEP = 1e-7


def step(m, E, dt, h_n, p):
    h, S, D = np.full(len(h_n), np.nan), np.empty(4), np.empty((4, 4))
    before = h_n.copy()
    code, heat = update(m.kind, p[0], p[1], E, dt, h_n, h, S, D)
    assert code == 0
    assert np.array_equal(h_n, before)
    return S, D, h, heat


@pytest.mark.parametrize("dt", [0.0, 1e-3, 1.0, 1e5, 1e20])
@pytest.mark.parametrize("name", KINDS)
def test_the_tangent_is_consistent_on_a_random_path(name, dt):
    m = material(**KINDS[name])
    p = parameters(m, 1050.0)
    random, h = np.random.default_rng(3), np.zeros(history_size(m.kind))
    for size in (3e-4, 3e-3, 3e-3, 0.1, 0.1):
        E = size * random.standard_normal(4)
        S, D, after, heat = step(m, E, dt, h, p)
        found = np.stack([(step(m, E + d, dt, h, p)[0] - step(m, E - d, dt, h, p)[0]) / (2 * STEP)
                          for d in STEP * np.eye(4)], axis=1)
        scale = max(np.abs(D).max(), 1e-6 * p[0].shear_modulus, 1e-8 * np.abs(S).max() / STEP)
        assert np.abs(D - found).max() <= 1e-6 * scale
        assert abs(S[0] + S[1] + S[3]) <= 1e-14 * max(np.abs(S).max(), p[0].shear_modulus * np.abs(E).max())
        if not has_skew_tangent(m.kind):
            assert np.abs(W @ D - (W @ D).T).max() <= 1e-14 * np.abs(D).max()
        assert heat >= 0.0
        h = after


@pytest.mark.parametrize("name", ["perfect", "voce", "table", "cubic table", "Armstrong-Frederick"])
def test_the_stress_ends_on_the_yield_surface_after_steps_of_any_size(name):
    m = material(**KINDS[name])
    p = parameters(m)
    for size in (5e-3, 0.05, 1.0, 1e3):
        S, _, h, _ = step(m, size * np.array([1.0, -0.3, 0.4, -0.1]), 1.0, np.zeros(history_size(m.kind)), p)
        s = S - (h[6:10] if len(h) > 6 else 0.0)
        q, e = np.sqrt(1.5 * (s @ W @ s)), h[4]
        R = {"perfect": 250e6, "table": np.interp(e, TABLE["strain"], TABLE["stress"])}.get(
            name, 250e6 + 265e6 * (1 - np.exp(-16.93 * e)) + 129e6 * e)
        assert e > 0.0
        if name == "cubic table":
            assert TABLE["stress"][0] < q
        else:
            assert q == pytest.approx(R, rel=1e-9)


def test_newton_finds_a_uniaxial_state_quadratically():
    m = material(plastic={**VOCE, **AF})
    point = strained(virgin(m), [0.01, 0.01, 0.01, -0.015])
    errors = [e for e in uniaxial(point, 0.012).errors if e > 1.0][-3:]
    assert np.log(errors[2] / errors[1]) / np.log(errors[1] / errors[0]) >= 1.8


def test_isotropic_and_kinematic_hardening_reverse_as_they_should():
    """To strain a and back: with H the reversed yield is at -s, with C at s - 2 s0."""
    H, s0, E = 2e9, 250e6, 2e11
    for kind in ("isotropic", "kinematic"):
        hardening = {"hardening": {"law": "linear", "H": H}} if kind == "isotropic" else {"kinematic": {"C": H}}
        point = uniaxial(virgin(material(plastic={"s_y": s0, **hardening})), 0.01)
        s = s0 + H * (0.01 - s0 / E) / (1 + H / E)
        assert point.S[0] == pytest.approx(s, rel=1e-9)
        span = 2 * s if kind == "isotropic" else 2 * s0
        still, flows = uniaxial(point, 0.01 - 0.999 * span / E), uniaxial(point, 0.01 - 1.01 * span / E)
        assert still.h[4] == point.h[4]
        assert flows.h[4] > point.h[4]
        assert flows.S[0] == pytest.approx(s - span - 0.01 * span * H / (E + H), rel=1e-9)


def test_backstress_saturates_at_c_over_gamma():
    """Monotonic: X = C/gamma (1 - exp(-gamma p)), by backward Euler of first order."""
    C, gamma = 50e9, 300.0
    errors = []
    for n in (100, 200):
        point = virgin(material(plastic={"s_y": 250e6, **AF}))
        for strain in np.linspace(0.0, 0.02, n + 1)[1:]:
            point = uniaxial(point, strain)
        errors.append(1.5 * point.h[6] - C / gamma * (1 - np.exp(-gamma * point.h[4])))
    assert abs(errors[1]) <= 0.01 * C / gamma
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)


def test_steady_flow_stresses():
    """At a steady rate: Norton (rate/A)^(1/n), superplastic K rate^m, overstress R + K rate^m, liquid 3 eta rate."""
    rate = 1e-3
    wanted = {"creep": (rate / 1e-40) ** 0.25, "superplastic": 1e9 * rate**0.5,
              "overstress": 3e8 + 5e7 * rate**0.1, "liquid": 3e6 * rate}
    given = {**KINDS, "overstress": {"plastic": {"s_y": 3e8, **OVER}}}
    for name, q in wanted.items():
        point = virgin(material(**given[name]))
        for _ in range(60):
            E = point.E + rate * 50.0 * np.array([1.0, -0.5, 0.0, -0.5])
            point = strained(point, E, 50.0, 1050.0)
        assert point.S[0] - point.S[1] == pytest.approx(q, rel=1e-6), name


def test_creep_converges_over_any_length_of_step():
    """n = 4, A = 1e-40: q + 3 G dt A q^4 = q_trial holds to round-off from 1e-30 to 1e300 s."""
    m = material(creep=NORTON)
    E, G = np.array([0.01, -0.005, 0.003, -0.005]), 2e11 / 2.6
    trial = 2 * G * np.sqrt(1.5 * (E @ W @ E))
    for dt in 10.0 ** np.arange(-30.0, 301.0, 15.0):
        s = strained(virgin(m), E, dt).S
        top = np.abs(s).max()
        q = top * np.sqrt(1.5 * ((s / top) @ W @ (s / top)))
        assert np.logaddexp(np.log(q), np.log(3 * G) + np.log(dt) + np.log(1e-40) + 4 * np.log(q)) == pytest.approx(
            np.log(trial), rel=1e-13)


def test_creep_slows_with_temperature_as_arrhenius_says():
    m = material(creep={"A": 1e-30, "n": 4.0, "Q": 3e5})
    cold, hot = (parameters(m, T)[0].creep_log_factor for T in (600.0, 900.0))
    assert hot - cold == pytest.approx(3e5 / 8.31446261815324 * (1 / 600 - 1 / 900), rel=1e-12)
    assert hot == pytest.approx(np.log(1e-30) - 3e5 / (8.31446261815324 * 900), rel=1e-12)


def test_plastic_flow_caps_what_creep_leaves():
    """Short steps leave the yield stress, long ones creep below it."""
    m = material(plastic={"s_y": 250e6}, creep=NORTON)
    E = np.array([0.01, -0.005, 0.0, -0.005])
    short, long = strained(virgin(m), E, 1e-3), strained(virgin(m), E, 1e6)
    assert short.S[0] - short.S[1] == pytest.approx(250e6, rel=1e-12)
    assert short.h[4] > 1e3 * short.h[5] > 0.0
    q = long.S[0] - long.S[1]
    assert q + 3 * 2e11 / 2.6 * 1e6 * 1e-40 * q**4 == pytest.approx(2e11 / 1.3 * 0.015, rel=1e-12)
    assert q < 100e6
    assert long.h[4] == 0.0


def test_creep_beside_hardening_that_bends_is_found():
    """n = 20 and Voce: Newton's method alone hops for ever between the two sides of the bend."""
    s0, Q, b = 1022314371.1884116, 3376405683.190754, 1.4120055918414174
    m = material(E=2.6 * 78383065386.88814, plastic={"s_y": s0, "hardening": {"law": "voce", "Q": Q, "b": b}},
                 creep={"A": np.exp(-443.0337171124942), "n": 20.0})
    S, D, h, _ = step(m, np.array([1.08840173, 1.55657012, -1.94226521, -0.16377704]), 44.28837039437646, np.zeros(6),
                      parameters(m))
    q = np.sqrt(1.5 * (S @ W @ S))
    assert q == pytest.approx(s0 + Q * (1 - np.exp(-b * h[4])), rel=1e-9)
    assert h[4] == pytest.approx(0.955, abs=1e-3)
    assert np.isfinite(D).all()


def test_heat_is_the_share_of_what_is_dissipated():
    """Linear hardening: chi (s0 p + H p^2/2) in one step; a Prager backstress stores its part; creep gives q dc."""
    E = np.array([0.1, -0.05, 0.0, -0.05])
    point = strained(virgin(material(plastic={"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}})), E)
    p = point.h[4]
    assert point.heat == pytest.approx(0.9 * (250e6 * p + 1e9 * p * p), rel=1e-9)
    point = strained(virgin(material(plastic={"s_y": 250e6, "kinematic": {"C": 2e9}, "chi": 1.0})), E)
    assert point.heat == pytest.approx(250e6 * point.h[4], rel=1e-9)
    point = strained(virgin(material(creep=NORTON)), E, 1e3)
    assert point.heat == pytest.approx((point.S[0] - point.S[1]) * point.h[5], rel=1e-9)


def test_work_is_what_is_stored_and_what_is_lost():
    """A cycle with a backstress that forgets, chi = 1: work = heat + elastic and backstress energy, of order 1."""
    left = []
    for n in (200, 400):
        m = material(plastic={"s_y": 250e6, "chi": 1.0, **AF})
        point, work, heat = virgin(m), 0.0, 0.0
        path = np.concatenate([np.linspace(0, 0.01, n), np.linspace(0.01, -0.01, 2 * n), np.linspace(-0.01, 0, n)])
        for a in path:
            new = strained(point, a * np.array([1.0, -0.5, 0.0, -0.5]))
            work += 0.5 * (new.S + point.S) @ W @ (new.E - point.E)
            heat += new.heat
            point = new
        e, X = np.empty(4), point.h[6:10]
        deviator(point.E, e)
        stored = 2e11 / 2.6 * (e - point.h[:4]) @ W @ (e - point.h[:4]) + 0.75 / 50e9 * X @ W @ X
        left.append((work - heat - stored) / work)
    assert abs(left[1]) <= 0.01
    assert left[0] / left[1] == pytest.approx(2.0, abs=0.2)


def test_moduli_that_change_with_temperature_change_the_stress_of_the_same_strain():
    m = material(E={"T": [300, 600], "value": [2e11, 1e11]}, plastic={"s_y": 1e9})
    point = strained(virgin(m), [1e-3, -5e-4, 0.0, -5e-4], T=300.0)
    assert strained(point, point.E, T=600.0).S[0] == pytest.approx(0.5 * point.S[0], rel=1e-12)
    assert point.S[0] == pytest.approx(2e11 / 1.3 * 1e-3, rel=1e-12)


def test_what_softens_too_fast_is_told():
    m = material(E=2e9, plastic={"s_y": 2e8, "hardening": {"law": "linear", "H": -4e9}, "softening": True})
    p = parameters(m)
    h, S, D = np.zeros(6), np.empty(4), np.empty((4, 4))
    assert update(m.kind, p[0], p[1], np.array([0.12, -0.06, 0.0, -0.06]), 1.0, np.zeros(6), h, S, D)[0] == 2
    assert update(m.kind, p[0], p[1], np.array([np.nan, 0.0, 0.0, 0.0]), 1.0, np.zeros(6), h, S, D)[0] == 3
