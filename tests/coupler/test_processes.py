"""Halves in processes of their own: the same answers, and no orphan whatever ends the run."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from contact.messages import Project, Registered
from contact.rpc import zenoh_session
from contact.rpc.calls import ServiceDownError
from contact.rpc.client import ZenohLink
from contact.rpc.link import open_link
from coupler.errors import HalfError
from coupler.fmu.children import LOG_MOST, ChildError, python, start
from coupler.fmu.half import Status
from coupler.fmu.processes import Processes, processes

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parent / "contact"))
from fake_contact import facing, register  # noqa: E402

HOST = [*python(), str(HERE / "fake_host.py")]
SERVICE = [*python(), str(HERE.parent / "contact" / "fake_contact.py")]
IDLE = [sys.executable, "-c", "import time; time.sleep(60)"]
# A wait ends when what is awaited is there: this only ends one in vain, on a machine however busy.
SOON = 30.0  # s; half of what a child that nobody ends goes on for
X = np.random.default_rng(7).random((4, 2))


@pytest.fixture
def fmu(tmp_path) -> Path:
    path = tmp_path / "toy.fmu"
    path.touch()
    return path


@contextmanager
def two(fmu: Path, **options: Any) -> Iterator[Processes]:
    """Two toy halves, initialised."""
    with processes({"thermal": fmu, "mechanical": fmu}, host=HOST, service=SERVICE, **options) as p:
        for half in p.halves.values():
            half.initialise(0.0, 1.0, {"contact.link": p.contact_link}, {"x": X}, ["y"])
        yield p


def gone(pids: list[int], within: float = SOON) -> bool:
    """Whether all processes have ended (or are only waiting to be buried)."""
    until = time.monotonic() + within
    while time.monotonic() < until:
        if not any(psutil.pid_exists(p) and psutil.Process(p).status() != psutil.STATUS_ZOMBIE for p in pids):
            return True
        time.sleep(0.05)
    return False


def test_states_of_any_size_cross_as_bytes(fmu):
    with two(fmu) as p:
        half = p.halves["thermal"]
        assert half.can_serialise
        half.advance(0.0, 2.0, {}, ["y"])
        done, data = half.read(["y"])["y"], half.serialise(half.save())
        half.advance(2.0, 1.0, {"x": 2 * X}, [])
        half.restore(half.deserialise(data))
        assert half.read(["y"])["y"].tobytes() == done.tobytes()
        large = np.random.default_rng(1).bytes(20_000_000)
        assert half.serialise(half.deserialise(large)) == large


def test_a_half_in_a_process_is_a_half(fmu):
    with two(fmu) as p:
        half = p.halves["thermal"]
        assert (half.name, half.can_save, half.strings) == ("thermal", True, {"mesh.hash": "abc"})
        assert half.blocks["x"].shape == (4, 2)
        done = half.advance(0.0, 2.0, {}, ["y", "sum"])
        expected = 2.0 * facing(Project("", X)).node_gap
        assert done.outputs["y"].tobytes() == expected.tobytes()
        assert (done.status, done.seconds, done.outputs["sum"].shape) == (Status.OK, 0.25, ())
        token = half.save()
        half.advance(2.0, 1.0, {"x": 2 * X}, [])
        assert half.read(["y"])["y"].tobytes() != expected.tobytes()
        half.restore(token)
        assert half.read(["y"])["y"].tobytes() == expected.tobytes()
        half.release(token)
        with pytest.raises(HalfError, match="released, or never kept"):
            half.restore(token)
        discarded = half.advance(2.0, 11.0, {}, ["y"])
        assert (discarded.status, discarded.message, discarded.dt_suggest) == (Status.DISCARD, "too long", 5.0)
        with pytest.raises(HalfError, match=r"(?s)half 'thermal': no block.*the log of the toy"):
            half.read(["nothing"])
        assert half.log_tail() == "nothing to say"
        pids = list(p.pids.values())
        assert int(half.read(["pid"])["pid"]) == p.pids["thermal"] != os.getpid()
    assert gone(pids)


def test_children_compute_on_one_thread_and_ignore_ctrl_c(fmu):
    with two(fmu) as p:
        for pid in p.pids.values():
            child = psutil.Process(pid)
            environment = child.environ()
            assert {environment[f"{k}_NUM_THREADS"] for k in ("OMP", "MKL", "OPENBLAS", "NUMBA")} == {"1"}
            child.send_signal(signal.SIGINT)
        assert p.halves["thermal"].advance(0.0, 1.0, {}, []).status is Status.OK


def test_the_coupler_asks_contact_through_the_same_session(fmu):
    with two(fmu) as p:
        link = open_link(p.contact_link)
        assert isinstance(link, ZenohLink)
        assert isinstance(link.ask(register()), Registered)
        assert link.ask(Project("surfaces-4", X)).xi_s.tobytes() == np.sin(X[:, 0]).tobytes()
        assert len(zenoh_session._sessions) == 1
        link.close()


@dataclass
class Ended:
    """How a run with trouble in it ended."""

    error: Exception
    seconds: float


def ended(fmu: Path, trouble: Callable[[Processes], object], **options: Any) -> Ended:
    """The error that trouble leads to, how long after it; no process may be left."""
    pids, started = [], 0.0
    try:
        with two(fmu, **options) as p:
            pids = list(p.pids.values())
            started = time.monotonic()
            trouble(p)
    except (HalfError, ServiceDownError) as exc:
        seconds = time.monotonic() - started
        assert gone(pids)
        return Ended(exc, seconds)
    raise AssertionError("nobody noticed")


@pytest.mark.few("mechanical", "contact")
@pytest.mark.parametrize("victim", ["thermal", "mechanical", "contact"])
def test_a_killed_child_is_named_soon_and_nobody_is_left(fmu, victim):
    def trouble(p: Processes) -> None:
        os.kill(p.pids[victim], signal.SIGKILL)
        for k in range(100):
            p.halves["thermal"].advance(float(k), 1.0, {}, ["y"])
            p.halves["mechanical"].advance(float(k), 1.0, {}, ["y"])

    end = ended(fmu, trouble)
    assert isinstance(end.error, ServiceDownError if victim == "contact" else HalfError)
    assert re.search(f"{victim}.*signal 9", str(end.error))
    assert end.seconds < SOON


def test_a_discard_does_not_hide_a_dead_contact_service(fmu):
    def trouble(p: Processes) -> None:
        os.kill(p.pids["contact"], signal.SIGKILL)
        time.sleep(0.1)
        p.halves["thermal"].advance(0.0, 11.0, {}, [])  # discarded, without contact being asked

    assert "contact service: its process was ended by signal 9" in str(ended(fmu, trouble).error)


def test_a_half_that_dies_in_mid_step_is_named_with_its_log(fmu):
    end = ended(fmu, lambda p: p.halves["thermal"].advance(0.0, 8.0, {}, []))
    assert re.search(r"(?s)half 'thermal'.*signal 9.*about to die", str(end.error))
    assert end.seconds < SOON


def test_a_death_is_noticed_while_another_half_works(fmu):
    def trouble(p: Processes) -> None:
        timer = threading.Timer(0.5, os.kill, (p.pids["mechanical"], signal.SIGKILL))
        timer.start()
        p.halves["thermal"].advance(0.0, 7.0, {}, [])  # would take a minute

    end = ended(fmu, trouble)
    assert re.search("half 'mechanical'.*signal 9", str(end.error))
    assert end.seconds < SOON


def test_a_stuck_half_is_named_at_its_deadline(fmu):
    def trouble(p: Processes) -> None:
        client = p.halves["thermal"].half._client
        assert client._deadline == 50.0
        client._deadline = 2.0  # shorter now that the start, which takes as long as the machine likes, is over
        p.halves["thermal"].advance(0.0, 7.0, {}, [])

    end = ended(fmu, trouble, call_deadline=50.0)
    assert re.search("half 'thermal'.*busy with Step for", str(end.error))
    assert 2.0 <= end.seconds < 2.0 + SOON


def test_an_endless_log_is_cut(fmu):
    with two(fmu) as p:
        half = p.halves["thermal"]
        for k in range(3):
            half.advance(5.0 * k, 5.0, {}, [])
        (log,) = Path(p.contact_link.split("unixsock-stream/")[1]).parents[1].glob("thermal.log")
        until = time.monotonic() + SOON
        while log.stat().st_size > LOG_MOST and time.monotonic() < until:
            half.half._client._watch()
        assert log.stat().st_size < LOG_MOST
        assert b"the log was cut here" in log.read_bytes()
        assert half.advance(15.0, 1.0, {}, []).status is Status.OK


def test_a_half_that_does_not_start_is_named(fmu, tmp_path):
    before = set(psutil.Process().children(recursive=True))
    with pytest.raises(HalfError, match=r"(?s)'b'.*code 1.*missing.fmu does not exist"), \
            processes({"a": fmu, "b": tmp_path / "missing.fmu"}, host=HOST, service=SERVICE):
        raise AssertionError("not reached")
    with pytest.raises(HalfError, match=r"'a': it was not ready in time"), \
            processes({"a": fmu}, host=IDLE, service=SERVICE, start_deadline=4.0):
        raise AssertionError("not reached")
    with pytest.raises(ServiceDownError, match=r"contact service: .*code 2"), \
            processes({"a": fmu}, host=HOST, service=[*SERVICE, "--nonsense"]):
        raise AssertionError("not reached")
    assert set(psutil.Process().children(recursive=True)) <= before


@pytest.mark.parametrize("name", ["contact", "", "a/b", "../x", "a b", "*"])
def test_wrong_names_are_refused(fmu, name):
    with pytest.raises(ValueError, match="cannot name a half"), processes({name: fmu}, host=HOST, service=SERVICE):
        raise AssertionError("not reached")


def test_a_program_that_is_not_there(tmp_path):
    with pytest.raises(ChildError, match="cannot be run"):
        start("x", ["/no/such/program"], tmp_path)


def test_nothing_is_left_in_the_temporary_directory(fmu, tmp_path, monkeypatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    def trouble(p: Processes) -> None:
        assert list(scratch.iterdir())
        raise HalfError("mine")

    assert str(ended(fmu, trouble).error) == "mine"
    assert not list(scratch.iterdir())


COUPLER = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from test_processes import two
with two(Path(sys.argv[2])) as p:
    print(*p.pids.values(), flush=True)
    if sys.argv[3] == "idle":
        time.sleep(60)
    p.halves["thermal"].advance(0.0, 7.0, {}, [])
"""


@contextmanager
def program(fmu: Path, doing: str) -> Iterator[subprocess.Popen[str]]:
    """A coupler in a process of its own, dead and its pipes closed in the end, whatever happened."""
    coupler = subprocess.Popen([sys.executable, "-c", COUPLER, str(HERE), str(fmu), doing], text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    with coupler:
        try:
            yield coupler
        finally:
            coupler.kill()


@pytest.mark.few("9-step")
@pytest.mark.parametrize("doing", ["idle", "step"])
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL, signal.SIGTERM])
def test_no_orphans_when_the_coupler_is_ended(fmu, how, doing):
    with program(fmu, doing) as coupler:
        assert coupler.stdout is not None
        pids = [int(word) for word in coupler.stdout.readline().split()]
        assert len(pids) == 3
        assert not gone(pids, 0.3)
        coupler.send_signal(how)
        _, err = coupler.communicate(timeout=SOON)
    assert coupler.returncode != 0
    assert how is not signal.SIGINT or "KeyboardInterrupt" in err
    assert gone(pids)


def test_no_orphans_when_ctrl_c_comes_while_they_start(fmu):
    with program(fmu, "idle") as coupler:
        me = psutil.Process(coupler.pid)
        children: list[psutil.Process] = []
        while len(children) < 2 and coupler.poll() is None:
            children = me.children()
            time.sleep(0.01)
        coupler.send_signal(signal.SIGINT)
        coupler.communicate(timeout=SOON)
    assert coupler.returncode != 0
    assert gone([c.pid for c in children])
