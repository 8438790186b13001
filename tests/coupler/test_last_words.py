"""What a run leaves where something goes wrong at its very end, and what a resume knows of what went wrong before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler import Results, load_scenario
from coupler.cli import running as running_module
from coupler.cli.cli import app
from coupler.errors import HalfError
from coupler.record import checkpoint as keeper_module
from coupler.record.journal import being_written
from coupler.running import resume as resume_module
from coupler.running.resume import resume, resumed
from coupler.running.run import Run

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios/casting_1d.yaml"
CHANGED = {"coupling.end": 0.2, "output.checkpoint": 0}


def test_a_half_that_dies_at_the_very_end_leaves_results(tmp_path, monkeypatch):
    """Windows of hours are in the journal: they become a results file whatever the last words are."""
    out = tmp_path / "run.h5"

    def dies(half: object) -> bytes:
        raise HalfError("it died", half="thermal")

    run = Run(load_scenario(SCENARIO, CHANGED), out)
    run.__enter__()
    last = [w.t for w in run.windows(until=0.1)][-1]
    monkeypatch.setattr(keeper_module, "state_of", dies)
    with pytest.raises(HalfError, match="it died") as died:
        run.__exit__(None, None, None)
    assert "slideline resume" in died.value.__notes__[0]
    monkeypatch.undo()
    left = Results(out)
    assert left.outcome == "failed"
    assert "it died" in left.message
    assert left.t[-1] == last
    assert resume(out).outcome == "completed"


def test_who_was_started_anew_is_told_of_a_resumed_run_too(tmp_path):
    out = tmp_path / "run.h5"
    for until, name in ((0.05, "thermal"), (0.1, "mechanical")):
        with (Run(load_scenario(SCENARIO, CHANGED), out) if name == "thermal" else resumed(out)) as run:
            windows = run.windows(until=until)
            next(windows)
            # In the last window: after the last checkpoint but that of the end.
            run._launched = replace(run._launched, restarts=[f"half {name!r}: died"])
            for _ in windows:
                pass
    told = resume(out).totals["restarts"]
    assert [text.partition(": ")[2] for text in told] == ["half 'thermal': died", "half 'mechanical': died"]


def test_resume_is_as_quiet_as_run_and_says_the_same_facts(tmp_path):
    out = tmp_path / "run.h5"
    sets = [word for k, v in CHANGED.items() for word in ("--set", f"{k}={v}")]
    CliRunner().invoke(app, ["run", str(SCENARIO), "-o", str(out), "--until", "0.1", "-q", *sets])
    said = CliRunner().invoke(app, ["resume", str(out), "-q", "--json"])
    assert said.exit_code == 0, said.output
    assert said.stderr == ""
    assert '"outcome": "completed"' in said.stdout


@pytest.mark.parametrize("quiet", [[], ["-q"]])
def test_a_quiet_run_that_fails_tells_its_notes_with_the_error(tmp_path, monkeypatch, quiet):
    """Laws that do not join are often why windows fail; a run that is not quiet has said so at its start."""
    def fails(*_: object, **__: object) -> None:
        raise HalfError("it died", half="thermal")

    monkeypatch.setattr(running_module, "run", fails)
    torn = "contact.interface.conduction.open={law: constant, h: 3}"
    bars = str(SCENARIO.with_name("heated_bars.yaml"))
    said = CliRunner().invoke(app, ["run", bars, "-o", str(tmp_path / "run.h5"), "--set", torn, *quiet])
    assert isinstance(said.exception, HalfError)
    notes = [note for note in getattr(said.exception, "__notes__", ()) if "conductance jumps from 3 to 2000" in note]
    assert len(notes) == len(quiet)
    assert ("conductance jumps" in said.stderr) == (not quiet)


def test_a_resume_of_a_run_that_ends_meanwhile_looks_again(tmp_path, monkeypatch):
    out = tmp_path / "run.h5"
    run = Run(load_scenario(SCENARIO, CHANGED), out)
    run.__enter__()
    list(run.windows(until=0.1))
    looks = []

    def ends(journal: Path) -> bool:
        if not looks:
            run.__exit__(None, None, None)
        looks.append(journal)
        return being_written(journal)

    monkeypatch.setattr(resume_module, "being_written", ends)
    assert resume(out).outcome == "completed"
    assert len(looks) == 2
