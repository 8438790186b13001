"""One temperature across bodies: what the halves rod and lumped tell of it ends in the trust table, and in exit code 4.
"""

from __future__ import annotations

import subprocess
import sys

import pytest

from coupler import Results, load_scenario, run
from coupler.trust.in_space import across

SCENE = """
slideline: 2
title: a plate between a film and the air
units: {{temperature: K}}
geometry: plane
materials:
  plate: {{rho: 2000, c: 1000, k: {k}, alpha: 0, T_ref: 300, E: 1.0e9}}
bodies:
  plate: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.02, 0.1], cells: [4, 2]}}}}, material: plate, T0: 300}}
thermal:
  half: {half}
  boundary: [{{on: plate.left, convection: {{h: 100, T: 400}}}}]
mechanical:
  half: rigid
  rigid: {{motion: {{plate: {{}}}}}}
coupling: {{end: 20, windows: [{{until: 20, size: 2}}]}}
"""


def check_of(rows):
    return next((c for c in rows if c.name == across.NAME), None)


@pytest.mark.few("1.0-broken")
@pytest.mark.parametrize(("k", "verdict"), [(200.0, "holds"), (10.0, "noted"), (1.0, "broken")])
def test_a_lumped_plate_is_told_by_its_biot_number(tmp_path, k, verdict):
    """h L/(3 k) of 100 K in the first window, 0.0033, 0.067 and 0.67 of it."""
    file = tmp_path / "plate.yaml"
    file.write_text(SCENE.format(k=k, half="lumped"))
    check = check_of(run(load_scenario(file), tmp_path / "run.h5").trust)
    assert check is not None
    assert check.verdict == verdict
    if verdict != "holds":
        # In the first window the plate warms by 0.5 K of the 100 K that it is told of.
        off = 100.0 * 100.0 * 0.02 / (3.0 * k)
        assert float(check.what.split("up to ")[1].split(" K")[0]) == pytest.approx(off, rel=0.02)
        assert check.number == pytest.approx(off / 100.0, rel=0.02)
        assert "thermal.half: thermal" in check.sentence


def test_a_half_with_temperatures_everywhere_has_no_such_row(tmp_path):
    file = tmp_path / "plate.yaml"
    file.write_text(SCENE.format(k=1.0, half="thermal"))
    assert check_of(run(load_scenario(file), tmp_path / "run.h5").trust) is None


@pytest.mark.slow
def test_the_command_line_ends_with_4_and_processes_tell_the_same(tmp_path):
    file = tmp_path / "plate.yaml"
    file.write_text(SCENE.format(k=1.0, half="lumped"))
    told = []
    for more in ([], ["--processes"]):
        out = tmp_path / f"run{len(more)}.h5"
        command = [sys.executable, "-m", "coupler.cli", "run", str(file), "--out", str(out), *more]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 4, done.stdout + done.stderr
        assert across.NAME in done.stdout + done.stderr
        told.append(check_of(Results(out).trust))
    assert told[0] == told[1]


def test_the_worst_window_counts():
    log = across.AcrossLog()
    assert across.checks(log, 100.0) == ()
    for t, off in ((1.0, 0.0), (2.0, 9.0), (3.0, 4.0)):
        log = across.watched(log, off, t)
    (check,) = across.checks(log, 100.0)
    assert (check.number, check.t, check.verdict) == (0.09, 2.0, "noted")
    assert across.watched(log, None, 4.0) == log
