"""A disk that is full ends a run by name, and loses nothing that was recorded."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from coupler import load_scenario, run

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from killed_runs import differences  # noqa: E402
from test_hosts import namespaces  # noqa: E402

ROOT = HERE.parents[1]
SCENARIO, END = ROOT / "scenarios/casting_1d.yaml", 2
# In a mount namespace of its own the folder $1 is a disk of $2, until there is room and the run goes on.
ON_A_SMALL_DISK = """
mount -t tmpfs -o size=$2 none "$1"
"$3" -m coupler.cli run "$4" --set coupling.end=2 -o "$1/run.h5" 2> "$5/run.log"
echo "$?"
cp "$1"/* "$5"
"""


@pytest.mark.few("at the end")
@pytest.mark.skipif(bool(namespaces()), reason=f"no small disk here: {namespaces()}")
@pytest.mark.parametrize(("size", "said"), [
    ("100k", "run.h5.journal: cannot be written (No space left on device). What it holds stays good: once this is "
             "mended, `slideline resume {run}` goes on"),
    ("600k", "run.h5: cannot be made from run.h5.journal (0.2 MB are free on its disk, 0.8 MB are needed). All windows "
             "are in the journal: once this is mended `slideline report {run}` makes the file"),
], ids=["in a window", "at the end"])
def test_a_full_disk_is_named_and_the_run_goes_on_where_there_is_room(tmp_path, size, said):
    small, kept = tmp_path / "small", tmp_path / "kept"
    small.mkdir()
    kept.mkdir()
    done = subprocess.run(["unshare", "-rm", "bash", "-ec", "set +e" + ON_A_SMALL_DISK, "bash", small, size,
                           sys.executable, SCENARIO, kept], capture_output=True, text=True, timeout=300, check=False,
                          cwd=ROOT)
    assert done.stdout == "3\n", done.stderr
    told = " ".join((kept / "run.log").read_text().split())
    assert said.format(run=small / "run.h5") in told
    assert "Traceback" not in told
    run(load_scenario(SCENARIO, {"coupling.end": END}), tmp_path / "whole.h5")
    command = "resume" if size == "100k" else "report"
    again = subprocess.run([sys.executable, "-m", "coupler.cli", command, kept / "run.h5"], capture_output=True,
                           text=True, timeout=300, check=False, cwd=ROOT)
    assert again.returncode == 0, again.stderr
    assert differences(tmp_path / "whole.h5", kept / "run.h5") == []
