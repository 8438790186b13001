"""What a run records of a half is read in one message."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from coupler import HalfError, Results, load_scenario, run
from coupler.fmu.metered import MeteredHalf
from coupler.record.look import Look, together

SCENARIO = Path(__file__).parents[2] / "scenarios/casting_1d.yaml"


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


def test_all_that_is_wanted_is_read_at_once(halves) -> None:
    look = Look(halves, together({"thermal": ["q", "heat.in"]}, {"thermal": ["q"], "mechanical": ["sigma"]}))
    assert look.read("thermal", ["q"])["q"] == 1.0
    assert look.read("thermal", ["heat.in", "q"])["heat.in"] == 7.0
    assert halves["thermal"].asked == [("q", "heat.in")]
    assert halves["mechanical"].asked == [("sigma",)]


def test_what_nobody_announced_is_read_once_when_it_is_asked_for(halves) -> None:
    look = Look(halves, {"thermal": ["q"]})
    for _ in range(2):
        assert list(look.read("thermal", ["late", "q"])) == ["late", "q"]
    assert halves["thermal"].asked == [("q",), ("late",)]


def test_nothing_wanted_is_no_message(halves) -> None:
    assert Look(halves, {"thermal": []}).read("thermal", []) == {}
    assert halves["thermal"].asked == []


def test_a_value_that_is_no_number_ends_nothing(halves) -> None:
    assert np.isnan(Look(halves, {}).read("mechanical", ["hole"])["hole"]).all()


@pytest.mark.parametrize("lost", ["contact.covered", "condition.heat.pair.interface"])
def test_of_a_window_that_could_not_be_read_nothing_is_recorded(tmp_path, monkeypatch, lost) -> None:
    """A half that is lost while a frame or a window is read: what is recorded ends where the run goes on from."""
    plain, asked, out = MeteredHalf.read, [], tmp_path / "run.h5"

    def read(self, names, finite=True):
        asked.extend(n for n in names if n == lost)
        if len(asked) > 2:
            raise HalfError("is gone", half=self.name)
        return plain(self, names, finite)

    monkeypatch.setattr(MeteredHalf, "read", read)
    with pytest.raises(HalfError) as died:
        run(load_scenario(SCENARIO, {"coupling.end": 0.3, "output.checkpoint": 0}), out)
    ended = Results(out)
    assert len(ended.t) > 1
    assert died.value.__notes__[-1] == f"`slideline resume {out}` goes on from t = {ended.t[-1]:.9g} s"
