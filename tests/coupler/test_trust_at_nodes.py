"""What is stated over place and read at nodes: a line of the trust table where a table bends between them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from pydantic import TypeAdapter

from contact.problem.curves import FieldSpec
from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.trust.in_space.at_nodes import NAME, checks

STEEL = {"rho": 7800.0, "c": 480.0, "k": 45.0}
SHARP = 1e-7


def strip(start: float, wide: float, axis: str = "x", over: float = 500.0) -> dict[str, Any]:
    """300 K, and `over` more on a strip, which begins and ends at once."""
    at = [start, start + SHARP, start + wide - SHARP, start + wide]
    return {"terms": [{"t": 300.0}, {"t": over, axis: {"at": at, "value": [0.0, 1.0, 1.0, 0.0]}}]}


def document(T0: Any, boundary: list[Any] | None = None, cells: tuple[int, int] = (10, 3),
             **mesh: Any) -> dict[str, Any]:
    """A plate of 100 by 30 mm."""
    plate = {"origin": [0, 0], "size": [0.1, 0.03], "cells": list(cells), **mesh}
    return {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL},
        "bodies": {"plate": {"mesh": {"rectangle": plate}, "material": "steel", "T0": T0}},
        "thermal": {"boundary": boundary or []}, "mechanical": {"half": "rigid", "rigid": {"motion": {}}},
        "coupling": {"end": 1.0, "windows": [{"until": 1.0, "size": 0.5}]}}


def row(tmp_path: Path, *args: Any, **more: Any) -> Any:
    scenario = scenario_from(json.dumps(document(*args, **more)), tmp_path / "s.yaml", {})
    found = checks(scenario.interface, scenario.models["thermal"], scenario.models["mechanical"])
    return found[0] if found else None


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("more", [{}, {"triangles": True}], ids=["quads", "triangles"])
def test_a_strip_between_two_rows_of_nodes_is_not_there(tmp_path, axis, more):
    found = row(tmp_path, strip(0.012, 0.005, axis), **more)
    assert found.verdict is TrustVerdict.BROKEN
    assert found.number == pytest.approx(1.0, abs=1e-9)
    assert "T0 of plate bends between nodes, which read 100 % less of it" in found.sentence


@pytest.mark.parametrize("more", [{}, {"triangles": True}], ids=["quads", "triangles"])
def test_one_about_a_row_of_nodes_is_as_wide_as_the_cells(tmp_path, more):
    """5 mm about the nodes at 10 mm: nodes read a tent of 20 mm, which holds twice as much."""
    found = row(tmp_path, strip(0.0075, 0.005), **more)
    assert found.number == pytest.approx(1.0, rel=0.1 if more else 0.02)
    assert "% more" in found.sentence


@pytest.mark.parametrize(("cells", "verdict"), [(10, TrustVerdict.NOTED), (2, TrustVerdict.BROKEN)])
def test_half_a_body_that_is_hot_is_off_by_half_a_cell(tmp_path, cells, verdict):
    """Beside the row of nodes at its middle: half a cell of ten of five, of two of one."""
    found = row(tmp_path, strip(-1.0, 1.05 + SHARP), cells=(cells, 1))
    assert found.verdict is verdict
    assert found.number == pytest.approx(0.5 / (cells / 2), rel=0.02)


def test_where_nodes_are_at_its_bends_nothing_is_said(tmp_path):
    bends = {"at": [0.0, 0.03, 0.05, 0.1], "value": [0.0, 1.0, 0.5, 0.0]}
    assert row(tmp_path, {"terms": [{"t": 300.0}, {"t": 50.0, "x": bends}]}) is None
    assert row(tmp_path, {"terms": [{"t": 300.0}, {"t": 50.0, "x": {"polynomial": [0.0, 1.0]}}]}) is None
    assert row(tmp_path, 300.0) is None
    assert row(tmp_path, strip(5.0, 1.0)) is None


def test_a_gentle_table_holds(tmp_path):
    """A tent whose top lies between nodes."""
    tent = {"at": [-0.1, 0.055, 0.2], "value": [0.0, 1.0, 0.0]}
    assert row(tmp_path, {"terms": [{"t": 300.0}, {"t": 50.0, "x": tent}]}).verdict is TrustVerdict.HOLDS


@pytest.mark.parametrize("more", [{}, {"triangles": True}], ids=["quads", "triangles"])
@pytest.mark.parametrize(("n", "verdict"), [(2, TrustVerdict.NOTED), (3, TrustVerdict.NOTED), (8, TrustVerdict.HOLDS)])
def test_a_parabola_is_read_by_its_chords(tmp_path, n, verdict, more):
    """300 K and 500 (x/L)^2: n chords hold 1/(6 n^2) of 500 too much, of 500/3 that are stated: 1/(2 n^2)."""
    found = row(tmp_path, {"terms": [{"t": 300.0}, {"t": 500.0, "x": {"polynomial": [0.0, 0.0, 100.0]}}]},
                cells=(n, 1), **more)
    assert found.number == pytest.approx(0.5 / n**2, rel=0.08)
    assert found.verdict is verdict
    if verdict is TrustVerdict.NOTED:
        assert found.sentence.endswith("Use smaller cells there")


def test_a_line_has_no_row(tmp_path):
    assert row(tmp_path, {"terms": [{"t": 300.0}, {"t": 500.0, "x": {"polynomial": [0.0, 10.0, 0.0]}}]}) is None


def test_a_prescribed_temperature_too_and_the_run_ends_so(tmp_path):
    """A hot strip on an edge that no node lies in: nothing is warmed, and the run is not to be trusted."""
    out = tmp_path / "run.h5"
    held = [{"on": "plate.bottom", "temperature": strip(0.012, 0.005)}]
    run(scenario_from(json.dumps(document(300.0, held)), tmp_path / "s.yaml", {}), out)
    (found,) = [check for check in Results(out).trust if check.name == NAME]
    assert found.verdict is TrustVerdict.BROKEN
    assert "the temperature of plate.bottom" in found.sentence


def test_a_prescribed_displacement_too(tmp_path):
    """A dent of 5 mm, pressed into an edge with nodes at every 10 mm, between two of them."""
    doc = document(300.0)
    doc["materials"]["steel"] |= {"E": 2.0e11, "nu": 0.3, "alpha": 0.0, "T_ref": 300.0}
    at = {"at": [0.012, 0.0145, 0.017], "value": [0.0, -1.0e-5, 0.0]}
    doc["mechanical"] = {"half": "elastic", "elastic": {"boundary": [
        {"on": "plate.bottom", "u_x": 0.0, "u_y": 0.0}, {"on": "plate.top", "u_y": {"terms": [{"x": at}]}}]}}
    scenario = scenario_from(json.dumps(doc), tmp_path / "s.yaml", {})
    (found,) = checks(scenario.interface, scenario.models["thermal"], scenario.models["mechanical"])
    assert found.verdict is TrustVerdict.BROKEN
    assert "u_y of plate.top bends between nodes, which read 100 % less of it" in found.sentence


def test_what_is_cold_is_missed_as_what_is_hot(tmp_path):
    hot, cold = (row(tmp_path, strip(0.012, 0.005, over=over)) for over in (100.0, -100.0))
    assert hot.number == pytest.approx(cold.number)
    assert "less of it" in cold.sentence


def fit(spec: Any, two_pass: bool = False, cells: tuple[int, int] = (10, 7)) -> Any:
    """Two plates on each other, the upper one with nodes at every 10 mm, the lower one with others."""
    doc = document(300.0)
    upper = {"origin": [0, 0.03], "size": [0.1, 0.03], "cells": [cells[0], 3]}
    lower = {"origin": [0, 0], "size": [0.1, 0.03], "cells": [cells[1], 3]}
    doc["bodies"] = {name: {"mesh": {"rectangle": mesh}, "material": "steel", "T0": 300.0}
                     for name, mesh in (("upper", upper), ("lower", lower))}
    doc["contact"] = {"face": {"slave": "upper.bottom", "master": "lower.top", "gap_max": 0.01, "two_pass": two_pass,
                               **spec}}
    return doc


@pytest.mark.parametrize("key", ["clearance", "interference"])
def test_a_fit_too_and_the_run_ends_so(tmp_path, key):
    """A groove of 5 mm between two nodes of the slave: contact knows nothing of it."""
    groove = {"terms": [{"t": 1.0e-4, "x": {"at": [0.012, 0.0145, 0.017], "value": [0.0, 1.0, 0.0]}}]}
    out = tmp_path / "run.h5"
    run(scenario_from(json.dumps(fit({key: groove})), tmp_path / "s.yaml", {}), out)
    (found,) = [check for check in Results(out).trust if check.name == NAME]
    assert found.verdict is TrustVerdict.BROKEN
    assert "the fit of pair face bends between nodes, which read 100 % less of it" in found.sentence


def test_a_fit_is_read_by_the_side_that_is_searched_from(tmp_path):
    """A tent between nodes of the slave; those of the master, which meet its foot, count where it is searched from."""
    tent = {"terms": [{"x": {"at": [0.01, 0.02, 0.03], "value": [0.0, 1.0e-4, 0.0]}}]}
    numbers = []
    for two_pass in (False, True):
        scenario = scenario_from(json.dumps(fit({}, two_pass)), tmp_path / "s.yaml", {})
        found = checks(scenario.interface, {}, {}, {"face": field_spec(tent)})
        numbers.append(found[0].number if found else None)
    assert numbers[0] is None
    assert numbers[1] is not None


def field_spec(spec: Any) -> Any:
    return TypeAdapter(FieldSpec).validate_python(spec)


def half_hot(tmp_path: Path, start: float, r: float = 0.0, geometry: str = "plane",
             quads_and_triangles: bool = False) -> float:
    """A plate of 100 mm from x = r on, hot from `start` on, between its nodes at every 10 mm."""
    doc = document(strip(start, 5.0), cells=(10, 1), origin=[r, 0])
    doc["geometry"] = geometry
    if quads_and_triangles:
        path = tmp_path / "mixed.msh"
        meshio.write(path, mixed(), file_format="gmsh22", binary=False)
        doc["bodies"]["plate"]["mesh"] = {"file": {"path": str(path)}}
    scenario = scenario_from(json.dumps(doc), tmp_path / "s.yaml", {})
    (found,) = checks(scenario.interface, scenario.models["thermal"], scenario.models["mechanical"])
    return float(found.number)


def mixed() -> meshio.Mesh:
    """The plate of 100 by 30 mm in ten columns: quads to the left, pairs of triangles from 50 mm on."""
    nodes = [[0.01 * k, y, 0.0] for y in (0.0, 0.03) for k in range(11)]
    corners = [[k, k + 1, k + 12, k + 11] for k in range(10)]
    cut = [t for a, b, c, d in corners[5:] for t in ([a, b, c], [a, c, d])]
    return meshio.Mesh(np.array(nodes), [("quad", np.array(corners[:5])), ("triangle", np.array(cut))])


def test_cells_of_a_body_are_judged_together(tmp_path):
    """Hot from 46 mm on: half a cell of 5.4 cells of ten, whether those from 50 mm on are quads or triangles."""
    quads, both = (half_hot(tmp_path, 0.046, quads_and_triangles=mixed) for mixed in (False, True))
    assert both == pytest.approx(quads, rel=1e-3)


@pytest.mark.parametrize("start", [0.01625, 0.09625])
def test_a_ring_counts_with_its_radius(tmp_path, start):
    """Cells of 10 mm: nodes read a slope from 10 to 20 mm, or from 90 to 100, where the table jumps within them."""
    number = half_hot(tmp_path, start, geometry="axisymmetric")
    a, b = start - 0.00625, start + 0.00375
    # Of r dr: what the slope holds beside the jump, over what is stated above the least or below the largest.
    slope = (2.0 * b + a) * (b - a) / 6.0
    jump = 0.5 * (b * b - start * start)
    hot = 0.5 * (0.1 * 0.1 - start * start)
    assert number == pytest.approx(abs(slope - jump) / min(hot, 0.5 * 0.1 * 0.1 - hot), rel=0.02)
