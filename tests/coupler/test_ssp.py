"""`slideline build --ssp`: both FMUs as one system, as fmpy reads it, and as libcosim runs it."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd, read_ssv
from typer.testing import CliRunner

from coupler.cli.cli import app
from coupler.errors import ScenarioError

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import TEXT

STEP, STEPS, NODES = 0.5, 4, 31
# What a master does that knows the system file and nothing else: values go along connections, at the start too.
BY_FMPY = """
import json, os, sys, tempfile, zipfile
from pathlib import Path
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.ssp.ssd import read_ssd

ssp, step, steps = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
ssd, folder = read_ssd(ssp), extract(ssp)
halves = {}
for part in ssd.system.elements:
    fmu = os.path.join(folder, part.source)
    about = read_model_description(fmu)
    half = FMU2Slave(guid=about.guid, unzipDirectory=extract(fmu), modelIdentifier=about.coSimulation.modelIdentifier,
                     instanceName=part.name)
    half.instantiate()
    half.setupExperiment(startTime=0.0)
    half.enterInitializationMode()
    halves[part.name] = half, {v.name: v.valueReference for v in about.modelVariables}
connections = [(c.startElement, c.startConnector, c.endElement, c.endConnector) for c in ssd.system.connections]

def exchange():
    values = [halves[a][0].getReal([halves[a][1][name]]) for a, name, _, _ in connections]
    for (_, _, b, name), value in zip(connections, values):
        halves[b][0].setReal([halves[b][1][name]], value)

exchange()
exchange()  # x follows T, and the mass of thermal cells x
for half, _ in halves.values():
    half.exitInitializationMode()
for k in range(steps):
    for half, _ in halves.values():
        half.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
    exchange()
half, names = halves["thermal"]
print(json.dumps(half.getReal([r for name, r in names.items() if name.startswith("T[")])), flush=True)
os._exit(0)
"""
BY_LIBCOSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver

log_output_level(CosimLogLevel.ERROR)
ssp, step, steps = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
run = CosimExecution.from_ssp_file(ssp_path=ssp, step_size=round(1e9 * step))
seen = CosimObserver.create_last_value()
run.add_observer(observer=seen)
thermal = next(i.index for i in run.slave_infos() if i.name == b"thermal")
names = {v.name.decode(): v.reference for v in run.slave_variables(thermal)}
assert run.step(steps)
print(json.dumps(list(seen.last_real_values(thermal, [r for n, r in names.items() if n.startswith("T[")]))))
"""


@pytest.fixture(scope="module")
def ssp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ssp")
    (folder / "s.yaml").write_text(TEXT)
    done = CliRunner().invoke(app, ["build", str(folder / "s.yaml"), "-o", str(folder / "out"), "--ssp"])
    assert done.exit_code == 0, done.output
    assert done.output.split() == [str(folder / "out" / name) for name in
                                   ("thermal.fmu", "mechanical.fmu", "scene.ssp")]
    return folder / "out" / "scene.ssp"


def temperatures(master: str, ssp: Path, steps: int = STEPS) -> np.ndarray:
    # The sources that the FMUs bring lie in a new place, where numba has nothing: a minute to compile.
    done = subprocess.run([sys.executable, "-c", master, str(ssp), str(STEP), str(steps)], capture_output=True,
                          text=True, timeout=240, check=False, env=os.environ | {"NUMBA_DISABLE_JIT": "1"})
    assert done.returncode == 0, f"ended with {done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return np.array(json.loads(done.stdout.splitlines()[-1]))


def test_it_is_a_system_of_both_halves(ssp: Path) -> None:
    """Validated by fmpy against the schema of SSP 1.0.  What is there: all the coupler exchanges, each value once."""
    system = read_ssd(ssp).system
    assert {part.name: part.source for part in system.elements} == {
        role: f"resources/{role}.fmu" for role in ("thermal", "mechanical")}
    pairs = [(c.startElement, c.startConnector, c.endElement, c.endConnector) for c in system.connections]
    assert all(a != b and name == other for a, name, b, other in pairs)
    ends = [(b, name) for _, _, b, name in pairs]
    assert len(set(ends)) == len(ends)
    blocks = {(a, name.partition("[")[0]) for a, name, _, _ in pairs}
    assert blocks == {("thermal", "T"), ("mechanical", "x"), ("mechanical", "contact.t_N")}
    assert sum(name.startswith("x[") for _, name, _, _ in pairs) == 2 * NODES
    assert ("thermal", "T[1]", "mechanical", "T[1]") in pairs
    assert ("mechanical", f"x[{NODES},2]", "thermal", f"x[{NODES},2]") in pairs
    with zipfile.ZipFile(ssp) as archive:
        assert archive.read("resources/thermal.fmu") == (ssp.parent / "thermal.fmu").read_bytes()


def test_values_to_begin_with_are_those_nobody_else_gives(ssp: Path) -> None:
    for role in ("thermal", "mechanical"):
        told = {p.name: (p.type, p.value) for p in read_ssv(ssp, f"resources/{role}.ssv").parameters}
        assert told["contact.link"] == ("String", "direct")
        assert told["control.method"] == ("Integer", "0")
        assert not {"T", "x", "contact.t_N"} & {name.partition("[")[0] for name in told}


@pytest.mark.slow
def test_a_master_that_knows_the_file_alone_runs_it(ssp: Path) -> None:
    T = temperatures(BY_FMPY, ssp)
    assert T.shape == (NODES,)
    assert 300.0 <= T.min() < T.max() <= 500.0
    assert np.ptp(temperatures(BY_FMPY, ssp, 1) - T) > 0.1


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("libcosimpy") is None, reason="libcosimpy is not installed")
def test_libcosim_gives_what_fmpy_gives(ssp: Path) -> None:
    """Each of three runs ends with 0: the wrapper may leave a damaged heap (docs/other_masters.md)."""
    T = temperatures(BY_FMPY, ssp)
    for _ in range(3):
        np.testing.assert_allclose(temperatures(BY_LIBCOSIM, ssp), T, rtol=1e-12)


@pytest.mark.parametrize(("words", "said"), [
    (["--fmi", "3"], "SSP 1.0 knows no arrays"),
    (["--set", "thermal.halves={a: {bodies: [lower]}, b: {bodies: [upper]}}"], "several thermal halves"),
    (["--set", "thermal.meshes={lower: {rectangle: {origin: [0, 0], size: [0.02, 0.01], cells: [3, 3]}}}"],
     "mapped by the coupler")])
def test_what_is_no_system_of_two_is_one_error(words: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(TEXT)
    with pytest.raises(ScenarioError, match=said):
        CliRunner().invoke(app, ["build", str(tmp_path / "s.yaml"), "-o", str(tmp_path / "out"), "--ssp", *words],
                           catch_exceptions=False)
    assert not (tmp_path / "out").exists()
