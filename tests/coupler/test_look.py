"""What a run records of a half is read in one message."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from coupler.record.look import Look, together


class Telling:
    """A half that gives out its names' lengths, and keeps what it was asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, ...]] = []

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, np.ndarray]:
        self.asked.append(tuple(names))
        return {n: np.array([np.nan if n == "hole" else float(len(n))]) for n in names}


@pytest.fixture
def halves() -> dict[str, Telling]:
    return {"thermal": Telling(), "mechanical": Telling()}


def test_all_that_is_wanted_is_read_at_the_first_question(halves) -> None:
    look = Look(halves, together({"thermal": ["q", "heat.in"]}, {"thermal": ["q"], "mechanical": ["sigma"]}))
    assert look.read("thermal", ["q"])["q"] == 1.0
    assert look.read("thermal", ["heat.in", "q"])["heat.in"] == 7.0
    assert [sorted(names) for names in halves["thermal"].asked] == [["heat.in", "q"]]
    assert halves["mechanical"].asked == []


def test_what_nobody_announced_is_read_when_it_is_asked_for(halves) -> None:
    look = Look(halves, {"thermal": ["q"]})
    assert list(look.read("thermal", ["late"])) == ["late"]
    assert list(look.read("thermal", ["q"])) == ["q"]
    assert halves["thermal"].asked == [("late", "q")]
    look.read("thermal", ["later"])
    assert halves["thermal"].asked[1:] == [("later",)]


def test_nothing_wanted_is_no_message(halves) -> None:
    assert Look(halves, {"thermal": ["q"]}).read("thermal", []) == {}
    assert halves["thermal"].asked == []


def test_a_value_that_is_no_number_ends_nothing(halves) -> None:
    assert np.isnan(Look(halves, {}).read("mechanical", ["hole"])["hole"]).all()
