"""Probes of what one step moved: recorded and told of, but not held against the same step solved as two."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupler import load_scenario, run
from coupler.experiments.confidence import confidence
from coupler.scenario.probes import NO_WEIGHTS, NONE, Probe, probe_notes
from coupler.trust.in_time.confidence import check

SCENE = """\
slideline: 2
units: {temperature: K}
geometry: plane
materials: {steel: {rho: 7800, c: 480, k: 45}}
bodies:
  plate: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.01], cells: [2, 1]}}, material: steel, T0: 300}
thermal:
  boundary:
    - {on: plate.left, name: lamp, flux: 2.0e4}
    - {on: plate.right, convection: {h: 500, T: 300}}
mechanical: {half: rigid}
coupling: {end: 600}
probes:
  step: {thermal.heat.flux: value}
  solves: {thermal.iterations: value}
  lamp: {heat.lamp: value}
  T: {T: {mean: plate}}
"""


def test_what_a_step_took_has_no_error_of_time(tmp_path: Path) -> None:
    """The half of a window takes half the heat: that was told as an error of 300 % of its range, with exit 4."""
    (tmp_path / "scene.yaml").write_text(SCENE)
    scenario = load_scenario(tmp_path / "scene.yaml")
    results = run(scenario, out=tmp_path / "run.h5")
    assert not results.broken
    errors = results.probe_errors
    assert errors["step"].error == errors["solves"].error == 0.0
    assert errors["T"].error > 0.0
    step, lamp = (results.probe(name)[1] for name in ("step", "lamp"))
    assert np.isfinite(step).all()
    assert (step[1:] > 0.0).all()
    assert (step[1:] <= np.diff(lamp) * (1.0 + 1e-9)).all(), "of the last substep, no more than of its window"
    assert lamp[-1] == pytest.approx(2.0e4 * 0.01 * 600.0, rel=1e-9)
    assert set(confidence(scenario, results)) == {"lamp", "T"}
    notes = [note for note in scenario.notes if note.startswith("probe ")]
    assert [note.partition(":")[0] for note in notes] == ["probe step", "probe solves"]
    assert "`heat.NAME` of a named condition" in notes[0]


@pytest.mark.parametrize(("quantity", "source", "of"), [
    ("thermal.heat.contact.slave", "", "heat"), ("mechanical.contact.slip", "", "contact.slip"),
    ("mechanical.contact.slip_path", "", ""), ("thermal.heat_stored", "", ""), ("mechanical.E_M", "", "E_M"),
    ("thermal.surface.E[1]", "", "surface.E"), ("heat.lamp", "thermal.condition.heat.lamp", ""), ("T", "", "")])
def test_outputs_of_a_step_are_told_from_those_of_its_end(quantity: str, source: str, of: str) -> None:
    probe = Probe(quantity, "", "point", NONE, NO_WEIGHTS, source=source)
    assert probe.of_a_step == of
    assert len(probe_notes({"a": probe})) == bool(of)


def test_without_other_probes_coarser_windows_have_nothing_to_tell() -> None:
    assert check({}).what == "every probe tells what one step moved"
