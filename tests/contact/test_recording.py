"""What the half `replay` plays: straight lines between rows, energies of the time since the row before."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from contact.half.recording import Recording

T = np.array([0.0, 1.0, 3.0])
LINE = Recording(T, {"T": np.array([[300.0, 280.0], [310.0, 280.0], [350.0, 286.0]]),
                     "E_M": np.array([[9.0], [4.0], [10.0]])})


def test_between_rows_it_is_a_straight_line_and_at_rows_the_row_itself() -> None:
    assert LINE.at("T", 0.25) == pytest.approx([302.5, 280.0], rel=1e-15)
    assert LINE.at("T", 2.0) == pytest.approx([330.0, 283.0], rel=1e-15)
    for k, t in enumerate(T):
        assert (LINE.at("T", float(t)) == LINE.outputs["T"][k]).all()
    assert (LINE.at("T", 7.0) == LINE.outputs["T"][-1]).all()


def test_the_energy_of_steps_adds_up_whatever_their_sizes() -> None:
    """4 J in the first second, 10 J in the two after it; a first row belongs to no time."""
    assert LINE.energy("E_M", 0.0, 3.0) == pytest.approx([14.0], rel=1e-15)
    assert LINE.energy("E_M", 0.5, 1.5) == pytest.approx([2.0 + 2.5], rel=1e-15)
    ends = np.cumsum([0.0, 0.2, 0.7, 0.4, 1.3, 0.4])
    parts = [float(LINE.energy("E_M", a, b)[0]) for a, b in pairwise(ends)]
    assert sum(parts) == pytest.approx(14.0, rel=1e-14)
    assert LINE.energy("E_M", 3.0, 5.0) == 0.0


def test_how_coarse_it_is_of_a_parabola_is_the_error_of_its_lines() -> None:
    """Of t^2 lines between rows 0.5 s apart are 0.25 * 0.5^2 off in their middles."""
    t = np.arange(0.0, 2.1, 0.5)
    parabola = Recording(t, {"T": (t * t)[:, None]})
    off, at = parabola.coarseness("T")
    middles = t[:-1] + 0.25
    true = max(abs(float(parabola.at("T", m)[0]) - m * m) for m in middles)
    assert off == pytest.approx(true, rel=1e-12)
    assert true == pytest.approx(0.25 * 0.25)
    assert at in t
    assert Recording(t[:2], {"T": (t * t)[:2, None]}).coarseness("T") == (0.0, 0.0)
