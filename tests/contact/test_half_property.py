"""Properties of temperature: value, slope and increase agree with each other, inside a table and beyond it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from contact.half.functions import SMALL, property_from

TABLE = {"T": [300.0, 400.0, 700.0], "value": [10.0, 40.0, 25.0], "form": "cubic"}
SPECS = [7.0, TABLE, {"T": [300.0, 500.0], "value": [1.0, 2.0]}, {"polynomial": [2.0, 0.01, 1e-5], "T_ref": 300.0}]


@pytest.mark.parametrize("spec", SPECS, ids=["constant", "table", "line", "polynomial"])
def test_slope_and_increase_belong_to_the_value(spec):
    p = property_from(spec)

    def value(T):
        return float(p(np.array([T]))[0])

    for T0, T in [(310.0, 390.0), (250.0, 900.0), (650.0, 320.0)]:
        exact, _ = quad(value, T0, T, points=[300.0, 400.0, 500.0, 700.0], limit=200)
        assert p.increase(np.array([T0]), np.array([T]))[0] == pytest.approx(exact, rel=1e-9)
    for T in (200.0, 350.0, 620.0, 800.0):
        numeric = (value(T + 1e-3) - value(T - 1e-3)) / 2e-3
        assert p.slope(np.array([T]))[0] == pytest.approx(numeric, rel=1e-6, abs=1e-9)


def test_increases_of_a_path_add_up():
    p, T = property_from(TABLE), np.linspace(200.0, 900.0, 50)
    assert p.increase(T[:-1], T[1:]).sum() == pytest.approx(float(p.increase(T[:1], T[-1:])[0]), rel=1e-13)


def test_a_table_is_straight_between_its_points_unless_it_is_said_to_be_cubic():
    """(300, 1), (400, 100), (500, 1): the cubic has a third more under it, 100 x (1 + 2/3 x 99) and not 100 x 50.5."""
    table = {"T": [300.0, 400.0, 500.0], "value": [1.0, 100.0, 1.0]}
    linear, cubic = property_from(table), property_from(table | {"form": "cubic"})
    T = np.array([250.0, 300.0, 325.0, 400.0, 450.0, 500.0, 600.0])
    assert linear(T) == pytest.approx([1.0, 1.0, 25.75, 100.0, 50.5, 1.0, 1.0], rel=1e-15)
    assert linear.slope(T) == pytest.approx([0.0, 0.99, 0.99, -0.99, -0.99, -0.99, 0.0], rel=1e-14)
    under = [float(p.increase(np.array(300.0), np.array(500.0))) for p in (linear, cubic)]
    assert under == pytest.approx([200 * 50.5, 2 * (100.0 + 2.0 / 3.0 * 9900.0)], rel=1e-13)
    assert under[1] / under[0] == pytest.approx(1.3267, abs=1e-4)
    assert property_from({"T": [300.0, 400.0], "value": [1.0, 2.0], "form": "cubic"})(T).tolist() == property_from(
        {"T": [300.0, 400.0], "value": [1.0, 2.0]})(T).tolist()


@pytest.mark.parametrize("spec", [*SPECS[1:], TABLE | {"form": "linear"}],
                         ids=["table", "line", "polynomial", "linear"])
def test_a_few_temperatures_are_told_to_the_bit_what_many_are(spec):
    """Few go through a loop of our own, many through scipy's: values, slopes and integrals, at a table's points too."""
    p = property_from(spec)
    T = np.concatenate([np.random.default_rng(0).uniform(200.0, 900.0, SMALL), [300.0, 400.0, 500.0, 700.0, np.nan]])
    T.flags.writeable = False
    start = np.full(T.shape, 350.0)
    for many, few in ((p(T), [p(t) for t in np.split(T, [7, 50, 51])]),
                      (p.slope(T), [p.slope(t) for t in np.split(T, [7, 50, 51])]),
                      (p.increase(start, T), [p.increase(start[:1], t) for t in np.split(T, [7, 50, 51])])):
        np.testing.assert_array_equal(np.concatenate(few), many)
    assert p(np.array(450.0)).shape == ()
    assert p(np.empty((0, 4))).shape == (0, 4)
