"""Clock and schedule: integer ticks, windows that end at kinks."""

from __future__ import annotations

import numpy as np
import pytest

from coupler.scenario.options import WindowRange
from coupler.schemes.schedule import TICKS, clock_with_marks, geometric_sizes, schedule


def test_marked_times_come_back_exactly():
    clock = clock_with_marks(25000.0, [2500.1, 14772.727272727272])
    for t in (2500.1, 14772.727272727272, 25000.0):
        assert clock.seconds(clock.ticks(t)) == t
    assert clock.ticks(25000.0) == TICKS


def test_sizes_are_geometric_and_add_up():
    sizes = np.array(geometric_sizes(1000.0, 5.0, 100.0))
    assert sizes.sum() == pytest.approx(1000.0, rel=1e-14)
    np.testing.assert_allclose(sizes[1:] / sizes[:-1], sizes[1] / sizes[0], rtol=1e-12)
    assert sizes[0] == pytest.approx(5.0, rel=0.05)
    assert sizes[-1] == pytest.approx(100.0, rel=0.05)
    assert len(geometric_sizes(10.0, 2.5, 2.5)) == 4


def test_windows_end_at_every_kink_and_range():
    kinks = [0.0, 7.7, 40.0, 66.6, 100.0, 200.0]
    s = schedule(100.0, [WindowRange(40.0, 3.0, 3.0), WindowRange(100.0, 1.0, 20.0)], kinks)
    ends = [s.clock.seconds(k) for k in s.bounds]
    assert ends[0] == 0.0
    assert ends[-1] == 100.0
    assert all(t in ends for t in (7.7, 40.0, 66.6))
    assert {s.clock.seconds(k) for k in s.kinks} == {7.7, 40.0, 66.6}
    sizes = np.diff(ends)
    assert sizes.min() > 0
    after = sizes[np.searchsorted(ends, 66.6)]
    assert after == pytest.approx(1 + 19 * 26.6 / 60, rel=0.3)  # the size goes on growing across the kink


@pytest.mark.parametrize(("ranges", "message"), [
    ([], "reach the end"), ([WindowRange(50.0, 1, 1)], "reach the end"),
    ([WindowRange(50.0, 1, 1), WindowRange(40.0, 1, 1), WindowRange(100.0, 1, 1)], "before it ends"),
])
def test_windows_that_do_not_cover_the_run_are_refused(ranges, message):
    with pytest.raises(ValueError, match=message):
        schedule(100.0, ranges, [])
