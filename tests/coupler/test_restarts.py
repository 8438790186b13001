"""Who died is started anew where the scenario allows it, and the run gives the bits of one that nobody disturbed."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from contact.rpc.calls import ServiceDownError
from coupler import HalfError, Results, load_scenario, run
from coupler.fmu.half import Status
from coupler.fmu.replayed import ReplayedHalf
from coupler.running.resume import resume

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from killed_roles import CHANGED, ROLES, SCENARIO, children, killed_run  # noqa: E402
from killed_runs import differences  # noqa: E402
from test_processes import X, ended, gone, two  # noqa: E402


@pytest.fixture
def fmu(tmp_path) -> Path:
    path = tmp_path / "toy.fmu"
    path.touch()
    return path


def course(fmu: Path, kill=lambda p, k: None, **options) -> bytes:
    """Twelve windows of two halves, every third one put back once; `kill` is called before each step."""
    bits, t = [], 0.0
    with two(fmu, **options) as p:
        for k in range(12):
            tokens = [half.save() for half in p.halves.values()]
            for name, half in p.halves.items():
                kill(p, k)
                done = half.advance(t, 1.0 + 0.1 * k, {"x": X * (1.0 + 0.1 * k)}, ["y", "x"])
                assert done.status is Status.OK
                bits += [v.tobytes() for v in done.outputs.values()]
                if k % 3 == 2 and name == "mechanical":
                    for other, token in zip(p.halves.values(), tokens, strict=True):
                        other.restore(token)
                    bits += [other.advance(t, 1.0 + 0.1 * k, {}, ["y"]).outputs["y"].tobytes()
                             for other in p.halves.values()]
            for half, token in zip(p.halves.values(), tokens, strict=True):
                half.release(token)
            t += 1.0 + 0.1 * k
        bits += [half.read(["y", "sum"])["y"].tobytes() for half in p.halves.values()]
    return b"".join(bits)


@pytest.mark.few("contact")
@pytest.mark.parametrize("victim", ROLES)
def test_who_died_between_two_calls_is_started_anew_and_nothing_else_happened(fmu, victim):
    killed = []

    def kill(p, k: int) -> None:
        if k in (0, 5, 8) and p.pids[victim] not in killed and len(killed) < 4:
            killed.append(p.pids[victim])
            os.kill(killed[-1], signal.SIGKILL)
            assert gone(killed)

    whole = course(fmu)
    assert course(fmu, kill, restarts=4) == whole
    assert len(killed) >= 3


@pytest.mark.few("thermal")
@pytest.mark.parametrize("victim", ROLES)
def test_who_dies_again_and_again_is_named_when_the_restarts_are_used_up(fmu, victim):
    def trouble(p) -> None:
        for k in range(20):
            os.kill(p.pids[victim], signal.SIGKILL)
            time.sleep(0.2)
            p.halves["thermal"].advance(float(k), 1.0, {}, [])
            p.halves["mechanical"].advance(float(k), 1.0, {}, [])
            told[:] = p.restarts

    told: list[str] = []
    end = ended(fmu, trouble, restarts=2)
    assert isinstance(end.error, ServiceDownError if victim == "contact" else HalfError)
    assert re.search(f"{victim}.*signal 9", str(end.error))
    assert len(told) == 2
    assert re.fullmatch(f".*{victim}.*: its process was ended by signal 9.*; started anew, 2 of 2", told[1])


def test_a_half_that_fails_or_is_stuck_is_not_started_anew(fmu):
    def trouble(p) -> None:
        try:
            p.halves["thermal"].read(["nothing"])
        finally:
            told[:] = p.restarts

    told: list[str] = []
    assert "no block" in str(ended(fmu, trouble, restarts=5).error)
    assert told == []


def test_a_half_that_gives_other_numbers_the_second_time_is_not_believed(fmu):
    with two(fmu, restarts=1) as p:
        half = p.halves["thermal"]
        assert isinstance(half, ReplayedHalf)
        half.advance(0.0, 1.0, {"x": X}, ["y", "x"])
        assert half.at is not None
        assert half.at.step is not None
        half.at.step.inputs["x"][:] *= 1.0 + 1e-12
        os.kill(p.pids["thermal"], signal.SIGKILL)
        with pytest.raises(HalfError, match="did not do again what the old one had done"):
            half.advance(1.0, 1.0, {}, ["y"])


def test_the_way_to_a_state_is_as_long_as_the_time_since_one_was_written_down(fmu):
    with two(fmu) as p:
        half = p.halves["thermal"]
        for _ in range(5):
            token = half.save()
            half.advance(0.0, 1.0, {"x": X}, ["y"])
            half.restore(token)
            half.release(token)
        assert half.at is not None
        assert half.at.data is not None  # nothing stands of what was put back
        for k in range(3):
            half.advance(float(k), 1.0, {"x": X}, ["y"])
        assert half.at.data is None
        assert half.at.seconds == 0.75
        token = half.save()
        half.serialise(token)
        assert half.at.data is not None
        assert half.at.before is None


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "run.h5"
    run(load_scenario(SCENARIO, CHANGED), out)
    return out


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_each_role_killed_at_random_moments_gives_the_bits_of_an_undisturbed_run(whole, tmp_path, seed):
    killed = killed_run(whole, tmp_path / "run.h5", seed)
    assert killed.roles
    assert 1 <= killed.restarts <= len(killed.roles)
    assert re.match(r"at t = .* s: .*: its process was ended by signal 9", Results(tmp_path / "run.h5").notes[-1])
    assert killed.differences == []
    assert children() == {}


@pytest.mark.slow
@pytest.mark.parametrize("victim", ROLES)
def test_without_restarts_nothing_is_lost_either(whole, tmp_path, victim):
    """Checkpoints are written every half a minute: the run is over before the second."""
    out = tmp_path / "run.h5"

    def kill(progress) -> None:
        if progress.number == 10:
            threading.Timer(0.02, os.kill, (children()[victim], signal.SIGKILL)).start()

    with pytest.raises((HalfError, ServiceDownError)) as died:
        run(load_scenario(SCENARIO, CHANGED), out, processes=True, on_window=kill)
    ended = Results(out)
    assert ended.outcome == "failed"
    assert victim in ended.message
    assert len(ended.windows) >= 10
    assert died.value.__notes__[-1] == f"`slideline resume {out} --processes` goes on from t = {ended.t[-1]:.9g} s"
    resume(out)
    assert differences(whole, out) == []


