"""Advice on a lumped scene, run: what is left out may be, what is kept must be, and what it has found is kept."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.experiments.advise import FULL_MODEL, Advice, AdviceOptions, advise
from coupler.experiments.variants import RIGID_REST

sys.path.insert(0, str(Path(__file__).parent))
from small_scenes import LUMPED_GAP

# E4 that never touches, with two paths more: the wall's near radiation, some 4 of 2e3 W/m2K, and far radiation of
# 1e-3 of that.
SCENE = LUMPED_GAP.format(T0=840, method="sdirk2", scheme="iterated", end=6, size=0.5).replace(
    "gap_max: 0.01", "gap_max: 0.01\n    radiation: {emissivity_slave: 0.05, emissivity_master: 0.05}").replace(
    "closed: {law: constant, h: 6000}", "closed: null").replace(
    "    - {on: wall.right", "    - {on: body.left, radiation: {emissivity: 1.0e-3, T: 933}}\n    - {on: wall.right")
# K: E4 goes from 840 K to 831.7 K; what its schemes miss they miss in the first 2 s.
ASKED = ("T=0.3K",)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("advise") / "scene.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return path


class Told:
    """Remembers what is told; after `stop` trials it is Ctrl-C."""

    def __init__(self, stop: int = 1000) -> None:
        self.names: list[str] = []
        self._stop = stop

    def __call__(self, name: str) -> Callable[[float], object]:
        if len(self.names) == self._stop:
            raise KeyboardInterrupt
        self.names.append(name)
        return lambda share: None


def test_what_was_found_before_ctrl_c_is_not_tried_again(scene: Path, tmp_path: Path) -> None:
    stopped, again = Told(3), Told(1)
    for told in (stopped, again):
        found = advise(scene, tmp_path / "a", AdviceOptions(ASKED), told)
        assert found.interrupted
        assert found.file is None
        assert any(f"{RIGID_REST} changes T by" in line for line in found.lines)
        assert found.lines[-1].startswith("stopped by Ctrl-C")
    assert {FULL_MODEL, RIGID_REST} <= set(stopped.names)
    assert not set(stopped.names) & set(again.names)


@pytest.fixture(scope="module")
def advices(scene: Path) -> tuple[Advice, Told, Advice, Told]:
    """One that Ctrl-C stopped before its fourth trial, and the same again."""
    first, second = Told(3), Told()
    return (advise(scene, scene.parent / "a", AdviceOptions(ASKED), first), first,
            advise(scene, scene.parent / "a", AdviceOptions(ASKED), second), second)


@pytest.mark.slow
def test_ctrl_c_keeps_the_findings(advices: tuple[Advice, Told, Advice, Told]) -> None:
    stopped, first, done, second = advices
    assert stopped.interrupted
    assert stopped.file is None
    assert any(f"{RIGID_REST} changes T by" in line for line in stopped.lines)
    assert stopped.lines[-1].startswith("stopped by Ctrl-C")
    assert not done.interrupted
    assert not {FULL_MODEL, RIGID_REST} & set(second.names)
    assert set(first.names) & {FULL_MODEL, RIGID_REST}


@pytest.mark.slow
def test_what_it_leaves_out_and_what_it_keeps(advices: tuple[Advice, Told, Advice, Told]) -> None:
    findings = advices[2].findings
    good = {t.simplification.name: t.acceptable for t in findings.trials}
    assert not good[RIGID_REST]
    assert not good["convection on body.left"]
    assert not good["conduction across the gap (gap)"]
    assert not good["thermal expansion of metal"]
    assert good["far radiation on body.left"]
    assert good["near radiation (gap)"]
    assert {r.name for r in findings.accepted} >= {"far radiation on body.left", "near radiation (gap)"}
    # It iterates at three times the solver calls of either: .375 K and .277 K off.
    assert not good["scheme staggered"]
    assert good["scheme extrapolated"]
    assert findings.combined is not None
    assert findings.full is not None
    assert findings.combined.solver_calls < 0.5 * findings.full.solver_calls
    # It has one cell a body, so it is tried on its own mesh, and longer windows than its own hold.
    assert "it has the scenario's own mesh and windows 4 times as long" in advices[2].lines


@pytest.mark.slow
def test_the_advised_scenario_is_as_near_as_it_says(scene: Path, advices: tuple[Advice, Told, Advice, Told]) -> None:
    done = advices[2]
    assert done.file is not None
    full, cheap = (run(load_scenario(path), scene.parent / f"{path.stem}.h5") for path in (scene, done.file))
    off = np.abs(_on(full) - _on(cheap)).max()
    assert off <= 0.3
    # The last run of the combination is this very run.
    assert off == pytest.approx(done.findings.combined_error["T"].largest, rel=0.05)


def _on(results: Results) -> np.ndarray:
    """T at times that are window ends of both."""
    t, T = results.probe("T")
    return np.interp(np.arange(0.0, 6.5, 2.0), t, T)


@pytest.mark.slow
def test_no_time(scene: Path, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "coupler.cli", "advise", str(scene), "-o", str(tmp_path / "a"),
                           "--limit", "1e-3"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "no result: time is up\n"


@pytest.mark.slow
def test_a_wrong_wish(scene: Path, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "coupler.cli", "advise", str(scene), "-o", str(tmp_path / "a"),
                           "--for", "T"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "--for: a goal is PROBE=TOLERANCE" in done.stderr
    assert not (tmp_path / "a").exists()
