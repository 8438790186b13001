"""What a server says of what it was asked, and what is not done twice: headers made, ends of answers waited for."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from contact.codec import encode
from contact.messages import Project
from contact.records import WireError, decode_record, encode_record
from contact.rpc.calls import RECENT, CallStats, LinkProtocolError, Verb, lines
from contact.rpc.client import ZenohLink
from contact.rpc.seal import keep_secret
from contact.rpc.zenoh_session import close_session, open_session

sys.path.insert(0, str(Path(__file__).parent))
from fake_contact import BUG, SECRET, register

FAKE = str(Path(__file__).parent / "fake_contact.py")


def test_counts_sums_and_the_longest():
    stats = CallStats()
    for seconds in (1.0, 5.0, 3.0):
        stats.add("Project", seconds, 10, 100)
    stats.add("Register", 2.0, 7, 0)
    told = stats.so_far()
    assert dict(told.verbs) == {"Project": Verb(3, 9.0, 3.0, 5.0, 30, 300), "Register": Verb(1, 2.0, 2.0, 2.0, 7, 0)}
    assert lines(told)[0] == "Project: 3 calls, 9 s (median 3 s, most 5 s), 30 bytes in, 300 bytes out"


def test_the_median_is_of_recent_calls_and_memory_is_bounded():
    stats = CallStats()
    for _ in range(RECENT):
        stats.add("a", 1.0, 0, 0)
    for _ in range(RECENT):
        stats.add("a", 2.0, 0, 0)
    assert stats.so_far().verbs["a"].typical == 2.0
    assert len(stats._counts["a"].recent) == RECENT


def test_a_service_tells_its_client_and_its_log():
    process = subprocess.Popen([sys.executable, FAKE, "--run", "r", "--child"], stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(SECRET.hex().encode() + b"\n")
    process.stdin.flush()
    keep_secret("r", SECRET)
    link = ZenohLink(process.stdout.readline().decode().split()[1], "r")
    requests = [Project("surfaces-4", np.full((4, 2), float(i))) for i in range(3)]
    for request in (register(), *requests):
        link.ask(request)
    with pytest.raises(LinkProtocolError, match="planted"):
        link.ask(Project("surfaces-4", np.full((4, 2), BUG)))
    verbs = link._client.stats().verbs
    assert {name: v.count for name, v in verbs.items()} == {"Register": 1, "Project": 4}
    assert verbs["Project"].bytes_in == 4 * len(encode(requests[0]))
    assert 0.0 < verbs["Project"].typical <= verbs["Project"].most <= verbs["Project"].total
    link.close()
    _, err = process.communicate(timeout=60)  # its parent is gone
    assert b"Register: 1 calls" in err
    assert err.count(b"Project: 4 calls") == 1


def test_a_header_seen_before_is_not_taken_for_another():
    """Short headers are made and checked once: same shapes and other values, other shapes, a body cut short."""
    first = encode_record("r", {"n": 1}, {"a": np.arange(3.0)})
    assert decode_record(first)[2]["a"].tolist() == [0.0, 1.0, 2.0]
    second = encode_record("r", {"n": 2}, {"a": np.arange(3.0) + 1.0})
    name, meta, arrays = decode_record(second)
    assert (name, meta, arrays["a"].tolist()) == ("r", {"n": 2}, [1.0, 2.0, 3.0])
    assert decode_record(encode_record("r", {"n": 1}, {"a": np.arange(4.0)}))[2]["a"].shape == (4,)
    assert decode_record(encode_record("r", {"n": 1}, {"a": np.arange(3)}))[2]["a"].dtype == np.int64
    meta["n"] = 3
    assert decode_record(second)[1] == {"n": 2}
    for data in (first[:-64], first + bytes(64)):
        with pytest.raises(WireError, match="bytes of arrays where its header says 64"):
            decode_record(data)
    damaged = bytearray(first)
    damaged[8] ^= 1  # the checksum, of a header that is known
    with pytest.raises(WireError, match="damaged"):
        decode_record(bytes(damaged))


def test_an_answer_is_taken_before_the_question_is_over():
    """zenoh says later that nothing more comes; here the question is kept open, and nobody says so."""
    session, kept = open_session(listen=("tcp/127.0.0.1:0",)), []

    def arrived(question):
        kept.append(question)
        question._query.reply("slideline/t/open", b"yes", attachment=question.label)

    declared = session.answer("slideline/t/open", arrived)
    started = time.monotonic()
    answers = session.ask("slideline/t/open", b"", "me", 60.0).answers(lambda: None, lambda answer: answer.spoken)
    assert [(a.spoken, a.label, a.payload) for a in answers] == [(True, "me", b"yes")]
    assert time.monotonic() - started < 30.0
    kept.clear()
    declared.undeclare()
    close_session(session)
