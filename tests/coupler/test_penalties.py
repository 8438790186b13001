"""The penalty a pair has that states none, and that contact is augmented unless a scene says otherwise."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface
from contact.half.outlines import cell_sizes
from coupler.scenario.penalties import MOST
from mechanical_fmu.problem import parse_elastic

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text

pytestmark = pytest.mark.usefixtures("unlooked")

SOFT = ("  soft: {rho: 1, c: 1, k: 1, E: {T: [0, 200], value: [2.0e9, 1.0e9]}, nu: 0.3, alpha: 0}\n"
        "bodies:\n")


def soft_above(nu: float = 0.3) -> str:
    """The good scenario with a soft upper block, of E = 1.5e9 Pa at its T0 of 100 degC."""
    text = GOOD.replace("bodies:\n", SOFT.replace("nu: 0.3", f"nu: {nu}"))
    return text.replace("cells: [5, 2]}}\n    material: steel", "cells: [5, 2]}}\n    material: soft")


def modulus(E: float, nu: float) -> float:
    return E * min((1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu)), MOST)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4999])
def test_it_is_that_of_the_two_cells_in_a_row(nu: float, tmp_path: Path) -> None:
    """Cells are 0.5 m deep; their edges of 0.4 and 0.5 m are no longer."""
    pair = load_text(tmp_path, soft_above(nu)).interface.pairs[0]
    assert pair.local
    assert pair.eps_N == pytest.approx(1.0 / (0.5 / modulus(1.5e9, nu) + 0.5 / modulus(2e11, 0.3)), rel=1e-12)
    stated = load_text(tmp_path, GOOD, {"contact.face.penalty": 7e12}).interface.pairs[0]
    assert (stated.eps_N, stated.local) == (7e12, False)


def test_a_graded_mesh_has_a_stiffness_for_each_edge(tmp_path: Path) -> None:
    """Deep cells count by their depth, flat ones by their edge."""
    graded = {"rectangle": {"origin": [0, 1], "size": [2, 1], "cells": [5, 2], "grading": [4, 1]}}
    interface = load_text(tmp_path, GOOD, {"bodies.upper.mesh": graded}).interface
    ends = interface.nodes[interface.surfaces["upper.bottom"]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert length.max() > 0.5 > length.min()
    np.testing.assert_allclose(interface.stiffness["upper.bottom"], modulus(2e11, 0.3) / np.maximum(length, 0.5),
                               rtol=1e-12)


def test_a_triangle_is_as_deep_as_it_is_high() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 3.0]])
    none = np.empty(0, np.int32)
    one = Interface("plane", nodes, np.empty((0, 4), np.int32), np.array([[0, 1, 2]], np.int32), none,
                    np.zeros(1, np.int32), ("a",), ("m",), {})
    np.testing.assert_allclose(cell_sizes(one, np.array([[0, 1]], np.int32)), [3.0])


@pytest.mark.parametrize(("keys", "expected"), [
    ({}, "semi_smooth"),
    ({"contact.face.augmented": None}, "penalty"),
    ({"contact.face.augmented": {"method": "uzawa"}}, "uzawa"),
    ({"mechanical.elastic.dynamics": {}}, "penalty"),
    ({"mechanical.elastic.dynamics": {}, "contact.face.augmented": {}}, "semi_smooth"),
])
def test_contact_is_augmented_unless_a_scene_says_otherwise(keys: dict[str, Any], expected: str,
                                                            tmp_path: Path) -> None:
    scenario = load_text(tmp_path, GOOD, keys)
    assert parse_elastic(scenario.interface, scenario.models["mechanical"]).enforcement == expected


def test_a_pair_that_says_nothing_settles_as_the_others_do(tmp_path: Path) -> None:
    other = {"slave": "upper.right", "master": "lower.right", "gap_max": 0.1, "augmented": {"method": "uzawa"}}
    scenario = load_text(tmp_path, GOOD, {"contact.other": other})
    spec = parse_elastic(scenario.interface, scenario.models["mechanical"])
    assert spec.enforcement == "uzawa"
    assert set(spec.augmented) == {"face", "other"}
