"""`slideline watch`: the page of a run that goes on, and that of its end."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler.cli.cli import app
from coupler.errors import ResultsError
from coupler.record.finish import finish, snapshot
from coupler.record.paths import journal_of
from coupler.record.results import Results
from coupler.report import watch_report
from coupler.report.watch import wait_for
from coupler.running.status import status

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, record, write_run


@pytest.fixture(autouse=True)
def _in_a_hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page may take all of a core from these runs."""
    monkeypatch.setattr("coupler.report.watch.SHARE", 1.0)


def test_a_run_that_goes_on_has_a_page_that_is_renewed_until_it_ends(tmp_path: Path) -> None:
    run = record(tmp_path / "run.h5", Case(windows=4, frames=3, reject=0))
    out, seen = tmp_path / "run.html", []

    def on_page(results: Results) -> None:
        seen.append((results.outcome, len(results.t), out.read_text("utf-8")))
        if len(seen) == 2:
            run.end("completed", "", {"seconds": 1.0})

    done = watch_report(tmp_path / "run.h5", out, 0.05, on_page)
    assert [outcome for outcome, _, _ in seen] == ["running", "running", "completed"]
    assert all(n == 5 for _, n, _ in seen)
    for outcome, _, page in seen:
        assert ("This run goes on." in page) == ("data-renew" in page.partition("<body>")[0]) == (outcome == "running")
        assert 'id="player"' in page
    assert done.outcome == "completed"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.h5", "run.html", "run.mechanical.vtkhdf",
                                                          "run.thermal.vtkhdf"]


@pytest.mark.slow
def test_watching_leaves_the_journal_as_it_is(tmp_path: Path) -> None:
    run = record(tmp_path / "run.h5", Case(windows=3, frames=2, reject=0))
    before = journal_of(tmp_path / "run.h5").read_bytes()

    def on_page(results: Results) -> None:
        if results.outcome == "running":
            assert journal_of(tmp_path / "run.h5").read_bytes() == before
            run.end("interrupted", "stopped", {"seconds": 1.0})

    assert watch_report(tmp_path / "run.h5", tmp_path / "page.html", 0.05, on_page).outcome == "interrupted"


def test_a_run_that_has_ended_has_its_page_at_once_and_none_is_named(tmp_path: Path) -> None:
    write_run(tmp_path / "run.h5", Case(windows=3, frames=2))
    pages = []
    watch_report(tmp_path / "run.h5", tmp_path / "run.html", 100.0, pages.append)
    assert [r.outcome for r in pages] == ["completed"]
    with pytest.raises(ResultsError, match="no such results file"):
        watch_report(tmp_path / "none.h5", tmp_path / "none.html", 1.0, pages.append)


def test_the_page_of_a_run_that_has_just_begun_says_so(tmp_path: Path) -> None:
    """It said that the run had ended, and had a table of zeros."""
    run = record(tmp_path / "run.h5", Case(windows=0, frames=0))
    told: list[str] = []

    def on_page(results: Results) -> None:
        told.append((tmp_path / "run.html").read_text("utf-8"))
        if len(told) == 1:
            run.end("completed", "", {"seconds": 1.0})

    watch_report(tmp_path / "run.h5", tmp_path / "run.html", 0.05, on_page)
    assert "This run goes on." in told[0]
    assert "It is at t = 0 s of 25000 s." in told[0]
    assert "There is no frame of fields yet." in told[0]
    assert "ended before" not in told[0]
    assert "<td>set-up</td>" not in told[0]


def test_a_run_that_has_not_begun_is_waited_for(tmp_path: Path) -> None:
    """Halves are built before a run writes anything; `watch` ended with an error until then."""
    out, told = tmp_path / "run.h5", []

    def begin() -> None:
        told.append("waits")
        write_run(out, Case(windows=3, frames=2))

    wait_for(out, 60.0, begin)
    assert (told, out.exists()) == (["waits"], True)
    wait_for(out, 60.0, begin)
    wait_for(tmp_path / "none.h5", 0.3, lambda: told.append("in vain"))
    assert told == ["waits", "in vain"]
    done = CliRunner().invoke(app, ["watch", str(tmp_path / "none.h5"), "--patience", "0.3"])
    assert "no run writes it yet" in done.output
    assert isinstance(done.exception, ResultsError)


def test_a_run_is_being_written_until_its_results_file_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever looked between the end of the journal and the file made the file too, in the same folder."""
    out, asked = tmp_path / "run.h5", []
    run = record(out, Case(windows=3, frames=2, reject=0))

    def watched(journal: Path, path: Path) -> None:
        with pytest.raises(ResultsError, match="its run still goes on"):
            Results(out)
        asked.append(status(out))
        finish(journal, path)

    monkeypatch.setattr("coupler.record.recorder.finish", watched)
    run.end("completed", "", {"seconds": 1.0})
    assert len(asked) == 1
    assert Results(out).outcome == "completed"
    assert Results(out).later is None


@pytest.mark.slow
def test_a_journal_that_goes_between_two_looks_is_the_end_of_the_run(tmp_path: Path,
                                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    out, looks = tmp_path / "run.h5", []
    run = record(out, Case(windows=3, frames=2, reject=0))

    def ended_meanwhile(journal: Path, path: Path) -> None:
        looks.append(path)
        run.end("completed", "", {"seconds": 1.0})
        snapshot(journal, path)

    monkeypatch.setattr("coupler.report.watch.snapshot", ended_meanwhile)
    pages: list[str] = []
    done = watch_report(out, tmp_path / "run.html", 0.05, lambda r: pages.append(r.outcome))
    assert (len(looks), pages, done.outcome) == (1, ["completed"], "completed")


RUN = """
import sys, time
sys.path.insert(0, {tests!r})
from pathlib import Path
from synthetic_run import Case, record
run = record(Path({out!r}), Case(windows=40, frames=41, reject=0))
print("goes on", flush=True)
time.sleep({wait})
run.end("completed", "", {{"seconds": 1.0}})
"""


@pytest.mark.slow
def test_a_run_and_who_watches_it_both_end_well(tmp_path: Path) -> None:
    for k in range(3):
        out = tmp_path / f"run{k}.h5"
        code = RUN.format(tests=str(Path(__file__).parent), out=str(out), wait=0.3 + 0.1 * k)
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as run:
            assert next(iter(run.stdout or ())) == "goes on\n"
            pages: list[str] = []
            watch_report(out, out.with_suffix(".html"), 0.01, lambda r, seen=pages: seen.append(r.outcome))
            assert run.wait(60) == 0
        assert (pages[0], pages[-1]) == ("running", "completed")
        assert "This run goes on." not in out.with_suffix(".html").read_text("utf-8")
