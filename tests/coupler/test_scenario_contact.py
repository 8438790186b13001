"""Contact in a scenario: what interface.h5 and model.json become, and what is refused where."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from contact.half.interface import Pair, read_interface
from contact.half.register import register_message
from contact.messages import Facing, Project, Registered
from contact.service import ContactService
from coupler.errors import ScenarioError
from coupler.scenario import Scenario
from mechanical_fmu.problem import parse_elastic
from thermal_fmu.half import ThermalHalf

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, line_of, load_text

FACE = "contact.face"
M = 2.0e11 * 0.7 / (1.3 * 0.4)
PENALTY = M / (0.5 + 0.5)  # two cells in a row, 0.5 m deep both
PLAIN = Pair("face", "upper.bottom", "lower.top", 0.1, PENALTY, local=True)
NEW_KEYS = ("friction", "two_pass", "form", "augmented")


def scene_of(folder: Path, **keys: Any) -> Scenario:
    """The good scenario with keys of its pair set."""
    return load_text(folder, GOOD, {f"{FACE}.{key}": value for key, value in keys.items()})


def the_pair(scenario: Scenario) -> Pair:
    (pair,) = scenario.interface.pairs
    # The penalty is a quotient of two measured lengths.
    return replace(pair, eps_N=PENALTY if pair.eps_N == pytest.approx(PENALTY, rel=1e-12) else pair.eps_N)


@pytest.mark.parametrize(("keys", "changes"), [
    ({}, {}),
    ({"friction": {"mu": 0.3}}, {"mu": 0.3}),
    ({"friction": {"mu": 0.3, "stick": "auto"}}, {"mu": 0.3}),
    ({"friction": {"mu": 0.3, "stick": 1.0e12}}, {"mu": 0.3, "eps_T": 1.0e12}),
    ({"friction": {"share": 0.4}}, {}),
    ({"two_pass": True}, {"two_pass": True}),
    ({"form": "edges"}, {}),
    ({"form": "nodes"}, {"by_node": True}),
    ({"augmented": {}}, {}),
    ({"penalty": 1.0e13, "two_pass": True, "form": "nodes"}, {"eps_N": 1.0e13, "two_pass": True, "by_node": True}),
])
def test_the_pair_of_interface_h5(keys: Mapping[str, Any], changes: Mapping[str, Any], tmp_path: Path) -> None:
    scenario = scene_of(tmp_path, **keys)
    expected = replace(PLAIN, local="penalty" not in keys, **changes)
    assert the_pair(scenario) == expected
    scenario.write_half("mechanical", tmp_path / "half")
    assert read_interface(tmp_path / "half" / "interface.h5").pairs == scenario.interface.pairs


def test_model_json_says_what_the_interface_does_not(tmp_path: Path) -> None:
    """The tolerance of augmentation belongs to the elastic half, the share of friction heat to the thermal one."""
    plain = scene_of(tmp_path).models
    assert plain["mechanical"]["pairs"] == {"face": {"augmented": {"tolerance": 1e-3, "method": "semi_smooth"}}}
    assert scene_of(tmp_path, augmented=None).models["mechanical"]["pairs"] == {"face": {}}
    assert "friction" not in plain["thermal"]["pairs"]["face"]
    full = scene_of(tmp_path, friction={"mu": 0.2, "share": 0.25}, augmented={"tolerance": 1e-5})
    both = {"tolerance": 1e-5, "method": "semi_smooth"}
    assert full.models["mechanical"]["pairs"] == {"face": {"augmented": both}}
    assert full.models["thermal"]["pairs"]["face"]["friction"]["share"] == 0.25
    rounds = scene_of(tmp_path, augmented={"method": "uzawa"})
    assert rounds.models["mechanical"]["pairs"] == {"face": {"augmented": {"tolerance": 1e-3, "method": "uzawa"}}}
    assert parse_elastic(rounds.interface, rounds.models["mechanical"]).enforcement == "uzawa"
    # What a scenario writes, the halves take.
    assert parse_elastic(full.interface, full.models["mechanical"]).augmented == {"face": 1e-5}
    assert parse_elastic(full.interface, full.models["mechanical"]).enforcement == "semi_smooth"
    assert ThermalHalf(full.interface, full.models["thermal"]).variables
    # Numbers that do not change in time make no kinks.
    assert full.coupling.kinks == scene_of(tmp_path).coupling.kinks


def test_two_passes_are_registered_with_half_the_weight(tmp_path: Path) -> None:
    passes = register_message(scene_of(tmp_path, two_pass=True, friction={"mu": 0.3, "stick": 5e11}).interface).passes
    assert passes.weight.tolist() == [0.5, 0.5]
    assert passes.slave.tolist() == passes.master[::-1].tolist() == [0, 1]
    assert passes.mu.tolist() == [0.3, 0.3]
    assert passes.eps_T.tolist() == [5e11, 5e11]


def test_the_rigid_half_takes_what_has_no_force(tmp_path: Path) -> None:
    rigid = {"mechanical.half": "rigid", f"{FACE}.friction": {"mu": 0.0, "share": 0.5}, f"{FACE}.form": "nodes",
             f"{FACE}.two_pass": True}
    scenario = load_text(tmp_path, GOOD, rigid)
    assert the_pair(scenario) == replace(PLAIN, two_pass=True, by_node=True)
    assert set(scenario.models["mechanical"]["pressure"]) == {"face"}


# keys of the pair, where the error is, words that the message or its remedy must hold
WRONG = {
    "a negative mu": ({"friction": {"mu": -0.1}}, "friction.mu", "not be negative"),
    "mu as text": ({"friction": {"mu": "dry"}}, "friction.mu", "number"),
    "friction as a number": ({"friction": 0.3}, "friction", "mapping"),
    "friction of nothing": ({"friction": {}}, "friction", "mu: 0.3"),
    "sticking alone": ({"friction": {"stick": 1.0e12}}, "friction", "mu: 0.3"),
    "sticking without friction": ({"friction": {"mu": 0, "stick": 1.0e12}}, "friction.stick", "without friction"),
    "sticking of no stiffness": ({"friction": {"mu": 0.1, "stick": 0}}, "friction.stick", "greater than zero"),
    "more than all of the heat": ({"friction": {"mu": 0.1, "share": 1.5}}, "friction.share", "between 0 and 1"),
    "a negative share": ({"friction": {"mu": 0.1, "share": -0.1}}, "friction.share", "between 0 and 1"),
    "the key of before": ({"friction_share": 0.4}, "friction_share", "Did you mean 'friction'"),
    "a tolerance of nothing": ({"augmented": {"tolerance": 0}}, "augmented.tolerance",
                               "between 1e-09 and 1, 1 excluded"),
    "a tolerance of round-off": ({"augmented": {"tolerance": 1e-12}}, "augmented.tolerance", "1e-09"),
    "a tolerance of everything": ({"augmented": {"tolerance": 1.0}}, "augmented.tolerance", "1 excluded"),
    "an unknown way to settle": ({"augmented": {"method": "semi-smooth"}}, "augmented.method", "semi_smooth"),
    "augmented as a word": ({"augmented": True}, "augmented", "mapping"),
    "a penalty of no stiffness": ({"penalty": 0}, "penalty", "greater than zero"),
    "a penalty as a word": ({"penalty": "atuo"}, "penalty", "number"),
    "an unknown form": ({"form": "node"}, "form", "Did you mean 'nodes'"),
    "two_pass as a number": ({"two_pass": 2}, "two_pass", "true"),
    "a surface twice from itself": ({"slave": "lower.top", "two_pass": True}, "two_pass", "in one pass"),
    "sides with a common node": ({"slave": "lower.left"}, "master", "both its slave and its master"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_contact_is_named(case: str, tmp_path: Path) -> None:
    keys, where, words = WRONG[case]
    with pytest.raises(ScenarioError) as caught:
        scene_of(tmp_path, **keys)
    assert caught.value.key == f"{FACE}.{where}"
    assert words in f"{caught.value.message} {caught.value.remedy}"


def test_pairs_that_settle_in_different_ways_are_named(tmp_path: Path) -> None:
    other = {"slave": "upper.right", "master": "lower.right", "gap_max": 0.1, "augmented": {"method": "uzawa"}}
    with pytest.raises(ScenarioError, match="semi_smooth in contact") as caught:
        load_text(tmp_path, GOOD, {f"{FACE}.augmented": {}, "contact.other": other})
    assert caught.value.key == "contact.other.augmented.method"


def test_explicit_steps_refuse_pressures_that_settle(tmp_path: Path) -> None:
    """They never did: contact pressed by its penalty alone, and nothing said so."""
    explicit = {"mechanical.elastic.method": "explicit"}
    with pytest.raises(ScenarioError, match="finds no equilibrium") as caught:
        load_text(tmp_path, GOOD, {f"{FACE}.augmented": {}, **explicit})
    assert caught.value.key == f"{FACE}.augmented"
    assert load_text(tmp_path, GOOD, explicit).interface.pairs


@pytest.mark.parametrize(("piece", "where"), [("    friction: {mu: 0.3}\n", "friction.mu"),
                                              ("    augmented: {tolerance: 1.0e-4}\n", "augmented")])
def test_the_rigid_half_refuses_what_it_would_ignore(piece: str, where: str, tmp_path: Path) -> None:
    """And says how to run the scene all the same: both words of the remedy do so."""
    text = GOOD.replace("    gap_max: 0.1\n", f"    gap_max: 0.1\n{piece}")
    load_text(tmp_path, text)
    with pytest.raises(ScenarioError, match="the half `rigid`") as caught:
        load_text(tmp_path, text, {"mechanical.half": "rigid"})
    assert caught.value.key == f"{FACE}.{where}"
    assert caught.value.line == line_of(piece.strip(), text)
    key = where.split(".", maxsplit=1)[0]
    assert f"{FACE}.{key}=null" in caught.value.remedy
    assert load_text(tmp_path, text, {"mechanical.half": "rigid", f"{FACE}.{key}": None}).interface.pairs


def test_a_surface_that_folds_onto_itself_is_slave_and_master(tmp_path: Path) -> None:
    """A slot .1 wide between two legs: its walls face each other, and each place counts once."""
    x, y = np.meshgrid(np.linspace(0, 2.1, 22), np.linspace(0, 1, 11), indexing="ij")
    n = np.arange(x.size).reshape(x.shape)
    quads = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], axis=-1)
    quads[10, 3:] = -1  # the slot
    quads = quads.reshape(-1, 4)
    quads = quads[quads[:, 0] >= 0]
    slot = np.concatenate([np.stack([n[10, 3:-1], n[10, 4:]], -1), np.stack([n[11, 3:-1], n[11, 4:]], -1),
                           [[n[10, 3], n[11, 3]]]])
    meshio.write(tmp_path / "fork.msh", meshio.Mesh(
        np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), [("quad", quads), ("line", slot)],
        cell_data={"gmsh:physical": [np.full(len(quads), 1), np.full(len(slot), 2)],
                   "gmsh:geometrical": [np.full(len(quads), 1), np.full(len(slot), 2)]},
        field_data={"all": np.array([1, 2]), "slot": np.array([2, 1])}), file_format="gmsh22")
    text = GOOD.replace("{rectangle: {origin: [0, 1], size: [2, 1], cells: [5, 2]}}", "{file: {path: fork.msh}}")
    text = text.replace("slave: upper.bottom\n    master: lower.top", "slave: upper.slot\n    master: upper.slot")
    text = text[: text.index("thermal:\n")] + """\
thermal: {half: thermal}
mechanical: {half: rigid}
coupling: {end: 1, windows: [{until: 1, size: 1}]}
"""
    scenario = load_text(tmp_path, text.replace("gap_max: 0.1", "gap_max: 0.15"))
    (pair,) = scenario.interface.pairs
    assert pair.slave == pair.master == "upper.slot"
    service = ContactService()
    known = service.handle(register_message(scenario.interface))
    assert isinstance(known, Registered)
    facing = service.handle(Project(known.surfaces, scenario.interface.nodes[scenario.interface.contact_nodes]))
    assert isinstance(facing, Facing)
    walls = facing.gap > 0.05
    assert facing.gap[walls] == pytest.approx(0.1)
    assert facing.area[walls].sum() == pytest.approx(0.7)
