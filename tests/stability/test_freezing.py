"""F2-1D, small: windows of 5 s along the heat stored, and the order of the schemes."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.iteration import Iteration
from coupler.level import Scheme

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from cases import first
from coupled_run import couple
from freezing_halves import T_0, Freezing, freezing, leaving, share_solid

F2 = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))["F2_1D"]
ROD = Freezing()


def solve(scheme: Scheme, windows: int, substeps: int) -> tuple[float, float]:
    """Solid fraction at 20 s, and passes a window."""
    state = first(np.full(ROD.n + 1, T_0), np.zeros((1, 2)))
    state = replace(state, now=replace(state.now, f_s=np.zeros(ROD.n + 1)))
    end, tried = couple((freezing(ROD), leaving(ROD)), state, (20.0, windows), scheme, how=Iteration(),
                        substeps=(substeps, 1))
    assert end.now.f_s is not None
    return share_solid(end.now.f_s), sum(w.solved.work.thermal_solves for w in tried) / substeps / windows


def test_small_windows_give_the_page():
    assert solve(Scheme.EXTRAPOLATED, 200, 1)[0] == pytest.approx(F2["solid"][2], rel=1e-3)


@pytest.mark.parametrize("substeps", [4, 8, 20])
def test_along_the_heat_an_exchange_every_five_seconds_is_enough(substeps):
    solid, passes = solve(Scheme.ALONG_HEAT, 4, substeps)
    assert solid == pytest.approx(F2["solid"][2], rel=F2["every_5"]["tolerance"])
    assert passes <= F2["every_5"]["passes"]


def test_held_it_is_not():
    case = F2["frozen_gap"][1]
    assert solve(Scheme.STAGGERED, 4, 50)[0] == pytest.approx(case["solid"], rel=0.01)
