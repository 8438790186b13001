"""A half that fails leaves a run that goes on from its last accepted window, and its own words as the cause."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from coupler import HalfError, Results, load_scenario, run
from coupler.fmu.fmi import FmuHalf
from coupler.running.resume import resume, resumed

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from killed_runs import differences  # noqa: E402

pytestmark = pytest.mark.usefixtures("unlooked")

SCENARIO = HERE.parents[1] / "scenarios/casting_1d.yaml"
CHANGED = {"coupling.end": 0.3}
STEP = 9


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "run.h5"
    run(load_scenario(SCENARIO, CHANGED), out)
    return out


def failing(monkeypatch, half: str, status: str) -> None:
    """One half answers a step with `error` or `fatal`, after its solver went somewhere else."""
    steps = 0
    advance = FmuHalf.advance

    def wrong(self, t, h, inputs, outputs):
        nonlocal steps
        steps += self.name == half
        done = advance(self, t, h, inputs, outputs)
        if self.name == half and steps == STEP:
            self._dead = status == "fatal"
            raise self._error(f"fmi2DoStep answered {status}")
        return done

    monkeypatch.setattr(FmuHalf, "advance", wrong)


@pytest.mark.few("mechanical")
@pytest.mark.parametrize("half", ["thermal", "mechanical"])
def test_after_an_error_the_last_accepted_window_is_kept(whole, tmp_path, monkeypatch, half):
    """Four windows were lost: the checkpoint of half a minute before was all there was."""
    out = tmp_path / "run.h5"
    failing(monkeypatch, half, "error")
    with pytest.raises(HalfError, match=f"half '{half}': fmi2DoStep answered error") as died:
        run(load_scenario(SCENARIO, CHANGED), out)
    monkeypatch.undo()
    left = Results(out)
    assert left.t[-1] > 0.0
    assert died.value.__notes__ == [f"`slideline resume {out}` goes on from t = {left.t[-1]:.9g} s"]
    assert resumed(out).start == left.t[-1]
    resume(out)
    assert differences(whole, out) == []


def test_fatal_keeps_its_cause_and_the_checkpoint_there_was(whole, tmp_path, monkeypatch):
    out = tmp_path / "run.h5"
    failing(monkeypatch, "mechanical", "fatal")
    with pytest.raises(HalfError, match="half 'mechanical': fmi2DoStep answered fatal") as died:
        run(load_scenario(SCENARIO, CHANGED), out)
    monkeypatch.undo()
    assert Results(out).message.startswith("half 'mechanical': fmi2DoStep answered fatal")
    assert died.value.__notes__ == [f"`slideline resume {out}` goes on from t = 0 s"]
    resume(out)
    assert differences(whole, out) == []
