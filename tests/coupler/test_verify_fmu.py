"""`slideline verify-half` on real FMUs, in processes of their own: ours pass, one that leaks is caught."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from coupler.init.init import new_scenario
from coupler.init.templates import Choices, template_named

sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from toy_halves import build, fresh

RESTORE = "save and restore to the bit"
VERIFY = """
import json, sys, tempfile
from pathlib import Path
from coupler.verify.border import CheckVerdict
from coupler.verify.conformance import verify_fmu
from coupler.cli.verifying import fmu_of

told = {}
for word in sys.argv[1:]:
    half, _, scenario = word.partition(":")
    with tempfile.TemporaryDirectory() as scratch:
        found = fmu_of(half, Path(scenario) if scenario else None, Path(scratch) / "half")
        findings = verify_fmu(found.fmu, Path(scratch), 1.0, found.scene)
        told[half] = {f.check: [f.verdict.name, f.reason] for f in findings}
print(json.dumps(told))
"""


@pytest.mark.slow
def test_an_fmu_that_leaks_on_restore_is_caught_and_one_that_does_not_passes(tmp_path: Path) -> None:
    good, leaky = str(build(tmp_path / "good")), str(build(tmp_path / "leaky", leak=1e-9))
    told = json.loads(fresh(VERIFY, good, leaky))
    assert {verdict for verdict, _ in told[good].values()} == {"PASS", "NOT_APPLICABLE"}
    assert told[good]["heat terms close"][0] == "NOT_APPLICABLE"
    assert told[leaky][RESTORE][0] == "FAIL"
    assert "gives another T" in told[leaky][RESTORE][1]


@pytest.mark.slow
@pytest.mark.parametrize("halves", [("lumped", "thermal_rod:casting", "mechanical_rod", "rigid"),
                                    ("thermal", "elastic")])
def test_our_own_halves_keep_to_the_border(halves: tuple[str, ...], tmp_path: Path) -> None:
    coarse = tmp_path / "casting.yaml"
    new_scenario(template_named("casting"), Choices(mesh=0.1), coarse)
    told = json.loads(fresh(VERIFY, *(half.replace("casting", str(coarse)) for half in halves)))
    for half, findings in told.items():
        assert not [check for check, (verdict, _) in findings.items() if verdict == "FAIL"], half
        assert findings[RESTORE][0] == findings["hot and cold caches, same bits"][0] == "PASS", half
    assert len(told) == len(halves)
