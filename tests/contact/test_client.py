"""What the client makes of the answers to one call, without a network."""

from __future__ import annotations

import numpy as np
import pytest

from contact.codec import REPLIES, encode
from contact.messages import Project, Registered
from contact.rpc.calls import LinkProtocolError, LinkTimeoutError
from contact.rpc.client import Client
from contact.rpc.zenoh_session import QueryAnswer

TIMEOUT = QueryAnswer(ok=False, spoken=False, label="", payload=b"Timeout")
REQUEST = Project("s", np.zeros((1, 2)))


class Wire:
    """A session that gives prepared answers to the next call."""

    def __init__(self, *answers) -> None:
        self.answers = answers

    def ask(self, key, payload, label, timeout, watch):
        if key.endswith("status"):
            return [QueryAnswer(ok=True, spoken=True, label="", payload=b"idle")]
        return [a if isinstance(a, QueryAnswer) else QueryAnswer(True, True, label, encode(a)) for a in self.answers]


def call(*answers) -> object:
    return Client(Wire(*answers), "run", "contact", REPLIES, instance="one", deadline=1.0).call(REQUEST)


def test_the_answer_that_came_with_the_timeout_is_taken():
    for answers in [(Registered("a"),), (TIMEOUT, Registered("a")), (Registered("a"), TIMEOUT)]:
        assert call(*answers) == Registered("a")


def test_the_same_answer_twice_is_one():
    assert call(Registered("a"), Registered("a")) == Registered("a")


def test_a_timeout_said_twice_is_a_timeout():
    for answers in [(TIMEOUT,), (TIMEOUT, TIMEOUT)]:
        with pytest.raises(LinkTimeoutError, match="it is idle"):
            call(*answers)


def test_two_answers_are_refused():
    with pytest.raises(LinkProtocolError, match="2 answers to one call"):
        call(Registered("a"), Registered("b"))
