"""FMI 3.0: a half in C with arrays is the one with scalars of FMI 2.0, to the bit, and what it may answer beside."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from coupler.errors import HalfError
from coupler.fmu.description import with_description
from coupler.fmu.fmi import FmuHalf, load_half
from coupler.fmu.half import Array, Status

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
from make import make, make_wall

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux", reason="needs a C compiler")
N, Q = 5, 3
X = np.linspace(0.0, 1.0, 2 * N).reshape(N, 2)


def begun(fmu: Path) -> FmuHalf:
    half = load_half(fmu)
    half.initialise(0.0, 10.0, {}, {"x": X}, ["T"])
    return half


def scenario(half: FmuHalf) -> Iterator[Array]:
    """A run with everything a coupler asks for: steps of all sizes, states kept, restored, written down."""
    t, token = 0.0, -1
    for k in range(8):
        h = 0.1 * (k + 1)
        answer = half.advance(t, h, {"contact.t_N": -1e5 * np.arange(k, k + Q), "x": X + k}, ["x", "T"])
        assert answer.status is Status.OK
        yield from answer.outputs.values()
        t += h
        if k == 3:
            token = half.save()
    data = half.serialise(token)
    half.restore(token)
    yield half.read(["T"])["T"]
    half.release(token)
    half.restore(half.deserialise(data))
    yield from half.read(["T", "x", "contact.t_N"]).values()


@pytest.mark.few("degC")
@pytest.mark.parametrize("unit", ["K", "degC"])
def test_arrays_of_fmi_3_are_the_scalars_of_fmi_2_to_the_bit(unit: str, tmp_path: Path) -> None:
    found: list[list[Array]] = []
    for fmi in (2, 3):
        half = begun(make_wall(tmp_path / str(fmi), N, Q, 20.0 if unit == "degC" else 293.15, unit=unit, fmi=fmi))
        assert {n: half.blocks[n].shape for n in ("T", "x", "contact.t_N")} == {
            "T": (N,), "x": (N, 2), "contact.t_N": (Q,)}
        found.append(list(scenario(half)))
        half.close()
    assert [a.tobytes() for a in found[0]] == [a.tobytes() for a in found[1]]
    assert found[1][0].tolist() == X.tolist()  # row by row, as it was set
    assert 293.15 < found[1][1][0] < found[1][-3][0] < 393.15


def test_a_step_that_ends_early_is_no_step(tmp_path: Path) -> None:
    """Early return is not allowed it; the window goes back and on in shorter steps."""
    half = begun(make_wall(tmp_path, N, Q, 300.0, "RETURNS_EARLY", fmi=3))
    answer = half.advance(0.0, 1.0, {}, ["T"])
    assert answer.status is Status.DISCARD
    assert "ended its step early, at 0.5 s" in answer.message
    assert answer.dt_suggest == 0.5
    assert not answer.outputs
    half.close()


def test_who_asks_for_the_end_ends_the_run(tmp_path: Path) -> None:
    half = begun(make_wall(tmp_path, N, Q, 300.0, "ENDS", fmi=3))
    for k in range(2):
        assert half.advance(float(k), 1.0, {}, ["T"]).status is Status.OK
    with pytest.raises(HalfError, match="asks for the end of the simulation"):
        half.advance(2.0, 1.0, {}, ["T"])
    half.close()


def test_a_discard_and_a_message_are_told(tmp_path: Path) -> None:
    half = begun(make_wall(tmp_path, N, Q, 300.0, "DISCARDS", fmi=3))
    assert half.log_tail() == "[ok] arrays: 100 %s of them"
    answer = half.advance(0.0, 1.0, {}, ["T"])
    assert (answer.status, answer.message) == (Status.DISCARD, "it gave no reason")
    half.close()


def test_a_value_that_is_no_number_has_its_name(tmp_path: Path) -> None:
    half = begun(make_wall(tmp_path, N, Q, 300.0, "NOT_A_NUMBER", fmi=3))
    answers = [half.advance(float(k), 1.0, {}, ["x", "T"]) for k in range(3)]
    assert [a.status for a in answers] == [Status.OK, Status.OK, Status.DISCARD]
    assert "T[2]" in answers[2].message
    half.close()


def test_an_array_of_another_size_than_described_is_refused_by_the_fmu(tmp_path: Path) -> None:
    fmu = make_wall(tmp_path / "wall", N, Q, 300.0, fmi=3)
    other = with_description(fmu, lambda xml: xml.replace(b'<Dimension start="5"/></Float64>',
                                                          b'<Dimension start="6"/></Float64>', 1), tmp_path / "o.fmu")
    half = load_half(other)
    with pytest.raises(HalfError, match="fmi3GetFloat64 answered error"):
        half.initialise(0.0, 1.0, {}, {}, ["T"])
    half.close()


def test_a_library_without_a_function_of_the_standard_is_told(tmp_path: Path) -> None:
    """A library of FMI 2.0 under a description of FMI 3.0."""
    two, three = make(tmp_path / "2", N, Q), make(tmp_path / "3", N, Q, fmi=3)
    shutil.unpack_archive(three, tmp_path / "u", "zip")
    shutil.unpack_archive(two, tmp_path / "v", "zip")
    shutil.copy(tmp_path / "v/binaries/linux64/wall.so", tmp_path / "u/binaries/x86_64-linux/wall.so")
    shutil.make_archive(str(tmp_path / "mixed"), "zip", tmp_path / "u")
    with pytest.raises(HalfError, match=r"library cannot be loaded: .*fmi3"):
        load_half((tmp_path / "mixed.zip").rename(tmp_path / "mixed.fmu"))
