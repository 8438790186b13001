"""Our halves as FMUs of FMI 3.0: valid, arrays are variables, and the same bits as of FMI 2.0."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest.importorskip("pythonfmu3")
sys.path.insert(0, str(Path(__file__).parent))
from toy_halves import build, directory, environment, fresh

BEGIN = """
import json, sys
from pathlib import Path
import numpy as np
from coupler.fmu.fmi import load_half

N = 4
half = load_half(Path(sys.argv[1]))
"""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("toy3"), fmi=3)


@pytest.fixture(scope="module")
def scalars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("toy2"))


def test_the_fmu_is_valid_and_can_be_dumped(fmu: Path) -> None:
    out = fresh("""
        import sys
        from fmpy import dump
        from fmpy.validation import validate_fmu
        dump(sys.argv[1])
        print(validate_fmu(sys.argv[1]))""", fmu)
    assert out.splitlines()[-1] == "[]"
    assert "PythonFMU3" in out


def test_an_array_is_one_variable(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        names, xml = archive.namelist(), ElementTree.fromstring(archive.read("modelDescription.xml"))
    identifier = xml.find("CoSimulation").get("modelIdentifier")
    assert f"binaries/x86_64-linux/{identifier}.so" in names
    found = {v.get("name"): [d.get("start") for d in v.iterfind("Dimension")] for v in xml.iterfind("ModelVariables/*")}
    assert (found["T"], found["x"], found["gain"]) == (["4"], ["4", "2"], [])


SCENARIO = """
first = half.initialise(0.0, 10.0, {"contact.link": "direct"}, {
    "drive": np.full(N, 400.0), "x": np.arange(2.0 * N).reshape(N, 2)}, ["T", "iterations"])
bits = [first["T"].tobytes().hex()]
for k in range(5):
    done = half.advance(k * 0.5, 0.5, {"drive": np.linspace(300.0, 400.0 + k, N)}, ["T", "sum", "iterations"])
    bits += [v.tobytes().hex() for v in done.outputs.values()]
    if k == 2:
        token = half.save()
token = half.deserialise(half.serialise(token))
half.restore(token)
bits += [half.read([name])[name].tobytes().hex() for name in ("T", "x", "drive", "sum")]
half.release(token)
half.close()
print(json.dumps(bits))
"""


def test_it_has_the_bits_of_fmi_2(fmu: Path, scalars: Path) -> None:
    first, second = (json.loads(fresh(BEGIN + SCENARIO, path)) for path in (scalars, fmu))
    assert len(set(first)) > 10
    assert first == second


@pytest.mark.slow
def test_a_discard_and_a_failure_are_told(fmu: Path) -> None:
    """The same words as through FMI 2.0: what leaves a method as an exception would crash the host."""
    out = json.loads(fresh(BEGIN + """
from coupler.errors import HalfError
half.initialise(0.0, 10.0, {}, {"drive": np.full(N, 400.0)}, ["T"])
bad = half.advance(0.0, 0.5, {"drive": np.full(N, np.nan)}, ["T"])
good = half.advance(0.0, 0.5, {"drive": np.full(N, 400.0)}, ["T"])
said = []
for name in ("T", "status.code"):
    try:
        half._set(name, np.zeros(half.blocks[name].shape))
        half.advance(0.5, 0.5, {}, ["T"])
    except HalfError as exc:
        said.append(str(exc).splitlines()[0])
print(json.dumps([bad.status.value, bad.message, good.status.value, said]))
""", fmu))
    assert out[:3] == ["discard", "input drive holds a value that is not finite", "ok"]
    assert "T is not an input or parameter" in out[3][0]


def test_it_begins_when_it_is_told_to(fmu: Path) -> None:
    """The wrapper drops the start time of fmi3EnterInitializationMode, so a parameter says it."""
    out = json.loads(fresh(BEGIN + """
half.initialise(5.0, 10.0, {"time.start": "5"}, {"drive": np.full(N, 400.0)}, [])
before = half.read(["time", "time.start", "T"])
half.advance(5.0, 0.5, {}, [])
print(json.dumps([float(before["time"]), float(before["time.start"]), before["T"].shape[0],
                  float(half.read(["time"])["time"])]))
""", fmu))
    assert out == [5.0, 5.0, 4, 5.5]


@pytest.mark.slow
def test_the_same_content_gives_the_same_file(fmu: Path, scalars: Path, tmp_path: Path) -> None:
    assert build(tmp_path / "again", fmi=3).read_bytes() == fmu.read_bytes() != scalars.read_bytes()


def test_without_the_wrapper_a_build_ends_with_2_and_one_line(tmp_path: Path) -> None:
    code = """
        import sys
        sys.modules["pythonfmu3"] = None
        import importlib.util
        found = importlib.util.find_spec
        importlib.util.find_spec = lambda name, *more: None if name == "pythonfmu3" else found(name, *more)
        from contact.half import build_main
        build_main("toy_half", "toy_half.model:load")
    """
    out = directory(tmp_path) / "x.fmu"
    done = subprocess.run([sys.executable, "-P", "-c", "\n".join(line.strip() for line in code.splitlines()),
                           str(tmp_path), str(out), "--fmi", "3"], capture_output=True, text=True, timeout=240,
                          env=environment(), check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.strip() == "FMI 3.0 needs the package pythonfmu3: pip install 'slideline[fmi3]'"
    assert not out.exists()
