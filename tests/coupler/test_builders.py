"""Builders of this project share a process; what goes wrong with it is nobody's build."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import psutil
import pytest

from coupler import HalfError, load_scenario
from coupler.fmu import builders
from coupler.fmu.builders import run_builder

sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from toy_halves import directory, environment

BARS = Path(__file__).resolve().parents[2] / "scenarios/heated_bars.yaml"
MODULE = "toy_half.build"
pytestmark = pytest.mark.skipif(not builders._FORKS, reason="builders share a process on Linux alone")


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what a half is built from."""
    return directory(tmp_path_factory.mktemp("toy"))


@pytest.fixture(autouse=True)
def ended(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", environment()["PYTHONPATH"])
    yield
    builders._end_all()
    assert not [c for c in psutil.Process().children(recursive=True) if "build_server" in " ".join(c.cmdline())]


def build(folder: Path, out: Path, sources: str = "here") -> Path:
    run_builder("toy", MODULE, [str(folder), str(out)], out, (sources, [MODULE]))
    return out


def test_the_same_file_comes_of_one_process(toy, tmp_path):
    first, second = build(toy, tmp_path / "1.fmu"), build(toy, tmp_path / "2.fmu")
    (server,) = builders._servers
    third = build(toy, tmp_path / "3.fmu", "edited")
    assert server.ended
    run_builder("toy", MODULE, [str(toy), str(tmp_path / "4.fmu")], tmp_path / "4.fmu", None)
    assert len({path.read_bytes() for path in (first, second, third, tmp_path / "4.fmu")}) == 1
    assert {p.suffix for p in tmp_path.iterdir()} == {".fmu"}  # no log is left


def test_a_builder_that_fails_speaks(toy, tmp_path):
    (tmp_path / "half").mkdir()
    for name in ("interface.h5", "model.json"):
        (tmp_path / "half" / name).write_bytes((toy / name).read_bytes())
    (tmp_path / "half/model.json").write_text('{"half": "other"}')
    with pytest.raises(HalfError, match=r"(?s)half 'toy'.*ended with code 2.*not 'toy'"):
        build(tmp_path / "half", tmp_path / "1.fmu")
    assert len(builders._servers) == 1
    assert not builders._servers[0].ended


def test_who_kills_the_process_ends_no_build(toy, tmp_path):
    build(toy, tmp_path / "1.fmu")
    (server,) = builders._servers
    os.kill(server._process.pid, signal.SIGSTOP)
    asked = server.build(MODULE, [str(toy), str(tmp_path / "2.fmu")], str(tmp_path / "log"))
    os.kill(server._process.pid, signal.SIGKILL)
    until = time.monotonic() + 30.0
    while not asked.cancelled() and time.monotonic() < until:
        time.sleep(0.02)
    assert asked.cancelled()
    with pytest.raises(BrokenPipeError):
        server.build(MODULE, [], "")
    assert build(toy, tmp_path / "3.fmu").is_file()


@pytest.mark.slow
def test_a_process_that_cannot_import_ends_no_build(toy, tmp_path):
    run_builder("toy", MODULE, [str(toy), str(tmp_path / "1.fmu")], tmp_path / "1.fmu", ("here", ["none_such"]))
    assert (tmp_path / "1.fmu").is_file()


def test_it_ends_when_nothing_is_asked(toy, tmp_path, monkeypatch):
    monkeypatch.setattr(builders, "SERVER", ["-c", "from coupler.fmu import build_server as b; b.IDLE = 0.2; b.main()"])
    build(toy, tmp_path / "1.fmu")
    (server,) = builders._servers
    assert server._process.wait(30.0) == 0


@pytest.mark.slow
def test_what_a_build_had_to_import_the_next_ones_have(tmp_path):
    """A table of a property: its class takes half of the time of a build to import."""
    def has_it(server: builders._Server) -> bool:
        return any("scipy/interpolate/" in m.path for m in psutil.Process(server._process.pid).memory_maps())

    plain, table = tmp_path / "plain", tmp_path / "table"
    load_scenario(BARS).write_half("thermal", plain)
    load_scenario(BARS, {"materials.steel.k": {"T": [300, 900], "value": [40, 20]}}).write_half("thermal", table)
    for folder, found in ((plain, False), (table, True)):
        out = tmp_path / f"{folder.name}.fmu"
        run_builder("thermal", "thermal_fmu.build", [str(folder), str(out)], out, ("here", ["thermal_fmu.build"]))
        (server,) = builders._servers
        until = time.monotonic() + (20.0 if found else 1.0)
        while not has_it(server) and time.monotonic() < until:
            time.sleep(0.05)
        assert has_it(server) == found
