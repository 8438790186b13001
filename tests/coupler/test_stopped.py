"""Stopped is not dead: who is stopped for a while is waited for; who stays so is named, and no other in his place."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from contact.rpc.calls import ServiceDownError
from coupler.errors import HalfError
from coupler.fmu.processes import Processes
from coupler.fmu.remote import KNOWN_STEPS, LEAST_DEADLINE, Course
from coupler.running.interrupts import Interrupts

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from test_processes import ended, two  # noqa: E402

STOP = 6.0  # s, beyond the lease of three seconds


@pytest.fixture
def fmu(tmp_path) -> Path:
    path = tmp_path / "toy.fmu"
    path.touch()
    return path


@pytest.mark.few("contact")
@pytest.mark.parametrize("victim", ["thermal", "mechanical", "contact"])
def test_a_process_stopped_for_a_while_is_waited_for(fmu, victim):
    with two(fmu) as p:
        half = p.halves["thermal"]
        half.advance(0.0, 1.0, {}, ["y"])
        os.kill(p.pids[victim], signal.SIGSTOP)
        timer = threading.Timer(STOP, os.kill, (p.pids[victim], signal.SIGCONT))
        timer.start()
        started = time.monotonic()
        done = half.advance(1.0, 1.0, {}, ["y"])
        assert done.outputs["y"].tobytes() == half.read(["y"])["y"].tobytes()
        assert victim == "mechanical" or time.monotonic() - started > 0.8 * STOP
        p.halves["mechanical"].advance(0.0, 1.0, {}, ["y"])
        timer.join()


COUPLER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from test_processes import ended, two
with two(Path(sys.argv[2])) as p:
    print("begun", flush=True)
    p.halves["thermal"].advance(0.0, 6.0, {}, ["y"])
    p.halves["mechanical"].advance(0.0, 1.0, {}, ["y"])
    print("done", float(p.halves["thermal"].advance(6.0, 1.0, {}, ["sum"]).outputs["sum"]), flush=True)
"""


@pytest.mark.slow
def test_a_coupler_that_was_stopped_blames_nobody(fmu):
    """Ctrl-Z for 8 s ended two runs of three, with a healthy half to blame."""
    with subprocess.Popen([sys.executable, "-c", COUPLER, str(HERE), str(fmu)], text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as coupler:
        assert coupler.stdout is not None
        assert coupler.stdout.readline() == "begun\n"
        time.sleep(0.5)
        coupler.send_signal(signal.SIGSTOP)
        time.sleep(8.0)
        coupler.send_signal(signal.SIGCONT)
        said, trouble = coupler.communicate(timeout=120)
    assert coupler.returncode == 0, trouble
    assert said.startswith("done ")


def stays_stopped(victim: str):
    def trouble(p: Processes) -> None:
        os.kill(p.pids[victim], signal.SIGSTOP)
        p.halves["thermal"].advance(0.0, 1.0, {}, [])

    return trouble


def test_a_half_that_stays_stopped_is_named_at_its_deadline(fmu):
    end = ended(fmu, stays_stopped("thermal"), step_deadlines={"thermal": 5.0})
    assert isinstance(end.error, HalfError)
    assert 5.0 <= end.seconds < 30.0
    assert re.search(r"half 'thermal': its process is stopped; `kill -CONT \d+` lets one go on "
                     r"\(in Step from t = 0 s by 1 s\)", str(end.error))


def test_a_contact_service_that_stays_stopped_is_named_and_no_half(fmu):
    end = ended(fmu, stays_stopped("contact"), step_deadlines={"thermal": 5.0})
    assert isinstance(end.error, ServiceDownError)
    assert re.search("contact service: its process is stopped", str(end.error))
    assert "found when half 'thermal' was called (in Step from t = 0 s by 1 s)" in end.error.__notes__[0]
    assert "Traceback" not in str(end.error)


def test_a_stuck_half_is_named_a_second_after_its_stated_deadline(fmu):
    def trouble(p: Processes) -> None:
        p.halves["thermal"].advance(0.0, 1.0, {}, [])
        begun.append(time.monotonic())
        try:
            p.halves["thermal"].advance(1.0, 7.0, {}, [])
        finally:
            begun.append(time.monotonic())

    begun: list[float] = []
    end = ended(fmu, trouble, step_deadlines={"thermal": 2.0})
    assert re.search("half 'thermal': Step to half-thermal: .*busy with Step for", str(end.error))
    assert "in Step from t = 1 s by 7 s; its last good step ended at t = 1 s" in str(end.error)
    assert 2.0 <= begun[1] - begun[0] < 6.0  # a second late, and more on a busy machine


def test_the_deadline_of_a_step_follows_its_median():
    course = Course()
    assert course.deadline is None
    for k in range(KNOWN_STEPS):
        course.add(float(k), 0.5)
    assert (course.t, course.deadline) == (KNOWN_STEPS - 1.0, LEAST_DEADLINE)
    for k in range(2 * KNOWN_STEPS):
        course.add(float(k), 30.0)
    assert course.deadline == 600.0
    assert Course(7.0).deadline == 7.0


def test_ctrl_c_amid_a_line(monkeypatch, capfd):
    """A signal that comes while progress is being written to stderr, whose buffer cannot be entered twice."""
    with Interrupts() as interrupts:
        class Slow(io.RawIOBase):
            def writable(self) -> bool:
                return True

            def write(self, data: bytes) -> int:
                if not interrupts.asked:
                    os.kill(os.getpid(), signal.SIGINT)
                    time.sleep(0.01)
                return len(data)

        monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(io.BufferedWriter(Slow()), write_through=True))
        print("window 7", file=sys.stderr, flush=True)
        assert interrupts.asked
    assert "stopping after this window" in capfd.readouterr().err
