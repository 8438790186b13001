"""Windows, schemes, account and control on two tiny halves with a known answer (cases E4 and E8)."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.control.loop import Plan, windows
from coupler.errors import CouplingError
from coupler.running.setup import what_is_missing, without_checkpoints
from coupler.scenario.options import Scheme, WindowRange
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.ledger import Ledger
from coupler.schemes.levels import Level
from coupler.schemes.schedule import schedule
from coupler.schemes.state import CoupledState, Verdict, wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
from fake_halves import gap_of, lumped, shrinking

EXACT_E8 = 831.7186022526  # verification.md E8: case E4 from 840 K to 20 s
END = 20.0


def couple(n: int, scheme: Scheme, thermal=None, mechanical=None, substeps=(1, 1), kinks=(), bends=(), end=END):
    thermal, mechanical = thermal or lumped(840.0), mechanical or shrinking(840.0)
    x = np.array([[0.0, gap_of(840.0)]])
    state = CoupledState(Level(0.0, np.array([840.0]), x, np.zeros(0), np.zeros(0), np.zeros(0)), (), 0,
                         {"E_M": EnergyAccount(np.zeros(1))})
    plan = Plan(schedule(end, [WindowRange(end, end / n, end / n)], kinks, bends), scheme,
                {"thermal": substeps[0], "mechanical": substeps[1]})
    tried, ledger = [], Ledger()
    for w in windows(wanted_outputs(thermal, mechanical), state, plan):
        tried.append(w)
        if w.accepted:
            state = w.solved.state
            for terms in w.solved.terms:
                ledger = ledger.plus(terms)
    return state, tried, ledger


def error(n: int, scheme: Scheme, **how) -> float:
    return abs(float(couple(n, scheme, **how)[0].now.T[0]) - EXACT_E8)


@pytest.mark.few("midpoint")
@pytest.mark.parametrize("method", ["midpoint", "backward_euler"])
def test_staggered_is_first_order_whatever_the_half(method):
    coarse, fine = (error(n, Scheme.STAGGERED, thermal=lumped(840.0, method)) for n in (160, 320))
    assert np.log2(coarse / fine) == pytest.approx(0.98, abs=0.03)
    assert fine < 0.05


def test_extrapolated_is_second_order_at_one_solve_a_half():
    coarse, fine = (error(n, Scheme.EXTRAPOLATED) for n in (160, 320))
    assert np.log2(coarse / fine) == pytest.approx(2.01, abs=0.05)
    assert fine < 1e-3


@pytest.mark.few("substeps0", "substeps2")
@pytest.mark.parametrize("substeps", [(3, 1), (1, 4), (2, 3)])
def test_substeps_of_either_half_keep_the_order(substeps):
    coarse, fine = (error(n, Scheme.EXTRAPOLATED, substeps=substeps) for n in (160, 320))
    assert np.log2(coarse / fine) > 1.8
    assert fine < 1e-3


def test_lagged_gap_cycles_beyond_its_limit_as_predicted():
    """E4: backward Euler cycles 814.312 / 840.020 at 1.2 dt_c, dt_c = 10.2449 s."""
    _, tried, _ = couple(200, Scheme.STAGGERED, thermal=lumped(840.0, "backward_euler"), end=1.2 * 10.2449 * 200)
    last = sorted(float(w.solved.state.now.T[0]) for w in tried[-2:])
    assert last == pytest.approx([814.312, 840.020], abs=2e-3)


def test_discard_of_either_half_puts_both_back_and_halves_the_window():
    plain = couple(40, Scheme.STAGGERED)[0].now.T
    for thermal, mechanical, verdict in [(lumped(840.0, h_max=0.6), shrinking(840.0), Verdict.THERMAL_DISCARD),
                                         (lumped(840.0), shrinking(840.0, h_max=0.6), Verdict.MECHANICAL_DISCARD)]:
        state, tried, _ = couple(20, Scheme.STAGGERED, thermal=thermal, mechanical=mechanical)
        assert [w.solved.verdict for w in tried[:3]] == [verdict, Verdict.ACCEPTED, Verdict.ACCEPTED]
        assert sum(w.accepted for w in tried) == 40
        np.testing.assert_allclose(state.now.T, plain, rtol=1e-14)


def test_a_window_that_never_works_is_one_error_with_time_and_remedy():
    with pytest.raises(CouplingError, match=r"window 1 at t = 0 s.*halved 10 times.*coupling\.windows"):
        couple(20, Scheme.STAGGERED, thermal=lumped(840.0, h_max=1e-9))


def test_a_half_without_states_cannot_be_tried_again():
    with pytest.raises(CouplingError, match="keeps no states"):
        couple(20, Scheme.STAGGERED, mechanical=replace(shrinking(840.0, h_max=1e-9), can_save=False))


def test_mechanical_heat_is_delivered_once_whatever_substeps_and_rejections():
    for substeps, h_max in [((1, 1), np.inf), ((3, 2), np.inf), ((1, 5), 0.6), ((2, 1), 0.3)]:
        state, _, ledger = couple(20, Scheme.STAGGERED, thermal=lumped(840.0, h_max=h_max),
                                  mechanical=shrinking(840.0, heat=1e4), substeps=substeps)
        account = state.accounts["E_M"]
        assert account.made == pytest.approx(1e4 * END, rel=1e-13)
        assert account.made == pytest.approx(account.delivered + account.carry.sum(), rel=1e-13)
        assert ledger.terms["heat.mechanical"] == pytest.approx(account.delivered, rel=1e-12)
        assert account.carry.sum() == pytest.approx(1e4 * (END / 20 if h_max == np.inf else h_max_window(h_max)))
        assert ledger.imbalance < 1e-12


def h_max_window(h_max: float) -> float:
    """The size a window of 1 s is cut to so that the thermal substep fits."""
    return {0.6: 0.5, 0.3: 0.5}[h_max]


def test_only_blocks_that_changed_are_sent():
    still = lumped(840.0)
    couple(20, Scheme.STAGGERED, thermal=still)
    assert still.calls[0][2] == {"x", "E_M"}
    assert all(sent == {"x"} for _, _, sent in still.calls[1:])


def test_the_window_after_a_kink_starts_without_a_slope():
    state, tried, _ = couple(20, Scheme.EXTRAPOLATED, kinks=(7.3,))
    ends = [w.t + w.H for w in tried]
    assert 7.3 in ends
    assert state.events == 1


def test_a_bend_of_thermal_data_ends_a_window_and_damps_nothing():
    schedule_ = schedule(END, [WindowRange(END, 1.0, 1.0)], (7.3, 9.1), bends={7.3})
    assert {schedule_.clock.seconds(k) for k in schedule_.kinks} == {7.3, 9.1}
    assert {schedule_.clock.seconds(k) for k in schedule_.events} == {9.1}
    state, tried, _ = couple(20, Scheme.EXTRAPOLATED, kinks=(7.3, 9.1), bends={7.3})
    assert {7.3, 9.1} <= {w.t + w.H for w in tried}
    assert state.events == 1


def test_heat_that_nobody_takes_stays_in_the_account():
    deaf = lumped(840.0)
    deaf.blocks = {n: b for n, b in deaf.blocks.items() if n != "E_M"}
    state, _, _ = couple(20, Scheme.STAGGERED, thermal=deaf, mechanical=shrinking(840.0, heat=1e4))
    assert state.accounts["E_M"].delivered == 0.0
    assert state.accounts["E_M"].carry.sum() == pytest.approx(1e4 * END)


def test_what_a_half_lacks_is_named_with_its_cost():
    thermal, mechanical = lumped(840.0), shrinking(840.0)
    assert what_is_missing(thermal, mechanical, touches=False) == []
    told = what_is_missing(replace(thermal, can_save=False), mechanical, touches=True)
    assert [n.split(":")[0] for n in told] == [
        "lumped cannot save its state", "shrinking gives no contact.t_N", "shrinking gives no contact.gap"]
    deaf = replace(thermal, blocks={n: b for n, b in thermal.blocks.items() if n != "E_M"})
    assert what_is_missing(deaf, mechanical, touches=False) == [
        "lumped takes no E_M: the heat shrinking makes is counted but not delivered"]
    silent = replace(mechanical, blocks={n: b for n, b in mechanical.blocks.items() if n != "E_M"})
    assert what_is_missing(thermal, silent, touches=False) == []
    thermal.can_serialise, mechanical.can_serialise = True, False
    both = {"thermal": thermal, "mechanical": mechanical}
    (told,) = without_checkpoints(both, 30.0)
    assert told.startswith("shrinking cannot write its state down")
    assert without_checkpoints(both, None) == []
