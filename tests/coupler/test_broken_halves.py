"""Halves of wrong physics are named with half, block, row, value and remedy: by a run, or by `verify-half`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import load_scenario
from coupler.errors import CouplingError, HalfError
from coupler.fmu.bounds import BorderScene, border_scene, scenario_border, start_turns, wrong_start, wrong_values
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Block, Half
from coupler.fmu.held import HeldHalf
from coupler.fmu.launch import Launched, build_half, launch
from coupler.running import run as running
from coupler.running.run import Run
from coupler.scenario import Scenario
from coupler.verify.border import CheckVerdict
from coupler.verify.conformance import verify_half
from coupler.verify.matter import known_scene
from coupler.verify.physics import AGREES, PHYSICS

sys.path.insert(0, str(Path(__file__).parent))
from broken_halves import CASES, FREE, NUMBERS, SCENE, Broken, Case, on


@dataclass(frozen=True)
class Built:
    scenario: Scenario
    fmus: Mapping[str, Path]
    border: BorderScene
    free: Built | None = None

    def of(self, case: Case) -> Built:
        return self.free if case.scene == "free" and self.free is not None else self

    def broken(self, case: Case) -> Callable[[], Half]:
        def make() -> Half:
            half = case.kind(load_half(self.fmus[case.role], None, case.role), case.rule, takes=case.takes,
                             hears=case.hears)
            half.X = self.scenario.interface.nodes
            return half
        return make


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    free = built_of(FREE, tmp_path_factory.mktemp("free"), ("thermal", "mechanical"))
    return replace(built_of(SCENE, tmp_path_factory.mktemp("broken"), ("thermal", "mechanical")), free=free)


def built_of(text: str, folder: Path, roles: tuple[str, ...]) -> Built:
    (folder / "s.yaml").write_text(text)
    scenario = load_scenario(folder / "s.yaml")
    fmus = {role: build_half(scenario.write_half(role, folder / role), folder / role) for role in roles}
    return Built(scenario, fmus, known_scene(scenario.interface, scenario.models["thermal"],
                                             scenario.models["mechanical"]))


def solve(built: Built, out: Path, monkeypatch: pytest.MonkeyPatch, **instead: Half) -> Any:
    @contextmanager
    def launched(scenario: Scenario, *, processes: bool, hosts: Path | None = None,
                 join: object = None, built: object = None) -> Iterator[Launched]:
        with launch(scenario, processes=processes) as both:
            yield replace(both, **instead)

    monkeypatch.setattr(running, "launch", launched)
    with Run(built.scenario, out) as r:
        for _ in r.windows():
            pass
    return r


@pytest.mark.few("degrees Celsius", "below absolute zero", "millimetres", "pressures that pull")
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.says])
def test_a_run_names_it(name: str, built: Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = CASES[name]
    with pytest.raises((HalfError, CouplingError), match=f"(?s){case.says}"):
        solve(built, tmp_path / "run.h5", monkeypatch, **{case.role: built.broken(case)()})


# A plain run names the others by the same checks and the same rows (test_plain_run.py). An FMU of ours that is not
# finite discards, which another row finds; one that counts is the example of what shows late.
@pytest.mark.slow
@pytest.mark.parametrize("name", ["not a number", "counts its substeps"])
def test_verify_half_names_it(name: str, built: Built) -> None:
    case = CASES[name]
    built = built.of(case)
    findings = {f.check: f for f in verify_half(built.broken(case), 1.0, built.border)}
    assert findings[case.check].verdict is CheckVerdict.FAIL
    assert findings[case.check].reason
    assert findings[case.check].remedy


@pytest.mark.few("mechanical-pressed-unasked2")
@pytest.mark.parametrize(("role", "scene", "unasked"), [
    ("thermal", "pressed", {"answers to a gap"}), ("thermal", "free", set()),
    ("mechanical", "pressed", {"expands freely", "moves rigidly", "nodes in order"}),
    ("mechanical", "free", set())])
def test_a_half_that_is_right_passes_all_of_it(role: str, scene: str, unasked: set[str], built: Built) -> None:
    right = Case(role, lambda half, got, h: got, "", "", scene=scene, cause="")
    built = built.of(right)
    verdicts = {f.check: f.verdict for f in verify_half(built.broken(right), 1.0, built.border)}
    assert [check for check, verdict in verdicts.items() if verdict is CheckVerdict.FAIL] == []
    assert verdicts["starts as the scene"] is CheckVerdict.PASS
    assert {check for check in PHYSICS[role] if verdicts[check] is not CheckVerdict.PASS} == {*unasked, AGREES}


def test_a_run_of_halves_that_are_right_is_the_same_run(built: Built, tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    """What a held half gives out are the bits of the half itself."""
    held = solve(built, tmp_path / "held.h5", monkeypatch).state.now
    monkeypatch.setattr(running, "held_halves", lambda launched, scenario: launched)
    bare = solve(built, tmp_path / "bare.h5", monkeypatch).state.now
    assert held.T.tobytes() == bare.T.tobytes()
    assert held.x.tobytes() == bare.x.tobytes()


def renamed(half: Half, old: str, new: str) -> Half:
    found = Broken(half, lambda _, got, h: got)
    found.blocks = {(new if n == old else n): b for n, b in half.blocks.items()}
    return found


def test_a_block_that_is_missing_is_named(built: Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    half = load_half(built.fmus["mechanical"], None, "mechanical")
    with pytest.raises(HalfError, match=r"(?s)half 'mechanical': it has no x, which a mechanical half must have as "
                                        r"output; it has .*coordinates.*Give the variable that name"):
        solve(built, tmp_path / "run.h5", monkeypatch, mechanical=renamed(half, "x", "a.coordinates"))


@pytest.mark.parametrize(("block", "says"), [
    (Block("T", (99,), "K", "output", "Real"), r"its T has shape \(99,\), but the scene has 21 rows"),
    (Block("T", (21,), "K", "local", "Real"), "its T is local, not output"),
    (Block("T", (21,), "Rankine", "output", "Real"), "its T is in Rankine, which cannot be made K")])
def test_blocks_no_run_can_use_are_named(block: Block, says: str, built: Built) -> None:
    half = load_half(built.fmus["thermal"], None, "thermal")
    wrong = Broken(half, lambda _, got, h: got)
    wrong.blocks = {**half.blocks, "T": block}
    with pytest.raises(HalfError, match=says):
        HeldHalf(wrong, "thermal", built.border)


def test_the_mesh_is_known_in_any_place_and_with_any_small_strain(built: Built) -> None:
    """A half may begin moved, turned by less than a right angle and strained; it may not begin inside out."""
    X = built.scenario.interface.nodes
    turn = np.array([[np.cos(1.2), -np.sin(1.2)], [np.sin(1.2), np.cos(1.2)]])
    strain = np.array([[1.1, 0.05], [0.0, 0.9]])
    assert wrong_start("mechanical", {"x": X @ (turn @ strain).T + 3.0}, built.border) is None
    mirrored = wrong_start("mechanical", {"x": X * (-1.0, 1.0)}, built.border)
    assert mirrored is not None
    assert "turned inside out" in mirrored.text


def test_a_body_may_begin_turned_as_its_motion_says(built: Built) -> None:
    """By 120 degrees as stated, or the same and less than a right angle more; not by what nothing states."""
    i = built.scenario.interface
    about = {"rotation": {"about": [0.0, 0.0], "angle": {"t": [0.0, 1.0], "value": [2.1, 5.0]}}}
    models = {**built.scenario.models, "mechanical": {"motion": {name: about for name in i.bodies}}}
    border = scenario_border(replace(built.scenario, models=models))
    assert border.turns.tolist() == [2.1] * len(i.bodies)
    one, other = i.bodies[:2]
    on = start_turns(i, {"boundary": [{"on": f"{one}.left", "u_x": 0}, {"on": f"{one}.left", **about},
                                      {"body": other, "angle": 3}]})
    assert on.tolist()[:2] == [2.1, 3.0]
    for angle, right in ((2.1, True), (2.1 + 1.5, True), (2.1 - 1.5, True), (2.1 + 1.7, False), (0.0, False)):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        found = wrong_start("mechanical", {"x": i.nodes @ turn.T}, border)
        assert (found is None) is right
        assert right or (found is not None and "turned by more than a right angle" in found.text)


def test_a_scene_of_another_scale_has_its_own_bounds(built: Built) -> None:
    """One that starts hotter than anything may be as hot; one that states 0 K itself may go below it."""
    at = {"T": np.full(21, 150000.0)}
    assert wrong_values("thermal", at, built.border) is not None
    assert wrong_values("thermal", at, replace(built.border, T_high=np.full(21, 150000.0))) is None
    model = built.scenario.models["thermal"]
    bodies = {name: {**body, "T0": 0.0} for name, body in model["bodies"].items()}
    cold = border_scene(built.scenario.interface, {**model, "bodies": bodies})
    below = {"T": np.full(21, -1.0)}
    assert wrong_values("thermal", below, built.border) is not None
    assert wrong_values("thermal", below, cold) is None
    held = border_scene(built.scenario.interface, {**model, "boundary": [{"on": "lower.bottom", "temperature": 0.0}]})
    assert wrong_values("thermal", below, held) is None


def test_a_pull_is_right_on_tied_pairs_alone(built: Built) -> None:
    interface = built.scenario.interface
    tied = replace(interface, pairs=tuple(replace(pair, tied=True) for pair in interface.pairs))
    pulled = {"contact.t_N": np.full(len(interface.pair_nodes), 1e5)}
    assert wrong_values("mechanical", pulled, replace(built.border, interface=tied)) is None
    assert wrong_values("mechanical", pulled, built.border) is not None


def test_what_no_shorter_step_mends_stops_the_run_at_once(built: Built, tmp_path: Path,
                                                         monkeypatch: pytest.MonkeyPatch) -> None:
    """Shares in percent from the third substep on: no window is halved for them, as one is for temperatures.

    The third is of the look at the first window (coupler.control.spare), which tells nothing then.
    """
    late = Case("mechanical", on("contact.covered", lambda half, c: 100.0 * c if half.made > 2 else c), "", NUMBERS,
                cause="")
    half = built.broken(late)()
    with pytest.raises(CouplingError, match=r"window 2 .*contact\.covered"):
        solve(built, tmp_path / "run.h5", monkeypatch, mechanical=half)
    assert half.made == 4
    cold = built.broken(CASES["below absolute zero"])()
    with pytest.raises(CouplingError, match="the window was halved"):
        solve(built, tmp_path / "cold.h5", monkeypatch, thermal=cold)
    assert cold.made > 6


def test_a_half_without_a_hash_is_told(built: Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    half = load_half(built.fmus["thermal"], None, "thermal")
    mute = Broken(half, lambda _, got, h: got)
    mute.blocks = {n: b for n, b in half.blocks.items() if n != "mesh.hash"}
    mute.strings = {n: s for n, s in half.strings.items() if n != "mesh.hash"}
    notes = solve(built, tmp_path / "run.h5", monkeypatch, thermal=mute).notes
    assert any("thermal does not say of which mesh it is (mesh.hash)" in note for note in notes)
