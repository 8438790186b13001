"""The table of many seeds: what crashes or hangs is a row, a run goes on, keys are told from declared ones."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
from random_scenes_clock import Clock, LateError  # noqa: E402
from random_scenes_table import compared, declared, reason, written  # noqa: E402

JUDGE = '''
import os, time

class Judgement:
    def __init__(self, seed):
        self.seed = seed

    def as_dict(self):
        row = {"invariant": "law", "verdict": "silent" if self.seed == 2 else "holds", "what": "it is off",
               "size": 3.0 * (self.seed == 2)}
        return {"seed": self.seed, "features": ["scheme staggered"], "keys": ["materials.NAME.rho"],
                "outcome": "completed", "message": "", "rows": [row], "seconds": 0.1}

def judged(seed):
    print("said by a run")
    if seed == 3:
        os._exit(5)
    if seed == 4:
        time.sleep(100)
    if seed == 7:
        while True:
            pass
    if seed == 5:
        raise ValueError("no such thing")
    return Judgement(seed)
'''


def table(folder: Path, seeds: int) -> str:
    (folder / "fake_judge.py").write_text(JUDGE)
    done = subprocess.run(
        [sys.executable, ROOT / "benchmarks/random_scenes.py", "--seeds", str(seeds), "--jobs", "2", "--limit", "1",
         "--warm-up", "5", "--judge", "fake_judge:judged", "--out", folder / "rows.jsonl"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}, capture_output=True, text=True,
        timeout=120, check=True)
    return done.stdout


@pytest.mark.slow
def test_what_crashes_or_hangs_is_a_row_and_a_run_goes_on(tmp_path):
    table(tmp_path, 3)
    path = tmp_path / "rows.jsonl"
    first = path.read_text()
    path.write_text(first + '{"seed": 6, "outc')  # cut while it was written
    text = table(tmp_path, 8)
    rows = [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]
    assert path.read_text().startswith(first)
    assert {r["seed"]: r["outcome"] for r in rows} == {
        **dict.fromkeys((0, 1, 2, 6), "completed"), 3: "crashed", 4: "hung", 5: "crashed", 7: "hung"}
    assert "| 8 | 4 | 0 | 0 | 2 | 2 | 0 | 1 |" in text
    assert "| law | 4 | 3 | 0 | 1 | 3 (seed 2) |" in text
    assert "ValueError: no such thing" in text


@pytest.mark.few("time.sleep(1)-nothing done", "[None for _ in range(200000)]-of CPU")
@pytest.mark.parametrize(("does", "late"), [
    ("time.sleep(0.5); [None for _ in range(3000000)]", ""),  # a part of a core: others have the rest
    ("[None for _ in range(200000)]", "of CPU"),
    ("time.sleep(1)", "nothing done"),
])
def test_a_worker_is_late_by_what_it_uses_and_not_by_the_clock(does, late):
    with subprocess.Popen([sys.executable, "-c", f"import time\nwhile True: {does}"]) as process:
        try:
            clock, until = Clock(process.pid, 1.0), time.monotonic() + 4.0
            with pytest.raises(LateError, match=late) if late else contextlib.nullcontext():
                while time.monotonic() < until or late:
                    time.sleep(0.2)
                    clock.look()
        finally:
            process.kill()


def test_keys_are_those_of_the_declaration():
    keys = declared()
    assert {"materials.NAME.rho", "mechanical.elastic.bodies.NAME.element", "coupling.adaptive.tolerance.gap.atol",
            "contact.NAME.conduction.closed.law", "thermal.boundary.convection.h"} <= keys
    row = {"seed": 0, "features": ["plane"], "outcome": "completed", "message": "", "rows": [], "seconds": 1.0,
           "keys": ["mechanical.elastic.bodies.upper.element", "coupling.end", "no.such.key"]}
    assert f"## Keys: 2 of {len(keys)} drawn" in written([row])


def test_two_files_stand_side_by_side():
    def row(seed, verdict):
        rows = [{"invariant": "law", "verdict": verdict, "what": "", "size": 1.0}] if verdict else []
        return {"seed": seed, "features": ["plane"], "outcome": "completed" if verdict else "failed", "message": "",
                "rows": rows, "seconds": 1.0, "keys": ["coupling.end"]}

    text = compared([row(0, "silent"), row(1, "warned"), row(2, "")], [row(0, "holds"), row(1, "silent")])
    assert "| before | 3 | 2 | 1 | 0 | 0 | 0 | 1 | 1 (33 %) |" in text
    assert "| law | 2 | 1 | 1 | 2 | 0 | 1 |" in text
    assert "| plane | 3 | 2 | 1 (33 %) | 2 | 2 | 1 (50 %) |" in text


def test_equal_reasons_are_one():
    assert reason("scene.yaml:12: 'a b' is 3.5e-2 K\nmore") == reason("scene.yaml:7: 'c' is 1 K")
    assert reason("") == "no message"
