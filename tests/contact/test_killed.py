"""The service is killed in the middle of a traction with friction and multipliers: the same bits, or a named error."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from contact.messages import Refused, Registered, Request, Traction, Tractions
from contact.rpc.calls import ServiceDownError
from contact.rpc.client import ZenohLink
from contact.rpc.link import DirectLink, Link
from contact.rpc.seal import keep_secret
from contact.service import ContactService

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import flat, passes
from fake_contact import SECRET

PROGRAM = str(Path(__file__).parent / "stalling_contact.py")
STALLED = 3  # which traction


def service(flag: Path, number: int = STALLED, listen: str = "tcp/127.0.0.1:0") -> tuple[subprocess.Popen[bytes], str]:
    process = subprocess.Popen([sys.executable, PROGRAM, str(number), str(flag), "--listen", listen, "--run", "r",
                                "--child"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(SECRET.hex().encode() + b"\n")
    process.stdin.flush()
    keep_secret("r", SECRET)
    return process, process.stdout.readline().decode().split()[1]


def course(link: Link) -> list[bytes]:
    """Five tractions of a block dragged over another, each with the history the one before left."""
    register, x = flat(5, 7, gap=-1e-3)
    register = replace(register, passes=passes((0, 1), mu=0.3))
    known = link.ask(register)
    assert isinstance(known, Registered), known
    before, multipliers, mobilised = x, np.zeros(len(x)), (np.zeros(len(x)), np.zeros((0, 3)))
    bits, slipping = [], 0
    for _ in range(5):
        x = before.copy()
        x[:6] += 4e-4, -1e-4
        reply = link.ask(Traction(known.surfaces, x, multipliers, before, multipliers, *mobilised))
        assert isinstance(reply, Tractions), reply
        bits += [v.tobytes() for v in vars(reply).values() if isinstance(v, np.ndarray)]
        before, multipliers, mobilised = x, reply.multipliers, (reply.mobilised, reply.mobilised_at)
        slipping += reply.n_slipping
    assert multipliers.min() < 0.0 < np.abs(mobilised[1][:, 2]).max(), "nothing pressed or rubbed: nothing was compared"
    assert slipping
    return bits


def when_there(flag: Path, then: Callable[[], object]) -> threading.Thread:
    def wait() -> None:
        until = time.monotonic() + 60.0
        while not flag.exists() and time.monotonic() < until:
            time.sleep(0.01)
        then()

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


@pytest.mark.slow
def test_a_service_killed_in_a_traction_and_started_anew_gives_the_same_bits(tmp_path):
    first, endpoint = service(tmp_path / "flag")
    others = []

    def trouble() -> None:
        first.kill()
        first.communicate()
        others.append(service(tmp_path / "flag", 0, endpoint)[0])

    link = ZenohLink(endpoint, "r", deadline=60.0, grace=30.0)
    thread = when_there(tmp_path / "flag", trouble)
    try:
        assert course(link) == course(DirectLink(ContactService().handle))
        assert (tmp_path / "flag").exists(), "it was never killed"
        assert link._client.stats().verbs["Register"].count == 1  # with the next life too
    finally:
        thread.join()
        link.close()
        for process in others:
            process.communicate()


def test_a_service_killed_in_a_traction_is_down_within_its_grace(tmp_path):
    process, endpoint = service(tmp_path / "flag")
    link = ZenohLink(endpoint, "r", deadline=60.0, grace=0.3)
    killed = []
    thread = when_there(tmp_path / "flag", lambda: (killed.append(time.monotonic()), process.kill()))
    with pytest.raises(ServiceDownError):
        course(link)
    assert time.monotonic() - killed[0] < 30.0  # not the deadline
    thread.join()
    link.close()
    process.communicate()


@pytest.mark.parametrize("lives", [2, 1000])
def test_lives_that_are_lost_within_the_grace_of_the_first_are_made_up_for(lives):
    """As many as there are; what goes on dying is down when the grace since the first is over."""
    grace, lost, answer = 0.6, [], Refused("unknown_surfaces", "")

    def call(request: Request) -> Refused:
        if len(lost) == lives:
            return answer
        lost.append(time.monotonic())
        time.sleep(0.1)
        raise ServiceDownError("it is gone")

    link = object.__new__(ZenohLink)
    link._client, link._grace = SimpleNamespace(call=call, move=lambda patience: None), grace
    request = flat(2, 2, gap=0.0)[0]
    if lives == 2:
        assert link._call(request) is answer
    else:
        with pytest.raises(ServiceDownError):
            link._call(request)
        assert grace - 0.1 < time.monotonic() - lost[0] < 10.0 * grace
