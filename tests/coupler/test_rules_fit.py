"""What rules ask of halves that do not have it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from coupler.control.state import ControlState
from coupler.errors import ScenarioError
from coupler.fmu.half import Block
from coupler.rules.engine import unfit
from coupler.running.interactive import changed
from coupler.scenario.options import Scheme
from coupler.scenario.rule_model import Change, Drive, Give, Rule, Stop, Test, When
from coupler.schemes.state import Settings, wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
from fake_halves import blocks_of
from ruled_run import heating, scalar, still

MECHANICAL = blocks_of(scalar("max_strain_increment", "output"), scalar("load.p", "input"),
                       Block("reaction.ram", (2,), "N", "output", "Real"), Block("t", (50,), "Pa", "output", "Real"),
                       Block("status.code", (), "1", "output", "Integer"))
BLOCKS = {"thermal": heating().blocks, "mechanical": MECHANICAL}


def watching(monitor: str) -> Rule:
    return Rule("r", When((Test(monitor, above=0.0),)), (Stop("x"),))


@pytest.mark.parametrize("monitor", ["t", "error.gap", "a.probe", "thermal.max_dT", "mechanical.max_strain_rate",
                                     "mechanical.reaction.ram[2]"])
def test_what_is_there(monitor: str) -> None:
    assert unfit([watching(monitor)], BLOCKS) == []


@pytest.mark.parametrize("monitor", ["thermal.max_strain_rate", "mechanical.reaction.ram[3]", "mechanical.t[1]",
                                     "mechanical.reaction.ram", "mechanical.status.code", "thermal.load.lamp"])
def test_what_is_not(monitor: str) -> None:
    half, _, name = monitor.partition(".")
    assert unfit([watching(monitor)], BLOCKS) == [f"rule 'r': the {half} half gives out no {name}"]


def test_inputs() -> None:
    good = Rule("good", do=(Give("mechanical", "load.p", Change(to=1.0)),))
    bad = Rule("bad", do=(Give("mechanical", "control.method", Change(to=1.0)),),
               drive=Drive("thermal", "bc.lamp", "t", 1.0, 1.0, 0.0, 2.0, log=False, gain=1.0))
    assert unfit([good, bad], BLOCKS) == ["rule 'bad': the mechanical half has no input control.method",
                                          "rule 'bad': the thermal half has no input bc.lamp"]


def test_a_user_cannot_give_a_run_rules_that_its_halves_do_not_fit() -> None:
    control = ControlState(Settings(Scheme.STAGGERED, {"thermal": 1, "mechanical": 1}))
    halves = wanted_outputs(heating(), still())
    assert changed(control, halves, rules=[watching("thermal.max_dT")]) == control
    with pytest.raises(ScenarioError, match="rule 'r': the thermal half gives out no max_strain_rate"):
        changed(control, halves, rules=[watching("thermal.max_strain_rate")])
