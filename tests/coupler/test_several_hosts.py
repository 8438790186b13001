"""Two thermal halves, a mechanical one and contact on four machines around a router: the embedded run's bits."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from coupler import Results, ScenarioError, run
from coupler.fmu.hosts import read_hosts
from coupler.scenario import load_scenario

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from host_scene import SCENARIO, SEVERAL_SETS  # noqa: E402
from killed_runs import differences  # noqa: E402
from test_hosts import namespaces  # noqa: E402

LINES = ("thermal.a: tls/127.0.0.1:17621\nthermal.b: tls/127.0.0.1:17622\nmechanical: tls/127.0.0.1:17623\n"
         "contact: tls/127.0.0.1:17624\ntls: certificates\n")


@pytest.mark.slow
def test_three_halves_around_a_router_give_the_bits_of_one_process(tmp_path):
    whole = tmp_path / "whole.h5"
    run(load_scenario(SCENARIO, SEVERAL_SETS), whole)
    command = [sys.executable, str(HERE / "host_scene.py"), str(tmp_path), "several"]
    if namespaces():
        command.append("--loopback")
    else:
        command[:0] = ["unshare", "-rnm"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, f"{done.stderr}\n{(tmp_path / 'run.log').read_text()}"
    assert differences(whole, tmp_path / "run.h5") == []
    assert Results(tmp_path / "run.h5").totals["restarts"] == []


def test_a_hosts_file_has_a_line_for_each_half(tmp_path):
    file = tmp_path / "hosts.yaml"
    file.write_text(LINES)
    found = read_hosts(file, ("thermal.a", "thermal.b", "mechanical"))
    assert found.halves == ("thermal.a", "thermal.b", "mechanical")
    assert found.addresses["thermal.b"] == "tls/127.0.0.1:17622"
    with pytest.raises(ScenarioError, match=r"where thermal\.a and thermal\.b and mechanical run; the scenario has "
                                            r"mechanical and thermal"):
        read_hosts(file, ("thermal", "mechanical"))
    file.write_text("thermal: tls/127.0.0.1:17620\n" + LINES)
    with pytest.raises(ScenarioError, match=r"thermal\.a, thermal\.b, mechanical, contact, tls"):
        read_hosts(file)
