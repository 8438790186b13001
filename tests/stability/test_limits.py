"""E4: limits found by bisection on the window are those of theory, to 2 %."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from coupler.scenario.options import Scheme

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from boundary import limit
from cases import CASES
from fake_halves import A_LAG, B_LAG

LIMITS = [("E4", Scheme.STAGGERED, 2 / (B_LAG - A_LAG)), ("E4", Scheme.PARALLEL, 1 / (B_LAG - A_LAG)),
          ("E4", Scheme.MECHANICAL_FIRST, 1 / (B_LAG / 2 - A_LAG)), ("E4 midpoint", Scheme.STAGGERED, 2 / B_LAG),
          ("E4 midpoint", Scheme.EXTRAPOLATED, 1 / B_LAG)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "scheme", "predicted"), LIMITS)
def test_of_the_lagged_gap(name, scheme, predicted):
    assert limit(CASES[name], scheme, predicted) == pytest.approx(predicted, rel=0.02)
