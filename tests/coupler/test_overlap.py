"""Halves that need nothing of each other work at the same time where they have processes of their own."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from coupler import HalfError, Results, load_scenario, run
from coupler.fmu import metered
from coupler.fmu.half import Advance, Status, begin
from coupler.fmu.metered import PARTS, Meter, MeteredHalf
from coupler.report.timeline import shares_over_time
from coupler.schemes.sweep import _together

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from killed_roles import ROLES  # noqa: E402
from test_processes import X, gone, two  # noqa: E402

SCENARIO = HERE.parents[1] / "scenarios/sliding_blocks.yaml"
SMALL = {"coupling.scheme": "parallel", "coupling.end": 4000, "coupling.kinks": [],
         "coupling.windows": [{"until": 4000, "size": 500}],
         "bodies.lower.mesh.rectangle.cells": [6, 6], "bodies.upper.mesh.rectangle.cells": [5, 5]}


@pytest.fixture
def fmu(tmp_path: Path) -> Path:
    path = tmp_path / "toy.fmu"
    path.touch()
    return path


class Worker:
    """Substeps that tell when they are begun and when their answer is asked for."""

    def __init__(self, name: str, said: list[str], fails: Exception | None = None) -> None:
        self.name, self.said, self.fails = name, said, fails

    def over(self, n: int):
        for k in range(n):
            self.said.append(f"{self.name}{k} begun")
            assert (yield lambda k=k: self.answer(k)) == k
        return self.name

    def answer(self, k: int) -> int:
        self.said.append(f"{self.name}{k} asked")
        if self.fails is not None:
            raise self.fails
        return k


def test_each_substep_is_begun_before_another_is_waited_for():
    said: list[str] = []
    assert _together([Worker("a", said).over(1), Worker("b", said).over(3)]) == ["a", "b"]
    assert said == ["a0 begun", "b0 begun", "a0 asked", "b0 asked", "b1 begun", "b1 asked", "b2 begun", "b2 asked"]


@pytest.mark.parametrize(("a", "b", "raised"), [("first", "", "first"), ("", "second", "second"),
                                                ("first", "second", "first")])
def test_what_fails_is_raised_when_nobody_works_any_more(a, b, raised):
    said: list[str] = []
    both = [Worker(name, said, HalfError(text) if text else None).over(1) for name, text in (("a", a), ("b", b))]
    with pytest.raises(HalfError, match=raised):
        _together(both)
    assert {"a0 asked", "b0 asked"} <= set(said)


def test_a_half_in_this_process_works_when_it_is_asked():
    class Here:
        steps = 0

        def advance(self, t, h, inputs, outputs):
            self.steps += 1
            return Advance(Status.OK, "", {}, 0.0)

    class Wrong:
        """One that passes on what it does not have, but for the step."""

        half = Here()

        def __getattr__(self, name):
            return getattr(self.half, name)

        def advance(self, t, h, inputs, outputs):
            return Advance(Status.DISCARD, "wrong", {}, 0.0)

    half = Here()
    answer = begin(half, 0.0, 1.0, {}, ())
    assert half.steps == 0
    assert answer().status is Status.OK
    assert begin(Wrong(), 0.0, 1.0, {}, ())().message == "wrong"


class Clock:
    now = 0.0

    def perf_counter(self) -> float:
        return self.now


def test_seconds_of_a_window_are_those_of_its_parts_but_for_what_was_done_at_the_same_time(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(metered, "time", clock)

    class Away:
        """A half elsewhere: its step takes so many seconds from when it is begun, 1 of them for messages."""

        name, blocks, strings, can_save, can_serialise = "away", {}, {}, True, True

        def __init__(self, seconds: float) -> None:
            self.seconds = seconds

        def begin(self, t, h, inputs, outputs):
            over = clock.now + self.seconds

            def answer() -> Advance:
                clock.now = max(clock.now, over)
                return Advance(Status.OK, "", {}, self.seconds - 1.0, transport=1.0)

            return answer

    meter = Meter()
    meter.begin()
    slow, quick = MeteredHalf(Away(9.0), "thermal", meter), MeteredHalf(Away(4.0), "mechanical", meter)
    answers = [half.begin(0.0, 1.0, {}, ()) for half in (slow, quick)]
    clock.now += 0.5
    for answer in answers:
        answer()
    quick.advance(1.0, 1.0, {}, ())
    meter.solved()
    timing = meter.end()
    parts = dict(zip(PARTS, timing.parts, strict=True))
    assert {n: parts[n] for n in ("seconds", "thermal", "mechanical", "transport", "overlap", "coupler", "thermal_wait",
                                  "mechanical_wait")} == {
        "seconds": 13.0, "thermal": 8.0, "mechanical": 6.0, "transport": 3.0, "overlap": 4.0, "coupler": 0.0,
        "thermal_wait": 4.0, "mechanical_wait": 5.0}
    assert timing.calls[:, 2:4].tolist() == [[0.0, 9.0], [0.0, 4.0], [9.0, 4.0]]


def course(fmu: Path, kill=lambda p, k: None, **options) -> bytes:
    """Eight windows of two halves, both asked at once; `kill` is called while both are at work."""
    bits, t = [], 0.0
    with two(fmu, **options) as p:
        for k in range(8):
            h = 1.0 + 0.1 * k
            tokens = [half.save() for half in p.halves.values()]
            answers = [begin(half, t, h, {"x": X * h}, ["y", "x"]) for half in p.halves.values()]
            kill(p, k)
            for answer in answers:
                done = answer()
                assert done.status is Status.OK
                bits += [v.tobytes() for v in done.outputs.values()]
            for half, token in zip(p.halves.values(), tokens, strict=True):
                if k % 3 == 2:
                    half.restore(token)
                half.release(token)
            t += 0.0 if k % 3 == 2 else h
        bits += [half.read(["y"])["y"].tobytes() for half in p.halves.values()]
    return b"".join(bits)


@pytest.mark.slow
@pytest.mark.parametrize("victims", [("contact",), ("thermal",), ("mechanical",), ("thermal", "mechanical"), ROLES],
                         ids="+".join)
def test_who_died_while_all_were_at_work_is_started_anew_and_nothing_else_happened(fmu, victims):
    killed: list[int] = []

    def kill(p, k: int) -> None:
        if k in (1, 5):
            mine = [p.pids[name] for name in victims]
            for pid in mine:
                os.kill(pid, signal.SIGKILL)
            assert gone(mine)
            killed.extend(mine)

    whole = course(fmu)
    assert course(fmu, kill, restarts=2 * len(victims)) == whole
    assert len(set(killed)) == 2 * len(victims)


@pytest.mark.slow
def test_two_halves_at_once_take_as_long_as_one(fmu):
    with two(fmu) as p:
        begun = time.perf_counter()
        answers = [begin(half, 0.0, 6.0, {"x": X}, ["y"]) for half in p.halves.values()]  # it sleeps for 6 s
        assert [answer().status for answer in answers] == [Status.OK] * 2
        assert 6.0 < time.perf_counter() - begun < 11.0


@pytest.mark.slow
def test_a_parallel_run_in_processes_has_the_bits_of_one_in_this_process(tmp_path: Path) -> None:
    here, away = tmp_path / "here.h5", tmp_path / "away.h5"
    scenario = load_scenario(SCENARIO, SMALL)
    run(scenario, here)
    run(scenario, away, processes=True)
    a, b = Results(here), Results(away)
    for name in a.probe_names:
        np.testing.assert_array_equal(a.probe(name)[1], b.probe(name)[1])
    assert a.windows.thermal_solves.sum() == b.windows.thermal_solves.sum() > 0
    assert not (a.timings.overlap > 1e-6).any()
    assert (b.timings.overlap[np.isfinite(b.timings.begun)] > 0.0).any()
    assert shares_over_time(b)[1].sum(axis=0).max() <= 1.0 + 1e-9
