"""Outputs while a half is initialised: a master may exchange them before the first step (FMI 2.0.4, 2.1.6.1)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[1] / "coupler"))
from foreign_scenes import scenes
from toy_halves import build, fresh

from contact.half.slave import HalfSlave
from mechanical_fmu.elastic_half import load


class Slave(HalfSlave):
    identity = "elastic"
    packages = {"contact": "", "mechanical_fmu": ""}  # noqa: RUF012 declared a ClassVar above
    load = staticmethod(load)


class Face:
    """An elastic half behind its slave.  get, set : a whole block."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        own, _ = scenes(folder, "mechanical", monkeypatch)
        own.write_half("mechanical", folder / "half")
        self.slave = Slave(instance_name="elastic", resources=str(folder / "half"))
        layout = self.slave._store.layout
        self.at = {v.name: list(range(layout.first[v.name], layout.first[v.name] + v.size)) for v in layout.reals}

    def get(self, name: str) -> np.ndarray:
        return np.array(self.slave.get_real(self.at[name]))

    def set(self, name: str, value: float) -> None:
        self.slave.set_real(self.at[name], [value] * len(self.at[name]))


@pytest.fixture
def face(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Face:
    return Face(tmp_path, monkeypatch)


def test_outputs_are_those_of_the_inputs_so_far(face: Face) -> None:
    """They follow inputs that change, and at the end of initialisation they are the same to the bit."""
    assert np.isnan(face.get("x")).all(), "nothing is known before initialisation"
    face.slave.enter_initialization_mode()
    face.set("T", 293.15)
    cold = face.get("x")
    assert np.isfinite(cold).all()
    face.set("T", 333.15)
    warm = face.get("x")
    assert np.abs(warm - cold).max() > 1e-6
    face.slave.exit_initialization_mode()
    np.testing.assert_array_equal(face.get("x"), warm)
    face.set("T", 293.15)
    np.testing.assert_array_equal(face.get("x"), warm, "from now on outputs are those of steps")


def test_inputs_that_cannot_be_used_are_told_at_the_end_of_initialisation(face: Face) -> None:
    face.slave.enter_initialization_mode()
    face.set("T", np.nan)
    assert np.isnan(face.get("x")).all()
    assert not face.slave.log_queue
    face.set("T", 293.15)
    face.slave.exit_initialization_mode()
    assert np.isfinite(face.get("x")).all()


def test_an_fmu_of_fmi_3_tells_them_too(tmp_path: Path) -> None:
    pytest.importorskip("pythonfmu3")
    said = fresh("""
        import sys, os
        from fmpy import extract, read_model_description
        from fmpy.fmi3 import FMU3Slave
        about = read_model_description(sys.argv[1])
        half = FMU3Slave(guid=about.guid, unzipDirectory=extract(sys.argv[1]), instanceName="toy",
                         modelIdentifier=about.coSimulation.modelIdentifier)
        half.instantiate()
        half.enterInitializationMode()
        T = next(v for v in about.modelVariables if v.name == "T")
        print(half.getFloat64([T.valueReference], nValues=4), flush=True)
        os._exit(0)""", build(tmp_path, fmi=3))
    assert said.strip() == "[273.15, 273.15, 273.15, 273.15]"
