"""What a check of a half needs is declared: of what is not there its row says so, and nothing is tried out."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from coupler import load_scenario
from coupler.errors import HalfError
from coupler.fmu.description import read_description, unpack, with_description
from coupler.fmu.fmi import load_half
from coupler.fmu.launch import build_half
from coupler.verify.behaviour import checks_of
from coupler.verify.bench import Declared
from coupler.verify.border import CheckVerdict, Finding
from coupler.verify.child import findings_of
from coupler.verify.conformance import verify_half
from coupler.verify.needs import NEEDS
from coupler.verify.verdicts import border_of

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from broken_halves import SCENE
from test_verify import Honest
from toy_halves import HALVES, build

LEFT = CheckVerdict.NOT_APPLICABLE


def found(kind: type[Honest], **declared: Any) -> dict[str, Finding]:
    return {f.check: f for f in verify_half(kind, 0.5, declared=Declared(**declared))}


def test_every_need_is_one_of_a_check() -> None:
    assert NEEDS.keys() <= checks_of("thermal").keys() | checks_of("mechanical").keys()


class Alone(Honest):
    """A half of which a process can hold one."""

    there = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        Alone.there += 1
        if Alone.there > 1:
            raise HalfError("the FMU could not be instantiated")

    def close(self) -> None:
        Alone.there -= 1


def test_one_that_a_process_holds_once_is_never_there_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Alone, "there", 0)
    rows = found(Alone, many=False)
    assert [f for f in rows.values() if f.verdict is CheckVerdict.FAIL] == []
    for check in ("same inputs, same bits", "reading has no side effect", "hot and cold caches, same bits",
                  "a rejected substep leaves no trace", "time passes"):
        assert rows[check].verdict is LEFT
        assert "canBeInstantiatedOnlyOncePerProcess" in rows[check].reason
    assert rows["save and restore to the bit"].verdict is CheckVerdict.PASS


class Metronome(Honest):
    """A half whose steps have one length."""

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Any:
        if h not in (0.0, 0.5):
            raise HalfError("fmi2DoStep answered error")
        return super().advance(t, h, inputs, outputs)


def test_one_whose_steps_have_one_length_is_asked_for_no_other() -> None:
    rows = found(Metronome, any_step=False)
    assert [f for f in rows.values() if f.verdict is CheckVerdict.FAIL] == []
    for check in ("time passes", "substeps converge", "substeps of one window"):
        assert rows[check].verdict is LEFT
        assert "canHandleVariableCommunicationStepSize" in rows[check].reason
    assert found(Metronome)["time passes"].verdict is CheckVerdict.FAIL, "it says that it takes any"


@pytest.mark.few("reads3-True")
@pytest.mark.parametrize(("reads", "left"), [
    (None, False), (frozenset({"materials"}), False), (frozenset({"materials.rho", "materials.c"}), False),
    (frozenset({"materials.rho"}), True), (frozenset(), True)])
def test_what_a_half_does_not_read_of_its_scene_is_not_asked_of_it(reads: frozenset[str] | None, left: bool,
                                                                   known: Any) -> None:
    make, scene = known
    rows = {f.check: f for f in verify_half(make, 1.0, scene, Declared(reads=reads))}
    assert (rows["heat warms a body"].verdict is LEFT) == left
    if left:
        assert rows["heat warms a body"].reason.startswith("it declares that it does not read materials.")
    else:
        assert rows["heat warms a body"].verdict is CheckVerdict.PASS


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Our thermal half in two blocks, and what is known of them."""
    folder = tmp_path_factory.mktemp("known")
    (folder / "s.yaml").write_text(SCENE)
    scenario = load_scenario(folder / "s.yaml")
    fmu = build_half(scenario.write_half("thermal", folder / "half"), folder / "half")
    return (lambda: load_half(fmu, None, "thermal")), border_of(scenario, "thermal")


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A toy, and the same that is said to be there once, with steps of one length: by both flags of its description."""
    folder = tmp_path_factory.mktemp("said")
    whole = build(folder / "half")
    flags = (b'canHandleVariableCommunicationStepSize="true"', b'canBeInstantiatedOnlyOncePerProcess="false"')
    return whole, with_description(whole, lambda xml: xml.replace(flags[0], b"").replace(flags[1], flags[1].replace(
        b"false", b"true")), folder / "said.fmu")


def test_what_an_fmu_can_do_is_read_from_its_description(said: tuple[Path, Path], tmp_path: Path) -> None:
    here = read_description(unpack(said[0], tmp_path / "whole"))
    assert (here.any_step, here.many) == (True, True)
    there = read_description(unpack(said[1], tmp_path / "said"))
    assert (there.any_step, there.many) == (False, False)
    kept = read_description(tmp_path / "said")
    assert (kept.any_step, kept.many) == (False, False), "as it lies beside the FMU from now on"


@pytest.mark.slow
def test_what_an_fmu_cannot_do_is_not_asked_of_it(said: tuple[Path, Path], tmp_path: Path,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(HALVES))
    (tmp_path / "scratch").mkdir()
    rows = {f.check: f for f in findings_of(said[1], tmp_path / "scratch", 1.0)}
    assert [f for f in rows.values() if f.verdict is CheckVerdict.FAIL] == []
    assert rows["same inputs, same bits"].verdict is rows["substeps converge"].verdict is LEFT
