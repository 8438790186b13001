"""Rules in the scenario: what they become, and what is said where one is wrong."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest

from coupler.errors import ScenarioError
from coupler.scenario.options import Scheme
from coupler.scenario.rule_model import (
    Change,
    Drive,
    Give,
    Of,
    Retry,
    Rule,
    Stop,
    Substeps,
    Test,
    UseScheme,
    When,
    Window,
)

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, line_of, load_text

NAMED = GOOD.replace("{on: upper.top, u_y: push}", "{on: upper.top, u_y: push, name: ram}")
ALL = """\
rules:
  - name: soft start
    when: {max_dT: {above: 20}}
    do: [{retry: {window: .25, least: 0.5}}]
    once: true
    after: 2
    until: 30
    cooldown: 3
  - name: both
    when:
      face.centre: {above: 90, for: 3}
      any:
        - {max_T: {below: 500, of: change}, max_p: {between: [1.0e5, 2.0e6]}}
        - {"mechanical.reaction.upper[2]": {below: 0, of: rate}}
    do:
      - {substeps: {thermal: 2, mechanical: x2, most: 16}}
      - {method: {thermal: sdirk2, mechanical: modified_newton}}
      - {scheme: iterated}
      - {window: x.5}
      - {window: 2}
      - {set: {load.lamp: x1.5, mechanical.bc.ram: 1.0e-5}}
      - {stop: all done}
  - {name: hold, drive: {load: lamp, so_that: {face.centre: 120}, gain: 2, first: 0.5, least: 0.1, most: 10, rate: 0.2}}
  - {name: push, drive: {bc: ram, so_that: {max_p: 1.0e6}, gain: 1.0e-11, rate: 1.0e-6}}
"""


def test_every_form_of_a_rule(tmp_path: Path) -> None:
    soft, both, hold, push = load_text(tmp_path, NAMED + ALL).rules
    assert soft == Rule("soft start", When((Test("thermal.max_dT", above=20.0),)), (Retry(0.25, 0.5),), once=True,
                        after=2.0, until=30.0, cooldown=3)
    assert both.when == When(
        (Test("face.centre", above=90.0 + 273.15, windows=3),),
        ((Test("max_T", Of.CHANGE, below=500.0), Test("max_p", above=1e5, below=2e6)),
         (Test("mechanical.reaction.upper[2]", Of.RATE, below=0.0),)))
    substeps, method = {"least": 1, "most": 64} | {"most": 16}, "control.method"
    thermal, mechanical, *rest = both.do
    assert (thermal, mechanical.half, mechanical.count.times) == (Substeps("thermal", Change(2.0, 1.0, **substeps)),
                                                                 "mechanical", 2.0)
    assert [a for a in rest if isinstance(a, Give) and a.name == method] == [
        Give("thermal", method, Change(2.0)), Give("mechanical", method, Change(2.0))]
    assert rest[2] == UseScheme(Scheme.ITERATED)
    assert isinstance(rest[3], Window)
    assert rest[3].size.times == 0.5
    assert rest[4] == Window(Change(2.0))
    assert isinstance(rest[5], Give)
    assert (rest[5].half, rest[5].name, rest[5].start) == ("thermal", "load.lamp", 1.0)
    assert rest[6:] == [Give("mechanical", "bc.ram", Change(1e-5), 0.0), Stop("all done")]
    assert hold.drive == Drive("thermal", "load.lamp", "face.centre", 120 + 273.15, 0.5, 0.1, 10.0, log=True, gain=2.0,
                               rate=0.2)
    assert push.drive == Drive("mechanical", "bc.ram", "max_p", 1e6, 0.0, -math.inf, math.inf, log=False, gain=1e-11,
                               rate=1e-6)
    assert load_text(tmp_path, NAMED).rules == ()


WRONG = [  # rules text | piece on whose line the error is | key | words of message and remedy
    ("- {name: a, when: {max_dt: {above: 1}}, do: [{stop: x}]}", "rules.0.when.max_dt",
     "no such monitor or probe", "Did you mean 'max_dT'?"),
    ("- {name: a, when: {face.center: {above: 1}}, do: [{stop: x}]}", "rules.0.when.face.center",
     "no such monitor", "'face.centre'"),
    ("- {name: a, when: {max_dT: {above: 20 K}}, do: [{stop: x}]}", "rules.0.when.max_dT.above",
     "a number without its unit", "units.temperature"),
    ("- {name: a, when: {max_dT: {over: 20}}, do: [{stop: x}]}", "rules.0.when.max_dT.over", "unknown key", "above"),
    ("- {name: a, when: {max_dT: {}}, do: [{stop: x}]}", "rules.0.when.max_dT", "a bound is needed", ""),
    ("- {name: a, when: {max_dT: {above: 2, below: 1}}, do: [{stop: x}]}", "rules.0.when.max_dT",
     "no value is above 2 and below 1", ""),
    ("- {name: a, when: {max_dT: {above: 1, for: 0}}, do: [{stop: x}]}", "rules.0.when.max_dT.for",
     "whole number, 1 or more", ""),
    ("- {name: a, when: {max_T: {below: -300}}, do: [{stop: x}]}", "rules.0.when.max_T.below",
     "below absolute zero", ""),
    ("- {name: a, when: {max_dT: [{t: {above: 1}}]}, do: [{stop: x}]}", "rules.0.when.max_dT", "under `any`", ""),
    ("- {name: a, when: {t: {above: 1}}}", "rules.0", "needs `do` or `drive`", ""),
    ("- {name: a, do: [{stop: x}]}", "rules.0", "acts in every window", "once"),
    ("- {name: a, when: {t: {above: 1}}, do: [{stop: x}, {retry: {}}]}", "rules.0.do", "neither end the run",
     "two rules"),
    ("- {name: a, when: {t: {above: 1}}, do: [{retry: {window: 1}}]}", "rules.0.do.0.retry.window", "less than 1", ""),
    ("- {name: a, when: {t: {above: 1}}, do: [{retry: {}, stop: x}]}", "rules.0.do.0", "exactly one of", ""),
    ("- {name: a, when: {t: {above: 1}}, do: [{substeps: {mechanical: 1.5}}]}", "rules.0.do.0.substeps.mechanical",
     "a factor such as x2", ""),
    ("- {name: a, when: {t: {above: 1}}, do: [{window: '*2'}]}", "rules.0.do.0.window", "not a factor", "x2"),
    ("- {name: a, when: {t: {above: 1}}, do: [{method: {mechanical: newtn}}]}", "rules.0.do.0.method.mechanical",
     "no such method", "'newton'"),
    ("- {name: a, when: {t: {above: 1}}, do: [{method: {thermal: theta}}]}", "rules.0.do.0.method.thermal",
     "the method theta needs the value of theta", "thermal.theta"),
    ("- {name: a, when: {t: {above: 1}}, do: [{method: {mechanical: explicit}}]}", "rules.0.do.0.method.mechanical",
     "the method explicit needs inertia", "dynamics"),
    ("- {name: a, when: {t: {above: 1}}, do: [{scheme: iterate}]}", "rules.0.do.0.scheme", "not known", "'iterated'"),
    ("- {name: a, when: {t: {above: 1}}, do: [{set: {load.lmp: 2}}]}", "rules.0.do.0.set.load.lmp",
     "no named boundary condition 'lmp'", "'lamp'"),
    ("- {name: a, when: {t: {above: 1}}, do: [{set: {bc.lamp: 2}}]}", "rules.0.do.0.set.bc.lamp",
     "of the thermal half, which takes load alone", "load.lamp"),
    ("- {name: a, when: {t: {above: 1}}, do: [{set: {bc.rm: 2}}]}", "rules.0.do.0.set.bc.rm", "that takes bc", "'ram'"),
    ("- {name: a, when: {t: {above: 1}}, do: [{set: {heat: 2}}]}", "rules.0.do.0.set.heat", "not an input",
     "load.NAME"),
    ("- {name: a, until: 3, after: 4, when: {t: {above: 1}}, do: [{stop: x}]}", "rules.0.until", "not later", ""),
    ("- {name: a, drive: {load: lamp, so_that: {max_T: 300}, least: 0}}", "rules.0.drive.least", "greater than zero",
     "linear"),
    ("- {name: a, drive: {bc: ram, so_that: {max_p: 1}}}", "rules.0.drive", "a gain is needed", "change of load"),
    ("- {name: a, drive: {bc: ram, so_that: {max_p: 1}, gain: 0}}", "rules.0.drive", "a gain is needed", ""),
    ("- {name: a, drive: {load: lamp, so_that: {max_p: 1}, gain: -1}}", "rules.0.drive.gain", "greater than zero",
     "scale: linear"),
    ("- {name: a, drive: {load: lamp, so_that: {max_p: 1, max_T: 1}}}", "rules.0.drive.so_that", "", ""),
    ("- {name: a, drive: {load: lamp, so_that: {max_p: 0}}}", "rules.0.drive.so_that.max_p", "no logarithm", "linear"),
    ("- {name: a, drive: {load: lamp, so_that: {max_p: 1}, least: 2}}", "rules.0.drive", "out of its bounds", "first"),
    ("- {name: a, drive: {so_that: {max_p: 1}}}", "rules.0.drive", "exactly one of load, bc", ""),
    ("- {name: a, when: {t: {above: 1}}, do: [{stop: x}]}\n  - {name: a, when: {t: {above: 1}}, do: [{stop: x}]}",
     "rules.1.name", "another rule 'a'", "its own"),
]


@pytest.mark.parametrize(("text", "key", "message", "remedy"), WRONG)
def test_what_is_wrong_is_said_at_its_place(tmp_path: Path, text: str, key: str, message: str, remedy: str) -> None:
    with pytest.raises(ScenarioError) as raised:
        load_text(tmp_path, f"{NAMED}rules:\n  {text}\n")
    error = raised.value
    assert error.key == key
    assert message in error.message
    assert remedy in error.remedy
    assert error.line == line_of("rules:", f"{NAMED}rules:\n") + 1 + (key.startswith("rules.1"))
    assert error.file.endswith("s.yaml")


def test_a_probe_with_the_name_of_a_monitor(tmp_path: Path) -> None:
    text = GOOD.replace("face.left:", "max_T:") + "rules:\n  - {name: a, when: {max_T: {above: 1}}, do: [{stop: x}]}\n"
    with pytest.raises(ScenarioError, match="a monitor and a probe"):
        load_text(tmp_path, text)


def test_a_name_that_both_halves_have(tmp_path: Path) -> None:
    text = NAMED.replace("name: lamp", "name: ram")
    rule = "rules:\n  - {name: a, when: {t: {above: 1}}, do: [{set: {HALFload.ram: 2}}]}\n"
    with pytest.raises(ScenarioError, match=r"both halves have a condition 'ram'.*thermal\.load\.ram"):
        load_text(tmp_path, text + rule.replace("HALF", ""))
    for half in ("thermal", "mechanical"):
        (found,) = load_text(tmp_path, text + rule.replace("HALF", f"{half}.")).rules
        assert found.do == (Give(half, "load.ram", Change(2.0), 1.0),)


@pytest.mark.parametrize("rule", ["once: true, do: [{set: {load.hot: 0.6}}]",
                                  "drive: {load: hot, so_that: {max_T: 200}}"])
def test_a_factor_on_a_temperature_is_one_of_kelvin(tmp_path: Path, rule: str) -> None:
    """0.6 times 500 degC is 190.7 degC: said where the file is in degC, of temperatures alone."""
    text = GOOD.replace("temperature: oven}", "temperature: oven, name: hot}") + f"rules:\n  - {{name: a, {rule}}}\n"
    (found,) = [n for n in load_text(tmp_path, text).notes if "load.hot" in n]
    assert "190.7 degC" in found
    for other in (text.replace("degC", "K"), text.replace("load.hot", "load.lamp").replace("load: hot", "load: lamp"),
                  text[:text.index("rules:")]):
        assert not [n for n in load_text(tmp_path, other).notes if "in kelvin" in n]


def test_a_retry_goes_no_further_than_windows_that_find_their_own_size(tmp_path: Path) -> None:
    start, end = GOOD.index("  windows:"), GOOD.index("probes:")
    text = GOOD[:start] + "  adaptive: {first: 1, least: 0.25}\n" + GOOD[end:]
    for given, least in (("", 0.25), ("least: 0.1", 0.25), ("least: 0.5", 0.5)):
        rule = f"rules:\n  - {{name: a, when: {{max_dT: {{above: 1}}}}, do: [{{retry: {{{given}}}}}]}}\n"
        (found,) = load_text(tmp_path, text + rule).rules
        assert found.do == (Retry(0.5, least),)


@pytest.mark.parametrize(("pair", "key"), [("augmented: {}", "augmented"), ("tied: true", "augmented: null")])
def test_a_rule_takes_no_explicit_steps_where_pressures_settle(tmp_path: Path, pair: str, key: str) -> None:
    """The head of the file refuses it, and so must a rule: what is augmented, stated or by default, never settled."""
    conduction = GOOD[GOOD.index("    conduction:"):GOOD.index("thermal:\n  half")]
    text = GOOD.replace(conduction, f"    {pair}\n").replace("  elastic:\n", "  elastic:\n    dynamics: {}\n")
    rule = "rules:\n  - {name: a, when: {t: {above: 1}}, do: [{method: {mechanical: METHOD}}]}\n"
    with pytest.raises(ScenarioError, match="finds no equilibrium") as raised:
        load_text(tmp_path, text + rule.replace("METHOD", "explicit"))
    assert raised.value.key == "rules.0.do.0.method.mechanical"
    assert f"contact.face.{key}" in raised.value.remedy
    assert load_text(tmp_path, text + rule.replace("METHOD", "bfgs")).rules
    alone = text.replace(pair, "augmented: null" if pair == "augmented: {}" else f"{pair}\n    augmented: null")
    assert load_text(tmp_path, alone + rule.replace("METHOD", "explicit")).rules
