"""Who begins a run in a lobby, who ends it, and how long either end waits for the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

from contact.rpc.calls import LinkError
from contact.rpc.seal import SECRET_BYTES, Seal
from coupler.fmu import at_hosts, lobby
from coupler.fmu.at_hosts import OUT_OF_SIGHT, Away
from coupler.fmu.children import ChildError
from coupler.fmu.host import CONTACT_PATIENCE
from coupler.fmu.lobby import Lobby
from coupler.fmu.lobby_messages import LOBBY, Begin, Begun, End, proof_of
from coupler.fmu.processes import START_DEADLINE
from coupler.fmu.remote import Acknowledged, Text

SECRET, OTHER = bytes(range(SECRET_BYTES)), bytes(SECRET_BYTES)


def test_a_run_is_ended_by_who_began_it(monkeypatch):
    """Every coupler has the secret of the lobby: the run, and the proof that one has its secret, tell them apart."""
    ended = threading.Event()
    monkeypatch.setattr(lobby, "_end", lambda code: ended.set())
    asked = Lobby("")
    asked.answer(End("", ""))
    asked.answers.put(Begun("life"))
    assert asked.answer(Begin("one", SECRET, "")) == Begun("life")
    assert asked.answer(Begin("two", OTHER, "")) == Text("it serves run one already")
    for strange in (End("two", proof_of("two", OTHER)), End("one", proof_of("one", OTHER)), End("one", ""),
                    End("", "")):
        assert asked.answer(strange) == Acknowledged()
    assert not ended.wait(0.5)
    asked.answer(End("one", proof_of("one", SECRET)))
    assert ended.wait(5.0)


class Network:
    """Who is seen on it, and what they are told.  lives : asked with each look."""

    def __init__(self, lives: Callable[[], set[str]]) -> None:
        self.lives = lives

    def tokens(self, key: str, watch: Callable[[], None]) -> set[str]:
        return {key.replace("*", life) for life in self.lives()}


class Told:
    """What the coupler says to a life, in place of contact.rpc.client.Client."""

    said: list[tuple[str, object]]
    answer: object

    def __init__(self, session: object, seal: object, role: str, replies: object, *, instance: str,
                 deadline: float) -> None:
        self.life = instance

    def call(self, what: object) -> object:
        self.said.append((self.life, what))
        return self.answer


@pytest.fixture
def told(monkeypatch):
    Told.said, Told.answer = [], Begun("x")
    monkeypatch.setattr(at_hosts, "Client", Told)
    return Told


OVER, BEGIN = End("one", proof_of("one", SECRET)), Begin("one", SECRET, "")


def test_who_was_let_go_is_waited_out_and_told_again(told):
    """The life that ends is seen for a while: it serves the run already, and would refuse to begin it again."""
    seal, left = Seal(LOBBY, SECRET), set()
    first, second = seal.instance("thermal"), seal.instance("thermal")
    looks = iter([{first}, {first}, {first}, set(), {second}])
    network = Network(lambda: next(looks))
    away = Away("thermal", "tls/there:1", network, seal, OVER, left)
    away.begin(away.enter(time.monotonic() + 5.0, lambda: None), BEGIN)
    away.end()
    again = Away("thermal", "tls/there:1", network, seal, OVER, left)
    assert again.enter(time.monotonic() + 5.0, lambda: None).life == second
    assert told.said == [(first, BEGIN), (first, OVER), (first, OVER), (first, OVER)]


@pytest.mark.parametrize(("answer", "ends"), [(Begun("x"), 1), (Text("it serves run two already"), 0)])
def test_a_run_that_was_refused_is_not_ended(told, answer, ends):
    seal = Seal(LOBBY, SECRET)
    life = seal.instance("thermal")
    away = Away("thermal", "tls/there:1", Network(lambda: {life}), seal, OVER)
    away.end()
    client = away.enter(time.monotonic() + 5.0, lambda: None)
    away.end()
    assert told.said == []
    told.answer = answer
    if ends:
        away.begin(client, BEGIN)
    else:
        with pytest.raises(ChildError, match="it serves run two already"):
            away.begin(client, BEGIN)
    away.end()
    assert told.said.count((life, OVER)) == ends


@pytest.mark.parametrize(("period", "dead"), [(OUT_OF_SIGHT + 40.0, False), (2.0, True)])
def test_a_coupler_that_was_stopped_does_not_blame_the_machines(told, monkeypatch, period, dead):
    """The first look after Ctrl-Z finds nobody: the network has to come back.  Looks that find nobody do count."""
    now = [1000.0]
    monkeypatch.setattr(at_hosts.time, "monotonic", lambda: now[0])
    seal = Seal(LOBBY, SECRET)
    life = seal.instance("thermal")
    seen = [{life}]
    away = Away("thermal", "tls/there:1", Network(lambda: seen[0]), seal, OVER)
    away.enter(now[0] + 5.0, lambda: None)
    seen[0] = set()
    for _ in range(1 if period > OUT_OF_SIGHT else round(OUT_OF_SIGHT / period) + 1):
        now[0] += period
        death = away.death()
    assert bool(death) == dead
    if not dead:
        for _ in range(round(OUT_OF_SIGHT / 2.0) + 1):
            now[0] += 2.0
            death = away.death()
        assert death == f"nothing was heard of tls/there:1 for {OUT_OF_SIGHT:g} s"


def test_a_network_that_is_lost_for_a_while_does_not_end_the_watch(monkeypatch):
    """A host whose look at its coupler failed once goes on looking: it ends in the end where that is gone."""
    looks = 0

    class EndedError(Exception):
        pass

    def end(code: int) -> None:
        assert code == 3
        raise EndedError

    def lives() -> set[str]:
        nonlocal looks
        looks += 1
        raise LinkError("no network")

    monkeypatch.setattr(lobby, "_end", end)
    monkeypatch.setattr(lobby, "OWNER_PERIOD", 0.05)
    with pytest.raises(EndedError):
        lobby._watch_owner(Network(lives), Seal("one", SECRET), 0.3)
    assert looks > 3


def test_a_half_waits_for_a_contact_service_that_is_started_anew_elsewhere():
    """As long as it takes to see that a machine is gone, and to start another."""
    assert CONTACT_PATIENCE > OUT_OF_SIGHT + START_DEADLINE
