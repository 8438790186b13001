"""tests/same_numbers.py on made-up files: what it calls equal, and what it must not."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from ruamel.yaml import YAML

sys.path.insert(0, str(Path(__file__).parent))
import same_numbers
from same_scenes import Scene, blocks, page_runs, page_scenes

T = np.array([300.0, 301.5, np.nan])
HEADER = {"title": "bars", "started": "today", "scenario": {"hash": "abc", "text": "end: 2  # seconds\n"},
          "halves": {"thermal": "FOLDER/half.fmu"}, "bodies": ["hot", "cold"], "coupling": {"kinks": [1, 2.5]}}


def made(folder: Path, scene: str = "bars", partial: bool = False) -> Path:
    """A folder as `store` leaves it, with one scene."""
    run = folder / "scenes" / scene / "embedded"
    run.mkdir(parents=True)
    (folder / "made.json").write_text(json.dumps({"folder": str(folder), "partial": partial, "on": {"numpy": "2"}}))
    with h5py.File(run / "run.h5", "w") as f:
        f.attrs.update(header=json.dumps(HEADER).replace("FOLDER", str(folder)), outcome="completed")
        f["probes/top"] = T
        f["probes/top"].attrs["unit"] = "K"
        f["windows"] = np.array([(0.0, b"accepted", 1.5)], dtype=[("t", "f8"), ("verdict", "S24"), ("seconds", "f8")])
        f["words"] = json.dumps([{"reason": "as asked", "fired": [["rule", "text", {"T": 3.0}]]}])
        f.create_group("monitors")
    with h5py.File(run / "run.thermal.vtkhdf", "w") as f:
        f["VTKHDF/Types"] = np.array([9, 9], dtype=np.uint8)
    half = folder / "scenes" / scene / "halves" / "thermal"
    half.mkdir(parents=True)
    (half / "model.json").write_text('{"half": "thermal", "bodies": {"steel": {"rho": 7800}}, "on": [{"kind": "T"}]}')
    return folder


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    return made(tmp_path / "before"), made(tmp_path / "after")


def held(pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    """The exit code of a comparison, and all it said."""
    code = same_numbers.main([*map(str, pair), *options])
    said = capsys.readouterr()
    return code, said.out + said.err


def in_run(folder: Path, change: Callable[[h5py.File], Any], name: str = "run.h5") -> None:
    with h5py.File(folder / "scenes/bars/embedded" / name, "r+") as f:
        change(f)


def in_header(folder: Path, **changes: Any) -> None:
    in_run(folder, lambda f: f.attrs.update(header=json.dumps({**json.loads(f.attrs["header"]), **changes})))


def set_row(column: str, value: Any) -> Callable[[h5py.File], None]:
    def change(f: h5py.File) -> None:
        rows = f["windows"][()]
        rows[column] = value
        f["windows"][...] = rows
    return change


def set_probe(value: Any) -> Callable[[h5py.File], None]:
    def change(f: h5py.File) -> None:
        f["probes/top"][...] = value
    return change


def test_the_same_is_equal_wherever_it_lies_and_nan_is_nan(pair, capsys):
    code, said = held(pair, capsys)
    assert (code, said) == (0, "bars: equal\n1 scenes: 1 equal\n")


def test_any_nan_is_like_any_other(pair, capsys):
    other = np.array([0xFFF8000000000001], dtype=np.uint64).view(float)[0]
    assert np.isnan(other)
    in_run(pair[1], set_probe([*T[:2], other]))
    assert held(pair, capsys)[0] == 0


def test_nan_is_no_number(pair, capsys):
    in_run(pair[1], set_probe([*T[:2], 7.0]))
    code, said = held(pair, capsys)
    assert code == 1
    assert "[2]: nan before, 7.0 after" in said


@pytest.mark.parametrize("value", [np.nextafter(301.5, 0), -301.5])
def test_one_bit_is_told_with_its_place_and_size(pair, capsys, value):
    in_run(pair[1], set_probe([300.0, value, np.nan]))
    code, said = held(pair, capsys)
    assert code == 1
    by = abs(value - 301.5)
    assert (f"bars: differs: 1 values, the largest embedded/run.h5/probes/top [1]: 301.5 before, {value} after, "
            f"by {by:.3g} ({by / 301.5:.2g} of its largest; 1 of 3 values)\n1 scenes: 1 differ\n") == said


def test_the_sign_of_a_zero_is_a_bit(pair, capsys):
    in_run(pair[0], set_probe([0.0, 0.0, 0.0]))
    in_run(pair[1], set_probe([0.0, -0.0, 0.0]))
    assert held(pair, capsys)[0] == 1


def delete(name: str) -> Callable[[h5py.File], None]:
    return lambda f: f.__delitem__(name)


CHANGES: dict[str, Callable[[Path], Any]] = {
    "a dataset": lambda folder: in_run(folder, delete("probes/top")),
    "an empty group": lambda folder: in_run(folder, delete("monitors")),
    "an attribute": lambda folder: in_run(folder, lambda f: f["probes/top"].attrs.update(unit="degC")),
    "a verdict": lambda folder: in_run(folder, set_row("verdict", b"rejected")),
    "a time": lambda folder: in_run(folder, set_row("t", 1e-300)),
    "a column": lambda folder: in_run(folder, lambda f: (delete("windows")(f), f.update(windows=np.zeros(1, "f8,f8")))),
    "a word": lambda folder: in_run(folder, lambda f: (delete("words")(f), f.update(words="[]"))),
    "a type": lambda folder: in_run(folder, lambda f: (delete("probes/top")(f), f.update({"probes/top": T[:2]}))),
    "a key": lambda folder: in_header(folder, title="other"),
    "a key with nothing in it": lambda folder: in_header(folder, more={}),
    "a number in a text": lambda folder: in_header(folder, coupling={"kinks": [1, 2.25]}),
    "a value of the scenario": lambda folder: in_header(folder, scenario={"hash": "abc", "text": "end: 3"}),
    "a field": lambda folder: in_run(folder, delete("VTKHDF/Types"), "run.thermal.vtkhdf"),
    "a model": lambda folder: (folder / "scenes/bars/halves/thermal/model.json").write_text('{"half": "thermal"}'),
    "a file": lambda folder: (folder / "scenes/bars/halves/thermal/model.json").unlink(),
    "half a scene": lambda folder: shutil.rmtree(folder / "scenes/bars/embedded"),
}


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("what", CHANGES)
def test_what_differs_is_seen_on_either_side(what, side, pair, capsys):
    CHANGES[what](pair[side])
    code, said = held(pair, capsys)
    assert code == 1
    assert said.startswith("bars: differs: ")


def test_all_differences_are_told_where_asked(pair, capsys):
    in_run(pair[1], delete("monitors"))
    in_header(pair[1], title="other")
    said = held(pair, capsys, "--all")[1]
    assert "  embedded/run.h5/monitors only before\n" in said
    assert "  embedded/run.h5/@header/title 'bars' before, 'other' after\n" in said


def test_what_no_two_runs_share_does_not_count(pair, capsys):
    in_run(pair[1], set_row("seconds", 99.0))
    in_header(pair[1], started="tomorrow", scenario={"hash": "def", "text": "# seconds\nend: 2\n"})
    assert held(pair, capsys)[0] == 0


def test_every_exclusion_has_its_reason():
    assert all(reason and pattern.startswith("*/") for pattern, reason in same_numbers.EXCLUDED.items())


@pytest.mark.parametrize(("path", "names", "after"), [
    ("embedded/run.h5/probes/top", {"*/run.h5/probes": "*/run.h5/sensors"}, "embedded/run.h5/sensors/top"),
    ("embedded/run.h5/probesque", {"*/run.h5/probes": "*/run.h5/sensors"}, "embedded/run.h5/probesque"),
    ("halves/thermal/model.json/bodies/hot/T0", {"*/model.json/bodies/*/T0": "*/model.json/start/*/T"},
     "halves/thermal/model.json/start/hot/T"),
    ("run.h5/probes/top", {"*/run.h5/probes": "*/run.h5/sensors", "*/sensors/top": "*/sensors/upper"},
     "run.h5/sensors/upper"),
])
def test_a_name_is_followed(path, names, after):
    assert same_numbers.renamed(path, names) == after


def test_what_was_renamed_is_equal(pair, capsys, monkeypatch):
    in_run(pair[1], lambda f: f.move("probes", "sensors"))
    assert held(pair, capsys)[0] == 1
    monkeypatch.setattr(same_numbers, "RENAMED", {"*/run.h5/probes": "*/run.h5/sensors"})
    assert held(pair, capsys)[0] == 0


def test_a_scene_may_be_meant_to_differ(pair, capsys, tmp_path):
    in_header(pair[1], title="other")
    file = tmp_path / "meant.toml"
    file.write_text('bars = "another title"\n')
    code, said = held(pair, capsys, "--expected", str(file))
    assert code == 0, said
    assert said.startswith("bars: differs: 1 values, the largest embedded/run.h5/@header/title 'bars' before, 'other' ")
    assert " (meant to differ: another title)\n" in said
    assert said.endswith("1 scenes: 1 meant to differ\n")
    assert held(pair, capsys, "--except", "bars")[0] == 0
    assert held(pair, capsys, "--except", "bras")[0] == 2


def test_what_is_meant_to_differ_and_does_not_is_said(pair, capsys):
    code, said = held(pair, capsys, "--except", "bars")
    assert code == 0
    assert said == "bars: equal (meant to differ: --except)\n1 scenes: 1 equal\n"


@pytest.mark.parametrize("side", [0, 1])
def test_a_scene_on_one_side_only_differs(side, pair, capsys):
    made(pair[side], "cans")
    code, said = held(pair, capsys)
    assert code == 1
    assert f"was not stored {('after', 'before')[side]}" in said


def test_a_scene_that_was_left_out_is_not_compared(tmp_path, capsys):
    pair = made(tmp_path / "before"), made(tmp_path / "after")
    made(pair[0], "cans")
    made_json = pair[1] / "made.json"
    made_json.write_text(made_json.read_text().replace("false", "true"))
    code, said = held(pair, capsys)
    assert code == 0
    assert said == "bars: equal\ncans: not compared\n2 scenes: 1 equal, 1 not compared\n"


def test_nothing_in_common_is_an_error(tmp_path, capsys):
    pair = made(tmp_path / "before", "cans", partial=True), made(tmp_path / "after", partial=True)
    code, said = held(pair, capsys)
    assert code == 2
    assert "nothing was compared" in said


def test_a_folder_that_is_not_there_is_named(pair, capsys, tmp_path):
    code, said = held((pair[0], tmp_path / "gone"), capsys)
    assert (code, said) == (2, f"error: {tmp_path / 'gone'}: no such folder\n")
    (pair[1] / "made.json").unlink()
    assert "not to its end" in held(pair, capsys)[1]


def test_nothing_is_stored_over_another(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert same_numbers.main(["store", str(tmp_path)]) == 2
    assert "is not empty" in capsys.readouterr().err


@pytest.fixture
def one_scene(monkeypatch, tmp_path):
    """A store of one scene, bars, that takes no time."""
    monkeypatch.setattr(same_numbers, "scenes", lambda *_: [Scene("bars", tmp_path / "bars.yaml", tmp_path)])
    monkeypatch.setattr(same_numbers, "keep", lambda scene, target, quick: (not quick, "as it should be"))
    return tmp_path / "new"


def test_an_unknown_scene_is_answered_with_those_there_are(one_scene, capsys):
    assert same_numbers.main(["store", str(one_scene), "--only", "bras"]) == 2
    assert "no scene bras; there are demo, bars" in capsys.readouterr().err
    assert not list(one_scene.iterdir())


@pytest.mark.parametrize(("options", "partial"), [((), False), (("--only", "bars"), True)])
def test_a_store_that_came_to_its_end_says_what_it_is(one_scene, capsys, options, partial):
    assert same_numbers.main(["store", str(one_scene), *options]) == 0
    assert "bars: as it should be\n1 scenes, 0 not well" in capsys.readouterr().out
    made = same_numbers.stored(one_scene)
    assert (made.at, made.partial, made.on["numpy"]) == (str(one_scene), partial, np.__version__)


def test_a_scene_that_failed_is_counted(one_scene, capsys):
    assert same_numbers.main(["store", str(one_scene), "--quick", "--only", "bars"]) == 1
    assert "1 scenes, 1 not well" in capsys.readouterr().out


def in_processes(folder: Path, rows: int, outcome: str) -> Path:
    """The scene with --processes too, of so many rows."""
    scene = folder / "scenes/bars"
    shutil.copytree(scene / "embedded", scene / "processes")
    with h5py.File(scene / "processes/run.h5", "r+") as f:
        top = f["probes/top"][:rows]
        del f["probes/top"]
        f["probes/top"], f["probes/top"].attrs["unit"] = top, "K"
        f.attrs["outcome"] = outcome
    return scene


def apart(scene: Path) -> list[str]:
    found = same_numbers.modes_apart(scene / "embedded", scene / "processes")
    return [difference.path for difference in found]


def test_the_two_ways_agree_in_the_windows_both_have(tmp_path):
    scene = in_processes(made(tmp_path / "before"), 2, "stopped")
    assert apart(scene) == []
    with h5py.File(scene / "processes/run.h5", "r+") as f:
        f["probes/top"][1] = 302.0
    assert apart(scene) == ["run.h5/probes/top"]


def test_the_two_ways_agree_in_all_where_both_came_to_their_end(tmp_path):
    scene = in_processes(made(tmp_path / "before"), 3, "completed")
    assert apart(scene) == []
    with h5py.File(scene / "processes/run.thermal.vtkhdf", "r+") as f:
        f["VTKHDF/Types"][0] = 5
    assert apart(scene) == ["run.thermal.vtkhdf/VTKHDF/Types"]


PAGE = """
<!-- scene: base -->
```yaml
bodies: {bar: {T0: 300, mesh: {cells: [4, 4]}}}
```
<!-- scene: hot -->
```yaml
bodies: {bar: {T0: 900}}
```
<!-- file: half/__init__.py -->
```python
A = 1
```
<!-- run -->
```
slideline check s.yaml
slideline run s.yaml --report
slideline run s.yaml -o other.h5 \\
    --set thermal.T0=3  # other
```
```
slideline run not.yaml
```
"""


def test_the_scenes_of_a_page_are_merged_into_its_first(tmp_path):
    base, hot = page_scenes("page", blocks(PAGE), tmp_path)
    assert (base.name, hot.name) == ("page.base", "page.hot")
    assert YAML(typ="safe").load(hot.file) == {"bodies": {"bar": {"T0": 900, "mesh": {"cells": [4, 4]}}}}


def test_the_runs_of_a_page_are_found_and_its_files_written(tmp_path):
    run, other = page_runs("page", blocks(PAGE), tmp_path, make=True)
    assert (run.name, run.options) == ("page.run", ())
    assert (other.name, other.options) == ("page.other", ("--set", "thermal.T0=3"))
    assert run.file == other.file == tmp_path / "s.yaml"
    assert (tmp_path / "half/__init__.py").read_text() == "A = 1\n"
