"""Folders of runs among the temporary ones: private, gone in the end, and those of killed runs with the next."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from coupler.fmu.scratch import PREFIX, remove_abandoned, scratch_folder

HOLD = ("import sys, time; from coupler.fmu.scratch import scratch_folder\n"
        "with scratch_folder() as f:\n    (f / 'x').write_text('x'); print(f, flush=True); time.sleep(60)")


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def holder() -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen([sys.executable, "-c", HOLD], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_a_folder_is_private_and_goes(temporary):
    os.umask(os.umask(0))  # whatever the umask
    with scratch_folder() as folder:
        assert folder.parent == temporary
        assert folder.stat().st_mode & 0o777 == 0o700
        with pytest.raises(ZeroDivisionError), scratch_folder():
            raise ZeroDivisionError
        assert list(temporary.iterdir()) == [folder]
    assert not list(temporary.iterdir())


def test_what_killed_runs_left_goes_with_the_next_and_what_lives_stays(temporary):
    processes, folders = zip(*[holder() for _ in range(4)], strict=True)
    for process in processes[:3]:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    assert all(f.exists() for f in folders)
    with scratch_folder() as mine:
        assert [f.exists() for f in folders] == [False, False, False, True]
        assert (folders[3] / "x").read_text() == "x"
        assert mine.exists()
        assert remove_abandoned() == []
    processes[3].kill()
    processes[3].communicate()
    assert remove_abandoned() == [folders[3]]


def test_what_is_not_a_run_s_is_left_alone(temporary):
    target = temporary / "mine"
    target.mkdir()
    (target / "lock").touch()
    (temporary / f"{PREFIX}link").symlink_to(target)
    (temporary / f"{PREFIX}empty").mkdir()
    (temporary / f"{PREFIX}file").touch()
    assert remove_abandoned() == []
    assert len(list(temporary.iterdir())) == 4
