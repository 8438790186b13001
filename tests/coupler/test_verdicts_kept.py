"""A verdict on a half of another package is kept, for just what it depends on; a damaged one is one more check."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from coupler import load_scenario
from coupler.errors import HalfError
from coupler.fmu.launch import KEEP_DAYS, VERDICTS, _drop_old, build_half, clear_cache
from coupler.scenario import Scenario
from coupler.trust.checks import TrustVerdict
from coupler.verify import verdicts
from coupler.verify.border import Finding, failed, not_applicable, passed
from coupler.verify.child import ALIVE
from coupler.verify.verdicts import Verify, read_verdict, trust_rows, verdicts_of, write_verdict

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
from broken_halves import SCENE
from make import make_wall

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux",
                                reason="the half in C needs a C compiler (cc), which is not here")
GOOD = (passed("role", "thermal"), not_applicable("heat warms a body", "it takes no E_M"))
BAD = (*GOOD, failed("time passes", "a substep of 0.001 s changes T", "A substep goes from t to t + h"))


class Bench:
    """Finds what it is told to find, and counts how often it is asked.  found : or what is raised."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.found: tuple[Finding, ...] | HalfError = GOOD

    def __call__(self, fmu: Path, scratch: Path, h: float, scene: Any, limit: float, **more: Any) -> Iterator[Finding]:
        self.asked.append({"h": h, "limit": limit, **more})
        if isinstance(self.found, HalfError):
            raise self.found
        yield from self.found


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Bench:
    made = Bench()
    monkeypatch.setattr(verdicts, "findings_of", made)
    monkeypatch.setenv("SLIDELINE_CACHE", str(tmp_path / "cache"))
    return made


@pytest.fixture(scope="module")
def walls(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two walls in C, which differ in where they start."""
    folder = tmp_path_factory.mktemp("walls")
    (folder / "s.yaml").write_text(SCENE)
    i = load_scenario(folder / "s.yaml").interface
    return [make_wall(folder / f"{T:g}", len(i.nodes), len(i.pair_nodes), T) for T in (293.15, 300.0)]


def scene_of(wall: Path, folder: Path, **more: Any) -> Scenario:
    (folder / "s.yaml").write_text(SCENE)
    return load_scenario(folder / "s.yaml", overrides={
        "thermal.half": str(wall), "thermal.boundary": [], "bodies.upper.T0": 20, "mechanical.half": "rigid", **more})


def judged(scenario: Scenario, how: Verify = Verify.ONCE, **more: Any) -> Any:
    kind = scenario.kinds["thermal"]
    return verdicts_of(scenario, {"thermal": build_half(kind, Path())}, how, **more)


def files(folder: Path) -> list[Path]:
    return sorted((folder / "cache" / VERDICTS).glob("*"))


def test_a_half_is_checked_once(bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    told: list[str] = []
    first = judged(scene_of(walls[0], tmp_path), tell=told.append)
    assert [t.partition(" against")[0] for t in told[:1]] == ["checking the thermal half wall.fmu"]
    assert "meets the interface specification: 1 passed, 1 not applicable" in told[1]
    again = judged(scene_of(walls[0], tmp_path), tell=told.append)
    assert (len(bench.asked), len(told)) == (1, 2)
    assert again == (replace(first[0], known=True),)
    (row,) = trust_rows(again)
    assert row.verdict is TrustVerdict.HOLDS
    assert row.what == "thermal half wall.fmu: 1 checks passed, not checked: heat warms a body (it takes no E_M)"


OTHER: dict[str, dict[str, Any]] = {
    "start": {"bodies.lower.T0": 25}, "mesh": {"bodies.lower.mesh.rectangle.origin": [0.001, 0]},
    "material": {"materials.steel.rho": 7900},
    "windows": {"coupling.windows": [{"until": 12, "size": 0.5}]}}
SAME: dict[str, dict[str, Any]] = {
    "end": {"coupling.end": 6, "coupling.windows": [{"until": 6, "size": 1}]},
    "windows of its size": {"coupling.windows": [{"until": 12, "size": 3}]},
    "scheme": {"coupling.scheme": "iterated"}, "probes": {"probes": {}},
    "what no rigid half knows": {"materials.steel.alpha": 1e-5}, "title": {"title": "another"}}


@pytest.mark.parametrize(("name", "times"), [*((n, 2) for n in OTHER), *((n, 1) for n in SAME)])
def test_what_of_the_scene_matters_asks_for_another_check(name: str, times: int, bench: Bench, walls: list[Path],
                                                          tmp_path: Path) -> None:
    judged(scene_of(walls[0], tmp_path))
    judged(scene_of(walls[0], tmp_path, **(OTHER | SAME)[name]))
    assert len(bench.asked) == times


def test_another_fmu_and_other_checks_ask_for_another_check(bench: Bench, walls: list[Path], tmp_path: Path,
                                                            monkeypatch: pytest.MonkeyPatch) -> None:
    for wall in walls:
        judged(scene_of(wall, tmp_path))
    assert len(bench.asked) == 2
    monkeypatch.setattr(verdicts, "checks_hash", lambda: {"verify": "another"})
    judged(scene_of(walls[0], tmp_path))
    assert len(bench.asked) == 3
    assert len(files(tmp_path)) == 3


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-20])


def turned(file: Path) -> None:
    """A failure that became a pass."""
    file.write_text(file.read_text().replace('"FAIL"', '"pass"'))


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut": cut, "turned": turned, "empty": lambda f: f.write_text(""), "zeros": lambda f: f.write_bytes(bytes(300)),
    "no verdict": lambda f: f.write_text("[1, 2]"), "number": lambda f: f.write_text("7"),
    "nothing found": lambda f: f.write_text(json.dumps({"findings": [], "sum": verdicts._sum([])})),
    "deep": lambda f: f.write_text("[" * 100_000), "no text": lambda f: f.write_bytes(b"\xff\xfe\x00"),
    "folder": lambda f: (f.unlink(), f.mkdir())}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_verdict_is_one_more_check(damage: str, bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    bench.found = BAD
    for times in (1, 1):
        with pytest.raises(HalfError, match=r"(?s)nothing was run.*\(time passes\):.*thermal half .*: time passes: "):
            judged(scene_of(walls[0], tmp_path))
        assert len(bench.asked) == times
    (file,) = files(tmp_path)
    DAMAGES[damage](file)
    with pytest.raises(HalfError, match="time passes"):
        judged(scene_of(walls[0], tmp_path))
    assert len(bench.asked) == 2
    if damage != "folder":
        with pytest.raises(HalfError, match="time passes"):
            judged(scene_of(walls[0], tmp_path))
        assert len(bench.asked) == 2, "it was mended"


def test_one_that_hung_is_checked_again(bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    """It may have hung for want of time or memory."""
    bench.found = (*GOOD, failed(ALIVE, "it gave no answer for 60 s", "A step that does not work out is a Discard"))
    for times in (1, 2):
        with pytest.raises(HalfError, match=ALIVE):
            judged(scene_of(walls[0], tmp_path))
        assert len(bench.asked) == times
    assert files(tmp_path) == []


def test_verify_checks_anew_and_no_verify_not_at_all(bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    scene = scene_of(walls[0], tmp_path)
    (left,) = judged(scene, Verify.NEVER)
    assert bench.asked == []
    (row,) = trust_rows((left,))
    assert (row.verdict, row.what) == (TrustVerdict.UNCHECKED,
                                       "thermal half wall.fmu: not checked: left out (--no-verify)")
    (unknown,) = judged(scene, Verify.KNOWN)
    assert unknown.why_not == "no verdict on it is known"
    judged(scene)
    judged(scene, Verify.ANEW)
    assert [row["most"] for row in bench.asked] == [verdicts.MOST, float("inf")]
    (known,) = judged(scene, Verify.KNOWN)
    assert known.known
    assert len(bench.asked) == 2


def test_a_broken_half_that_runs_on_is_not_to_be_trusted(bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    """A run that is resumed reads the verdict; one that was left out when it began may have been found meanwhile."""
    bench.found = BAD
    with pytest.raises(HalfError, match="time passes"):
        judged(scene_of(walls[0], tmp_path))
    (row,) = trust_rows(judged(scene_of(walls[0], tmp_path), Verify.KNOWN))
    assert row.verdict is TrustVerdict.BROKEN
    assert "time passes: a substep of 0.001 s changes T" in row.sentence


def test_ours_are_not_checked(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SCENE)
    assert verdicts_of(load_scenario(tmp_path / "s.yaml"), {}, Verify.ANEW) == ()
    assert trust_rows(()) == ()
    assert bench.asked == []


def test_a_call_may_take_as_long_as_the_scene_says(bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    judged(scene_of(walls[0], tmp_path, **{"coupling.deadlines.thermal": 7}))
    assert bench.asked[0]["limit"] == 7.0


def test_one_that_runs_on_another_machine_need_not_run_here(bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    bench.found = HalfError("the FMU's library cannot be loaded: no binary for linux64")
    with pytest.raises(HalfError, match="cannot be loaded"):
        judged(scene_of(walls[0], tmp_path))
    (verdict,) = judged(scene_of(walls[0], tmp_path), elsewhere=True)
    assert "it runs on another machine, and not on this one (the FMU's library cannot be loaded" in verdict.text
    assert files(tmp_path) == []


def test_a_cache_that_cannot_be_written_costs_a_check(bench: Bench, walls: list[Path], tmp_path: Path) -> None:
    fmu = {"thermal": build_half(str(walls[0]), Path())}
    (tmp_path / "cache" / VERDICTS).write_text("a file where the folder should be")
    for times in (1, 2):
        verdicts_of(scene_of(walls[0], tmp_path), fmu, Verify.ONCE)
        assert len(bench.asked) == times


def test_many_may_write_and_read_one_verdict(tmp_path: Path) -> None:
    """Whoever reads finds a whole verdict or none, and nothing is left beside it."""
    file, rows = tmp_path / "v" / "one.json", GOOD * 500
    with ThreadPoolExecutor(8) as pool:
        writers = [pool.submit(write_verdict, file, rows) for _ in range(40)]
        while not file.exists():
            time.sleep(0.001)
        assert all(read_verdict(file) == rows for _ in range(40))
        for writer in writers:
            writer.result()
    assert [p.name for p in file.parent.iterdir()] == ["one.json"]


def test_verdicts_go_with_the_cache_and_with_time(tmp_path: Path) -> None:
    folder = tmp_path / VERDICTS
    for name, days in (("old", KEEP_DAYS + 1), ("new", 1)):
        write_verdict(folder / f"{name}.json", GOOD)
        then = time.time() - days * 86400
        os.utime(folder / f"{name}.json", (then, then))
    _drop_old(tmp_path)
    assert [p.stem for p in folder.iterdir()] == ["new"]
    clear_cache(tmp_path)
    assert not folder.exists()
