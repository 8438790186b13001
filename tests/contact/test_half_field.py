"""Fields: sums of products of a signal and two profiles."""

from __future__ import annotations

import numpy as np
import pytest

from contact.half.functions import Field, field_from, resolve, signal_from

RAMP = {"t": [0.0, 10.0], "value": [2.0, 4.0]}
JUMP = {"t": [0.0, 5.0, 5.0, 10.0], "value": [1.0, 1.0, 3.0, 3.0]}
PLACES = np.array([[0.0, 0.0], [0.5, 2.0], [1.0, -1.0], [3.0, 0.25]])


def test_a_sum_of_products():
    field = field_from({"terms": [{"t": RAMP, "x": {"polynomial": [1.0, 2.0, -1.0]}},
                                  {"y": {"at": [0.0, 2.0], "value": [10.0, 30.0]}},
                                  {"t": JUMP, "x": {"at": [0.0, 1.0], "value": [0.0, 1.0]},
                                   "y": {"polynomial": [0, 1]}}]})
    x, y = PLACES.T
    for t, side, jump in ((2.0, 1, 1.0), (5.0, -1, 1.0), (5.0, 1, 3.0)):
        expected = ((2.0 + 0.2 * t) * (1.0 + 2.0 * x - x**2) + 10.0 + 10.0 * np.clip(y, 0.0, 2.0)
                    + jump * np.clip(x, 0.0, 1.0) * y)
        assert np.abs(field.at(PLACES, t, side) - expected).max() < 1e-13
        assert np.array_equal(resolve(field.level(t, side), field.shapes(PLACES)), field.at(PLACES, t, side))
    assert not field.is_uniform
    assert [s.t.size for s in field.signals] == [2, 1, 4]


@pytest.mark.parametrize("spec", [7.0, RAMP, JUMP, {"terms": [{"t": JUMP}]}])
def test_a_uniform_field_is_its_signal_to_the_bit(spec):
    field = field_from(spec)
    signal = signal_from(spec["terms"][0]["t"] if isinstance(spec, dict) and "terms" in spec else spec)
    assert field.is_uniform
    assert field.shapes(PLACES) is None
    for t in (-1.0, 0.3, 5.0, 11.0):
        for side in (-1, 1):
            assert field.level(t, side) == signal.at(t, side)
            assert field.at(PLACES, t, side).tolist() == [signal.at(t, side)] * 4


def test_terms_without_profiles_add_up_to_a_number():
    field = field_from({"terms": [{"t": RAMP}, {"t": JUMP}, {}]})
    assert field.level(5.0, -1) == 3.0 + 1.0 + 1.0
    assert field.is_uniform


@pytest.mark.parametrize(("spec", "least"), [
    (3.0, 3.0), (JUMP, 1.0), ({"t": [0, 1, 1, 2], "value": [1, 5, -2, 0]}, -2.0),
    ({"terms": [{"t": RAMP}, {"t": {"t": [0, 10], "value": [0, -9]}}]}, -5.0),
    ({"terms": [{"t": RAMP, "x": {"at": [0, 1], "value": [-1, 2]}}]}, -4.0),
    ({"terms": [{"t": RAMP, "x": {"at": [0, 1], "value": [-1, 2]}, "y": {"at": [0, 1], "value": [-3, 1]}}]}, -24.0),
    ({"terms": [{"x": {"polynomial": [2.0]}}]}, 2.0), ({"terms": [{"x": {"polynomial": [2.0, 1.0]}}]}, None),
    ({"terms": [{"x": {"at": [0, 1], "value": [1, 2]}}, {}]}, None)])
def test_the_least_value_where_it_is_known(spec, least):
    assert field_from(spec).least == least


def test_zero_is_known():
    assert field_from(0.0).is_zero
    assert not field_from({"terms": [{"t": 0.0}, {"t": JUMP}]}).is_zero
    assert isinstance(field_from(1), Field)


@pytest.mark.parametrize(("spec", "message"), [
    ({"terms": []}, "one term or more"),
    ({"terms": [{}], "t": 1.0}, "nothing else"),
    ({"terms": [{"z": 1.0}]}, r"terms\[0\]: an object with t, x, y"),
    ({"terms": [{}, {"x": {"at": [1.0, 0.0], "value": [1.0, 2.0]}}]}, r"terms\[1\]: the places `at` of a profile must "
                                                                      r"increase, not \[1.0, 0.0\]"),
    ({"terms": [{"x": {"at": [0.0, 1.0], "value": [1.0]}}]}, "as many values as places"),
    ({"terms": [{"x": {"at": [0.0, 1.0]}}]}, "a profile is"),
    ({"terms": [{"x": 3.0}]}, "a profile is"),
    ({"terms": [{"y": {"polynomial": []}}]}, "one or more finite numbers"),
    ({"terms": [{"y": {"polynomial": [float("nan")]}}]}, "finite"),
    ({"terms": [{"t": {"t": [1, 0], "value": [1, 2]}}]}, r"terms\[0\]: the times of a signal must not decrease")])
def test_what_is_no_field(spec, message):
    with pytest.raises(ValueError, match=message):
        field_from(spec)
