"""Somebody without the secret of a run does what was once possible; the run goes on as if nobody had."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import pytest

from contact.messages import Project
from contact.rpc.client import Client
from contact.rpc.seal import seal_of
from contact.rpc.server import REFUSED
from coupler.errors import HalfError
from coupler.fmu.half import Advance
from coupler.fmu.host import Hosted
from coupler.fmu.processes import Processes
from coupler.fmu.remote import ANSWERS, Acknowledged, Describe, Failed, Initialise, Restore, Save, Step

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from fake_host import Toy  # noqa: E402
from test_processes import X, facing, two  # noqa: E402

TCP = "tcp/127.0.0.1:0"
GAP = facing(Project("", X)).node_gap


@pytest.fixture(params=["socket", "tcp"])
def run(request, tmp_path, monkeypatch) -> Iterator[Processes]:
    """Two toy halves after their first step; on TCP they can be reached by every user of the machine."""
    if request.param == "tcp":
        monkeypatch.setattr("coupler.fmu.processes.socket_in", lambda folder, name: TCP)
    (tmp_path / "toy.fmu").touch()
    with two(tmp_path / "toy.fmu") as p:
        p.halves["thermal"].advance(0.0, 1.0, {}, ["y"])
        yield p


def endpoints(p: Processes) -> list[str]:
    """Where the processes of a run can be reached."""
    found = set()
    for pid in p.pids.values():
        process = psutil.Process(pid)
        found |= {f"tcp/127.0.0.1:{c.laddr.port}" for c in process.net_connections("tcp") if c.status == "LISTEN"}
        found |= {f"unixsock-stream/{c.laddr}" for c in process.net_connections("unix") if c.laddr}
    assert len(found) == 3
    return sorted(found)


@contextmanager
def stranger(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen([sys.executable, str(HERE / "stranger.py"), *arguments], text=True, stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            process.kill()


def undisturbed(p: Processes, steps: int = 3) -> None:
    """The halves are where they were, and go on from there with the right numbers."""
    half = p.halves["thermal"]
    np.testing.assert_array_equal(half.read(["y"])["y"], GAP)
    for k in range(1, steps):
        np.testing.assert_array_equal(half.advance(float(k), 1.0, {}, ["y"]).outputs["y"], (k + 1) * GAP)
    p.halves["mechanical"].advance(0.0, 1.0, {}, ["y"])


@pytest.mark.few("tcp")
def test_a_stranger_learns_nothing_and_changes_nothing(run):
    with stranger(*endpoints(run)) as process:
        got = json.loads(process.communicate(timeout=60)[0])
    assert got["roles"], "it reached nobody: nothing was tried"
    assert not any("half" in role or "contact" in role for role in got["roles"])
    for what in ("read", "state", "step", "close"):
        assert got[what], what
        assert set(got[what]) == {"unsigned: this is not signed with the secret of the run"}, what
    undisturbed(run)
    assert run.asked()[REFUSED]["count"] > 0


@pytest.mark.few("tcp")
def test_who_answers_in_the_place_of_a_half_is_not_believed(run):
    with stranger("--in-their-place", *endpoints(run)) as process:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["tokens"], "it reached nobody: nothing was tried"
        undisturbed(run, steps=8)


@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="another user is needed to be one")
def test_another_user_does_not_reach_the_sockets(tmp_path):
    (tmp_path / "toy.fmu").touch()
    with two(tmp_path / "toy.fmu") as p:
        (path, *_) = [e.removeprefix("unixsock-stream/") for e in endpoints(p)]
        child = os.fork()
        if child == 0:  # no Python of a virtual environment: another user may not be allowed to read one
            import socket
            os.setgid(65534)
            os.setuid(65534)
            try:
                socket.socket(socket.AF_UNIX).connect(path)
            except PermissionError:
                os._exit(7)
            os._exit(8)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


@pytest.mark.few("tcp")
def test_a_half_serves_one_owner(run):
    half = run.halves["thermal"]
    session, instance = half.half._client._session, half.half._client._instance
    second = Client(session, seal_of(half.half._client._run), "half-thermal", ANSWERS, instance=instance)
    with pytest.raises(Exception, match="not_owner: this serves"):
        second.call(Describe())
    undisturbed(run)


@pytest.mark.few("socket")
def test_the_secret_is_in_no_command_line_environment_or_file(run):
    run_name = run.contact_link.rpartition("/")[2]
    seal = seal_of(run_name)
    assert seal.signed("x", b"", seal.sign("x", b""))
    folder = next(Path(c.laddr).parent for c in psutil.Process(run.pids["thermal"]).net_connections("unix")
                  if c.laddr) if "unixsock" in run.contact_link else None
    for pid in run.pids.values():
        process = psutil.Process(pid)
        words = [*process.cmdline(), *process.environ().values()]
        assert not any(is_secret(seal, word) for word in words)
    if folder is not None:
        assert folder.stat().st_mode & 0o777 == 0o700
        files = [f for f in folder.rglob("*") if f.is_file()]
        assert files
        assert not any(is_secret(seal, word) for f in files for word in f.read_text(errors="replace").split())


def is_secret(seal, word: str) -> bool:
    """Whether a word holds the 64 hexadecimal digits with which this seal signs."""
    from contact.rpc.seal import Seal

    return any(Seal(seal.run, bytes.fromhex(word[i:i + 64])).sign("x", b"") == seal.sign("x", b"")
               for i in range(len(word) - 63) if set(word[i:i + 64]) <= set("0123456789abcdef"))


@pytest.mark.few("socket")
def test_a_step_from_another_time_is_refused(run):
    half = run.halves["thermal"]
    for t in (0.0, 2.0, 1.0 + 1e-9):
        with pytest.raises(HalfError, match=r"was asked for a step from t = .* and is at t = 1.0 s"):
            half.advance(t, 1.0, {}, ["y"])
    undisturbed(run)


def test_a_half_knows_the_time_of_the_state_it_has():
    hosted = Hosted(Toy("toy"))

    def steps(t: float, h: float) -> bool:
        return isinstance(hosted.answer(Step(t, h, {}, ())), Advance)

    assert not isinstance(hosted.answer(Initialise(5.0, 9.0, {}, {"x": X}, ())), Failed)
    hosted.half.link.ask = lambda request: facing(Project("", X))
    assert [steps(0.0, 1.0), steps(5.0, 0.1), steps(5.1, 0.1)] == [False, True, True]
    assert hosted.answer(Save(1)) == Acknowledged()
    assert [steps(5.1 + 0.1, 11.0), steps(5.2, 0.3), steps(5.2, 0.3)] == [True, True, False]  # a discard moves nothing
    hosted.answer(Restore(1))
    assert [steps(5.5, 0.1), steps(5.2, 0.1)] == [False, True]
