"""Where results may go: nothing that is not a results file is ever replaced, and it is said before a run starts."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest

from coupler.errors import ResultsError
from coupler.record.journal import Journal
from coupler.record.paths import check_target, journal_of
from coupler.record.recorder import Recorder
from coupler.record.results import Results
from coupler.report import write_report

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, blocks, record, write_run


@pytest.fixture
def run_h5(tmp_path: Path) -> Path:
    return write_run(tmp_path / "old.h5", Case(windows=2, frames=1)).path


def test_new_empty_and_older_results_files_will_do(tmp_path: Path, run_h5: Path) -> None:
    (tmp_path / "empty").touch()
    for out in (tmp_path / "run.h5", tmp_path / "empty", run_h5):
        check_target(out, report=True)


@pytest.mark.parametrize(("name", "says"), [
    ("no/run.h5", "does not exist"), ("folder", "such as"), ("s.yaml", "not a results file"),
    ("foreign.h5", "not a results file"), ("device", "ordinary"), ("run.html", "the report takes this name"),
    ("busy.h5", "another run is writing"), ("/proc/run.h5", "cannot be written to"),
])
def test_what_else_stands_there_stays(tmp_path: Path, name: str, says: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "s.yaml").write_text("slideline: 2\n")
    os.mkfifo(tmp_path / "device")
    with h5py.File(tmp_path / "foreign.h5", "w") as f:
        f["a"] = 1
    with Journal(journal_of(tmp_path / "busy.h5")), pytest.raises(ResultsError, match=says):
        check_target(tmp_path / name, report=True)


def test_the_recorder_asks_too(tmp_path: Path) -> None:
    scenario = tmp_path / "s.yaml"
    scenario.write_text("slideline: 2\n")
    with pytest.raises(ResultsError, match="not a results file"):
        Recorder(scenario, {}, blocks(2))
    assert [p.name for p in tmp_path.iterdir()] == ["s.yaml"]
    assert scenario.read_text() == "slideline: 2\n"


@pytest.mark.few("s.yaml")
@pytest.mark.parametrize("name", ["old.h5", "s.yaml"])
def test_a_page_replaces_pages_only(tmp_path: Path, run_h5: Path, name: str) -> None:
    (tmp_path / "s.yaml").write_text("slideline: 2\n")
    before = (tmp_path / name).read_bytes()
    with pytest.raises(ResultsError, match="not a page"):
        write_report(Results(run_h5), tmp_path / name)
    assert (tmp_path / name).read_bytes() == before
    page = write_report(Results(run_h5), tmp_path / "run.html")
    assert write_report(Results(run_h5), page) == page


def test_a_full_disk_is_one_error_and_nothing_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "run.h5"
    recorder = record(out, Case(windows=3, frames=1))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=1_000))
    with pytest.raises(ResultsError, match=r"0.0 MB are free .* `slideline report"):
        recorder.end("completed", "", {})
    assert [p.name for p in tmp_path.iterdir()] == [journal_of(out).name]
    monkeypatch.undo()
    assert Results(out).outcome == "completed"


def test_a_journal_that_cannot_grow_says_so() -> None:
    with Journal.__new__(Journal) as journal:
        journal.path = Path("/dev/full")
        journal._file = open("/dev/full", "wb", buffering=0)  # noqa: SIM115  (closed with the journal)
        with pytest.raises(ResultsError, match="No space left"):
            journal.write("window", {})
