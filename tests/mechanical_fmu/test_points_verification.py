"""B9, B10, B11, B12 and B17 on one point."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from mechanical_fmu.material import thermoelastic_heat
from mechanical_fmu.strain import log_strain_gradient, piola

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED
from point_driver import ONE_CELL, material, parameters, strained, uniaxial, virgin

DIGITS = 3e-8  # the printed ones


def test_b9_a_fixed_bar_heated_and_cooled():
    """Thermal strain alpha dT, as the row means it; alpha dT as a stretch is 6e-4 less of strain.

    Length is kept, so the force per reference area is the Kirchhoff stress.
    """
    row = EXPECTED["B9"]
    point = virgin(material(nu=0.3, plastic={"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}}))
    first = 3 * 1.2e-5 * row["yields_at"]
    assert uniaxial(point, 0.0, e_th=first * (1 - 1e-6)).h[4] == 0.0
    assert uniaxial(point, 0.0, e_th=first * (1 + 1e-6)).h[4] > 0.0
    point = uniaxial(point, 0.0, e_th=3 * 1.2e-5 * 300.0)
    assert point.S[0] == pytest.approx(row["heated"], rel=DIGITS)
    cooled = uniaxial(point, 0.0, e_th=0.0)
    assert cooled.S[0] == pytest.approx(row["cooled"], rel=DIGITS)
    assert cooled.h[4] > point.h[4]
    # Half-way back it is elastic.
    assert uniaxial(point, 0.0, e_th=3 * 1.2e-5 * 150.0).h[4] == point.h[4]


@pytest.mark.parametrize("E", [206.9e9, 206.9e13])
def test_b10_the_largest_load_of_a_voce_bar(E):
    """The row is of a rigid-plastic bar; elastic strain lowers the load by 3e-3 and adds s/E of elongation."""
    row = EXPECTED["B10"]
    m = material(E=E, plastic={"s_y": 450e6, "hardening": {"law": "voce", "Q": 265e6, "b": 16.93, "H": 129.24e6}})
    point, loads = virgin(m), []
    elongations = np.linspace(0.0, 9e-3, 301)[1:]
    for u in elongations:
        point = uniaxial(point, np.log1p(u / 53.334e-3))
        loads.append(point.S[0] / (1 + u / 53.334e-3) * np.pi * 6.413e-3**2)
    i = int(np.argmax(loads))
    at = elongations[i] + 0.5 * (elongations[1] - elongations[0]) * (loads[i + 1] - loads[i - 1]) / (
        2 * loads[i] - loads[i - 1] - loads[i + 1])
    elastic = np.exp(697e6 / E)
    assert loads[i] == pytest.approx(row["load"], rel=row["tolerance"])
    assert at == pytest.approx((53.334e-3 + row["elongation"]) * elastic - 53.334e-3, rel=row["tolerance"])


def test_b11_plastic_work_heats():
    """Adiabatic to a plastic strain of .5; with softening the yield stress follows the temperature it makes."""
    row = EXPECTED["B11"]
    rho_c, G = 7800.0 * 460.0, 2e11 / 2.6
    m = material(plastic={"s_y": 300e6})
    E = (0.5 + 300e6 / (3 * G)) * np.array([1.0, -0.5, 0.0, -0.5])
    assert strained(virgin(m), E).heat / rho_c == pytest.approx(row["rise"], rel=1e-6)
    m = material(plastic={"s_y": 300e6, "factor": {"polynomial": [1.0, -0.002], "T_ref": 300.0}})
    point, T = virgin(m), 300.0
    n = 200
    for k in range(n):
        e = 0.5 * (k + 1) / n
        middle = T
        for _ in range(4):
            # The yield stress of the middle of the step.
            s = 300e6 * (1 - 0.002 * (middle - 300.0))
            new = strained(point, (e + s / (3 * G)) * np.array([1.0, -0.5, 0.0, -0.5]), T=middle)
            middle = T + 0.5 * new.heat / rho_c
        point, T = new, T + new.heat / rho_c
    assert point.h[4] == pytest.approx(0.5, rel=1e-9)
    rise = T - 300.0
    assert rise == pytest.approx(row["rise_softening"], rel=1e-5)


def test_b12_norton_relaxation():
    """Length kept, sides free: first order in the step; twice the fine answer less the coarse one is good to 2e-5."""
    row = EXPECTED["B12"]
    m = material(E=150e9, creep={"A": 1e-40, "n": 4.0})
    answers = []
    for n in (150, 300):
        start = uniaxial(virgin(m), 100e6 / 150e9, dt=0.0)
        assert start.S[0] == pytest.approx(100e6, rel=1e-9)
        point, stress, t = start, [], 0.0
        for stop in row["t"]:
            for to in np.linspace(t, stop, n + 1)[1:] if t == 0 else t * (stop / t) ** (np.arange(1, n + 1) / n):
                point = uniaxial(point, 100e6 / 150e9, dt=to - t)
                t = to
            stress.append(point.S[0])
        answers.append(np.array(stress))
    assert np.abs(answers[1] / row["stress"] - 1.0).max() <= 2e-3
    assert np.abs((2 * answers[1] - answers[0]) / row["stress"] - 1.0).max() <= 2e-5


@pytest.mark.parametrize("spec", [{}, {"plastic": {"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}}},
                                  {"plastic": {"s_y": 250e6, "kinematic": {"C": 5e9, "gamma": 30.0}}}])
def test_b17_a_stretched_block_turned_in_three_unequal_steps(spec):
    m = material(**spec)

    def nominal(point, F, dt):
        E, L, P = np.empty(4), np.empty((4, 5)), np.empty(5)
        log_strain_gradient(F, E, L)
        point = strained(point, E, dt)
        piola(L, point.S, P)
        return point, P

    U = np.array([[1.3, 0.1], [0.0, 1.0]])
    point, still = nominal(virgin(m), np.array([*U.ravel(), 1.0]), 1.0)
    assert np.abs(still).max() > 1e7
    history = point.h
    for degrees, dt in ((10.0, 1.0), (31.0, 0.3), (75.0, 2.0)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        Q = np.array([[c, -s], [s, c]])
        point, P = nominal(point, np.array([*(Q @ U).ravel(), 1.0]), dt)
        expected = np.array([*(Q @ still[:4].reshape(2, 2)).ravel(), still[4]])
        assert np.abs(P - expected).max() <= EXPECTED["B17"]["tolerance"] * np.abs(still).max()
        assert point.h == pytest.approx(history, rel=1e-8, abs=1e-12)


def test_compression_heats_and_free_expansion_does_not():
    """Reversible heat of a volume change: T (de_th/dT) kappa each J/m3."""
    m = material(alpha={"polynomial": [1e-5, 1e-8], "T_ref": 300.0}, T_ref=300.0)
    kappa = parameters(m, 400.0)[2]
    heat = thermoelastic_heat((m,), ONE_CELL, np.array([400.0]), np.array([kappa]), np.array([-1e-4]))
    step = 1e-3
    rate = (parameters(m, 400.0 + step)[3] - parameters(m, 400.0 - step)[3]) / (2 * step)
    assert heat[0] > 0.0
    assert heat[0] == pytest.approx(kappa * 400.0 * 1e-4 * rate, rel=1e-6)
    plain = material(alpha=1.2e-5, T_ref=300.0)
    heat = thermoelastic_heat((plain,), ONE_CELL, np.array([300.0]), np.array([kappa]), np.array([1e-4]))
    assert heat[0] == pytest.approx(-3 * kappa * 1.2e-5 * 300.0 * 1e-4, rel=1e-12)
