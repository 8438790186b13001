"""A thermal half on a mesh of its own: the run of that mesh, heat that adds up, and what is told where it cannot be."""

from __future__ import annotations

import importlib
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface
from coupler import HalfError, Results, ScenarioError, load_scenario
from coupler.fmu.half import Block
from coupler.report.verdict import Bound, verdict
from coupler.running.resume import resume
from coupler.scenario.mesh_maps import mesh_maps
from coupler.scenario.own_mesh import OwnMesh
from coupler.schemes.mapped import MappedHalf
from coupler.trust.checks import broken
from coupler.trust.in_space import carried

sys.path.insert(0, str(Path(__file__).parent))
from fake_halves import Bytes, FakeHalf
from killed_runs import differences
from mesh_scenes import as_bodies, block_meshes, box, rings
from several_scenes import BLOCKS, SCENARIOS, THREE, apart, blocks, ran

pytestmark = pytest.mark.usefixtures("unlooked")

SHORT = {"coupling.end": 60, "coupling.windows": [{"until": 60, "size": 4}], "output.checkpoint": 0}
SCENE = block_meshes((3, 4), (4, 4), (5, 4))
OTHER = block_meshes((6, 5), (8, 7), (10, 6))  # its surfaces have the nodes of SCENE among theirs
CLOSE = 1e-12


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return blocks(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def other(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Bodies on SCENE, their heat on OTHER."""
    return ran(file, tmp_path_factory.mktemp("other") / "run.h5", SHORT | {"thermal.meshes": OTHER, "probes": {
        "upper.T": {"T": "upper.bottom.left"}, "off.T": {"thermal.mesh.T_off": "value"},
        "off.x": {"thermal.mesh.x_off": "value"}}})


# Laws.

@pytest.mark.slow
def test_like_meshes_are_one_run_to_the_bit(file: Path, tmp_path: Path) -> None:
    one, same = (ran(file, tmp_path / f"{name}.h5", SHORT | changes) for name, changes in (
        ("one", {}), ("same", {"thermal.meshes": SCENE})))
    assert max(apart(one, same).values()) == 0.0
    assert one.field("thermal.T")[1].max() > 900.0


def test_it_is_the_run_of_that_mesh(file: Path, tmp_path: Path, other: Results) -> None:
    """Rigid bodies under an even pressure: what they are meshed with shows in nothing but their heat."""
    whole = ran(file, tmp_path / "whole.h5", SHORT | as_bodies(OTHER) | {"probes": {"upper.T": {
        "T": "upper.bottom.left"}}})
    assert np.abs(other.probe("upper.T")[1] - whole.probe("upper.T")[1]).max() < 1e-9 * 1000.0
    largest = max(abs(J) for J in whole.ledger.values())
    assert max(abs(other.ledger[n] - J) for n, J in whole.ledger.items()) < 1e-9 * largest
    assert whole.ledger["contact.master"] > 1e5
    assert other.heat_imbalance < CLOSE


@pytest.mark.slow
def test_around_an_axis_it_is_the_run_of_that_mesh(file: Path, tmp_path: Path) -> None:
    """Discs in place of blocks: what is exchanged goes by areas of the whole turn."""
    about, probe = SHORT | {"geometry": "axisymmetric"}, {"probes": {"upper.T": {"T": "upper.bottom.left"}}}
    other = ran(file, tmp_path / "other.h5", about | probe | {"thermal.meshes": OTHER})
    whole = ran(file, tmp_path / "whole.h5", about | probe | as_bodies(OTHER))
    assert np.abs(other.probe("upper.T")[1] - whole.probe("upper.T")[1]).max() < 1e-9 * 1000.0
    largest = max(abs(J) for J in whole.ledger.values())
    assert max(abs(other.ledger[n] - J) for n, J in whole.ledger.items()) < 1e-9 * largest
    assert np.ptp(whole.probe("upper.T")[1]) > 10.0
    assert other.heat_imbalance < CLOSE


@pytest.mark.slow
def test_all_friction_heat_and_all_plastic_work_arrive(tmp_path: Path) -> None:
    """A block that yields and rubs on cells of its own size, its heat on others: what was made is what came."""
    text = (SCENARIOS / "rubbing_block.yaml").read_text()
    text = text.replace("  steel: {rho: 7800, c: 480, k: 45, E: 2.1e11, nu: 0.3, alpha: 0}",
                        "  steel: {rho: 7800, c: 480, k: 45, E: 2.1e11, nu: 0.3, alpha: 0, plastic: {s_y: 2.0e+6, "
                        "chi: 0.9}}")
    (tmp_path / "rub.yaml").write_text(text)
    changes: dict[str, Any] = {
        "coupling": {"end": 3, "scheme": "staggered", "windows": [{"until": 3, "size": 0.25}]},
        "bodies.bar.mesh.rectangle.cells": [12, 2], "bodies.block.mesh.rectangle.cells": [5, 3],
        "output.fields": {"every": 1}}
    meshes = {"bar": box((0, 0), (0.12, 0.02), (31, 5), triangles=True),
              "block": box((0.02, 0.02), (0.04, 0.02), (13, 4), grading=[1, 3])}
    one, own = (ran(tmp_path / "rub.yaml", tmp_path / f"{name}.h5", changes | more) for name, more in (
        ("one", {}), ("own", {"thermal.meshes": meshes})))
    friction = [r.ledger["friction.slave"] + r.ledger["friction.master"] for r in (one, own)]
    assert friction[0] > 100.0
    assert friction[1] == pytest.approx(friction[0], rel=CLOSE)
    assert one.ledger["mechanical"] > 0.1
    assert own.ledger["mechanical"] == pytest.approx(one.ledger["mechanical"], rel=CLOSE)
    assert own.heat_imbalance < CLOSE
    # The effusivities share it between the sides, whatever the meshes: 0.365 into the steel.
    assert own.ledger["friction.slave"] / friction[1] == pytest.approx(one.ledger["friction.slave"] / friction[0],
                                                                      rel=1e-3)


def turned_rings() -> tuple[MappedHalf, FakeHalf, Interface, Interface]:
    """A half on rings of 32 cells around, in a scene of rings of 24 and 40: both cut the circle elsewhere."""
    scene, own = rings({"shaft": 24, "hub": 40}), rings({"shaft": 32, "hub": 32}, layers=3)
    n, n_q, n_cells = len(own.nodes), len(own.pair_nodes), len(own.quads)
    takes = {"x": ((n, 2), "m", "nodes"), "E_M": ((n_cells,), "J", "cells"),
             "contact.t_N": ((n_q,), "Pa", "pair_nodes"), "contact.E_friction": ((n_q,), "J", "pair_nodes")}
    half = Bytes("thermal", {name: Block(name, shape, unit, "input", "Real", on=on)
                             for name, (shape, unit, on) in takes.items()},
                 lambda state, inputs, t, h: (state, {}), np.zeros(1))
    return MappedHalf(half, OwnMesh(own, mesh_maps(scene, own), ()), scene), half, scene, own


@pytest.mark.fast
def test_rings_that_turn_keep_their_shape() -> None:
    mapped, half, scene, own = turned_rings()
    c, s = np.cos(1.0), np.sin(1.0)
    turn = np.array([[c, s], [-s, c]])
    mapped.advance(0.0, 1.0, {"x": scene.nodes @ turn}, [])
    assert np.abs(half.inputs["x"] - own.nodes @ turn).max() < CLOSE


@pytest.mark.fast
def test_what_a_half_is_given_adds_up() -> None:
    """Joules in all, pressure within its bounds, each side of the pair for itself."""
    mapped, half, scene, own = turned_rings()
    rng = np.random.default_rng(1)
    given = {name: rng.random(mapped.blocks[name].shape) for name in ("E_M", "contact.E_friction", "contact.t_N")}
    assert given["E_M"].shape == (len(scene.quads),)
    mapped.advance(0.0, 1.0, given, [])
    for name in ("E_M", "contact.E_friction"):
        assert half.inputs[name].sum() == pytest.approx(given[name].sum(), rel=CLOSE)
    for one, other in zip(scene.pair_sides, own.pair_sides, strict=True):
        t_N = half.inputs["contact.t_N"][other.at]
        assert t_N.max() <= given["contact.t_N"][one.at].max()
        assert half.inputs["contact.E_friction"][other.at].sum() == pytest.approx(
            given["contact.E_friction"][one.at].sum(), rel=CLOSE)


@pytest.mark.fast
def test_going_back_takes_the_coordinates_along() -> None:
    """What is told of them is that of the state, also of one that was written down."""
    mapped, _, scene, _ = turned_rings()
    mapped.advance(0.0, 1.0, {"x": scene.nodes + 0.1 * np.sin(5.0 * scene.nodes)}, [])
    off, token = float(mapped.read(["mesh.x_off"])["mesh.x_off"]), mapped.save()
    assert off > 1e-3
    written = mapped.serialise(token)
    for again in (token, mapped.deserialise(written)):
        mapped.advance(1.0, 1.0, {"x": scene.nodes}, [])
        assert float(mapped.read(["mesh.x_off"])["mesh.x_off"]) < 1e-12
        mapped.restore(again)
        assert float(mapped.read(["mesh.x_off"])["mesh.x_off"]) == off
    with pytest.raises(HalfError, match="no state"):
        mapped.deserialise(written[8:])


@pytest.mark.fast
def test_what_the_scene_s_mesh_does_not_hold_is_told_and_breaks_nothing() -> None:
    log = carried.watched(carried.watched(carried.CarriedLog(), 5.0, 3.0), 4.0, 6.0)
    assert carried.checks(log, 100.0, own_mesh=False) == ()
    (noted,), (holds,) = (carried.checks(log, span, own_mesh=True) for span in (100.0, 1000.0))
    assert (noted.verdict.value, noted.number, noted.t, holds.verdict.value) == ("noted", 0.05, 3.0, "holds")
    assert "5 K, 5 % of their span, at t = 3 s" in noted.what
    assert not broken(carried.checks(log, 4.0, own_mesh=True))


@pytest.mark.slow
def test_heat_of_elastic_blocks_follows_the_finer_mesh(tmp_path: Path) -> None:
    """Sliding blocks to the end of pressing: finer heat on coarse bodies is nearer to all fine than all coarse is."""
    low, up = box((0, 0), (0.0762, 0.0762), (12, 12)), box((0, 0.127), (0.0762, 0.0762), (12, 12))
    coarse = {"coupling.end": 12500, "bodies.lower.mesh.rectangle.cells": [4, 4],
              "bodies.upper.mesh.rectangle.cells": [4, 4], "output.fields": {"every": 10},
              "coupling.windows": [{"until": 2500, "size": 500}, {"until": 10000, "first": 1000, "last": 20},
                                   {"until": 12500, "size": 250}]}
    fine = coarse | as_bodies({"lower": low, "upper": up})
    runs = {name: ran(SCENARIOS / "sliding_blocks.yaml", tmp_path / f"{name}.h5", changes) for name, changes in (
        ("coarse", coarse), ("own", coarse | {"thermal.meshes": {"lower": low, "upper": up}}), ("fine", fine))}
    T = {name: r.probe("lower.top.centre")[1] for name, r in runs.items()}
    by_mesh = np.abs(T["coarse"] - T["fine"]).max()
    assert by_mesh > 1.0
    assert np.abs(T["own"] - T["fine"]).max() < 0.05 * by_mesh
    # The scene is one, and on its mesh fields can be compared: within what coarse cells are off by.
    bounds = {"T": Bound(1.5 * by_mesh), "p": Bound(0.05, of_range=True), "u": Bound(1e-6), "gap": Bound(1e-6)}
    found = verdict(runs["own"], runs["coarse"], bounds)
    assert not found.changed
    assert not found.differs
    assert verdict(runs["own"], runs["coarse"], bounds | {"T": Bound(0.05 * by_mesh)}).differs
    assert runs["own"].heat_imbalance < 1e-9


# Machinery.

@pytest.mark.slow
def test_a_run_that_stopped_goes_on_to_the_same_bits(file: Path, tmp_path: Path, other: Results) -> None:
    from coupler.running.run import Run

    scenario = load_scenario(file, SHORT | {"thermal.meshes": OTHER, "probes": other.header["scenario"]["resolved"][
        "probes"]})
    with Run(scenario, tmp_path / "run.h5") as run:
        for _ in run.windows(until=28.0):
            pass
    resume(tmp_path / "run.h5")
    assert differences(tmp_path / "run.h5", other.path) == []


@pytest.mark.slow
def test_halves_in_processes_say_the_same(file: Path, tmp_path: Path, other: Results) -> None:
    there = ran(file, tmp_path / "run.h5", SHORT | {"thermal.meshes": OTHER}, processes=True)
    assert (there.field("thermal.T")[1] == other.field("thermal.T")[1]).all()


@pytest.mark.slow
def test_several_halves_have_shares_of_it(file: Path, tmp_path: Path, other: Results) -> None:
    several = ran(file, tmp_path / "run.h5", SHORT | {"thermal.meshes": OTHER, "thermal.halves": THREE})
    assert np.abs(several.field("thermal.T")[1] - other.field("thermal.T")[1]).max() < 1e-6


def test_the_trust_table_tells_what_the_other_mesh_does_not_hold(other: Results) -> None:
    (row,) = [c for c in other.trust if c.name == "temperatures carried to the scene's mesh"]
    worst = float(other.probe("off.T")[1].max())
    assert worst > 1.0
    assert f"{worst:.3g} K" in row.what
    assert row.verdict.value == "noted"
    assert other.probe("off.x")[1].max() < 1e-15
    assert any("mesh of its own, 191 nodes" in note for note in other.header["notes"])


@pytest.mark.slow
def test_another_package_s_half_has_one_without_knowing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scikit-fem half of docs/write_a_half.md, its forty lines unchanged, and ours: one answer."""
    page = (SCENARIOS.parent / "docs/write_a_half.md").read_text()
    for name, text in re.findall(r"<!-- file: (swap_halves/\S+) -->\n```\w+\n(.*?)```", page, re.S):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    info = tmp_path / "swap_halves-0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: swap-halves\nVersion: 0\n")
    (info / "entry_points.txt").write_text("[slideline.halves]\nskfem = swap_halves.skfem_build\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    importlib.invalidate_caches()
    # Square cells: on others our half integrates conduction elsewhere.
    changes = SHORT | {"thermal.meshes": block_meshes((5, 5), (8, 8), (10, 10))}
    # Its checks, which take ten times as long as the run, are those of test_plain_run.py and of the page.
    own, theirs = (ran(blocks(tmp_path), tmp_path / f"{kind}.h5", changes | {"thermal.half": kind}, verify="never")
                   for kind in ("thermal", "skfem"))
    assert np.abs(own.field("thermal.T")[1] - theirs.field("thermal.T")[1]).max() < 1e-6
    assert own.field("thermal.T")[1].max() > 900.0


def test_what_is_recorded_is_played_on_the_mesh_of_the_scene(file: Path, other: Results) -> None:
    again = load_scenario(file, SHORT | {"thermal.meshes": OTHER, "thermal.half": "replay",
                                         "thermal.replay": {"from": str(other.path)}})
    assert again.interface_of("thermal") is again.interface


# What is wrong.

def told(file: Path, meshes: Any, **changes: Any) -> list[ScenarioError]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file, {"thermal.meshes": meshes, **changes})
    return [caught.value, *caught.value.others]


@pytest.mark.fast
def test_a_body_that_is_not_there(file: Path) -> None:
    (error,) = told(file, {"uper": SCENE["upper"]})
    assert (error.key, error.message.split(" [")[0]) == ("thermal.meshes.uper", "there is no body 'uper'")
    assert "upper" in error.remedy


@pytest.mark.fast
def test_a_body_left_out_keeps_its_mesh(file: Path) -> None:
    scenario = load_scenario(file, {"thermal.meshes": {"upper": OTHER["upper"]}})
    assert len(scenario.interface_of("thermal").nodes) == 4 * 5 + 5 * 5 + 11 * 7
    assert scenario.own_meshes.keys() == {"thermal"}


@pytest.mark.fast
def test_a_mesh_that_covers_less_is_refused(file: Path) -> None:
    errors = told(file, {"upper": box((0.005, 0.022), (0.02, 0.019), (5, 4)),
                         "middle": box((0, 0), (0.019, 0.02), (4, 4))})
    assert {e.key for e in errors} == {"thermal.meshes.upper", "thermal.meshes.middle"}
    assert "body 'upper' has 0.00038 m2 in it and 0.0004 m2 in the scene" in str(errors)
    assert "surface 'middle.bottom' has 0.019 m in it" in str(errors)


@pytest.mark.fast
def test_a_mesh_in_another_place_is_refused(file: Path) -> None:
    error, *_ = told(file, {"upper": box((0.005, 0.024), (0.02, 0.02), (5, 4))})
    assert error.key == "thermal.meshes.upper"
    assert "has a node at" in error.message
    assert "0.002 m outside of the scene's" in error.message


SQUARE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "top"
1 2 "left"
2 3 "all"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 0.02 0 0
3 0.02 0.02 0
4 0 0.02 0
$EndNodes
$Elements
3
1 1 2 1 1 3 4
2 1 2 2 1 4 1
3 3 2 3 1 1 2 3 4
$EndElements
"""


@pytest.mark.fast
def test_a_surface_that_is_missing(file: Path) -> None:
    (file.parent / "square.msh").write_text(SQUARE)
    (error,) = told(file, {"middle": {"file": {"path": "square.msh"}}})
    assert error.key == "thermal.meshes.middle"
    assert "has no 'bottom', which contact.gas names" in error.message


@pytest.mark.fast
def test_a_file_that_is_not_there(file: Path) -> None:
    (error,) = told(file, {"middle": {"file": {"path": "none.msh"}}})
    assert error.key == "thermal.meshes.middle.file.path"
    assert "with the thermal half's own mesh: body 'middle': there is no file" in error.message


@pytest.mark.fast
def test_another_mesh_file_is_another_scenario(file: Path) -> None:
    full = SQUARE.replace("3\n1 1 \"top\"", "4\n1 1 \"top\"\n1 4 \"bottom\"").replace(
        "$Elements\n3\n", "$Elements\n4\n").replace("3 3 2 3", "4 1 2 4 1 1 2\n3 3 2 3")
    hashes = []
    for text in (full, full.replace("0.02 0.02 0", "0.0200001 0.02 0")):
        (file.parent / "own.msh").write_text(text)
        hashes.append(load_scenario(file, {"thermal.meshes": {"middle": {"file": {"path": "own.msh"}}}}).hash)
    assert hashes[0] != hashes[1]


assert "upper" in BLOCKS
