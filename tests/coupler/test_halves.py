"""Builders found by entry point, FMUs cached by content."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from coupler.errors import HalfError
from coupler.fmu.launch import build_half, cache_directory, known_halves

sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from toy_halves import HALVES, directory, environment


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    """A cache, with the toy half installed."""
    monkeypatch.syspath_prepend(str(HALVES))
    monkeypatch.setenv("PYTHONPATH", environment()["PYTHONPATH"])
    return tmp_path / "cache"


def test_our_own_halves_and_a_third_partys_are_known(cache):
    assert {"thermal", "elastic", "rigid", "toy"} <= set(known_halves())


def test_one_that_is_installed_while_the_program_runs_is_known_and_forgotten_with_its_package(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    info = tmp_path / "late_half-1.0.dist-info"
    for kind in ("late", "later"):  # another version of the package comes in a new folder
        assert kind not in known_halves()
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: late-half\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[slideline.halves]\n{kind} = late_half.build\n")
        assert known_halves()[kind].module == "late_half.build"
        known_halves().clear()  # what is done to an answer changes no other
        assert {"thermal", kind} <= set(known_halves())
        shutil.rmtree(info)
        assert kind not in known_halves()


def test_an_unknown_kind_names_the_known_ones(cache, tmp_path):
    with pytest.raises(HalfError, match=r"'termal'.*elastic, .*thermal.*did you mean 'thermal'"):
        build_half("termal", tmp_path, cache)


def test_the_same_content_is_built_once_and_unpacked_beside(cache, tmp_path):
    first = build_half("toy", directory(tmp_path / "a"), cache)
    stamp = first.stat().st_mtime_ns
    assert first.with_suffix("").joinpath("modelDescription.xml").is_file()
    assert build_half("toy", directory(tmp_path / "b"), cache) == first
    assert first.stat().st_mtime_ns == stamp
    others = {build_half("toy", directory(tmp_path / "c", rate=0.2), cache),
              build_half("toy", directory(tmp_path / "d", n=5), cache)}
    assert len(others | {first}) == 3
    assert not [p for p in cache.iterdir() if p.name.startswith(".")]


def test_a_failing_builder_speaks(cache, tmp_path):
    broken = directory(tmp_path / "a")
    (broken / "model.json").write_text('{"half": "other"}')
    with pytest.raises(HalfError, match=r"(?s)half 'toy'.*ended with code 2.*not 'toy'"):
        build_half("toy", broken, cache)
    assert list(cache.iterdir()) == []
    (broken / "model.json").write_text("{")
    with pytest.raises(HalfError, match=r"model\.json"):
        build_half("toy", broken, cache)


def test_a_builder_that_does_not_end_is_given_up(cache, tmp_path, monkeypatch):
    monkeypatch.setattr("coupler.fmu.builders.DEADLINE", 0.01)
    with pytest.raises(HalfError, match=r"did not end within 0\.01 s"):
        build_half("toy", directory(tmp_path / "a"), cache)


def test_two_builders_at_once_end_with_one_fmu(cache, tmp_path):
    directory(tmp_path / "a")
    code = "import sys; from pathlib import Path; from coupler.fmu.launch import build_half; " \
           "print(build_half('toy', Path(sys.argv[1]), Path(sys.argv[2])))"
    both = [subprocess.Popen([sys.executable, "-P", "-c", code, str(tmp_path / "a"), str(cache)], text=True,
                             stdout=subprocess.PIPE, env=environment()) for _ in range(2)]
    paths = {process.communicate(timeout=240)[0].strip() for process in both}
    assert [p.returncode for p in both] == [0, 0]
    assert len(paths) == 1
    assert Path(paths.pop()).is_file()
    assert len(list(cache.iterdir())) == 1


def test_what_was_not_used_for_long_is_dropped_and_other_files_are_left(cache, tmp_path):
    old = build_half("toy", directory(tmp_path / "a"), cache).parent
    mine = cache / "notes-mine"
    mine.mkdir()
    long_ago = time.time() - 31 * 86400
    for path in (old, mine):
        os.utime(path, (long_ago, long_ago))
    build_half("toy", directory(tmp_path / "b", n=6), cache)
    assert not old.exists()
    assert mine.exists()


def test_the_cache_is_where_it_is_told_and_never_where_fmus_crash(tmp_path, monkeypatch):
    monkeypatch.setenv("SLIDELINE_CACHE", str(tmp_path / "mine"))
    assert cache_directory() == tmp_path / "mine"
    monkeypatch.delenv("SLIDELINE_CACHE")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_directory() == tmp_path / "home" / ".cache" / "slideline"
    monkeypatch.setenv("HOME", str(tmp_path / "grün"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert cache_directory() == tmp_path / f"slideline-{os.getuid()}"
    assert cache_directory().stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("name", ["grün", "file"])
def test_a_cache_that_cannot_serve_is_named(tmp_path, monkeypatch, name):
    (tmp_path / "file").touch()
    monkeypatch.setenv("SLIDELINE_CACHE", str(tmp_path / name))
    with pytest.raises(HalfError, match=f"SLIDELINE_CACHE is {tmp_path / name}"):
        cache_directory()
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
