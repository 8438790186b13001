"""What is done with states goes ahead of the next call to a half in another process, in the same message."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from contact.rpc.client import Client
from coupler import load_scenario, run
from coupler.errors import HalfError
from coupler.fmu.half import Status
from coupler.fmu.host import Hosted
from coupler.fmu.remote import (
    VERBS,
    Acknowledged,
    Ahead,
    Describe,
    Deserialise,
    Failed,
    Read,
    Release,
    RemoteHalf,
    Restore,
    Save,
    Serialise,
    Step,
)
from coupler.record.trace import STEP

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from counting_half import CountingHalf  # noqa: E402

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios/casting_1d.yaml"


@pytest.fixture
def far():
    """A half behind messages, the half itself, and the messages."""
    half, said = CountingHalf(), []
    hosted = Hosted(half)

    def call(verb):
        said.append(verb)
        return hosted.answer(verb)

    client = SimpleNamespace(begin=lambda verb, deadline: verb, answer=call, answered_at=0.0)
    remote = RemoteHalf("counter", client, lambda patience: False)
    said.clear()
    return remote, half, said


def test_a_window_is_one_message_and_what_is_read_of_it(far):
    remote, half, said = far
    for k in range(3):
        token = remote.save()
        remote.advance(float(k), 1.0, {}, ("y",))
        remote.release(token)
    assert [type(s) for s in said] == [Ahead] * 3
    assert [type(v) for v in said[2].first] == [Release, Save]
    assert half.state == 3.0
    assert len(half.kept) == 1  # until the next message


def test_a_window_put_back_begins_where_it_did(far):
    remote, half, said = far
    token = remote.save()
    remote.advance(0.0, 1.0, {}, ())
    remote.restore(token)
    assert remote.advance(0.0, 0.25, {}, ("y",)).outputs == {"y": 0.25}
    remote.restore(token)
    assert remote.read(("y",)) == {"y": 0.0}
    assert [type(s) for s in said] == [Ahead] * 3
    assert half.kept == {71: 0.0}


def test_a_state_is_that_of_its_time_whatever_comes_before_it_is_written_down(far):
    remote, _, said = far
    early = remote.save()
    remote.advance(0.0, 1.0, {}, ())
    late = remote.save()
    assert (remote.serialise(early), remote.serialise(late)) == (b"0.0", b"1.0")
    there = remote.deserialise(b"7.5")
    remote.restore(there)
    assert remote.read(("y",)) == {"y": 7.5}
    assert [type(getattr(s, "verb", s)) for s in said] == [Step, Serialise, Serialise, Deserialise, Read]
    assert len({early, late, there}) == 3


def test_after_a_discard_states_still_go_ahead(far):
    remote, _, said = far
    token = remote.save()
    assert remote.advance(0.0, 2.0, {}, ()).status is Status.DISCARD
    remote.restore(token)
    assert remote.advance(0.0, 0.5, {}, ("y",)).outputs == {"y": 0.5}
    assert [type(s) for s in said] == [Ahead, Ahead]


def test_after_a_failure_nothing_is_put_off(far):
    """Whether a half that failed went back is what the last checkpoint of a run hangs on."""
    remote, half, said = far
    token = remote.save()
    with pytest.raises(HalfError, match="too long"):
        remote.advance(0.0, 9.0, {}, ())
    with pytest.raises(HalfError, match="keeps no state 99"):
        remote.restore(99)
    remote.restore(token)
    assert type(said[-1]) is Restore
    assert half.state == 0.0
    remote.release(token)  # put off again: what came before went well
    assert type(said[-1]) is Restore
    remote.read(("y",))
    assert half.kept == {}


def test_names_of_states_are_taken_once():
    hosted = Hosted(CountingHalf())
    assert hosted.answer(Save(3)) == Acknowledged()
    assert hosted.answer(Save(3)) == Failed("keeps a state 3 already", "")
    assert hosted.answer(Deserialise(3, b"1.0")) == Failed("keeps a state 3 already", "")
    assert len(hosted.half.kept) == 1


@pytest.mark.slow
def test_round_trips_of_a_run_are_its_steps_and_reads(tmp_path, monkeypatch):
    """Of casting_1d no message goes for states alone: steps, and the reads of its record."""
    asked = []
    plain = Client.begin

    def counted(self, verb, *more):
        asked.append(verb)
        return plain(self, verb, *more)

    monkeypatch.setattr(Client, "begin", counted)
    results = run(load_scenario(SCENARIO, {"coupling.end": 0.05}), tmp_path / "run.h5", processes=True)
    verbs = [type(v.verb if isinstance(v, Ahead) else v) for v in asked if type(v).__name__ in VERBS]
    assert verbs.count(Save) + verbs.count(Release) + verbs.count(Restore) == 0
    assert verbs.count(Step) == (results.calls.call == STEP).sum() >= 2 * len(results.windows)
    assert verbs.count(Describe) == 2
