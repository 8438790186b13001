"""Conductance laws: published numbers, joined branches, exact derivatives, and clear words for wrong parameters."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EXPECTED

from contact.laws import (
    branch_jump,
    closed_conductance,
    gap_factor,
    open_conductance,
    parse_law,
)

CMY = {"law": "cmy", "k_s": 2 * 210 * 45 / (210 + 45), "m": 0.1, "sigma": 2e-6, "H": 3e9}
GAS = {"law": "gas", "k_g": 0.06, "g_m": 2e-6}
POWER = {"law": "power", "h0": 2000, "h1": 6000, "p0": 1e7, "exponent": 0.95, "p_max": 1e7}
TABLE = {"law": "table", "x": [0, 1e6, 4e6], "h": [100, 900, 1000]}
TABLE_T = {"law": "table", "x": [300, 400, 600], "h": [100, 300, 350], "variable": "T"}


def test_d4_gap_law_one_over_g() -> None:
    """D4: k_g 1 over a unit gap between 200 and 100; the floor g_m is made too small to count."""
    h, _ = open_conductance(parse_law({"law": "gas", "k_g": 1, "g_m": 1e-13}), 1.0, 150.0)
    assert h * (200 - 100) == pytest.approx(EXPECTED["D4"]["q"], rel=1e-12)


def test_d6_cooper_mikic_yovanovich() -> None:
    D6 = EXPECTED["D6"]
    p = np.array(D6["p"])
    h, dh_dT = closed_conductance(parse_law(CMY), p, 300.0)
    np.testing.assert_allclose(h, D6["expected"], rtol=D6["tolerance"])
    np.testing.assert_allclose(np.diff(np.log(h)) / np.diff(np.log(p)), D6["slope"], rtol=1e-12)
    assert not dh_dT.any()


def test_d7_rarefied_gas() -> None:
    D7 = EXPECTED["D7"]
    h, _ = open_conductance(parse_law(GAS), np.array(D7["g"]), 300.0)
    np.testing.assert_allclose(h, D7["expected"], rtol=0, atol=D7["tolerance"])


def test_a_gas_without_a_jump_distance() -> None:
    """k_g/g down to 1 nm, and finite at the touch, where an open point that is not pressed has no gap."""
    h, _ = open_conductance(parse_law({"law": "gas", "k_g": 0.03, "g_m": 0}), np.array([1e-3, 1e-8, 0.0]), 300.0)
    np.testing.assert_allclose(h, [30.0, 3e6, 3e7], rtol=1e-14)


def test_power_law_of_the_sliding_blocks() -> None:
    """2000 + 6000 min(p/10 MPa, 1)^.95, and it joins the gas gap .05/25e-6 at the touch."""
    law = parse_law(POWER)
    h, _ = closed_conductance(law, np.array([0.0, 5e6, 1e7, 9e7]), 300.0)
    np.testing.assert_allclose(h, [2000, 2000 + 6000 * 0.5**0.95, 8000, 8000], rtol=1e-14)
    gas = parse_law({"law": "gas", "k_g": 0.05, "g_m": 25e-6})
    assert branch_jump(law, gas, 300.0) == pytest.approx(0.0, abs=1e-9)
    assert branch_jump(law, parse_law(GAS), 300.0) == pytest.approx(2000 - 30000)


def test_power_law_without_a_cap_goes_on() -> None:
    law = parse_law({k: v for k, v in POWER.items() if k != "p_max"})
    assert closed_conductance(law, 4e7, 300.0)[0] == pytest.approx(2000 + 6000 * 4**0.95)


def test_table_is_monotone_and_held_at_its_ends() -> None:
    """Through its points, no overshoot between them (a spline would), constant beyond."""
    law = parse_law(TABLE)
    x = np.linspace(0, 6e6, 601)
    for conductance in (closed_conductance, open_conductance):
        h, _ = conductance(law, x, 300.0)
        assert (np.diff(h) >= 0).all()
        np.testing.assert_allclose(h[[0, 100, 400, 600]], [100, 900, 1000, 1000], rtol=1e-13)


def test_a_table_that_ends_at_nothing_conducts_no_less() -> None:
    law = parse_law({"law": "table", "x": [0.0, 1e-5], "h": [3000.0, 0.0]})
    assert open_conductance(law, np.array([1e-5, 1e-3]), 300.0)[0].tolist() == [0.0, 0.0]


def test_derivative_in_temperature_is_exact() -> None:
    law = parse_law({"law": "sum", "of": [TABLE_T, {"law": "constant", "h": 7}]})
    T, e = np.array([250.0, 320.0, 370.0, 450.0, 599.0, 700.0]), 1e-4
    h, dh_dT = closed_conductance(law, 1e6, T)
    difference = (closed_conductance(law, 1e6, T + e)[0] - closed_conductance(law, 1e6, T - e)[0]) / (2 * e)
    np.testing.assert_allclose(dh_dT, difference, rtol=1e-6, atol=1e-7)
    assert h[0] == pytest.approx(107)
    assert (dh_dT[[0, -1]] == 0).all()


def test_sum_adds_and_serves_both_branches() -> None:
    """Spots and gas side by side: open it is gas alone, touching it is gas at no gap and the spots; it joins."""
    law = parse_law({"law": "sum", "of": [CMY, GAS]})
    assert open_conductance(law, 1e-5, 300.0)[0] == pytest.approx(5000)
    assert closed_conductance(law, 1e6, 300.0)[0] == pytest.approx(30000 + 2304.286, rel=1e-6)
    assert branch_jump(law, law, 300.0) == 0.0


def test_gap_factor() -> None:
    """Eq. (7) mended: 0 up to d_cut (the misprint gives -1 there), 1 from d_full on, linear between."""
    np.testing.assert_allclose(gap_factor([-1.0, 0.0, 1e-3, 3.5e-3, 6e-3, 1.0], 1e-3, 6e-3), [0, 0, 0, 0.5, 1, 1],
                               atol=1e-15)
    for d_cut, d_full in ((1e-3, 1e-3), (2e-3, 1e-3), (-1e-3, 1e-3), (np.nan, 1.0)):
        with pytest.raises(ValueError, match="d_cut < d_full"):
            gap_factor(0.0, d_cut, d_full)


@pytest.mark.parametrize(("spec", "words"), [
    ({"law": "cym", "k_s": 1}, "law.law: not known here, not 'cym'. Did you mean 'cmy'"),
    ({}, "law.law: a required key is missing"),
    ({"law": ["gas"]}, "law:"),
    ("gas", "a contact law is needed here, .*not 'gas'"),
    ({"law": "constant"}, "law.h: a required key is missing"),
    ({"law": "constant", "h": -1}, "law.h: must not be negative, not -1"),
    ({"law": "constant", "h": True}, "law.h: a number is needed here, not true or false"),
    ({"law": "constant", "h": "5"}, "law.h: a number is needed here, not text, not '5'"),
    ({"law": "constant", "h": float("nan")}, "law.h: the number is not finite, not nan"),
    ({"law": "constant", "h": 1, "g": 2}, "law.g: unknown key, not 2"),
    ({**GAS, "g_m": -1e-9}, "law.g_m: must not be negative, not -1e-09"),
    ({**POWER, "p_max": -1}, "law.p_max: must be greater than zero"),
    ({**POWER, "exponent": 0}, "law.exponent: must be greater than zero"),
    ({**CMY, "sigma": 0.0}, "law.sigma: must be greater than zero"),
    ({**TABLE, "h": [1, 2]}, "equally long"),
    ({**TABLE, "h": [1, 2, -3]}, "law.h.2: must not be negative, not -3"),
    ({**TABLE, "x": [0, 0, 1]}, "increase"),
    ({**TABLE, "x": ["a", "b", "c"]}, "law.x.0: a number is needed"),
    ({**TABLE, "variable": "p"}, "law.variable: not known here, not 'p'"),
    ({"law": "sum", "of": []}, "law.of: at least one law is needed"),
    ({"law": "sum", "of": [GAS, {"law": "gas"}]}, "law.of.1.k_g: a required key is missing"),
])
def test_wrong_parameters_are_named(spec: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_law(spec)


def test_shapes_are_kept() -> None:
    """Laws are elementwise on any shape, also none at all."""
    for spec in (CMY, GAS, POWER, TABLE, TABLE_T, {"law": "constant", "h": 1}, {"law": "sum", "of": [CMY, TABLE_T]}):
        for shape in ((0,), (3,), (2, 3)):
            for conductance in (closed_conductance, open_conductance):
                h, dh_dT = conductance(parse_law(spec), np.full(shape, 1e-3), np.full(shape, 350.0))
                assert h.shape == dh_dT.shape == shape
