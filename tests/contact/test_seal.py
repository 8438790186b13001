"""The secret of a run: who has it is let in, and no other; no bit of a message may change on the way."""

from __future__ import annotations

import re

import numpy as np
import pytest

from contact.codec import REQUESTS, encode
from contact.messages import Project, Registered
from contact.rpc.calls import Answered, Envelope, LinkSpecError
from contact.rpc.client import Client
from contact.rpc.seal import Seal, forget_secret, keep_secret, seal_of, secret_line
from contact.rpc.server import REFUSED, Server, answer_label, question_label
from contact.rpc.zenoh_session import QueryAnswer

SECRET = bytes(range(32))
SEAL = Seal("r", SECRET)
STRANGE = [Seal("r", SECRET[:-1] + b"\x00"), Seal("s", SECRET)]  # another secret, and another run of the same


class Question:
    def __init__(self, label: str, payload: bytes) -> None:
        self.label, self.payload = label, payload
        self.said: list[tuple[str, bytes]] = []

    def answer(self, key, label, payload):
        self.said.append((label, payload))


class Network:
    """A session that carries nothing: what was declared on it is asked by hand."""

    def __init__(self) -> None:
        self.doors = {}

    def answer(self, key, arrived):
        self.doors[key.rpartition("/")[2]] = arrived, key

    def show_token(self, key):
        self.token = key


@pytest.fixture
def network() -> Network:
    network = Network()
    network.server = Server(network, SEAL, "contact", REQUESTS)
    return network


def asked(network, verb="ask", number=1, attempt=1, payload=b"", seal=SEAL, instance="", client="me"):
    """What comes of a question: the label and the words of its answer, or nothing where it waits for the worker."""
    arrived, key = network.doors[verb]
    envelope = Envelope(instance or network.server.instance, client, number, attempt)
    question = Question(question_label(seal, key, envelope, payload), payload)
    arrived(question)
    return question


def waiting(network) -> int:
    return network.server._calls.queue.qsize()


def test_who_has_the_secret_is_let_in_and_no_other(network):
    asked(network)
    assert waiting(network) == 1
    for number, stranger in enumerate(STRANGE, 2):
        (said,) = asked(network, number=number, seal=stranger).said
        assert said == ("", b"unsigned: this is not signed with the secret of the run")
    assert waiting(network) == 1
    assert network.server.stats.so_far().verbs[REFUSED].count == 2


@pytest.mark.parametrize("verb", ["ask", "status", "stats"])
def test_what_was_heard_is_refused_without_a_signature(network, verb):
    asked(network, verb, 1, 1)
    asked(network, verb, 3, 1)
    for number, attempt in ((3, 1), (1, 1), (2, 1), (1, 7)):  # a replay, and what was overtaken
        (said,) = asked(network, verb, number, attempt).said
        assert said[0] == ""
        assert said[1].startswith(b"replayed")
    assert not asked(network, verb, 4, client="you").said or verb != "ask"


@pytest.mark.parametrize("verb", ["status", "stats"])
def test_nobody_else_is_told_what_it_does(network, verb):
    (said,) = asked(network, verb).said
    assert re.fullmatch(rf"{network.server.instance}/me/1/1/ok/[0-9a-f]{{64}}", said[0])
    assert asked(network, verb, 2, seal=STRANGE[0]).said[0][1].startswith(b"unsigned")


def test_a_message_for_another_key_life_or_way_is_none(network):
    arrived, key = network.doors["ask"]
    _, other = network.doors["status"]
    envelope = Envelope(network.server.instance, "me", 1)
    answer = answer_label(SEAL, key, envelope, Answered(True, b"x")).replace("/ok/", "/")
    for label in (question_label(SEAL, other, envelope, b"x"), answer, str(envelope), "", "/", str(envelope) + "/"):
        question = Question(label, b"x")
        arrived(question)
        assert question.said[0][1].startswith(b"unsigned"), label
    assert asked(network, instance=SEAL.instance("contact")).said[0][1].startswith(b"wrong_instance")
    assert waiting(network) == 0


def flips(data: bytes):
    for i in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[i // 8] ^= 1 << i % 8
        yield bytes(flipped)


def test_no_flipped_bit_of_a_question_is_let_in(network):
    arrived, key = network.doors["ask"]
    payload = encode(Project("surfaces", np.arange(6.0).reshape(3, 2)))
    label = question_label(SEAL, key, Envelope(network.server.instance, "me", 1), payload)
    tried = [(label, p) for p in flips(payload)]
    tried += [(flipped.decode("latin-1"), payload) for flipped in flips(label.encode())]
    for changed in tried:
        question = Question(*changed)
        arrived(question)
        assert question.said, changed
    assert len(tried) == 8 * (len(payload) + len(label)) > 2000
    assert waiting(network) == 0
    arrived(Question(label, payload))
    assert waiting(network) == 1


def test_no_flipped_bit_of_an_answer_is_believed():
    instance = SEAL.instance("contact")
    payload = encode(Registered("surfaces"))
    believed = []

    class Wire:
        at = 0.0

        def ask(self, key, _, label, timeout):
            self.key, self.label = key, label
            return self

        def answers(self, watch, taken):
            key, label = self.key, self.label
            true = answer_label(SEAL, key, Envelope(*label.split("/")[:2], 1, 1), Answered(True, payload))
            tried = [QueryAnswer(True, true, p) for p in flips(payload)]
            tried += [QueryAnswer(True, flipped.decode("latin-1"), payload) for flipped in flips(true.encode())]
            believed.extend(answer for answer in tried if taken(answer))
            assert len(tried) > 2000
            assert taken(QueryAnswer(True, true, payload))

    client = Client(Wire(), SEAL, "contact", {"Registered": Registered}, instance=instance)
    assert client.call(Registered("x")) == Registered("surfaces")
    assert believed == []


def test_names_on_the_network_tell_nothing_and_prove_the_secret():
    role = SEAL.name("half-thermal")
    assert re.fullmatch("[0-9a-f]{24}", role)
    assert len({role, SEAL.name("contact"), *(s.name("half-thermal") for s in STRANGE)}) == 4
    life = SEAL.instance("contact")
    assert SEAL.made("contact", life)
    assert life != SEAL.instance("contact")
    for false in (STRANGE[0].instance("contact"), SEAL.instance("half-thermal"), "", f"{'0' * 16}-{'0' * 24}",
                  life[:-1], life[1:], life.upper(), f"{life}\n"):
        assert not SEAL.made("contact", false), false


def test_a_process_that_was_not_given_the_secret_says_so():
    with pytest.raises(LinkSpecError, match="the secret of run 'nobody' was not given to this process"):
        seal_of("nobody")
    assert keep_secret("somebody", SECRET) is seal_of("somebody")
    forget_secret("somebody")
    with pytest.raises(LinkSpecError):
        seal_of("somebody")


def test_a_secret_on_standard_input_is_whole():
    assert secret_line(SECRET.hex() + "\n") == SECRET
    for line in ("", "ready", SECRET.hex()[:-2], SECRET.hex() + "00", "zz" * 32):
        with pytest.raises(LinkSpecError, match="not a secret of 64 hexadecimal digits") as told:
            secret_line(line)
        assert not line or line not in str(told.value)
    with pytest.raises(LinkSpecError, match="32 bytes, not 3"):
        Seal("r", b"abc")
