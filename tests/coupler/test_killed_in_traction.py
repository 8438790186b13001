"""A run whose contact service or coupler is killed in the middle of a traction with friction and multipliers."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import psutil
import pytest

from coupler.fmu import processes as module
from coupler.fmu.children import python
from coupler.record.results import Results
from coupler.report.page import render
from coupler.running.run import Run
from coupler.scenario import load_scenario

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
PROGRAM = HERE.parent / "contact" / "stalling_contact.py"
OVERRIDES = {
    "bodies.bar.mesh.rectangle.cells": [6, 1], "bodies.block.mesh.rectangle.cells": [3, 1],
    "contact.face.augmented": {"tolerance": 0.01}, "coupling.end": 2, "coupling.windows": [{"until": 2, "size": 0.5}],
}


def start(out: Path, number: int, flag: Path) -> Run:
    """A run whose service stalls in traction `number`; 0: never."""
    module.processes = partial(PROCESSES, service=[*python(), str(PROGRAM), str(number), str(flag)])
    return Run(load_scenario(ROOT / "scenarios" / "rubbing_block.yaml", OVERRIDES), out, processes=True)


PROCESSES = module.processes


@pytest.fixture(autouse=True)
def _put_back(monkeypatch):
    monkeypatch.setattr(module, "processes", PROCESSES)


def wait_for(flag: Path) -> None:
    until = time.monotonic() + 200.0
    while not flag.exists():
        assert time.monotonic() < until, "the service never came to that traction"
        time.sleep(0.02)


def of(pids: list[int], within: float) -> list[int]:
    """Those that still live after so many seconds."""
    until = time.monotonic() + within
    left = pids
    while left and time.monotonic() < until:
        left = [p for p in left if psutil.pid_exists(p) and psutil.Process(p).status() != psutil.STATUS_ZOMBIE]
        time.sleep(0.05)
    return left


COUPLER = """
import sys, threading
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import psutil
from test_killed_in_traction import of, start, wait_for
from contact.rpc.calls import ServiceDownError

flag, out, number = Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4])
try:
    with start(out, number, flag) as r:
        children = psutil.Process().children()
        print(*(c.pid for c in children), flush=True)
        service = next(c for c in children if "stalling_contact.py" in " ".join(c.cmdline()))
        def trouble():
            wait_for(flag)
            service.kill()
        if sys.argv[5] == "service":
            threading.Thread(target=trouble).start()
        for w in r.windows():
            pass
except ServiceDownError as exc:
    print("named:", str(exc).splitlines()[0])
    print("left:", of([c.pid for c in children], 30.0))
"""


@contextmanager
def program(tmp_path: Path, number: int, victim: str) -> Iterator[subprocess.Popen[str]]:
    """A coupler in a process of its own, dead in the end; its first line: the pids of its children."""
    coupler = subprocess.Popen([sys.executable, "-c", COUPLER, str(HERE), str(tmp_path / "flag"),
                                str(tmp_path / "run.h5"), str(number), victim], stdout=subprocess.PIPE, text=True)
    with coupler:
        try:
            yield coupler
        finally:
            coupler.kill()


@pytest.mark.slow
def test_a_service_killed_in_a_traction_ends_the_run_by_name(tmp_path):
    with program(tmp_path, 8, "service") as coupler:
        said, _ = coupler.communicate(timeout=200)
    assert "named: contact service: its process was ended by signal 9" in said
    assert "left: []" in said
    results = Results(tmp_path / "run.h5")
    assert results.outcome == "failed"
    assert "signal 9" in results.message
    assert results.totals["contact"] == {}


@pytest.mark.slow
def test_a_coupler_killed_in_a_traction_leaves_nobody(tmp_path):
    with program(tmp_path, 8, "coupler") as coupler:
        assert coupler.stdout is not None
        pids = [int(word) for word in coupler.stdout.readline().split()]
        assert len(pids) == 3
        wait_for(tmp_path / "flag")
        coupler.send_signal(signal.SIGKILL)
        coupler.communicate()
    assert of(pids, 30.0) == []


@pytest.mark.slow
def test_a_run_says_what_its_service_was_asked(tmp_path):
    with program(tmp_path, 0, "nobody") as coupler:
        said, _ = coupler.communicate(timeout=200)
    assert "named" not in said
    results = Results(tmp_path / "run.h5")
    asked, page = results.totals["contact"], render(results)
    assert asked["Traction"]["count"] > 10
    assert asked["Register"]["count"] == 2  # by either half, and the surfaces do not change
    assert 0.0 < asked["Traction"]["typical"] <= asked["Traction"]["most"] <= asked["Traction"]["total"]
    assert asked["Traction"]["bytes_out"] > asked["Traction"]["bytes_in"] > 0
    assert "Requests to the contact service" in page
    assert f"<td>Traction</td><td class=\"n\">{asked['Traction']['count']}</td>" in page
