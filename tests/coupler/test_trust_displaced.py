"""What the mesh of mechanics puts a displacement off by is told of its probe, and changes no run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from coupler import Results, load_scenario, run
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.in_space.displaced import NAME, DisplacedLog, Seen, checks

# Pulled with 100 MPa and pushed aside with 0.02: next to none of its energy is of bending.
BAR = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  m: {{rho: 7800, k: 40, c: 480, E: 2.0e11, nu: 0.3, alpha: 0}}
bodies:
  bar: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.5, 0.02], cells: [{n}, {m}]}}}}, material: m, T0: 300}}
thermal: {{}}
mechanical:
  half: elastic
  elastic:
    element: {element}
    boundary:
      - {{on: bar.left, u_x: 0, u_y: 0}}
      - {{on: bar.right, t_x: {{t: [0, 1], value: [0, 1.0e8]}}, t_y: {{t: [0, 1], value: [0, 2.0e4]}}}}
coupling: {{end: 1}}
probes:
  aside: {{u_y: bar.right.centre}}
  long: {{u_x: {{mean: bar.right}}}}
  T: {{T: bar.right.centre}}
"""


def bar(folder: Path, n: int, m: int, element: str = "mean_dilatation", **change: Any) -> Results:
    file = folder / "bar.yaml"
    file.write_text(BAR.format(n=n, m=m, element=element), encoding="utf-8")
    return run(load_scenario(file, change), out=folder / f"{n}{element}.h5")


def row(results: Results) -> Check | None:
    return {check.name: check for check in results.trust}.get(NAME)


def test_a_deflection_that_falls_short_is_told_though_next_to_no_energy_is_missed(tmp_path: Path) -> None:
    """15 % short of it, and every other row in order: the one on the energy of stress reads 0.025, 0.06 %."""
    coarse, fine = bar(tmp_path, 20, 2), bar(tmp_path, 120, 6, "enhanced")
    short = 1.0 - coarse.probe("aside")[1][-1] / fine.probe("aside")[1][-1]
    found = row(coarse)
    assert found is not None
    assert short == pytest.approx(0.152, abs=0.01)
    assert found.number == pytest.approx(short, rel=0.1)
    assert found.what.startswith("probe aside tells")
    assert {c.name for c in coarse.trust if c.verdict in (TrustVerdict.NOTED, TrustVerdict.BROKEN)} == {NAME}
    told = coarse.probe_errors["aside"]
    assert told.mesh == pytest.approx(found.number * told.range)
    assert coarse.probe_errors["long"].mesh < 0.01 * coarse.probe_errors["long"].range
    assert coarse.probe_errors["T"].mesh == 0.0
    right = row(fine)
    assert right is not None
    assert right.verdict is TrustVerdict.HOLDS


def test_a_run_is_the_same_whether_it_is_asked_or_not(tmp_path: Path) -> None:
    asked = bar(tmp_path, 10, 2)
    alone = bar(tmp_path, 10, 2, **{"probes.aside": {"mechanical.iterations": "value"},
                                    "probes.long": {"T": "bar.left.centre"}})
    assert row(alone) is None
    assert (asked.fields("u")[1] == alone.fields("u")[1]).all()
    assert not [name for name in asked.field_files if "u_off" in name]


def test_of_a_single_row_of_quads_it_is_not_checked(tmp_path: Path) -> None:
    found = row(bar(tmp_path, 20, 1))
    assert found is not None
    assert found.verdict is TrustVerdict.UNCHECKED
    assert "two rows or more" in found.what


@pytest.mark.parametrize(("off", "verdict"), [(4e-4, TrustVerdict.HOLDS), (6e-4, TrustVerdict.NOTED),
                                              (3e-3, TrustVerdict.BROKEN)])
def test_verdicts(off: float, verdict: TrustVerdict) -> None:
    """Against the range over the run, which looks may not have met."""
    by_rounding = Seen(0.0, 1e-12, 1e-12, 1e-12, 1.0, 0.0, 3)
    log = DisplacedLog({"a": Seen(0.0, 5e-3, -off, 5e-3, 1.0, 0.0, 3), "b": by_rounding}, 3)
    (found,) = checks(log, {"a": 1e-2}, 1e-10)
    assert found.verdict is verdict
    assert found.number == pytest.approx(off / 1e-2)
    # What is 0 by symmetry harms nobody.
    assert "b by" not in found.what
    assert checks(log, {"a": 1e-2}, 0.0)[0].number > 0.9


def test_where_little_moves_it_is_held_against_how_far_the_body_goes() -> None:
    """The far corner of a block that is pressed in its middle goes 0.6 um, 39 % wrong, and its middle 0.4 mm."""
    (found,) = checks(DisplacedLog({"a": Seen(0.0, 6e-7, 2.5e-7, 6e-7, 1.0, 4e-4, 3)}, 3), {}, 1e-12)
    assert found.number == pytest.approx(2.5e-7 / 4e-5)
    assert found.verdict is TrustVerdict.HOLDS
    (found,) = checks(DisplacedLog({"a": Seen(0.0, 6e-7, 2.5e-7, 6e-7, 1.0, 1e-5, 3)}, 3), {}, 1e-12)
    assert "a tenth of how far its body went" in found.what


def test_what_does_not_move_is_held_against_where_it_is(tmp_path: Path) -> None:
    """A load that is there from the start, in equilibrium: the deflection has no range, and is 15 % short."""
    loads = {"mechanical.elastic.boundary.1.t_x": 1e8, "mechanical.elastic.boundary.1.t_y": 2e4,
             "mechanical.elastic.start": "equilibrium"}
    found = row(bar(tmp_path, 20, 2, **loads))
    assert found is not None
    assert found.number == pytest.approx(0.152, abs=0.01)


def test_where_no_look_told_anything_that_is_said() -> None:
    (found,) = checks(DisplacedLog({"a": Seen(0.0, 1.0)}, 3), {}, 0.0)
    assert found.verdict is TrustVerdict.UNCHECKED
    assert not checks(DisplacedLog(), {}, 0.0)
