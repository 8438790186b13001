"""The trust row on heat that was delivered to a thermal half, against what it states as received."""

from __future__ import annotations

import pytest

from coupler.trust.checks import TrustVerdict
from coupler.trust.laws.delivered import checks, left_checks

HOLDS, NOTED, BROKEN, _ = TrustVerdict
FRICTION = {"heat.friction.slave": 30.0, "heat.friction.master": 70.0, "heat.stored.body": 100.0}


@pytest.mark.parametrize(("taken", "verdict"), [(1.0, HOLDS), (2.0, BROKEN), (0.0, BROKEN), (1.001, NOTED)])
def test_friction_heat_is_taken_once(taken: float, verdict: TrustVerdict) -> None:
    """Beside however much other heat: each body stores all that it takes, so the heat balance holds in every case."""
    for other in (0.0, 1e6):
        totals = {name: taken * heat for name, heat in FRICTION.items()} | {"heat.source": other}
        row, = checks({"contact.E_friction": 100.0}, totals)
        assert row.verdict is verdict
        assert row.number == pytest.approx(abs(taken - 1.0))


def test_heat_that_goes_to_and_fro_is_held_against_all_heat() -> None:
    """Heat of squeezing sums to next to nothing over a cycle: its round-off is no finding, half of it missing is."""
    totals = {"heat.mechanical": 1e-12, "heat.flux": 50.0, "heat.stored.body": 50.0}
    assert checks({"E_M": 3e-12}, totals)[0].verdict is HOLDS
    assert checks({"E_M": 20.0}, {**totals, "heat.mechanical": 10.0})[0].verdict is BROKEN


def test_the_worst_of_several_heats_is_told_with_its_terms() -> None:
    row, = checks({"E_M": 20.0, "E_S": -5.0, "contact.E_friction": 100.0},
                  {**FRICTION, "heat.mechanical": 20.0, "heat.entropy": 5.0})
    assert row.verdict is BROKEN
    assert "-5 J of entropy part delivered" in row.what
    assert "heat.entropy" in row.remedy


def test_nothing_is_said_where_nothing_was_delivered_or_no_terms_are_stated() -> None:
    assert checks({"E_M": 0.0}, FRICTION) == checks({"E_M": 5.0}, {"heat_moved": 3.0}) == ()


@pytest.mark.parametrize(("left", "verdict"),
                         [(0.0, HOLDS), (1.0, HOLDS), (10.0, NOTED), (-60.0, BROKEN), (90.0, BROKEN)])
def test_heat_that_is_left_over_at_the_end_is_told(left: float, verdict: TrustVerdict) -> None:
    """A block that stopped within a window of 10 ms had been handed 3.76 J of friction heat and made 2.16, exit 0."""
    row, = left_checks({"contact.E_friction": 100.0}, {"contact.E_friction": left}, {"heat.source": 100.0})
    assert row.verdict is verdict
    assert row.number == pytest.approx(max(abs(left) - 0.1, 0.0) / max(100.0, 100.0 + left))
    assert "handed" in row.what or verdict is HOLDS
    # Beside a furnace it is nothing.
    row, = left_checks({"contact.E_friction": 100.0}, {"contact.E_friction": left}, {"heat.source": 1e5})
    assert row.verdict is HOLDS


def test_heat_of_squeezing_that_is_left_over_is_held_against_all_heat() -> None:
    totals = {"heat.flux": 50.0, "heat.stored.body": 50.0}
    assert left_checks({"E_M": 1e-3}, {"E_M": 1e-2}, totals)[0].verdict is HOLDS
    assert left_checks({"E_M": 20.0}, {"E_M": 40.0}, totals)[0].verdict is BROKEN
    # Nor is there a row where none was made, however much other heat moves.
    assert left_checks({"E_M": 0.0}, {"E_M": 0.0}, totals) == ()
