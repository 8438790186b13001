"""Halves through FMI: each test in a process of its own that must end with 0, as FMUs share an interpreter."""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import pytest

from coupler.errors import HalfError
from coupler.fmu.description import unpack, unpacked_beside

sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from toy_halves import build, fresh

BEGIN = """
import gc, json, os, sys
from pathlib import Path
import numpy as np
from coupler.errors import HalfError
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Status

N = 4
def half(fmu, name="toy", extracted=None):
    return load_half(Path(fmu), extracted and Path(extracted), name, PAST_LISTS)
def begun(fmu, name="toy", drive=400.0, **inputs):
    h = half(fmu, name)
    h.initialise(0.0, 10.0, {"contact.link": "direct"}, {"drive": np.full(N, drive), **inputs}, ["T"])
    return h
def method(k):
    return {"control.method": np.array(k)}
"""


def run(code: str, *args: object, past_lists: bool = False) -> str:
    return fresh(f"PAST_LISTS = {past_lists}\n" + BEGIN + code, *args)


BOTH_WAYS = pytest.mark.parametrize("past_lists", [False, True])


@pytest.fixture(scope="module")
def fmu(tmp_path_factory) -> Path:
    return build(tmp_path_factory.mktemp("toy"))


@pytest.fixture(scope="module")
def other(tmp_path_factory) -> Path:
    return build(tmp_path_factory.mktemp("other"), n=3, rate=0.5)


def test_a_half_is_described_and_steps(fmu):
    out = json.loads(run("""
h = half(sys.argv[1])
first = h.initialise(0.0, 10.0, {}, {"drive": np.full(N, 400.0)}, ["T", "iterations"])
a = h.advance(0.0, 0.5, {}, ["T", "sum", "iterations"])
print(json.dumps({"x": [h.blocks["x"].shape, h.blocks["x"].unit, h.blocks["x"].causality], "strings": dict(h.strings),
                  "first": first["T"].tolist(), "T": a.outputs["T"].tolist(), "sum": float(a.outputs["sum"]),
                  "steps": float(a.outputs["iterations"]), "status": a.status.value, "saves": h.can_save}))
""", fmu))
    T = (273.15 + 0.05 * 400) / 1.05
    assert out["x"] == [[4, 2], "m", "input"]
    assert out["strings"]["geometry"] == "plane"
    assert out["first"] == [273.15] * 4
    assert out["T"] == pytest.approx([T] * 4, rel=1e-14)
    assert (out["status"], out["steps"], out["saves"]) == ("ok", 1.0, True)
    assert out["sum"] == pytest.approx(4 * T)


@BOTH_WAYS
def test_step_restore_step_gives_the_same_bits_twice(fmu, past_lists):
    run("""
h = begun(sys.argv[1])
h.advance(0.0, 0.5, {}, ["T"])
token = h.save()
seen = []
for _ in range(3):
    a = h.advance(0.5, 0.25, {"drive": np.linspace(300, 500, N)}, ["T", "sum"])
    b = h.advance(0.75, 0.5, {"gain": np.array(2.0)}, ["T", "sum"])
    seen.append([v.tobytes() for s in (a, b) for v in s.outputs.values()])
    h.restore(token)
assert seen[0] == seen[1] == seen[2]
h.release(token)
try:
    h.restore(token)
except HalfError as exc:
    assert "was released" in str(exc)
else:
    raise AssertionError
""", fmu, past_lists=past_lists)


@pytest.mark.few("False")
@BOTH_WAYS
def test_a_state_written_in_one_process_goes_on_in_another(fmu, tmp_path, past_lists):
    first = run("""
h = begun(sys.argv[1])
h.advance(0.0, 0.5, {"drive": np.linspace(300, 500, N)}, [])
token = h.save()
data = h.serialise(token)
assert data == h.serialise(token)
Path(sys.argv[2]).write_bytes(data)
print(h.advance(0.5, 0.5, {}, ["T"]).outputs["T"].tobytes().hex())
""", fmu, tmp_path / "state", past_lists=past_lists)
    second = run("""
h = begun(sys.argv[1], drive=0.0)
h.restore(h.deserialise(Path(sys.argv[2]).read_bytes()))
print(h.advance(0.5, 0.5, {}, ["T"]).outputs["T"].tobytes().hex())
""", fmu, tmp_path / "state")
    assert first == second
    assert len(first) > 10


def test_a_state_of_another_half_is_refused(fmu, other, tmp_path):
    run("h = begun(sys.argv[1]); Path(sys.argv[2]).write_bytes(h.serialise(h.save()))", fmu, tmp_path / "state")
    out = run("""
N = 3
h = begun(sys.argv[1])
for data in (Path(sys.argv[2]).read_bytes(), b"nonsense"):
    try:
        h.restore(h.deserialise(data))
    except HalfError as exc:
        print(exc.message)
""", other, tmp_path / "state")
    assert "belongs to another half" in out.splitlines()[0]
    assert len(out.splitlines()) == 2


@pytest.mark.slow
def test_fifty_rejected_steps_leave_a_healthy_process(fmu):
    run("""
h = begun(sys.argv[1])
t = 0.0
for k in range(50):
    token = h.save()
    a = h.advance(t, 1.5, {}, ["T"])
    assert a.status is Status.DISCARD and a.message.startswith("step of 1.5 s") and a.dt_suggest == 1.0, a
    assert a.outputs == {}
    h.restore(token)
    b = h.advance(t, 0.75, {}, ["T", "iterations"])
    assert b.status is Status.OK and b.outputs["iterations"] == k + 1
    h.release(token)
    t += 0.75
    gc.collect()
assert abs(b.outputs["T"] - 400.0).max() < 25
""", fmu)


@pytest.mark.few("5-read-only")
@pytest.mark.parametrize(("kind", "words"), [(1, "RuntimeError: a bug"), (3, "SystemExit"), (5, "read-only")])
def test_exceptions_of_a_half_are_errors_with_its_traceback(fmu, kind, words):
    out = run("""
h = begun(sys.argv[1], "sick")
other = begun(sys.argv[1], "well")
for _ in range(15):
    try:
        h.advance(0.0, 0.5, method(int(sys.argv[2])), ["T"])
    except HalfError as exc:
        text = str(exc)
    gc.collect()
assert other.advance(0.0, 0.5, {}, ["T"]).status is Status.OK
h.close()
h.close()
print(text)
""", fmu, kind)
    assert words in out
    assert "half 'sick'" in out
    assert "(t = 0 s, h = 0.5 s)" in out
    assert "Traceback" in out
    assert "toy_half" in out


@pytest.mark.few("True")
@BOTH_WAYS
def test_a_failed_computation_and_a_bad_number_are_discards(fmu, past_lists):
    run("""
h = begun(sys.argv[1])
for inputs, words in ((method(2), "ZeroDivisionError"), (method(6), "output T is not finite"),
                      ({**method(0), "drive": np.array([1.0, np.nan, 1.0, 1.0])}, "input drive")):
    a = h.advance(0.0, 0.5, inputs, ["T"])
    assert a.status is Status.DISCARD and words in a.message, a
assert h.advance(0.0, 0.5, {"drive": np.full(N, 1.0)}, ["T"]).status is Status.OK
""", fmu, past_lists=past_lists)


@pytest.mark.few("True")
@BOTH_WAYS
def test_an_interruption_inside_a_half_reaches_the_caller(fmu, past_lists):
    run("""
h = begun(sys.argv[1])
try:
    h.advance(0.0, 0.5, method(4), ["T"])
except KeyboardInterrupt:
    assert h.advance(0.0, 0.5, method(0), ["T"]).status is Status.OK
else:
    raise AssertionError
""", fmu, past_lists=past_lists)


@pytest.mark.few("False")
@BOTH_WAYS
def test_a_half_that_cannot_start_is_an_error(fmu, past_lists):
    out = run("""
try:
    begun(sys.argv[1], **method(9))
except HalfError as exc:
    print(exc)
""", fmu, past_lists=past_lists)
    assert "cannot start: 100 percents of it" in out


def test_a_broken_model_is_told_when_the_fmu_is_loaded(fmu, tmp_path):
    target = unpack(fmu, tmp_path / "fmu")
    (target / "resources" / "model.json").write_text("{")
    out = run("""
for _ in range(15):
    try:
        half(sys.argv[1], extracted=sys.argv[2])
    except HalfError as exc:
        text = str(exc)
    gc.collect()
print(text)
""", fmu, target)
    assert "could not be instantiated" in out
    assert "model.json: not a readable JSON file" in out


@pytest.mark.few("True")
@BOTH_WAYS
def test_halves_of_one_kind_with_other_models_live_side_by_side(fmu, other, past_lists):
    run("""
a, b = begun(sys.argv[1], "a"), half(sys.argv[2], "b")
b.initialise(0.0, 1.0, {}, {"drive": np.full(3, 400.0)}, [])
for _ in range(3):
    more = begun(sys.argv[1])
    more.close()
    gc.collect()
Ta, Tb = (h.advance(0.0, 0.5, {}, ["T"]).outputs["T"] for h in (a, b))
assert Ta.shape == (4,) and Tb.shape == (3,)
assert abs(Ta - (273.15 + 0.05 * 400) / 1.05).max() < 1e-9
assert abs(Tb - (273.15 + 0.25 * 400) / 1.25).max() < 1e-9
""", fmu, other, past_lists=past_lists)


@pytest.mark.few("False")
@BOTH_WAYS
def test_what_a_caller_does_wrong_is_named(fmu, past_lists):
    out = run("""
h = begun(sys.argv[1])
for wrong in (lambda: h.advance(0.0, 0.5, {"drvie": np.zeros(N)}, []), lambda: h.read(["nothing"]),
              lambda: h.advance(0.0, 0.5, {"drive": np.zeros(3)}, []), lambda: h.read(["geometry"]),
              lambda: h.advance(0.0, 0.5, {"T": np.zeros(N)}, [])):
    try:
        wrong()
    except HalfError as exc:
        print(exc.message)
h.close()
try:
    h.read(["T"])
except HalfError as exc:
    print(exc.message)
""", fmu, past_lists=past_lists).splitlines()
    for words, line in zip(["no variable 'drvie'", "no variable 'nothing'", "drive has shape (4,), it was given (3,)",
                            "geometry is a String", "T is not an input or parameter", "after the half had ended"],
                           out, strict=True):
        assert words in line


def test_the_working_directory_stays_and_a_missing_library_is_told(fmu, tmp_path):
    target = unpack(fmu, tmp_path / "fmu")
    library = next(target.glob("binaries/linux64/*.so"))
    library.write_bytes(b"not a library")
    out = run("""
here = os.getcwd()
try:
    half(sys.argv[1], extracted=sys.argv[2])
except HalfError as exc:
    print(exc)
assert os.getcwd() == here
""", fmu, target)
    assert "library cannot be loaded" in out


def test_exits_are_clean_whatever_is_still_alive(fmu):
    for ending in ("", "h.close()", "sys.exit(0)", "del h; gc.collect()"):
        run(f"h, k = begun(sys.argv[1]), begun(sys.argv[1])\nh.save()\nh.advance(0.0, 0.5, {{}}, ['T'])\n{ending}", fmu)


def test_a_foreign_slave_that_lets_an_exception_out_is_never_called_again(fmu, tmp_path):
    target = unpack(fmu, tmp_path / "fmu")
    script = next(p for p in (target / "resources").glob("toy_half_*.py"))
    script.write_text(script.read_text() + "\n    def do_step(self, t, h):\n        raise ValueError('out')\n")
    out = run("""
h = half(sys.argv[1], extracted=sys.argv[2])
h.initialise(0.0, 1.0, {}, {}, [])
for call in (lambda: h.advance(0.0, 0.5, {}, []), lambda: h.read(["T"]), h.save):
    try:
        call()
    except HalfError as exc:
        print(exc.message)
h.close()
del h
gc.collect()
""", fmu, target).splitlines()
    assert "fmi2DoStep answered fatal" in out[0]
    assert all("after the half had ended" in line for line in out[1:])


@pytest.mark.parametrize("name", ["a#b", "a%20b", "grün", "a[b"])
def test_paths_that_would_crash_the_wrapper_are_refused(fmu, tmp_path, name):
    with pytest.raises(HalfError, match="SLIDELINE_CACHE"):
        unpack(fmu, tmp_path / name / "fmu")
    assert not (tmp_path / name).exists()


def test_a_path_with_blanks_works(fmu, tmp_path):
    run("half(sys.argv[1], extracted=sys.argv[2]).initialise(0.0, 1.0, {}, {}, ['T'])", fmu, tmp_path / "a b" / "fmu")


def test_damaged_archives_are_refused_and_leave_nothing(tmp_path, monkeypatch):
    (tmp_path / "x.fmu").write_bytes(b"PK no")
    with pytest.raises(HalfError, match="cannot be unpacked"):
        unpack(tmp_path / "x.fmu", tmp_path / "x")
    with pytest.raises(HalfError, match="cannot be unpacked"):
        unpack(tmp_path / "missing.fmu", tmp_path / "x")
    with zipfile.ZipFile(tmp_path / "big.fmu", "w") as archive:
        archive.writestr("a", b"0" * 1000)
    monkeypatch.setattr("coupler.fmu.description.LIMIT", 999)
    with pytest.raises(HalfError, match="more than"):
        unpack(tmp_path / "big.fmu", tmp_path / "x")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["big.fmu", "x.fmu"]


def test_a_directory_beside_the_fmu_is_used_only_if_it_is_the_same(fmu, tmp_path):
    copy = tmp_path / "toy.fmu"
    copy.write_bytes(fmu.read_bytes())
    assert unpacked_beside(copy) is None
    assert unpack(copy, tmp_path / "toy") == unpacked_beside(copy)
    (tmp_path / "toy" / "modelDescription.xml").write_text("<other/>")
    assert unpacked_beside(copy) is None
