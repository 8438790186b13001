"""Outputs that are owed: worked out once, when one of them is read, from what the step left, whatever came since."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.door import doors
from contact.half.layout import layout_of
from contact.half.model import Discard, Outputs, Variable
from contact.half.slave import HalfSlave
from contact.half.state import from_bytes
from contact.half.store import VariableStore

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent / "halves")]
from toy_half.model import load as load_toy  # noqa: E402
from toy_halves import directory  # noqa: E402

FIELDS = (Variable("a"), Variable("stress", (3,)), Variable("strain", (2,)), Variable("z"))


class Made:
    """What works outputs out, and how often it was asked to."""

    def __init__(self, level: float) -> None:
        self.level, self.times = level, 0

    def __call__(self):
        self.times += 1
        return {"stress": np.full(3, self.level), "strain": np.full(2, 10.0 * self.level)}


def store_with(level: float) -> tuple[VariableStore, Made]:
    store, made = VariableStore(layout_of(FIELDS, ())), Made(level)
    assert store.take_outputs(Outputs({"a": 1.0, "z": 2.0}, ("stress", "strain"), made)) == ""
    return store, made


def test_what_nobody_reads_is_not_worked_out():
    store, made = store_with(5.0)
    assert store.get_reals([0]) + store.get_reals([6]) + store.get_reals([6, 0]) == [1.0, 2.0, 2.0, 1.0]
    assert made.times == 0
    assert store.get_reals([4, 5]) == [50.0, 50.0]
    assert store.get_reals([0, 1, 2, 3]) == [1.0, 5.0, 5.0, 5.0]
    assert store.get_reals([5, 1, 6]) == [50.0, 5.0, 2.0]
    assert made.times == 1, "all of them at once, and once"


def test_what_is_apart_is_worked_out_alone():
    """And the rest without it: who reads stresses in every window is not to pay for what is asked for once a run."""
    store, made, rare = VariableStore(layout_of(FIELDS, ())), Made(5.0), []
    outputs = Outputs({"a": 1.0}, ("stress", "strain"), made, {"z": lambda: rare.append(1) or 7.0})
    assert store.take_outputs(outputs) == ""
    assert set(outputs) == {"a", "stress", "strain", "z"}
    assert store.get_reals([1, 2, 3]) == [5.0, 5.0, 5.0]
    assert (made.times, len(rare)) == (1, 0)
    store, made = VariableStore(layout_of(FIELDS, ())), Made(5.0)
    store.take_outputs(Outputs({"a": 1.0}, ("stress", "strain"), made, {"z": lambda: rare.append(1) or 7.0}))
    assert store.get_reals([6]) + store.get_reals([6]) == [7.0, 7.0]
    assert (made.times, len(rare)) == (0, 1)


def test_a_state_in_bytes_does_not_wait_for_what_nobody_may_ask_for():
    """It tells what stands for it; who asks the half itself still gets the answer."""
    store, made, rare = VariableStore(layout_of(FIELDS, ())), Made(5.0), []
    store.take_outputs(Outputs({"a": 1.0}, ("stress", "strain"), made, {"z": lambda: rare.append(1) or 7.0},
                               {"z": -1.0}))
    reals = np.array(store.reals)
    for one in store.owed:
        one.leave(reals)
    assert reals.tolist() == [1.0, 5.0, 5.0, 5.0, 50.0, 50.0, -1.0]
    assert not rare
    assert store.get_reals([6]) == [7.0]


def test_any_order_of_references_finds_what_is_owed():
    store, made = store_with(5.0)
    assert store.get_reals([6, 3, 0]) == [2.0, 5.0, 1.0]
    assert made.times == 1


def test_what_a_step_leaves_out_stays_owed():
    """As an output left out keeps its value; one that is given, or owed anew, is the new one."""
    store, made = store_with(5.0)
    store.take_outputs({"a": 3.0, "strain": np.array([7.0, 8.0])})
    assert store.get_reals(list(range(7))) == [3.0, 5.0, 5.0, 5.0, 7.0, 8.0, 2.0]
    store, made = store_with(5.0)
    store.take_outputs(Outputs({}, ("stress", "strain"), Made(6.0)))
    assert store.get_reals(list(range(1, 6))) == [6.0, 6.0, 6.0, 60.0, 60.0]
    assert made.times == 0


def test_an_output_of_another_shape_is_told():
    store = VariableStore(layout_of(FIELDS, ()))
    store.take_outputs(Outputs({}, ("stress",), lambda: {"stress": np.zeros(2)}))
    with pytest.raises(ValueError, match=r"stress has shape \(2,\), not \(3,\)"):
        store.get_reals([1])


class OwingToy:
    """The toy half, which owes its temperatures."""

    def __init__(self, toy) -> None:
        self.toy, self.variables, self.made = toy, toy.variables, 0

    def start(self, inputs, t, link):
        state, outputs = self.toy.start(inputs, t, link)
        return state, self._owing(outputs)

    def step(self, state, inputs, t, h, link):
        done = self.toy.step(state, inputs, t, h, link)
        return done if isinstance(done, Discard) else replace(done, outputs=self._owing(done.outputs))

    def _owing(self, outputs):
        def make():
            self.made += 1
            return {"T": outputs["T"]}

        return Outputs({n: v for n, v in outputs.items() if n != "T"}, ("T",), make)


class Slave(HalfSlave):
    identity = "toy"
    packages = {"contact": "", "toy_half": ""}  # noqa: RUF012 declared a ClassVar above
    load = staticmethod(load_toy)


class OwingSlave(Slave):
    load = staticmethod(lambda interface, model: OwingToy(load_toy(interface, model)))


def begun(kind, path: Path):
    slave = kind(instance_name="toy", resources=str(directory(path)))
    layout = slave._store.layout
    drive = layout.first["drive"]
    slave.setup_experiment(0.0)
    slave.exit_initialization_mode()
    slave.set_real(list(range(drive, drive + 4)), [300.0, 310.0, 320.0, 330.0])
    return slave, list(range(layout.first["T"], layout.first["T"] + 4))


def test_a_slave_that_owes_answers_the_same_bits(tmp_path):
    """Read after each step, after later steps, after going back, and from bytes."""
    eager, T = begun(Slave, tmp_path / "eager")
    lazy, _ = begun(OwingSlave, tmp_path / "lazy")
    first = eager.get_real(T)
    kept, steps = [], []
    for i in range(3):
        for slave in (eager, lazy):
            assert slave.do_step(0.5 * i, 0.5) is True
        kept.append(lazy._get_fmu_state())
        steps.append(eager.get_real(T))
    assert lazy._model.made == 0
    assert lazy.get_real(T) == steps[2]
    lazy._set_fmu_state(kept[0])
    assert lazy.get_real(T) == steps[0] != first
    for saved, step in zip(kept, steps, strict=True):
        data = OwingSlave._fmu_state_to_bytes(saved)
        assert data is OwingSlave._fmu_state_to_bytes(saved), "written down once, for its size and for itself"
        assert from_bytes(data, {"contact", "toy_half"}).reals[T].tolist() == step
        other, _ = begun(OwingSlave, tmp_path / "other")
        other._set_fmu_state(OwingSlave._fmu_state_from_bytes(data))
        assert other.get_real(T) == step


def test_a_block_is_what_a_list_is():
    """Read with what is owed, written to inputs alone, refused beyond what there is."""
    for first, n in ((0, 7), (1, 3), (4, 2), (5, 2), (0, 1)):
        one, made = store_with(5.0)
        other, _ = store_with(5.0)
        values = np.full(n, np.nan)
        one.read(first, values)
        assert values.tolist() == other.get_reals(list(range(first, first + n)))
        assert made.times == int(n > 1)
    for first, n in ((-1, 2), (6, 2), (8, 1)):
        with pytest.raises(ValueError, match="no Real"):
            store_with(5.0)[0].read(first, np.zeros(n))


def test_a_half_is_heard_of_by_who_made_it_and_takes_blocks(tmp_path):
    """Blocks set and tell what lists do; what cannot be set fails as it does by lists."""
    with doors() as outer:
        with doors() as made:
            blocks, T = begun(Slave, tmp_path / "blocks")
        assert made == [blocks]
        lists, _ = begun(Slave, tmp_path / "lists")
    assert outer == [lists]
    begun(Slave, tmp_path / "unheard")
    assert outer == [lists]
    drive = lists._store.layout.first["drive"]
    given = np.array([301.0, 311.0, 321.0, 331.0])
    blocks.write_block(drive, given)
    lists.set_real(list(range(drive, drive + 4)), given.tolist())
    given[:] = 0.0
    for slave in (blocks, lists):
        assert slave.do_step(0.0, 0.5) is True
    values = np.empty(4)
    blocks.read_block(T[0], values)
    assert values.tolist() == lists.get_real(T)
    blocks.write_block(T[0], values)
    lists.set_real(T, values.tolist())
    for slave in (blocks, lists):
        assert slave.do_step(0.5, 0.5) is False
    assert "is not an input or parameter" in blocks._store.text("status.message")
    by_lists = lists._store.text("status.message")
    assert blocks._store.text("status.message") == by_lists.replace("set_real", "write_block")
    blocks.read_block(10**6, values)
    assert np.isnan(values).all()
