"""A half that lost its process, or contact, in the middle of a call: it goes on from where it was."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from coupler.errors import HalfError
from coupler.fmu.half import Advance, Status
from coupler.fmu.processes import _Crew
from coupler.fmu.remote import Described, RemoteHalf
from coupler.fmu.replayed import ReplayedHalf


class Counter:
    """A half whose state is the number of its steps.  dies : at its next restore."""

    name, blocks, strings, can_save, can_serialise = "counter", {}, {}, True, True

    def __init__(self) -> None:
        self.n, self.kept, self.dies = 0, [], False

    def initialise(self, *of):
        return {}

    def advance(self, t, h, inputs, outputs):
        self.n += 1
        return Advance(Status.OK, "", {"n": np.array(float(self.n))}, 0.0)

    def read(self, names, finite=True):
        return {"n": np.array(float(self.n))}

    def save(self):
        self.kept.append(self.n)
        return len(self.kept) - 1

    def restore(self, token):
        if self.dies:
            raise HalfError("it died", half="counter")
        self.n = self.kept[token]

    def release(self, token):
        pass

    def serialise(self, token):
        return bytes([self.kept[token]])

    def deserialise(self, data):
        self.kept.append(data[0])
        return len(self.kept) - 1


def test_who_dies_on_the_way_to_a_kept_state_goes_on_from_where_it_was():
    """Two lives are lost: one after a step, the next while it is brought back to the state before for its bytes."""
    half = ReplayedHalf(Counter(), lambda: half.replace(Counter()) is None)
    half.initialise(0.0, 9.0, {}, {}, ())
    half.advance(0.0, 1.0, {}, ("n",))
    token = half.save()
    half.advance(1.0, 1.0, {}, ("n",))
    half.replace(Counter())
    half.read(("n",))  # brings the new life to 2 steps
    half.half.dies = True
    assert half.serialise(token) == bytes([1])
    assert half.read(("n",))["n"] == 2.0


class Broken(Counter):
    """A half that goes a part of its step, and then has no contact.  breaks : so often."""

    def __init__(self, breaks: int) -> None:
        super().__init__()
        self.breaks = breaks

    def advance(self, t, h, inputs, outputs):
        if self.breaks:
            self.breaks -= 1
            self.n += 100
            raise HalfError("contact is gone", half="counter")
        return super().advance(t, h, inputs, outputs)


@pytest.mark.parametrize("saved", [False, True], ids=["from its last bytes", "from a state at hand"])
def test_a_step_broken_off_half_way_is_repeated_from_where_it_began(saved):
    """Contact died, and lives again; the half lives on, somewhere inside its step."""
    inner = Broken(0)
    half = ReplayedHalf(inner, lambda: True)
    half.initialise(0.0, 9.0, {}, {}, ())
    half.advance(0.0, 1.0, {}, ("n",))
    if saved:
        half.save()
    inner.breaks = 2
    assert half.advance(1.0, 1.0, {}, ("n",)).outputs["n"] == 2.0
    assert half.read(("n",))["n"] == 2.0


class Child:
    """A process that is dead, or lives."""

    pid, log_tail = 1, staticmethod(str)

    def __init__(self, dead: bool) -> None:
        self.dead = dead

    def death(self):
        return "ended by signal 9" if self.dead else ""

    def is_stopped(self):
        return False


class Starts:
    """What the processes of a run begin with, without any."""

    patience = 1.0

    def reap(self, children): ...

    def start(self, name, fmu, listen=""):
        return Child(dead=False)

    def ready(self, child, until, watch):
        return "there", "next"


def crew_whose_contact_died(monkeypatch) -> _Crew:
    crew = _Crew(Starts(), None, {}, None, 3)
    monkeypatch.setattr(crew, "_contact_client", object)
    crew.endpoints["contact"] = "there"
    crew.children["contact"] = Child(dead=True)
    return crew


def test_a_call_that_contact_broke_off_is_repeated_once(monkeypatch):
    """Who waits for the call sees the death first and starts contact anew: the half has failed all the same."""
    crew = crew_whose_contact_died(monkeypatch)
    assert crew.blame(0.0)
    assert crew.left == 2
    assert crew.mended()
    assert not crew.mended()
    assert not crew.blame(0.0)


def test_a_discard_while_contact_was_started_anew_is_no_discard(monkeypatch):
    crew = crew_whose_contact_died(monkeypatch)
    answers = [Described("t", (), {}, True, True), Advance(Status.DISCARD, "no answer of contact", {}, 0.0),
               Advance(Status.DISCARD, "too long", {}, 0.0)]
    client = SimpleNamespace(begin=lambda verb, deadline: verb, answer=lambda verb: answers.pop(0), answered_at=0.0)
    half = RemoteHalf("t", client, crew.blame)
    with pytest.raises(HalfError, match=r"broken off: no answer of contact .*Step from t = 0 s"):
        half.advance(0.0, 1.0, {}, ())
    assert crew.mended()
    assert half.advance(0.0, 1.0, {}, ()).status is Status.DISCARD  # one of its own
