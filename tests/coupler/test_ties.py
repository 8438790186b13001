"""Tied pairs of a scenario: pulled apart they hold, heat crosses them as stated, and what contradicts is told."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import Results, run
from coupler.control.contact_status import ContactState
from coupler.errors import ScenarioError
from coupler.scenario.ties import LAYER

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, line_of, load_text

# Two bars on end, 3 and 4 cells across, pulled by their ends at 100 MPa: what is only in contact would part.
PULLED = """\
slideline: 2
units: {temperature: K}
geometry: plane
materials:
  steel: {rho: 7800, k: 45, c: 480, E: 2.0e11, nu: 0, alpha: 0}
  brass: {rho: 8500, k: 120, c: 380, E: 1.0e11, nu: 0, alpha: 0}
bodies:
  lower: {mesh: {rectangle: {origin: [0, 0], size: [0.1, 0.2], cells: [3, 6]}}, material: steel, T0: 300}
  upper: {mesh: {rectangle: {origin: [0, 0.2], size: [0.1, 0.1], cells: [4, 4]}}, material: brass, T0: 300}
contact:
  joint: {slave: upper.bottom, master: lower.top, gap_max: 1.0e-3, tied: true}
thermal:
  method: steady
  boundary:
    - {on: lower.bottom, temperature: 300}
    - {on: upper.top, temperature: 400}
mechanical:
  half: elastic
  elastic:
    boundary:
      - {on: lower.bottom, u_y: 0}
      - {on: lower.left, u_x: 0}
      - {on: upper.left, u_x: 0}
      - {on: upper.top, t_y: {t: [0, 1], value: [0, 1.0e8]}}
coupling: {end: 2, windows: [{until: 2, size: 1}]}
probes:
  below: {T: {mean: lower.top}}
  above: {T: {mean: upper.bottom}}
  spread: {T: {max: lower.top}}
  pulled: {mechanical.reaction.lower.y: value}
  p: {p: {max: upper.bottom}}
output: {fields: {every: 1}}
"""
WARM = {"below": {"T": {"mean": "lower.top"}}, "above": {"T": {"mean": "upper.bottom"}},
        "spread": {"T": {"max": "lower.top"}}}  # what the half rigid can tell, too
L, K = (0.2, 0.1), (45.0, 120.0)


def solved(folder: Path, text: str = PULLED, name: str = "run", **keys: Any) -> Results:
    return run(load_text(folder, text, {k.replace("__", "."): v for k, v in keys.items()}), out=folder / f"{name}.h5")


def jump(R: float) -> float:
    """Steady difference of temperature [K] across a joint of resistance R [m2K/W]."""
    return 100.0 * R / (L[0] / K[0] + R + L[1] / K[1])


@pytest.mark.few("1e-05-elastic")
@pytest.mark.parametrize("half", ["elastic", "rigid"])
@pytest.mark.parametrize("R", [1e-3, 1e-5])
def test_heat_crosses_it_by_its_resistance_though_it_is_pulled(R: float, half: str, tmp_path: Path) -> None:
    results = solved(tmp_path, contact__joint__resistance=R, mechanical__half=half, probes=WARM)
    above, below = (float(results.probe(name)[1][-1]) for name in ("above", "below"))
    assert above - below == pytest.approx(jump(R), rel=2e-3)  # the bar is pulled by 5e-4, and its area shrinks
    assert float(results.probe("spread")[1][-1]) == pytest.approx(below, abs=1e-6)
    assert not results.broken


def test_one_without_a_resistance_conducts_like_a_hundredth_of_the_cells_beside_it(tmp_path: Path) -> None:
    results = solved(tmp_path)
    above, below = (float(results.probe(name)[1][-1]) for name in ("above", "below"))
    assert above - below == pytest.approx(jump(LAYER * (0.2 / 6 / K[0] + 0.1 / 4 / K[1])), rel=2e-3)
    assert above - below < 2e-3 * 100.0  # as good as one bar, on these six and four cells


def test_it_carries_the_pull_and_says_so(tmp_path: Path) -> None:
    results = solved(tmp_path)
    assert float(results.probe("pulled")[1][-1]) == pytest.approx(-1.0e7, rel=1e-3)
    joint = results.contact["joint"]
    # Pulled, its pressure is negative.
    assert float(results.probe("p")[1][-1]) == pytest.approx(-1.0e8, rel=1e-3)
    np.testing.assert_allclose(joint.t_N[-1], 1.0e8, rtol=1e-3)


@pytest.mark.slow
def test_roles_do_not_matter(tmp_path: Path) -> None:
    a = solved(tmp_path)
    b = solved(tmp_path, name="exchanged", contact__joint__slave="lower.top", contact__joint__master="upper.bottom")
    for name in ("above", "below", "pulled", "p"):
        assert float(b.probe(name)[1][-1]) == pytest.approx(float(a.probe(name)[1][-1]), rel=2e-5)


@pytest.mark.few("thermal")
@pytest.mark.parametrize("half", ["lumped", "thermal"])
def test_heat_is_kept_across_it_in_time(half: str, tmp_path: Path) -> None:
    """Bodies of 300 and 400 K, insulated: together they come to the mean of what they store."""
    results = solved(tmp_path, thermal__half=half, thermal__method="backward_euler", thermal__boundary=[],
                     bodies__upper__T0=400, contact__joint__resistance=1e-6, coupling__end=20000,
                     coupling__windows=[{"until": 20000, "size": 500}], mechanical__half="rigid",
                     probes=WARM)
    store = np.array([7800 * 480 * 0.02, 8500 * 380 * 0.01])
    mean = float(store @ [300.0, 400.0] / store.sum())
    for name in ("above", "below"):
        assert float(results.probe(name)[1][-1]) == pytest.approx(mean, abs=1e-3)
    assert abs(results.heat_imbalance) < 1e-8


def test_a_tied_pair_never_opens(tmp_path: Path) -> None:
    """Pulled, let go and pressed: no event, no status but closed."""
    results = solved(tmp_path, mechanical__elastic__boundary=[
        {"on": "lower.bottom", "u_y": 0}, {"on": "lower.left", "u_x": 0}, {"on": "upper.left", "u_x": 0},
        {"on": "upper.top", "t_y": {"t": [0, 1, 2], "value": [0, 1.0e8, -1.0e8]}}],
        coupling__windows=[{"until": 2, "size": 0.25}], coupling__events={})
    assert len(results.t) == 9  # every window ended where it was planned
    assert float(results.probe("p")[1][-1]) == pytest.approx(1.0e8, rel=2e-3)


def test_its_status_is_closed_whatever_it_carries() -> None:
    from coupler.control.contact_status import PairNodes, contact_status
    from coupler.schemes.levels import Level

    n = np.arange(3)
    pulled = Level(0.0, np.zeros(3), np.zeros((3, 2)), np.full(3, 1e6), np.zeros(3), np.ones(3), None)
    for tied, is_so in ((True, ContactState.CLOSED), (False, ContactState.OPEN)):
        assert contact_status((PairNodes("joint", n, 1.0, tied=tied),), pulled, {}).status[0] is is_so


def test_the_report_says_tied(tmp_path: Path) -> None:
    from coupler.report.contact import TIED, status

    results = solved(tmp_path)
    assert (status(results.contact["joint"], 0.0, 1e-3, tied=True) == TIED).all()


BAD = {
    "friction": ("{mu: 0.2}", "does not slip"), "clearance": ("1.0e-4", "keeps the gap"),
    "interference": ("1.0e-4", "keeps the gap"), "two_pass": ("true", "from both sides alike"),
    "form": ("nodes", "edges cut"), "conduction": ("{closed: {law: constant, h: 1}, open: null}", "resistance"),
    "smooth": ("true", "keeps the gap"),
    "radiation": ("{emissivity_slave: 0.5, emissivity_master: 0.5}", "nothing crosses a gap")}


@pytest.mark.parametrize("key", BAD)
def test_what_contradicts_is_told_with_its_place(key: str, tmp_path: Path) -> None:
    value, why = BAD[key]
    text = PULLED.replace("  joint: {slave: upper.bottom, master: lower.top, gap_max: 1.0e-3, tied: true}\n",
                          "  joint:\n    slave: upper.bottom\n    master: lower.top\n    gap_max: 1.0e-3\n"
                          f"    tied: true\n    {key}: {value}\n")
    with pytest.raises(ScenarioError, match=why) as told:
        load_text(tmp_path, text)
    assert told.value.key == f"contact.joint.{key}"
    assert told.value.line == line_of(f"    {key}: {value}", text)
    assert f"Leave {key} out" in str(told.value)


def test_other_contradictions_are_told_too(tmp_path: Path) -> None:
    for change, why in (({"bodies.upper.mesh.rectangle.origin": [0, 0.21]}, "nothing to tie.*0.01 m apart, gap_max"),
                        ({"contact.joint.tied": False, "contact.joint.resistance": 1e-4}, "that of a tied pair"),
                        ({"mechanical.half": "rigid", "mechanical.rigid": {"motion": {"upper": {"u_y": 0.1}}}},
                         "moves upper and lower apart"),
                        ({"mechanical.elastic.boundary.1.until": {"joint": "closes"}}, "is tied: it is closed")):
        with pytest.raises(ScenarioError, match=why):
            load_text(tmp_path, PULLED, change)


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a_tie_of_a_part_is_told_with_its_share(geometry: str, tmp_path: Path) -> None:
    """A joint of 0.1 m, of which 0.04 reach beyond the other side: 0.6 of its width, 0.84 of its rings."""
    change = {"bodies.lower.mesh.rectangle": {"origin": [0.04, 0], "size": [0.1, 0.2], "cells": [3, 6]},
              "geometry": geometry}
    notes = [n for n in load_text(tmp_path, PULLED, change).notes if "is tied" in n]
    share = "60" if geometry == "plane" else "84"
    assert notes == [f"pair joint: {share} % of upper.bottom is tied; the rest faces nothing within gap_max = 0.001 m "
                     "as drawn, and stays free"]
    assert not [n for n in load_text(tmp_path, PULLED).notes if "is tied" in n]


def test_rods_are_not_tied(tmp_path: Path) -> None:
    rods = {"contact.face": {"slave": "upper.left", "master": "lower.right", "gap_max": 0.1, "tied": True},
            "bodies.upper.mesh.rectangle.origin": [2, 0], "mechanical.half": "rod", "thermal.boundary": [],
            "mechanical.rod": {"held": {"lower": {"left": 0}, "upper": {"right": 0}}}, "probes": {}}
    with pytest.raises(ScenarioError, match="rods press on each other, they do not pull"):
        load_text(tmp_path, GOOD, rods)


def test_ties_settle_with_inertia_too_but_not_in_explicit_steps(tmp_path: Path) -> None:
    def augmented(**elastic: Any) -> Any:
        told = load_text(tmp_path, PULLED, {f"mechanical.elastic.{k}": v for k, v in elastic.items()})
        return told.models["mechanical"]["pairs"]["joint"].get("augmented")

    assert augmented() is not None
    assert augmented(dynamics={}) is not None
    assert augmented(dynamics={}, method="explicit") is None


def test_a_scene_with_a_tied_pair_says_so_to_halves_by_its_version(tmp_path: Path) -> None:
    import h5py

    for tied, version in ((True, 4), (False, 3)):
        scenario = load_text(tmp_path, PULLED, {"contact.joint.tied": tied})
        scenario.write_half("mechanical", tmp_path / str(tied))
        with h5py.File(tmp_path / str(tied) / "interface.h5") as f:
            assert f.attrs["version"] == version
            assert ("tied" in f.attrs["pairs"]) is tied


def test_a_body_tied_to_a_held_one_is_held(tmp_path: Path) -> None:
    assert load_text(tmp_path, PULLED, {"mechanical.elastic.boundary": [{"on": "lower.bottom", "u_x": 0, "u_y": 0}]})
    with pytest.raises(ScenarioError, match="nothing will ever hold body 'upper'"):
        load_text(tmp_path, PULLED, {"mechanical.elastic.boundary": [{"on": "lower.bottom", "u_x": 0, "u_y": 0}],
                                     "contact.joint.tied": False})


@pytest.mark.slow
def test_a_run_that_starts_from_one_with_ties_goes_on(tmp_path: Path) -> None:
    """Pulled by the first run, held by the second: the pull stays, though the ties' tractions are found anew."""
    solved(tmp_path)
    kept = {"on": "upper.top", "t_y": 1.0e8}
    results = solved(tmp_path, name="then", bodies__lower__u0={"from": "run.h5"}, bodies__upper__u0={"from": "run.h5"},
                     mechanical__elastic__boundary=[{"on": "lower.bottom", "u_y": 0}, {"on": "lower.left", "u_x": 0},
                                                    {"on": "upper.left", "u_x": 0}, kept])
    for when in (0, -1):
        assert float(results.probe("p")[1][when]) == pytest.approx(-1.0e8, rel=1e-3)
