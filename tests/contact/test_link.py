"""The ways to the contact service agree to the bit, and a server carries each call out once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from contact.messages import Project, Refused, Registered
from contact.rpc.calls import (
    CAPACITY,
    KEEP_ANSWERS,
    KEEP_CLIENTS,
    Answered,
    CallQueue,
    Envelope,
    Heard,
    LinkProtocolError,
    LinkSpecError,
    parse_envelope,
)
from contact.rpc.link import CodecLink, DirectLink, open_link

sys.path.insert(0, str(Path(__file__).parent))
from fake_contact import FakeContact, register

X = np.random.default_rng(3).random((4, 2))


def test_codec_and_direct_agree():
    for link in (DirectLink(FakeContact().handle), CodecLink(FakeContact().handle)):
        assert link.ask(register()) == Registered("surfaces-4")
        facing = link.ask(Project("surfaces-4", X))
        assert facing.xi_s.tobytes() == np.sin(X[:, 0]).tobytes()
        assert isinstance(link.ask(Project("other", X)), Refused)
        link.close()


def test_codec_link_does_not_alias():
    held = []

    def keep(request):
        held.append(request.x)
        return Registered("")

    CodecLink(keep).ask(Project("s", X))
    assert not np.shares_memory(held[0], X)


def test_codec_link_refuses_what_cannot_be_sent():
    with pytest.raises(LinkProtocolError, match="float64 was expected"):
        CodecLink(FakeContact().handle).ask(Project("s", X.astype(np.float32)))


@pytest.mark.parametrize("spec", [
    "", "Direct", "tcp/127.0.0.1:1", "zenoh:", "zenoh:tcp/127.0.0.1:7447", "zenoh:tcp/192.168.0.1:7447/r",
    "zenoh:tcp/0.0.0.0:7447/r", "zenoh:tcp/[::]:7447/r", "zenoh:udp/127.0.0.1:7447/r", "zenoh:tcp/127.0.0.1:99999/r",
    "zenoh:tcp/127.0.0.1.example.org:7447/r", "zenoh:tcp/127.0.0.1:7447#iface=eth0/r", "zenoh:tcp/127.0.0.1:7447/a*"])
def test_wrong_specs_are_refused(spec):
    with pytest.raises(LinkSpecError):
        open_link(spec)


def test_embedded_use_does_not_load_zenoh():
    code = "import sys, contact.rpc.link; assert 'zenoh' not in sys.modules, 'loaded'"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=240)


OK = Answered(True, b"yes")


def test_a_repeated_call_is_carried_out_once():
    calls: CallQueue[str] = CallQueue("i")
    assert calls.arrive(Envelope("i", "me", 1), b"x", "first") is None
    assert calls.arrive(Envelope("i", "me", 1, 2), b"x", "again") is None
    call = calls.queue.get_nowait()
    assert call is not None
    assert calls.queue.empty()
    assert calls.finish(call, OK) == ["first", "again"]
    assert calls.arrive(Envelope("i", "me", 1, 3), b"x", "late") == OK
    assert calls.queue.empty()


def test_forgotten_foreign_and_garbled_calls_are_refused():
    calls: CallQueue[int] = CallQueue("i")
    for n in range(1, KEEP_ANSWERS + 3):
        assert calls.arrive(Envelope("i", "me", n), b"", n) is None
        calls.finish(calls.queue.get_nowait(), OK)
    assert calls.arrive(Envelope("i", "me", 1, 2), b"", 0).payload.startswith(b"stale")
    assert calls.arrive(Envelope("i", "you", 1), b"", 0) is None


def test_an_envelope_is_one_or_none():
    envelope = Envelope("i", "me", 7, 2)
    assert parse_envelope(str(envelope)) == envelope
    for text in ("", "i/me", "i/me/1", "i/me/-1/1", "i/me/x/1", "i/m e/1/1", f"i/me/{10**40}/1", "i/me/0/1", "i/me/1/0",
                 "i/me/1/1/", "i/me/01/1", f"{'i' * 65}/me/1/1", "i/me/1/\u0661"):
        assert parse_envelope(text) is None, text


def test_what_was_heard_of_a_client_is_never_new_again():
    heard = Heard()
    said = [(1, 1), (1, 2), (2, 1), (2, 1), (1, 3), (2, 3), (2, 2), (3, 1)]
    assert [heard.is_new(Envelope("i", "me", *message)) for message in said] == [
        True, True, True, False, False, True, False, True]
    assert heard.is_new(Envelope("i", "you", 1, 1))


def test_one_owner_is_the_first_who_calls():
    calls: CallQueue[int] = CallQueue("i", one_owner=True)
    assert calls.arrive(Envelope("i", "me", 1), b"", 0) is None
    assert calls.arrive(Envelope("i", "you", 1), b"", 0).payload.startswith(b"not_owner: this serves me alone")
    assert calls.arrive(Envelope("i", "me", 2), b"", 0) is None


def test_a_flood_is_told_to_wait_and_memory_is_bounded():
    calls: CallQueue[int] = CallQueue("i")
    for n in range(CAPACITY):
        assert calls.arrive(Envelope("i", f"c{n}", 1), b"", n) is None
    assert calls.arrive(Envelope("i", "late", 1), b"", 0).payload.startswith(b"busy")
    for _ in range(CAPACITY):
        calls.finish(calls.queue.get_nowait(), OK)
    assert calls.arrive(Envelope("i", "late", 1), b"", 0) is None
    for n in range(3 * KEEP_CLIENTS):
        calls.arrive(Envelope("i", f"d{n}", 1), b"", n)
        while not calls.queue.empty():
            calls.finish(calls.queue.get_nowait(), OK)
    assert len(calls._clients) <= KEEP_CLIENTS
