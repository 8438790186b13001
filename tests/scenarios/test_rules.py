"""Rules on real halves: a lumped body that shrinks from a wall, stations of FMUs and all (the bodies of case E4)."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from coupler import Results, load_scenario, run
from coupler.cli.cli import app
from coupler.errors import HalfError
from coupler.report import write_report
from coupler.report.control import rules_that_fired
from coupler.running.replay import replayed, sentence
from coupler.running.resume import resume

sys.path.insert(0, str(Path(__file__).parent))
from small_scenes import LUMPED_GAP, ROOT, solve

pytestmark = pytest.mark.usefixtures("unlooked")

B14 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["B14"]

BASE = LUMPED_GAP.replace("{{h: 5000, T: 933}}}}", "{{h: 5000, T: 933}}, name: film}}").format(
    T0=840, method="sdirk2", scheme="extrapolated", size=1, end=16)
SOFT = "{name: soft start, once: true, when: {max_dT: {above: 3}}, do: [{retry: {window: .5}}]}"
HOLD = "{name: hold, drive: {load: film, so_that: {T: 835}, lag: 5, least: 0.2, most: 5}}"
LATE = """{name: late, once: true, when: {T: {below: 839}, t: {above: 8}}, do: [{method: {thermal: backward_euler}},
   {substeps: {thermal: x2}}, {set: {load.film: x.5}}, {scheme: iterated}]}"""
ENOUGH = "{name: enough, when: {thermal.heat_stored: {of: change, between: [-2000, 0]}}, do: [{stop: at rest}]}"

# A bar that is pulled and creeps, s = K rate^.5; the load begins at 1/33 of what it needs.
CREEPS = """
slideline: 2
units: {temperature: K}
geometry: plane
materials:
  alloy: {rho: 4400, c: 600, k: 20, E: 5.0e10, nu: 0.3, alpha: 0, T_ref: 1200, creep: {K: 1.0e9, m: 0.5, heat: 0}}
bodies:
  bar: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.01], cells: [2, 1]}}, material: alloy, T0: 1200}
thermal:
  half: lumped
mechanical:
  half: elastic
  elastic:
    boundary:
      - {on: bar.left, u_x: 0}
      - {on: bar.bottom, u_y: 0}
      - {on: bar.right, t_x: 1.0e6, name: pull}
coupling:
  scheme: staggered
  end: 60
  windows: [{until: 60, size: 1}]
probes:
  u: {u_x: bar.right.centre}
rules:
  - {name: hold the strain rate, drive: {load: pull, so_that: {max_strain_rate: 1.0e-3}}}
"""


def ruled(folder: Path, *rules: str, **overrides: object) -> Results:
    folder.mkdir(exist_ok=True)
    return solve(folder, BASE + "rules:\n" + "".join(f" - {rule}\n" for rule in rules) if rules else BASE, **overrides)


@pytest.mark.slow
def test_a_window_put_back_leaves_no_trace(tmp_path: Path) -> None:
    """The first window is cut in two by a rule: the same bits as where it was two from the start."""
    cut = ruled(tmp_path / "cut", SOFT)
    laid = ruled(tmp_path / "laid", **{"coupling.windows": [{"until": 1, "size": 0.5}, {"until": 16, "size": 1}]})
    assert list(cut.windows.verdict[:3]) == ["cut by a rule", "accepted", "accepted"]
    assert cut.messages[0].startswith("rule 'soft start': window rejected")
    np.testing.assert_array_equal(cut.t, laid.t)
    for probe in ("T", "gap"):
        np.testing.assert_array_equal(cut.probe(probe)[1], laid.probe(probe)[1])
    assert cut.heat_imbalance < 1e-12
    (firing,) = cut.firings
    assert (firing.row, firing.t, firing.rule, firing.text) == (0, 0.0, "soft start", "window rejected, x0.5")
    assert firing.values["thermal.max_dT"] > 3.0


def test_a_film_driven_so_that_a_probe_holds_its_target(tmp_path: Path) -> None:
    told = ruled(tmp_path, HOLD, **{"coupling.end": 64, "coupling.windows": [{"until": 64, "size": 1}]})
    T = told.probe("T")[1]
    assert T[-20:] == pytest.approx(835.0, abs=0.5)
    assert abs(ruled(tmp_path / "free").probe("T")[1][-1] - 835.0) > 1.0
    assert {f.rule for f in told.firings} == {"hold"}
    assert told.monitors["T"][1:] == pytest.approx(T[1:])
    (rule,) = rules_that_fired(told)
    assert (rule.name, rule.times, rule.left_out) == ("hold", len(told.firings), len(told.firings) - 10)
    page = write_report(told, tmp_path / "run.html").read_text(encoding="utf-8")
    assert f"hold: fired {rule.times} times" in page
    assert rule.last[-1].did in page


def test_a_bar_pulled_at_a_constant_strain_rate(tmp_path: Path) -> None:
    """The elastic half tells increments of E_11 = (F2 - 1)/2 only; its rate over F2 is that of the true strain.

    Without volume change t_x on the reference surface = s_11/F, s_11 = 2/sqrt3 K (2/sqrt3 rate)^.5 (plane strain).
    """
    told = solve(tmp_path, CREEPS)
    rates = [f.values["mechanical.max_strain_rate"] for f in told.firings]
    assert rates[20:] == pytest.approx([1e-3] * (len(rates) - 20), rel=B14["rate_held_within"])
    F2 = (1.0 + told.probe("u")[1] / 0.02)**2
    assert 0.5 * np.diff(F2)[20:] == pytest.approx(rates[20:], rel=2e-3)
    F2 = F2[-2:].mean()
    needed = 2.0 / np.sqrt(3.0) * 1e9 * (2.0 / np.sqrt(3.0) * 1e-3 / F2)**0.5 / F2**0.5
    assert float(told.firings[-1].text.split()[-1]) * 1e6 == pytest.approx(needed, rel=0.01)


def test_method_substeps_load_and_scheme_of_real_halves(tmp_path: Path) -> None:
    told, free = ruled(tmp_path, LATE), ruled(tmp_path / "free")
    w = told.windows
    assert list(w.scheme) == ["extrapolated"] * 9 + ["iterated"] * 7
    assert list(w.thermal_solves[:9]) == [1] * 9
    assert (w.thermal_solves[9:] == 2 * w.iterations[9:]).all()
    (firing,) = told.firings
    assert (firing.row, firing.text) == (8, "thermal.control.method 3, thermal.substeps x2, thermal.load.film x0.5, "
                                            "scheme iterated")
    np.testing.assert_array_equal(told.probe("T")[1][:10], free.probe("T")[1][:10])
    assert told.probe("T")[1][10] < free.probe("T")[1][10] - 0.5


def test_stop_is_a_good_end(tmp_path: Path) -> None:
    told = ruled(tmp_path, ENOUGH)
    assert told.outcome == "completed"
    assert "rule 'enough': at rest" in told.message
    assert told.t[-1] < 16.0
    assert told.firings[-1].values["change of thermal.heat_stored"] > -2000.0


def test_which_rules_would_have_fired(tmp_path: Path) -> None:
    """From a run with SOFT: what its monitors and probes tell, and what they do not."""
    told = ruled(tmp_path, SOFT)
    later = tmp_path / "later.yaml"
    later.write_text(BASE + f"rules:\n - {SOFT}\n - {LATE}\n - {ENOUGH}\n" + """\
 - {name: cold, when: {T: {below: 200}}, do: [{stop: cold}]}
 - {name: falls, when: {T: {below: -0.2, of: rate, for: 2}}, do: [{retry: {least: 1}}, {window: x.5}], cooldown: 1}
""", encoding="utf-8")
    soft, late, enough, cold, falls = replayed(load_scenario(later).rules, told)
    assert (soft.firings, soft.did) == ((), 1)
    assert [f.row for f in late.firings] == [10]
    assert late.firings[0].t == pytest.approx(9.0)
    assert enough.missing == ("thermal.heat_stored",)
    assert cold.firings == ()
    rate = np.diff(told.probe("T")[1]) / np.diff(told.t) < -0.2
    assert rate[:3].all()
    assert falls.firings[0].row == 2  # the second window taken
    T, t = told.probe("T")[1], told.t
    assert falls.firings[0].values == {"rate of T": pytest.approx((T[2] - T[1]) / (t[2] - t[1]), rel=1e-9)}
    assert "has not recorded thermal.heat_stored" in sentence(enough, told)
    assert sentence(cold, told) == "cold: never"
    assert sentence(soft, told) == "soft start: never; it fired once in the run itself"
    assert sentence(late, told).startswith("late: once, first in row 11 of the windows, t = 9 s (T 8")
    shown = CliRunner().invoke(app, ["check", "--rules", str(told.path), str(later)])
    assert shown.exit_code == 0, shown.output
    lines = shown.output.splitlines()
    assert lines[0] == "run.h5: scenario, completed, 17 windows to t = 16 s. Of the rules of later.yaml:"
    assert lines[1:] == [f"  {sentence(would, told)}" for would in (soft, late, enough, cold, falls)]


@pytest.mark.slow
def test_a_resumed_run_goes_on_with_what_its_rules_remember(tmp_path: Path) -> None:
    """Stopped in the middle of three windows in a row, of a rest and of a drive: the same bits as never stopped."""
    rules = (SOFT, HOLD, "{name: three, cooldown: 2, when: {T: {below: 860, for: 3}}, do: [{substeps: {thermal: x2}}]}")
    whole = ruled(tmp_path / "whole", *rules)
    (tmp_path / "cut").mkdir()
    path = tmp_path / "cut" / "scenario.yaml"
    path.write_text(BASE + "rules:\n" + "".join(f" - {rule}\n" for rule in rules), encoding="utf-8")
    run(load_scenario(path), out=tmp_path / "cut" / "run.h5", until=4.0)
    cut = resume(tmp_path / "cut" / "run.h5")
    assert {f.rule for f in whole.firings} == {"soft start", "hold", "three"}
    assert [(f.row, f.rule, f.text, f.values) for f in cut.firings] == [
        (f.row, f.rule, f.text, f.values) for f in whole.firings]
    for probe in ("T", "gap"):
        np.testing.assert_array_equal(cut.probe(probe)[1], whole.probe(probe)[1])


def test_what_the_halves_do_not_have_is_said_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(HalfError, match="rule 'a': the mechanical half gives out no max_strain_rate"):
        ruled(tmp_path, "{name: a, when: {max_strain_rate: {above: 1}}, do: [{stop: x}]}")
