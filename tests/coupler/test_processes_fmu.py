"""Real halves and the real contact service: in one process or in three, the same bits."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from contact.records import decode_record
from contact.rpc.calls import ServiceDownError
from coupler.errors import HalfError
from coupler.fmu.processes import processes
from coupler.scenario import load_scenario

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE))
from half_steps import steps  # noqa: E402


@pytest.fixture(scope="module", params=["rigid", "elastic"])
def fmu(request, tmp_path_factory) -> Path:
    """A small mechanical half of the sliding blocks."""
    directory = tmp_path_factory.mktemp(request.param)
    scenario = load_scenario(ROOT / "scenarios" / "sliding_blocks.yaml", {
        "mechanical.half": request.param, "bodies.lower.mesh.rectangle.cells": [4, 2],
        "bodies.upper.mesh.rectangle.cells": [6, 2]})
    scenario.write_half("mechanical", directory)
    out = directory / "half.fmu"
    subprocess.run([sys.executable, "-m", "mechanical_fmu.build", str(directory), str(out)],
                   check=True, timeout=240)
    return out


def embedded(fmu: Path, link: str, out: Path) -> bytes:
    """The steps in one fresh process: an FMU stays in the interpreter that loaded it."""
    subprocess.run([sys.executable, str(HERE / "half_steps.py"), str(fmu), link, str(out)], check=True, timeout=240)
    return out.read_bytes()


@pytest.mark.slow
def test_the_same_bits_in_one_process_and_in_three(fmu, tmp_path):
    direct = embedded(fmu, "direct", tmp_path / "direct")
    with processes({"mechanical": fmu}) as p:
        hosted = steps(p.halves["mechanical"], p.contact_link)
    assert hosted == direct
    assert embedded(fmu, "codec", tmp_path / "codec") == direct
    arrays = decode_record(direct)[2]
    pressed = arrays["contact.t_N 2"]
    assert np.isfinite(pressed).all()
    assert pressed.min() < -1e6, "the blocks are not pressed: nothing was compared"
    assert (arrays["contact.t_N 1"] == 0.0).all()


@pytest.mark.slow
def test_a_half_that_loses_its_contact_service_ends_the_run_by_name(fmu):
    with pytest.raises(ServiceDownError, match=r"contact service: .*signal 9"), processes({"mechanical": fmu}) as p:
        lose_contact(p)


def lose_contact(p) -> None:
    half = p.halves["mechanical"]
    steps(half, p.contact_link)
    os.kill(p.pids["contact"], signal.SIGKILL)
    started = time.monotonic()
    try:
        half.advance(13000.0, 100.0, {}, ["x"])
    finally:
        assert time.monotonic() - started < 60.0


def test_what_is_no_fmu_is_refused_by_name(tmp_path):
    path = tmp_path / "no.fmu"
    path.write_bytes(b"not a zip file")
    with pytest.raises(HalfError, match=r"(?s)half 'a': its process ended with code 1.*cannot be unpacked"), \
            processes({"a": path}):
        raise AssertionError("not reached")
