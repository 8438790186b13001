"""A half with friction stands still while its inputs stay as they are; one that creeps on, or dies away, is wrong."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from coupler import load_scenario
from coupler.fmu.half import Half
from coupler.verify.bench import settled
from coupler.verify.border import CheckVerdict
from coupler.verify.physics import converges
from coupler.verify.verdicts import border_of
from mechanical_fmu.elastic_half import load

sys.path.insert(0, str(Path(__file__).parent))
from broken_halves import Broken, Values, on
from model_half import ModelHalf
from stacked_blocks import rectangle, stacked

# The upper block is pressed by a traction, and warmer: its ends slip outwards.
SCENE = stacked(
    rectangle("0, 0", "0.04, 0.01", "8, 4", 300), rectangle("0.005, 0.01", "0.02, 0.01", "6, 4", 600), T_ref=293.15,
    mu=0.3, h=1000, end=10, elastic="""\
    boundary:
      - {on: lower.bottom, u_x: 0, u_y: 0}
      - {on: upper.top, u_x: 0}
      - {on: upper.top, t_y: -1.0e6}
""")


def creeps(half: Broken, outputs: Values, h: float) -> Values:
    """1e-8 m more in each substep, of any length."""
    return on("x", lambda half, x: x + 1e-8 * half.made)(half, outputs, h)


def dies_away(half: Broken, outputs: Values, h: float) -> Values:
    """4.5e-8 m in the first substep, and 0.92 of the last one in each that follows."""
    return on("x", lambda half, x: x + 4.5e-8 * (1.0 - 0.92**half.made) / 0.08)(half, outputs, h)


PENALTY = "    penalty: 1.0e13\n"
SCENES = {"augmented": SCENE, "penalty": SCENE.replace(PENALTY, PENALTY + "    augmented: null\n"),
          "rounds": SCENE.replace(PENALTY, "    augmented: {method: uzawa}\n"),
          "two passes": SCENE.replace(PENALTY, PENALTY + "    two_pass: true\n"),
          "nodes": SCENE.replace(PENALTY, "    form: nodes\n"),
          "other slave": SCENE.replace("slave: upper.bottom", "slave: lower.top").replace("master: lower.top",
                                                                                       "master: upper.bottom")}


@pytest.mark.few("augmented-None-CheckVerdict.PASS", "augmented-dies_away-CheckVerdict.FAIL")
@pytest.mark.parametrize(("scene", "rule", "verdict"), [
    *((name, None, CheckVerdict.PASS) for name in SCENES),
    ("augmented", creeps, CheckVerdict.FAIL), ("augmented", dies_away, CheckVerdict.FAIL)])
def test_nothing_may_creep(tmp_path: Path, scene: str, rule: Callable[[Broken, Values, float], Values] | None,
                           verdict: CheckVerdict) -> None:
    (tmp_path / "s.yaml").write_text(SCENES[scene])
    scenario = load_scenario(tmp_path / "s.yaml")

    def make() -> Half:
        half = ModelHalf(load(scenario.interface, scenario.models["mechanical"]))
        return half if rule is None else Broken(half, rule)

    finding = converges(settled(make, 1.0, border_of(scenario, "mechanical")), "substeps converge")
    assert finding.verdict is verdict, finding.reason
