"""An FMU of the cache that was damaged is made anew, not refused for ever."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

from coupler.fmu import launch
from coupler.fmu.launch import DIGEST, SIZE, _cached, cached_halves, is_whole


class Builder:
    """Makes an FMU of three files, and counts how often."""

    def __init__(self) -> None:
        self.built = 0

    def __call__(self, out: Path) -> None:
        self.built += 1
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
            archive.writestr("resources/data.bin", np.random.default_rng(0).bytes(3000))
            archive.writestr("resources/empty", "")


@pytest.fixture
def place(tmp_path) -> Path:
    return tmp_path / "cache" / f"toy-{'0' * 32}"


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-20])


DAMAGES = {
    "archive empty": lambda p: (p / "half.fmu").write_bytes(b""),
    "archive cut": lambda p: cut(p / "half.fmu"),
    "archive of zeros": lambda p: (p / "half.fmu").write_bytes(bytes(3000)),
    "archive flipped": lambda p: flip(p / "half.fmu", 900),
    "file cut": lambda p: cut(p / "half/resources/data.bin"),
    "file flipped": lambda p: flip(p / "half/resources/data.bin", 7),
    "file missing": lambda p: (p / "half/modelDescription.xml").unlink(),
    "folder missing": lambda p: shutil.rmtree(p / "half"),
}


def flip(file: Path, at: int) -> None:
    data = bytearray(file.read_bytes())
    data[at] ^= 4
    file.write_bytes(data)


@pytest.mark.parametrize("kept", [True, False], ids=["", "no digest"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_fmu_is_built_anew_once(place, damage, kept):
    builder = Builder()
    fmu = _cached(place, builder)
    if not kept:
        (place / DIGEST).unlink()  # as of older versions
    assert is_whole(fmu)
    (place / "half" / "blocks.json").write_text("{}")  # what is beside belongs to no archive
    assert _cached(place, builder) == fmu
    assert builder.built == 1
    DAMAGES[damage](place)
    assert not is_whole(fmu)
    for _ in range(2):
        assert _cached(place, builder) == fmu
        assert is_whole(fmu)
    assert builder.built == 2
    assert [p.name for p in place.parent.iterdir()] == [place.name]


def test_sizes_are_known_without_a_look_at_the_files(tmp_path, monkeypatch):
    """2.5 ms a half, at every build: a cache of 800 halves, its cap, made each build take 2 s longer."""
    for k in range(3):
        _cached(tmp_path / f"toy-{k:032}", Builder())
    counted = [sum(f.stat().st_size for f in place.rglob("*") if f.is_file() and f.name not in (SIZE, DIGEST))
               for place, _, _ in cached_halves(tmp_path)]
    walks = []
    bytes_in = launch._bytes_in

    def walked(place: Path) -> int:
        walks.append(place.parent.name + place.name)
        return bytes_in(place)

    monkeypatch.setattr(launch, "_bytes_in", walked)
    assert [size for _, _, size in cached_halves(tmp_path)] == counted
    assert walks == []
    _cached(tmp_path / f"toy-{3:032}", Builder())
    assert len(walks) == 1  # of the new one


@pytest.mark.parametrize("content", [None, "", "12 MB"])
def test_a_size_that_is_lost_is_counted(place, content):
    _cached(place, Builder())
    [(_, _, size)] = cached_halves(place.parent)
    (place / SIZE).unlink() if content is None else (place / SIZE).write_text(content)
    assert [s for _, _, s in cached_halves(place.parent)] == [size]
