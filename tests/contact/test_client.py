"""What the client makes of the answers to one call, without a network."""

from __future__ import annotations

import numpy as np
import pytest

from contact.codec import REPLIES, encode
from contact.messages import Project, Registered
from contact.rpc.calls import (
    Answered,
    LinkProtocolError,
    LinkTimeoutError,
    ServiceDownError,
    failure,
    parse_envelope,
)
from contact.rpc.client import Client
from contact.rpc.seal import Seal
from contact.rpc.server import answer_label
from contact.rpc.zenoh_session import QueryAnswer

TIMEOUT = QueryAnswer(spoken=False, label="", payload=b"Timeout")
REQUEST = Project("s", np.zeros((1, 2)))
SEAL = Seal("run", bytes(32))
ONE = SEAL.instance("contact")


class Asked:
    """A question whose answers are told by a function of a watch and of what is taken."""

    at = 0.0

    def __init__(self, answers) -> None:
        self.answers = answers


class Wire:
    """A session that gives prepared answers to the next call, signed by one who has the secret, or by another."""

    def __init__(self, *answers, seal: Seal = SEAL) -> None:
        self.answers, self.seal = answers, seal

    def ask(self, key, payload, label, timeout):
        return Asked(lambda watch, taken: self.told(key, label, timeout, watch, taken))

    def told(self, key, label, timeout, watch, taken):
        envelope = parse_envelope(label.rpartition("/")[0])
        given = [Answered(True, b"idle")] if key.endswith("status") else self.answers
        said = []
        for one in given:
            if not isinstance(one, QueryAnswer):
                answered = one if isinstance(one, Answered) else Answered(True, encode(one))
                one = QueryAnswer(True, answer_label(self.seal, key, envelope, answered), answered.payload)
            said.append(one)
            if taken(one):
                break
        return said

    def tokens(self, key, watch):
        return {key.replace("*", ONE)}


def call(*answers, **how) -> object:
    return Client(Wire(*answers, **how), SEAL, "contact", REPLIES, instance=ONE, deadline=1.0).call(REQUEST)


def test_the_answer_that_came_with_the_timeout_is_taken():
    for answers in [(Registered("a"),), (TIMEOUT, Registered("a")), (Registered("a"), TIMEOUT)]:
        assert call(*answers) == Registered("a")


def test_a_timeout_said_twice_is_a_timeout():
    for answers in [(TIMEOUT,), (TIMEOUT, TIMEOUT)]:
        with pytest.raises(LinkTimeoutError, match="it is idle"):
            call(*answers)


def test_a_call_repeated_is_a_new_message():
    """What was heard once is refused: the same bytes again would never be answered."""
    attempts = []

    class Deaf(Wire):
        def told(self, key, label, timeout, watch, taken):
            attempts.append(parse_envelope(label.rpartition("/")[0]).attempt)
            return super().told(key, label, timeout, watch, taken) if len(attempts) == 3 else []

    assert Client(Deaf(Registered("a")), SEAL, "contact", REPLIES, instance=ONE).call(REQUEST) == Registered("a")
    assert attempts == [1, 2, 3]


def test_who_was_stopped_himself_waits_on(monkeypatch):
    """Ctrl-Z, and `fg` after the deadline: the clock went on, and the other side is not late."""
    clock = [100.0]
    monkeypatch.setattr("contact.rpc.client.time.monotonic", lambda: clock[0])
    monkeypatch.setattr("contact.rpc.client.time.sleep", lambda s: None)
    asked = []

    class Slow(Wire):
        def told(self, key, label, timeout, watch, taken):
            asked.append(timeout)
            clock[0] += 0.25
            watch()
            if len(asked) == 1:
                clock[0] += 500.0  # stopped
                taken(TIMEOUT)
                return [TIMEOUT]
            return super().told(key, label, timeout, watch, taken)

    assert Client(Slow(Registered("a")), SEAL, "contact", REPLIES, instance=ONE, deadline=9.0).call(REQUEST) == (
        Registered("a"))
    assert asked == [9.0, 8.75]


def test_who_looks_after_the_deadline_may_ask_again(monkeypatch):
    """The answer was lost while something else was waited for: the server knows the call, and says it again."""
    clock, told = [100.0], []
    monkeypatch.setattr("contact.rpc.client.time.monotonic", lambda: clock[0])
    monkeypatch.setattr("contact.rpc.client.time.sleep", lambda s: None)

    class Lost(Wire):
        def told(self, key, label, timeout, watch, taken):
            told.append(timeout)
            return super().told(key, label, timeout, watch, taken) if len(told) == 2 else []

    client = Client(Lost(Registered("a")), SEAL, "contact", REPLIES, instance=ONE, deadline=9.0)
    begun = client.begin(REQUEST)
    clock[0] += 500.0
    assert client.answer(begun) == Registered("a")
    assert len(told) == 2


def test_who_waits_for_one_that_is_gone_is_told(monkeypatch):
    """The network lost the server, and does not say so."""
    clock, waited = [100.0], []
    monkeypatch.setattr("contact.rpc.client.time.monotonic", lambda: clock[0])
    monkeypatch.setattr("contact.rpc.client.time.sleep", lambda s: None)

    class Gone(Wire):
        def told(self, key, label, timeout, watch, taken):
            until = clock[0] + timeout
            while clock[0] < until:
                clock[0] += 0.25
                waited.append(0.25)
                watch()
            return []

        def tokens(self, key, watch):
            return set()

    with pytest.raises(ServiceDownError, match="contact is gone"):
        Client(Gone(), SEAL, "contact", REPLIES, instance=ONE, deadline=300.0).call(REQUEST)
    assert 5.0 < sum(waited) < 6.0
    waited.clear()
    with pytest.raises(LinkTimeoutError):
        Client(Gone(), SEAL, "contact", REPLIES, instance=ONE, deadline=30.0, lives=lambda: True).call(REQUEST)


def test_a_signed_refusal_is_told():
    with pytest.raises(LinkProtocolError, match="not_owner: this serves another"):
        call(failure("not_owner", "this serves another"))


def test_what_is_not_signed_is_no_answer():
    lie = QueryAnswer(True, "", encode(Registered("lie")))
    assert call(lie, Registered("a")) == Registered("a")
    for answers, how in [((lie,), {}), ((Registered("lie"),), {"seal": Seal("run", bytes(31) + b"1")}),
                         ((Registered("lie"),), {"seal": Seal("other", bytes(32))})]:
        with pytest.raises(LinkProtocolError, match="whoever answers has not the secret of run run"):
            call(*answers, **how)
