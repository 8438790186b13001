"""A step begins where bodies that yield go on as in the step before, if forces balance better there."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import block, blocks, done, elastic, hold, inputs_of, press

from contact.rpc.link import open_link
from mechanical_fmu import advance
from mechanical_fmu.predicting import going_on, predicted

SOFT = {"plastic": {"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}}}
PULLED = [hold("block.left", 0), hold("block.bottom", 1), hold("block.right", 0, {"t": [0, 1], "value": [0, 0.01]})]


def steps(half, end=1.0, n=10):
    """States and outputs after each of n steps to a time."""
    found = []
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for k in range(n):
            t, h = end * k / n, end / n
            state, outputs = done(half.step(state, inputs_of(half), t, h, link))
            found.append((state, outputs))
    return found


def notched():
    """A block whose right half is 0.6 as high: it yields there first, and not evenly."""
    return block(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 0.3, 4),
                 move=lambda x: x * np.column_stack([np.ones(len(x)), np.where(x[:, 0] > 0.5, 0.6, 1.0)]))


def from_where_it_was(system, u, way, loading, first, settings):
    return first


def test_what_yields_goes_on_in_few_iterations_to_the_same_place(monkeypatch):
    """From where it was: 5 to 7 iterations a step."""
    half = elastic(notched(), PULLED, SOFT)
    with_trend = steps(half, n=30)
    monkeypatch.setattr(advance, "going_on", from_where_it_was)
    without = steps(half, n=30)
    for (state, outputs), (other, others) in zip(with_trend[6:], without[6:], strict=True):
        assert outputs["iterations"] <= 3 < 5 <= others["iterations"]
        assert np.abs(state.u - other.u).max() <= 1e-8 * 0.01
        assert np.abs(state.history - other.history).max() <= 1e-6 * np.abs(other.history).max()


def test_what_rests_stays():
    """The pull ends at 1 s: a step with nothing new leaves every digit as it is."""
    half = elastic(notched(), PULLED, SOFT)
    found = steps(half, 1.5, 15)
    (before, _), (after, outputs) = found[-2:]
    assert outputs["iterations"] == 0
    assert np.array_equal(before.u, after.u)


def test_a_pull_that_turns_round_is_followed(monkeypatch):
    """Where it turns, nodes do not go on."""
    stayed = []

    def seen(system, u, way, loading, first, settings):
        found = going_on(system, u, way, loading, first, settings)
        stayed.append(found is first)
        return found

    monkeypatch.setattr(advance, "going_on", seen)
    back = [*PULLED[:2], hold("block.right", 0, {"t": [0, 0.5, 1], "value": [0, 0.01, 0.0]})]
    half = elastic(notched(), back, SOFT)
    assert all(outputs["iterations"] <= 8 for _, outputs in steps(half))
    assert stayed[4]  # the sixth step, and the first step has none before it


def test_a_body_that_nothing_holds_aside_is_not_sent_on():
    """A block lies on another without friction, and grows warm; in the step before it was moved aside."""
    half = elastic(blocks(3, 4), [hold("lower.bottom", 0), hold("lower.bottom", 1), press("upper.top", 1e8)])
    system = half.system
    with closing(open_link("direct")) as link:
        cold, _ = half.start(inputs_of(half, 300.0), 0.0, link)
        state, _ = done(half.step(cold, inputs_of(half, 400.0), 0.0, 1.0, link))
        u, grown = np.array(cold.u), np.array(state.u - cold.u)
        task = advance.Task(cold.drive, state.drive, 1.0, advance.ContactQuery(system.contact, link, cold.contact,
                                                                               cold.contact.multipliers), None)
        loading = advance.loading_of(system, task, 1.0, 1.0, np.array(cold.history))
        first = predicted(system, u, loading, True)
        aside = np.where((system.interface.node_body == 1)[:, None], [0.01, 0.0], 0.0)
        found = going_on(system, u, grown + aside, loading, first, half.settings)
    assert found is first


def test_a_state_has_all_of_it():
    """A half that is given a state goes on to the same digits."""
    half, again = (elastic(notched(), PULLED, SOFT) for _ in range(2))
    state, _ = steps(half, 0.6, 6)[-1]
    with closing(open_link("direct")) as link:
        here, _ = done(half.step(state, inputs_of(half), 0.6, 0.1, link))
        again.start(inputs_of(again), 0.0, link)
        there, _ = done(again.step(state, inputs_of(again), 0.6, 0.1, link))
    assert np.array_equal(here.u, there.u)
    assert np.array_equal(here.trend, there.trend)
