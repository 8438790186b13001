"""Both mechanical halves as FMUs, each in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from contact.half.interface import write_interface

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import STEEL, blocks, hold

STROKE = {"t": [0, 1, 2], "value": [0, -1e-3, -1.01e-3]}
MODELS = {
    "elastic": {"materials": {"m": STEEL}, "bodies": {"lower": {"material": "m"}, "upper": {"material": "m"}},
                "boundary": [hold("lower.bottom", 1), hold("lower.left", 0),
                             hold("upper.top", 1, STROKE), {"at": "upper.middle", "u_x": 0.0},
                             hold("lower.left", 1),
                             hold("lower.right", 0, 1e-9, name="squash"), hold("lower.right", 1)]},
    "rigid": {"motion": {"upper": {"u_y": STROKE}}, "pressure": {"interface": 1e7}},
}
DRIVE = """
import sys
from pathlib import Path
from fmpy.validation import validate_fmu
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Status
fmu = Path(sys.argv[1])
assert validate_fmu(str(fmu)) == []
half = load_half(fmu, None, "mechanical")
outputs = ("x", "contact.t_N", "contact.gap", "contact.covered", "contact.touching")
half.initialise(0.0, 2.0, {}, {}, outputs)
first = half.advance(0.0, 1.0, {}, outputs)
assert first.status is Status.OK, first.message
token = half.save()
once = half.advance(1.0, 1.0, {}, outputs)
half.restore(token)
half.advance(1.0, 0.3, {}, outputs)
half.restore(token)
again = half.advance(1.0, 1.0, {}, outputs)
assert once.status is again.status is Status.OK, once.message
assert all(once.outputs[n].tobytes() == again.outputs[n].tobytes() for n in outputs)
assert once.outputs["contact.t_N"].max() < -1e5, once.outputs["contact.t_N"]
if "squash" in sys.argv:
    half.restore(token)
    bad = half.advance(1.0, 1.0, {"load.squash": -2e9}, outputs)
    assert bad.status is Status.DISCARD and 0 < bad.dt_suggest < 1, bad
    assert "body lower" in bad.message, bad.message
half.close()
print("well")
"""


@pytest.mark.few("elastic")
@pytest.mark.parametrize("kind", MODELS)
def test_an_fmu_is_built_valid_steps_restores_and_refuses(tmp_path, kind):
    write_interface(blocks(4, 5, gap=1e-3), tmp_path / "interface.h5")
    (tmp_path / "model.json").write_text(json.dumps({"half": kind, "format": 2} | MODELS[kind]), encoding="utf-8")
    fmu = tmp_path / f"{kind}.fmu"
    run([sys.executable, "-m", "mechanical_fmu.build", str(tmp_path), str(fmu)])
    assert run([sys.executable, "-c", DRIVE, str(fmu), *(["squash"] if kind == "elastic" else [])]) == "well"


def test_the_builder_of_a_wrong_model_says_what_is_wrong(tmp_path):
    write_interface(blocks(2, 2), tmp_path / "interface.h5")
    model = {"half": "elastic", "format": 2, "materials": {}, "bodies": {}}
    (tmp_path / "model.json").write_text(json.dumps(model), encoding="utf-8")
    command = [sys.executable, "-m", "mechanical_fmu.build", str(tmp_path), str(tmp_path / "x.fmu")]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 2
    assert "model.json: bodies: key 'lower' is missing" in answer.stderr


def run(command):
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr[-3000:]
    return answer.stdout.strip()
