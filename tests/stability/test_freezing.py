"""F2-1D, small: windows of 5 s along the heat stored, and the order of the schemes."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.scenario.options import Iteration, Scheme, Tolerance, Tolerances

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from cases import first
from coupled_run import couple
from freezing_halves import T_0, Freezing, freezing, gap_of, leaving, share_solid

F2 = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))["F2_1D"]
ROD = Freezing()
SHARP = Iteration(max_iterations=60, tolerance=Tolerances(
    temperature=Tolerance(atol=1e-9, rtol=1e-9), gap=Tolerance(atol=1e-14, rtol=1e-9),
    pressure=Tolerance(atol=1.0, rtol=1.0), solid_fraction=Tolerance(atol=1e-9, rtol=1e-9)))


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


def cooling(scheme: Scheme, windows: int) -> float:
    """The gap [um] after 30 s of a rod that is all solid and cools evenly, from a state 10 s on its way."""
    rod = Freezing(20)
    T = 880.0 - 40.0 * np.linspace(0.0, 1.0, rod.n + 1) ** 2
    state = first(T, np.array([[0.0, 1e-9]]))
    state = replace(state, now=replace(state.now, x=np.array([[0.0, gap_of(T, np.ones(rod.n + 1))]]),
                                       f_s=np.ones(rod.n + 1)))
    halves = freezing(rod), leaving(rod)
    halves[0].state = np.append(T, 1.0)
    on, _ = couple(halves, state, (10.0, 40), Scheme.ITERATED, how=SHARP)
    past = tuple(replace(p, t=p.t - 10.0) for p in on.past)
    on = replace(on, now=replace(on.now, t=0.0), past=past, sent={}, events=0)
    end, _ = couple(halves, on, (30.0, windows), scheme, how=SHARP)
    return 1e6 * float(end.now.x[0, 1])


@pytest.mark.few("Scheme.ALONG_HEAT-2.0")
@pytest.mark.parametrize(("scheme", "order"), [
    (Scheme.STAGGERED, 1.0), (Scheme.EXTRAPOLATED, 2.0), (Scheme.ALONG_HEAT, 2.0), (Scheme.ITERATED, 2.0)])
def test_order_in_the_gap_where_nothing_freezes_any_more(scheme, order):
    """sdirk2 shows 1.4 in the temperature of the tip itself, by any scheme: what is exchanged varies in its stages."""
    coarse, middle, fine = (cooling(scheme, n) for n in (24, 48, 96))
    assert np.log2(abs(middle - coarse) / abs(fine - middle)) == pytest.approx(order, abs=0.05)
    assert abs(fine - middle) < (5e-2 if order == 1.0 else 2e-4)
