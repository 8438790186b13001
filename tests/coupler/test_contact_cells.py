"""Contact that conducts far better than the cells behind it, between nodes that do not face each other."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler.schemes.levels import Level
from coupler.trust.checks import Check
from coupler.trust.contact_cells import ContactCells, ContactCellsLog, check

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text

CELLS = 0.5 * 30.0 / 0.5  # W/m2K: two cells of half a metre in a row, k = 30 W/mK
H, MESH = "contact.face.conduction.closed.h", "bodies.{}.mesh.rectangle.{}"


def told(folder: Path, ratio: float = 1000.0, p: float = 1.0e7, **keys: Any) -> Check:
    """The check of one window of a pair that conducts `ratio` times what its cells do and is pressed by p."""
    scene = load_text(folder, GOOD, {H: ratio * CELLS, **keys})
    interface = scene.interface
    cells, n = ContactCells(interface, scene.models["thermal"]), len(interface.pair_nodes)
    now = Level(3.0, np.full(len(interface.nodes), 300.0), interface.nodes, np.full(n, -p), np.zeros(n), np.ones(n))
    return check(cells.watched(ContactCellsLog(), now), cells)


@pytest.mark.parametrize(("ratio", "verdict"), [(190.0, "holds"), (1000.0, "noted"), (1e6, "noted")])
def test_a_conductance_is_held_against_the_cells_that_meet(ratio: float, verdict: str, tmp_path: Path) -> None:
    found = told(tmp_path, ratio)
    assert found.verdict == verdict
    if verdict == "noted":
        assert found.number == pytest.approx(ratio, rel=1e-12)
        assert found.t == 3.0
        assert "pair face conducts" in found.sentence
        assert "form: nodes" in found.sentence


def test_either_side_counts(tmp_path: Path) -> None:
    """Cells of the slave or of the master of a quarter of the depth conduct 4 times as well: 1/(1 + 1/4) in a row."""
    for body, rows in (("upper", 8), ("lower", 8)):
        size = 0.4 if body == "upper" else 0.5  # the edge, where it is more than the depth
        of = {"upper": 0.5, "lower": 0.5, body: size}
        found = told(tmp_path, **{MESH.format(body, "cells"): [{"upper": 5, "lower": 4}[body], rows]})
        in_a_row = 30.0 / (of["upper"] + of["lower"])
        assert found.number == pytest.approx(1000.0 * CELLS / in_a_row, rel=1e-12)


@pytest.mark.parametrize("upper", [4, 8])
def test_nodes_that_face_nodes_hold_nothing(upper: int, tmp_path: Path) -> None:
    """Meshes that match, and one whose nodes include those of the other."""
    assert told(tmp_path, **{MESH.format("upper", "cells"): [upper, 2]}).verdict == "holds"


@pytest.mark.parametrize("keys", [{"p": 0.0}, {"ratio": 1.0}])
def test_what_is_not_pressed_or_conducts_little_holds_nothing(keys: dict[str, Any], tmp_path: Path) -> None:
    assert told(tmp_path, **keys).verdict == "holds"


def test_one_point_a_node_is_left_out(tmp_path: Path) -> None:
    assert told(tmp_path, **{"contact.face.form": "nodes"}).verdict == "not checked"


def test_what_moves_apart_is_told_no_more_but_stays_told(tmp_path: Path) -> None:
    """The worst window stays; the numbers go into a checkpoint as plain values."""
    scene = load_text(tmp_path, GOOD, {H: 1000.0 * CELLS})
    interface = scene.interface
    cells, n = ContactCells(interface, scene.models["thermal"]), len(interface.pair_nodes)
    pressed = Level(3.0, np.full(len(interface.nodes), 300.0), interface.nodes, np.full(n, -1.0e7), np.zeros(n),
                    np.ones(n))
    free = Level(4.0, pressed.T, pressed.x, np.zeros(n), np.ones(n), np.ones(n))
    log = cells.watched(cells.watched(ContactCellsLog(), pressed), free)
    assert asdict(log) == {"share": pytest.approx(1000.0), "pair": "face", "t": 3.0, "h": 1000.0 * CELLS}
