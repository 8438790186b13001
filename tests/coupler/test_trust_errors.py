"""The estimated error of the probes, from the windows that were looked at."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coupler.record.observe import ProbeReader
from coupler.trust import errors
from coupler.trust.errors import ErrorLog, Looked

K = {"a": "K", "b": "K"}


def log_of(rows: list[tuple[list[float], list[float], list[float]]]) -> ErrorLog:
    """rows : values, second differences and errors (or nothing) of each window."""
    log = errors.begun(np.zeros(len(rows[0][0])))
    for k, (values, second, error) in enumerate(rows):
        log = errors.watched(log, Looked(np.array(values), np.array(second), np.array(error), solves=4), k + 1.0)
    return log


def test_windows_not_looked_at_have_the_ratio_of_those_that_were():
    log = log_of([([10.0], [1.0], []), ([20.0], [1.1], [0.11]), ([30.0], [1.3], []), ([40.0], [1.2], [0.12])])
    assert errors.estimated(log) == pytest.approx([0.46])
    assert errors.table(log, {"a": "K"}) == {"a": errors.ProbeError(pytest.approx(0.46), 40.0, "K")}
    assert errors.check(log, {"a": "K"}, False).number == pytest.approx(0.0115)


def test_the_window_in_which_a_body_touches_tells_nothing_of_those_in_which_it_slides():
    calm = [([1.0], [0.02], [])] * 50
    log = log_of([([1.0], [0.02], [0.001]), ([50.0], [40.0], [16.0]), *calm])
    assert errors.estimated(log) == pytest.approx([16.001 + 50 * 0.001])


def test_an_error_larger_than_its_bend_is_a_jump_inside_and_is_not_carried_on():
    log = log_of([([1.0], [0.1], [5.0]), ([1.0], [0.1], [])])
    assert errors.estimated(log) == pytest.approx([5.0 + errors.MOST * 0.1])


def test_a_probe_that_hardly_moves_is_held_against_the_others():
    log = log_of([([100.0, 0.1], [0.0, 0.0], [1.0, 0.05])])
    assert errors.scales(log, list(K.values())) == pytest.approx([100.0, 1.0])
    check = errors.check(log, K, False)
    assert check.number == pytest.approx(0.05)
    assert check.verdict == "holds"


@pytest.mark.parametrize(("error", "verdict"), [(5.0, "holds"), (20.0, "noted"), (60.0, "broken")])
def test_verdicts(error, verdict):
    check = errors.check(log_of([([100.0], [50.0], [error])]), {"a": "K"}, False)
    assert check.verdict == verdict
    if verdict != "holds":
        assert f"a may be off by {error:.3g} % of its range ({error:.3g} K)" in check.sentence
        assert check.t == 1.0


def test_where_nothing_was_looked_at_nothing_is_said():
    log = log_of([([1.0], [1.0], [])])
    assert errors.check(log, {"a": "K"}, False).verdict == "not checked"
    assert errors.table(log, {"a": "K"}) == {}


class Told(ProbeReader):
    """Probes of a scene with one pair that looks 6 mm far, whose values are given."""

    def __init__(self, quantities: list[str], values: list[float]) -> None:
        self._probes: Any = {f"{k}": SimpleNamespace(quantity=q) for k, q in enumerate(quantities)}
        self._interface: Any = SimpleNamespace(pairs=[SimpleNamespace(gap_max=0.006)])
        self._values = np.array(values)

    def values(self, level: Any) -> Any:
        return self._values


def test_a_gap_of_a_node_that_faces_nothing_tells_of_no_error():
    """Its gap is told as gap_max, whole, and may be anything in the same window solved as two."""
    none: Any = None
    np.testing.assert_array_equal(Told(["gap", "gap", "u_x"], [0.006, 0.0012, 0.006]).measurable(none),
                                  [np.nan, 0.0012, 0.006])
