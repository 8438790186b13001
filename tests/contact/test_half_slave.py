"""The slave without its native wrapper: nothing leaves a method as an exception, a discard changes nothing."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.slave import HalfSlave, Saved, plain

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent / "halves")]
from toy_half.model import load as load_toy  # noqa: E402
from toy_halves import directory  # noqa: E402

CODE, MESSAGE, SUGGEST, METHOD = "status.code", "status.message", "status.dt_suggest", "control.method"


class Slave(HalfSlave):
    identity = "toy"
    packages = {"contact": "", "toy_half": ""}  # noqa: RUF012 declared a ClassVar above
    load = staticmethod(load_toy)


class Face:
    """A slave by names."""

    def __init__(self, path: Path, **model: object) -> None:
        self.slave = Slave(instance_name="toy", resources=str(directory(path, **model)))
        self.layout = self.slave._store.layout
        self.kinds = {v.name: (v.kind, v.size) for v in self.layout.variables}

    def vrs(self, name: str) -> list[int]:
        return list(range(self.layout.first[name], self.layout.first[name] + self.kinds[name][1]))

    def get(self, name: str):
        kind = {"Real": "real", "Integer": "integer", "String": "string"}[self.kinds[name][0]]
        got = getattr(self.slave, f"get_{kind}")(self.vrs(name))
        assert type(got) is list
        assert len(got) == self.kinds[name][1]
        return got if len(got) > 1 else got[0]

    def set(self, name: str, *values) -> None:
        kind = {"Real": "real", "Integer": "integer", "String": "string"}[self.kinds[name][0]]
        getattr(self.slave, f"set_{kind}")(self.vrs(name), list(values))

    def begin(self) -> Face:
        self.slave.setup_experiment(0.0)
        self.slave.enter_initialization_mode()
        self.slave.exit_initialization_mode()
        return self

    def logged(self) -> str:
        return "\n".join(m.msg for m in self.slave.log_queue)


@pytest.fixture
def face(tmp_path):
    return Face(tmp_path).begin()


def test_a_step_is_backward_euler(face):
    face.set("drive", *[400.0] * 4)
    assert face.slave.do_step(0.0, 0.5) is True
    assert face.get("T") == pytest.approx([(273.15 + 0.05 * 400) / 1.05] * 4, rel=1e-14)
    assert (face.get(CODE), face.get("iterations"), face.get("status.dt_stable")) == (0, 1, 2.0)


def test_step_restore_step_twice_gives_the_same_bits(face):
    face.set("drive", 300.0, 310.0, 320.0, 330.0)
    face.slave.do_step(0.0, 0.5)
    saved = face.slave._get_fmu_state()
    runs = []
    for _ in range(3):
        face.slave.do_step(0.5, 0.25)
        face.slave.do_step(0.75, 0.5)
        runs.append((face.get("T"), face.get("iterations"), face.get("drive")))
        face.set("drive", *[999.0] * 4)
        face.slave._set_fmu_state(saved)
    assert runs[0] == runs[1] == runs[2]
    assert face.get("drive") == [300.0, 310.0, 320.0, 330.0], "inputs are state"


def test_hidden_state_is_in_the_state(face):
    saved = face.slave._get_fmu_state()
    face.slave.do_step(0.0, 0.5)
    after = face.slave._get_fmu_state()
    assert saved.state.memory.any() == 0
    assert after.state.memory.any()
    assert isinstance(saved, Saved)
    assert np.isfinite(saved.reals).all()


def test_a_discard_says_why_and_changes_nothing(face):
    before = face.slave._get_fmu_state()
    assert face.slave.do_step(0.0, 5.0) is False
    assert face.get(CODE) == 1
    assert face.get(SUGGEST) == 1.0
    assert "more than 1.0 s" in face.get(MESSAGE)
    assert "%" not in face.get(MESSAGE)
    after = face.slave._get_fmu_state()
    assert after.time == before.time
    assert after.state is before.state
    assert face.get("T") == [273.15] * 4
    assert face.slave.do_step(0.0, 0.5) is True
    assert face.get(CODE) == 0
    assert face.get(MESSAGE) == ""


@pytest.mark.parametrize(("method", "what"), [(1, "RuntimeError: a bug"), (3, "SystemExit: 3"),
                                              (5, "ValueError: assignment destination is read-only")])
def test_bugs_stay_inside_and_stick(face, method, what):
    saved = face.slave._get_fmu_state()
    face.set(METHOD, method)
    assert face.slave.do_step(0.0, 0.5) is False
    assert face.get(CODE) == 2
    assert what in face.get(MESSAGE)
    assert "Traceback" in face.logged()
    assert "toy_half" in face.logged()
    assert "%" not in face.logged()
    face.slave._set_fmu_state(saved)
    assert face.slave.do_step(0.0, 0.5) is False, "a bug may have spoilt the model"
    assert face.get(CODE) == 2
    assert len(face.get("T")) == 4


def test_a_failed_computation_is_a_discard_that_may_be_tried_again(face):
    face.set(METHOD, 2)
    assert face.slave.do_step(0.0, 0.5) is False
    assert face.get(CODE) == 1
    assert face.get(MESSAGE) == "ZeroDivisionError: nothing to divide by"
    face.set(METHOD, 0)
    assert face.slave.do_step(0.0, 0.5) is True


def test_an_interruption_is_told_and_does_not_stick(face):
    face.set(METHOD, 4)
    assert face.slave.do_step(0.0, 0.5) is False
    assert face.get(CODE) == 3
    face.set(METHOD, 0)
    assert face.slave.do_step(0.0, 0.5) is True


def test_an_interruption_between_steps_is_told_by_the_next_step(face, monkeypatch):
    def interrupted(vrs, values):
        raise KeyboardInterrupt

    with monkeypatch.context() as m:
        m.setattr(face.slave._store, "set_reals", interrupted)
        face.set("drive", *[999.0] * 4)
    assert face.slave.do_step(0.0, 0.5) is False, "the input never arrived"
    assert face.get(CODE) == 3
    assert face.slave.do_step(0.0, 0.5) is True


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_input_that_is_not_finite_is_a_discard_naming_the_block(face, bad):
    face.set("drive", 300.0, 300.0, bad, 300.0)
    assert face.slave.do_step(0.0, 0.5) is False
    assert (face.get(CODE), face.get(MESSAGE)) == (1, "input drive holds a value that is not finite")
    face.set("drive", *[300.0] * 4)
    assert face.slave.do_step(0.0, 0.5) is True


def test_output_that_is_not_finite_is_a_discard_naming_the_block(face):
    face.set(METHOD, 6)
    assert face.slave.do_step(0.0, 0.5) is False
    assert (face.get(CODE), face.get(MESSAGE)) == (1, "output T is not finite")
    assert face.get("T") == [273.15] * 4


@pytest.mark.parametrize(("t", "h"), [(0.0, 0.0), (0.0, -1.0), (0.0, np.nan), (np.nan, 0.5), (0.0, np.inf)])
def test_a_step_of_no_length_is_a_discard(face, t, h):
    assert face.slave.do_step(t, h) is False
    assert face.get(CODE) == 1
    assert "is none" in face.get(MESSAGE)


def test_outputs_may_not_be_set_and_wrong_references_fail_in_words(face):
    face.slave.set_real(face.vrs("T"), [0.0] * 4)
    assert face.get("T") == [273.15] * 4
    assert face.slave.do_step(0.0, 0.5) is False
    assert "T is not an input" in face.get(MESSAGE)
    for vrs in ([10**6], [-1], face.vrs("iterations")):
        assert np.isnan(face.slave.get_real(vrs)).all()
    assert face.slave.get_integer(face.vrs("T")) == [2] * 4
    assert face.slave.get_string([0]) == [""]


def test_the_first_failure_is_the_one_that_is_told(face):
    face.set(METHOD, 1)
    face.slave.do_step(0.0, 0.5)
    face.slave.get_real([10**6])
    assert "RuntimeError: a bug" in face.get(MESSAGE)


def test_what_a_model_is_given_does_not_change_under_it(face):
    given = face.slave._store.inputs()
    face.set("drive", *[999.0] * 4)
    assert given["drive"].tolist() == [300.0] * 4
    with pytest.raises(ValueError, match="read-only"):
        given["drive"][0] = 0.0


def test_any_order_of_value_references_is_answered(face):
    face.set("drive", 1.0, 2.0, 3.0, 4.0)
    vrs = face.vrs("drive")
    assert face.slave.get_real(vrs[::-1]) == [4.0, 3.0, 2.0, 1.0]
    assert face.slave.get_real([vrs[0], vrs[2], vrs[1], vrs[3]]) == [1.0, 3.0, 2.0, 4.0], "ends alone would mislead"
    face.slave.set_real([vrs[0], vrs[2], vrs[1], vrs[3]], [5.0, 6.0, 7.0, 8.0])
    assert face.get("drive") == [5.0, 7.0, 6.0, 8.0]
    assert face.slave.get_real([]) == []


def test_bytes_of_a_state_of_another_half_are_refused(face, tmp_path):
    data = Slave._fmu_state_to_bytes(face.slave._get_fmu_state())
    assert data == Slave._fmu_state_to_bytes(face.slave._get_fmu_state()), "asked for twice: size, then bytes"
    face.slave._set_fmu_state(Slave._fmu_state_from_bytes(data))
    assert face.slave.do_step(0.0, 0.5) is True
    for bad in (data.replace(b'"toy"', b'"tox"'), b"", data[:-3]):
        other = Face(tmp_path / "other").begin()
        other.slave._set_fmu_state(Slave._fmu_state_from_bytes(bad))
        assert other.get(CODE) == 2
        assert "state" in other.get(MESSAGE)


def test_a_restored_state_keeps_the_link_of_this_run(face):
    saved = face.slave._get_fmu_state()
    face.set("contact.link", "codec")
    face.slave._set_fmu_state(saved)
    assert face.get("contact.link") == "codec"


def test_initialisation_that_fails_and_steps_before_it_are_told(tmp_path):
    early = Face(tmp_path)
    assert early.slave.do_step(0.0, 0.5) is False
    assert "not initialised" in early.get(MESSAGE)
    failed = Face(tmp_path)
    failed.set(METHOD, 9)
    failed.begin()
    assert failed.get(CODE) == 2
    assert "cannot start" in failed.get(MESSAGE)
    assert len(failed.get("T")) == 4
    assert any("Traceback" in m.msg for m in failed.slave.log_queue)
    refused = Face(tmp_path)
    refused.set(METHOD, 8)
    refused.begin()
    assert refused.get(CODE) == 2
    assert refused.get(MESSAGE) == "nothing holds it"
    assert not any("Traceback" in m.msg for m in refused.slave.log_queue)
    ended = Face(tmp_path).begin()
    ended.slave.terminate()
    assert ended.slave.do_step(0.0, 0.5) is False
    assert ended.get("T") == [273.15] * 4


@pytest.mark.parametrize(("text", "match"), [("{", "model.json: not a readable JSON"), ("[]", "one object"),
                                             ('{"half": "other"}', "'other', not 'toy'"),
                                             ('{"half": "toy"}', r"(?s)Traceback.*KeyError: 'rate'")])
def test_a_broken_model_is_told_when_the_half_is_made(tmp_path, text, match):
    directory(tmp_path)
    (tmp_path / "model.json").write_text(text)
    with pytest.raises(RuntimeError, match=match):
        Slave(instance_name="toy", resources=str(tmp_path))


def test_the_log_does_not_grow_without_bound(face):
    for _ in range(500):
        face.slave.do_step(0.0, 5.0)
    assert len(face.slave.log_queue) <= 200
    assert max(len(m.msg) for m in face.slave.log_queue) <= 1500


def test_plain_text_can_go_through_printf():
    assert plain("100%n\0\ud800") == "100 percentn ?"
