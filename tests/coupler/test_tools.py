"""What a script and a shell read of the command line: lists, the cache, JSON, completion, how much is told."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler import Results
from coupler.cli.cli import app
from coupler.cli.console import bar
from coupler.cli.tools import listed, sentence_of
from coupler.fmu.launch import USED_LATELY, cached_halves, clear_cache, drop_to
from coupler.scenario.kinds import OWN

ROOT = Path(__file__).resolve().parents[2]
BARS = str(ROOT / "scenarios/heated_bars.yaml")


def told(*arguments: str, code: int = 0) -> str:
    done = CliRunner().invoke(app, list(arguments))
    assert done.exit_code == code, (done.output, done.exception)
    return done.stdout


def test_the_list_has_every_scenario_and_half_with_a_sentence() -> None:
    found = json.loads(told("list", "--json"))
    assert found == listed()
    assert {row["name"] for row in found["scenarios"]} == {p.stem for p in (ROOT / "scenarios").glob("*.yaml")}
    assert {(row["role"], row["name"]) for row in found["halves"]} >= {
        (role, name) for role, kinds in OWN.items() for name in kinds}
    text = told("list")
    for row in (*found["scenarios"], *found["halves"]):
        assert row["about"] in text
        assert len(row["about"]) > 20
    assert all(row["about"].endswith(".") for row in found["scenarios"])


def test_a_sentence_ends_where_the_next_begins(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("# A sheet of 20.5 mm\n# flows.  Half of it.\n#\n# More.\nslideline: 2\n", encoding="utf-8")
    assert sentence_of(path) == "A sheet of 20.5 mm flows."


def cache_of(folder: Path, ages: dict[str, float]) -> None:
    for k, (name, age) in enumerate(ages.items()):
        place = folder / f"{name}-{k:032x}"
        place.mkdir()
        (place / "half.fmu").write_bytes(b"x" * 1000)
        os.utime(place, (time.time() - age,) * 2)


def test_the_cache_drops_what_was_used_longest_ago(tmp_path: Path) -> None:
    cache_of(tmp_path, {"new": 10.0, "old": 9e5, "older": 1e6})
    (tmp_path / "kept.json").write_text("{}", encoding="utf-8")
    assert [size for _, _, size in cached_halves(tmp_path)] == [1000] * 3
    assert drop_to(tmp_path, 2500.0) == 1
    assert [p.name.partition("-")[0] for p, _, _ in cached_halves(tmp_path)] == ["old", "new"]
    # What a run may have open stays, however small the cap.
    assert drop_to(tmp_path, 0.0, spare=USED_LATELY) == 1
    assert [p.name.partition("-")[0] for p, _, _ in cached_halves(tmp_path)] == ["new"]
    assert clear_cache(tmp_path) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["kept.json"]


def test_the_cache_tells_its_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIDELINE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    cache_of(tmp_path / "cache", {"a": 10.0, "b": 2e5})
    about = json.loads(told("cache", "--json"))
    assert (about["halves"], about["bytes"], about["cap_bytes"]) == (2, 2000, 2_000_000_000)
    assert "1 halves" in told("cache", "--cap", "0.0000015")
    assert json.loads(told("cache", "--clear", "--json"))["halves"] == 0


def test_a_script_reads_a_run_and_hears_nothing_else(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "coupler.cli", "run", BARS, "-q", "--json", "-o", "run.h5", "--set",
                           "coupling.end=100"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    about, results = json.loads(done.stdout), Results(tmp_path / "run.h5")
    assert (about["outcome"], about["trusted"]) == ("completed", True)
    assert about["windows"] == int(results.windows.taken.sum())
    assert about["solver_calls"] == int(results.windows.solves.sum())
    for name, of in about["probes"].items():
        assert of["last"] == results.probe(name)[1][-1]
    assert {c["name"] for c in about["checks"]} == {c.name for c in results.trust}


def test_verbose_has_a_line_each_window_with_its_size_and_solver_calls(tmp_path: Path) -> None:
    short = ["--set", "coupling.end=8", "--set", "coupling.windows=[{until: 8, size: 1}]"]
    done = subprocess.run([sys.executable, "-m", "coupler.cli", "run", BARS, "-v", "-o", "run.h5", *short],
                          cwd=tmp_path, capture_output=True, text=True, check=True)
    lines = [line for line in done.stderr.splitlines() if "| window " in line]
    w = Results(tmp_path / "run.h5").windows
    assert len(lines) == len(w)
    assert f"| window 3/{len(w)} of {w.H[2]:.3g} s | {int(w.solves[:3].sum())} solver calls |" in lines[2]


def test_a_shell_completes_commands() -> None:
    # As the installed command of this name does.
    start = "from coupler.cli.cli import app; app(prog_name='slideline')"
    done = subprocess.run([sys.executable, "-c", start], capture_output=True, text=True, check=False,
                          env={**os.environ, "_SLIDELINE_COMPLETE": "complete_bash",
                               "COMP_WORDS": "slideline re", "COMP_CWORD": "1"})
    assert done.stdout.split() == ["resume", "report"], done.stderr


def test_a_bar_is_as_long_as_what_is_done() -> None:
    assert bar(0.0) == "[                ]   0 %"
    assert bar(0.5) == "[========        ]  50 %"
    assert bar(1.0) == "[================] 100 %"
