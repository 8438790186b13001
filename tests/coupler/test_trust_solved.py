"""Halves that solve to a loose tolerance: what their equations leave ends in the trust table, and in exit code 4."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from fresh_scenes import column

from coupler import load_scenario, run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.trust.laws import solved

BEAM = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials: {{m: {{rho: 1, c: 1, k: 1, alpha: 0, T_ref: 300, E: 2.0e11, nu: 0}}}}
bodies: {{beam: {{mesh: {{rectangle: {{origin: [0, 0], size: [10, 0.2], cells: [40, 2]}}}}, material: m, T0: 300}}}}
thermal: {{half: thermal}}
mechanical:
  half: elastic
  elastic:
    element: enhanced
    tolerance: {tolerance}
    boundary: [{{on: beam.left, u_x: 0, u_y: 0}}, {{on: beam.right, t_y: {{t: [0, 1], value: [0, -5.0e6]}}}}]
coupling: {{scheme: staggered, end: 1, windows: [{{until: 1, size: 0.5}}]}}
probes: {{u: {{u_y: beam.right.centre}}}}
"""

HEAT = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  m: {{rho: 1, c: {{T: [300, 400, 600], value: [1, 3, 1]}}, k: {{T: [300, 400, 600], value: [1, 9, 2]}}, alpha: 0,
      T_ref: 300}}
bodies: {{wall: {{mesh: {{rectangle: {{origin: [0, 0], size: [1, 1], cells: [20, 2]}}}}, material: m, T0: 300}}}}
thermal: {{method: sdirk2, tolerance: {tolerance}, boundary: [{{on: wall.left,
  temperature: {{t: [0, 0.5], value: [300, 600]}}}}]}}
mechanical: {{half: rigid}}
coupling: {{scheme: staggered, end: 0.5, windows: [{{until: 0.5, size: 0.05}}]}}
probes: {{T: {{T: wall.right.centre}}}}
"""


def scene(folder, text, tolerance):
    file = folder / f"at{tolerance:g}.yaml"
    file.write_text(text.format(tolerance=tolerance))
    return file


def check_of(rows):
    return next((c for c in rows if c.name == solved.NAME), None)


@pytest.mark.few("0.01-1.0-broken")
@pytest.mark.parametrize(("tolerance", "off", "verdict"), [(1e-8, 1e-8, "holds"), (1e-2, 1.0, "broken")])
def test_a_beam_that_was_not_solved_for(tmp_path, tolerance, off, verdict):
    """By a tolerance of 1 % the beam stays straight: its load is 0.3 % of the forces that hold it.  Tip: -2.35636 m."""
    results = run(load_scenario(scene(tmp_path, BEAM, tolerance)), tmp_path / "run.h5")
    assert results.probe("u")[1][-1] == pytest.approx(-2.356356301 * (1.0 - (off if off == 1.0 else 0.0)), rel=1e-8)
    check = check_of(results.trust)
    assert check.verdict == verdict
    if verdict == "broken":
        assert check.number == pytest.approx(0.00306, rel=0.01)
        assert "mechanical.elastic.tolerance" in check.sentence


def test_heat_that_was_not_solved_for(tmp_path):
    """By a tolerance of 0.5 the far side is 0.5 K off."""
    found = {}
    for tolerance in (1e-10, 1e-3, 0.5):
        results = run(load_scenario(scene(tmp_path, HEAT, tolerance)), tmp_path / f"run{tolerance:g}.h5")
        found[tolerance] = results.probe("T")[1][-1], check_of(results.trust)
    assert [check.verdict for _, check in found.values()] == ["holds", "noted", "broken"]
    assert abs(found[1e-3][0] - found[1e-10][0]) < 1e-3
    assert abs(found[0.5][0] - found[1e-10][0]) > 0.1
    assert "thermal.tolerance" in found[0.5][1].sentence


def test_a_step_without_heat_has_round_off_alone(tmp_path):
    """The adiabatic split puts on the entropy part at once: at rest, and 36 000 K, that leaves half of nothing."""
    scenario = scenario_from(json.dumps(column(0.05, 0.2, "adiabatic")), tmp_path / "column.yaml", {})
    check = check_of(run(scenario, tmp_path / "run.h5").trust)
    assert check.verdict == "holds"
    assert check.number < 1e-7


def test_heat_counts_with_what_was_moved_and_forces_with_their_worst_window():
    log = solved.watched(solved.SolvedLog(), {"thermal.residual": 1e-2, "mechanical.residual": 2e-3},
                         {"heat.flux": 1.0, "heat.stored.a": 1.0}, 1.0)
    log = solved.watched(log, {"thermal.residual": 0.0, "mechanical.residual": 1e-9},
                         {"heat.flux": 99.0, "heat.stored.a": 99.0, "heat_rounding": 1e9}, 2.0)
    assert log.missing / log.moved == pytest.approx(1e-4)
    assert (log.force, log.t) == (2e-3, 1.0)


def test_no_half_that_tells_no_row():
    log = solved.watched(solved.SolvedLog(), {"touching": 0.0}, {"heat.flux": 1.0}, 1.0)
    assert solved.checks(log) == ()
    log = solved.watched(log, {"thermal.residual": 0.0}, {}, 2.0)
    assert [c.verdict for c in solved.checks(log)] == [TrustVerdict.HOLDS]
