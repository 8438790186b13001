"""What crosses besides E_M: the entropy part, friction heat, the solid fraction; each once, whatever the substeps."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.control.loop import Plan, windows
from coupler.fmu.half import Block
from coupler.running.setup import accounts_of, what_is_missing
from coupler.scenario.options import Scheme, WindowRange
from coupler.schemes.accounts import EnergyAccount, Foreseen, delivered, share_of, with_made
from coupler.schemes.ledger import Ledger, imbalance
from coupler.schemes.levels import Level
from coupler.schemes.schedule import schedule
from coupler.schemes.state import CoupledState, wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
from fake_halves import FakeHalf

END = 8.0


def test_places_left_behind_are_paid_for_by_the_others():
    """A node that was handed 3 J ahead and no longer rubs cannot give them back; in all no more than 2 J are due.

    Two blocks of which both sides rub were warmed by 0.25 % more than was made.
    """
    account = EnergyAccount(np.array([5.0, -3.0, 0.0]))
    assert account.due(Foreseen(0.0)) == pytest.approx([2.0, 0.0, 0.0])
    paid = account.deliver(account.due(Foreseen(0.0)), None)
    assert paid.carry.sum() == 0.0
    assert not paid.due(Foreseen(0.0)).any()
    rubs = EnergyAccount(np.array([1.0, -3.0, 0.0]), power=np.array([2.0, 0.0, 2.0]))
    assert rubs.due(Foreseen(1.0)).sum() == pytest.approx(2.0)
    assert rubs.due(Foreseen(1.0))[1] == 0.0
    assert not EnergyAccount(np.array([1.0, -3.0])).due(Foreseen(0.0)).any()


SURFACE = Block("contact.E_friction", (2,), "J", "input", "Real")


def half(name: str, rule, *blocks: Block) -> FakeHalf:
    return FakeHalf(name, {b.name: b for b in blocks}, rule, np.zeros(2))


def melting() -> FakeHalf:
    """f_s = t/END; remembers what heat it was given in which substep."""

    def rule(state, inputs, t, h):
        given = {n: float(np.sum(inputs.get(n, 0.0))) for n in ("E_S", "contact.E_friction")}
        log.append((t, given))
        return state, {"T": np.array([300.0 + t + h]), "f_s": np.array([(t + h) / END]),
                       "heat.entropy": np.array(given["E_S"]),
                       "heat.friction.slave": np.array(given["contact.E_friction"])}

    log: list = []
    made = half("melting", rule, Block("T", (1,), "K", "output", "Real"), Block("f_s", (1,), "1", "output", "Real"),
                Block("x", (1, 2), "m", "input", "Real"), Block("E_S", (1,), "J", "input", "Real"), SURFACE)
    made.strings = {"log": log}
    return made


def rubbing(h_max: float = np.inf) -> FakeHalf:
    """Makes 3 J/s of entropy part and 2 J/s of friction heat on each of two nodes; remembers the f_s it sees."""

    def rule(state, inputs, t, h):
        seen.append((t + h, float(inputs["f_s"][0])))
        return state, {"x": np.zeros((1, 2)), "E_S": np.array([3.0 * h]), "contact.E_friction": np.full(2, 2.0 * h)}

    seen: list = []
    made = half("rubbing", rule, Block("T", (1,), "K", "input", "Real"), Block("f_s", (1,), "1", "input", "Real"),
                Block("x", (1, 2), "m", "output", "Real"), Block("E_S", (1,), "J", "output", "Real"),
                replace(SURFACE, causality="output"))
    made.strings, made.h_max = {"seen": seen}, h_max
    return made


def couple(thermal: FakeHalf, mechanical: FakeHalf, substeps: tuple[int, int], n: int = 4):
    now = Level(0.0, np.array([300.0]), np.zeros((1, 2)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(1))
    state = CoupledState(now, (), 0, accounts_of(mechanical, 1))
    plan = Plan(schedule(END, [WindowRange(END, END / n, END / n)], ()), Scheme.STAGGERED,
                {"thermal": substeps[0], "mechanical": substeps[1]})
    terms: list = []
    for tried in windows(wanted_outputs(thermal, mechanical), state, plan):
        if tried.accepted:
            state = tried.solved.state
            terms += tried.solved.terms
    return state, terms


@pytest.mark.parametrize(("substeps", "h_max"), [((1, 1), np.inf), ((3, 2), np.inf), ((2, 1), 1.5)])
def test_every_joule_crosses_once(substeps, h_max):
    state, terms = couple(melting(), rubbing(h_max), substeps)
    for name, term, rate in (("E_S", "heat.entropy", 3.0), ("contact.E_friction", "heat.friction.slave", 4.0)):
        account = state.accounts[name]
        assert account.made == pytest.approx(rate * END, rel=1e-13)
        assert account.made == pytest.approx(account.delivered + account.carry.sum(), rel=1e-13)
        assert sum(t[term] for t in terms) == pytest.approx(account.delivered, rel=1e-13)
        assert account.delivered > 0


def handed_over(scheme: Scheme, n: int, power=lambda t: 1.0 + t * t, kinks=()) -> tuple[np.ndarray, CoupledState]:
    """Friction heat handed to the thermal half in each of n windows, made at a power of so much [W]; and the end."""
    def rule(state, inputs, t, h):
        made = np.full(2, h * (power(t) + 4.0 * power(t + 0.5 * h) + power(t + h)) / 6.0)
        return state, {"x": np.zeros((1, 2)), "E_S": np.zeros(1), "contact.E_friction": made}

    thermal, mechanical = melting(), replace(rubbing(), rule=rule)
    now = Level(0.0, np.array([300.0]), np.zeros((1, 2)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(1))
    plan = Plan(schedule(END, [WindowRange(END, END / n, END / n)], kinks), scheme,
                {"thermal": 1, "mechanical": 1})
    *_, last = windows(wanted_outputs(thermal, mechanical), CoupledState(now, (), 0, accounts_of(mechanical, 1)), plan)
    return np.array([given["contact.E_friction"] for _, given in thermal.strings["log"]]), last.solved.state


@pytest.mark.parametrize(("scheme", "order"), [(Scheme.STAGGERED, 1.0), (Scheme.EXTRAPOLATED, 2.0)])
def test_friction_heat_that_is_extrapolated_is_late_by_second_order(scheme, order):
    late = []
    for n in (16, 32, 64):
        handed, end = handed_over(scheme, n)
        account = end.accounts["contact.E_friction"]
        assert account.made == pytest.approx(account.delivered + account.carry.sum(), rel=1e-13)
        assert handed.sum() == pytest.approx(account.delivered, rel=1e-13)
        late.append(abs(account.carry.sum()))
    assert np.log2(late[1] / late[2]) == pytest.approx(order, abs=0.1)


def test_friction_that_stops_takes_no_heat_back():
    """What was handed over ahead is missing in the windows after, but none is below 0; across a kink none is ahead."""
    handed, end = handed_over(Scheme.EXTRAPOLATED, 16, lambda t: float(t < 0.5 * END))
    assert handed.min() == 0.0
    account = end.accounts["contact.E_friction"]
    assert account.delivered >= account.made
    assert abs(account.carry.sum()) <= account.made / 8.0 * (1.0 + 1e-9)
    steady = handed_over(Scheme.EXTRAPOLATED, 16, lambda t: 1.0, kinks=(0.5 * END,))[0]
    assert steady[[0, 1, 2, 7, 8, 9]] == pytest.approx([0.0, 2.0, 1.0, 1.0, 0.0, 2.0], abs=1e-12)


@pytest.mark.parametrize("fresh", [False, True])
def test_what_belonged_to_later_times_is_settled_where_friction_ends(fresh):
    """What the trapezoidal rule says was made; 0.107 of 3510 J stayed for ever, delivered and never made."""
    account = EnergyAccount(np.array([-0.1, 0.02]), made=10.0, delivered=10.08, power=np.ones(2),
                            late=np.array([-0.1, 0.02]), at_end=True)
    ended = account.make(np.zeros(2) if not fresh else np.ones(2), 1.0, 1.0, fresh)
    assert ended.carry == pytest.approx([float(fresh), float(fresh)], abs=1e-15)
    assert ended.late is None
    assert ended.made == pytest.approx(10.08 + 2.0 * fresh)
    # What is handed over with all the rest is not kept back, so nothing is settled again.
    paid = delivered({"E": account}, {"E": account.carry}, ["E"], ahead=None)["E"].make(np.ones(2), 1.0, 1.0, True)
    assert paid.carry == pytest.approx([1.0, 1.0])
    assert paid.made == pytest.approx(12.0)


@pytest.mark.parametrize(("p", "v", "p_end", "v_end"), [
    (2.0, 3.0, 5.0, 3.0), (2.0, 3.0, 2.0, 7.0), (0.0, 0.0, 4.0, 3.0), (4.0, 3.0, 0.0, 0.0), (2.0, 0.0, 2.0, 3.0)])
def test_only_power_that_pressure_makes_belongs_to_later_times(p, v, p_end, v_end):
    """By the pressure at the end of a step of 0.5 s, its heat is (p' - p) v/2 times the step too large.

    Where slip is faster at the same pressure it is right as it stands: a bar that slid as it grew had 7 % too little.
    A second node rubs on as it did.
    """
    account = EnergyAccount(np.zeros(2), power=np.array([p * v, 1.0]), at_end=True)
    told = with_made({"E": account}, {"E": 0.5 * np.array([p_end * v_end, 1.0])}, (1.0, 1.5), False,
                     (np.array([p, 1.0]), np.array([p_end, 1.0])))["E"]
    assert told.late == pytest.approx([0.25 * (p_end - p) * max(v, v_end) if p != p_end else 0.0, 0.0])


def test_the_entropy_part_comes_at_the_start_and_friction_evenly():
    thermal = melting()
    couple(thermal, rubbing(), (4, 1))
    second = [given for t, given in thermal.strings["log"] if 2.0 <= t < 4.0]
    assert [g["E_S"] for g in second] == pytest.approx([6.0, 0, 0, 0])
    assert [g["contact.E_friction"] for g in second] == pytest.approx([2.0, 2.0, 2.0, 2.0])


def test_the_solid_fraction_is_interpolated_to_the_ends_of_mechanical_substeps():
    mechanical = rubbing()
    couple(melting(), mechanical, (1, 2))
    assert [f for _, f in mechanical.strings["seen"]] == pytest.approx([t / END for t, _ in mechanical.strings["seen"]])
    assert len(mechanical.strings["seen"]) == 8


def test_f_s_is_asked_for_wherever_something_melts():
    """Probes show it, also where the mechanical half does not take it."""
    mechanical = rubbing()
    rigid = replace(mechanical, blocks={n: b for n, b in mechanical.blocks.items() if n != "f_s"})
    for half in (mechanical, rigid):
        assert "f_s" in wanted_outputs(melting(), half).thermal_outputs
    dry = replace(melting(), blocks={n: b for n, b in melting().blocks.items() if n != "f_s"})
    assert "f_s" not in wanted_outputs(dry, mechanical).thermal_outputs


def test_accounts_are_opened_for_what_is_made():
    assert {n: a.carry.shape for n, a in accounts_of(rubbing(), 7).items()} == {
        "E_M": (7,), "E_S": (1,), "contact.E_friction": (2,)}
    assert list(accounts_of(melting(), 7)) == ["E_M"]


def test_a_share_of_nothing_is_nothing():
    given = share_of({"E_S": np.array([5.0]), "E_M": np.array([5.0])}, 0.25, False)
    assert {n: v.tolist() for n, v in given.items()} == {"E_S": [0.0], "E_M": [1.25]}


def test_round_off_of_what_bodies_hold_is_no_imbalance():
    """A body at rest takes up round-off: all of it, of heat that moved nothing, is not accounted for."""
    at_rest = {"heat.stored.a": 7e-12, "heat_moved": 1e-7, "heat_rounding": 1e-9}
    assert imbalance(at_rest) == 0.0
    assert imbalance(at_rest | {"heat_rounding": 0.0}) == pytest.approx(7e-5)
    warmed = {"heat.stored.a": 1.0, "heat.flux": 1.1, "heat_moved": 1.0, "heat_rounding": 1e-9}
    assert imbalance(warmed) == pytest.approx(0.1 / 2.1, rel=1e-8)
    ledger = Ledger().plus(at_rest).plus(at_rest)
    assert ledger.everything["heat_rounding"] == 2e-9
    assert set(ledger.terms) == {"heat.stored.a"}


def test_heat_that_is_not_taken_is_told():
    thermal = melting()
    deaf = replace(thermal, blocks={n: b for n, b in thermal.blocks.items() if not n.startswith("contact")})
    told = what_is_missing(deaf, rubbing(), touches=False)
    assert told == ["melting takes no contact.E_friction: the heat rubbing makes is counted but not delivered"]
