"""A mechanical half on a mesh of its own: the run of that mesh, totals that stay, and what is told where not."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface
from coupler import HalfError, Results, ScenarioError, load_scenario
from coupler.fmu.half import Block
from coupler.running.resume import resume
from coupler.scenario.mesh_maps import mesh_maps
from coupler.scenario.own_mesh import OwnMesh
from coupler.schemes.mapped import MappedHalf
from coupler.trust.checks import broken
from coupler.trust.in_space import carried

sys.path.insert(0, str(Path(__file__).parent))
from fake_halves import Bytes
from killed_runs import differences
from mesh_scenes import as_bodies, box, rectangles, rings
from several_scenes import SCENARIOS, apart, ran

pytestmark = pytest.mark.usefixtures("unlooked")

CLOSE = 1e-12
# A block that yields is pressed on a bar and dragged along it: forces, friction heat and plastic work.
RUB = {"coupling": {"end": 3, "scheme": "staggered", "windows": [{"until": 3, "size": 0.25}]},
       "bodies.bar.mesh.rectangle.cells": [12, 2], "bodies.block.mesh.rectangle.cells": [5, 3],
       "output.fields": {"every": 1}, "output.checkpoint": 0}
BAR, BLOCK = ((0, 0), (0.12, 0.02)), ((0.02, 0.02), (0.04, 0.02))
SCENE = {"bar": box(*BAR, (12, 2)), "block": box(*BLOCK, (5, 3))}
FINER = {"bar": box(*BAR, (24, 4)), "block": box(*BLOCK, (10, 6))}  # the nodes of SCENE are among its nodes
OTHER = {"bar": box(*BAR, (31, 5), triangles=True), "block": box(*BLOCK, (13, 4), grading=[1, 3])}


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    text = (SCENARIOS / "rubbing_block.yaml").read_text()
    old = "E: 2.1e11, nu: 0.3, alpha: 0}"
    assert old in text
    path = tmp_path_factory.mktemp("scene") / "rub.yaml"
    path.write_text(text.replace(old, "E: 2.1e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20, plastic: {s_y: 2.0e+6, chi: 0.9}}"
                                 ).replace("E: 7.0e10, nu: 0.3, alpha: 0}",
                                           "E: 7.0e10, nu: 0.3, alpha: 2.3e-5, T_ref: 20}"))
    return path


@pytest.fixture(scope="module")
def other(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Heat on SCENE, deformation on OTHER."""
    return ran(file, tmp_path_factory.mktemp("other") / "run.h5", RUB | {"mechanical.meshes": OTHER, "probes": {
        "block.u": {"u_x": {"mean": "block.bottom"}}, "off.x": {"mechanical.mesh.x_off": "value"},
        "off.T": {"mechanical.mesh.T_off": "value"}}})


# Laws.

@pytest.mark.slow
def test_like_meshes_are_one_run_to_the_bit(file: Path, tmp_path: Path) -> None:
    one, same = (ran(file, tmp_path / f"{name}.h5", RUB | changes) for name, changes in (
        ("one", {}), ("same", {"mechanical.meshes": SCENE, "thermal.meshes": SCENE})))
    assert max(apart(one, same).values()) == 0.0
    assert one.ledger["friction.slave"] > 10.0
    assert one.ledger["mechanical"] > 0.1


def test_it_is_the_run_of_that_mesh(file: Path, tmp_path: Path) -> None:
    """Bodies that do not expand with heat: what heat is meshed with shows nowhere in their deformation."""
    cold = RUB | {"coupling": {"end": 1.5, "scheme": "staggered", "windows": [{"until": 1.5, "size": 0.25}]}} | {
        f"materials.{m}.alpha": 0 for m in ("steel", "aluminium")} | {"probes": {
        "u": {"u_y": "block.bottom.left"}, "force": {"mechanical.reaction.bar.y": "value"}}}
    own = ran(file, tmp_path / "own.h5", cold | {"mechanical.meshes": FINER})
    whole = ran(file, tmp_path / "whole.h5", cold | as_bodies(FINER))
    coarse = ran(file, tmp_path / "coarse.h5", cold)
    for name in ("u", "force"):
        size = np.abs(whole.probe(name)[1]).max()
        assert np.abs(own.probe(name)[1] - whole.probe(name)[1]).max() < 1e-11 * size
        assert np.abs(coarse.probe(name)[1] - whole.probe(name)[1]).max() > 1e-4 * size
    made = [sum(r.totals["made"].values()) for r in (own, whole, coarse)]
    assert made[0] == pytest.approx(made[1], rel=1e-9)
    assert abs(made[2] - made[1]) > 1e-4 * made[1]


def test_all_friction_heat_and_all_plastic_work_arrive(other: Results) -> None:
    friction = other.ledger["friction.slave"] + other.ledger["friction.master"]
    made = {name: other.totals[f"{name}_heat"] for name in ("friction", "mechanical")}
    assert friction > 100.0
    assert friction == pytest.approx(made["friction"]["delivered"], rel=CLOSE)
    assert other.ledger["mechanical"] > 0.1
    assert other.ledger["mechanical"] == pytest.approx(made["mechanical"]["delivered"], rel=CLOSE)
    for heat in made.values():
        assert heat["made"] == pytest.approx(heat["delivered"] + heat["carried"], rel=CLOSE)
    assert other.heat_imbalance < CLOSE


def mapped_on(scene: Interface, own: Interface) -> tuple[MappedHalf, Bytes, dict[str, np.ndarray]]:
    """A half that gives out what stands in the dictionary, on a mesh of its own."""
    n, n_q, n_cells = len(own.nodes), len(own.pair_nodes), len(own.quads) + len(own.triangles)
    gives = {"x": ((n, 2), "m", "nodes"), "E_M": ((n_cells,), "J", "cells"), "sigma": ((n_cells, 4), "Pa", "cells"),
             "contact.t_N": ((n_q,), "Pa", "pair_nodes"), "contact.E_friction": ((n_q,), "J", "pair_nodes"),
             "contact.gap": ((n_q,), "m", "pair_nodes")}
    out = {name: np.zeros(shape) for name, (shape, *_) in gives.items()}
    half = Bytes("mechanical", {"T": Block("T", (n,), "K", "input", "Real", on="nodes")} | {
        name: Block(name, shape, unit, "output", "Real", on=on) for name, (shape, unit, on) in gives.items()},
        lambda state, inputs, t, h: (state, out), np.zeros(1))
    return MappedHalf(half, OwnMesh(own, mesh_maps(scene, own), ()), scene), half, out


MESHES = {
    "finer": (rectangles({"low": (5, 3), "up": (4, 3)}), rectangles({"low": (17, 7), "up": (9, 11)})),
    "coarser": (rectangles({"low": (17, 7), "up": (9, 11)}), rectangles({"low": (5, 3), "up": (4, 3)})),
    "triangles": (rectangles({"low": (5, 3), "up": (4, 3)}, grading=(3.0, 0.3)),
                  rectangles({"low": (7, 7), "up": (9, 5)}, triangles=("low",))),
    "axisymmetric": (rectangles({"low": (5, 3), "up": (4, 3)}, "axisymmetric"),
                     rectangles({"low": (7, 7), "up": (9, 5)}, "axisymmetric")),
    "rings": (rings({"shaft": 24, "hub": 40}), rings({"shaft": 32, "hub": 32}, layers=3)),
}


@pytest.mark.fast
@pytest.mark.parametrize("name", MESHES)
def test_what_a_half_gives_adds_up_and_keeps_its_shape(name: str) -> None:
    """Linear maps of x; joules of bodies and of each side of a pair; a uniform stress, and pressures in bounds."""
    scene, own = MESHES[name]
    mapped, _, out = mapped_on(scene, own)
    rng = np.random.default_rng(1)
    for key in ("E_M", "contact.E_friction", "contact.t_N"):
        out[key] = -rng.random(out[key].shape)
    turn = np.array([[0.3, 1.2], [-0.9, 0.5]])
    out["x"], out["sigma"] = own.nodes @ turn + 0.3, np.full(out["sigma"].shape, -7.0)
    found = mapped.advance(0.0, 1.0, {"T": np.full(len(scene.nodes), 300.0)}, list(out)).outputs
    assert {key: value.shape for key, value in found.items()} == {key: mapped.blocks[key].shape for key in out}
    assert np.abs(found["x"] - (scene.nodes @ turn + 0.3)).max() < 10.0 * CLOSE
    assert np.abs(found["sigma"] + 7.0).max() < 7.0 * CLOSE
    assert found["E_M"].sum() == pytest.approx(out["E_M"].sum(), rel=CLOSE)
    for one, of in zip(scene.pair_sides, own.pair_sides, strict=True):
        assert found["contact.E_friction"][one.at].sum() == pytest.approx(out["contact.E_friction"][of.at].sum(),
                                                                          rel=CLOSE)
        assert out["contact.t_N"][of.at].min() <= found["contact.t_N"][one.at].min()
        if name in ("finer", "coarser", "triangles"):
            assert force(found["contact.t_N"], scene, one) == pytest.approx(force(out["contact.t_N"], own, of),
                                                                            rel=CLOSE)


def force(t_N: np.ndarray, interface: Interface, side: Any) -> float:
    """Of a side, per metre of depth: each node has the halves of its edges."""
    edges = interface.surfaces[side.surface]
    length = np.linalg.norm(np.diff(interface.nodes[edges], axis=1)[:, 0], axis=1)
    of = np.searchsorted(side.nodes, edges)
    return float(sum(0.5 * length @ t_N[side.at][of[:, k]] for k in range(2)))


@pytest.mark.fast
@pytest.mark.parametrize("name", [n for n in MESHES if n != "rings"])
def test_temperatures_on_a_straight_line_arrive(name: str) -> None:
    scene, own = MESHES[name]
    mapped, half, _ = mapped_on(scene, own)
    mapped.advance(0.0, 1.0, {"T": 300.0 + scene.nodes @ [100.0, -70.0]}, [])
    assert np.abs(half.inputs["T"] - 300.0 - own.nodes @ [100.0, -70.0]).max() < CLOSE * 400.0


@pytest.mark.fast
def test_a_gap_beyond_the_end_is_no_part_of_those_before_it() -> None:
    """Some nodes of the half face nothing, which they say by gap_max: of it no mean is made."""
    scene, own = MESHES["finer"]
    mapped, _, out = mapped_on(scene, own)
    (far,) = {pair.gap_max for pair in own.pairs}
    out["contact.gap"] = np.full(len(own.pair_nodes), 2e-3)
    (side,) = [s for s in own.pair_sides if s.surface == "low.top"]
    out["contact.gap"][side.at] = np.where(own.nodes[side.nodes, 0] < 0.72, far, 3e-3)
    gap = mapped.advance(0.0, 1.0, {}, ["contact.gap"]).outputs["contact.gap"]
    (there,) = [s for s in scene.pair_sides if s.surface == "low.top"]
    assert np.ptp(np.delete(gap, np.arange(there.at.start, there.at.stop))) < 2e-3 * CLOSE
    assert set(np.round(gap[there.at], 12)) == {far, 3e-3}
    assert np.isclose(gap[there.at], far).sum() in (2, 3)


@pytest.mark.fast
def test_going_back_takes_the_temperatures_along() -> None:
    scene, own = MESHES["coarser"]
    mapped, _, _ = mapped_on(scene, own)
    mapped.advance(0.0, 1.0, {"T": 300.0 + 50.0 * np.sin(9.0 * scene.nodes[:, 0])}, [])
    off, token = float(mapped.read(["mesh.T_off"])["mesh.T_off"]), mapped.save()
    assert off > 1.0
    written = mapped.serialise(token)
    for again in (token, mapped.deserialise(written)):
        mapped.advance(1.0, 1.0, {"T": np.full(len(scene.nodes), 300.0)}, [])
        assert float(mapped.read(["mesh.T_off"])["mesh.T_off"]) < 1e-9
        mapped.restore(again)
        assert float(mapped.read(["mesh.T_off"])["mesh.T_off"]) == off
    with pytest.raises(HalfError, match="no state"):
        mapped.deserialise(written[8:])


@pytest.mark.fast
def test_what_the_scene_s_mesh_does_not_hold_of_shapes_is_told() -> None:
    log = carried.watched(carried.watched(carried.CarriedLog(), 5e-6, 3.0, 1e-4), 4e-6, 6.0, 5e-5)
    assert carried.shape_checks(log, own_mesh=False) == ()
    (noted,) = carried.shape_checks(log, own_mesh=True)
    assert (noted.verdict.value, noted.number, noted.t) == ("noted", pytest.approx(0.05), 3.0)
    assert "5e-06 m, 5 % of the largest inside a body, at t = 3 s" in noted.what
    assert not broken((noted,))


# Machinery.

def test_the_trust_table_and_the_notes_tell_of_it(other: Results) -> None:
    (row,) = [c for c in other.trust if c.name == "displacements carried to the scene's mesh"]
    worst = float(other.probe("off.x")[1].max())
    assert 0.0 < worst < 1e-4
    assert row.number > 0.0
    assert any("the mechanical half has a mesh of its own, 262 nodes" in note for note in other.header["notes"])


@pytest.mark.slow
def test_a_run_that_stopped_goes_on_to_the_same_bits(file: Path, tmp_path: Path, other: Results) -> None:
    from coupler.running.run import Run

    scenario = load_scenario(file, RUB | {"mechanical.meshes": OTHER, "probes": other.header["scenario"]["resolved"][
        "probes"]})
    with Run(scenario, tmp_path / "run.h5") as run:
        for _ in run.windows(until=1.5):
            pass
    resume(tmp_path / "run.h5")
    assert differences(tmp_path / "run.h5", other.path) == []


@pytest.mark.slow
def test_halves_in_processes_say_the_same(file: Path, tmp_path: Path, other: Results) -> None:
    there = ran(file, tmp_path / "run.h5", RUB | {"mechanical.meshes": OTHER}, processes=True)
    for name in ("thermal.T", "mechanical.u"):
        assert (there.field(name)[1] == other.field(name)[1]).all()


# What is wrong.

def told(file: Path, meshes: Any, **changes: Any) -> list[ScenarioError]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file, {"mechanical.meshes": meshes, **changes})
    return [caught.value, *caught.value.others]


@pytest.mark.fast
def test_each_mesh_belongs_to_its_role(file: Path) -> None:
    scenario = load_scenario(file, RUB | {"mechanical.meshes": {"bar": OTHER["bar"]}})
    assert scenario.own_meshes.keys() == {"mechanical"}
    assert scenario.interface_of("thermal") is scenario.interface
    assert len(scenario.interface_of("mechanical").nodes) == 32 * 6 + 6 * 4
    (error,) = told(file, {"baar": OTHER["bar"]})
    assert (error.key, error.message.split(" [")[0]) == ("mechanical.meshes.baar", "there is no body 'baar'")


@pytest.mark.fast
def test_a_mesh_that_covers_less_or_lies_elsewhere_is_refused(file: Path) -> None:
    errors = told(file, {"bar": box((0, 0), (0.1, 0.02), (12, 2))})
    assert {e.key for e in errors} == {"mechanical.meshes.bar"}
    errors = told(file, {"block": box((0.03, 0.02), (0.04, 0.02), (5, 3))})
    assert errors[0].key == "mechanical.meshes.block"
    assert "has a node at" in errors[0].message


def test_mechanics_of_another_run_are_refused(file: Path, tmp_path: Path, other: Results) -> None:
    """Neither to such a half, nor from one: what it remembers is on its own mesh."""
    short = RUB | {"coupling": {"end": 0.5, "scheme": "staggered", "windows": [{"until": 0.5, "size": 0.25}]}}
    plain = ran(file, tmp_path / "plain.h5", short)
    again = {"bodies.block.u0": {"from": str(plain.path)}}
    assert load_scenario(file, short | again).interface.start
    (error,) = told(file, {"bar": OTHER["bar"]}, **short, **again)
    assert (error.key, "starts from no other run" in error.message) == ("bodies.block.u0", True)
    with pytest.raises(ScenarioError, match="had a mesh of its own"):
        load_scenario(file, short | {"bodies.block.u0": {"from": str(other.path)}})
