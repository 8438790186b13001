"""Clearance and interference of a pair: the gap at the start is what is stated, whatever is drawn."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import read_interface
from coupler import Results, run
from coupler.errors import ScenarioError
from coupler.trust.in_space import heat_mesh, mesh, moved, probed

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text

APART = 1.0e-4  # m
SHORT = {"coupling.end": 10, "coupling.kinks": [], "output.fields": {"every": 1},
         "coupling.windows": [{"until": 10, "size": 2}]}


def solved(folder: Path, **keys: Any) -> Results:
    folder.mkdir()
    keys = {name.replace("__", "."): value for name, value in keys.items()}
    return run(load_text(folder, GOOD, {**SHORT, **keys}), out=folder / "run.h5")


def drawn(gap: float) -> dict[str, Any]:
    return {"bodies__upper__mesh__rectangle__origin": [0, 1.0 + gap]}


CLOSES = {"signals__push": {"t": [0, 10], "value": [0, -2 * APART]}}
FITS = {
    "a clearance of what touches as drawn": (drawn(APART), {"contact__face__clearance": APART}),
    "an interference as an overlap": (drawn(-APART / 10), {"contact__face__interference": APART / 10}),
    "in touch, though drawn apart": (drawn(0.0), {**drawn(0.02), "contact__face__clearance": 0}),
    "farther apart than the surfaces see": (drawn(APART), {**drawn(0.2), "contact__face__gap_max": 0.21,
                                                           "contact__face__clearance": APART}),
}


@pytest.mark.few("an interference as an overlap-elastic", "in touch, though drawn apart-rigid")
@pytest.mark.parametrize("half", ["elastic", "rigid"])
@pytest.mark.parametrize("fit", FITS)
def test_it_is_as_if_it_were_drawn_so(fit: str, half: str, tmp_path: Path) -> None:
    """Pressures and temperatures; rays from a bent surface that go 0.2 m end elsewhere by 1e-8 m."""
    one, other = FITS[fit]
    way = {**CLOSES, "mechanical__half": half}
    a, b = solved(tmp_path / "drawn", **one, **way), solved(tmp_path / "told", **other, **way)
    np.testing.assert_allclose(b.contact["face"].t_N, a.contact["face"].t_N, rtol=2e-5,
                               atol=2e-5 * np.abs(a.contact["face"].t_N).max())
    faced = a.contact["face"].gap < 0.09
    assert ((b.contact["face"].gap < 0.09) == faced).all()
    np.testing.assert_allclose(b.contact["face"].gap[faced], a.contact["face"].gap[faced], rtol=0.0, atol=1e-4 * APART)
    K = 1e-4 if "farther" in fit else 1e-5
    for name in ("face.left", "face.centre"):
        np.testing.assert_allclose(b.probe(name)[1], a.probe(name)[1], rtol=0.0, atol=K)
    # Cells of a quarter of a metre do not resolve what heat does in 10 s, nor its stress, however the blocks are drawn.
    known = {heat_mesh.NAME, mesh.NAME, moved.NAME, probed.NAME}
    assert {check.name for check in b.broken} == {check.name for check in a.broken} <= known


def test_a_fit_may_change_along_the_surface(tmp_path: Path) -> None:
    terms = {"terms": [{"x": {"polynomial": [1e-4, 2e-4]}}]}
    scenario = load_text(tmp_path, GOOD, {"contact.face.clearance": terms})
    scenario.write_half("mechanical", tmp_path / "half")
    interface = read_interface(tmp_path / "half" / "interface.h5")
    x = interface.nodes[interface.pair_nodes, 0]
    np.testing.assert_allclose(interface.gap_offset, 1e-4 + 2e-4 * x, rtol=1e-12)


@pytest.mark.few("True")
@pytest.mark.parametrize("exchanged", [False, True])
def test_a_shrink_fit_by_its_interference(exchanged: bool, tmp_path: Path) -> None:
    """Lame, drawn in touch, whichever side is the slave.  The mesh is too stiff by 0.06 %."""
    a, b, c, delta, E, nu = 0.02, 0.03, 0.04, 1.0e-5, 2.0e11, 0.3
    sides = ["tube.right", "ring.left"][:: -1 if exchanged else 1]
    text = f"""\
slideline: 2
units: {{temperature: K}}
geometry: axisymmetric
materials:
  steel: {{rho: 7800, k: 45, c: 480, E: {E}, nu: {nu}, alpha: 0}}
bodies:
  tube: {{mesh: {{rectangle: {{origin: [{a}, 0], size: [{b - a}, 0.01], cells: [4, 4]}}}}, material: steel, T0: 300}}
  ring: {{mesh: {{rectangle: {{origin: [{b}, 0], size: [{c - b}, 0.01], cells: [4, 3]}}}}, material: steel, T0: 300}}
contact:
  face: {{slave: {sides[0]}, master: {sides[1]}, gap_max: 0.01, interference: {delta}}}
thermal: {{}}
mechanical:
  half: elastic
  elastic:
    boundary:
      - {{on: tube.bottom, u_y: 0}}
      - {{on: tube.top, u_y: 0}}
      - {{on: ring.bottom, u_y: 0}}
      - {{on: ring.top, u_y: 0}}
coupling: {{end: 1, windows: [{{until: 1, size: 1}}]}}
"""
    p = -run(load_text(tmp_path, text), out=tmp_path / "run.h5").contact["face"].t_N[-1]
    E_, nu_ = E / (1.0 - nu**2), nu / (1.0 - nu)
    exact = delta * E_ / b / ((c**2 + b**2) / (c**2 - b**2) + nu_ + (b**2 + a**2) / (b**2 - a**2) - nu_)
    np.testing.assert_allclose(p, exact, rtol=0.002)


@pytest.mark.parametrize(("keys", "where", "words"), [
    ({"contact.face.clearance": 0, "contact.face.interference": 1e-4}, "interference", "Give one of the two"),
    ({"contact.face.clearance": 0, "bodies.upper.mesh.rectangle.origin": [0, 1.5]}, "clearance", "do not face"),
    ({"contact.face.clearance": "push"}, "clearance", "does not change in time"),
    ({"contact.face.interference": 0, "contact.face.slave": "lower.top"}, "interference", "faces itself"),
    ({"contact.face.clearance": "loose"}, "clearance", ""),
])
def test_what_is_no_fit_is_named(keys: dict[str, Any], where: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, GOOD, keys)
    assert caught.value.key == f"contact.face.{where}"
    assert words in f"{caught.value.message} {caught.value.remedy}"
