"""Heat and force of named conditions, from a scenario to its probes, rules, results and page."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import Results, Run, ScenarioError, load_scenario, run
from coupler.cli.console import summary
from coupler.errors import ResultsError
from coupler.fmu.launch import launch
from coupler.report.conditions import condition_tables
from coupler.report.page import render
from coupler.running.resume import resume
from coupler.scenario import Scenario
from coupler.scenario.conditions import TAKEN, ConditionOutput, resolved
from coupler.schemes.ledger import MECHANISMS

sys.path.insert(0, str(Path(__file__).parent))

pytestmark = pytest.mark.usefixtures("unlooked")

# A bar in tension beside a warm lid.  Its hot grip is named as a mechanism of heat, the force on it as its body.
SCENE = """\
slideline: 2
title: Tension
units: {temperature: degC}
geometry: plane
materials:
  steel: {E: 2.0e+11, nu: 0.3, alpha: 0, T_ref: 20, rho: 7800, k: 45, c: 480}
bodies:
  bar: {material: steel, T0: 20, mesh: {rectangle: {origin: [0, 0], size: [0.01, 0.05], cells: [2, 6]}}}
  lid: {material: steel, T0: 120, mesh: {rectangle: {origin: [0.011, 0], size: [0.009, 0.05], cells: [2, 5]}}}
contact:
  side:
    {slave: lid.left, master: bar.right, gap_max: 0.004, penalty: 1.0e+12,
     conduction: {closed: {law: constant, h: 1000}, open: {law: constant, h: 1000}}}
thermal:
  boundary:
    - {on: bar.top, temperature: {t: [0, 10], value: [20, 200]}, name: flux}
    - {on: bar.bottom, temperature: 20, name: foot}
    - {on: lid.right, convection: {h: 50, T: 20}, name: air}
mechanical:
  half: elastic
  elastic:
    state: plane_stress
    tolerance: 1.0e-11
    boundary:
      - {on: bar.bottom, u_y: 0, name: foot}
      - {on: bar.top, u_y: {t: [0, 10], value: [0, 1.0e-6]}, name: bar}
      - {on: bar.left, u_x: 0}
      - {on: lid.bottom, u_y: 0}
      - {on: lid.right, u_x: 0, name: wall}
coupling: {scheme: extrapolated, end: 6, windows: [{until: 6, size: 0.5}]}
output: {checkpoint: 0}
probes:
  hot: {heat.flux: value}
  foot: {reaction.foot.y: value}
  grip: {"reaction.bar[2]": value}
  body: {mechanical.reaction.bar.y: value}
  step: {thermal.heat.flux: value}
  warm: {thermal.heat.air: value}
  lid: {"heat.pair.side[1]": value}
"""


def scene(tmp_path: Path, text: str = SCENE, **changes: object) -> Scenario:
    path = tmp_path / "tension.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path, changes)


def refused(tmp_path: Path, old: str, new: str) -> str:
    assert old in SCENE
    with pytest.raises(ScenarioError) as caught:
        scene(tmp_path, SCENE.replace(old, new))
    return str(caught.value)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Results:
    folder = tmp_path_factory.mktemp("ran")
    return run(scene(folder), folder / "run.h5")


def last(results: Results, name: str) -> Any:
    return results.condition(name)[1][-1]


def test_heat_by_name_adds_up(ran: Results) -> None:
    assert list(ran.conditions) == ["heat.flux", "heat.foot", "heat.air", "heat.pair.side", "reaction.foot",
                                    "reaction.bar", "reaction.wall"]
    ledger = ran.ledger
    moved = sum(abs(v) for v in ledger.values())
    given = {n: last(ran, f"heat.{n}") for n in ("flux", "foot", "air")}
    slave, master = last(ran, "heat.pair.side")
    assert slave == pytest.approx(-master, abs=1e-12 * moved)
    assert given["flux"] + given["foot"] + master == pytest.approx(ledger["stored.bar"], abs=1e-9 * moved)
    assert given["air"] + slave == pytest.approx(ledger["stored.lid"], abs=1e-9 * moved)
    assert given["air"] == pytest.approx(ledger["convection"], abs=1e-12 * moved)
    assert given["flux"] + given["foot"] == pytest.approx(
        ledger["temperature.in"] + ledger["temperature.out"], abs=1e-12 * moved)
    assert min(abs(v) for v in (*given.values(), slave)) > 1e-3 * moved


def test_grip_and_foot_show_what_their_sum_hides(ran: Results) -> None:
    grip, foot = last(ran, "reaction.bar"), last(ran, "reaction.foot")
    sigma = 2e11 * 0.6e-6 / 0.05
    assert grip[1] == pytest.approx(sigma * 0.01, rel=5e-5)
    assert foot == pytest.approx(-grip, abs=1e-9 * grip[1])
    assert abs(ran.probe("body")[1][-1]) < 1e-9 * grip[1]


def test_probes_are_of_the_condition_not_of_what_has_its_name(ran: Results) -> None:
    assert ran.probe("hot")[1].tolist() == ran.condition("heat.flux")[1].tolist()
    assert ran.probe("warm")[1].tolist() == ran.condition("heat.air")[1].tolist()
    assert ran.probe("lid")[1].tolist() == ran.condition("heat.pair.side")[1][:, 0].tolist()
    assert ran.probe("foot")[1].tolist() == ran.condition("reaction.foot")[1][:, 1].tolist()
    assert ran.probe("grip")[1].tolist() == ran.condition("reaction.bar")[1][:, 1].tolist()
    assert ran.probe("step")[1].tolist() == [0.0] * len(ran.t)  # the mechanism: no flux is prescribed
    assert (ran.quantity("hot"), ran.unit("hot"), ran.unit("foot")) == ("heat.flux", "J", "N")


def test_unknown_names_are_told_with_those_there_are(ran: Results, tmp_path: Path) -> None:
    text = refused(tmp_path, "{heat.flux: value}", "{heat.flex: value}")
    assert "probes.hot" in text
    assert "Did you mean 'heat.flux'?" in text
    assert "reaction.foot.y" in refused(tmp_path, "{reaction.foot.y: value}", "{reaction.fot.y: value}")
    assert "reaction.foot.y" in refused(tmp_path, "{reaction.foot.y: value}", "{reaction.foot: value}")
    assert "`value`" in refused(tmp_path, "{heat.flux: value}", "{heat.flux: bar.top.left}")
    rule = "rules: [{name: r, when: {heat.flu: {above: 1}}, do: [{stop: enough}]}]\nprobes:"
    text = refused(tmp_path, "probes:", rule)
    assert "Did you mean 'heat.flux'?" in text
    with pytest.raises(ScenarioError, match=r"Nothing of this scene has one"):
        scene(tmp_path, **{"mechanical.half": "rigid"})
    with pytest.raises(ResultsError, match=r"Did you mean 'heat\.flux'"):
        ran.condition("heat.fluxx")


@pytest.mark.parametrize(("monitor", "above", "condition", "part"), [
    ("heat.flux", 20000.0, "heat.flux", None), ('"reaction.bar[2]"', 3000.0, "reaction.bar", 1),
    ("reaction.bar.y", 3000.0, "reaction.bar", 1), ("thermal.heat.air", -1e9, "heat.air", None)])
def test_rules_act_on_them(tmp_path: Path, ran: Results, monitor: str, above: float, condition: str,
                           part: int | None) -> None:
    rule = f"rules: [{{name: enough, when: {{{monitor}: {{above: {above}}}}}, do: [{{stop: far}}]}}]\nprobes:"
    stopped = run(scene(tmp_path, SCENE.replace("probes:", rule)), tmp_path / "run.h5")
    values = ran.condition(condition)[1] if part is None else ran.condition(condition)[1][:, part]
    first = int(np.flatnonzero(values[1:] > above)[0]) + 1
    assert stopped.t[-1] == ran.t[first]
    assert stopped.message == "rule 'enough': far"


def test_a_drive_holds_a_force(tmp_path: Path) -> None:
    """The push on the grip goes to where its foot holds 800 N."""
    text = SCENE.replace("u_y: {t: [0, 10], value: [0, 1.0e-6]}", "t_y: -1.0e+5").replace("probes:", """\
rules:
  - name: hold
    when: {}
    drive: {load: bar, so_that: {reaction.foot.y: 800}, first: 0.3, scale: linear, gain: 1.0e-3}
probes:""")
    results = run(scene(tmp_path, text, **{"coupling.scheme": "staggered"}), tmp_path / "run.h5")
    assert last(results, "reaction.foot")[1] == pytest.approx(800.0, rel=1e-6)
    assert last(results, "reaction.bar")[1] == pytest.approx(-800.0, rel=1e-6)


def the_same(a: Results, b: Results) -> None:
    for name, series in a.conditions.items():
        np.testing.assert_array_equal(b.conditions[name].values, series.values, err_msg=name)


@pytest.mark.slow
def test_rewound_resumed_and_in_processes_they_are_the_same(ran: Results, tmp_path: Path) -> None:
    with Run(scene(tmp_path), tmp_path / "rewound.h5") as r:
        steps = r.windows()
        for _ in range(4):
            next(steps)
        moment = r.keep()
        for _ in range(3):
            next(steps)
        r.rewind(moment)
        for _ in steps:
            pass
    the_same(ran, Results(tmp_path / "rewound.h5"))
    run(scene(tmp_path), tmp_path / "resumed.h5", until=2.0)
    the_same(ran, resume(tmp_path / "resumed.h5"))
    the_same(ran, run(scene(tmp_path), tmp_path / "processes.h5", processes=True))


def test_with_substeps_and_windows_put_back_each_joule_counts_once(tmp_path: Path) -> None:
    changes = {"coupling.scheme": "iterated", "coupling.substeps": {"thermal": 3, "mechanical": 2}}
    results = run(scene(tmp_path, **changes), tmp_path / "run.h5")
    assert results.windows.iterations.max() > 1
    moved = sum(abs(v) for v in results.ledger.values())
    assert last(results, "heat.air") == pytest.approx(results.ledger["convection"], abs=1e-12 * moved)
    rule = "rules: [{name: finer, once: true, when: {heat.flux: {above: 100}}, do: [{retry: {window: 0.5}}]}]\nprobes:"
    again = run(scene(tmp_path, SCENE.replace("probes:", rule)), tmp_path / "again.h5")
    assert (~again.windows.taken).sum() == 1
    assert last(again, "heat.air") == pytest.approx(again.ledger["convection"], abs=1e-12 * moved)


def test_variables_have_units_and_words(tmp_path: Path) -> None:
    scenario = scene(tmp_path)
    with launch(scenario, processes=False) as launched:
        for of in scenario.conditions.values():
            block = (launched.thermal if of.half == "thermal" else launched.mechanical).blocks[of.output]
            assert (block.unit, block.causality) == (of.unit, "output")
            assert block.shape == (() if len(of.parts) == 1 else (2,))
            assert block.description


def test_page_and_console_show_them(ran: Results) -> None:
    page = render(ran)
    assert "Heat and force by name" in page
    for word in ("prescribed temperature", "prescribed displacement", "bar.top", "lid.right"):
        assert f"<td>{word}</td>" in page
    lines = summary(ran).splitlines()
    heat = next(line for line in lines if "heat into the bodies, per metre of depth" in line)
    assert f"flux (bar.top) {last(ran, 'heat.flux'):.5g} J" in heat
    assert any("foot (bar.bottom) 0, -" in line and line.endswith(" N") for line in lines)
    assert "conditions without a name" not in page


def test_what_has_no_name_is_told_as_a_rest(ran: Results, tmp_path: Path) -> None:
    unnamed = Results(ran.path)
    air = unnamed._conditions.pop("heat.air").values[-1]
    tables = condition_tables(unnamed)
    assert tables is not None
    assert float(tables.unnamed) == pytest.approx(air * (1e-3 if tables.unit == "kJ" else 1.0), rel=1e-5)
    assert "conditions without a name" in render(unnamed)


def test_names_taken_by_mechanisms_are_those_there_are() -> None:
    assert {n.removeprefix("heat.") for n in MECHANISMS if n.count(".") == 1} == TAKEN


def test_a_name_that_is_an_axis_is_a_name() -> None:
    known = {f"reaction.{n}": ConditionOutput(f"reaction.{n}", "mechanical", "u_x", "a.left", ("x", "y"), "N")
             for n in ("x", "grip")}
    of = {text: resolved(text, known, ("a",)) for text in (
        "reaction.x", "reaction.x.y", "reaction.grip", "reaction.grip.x", "reaction.grip[2]", "reaction.grip[3]",
        "mechanical.reaction.grip.y", "thermal.reaction.grip.y", "reaction.a.x")}
    found = {text: (one[0].name, one[1]) for text, one in of.items() if one}
    assert found == {"reaction.x.y": ("reaction.x", 2), "reaction.grip.x": ("reaction.grip", 1),
                     "reaction.grip[2]": ("reaction.grip", 2), "mechanical.reaction.grip.y": ("reaction.grip", 2)}
