"""What a run shows: no nonsense numbers, no guess before it can be made, lines spread over the work."""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from coupler.cli.console import SETTING_UP, ProgressLine, summary
from coupler.running.progress import Progress

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import write_run

FIRST = Progress(t=1.0, t_end=1000.0, number=1, total=200, verdict="accepted", message="", touching=0, max_T=373.15,
                 max_p=-0.0, imbalance=1e-14, elapsed=30.0, remaining=6000.0)


def shown(width: int = 100, terminal: bool = False) -> tuple[ProgressLine, io.StringIO]:
    file = io.StringIO()
    return ProgressLine("degC", Console(file=file, width=width, force_terminal=terminal, highlight=False)), file


def test_a_line_has_no_minus_zero_and_no_guess_from_the_first_window() -> None:
    line, _ = shown()
    text = line.line(FIRST)
    assert "max p 0 MPa" in text
    assert "max T 100.0 degC" in text
    assert "left" not in text
    assert line.line(replace(FIRST, number=20, remaining=65.0)).endswith("1:05 min to go")


def test_lines_come_by_windows_and_the_last_is_told() -> None:
    line, file = shown()
    with line:
        for n in range(1, 201):  # all but the last windows lie in the first second
            line(replace(FIRST, number=n, t=1000.0 if n == 200 else n / 200))
    assert 10 <= file.getvalue().count("| window") <= 12


def test_the_line_goes_on_telling_what_windows_broke() -> None:
    file = io.StringIO()
    with ProgressLine("degC", Console(file=file, width=300), verbose=True) as line:
        line(FIRST)
        line(replace(FIRST, number=2, t=300.0, anyway=True))
        line(replace(FIRST, number=3, t=600.0))
        line(replace(FIRST, number=4, t=800.0, anyway=True))
    told = [text.partition(" | trust so far: ")[2] for text in file.getvalue().splitlines() if "| window" in text]
    assert [text.partition(" not")[0] for text in told] == ["", "1 window", "1 window", "2 windows"]


def test_a_terminal_hears_of_the_set_up() -> None:
    line, file = shown(width=200, terminal=True)
    with line:
        pass
    assert SETTING_UP in file.getvalue()


def test_tries_of_one_window_are_one_line() -> None:
    line, file = shown()
    loose = [f"nothing holds body [b]; {share:.3g} of the step was reached" for share in np.logspace(-9, 0, 9)]
    with line:
        for message in (*loose, "no equilibrium"):
            line(replace(FIRST, verdict="mechanical discard", message=message, H=2.0, scheme="iterated"))
        line(replace(FIRST, H=0.002, scheme="iterated"))
    first, second = file.getvalue().splitlines()[1:]
    assert first == ("window 1 at t = 1 s, 2 s iterated: the mechanical solver failed (nothing holds body [b]; "
                     "1e-09 of the step was reached); "
                     "the mechanical solver failed (no equilibrium); the step was rejected 10 times; "
                     "accepted with 0.002 s iterated")
    assert "| window 1 of 0.002 s (10 rejected)" in second


def test_bodies_whose_names_differ_in_a_number_are_two_reasons() -> None:
    line, file = shown()
    with line:
        for body in ("b1", "b2"):
            line(replace(FIRST, verdict="mechanical discard", message=f"nothing holds body {body}", H=2.0))
        line(replace(FIRST, H=1.0))
    assert "nothing holds body b1" in file.getvalue()
    assert "nothing holds body b2" in file.getvalue()


def test_no_window_is_beyond_the_planned_ones() -> None:
    """After a rejection there are more windows than were planned: "window 5/4" was said."""
    line, file = shown()
    with line:
        line(replace(FIRST, number=1, total=4))
        line(replace(FIRST, number=5, total=4))
    first, second = file.getvalue().splitlines()[1:]
    assert "| window 1/4 of" in first
    assert "| window 5 of" in second


def test_errors_that_are_too_large_are_told_ten_times() -> None:
    line, file = shown()
    with line:
        for n in range(1, 31):
            line(replace(FIRST, number=n, total=0, verdict="error too large", message="2 tolerances", H=2.0))
            line(replace(FIRST, number=n, total=0, H=1.0))
    told = [text for text in file.getvalue().splitlines() if "error too large" in text]
    assert len(told) == 10
    assert told[-1].endswith("further ones are only counted")


def test_what_was_told_at_the_start_is_not_told_again(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5")
    assert "note: a note of the run" in summary(results)
    assert "note: a note of the run" not in summary(results, printed={"a note of the run"})


def test_seconds_in_which_both_halves_worked_are_told_once(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5")
    alone = f"{0.05 * int(results.windows.taken.sum()):.1f} s after 0.5 s of set-up"
    assert alone in summary(results)
    assert "at the same time" not in summary(results)
    results.timings = np.rec.array([(0.2,), (0.1,)], dtype=[("overlap", float)])
    assert alone in summary(results)  # the run took no longer
    assert "(both halves at the same time: 0.3 s)" in summary(results)


def test_notes_of_windows_are_remembered_as_told() -> None:
    line, file = shown()
    line(replace(FIRST, notes=("it rings",)))
    assert "note: it rings" in file.getvalue()
    assert line.printed == {"it rings"}


def test_old_names_of_progress_warn() -> None:
    p = replace(FIRST, number=20, total=200, remaining=65.0)
    with pytest.warns(DeprecationWarning, match="Progress.remaining"):
        assert p.left == 65.0
    with pytest.warns(DeprecationWarning, match="Progress.fraction"):
        assert p.share == 0.1
