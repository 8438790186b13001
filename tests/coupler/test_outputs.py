"""Outputs of halves that the coupler has never heard of: recorded, shown and probed by what their description says."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from coupler.errors import ResultsError, ScenarioError
from coupler.fmu.half import Block
from coupler.fmu.outputs import On, component_of, names_of, output_fields, place_of, unclear
from coupler.record.observe import ProbeReader
from coupler.record.recorder import Recorder
from coupler.record.results import Results
from coupler.record.vtkhdf import FieldReader
from coupler.scenario import Scenario, load_scenario
from coupler.schemes.levels import Level

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from fake_halves import FakeHalf
from toy_halves import HALVES, environment

SCENE = """
slideline: 2
title: A half of a third party
units: {temperature: K}
geometry: plane
materials: {steel: {rho: 7800, c: 480, k: 45}}
bodies:
  low: {mesh: {rectangle: {origin: [0, 0], size: [0.3, 0.1], cells: [3, 2]}}, material: steel, T0: 300}
  high: {mesh: {rectangle: {origin: [0, 0.1], size: [0.3, 0.2], cells: [2, 3]}}, material: steel, T0: 300}
contact:
  pair: {slave: high.bottom, master: low.top, gap_max: 0.01, conduction: {closed: {law: constant, h: 2000}, open: null}}
thermal: {half: flux}
mechanical: {half: rigid, rigid: {pressure: {pair: 1.0e6}}}
coupling: {scheme: staggered, end: 4, windows: [{until: 4, size: 1}]}
output: {fields: {every: 2}}
probes:
  flux: {thermal.q_node.y: {max: low}}
  flux.there: {"thermal.q_node[1]": {at: [0.1, 0.05], body: low}}
  damage: {thermal.damage: {mean: high}}
  damage.below: {thermal.damage: {max: high.bottom}}
  wear: {thermal.contact.wear: high.bottom.left}
  lost: {thermal.lost: {mean: high}}
  thrust: {thermal.thrust.y: value}
  clock: {thermal.clock: value}
  warm: {T: {mean: high}}
"""
T = np.array([0.0, 2.0, 4.0])


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    """Without the half: a scenario is checked before it is known what its halves give out."""
    file = tmp_path_factory.mktemp("scene") / "scene.yaml"
    file.write_text(SCENE.replace("half: flux", "half: thermal"))
    return load_scenario(file)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A run of the half by the command line, as its owner would do it, with its report; it is not checked first."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "scene.yaml").write_text(SCENE)
    command = [sys.executable, "-P", "-m", "coupler.cli", "run", "scene.yaml", "--report", "--no-verify"]
    done = subprocess.run(command, cwd=folder, env=environment(SLIDELINE_CACHE=str(folder / "cache")), text=True,
                          capture_output=True, timeout=240, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return Results(folder / "run.h5")


@pytest.fixture(scope="module")
def model():
    """The module of the half, for its formulas."""
    spec = importlib.util.spec_from_file_location("flux_model", HALVES / "flux_half/model.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their own module up
    spec.loader.exec_module(module)
    return module


def test_what_is_recorded_is_what_the_description_says(run: Results) -> None:
    found = {name: (f.on.value, f.unit, f.components, f.description) for name, f in run.fields.items()}
    assert found["thermal.q_node"] == ("nodes", "W/m2", 2, "heat flux at nodes")
    assert found["thermal.damage"] == ("cells", "1", 1, "damage of cells")
    assert found["thermal.contact.wear"] == ("pair_nodes", "m", 1, "depth worn off")
    assert found["thermal.stretch"][:3] == ("nodes", "1", 4)
    assert found["thermal.lost"][:2] == ("bodies", "J")
    assert found["thermal.thrust"][:2] == ("none", "N")
    assert found["mechanical.u"][:3] == ("nodes", "m", 2)
    assert not [note for note in run.notes if "rows" in note]


def test_run_h5_has_every_array_of_the_half_at_the_frames(run: Results, scenario: Scenario, model) -> None:
    i = scenario.interface
    t, q = run.field("thermal.q_node")
    assert t.tolist() == T.tolist()
    assert np.array_equal(q, [model.flux(i.nodes, at) for at in T])
    assert np.array_equal(run.field("thermal.stretch")[1], [model.stretch(i.nodes, at) for at in T])
    assert np.array_equal(run.field("thermal.damage")[1], T[:, None] * np.arange(12))
    worn = run.field("thermal.contact.wear")[1]
    assert np.array_equal(worn[:, i.contact_nodes], [model.wear(i.nodes[i.contact_nodes], at) for at in T])
    assert np.isnan(np.delete(worn, i.contact_nodes, axis=1)).all()
    assert np.array_equal(run.field("thermal.lost")[1], T[:, None] * [1.0, 2.0])
    assert np.array_equal(run.field("thermal.thrust")[1], T[:, None] * [1.0, -2.0])
    assert run.field("mechanical.u")[1].shape == (3, len(i.nodes), 2)
    with h5py.File(run.path) as f:
        assert f["fields/thermal/thrust"].attrs["unit"] == "N"
        assert f["fields/thermal/q_node"].shape == (3 * len(i.nodes), 3), "the field file is reached from run.h5"
    with pytest.raises(ResultsError, match=r"no field 'thermal.q_nod'; did you mean 'thermal.q_node'"):
        run.field("thermal.q_nod")


def test_paraview_reads_them(run: Results, scenario: Scenario, model) -> None:
    vtk_io = pytest.importorskip("vtkmodules.vtkIOHDF", reason="VTK is not installed")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    i = scenario.interface
    reader = vtk_io.vtkHDFReader()
    reader.SetFileName(str(run.field_files["thermal"]))
    for at in T:
        reader.UpdateInformation()
        reader.UpdateTimeStep(at)
        grid = reader.GetOutput()
        point, cell = grid.GetPointData(), grid.GetCellData()
        assert np.array_equal(vtk_to_numpy(point.GetArray("q_node"))[:, :2], model.flux(i.nodes, at))
        tensor = model.stretch(i.nodes, at)
        assert np.array_equal(vtk_to_numpy(point.GetArray("stretch"))[:, :4], tensor[:, [0, 1, 3, 2]])
        assert np.array_equal(vtk_to_numpy(cell.GetArray("damage")), at * np.arange(12))
        worn = vtk_to_numpy(point.GetArray("contact.wear"))
        assert np.array_equal(worn[i.contact_nodes], model.wear(i.nodes[i.contact_nodes], at))
        assert np.isnan(np.delete(worn, i.contact_nodes)).all()
    with FieldReader(run.field_files["thermal"]) as file:
        assert set(file.point_fields) == {"T", "q_node", "stretch", "contact.wear"}
        assert set(file.cell_fields) == {"body", "damage"}


def test_the_report_has_a_picture_of_each_field(run: Results) -> None:
    page = run.path.with_suffix(".html").read_text(encoding="utf-8")
    assert "Heat flux at nodes" in page
    assert "Damage of cells" in page
    assert "thermal.q_node.y" in page, "a curve of its probe"


def test_probes_are_read_from_any_output(run: Results, scenario: Scenario) -> None:
    i = scenario.interface
    middles = i.nodes[i.quads].mean(axis=1)
    assert np.flatnonzero((i.quad_body == 1) & (middles[:, 1] < 0.17)).tolist() == [6, 9], "the cells at high.bottom"
    t = np.arange(5.0)
    expected = {
        "flux": 3.0 * (1 + t), "flux.there": 0.05 * (1 + t), "damage": t * np.arange(6, 12).mean(),
        "damage.below": t * 9.0, "wear": 1e-6 * t, "lost": 2.0 * t, "thrust": -2.0 * t, "clock": t, "warm": 300 + t}
    for name, values in expected.items():
        assert run.probe(name)[1] == pytest.approx(values, rel=1e-12), name
    assert [run.unit(n) for n in ("flux", "damage", "wear", "thrust", "clock")] == ["W/m2", "1", "m", "N", "s"]
    assert run.quantity("flux") == "thermal.q_node.y"


# Probes against the description of a half, before the first window.

def flux_like(scenario: Scenario, *blocks: Block) -> FakeHalf:
    n = len(scenario.interface.nodes)
    own = (Block("T", (n,), "K", "output", "Real"), Block("q_node", (n, 2), "W/m2", "output", "Real"),
           Block("wear", (len(scenario.interface.contact_nodes),), "m", "output", "Real"),
           Block("thrust", (5,), "N", "output", "Real"))
    return FakeHalf("flux", {b.name: b for b in (*own, *blocks)}, None, np.zeros(1))


@pytest.mark.parametrize(("probe", "match"), [
    ("{thermal.q_nod.x: {max: low}}", r"probes.it.thermal.q_nod.x: the thermal half gives out no q_nod.x.*q_node.x"),
    ("{thermal.q_node: {max: low}}", r"gives out no q_node.*q_node.x"),
    ("{'thermal.q_node[3]': {max: low}}", r"gives out no q_node\[3\]"),
    ("{thermal.thrust.x: value}", "gives out no thrust.x"),
    ("{'thermal.thrust[2]': {max: low}}", "belongs to no place of the mesh.*Write `value`"),
    ("{thermal.T: value}", "this output has a place"),
    ("{thermal.wear: {max: low}}", "exists only on contact surfaces.*high.bottom, low.top")])
def test_a_probe_of_what_a_half_does_not_have(probe: str, match: str, tmp_path: Path) -> None:
    text = SCENE.replace("half: flux", "half: thermal")
    (tmp_path / "s.yaml").write_text(text[: text.index("probes:")] + f"probes: {{it: {probe}}}\n")
    scenario = load_scenario(tmp_path / "s.yaml")
    halves = {"thermal": flux_like(scenario), "mechanical": FakeHalf("m", {}, None, np.zeros(1))}
    with pytest.raises(ScenarioError, match=match):
        ProbeReader(scenario.probes, scenario.interface, halves, scenario.file)


def test_a_misspelt_quantity_is_still_refused_when_the_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SCENE.replace("half: flux", "half: thermal").replace("{T: {mean", "{t: {mean"))
    with pytest.raises(ScenarioError, match=r"probes.warm.t: unknown key.*Known here: T, f_s, gap"):
        load_scenario(tmp_path / "s.yaml")


def test_a_probe_of_a_quantity_and_of_an_output_is_one_too_many(tmp_path: Path) -> None:
    two = "{T: {mean: high}, thermal.clock: value}"
    (tmp_path / "s.yaml").write_text(SCENE.replace("half: flux", "half: thermal").replace("{T: {mean: high}}", two))
    with pytest.raises(ScenarioError, match=r"exactly one .* is needed, not T and thermal.clock"):
        load_scenario(tmp_path / "s.yaml")


def test_halves_are_asked_for_nothing_beside_what_probes_need(scenario: Scenario) -> None:
    """Reading at every window costs: without probes of outputs nothing is read, with some nothing else."""
    asked: list[list[str]] = []

    class Watching(FakeHalf):
        def read(self, names, finite=True):
            asked.append(list(names))
            return {n: np.zeros(self.blocks[n].shape) for n in names}

    i = scenario.interface
    level = Level(0.0, np.zeros(len(i.nodes)), i.nodes, *(np.zeros(len(i.pair_nodes)) for _ in range(3)))
    half = flux_like(scenario)
    half = Watching("flux", half.blocks, None, np.zeros(1))
    warm = {"warm": scenario.probes["warm"]}
    halves = {"thermal": half, "mechanical": FakeHalf("m", {}, None, np.zeros(1))}
    ProbeReader(warm, i, halves).values(level)
    assert asked == []
    ProbeReader({**warm, "a": scenario.probes["flux"], "b": scenario.probes["flux.there"]}, i, halves).values(level)
    assert asked == [["q_node"]]


# What an array is on.

def ring(n: int) -> Interface:
    """A ring of n quads cut in two: 2 n nodes, 2 n triangles."""
    angle = 2 * np.pi * np.arange(n) / n
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    a, b = np.arange(n), (np.arange(n) + 1) % n
    cells = np.concatenate([np.column_stack([a, a + n, b + n]), np.column_stack([a, b + n, b])]).astype(np.int32)
    return Interface("plane", np.concatenate([circle, 2 * circle]), np.empty((0, 4), np.int32), cells,
                     np.empty(0, np.int32), np.zeros(2 * n, np.int32), ("ring",), ("steel",),
                     {"in": np.column_stack([b, a]).astype(np.int32),
                      "out": np.column_stack([a + n, b + n]).astype(np.int32)}, {},
                     (Pair("pair", "in", "out", 0.1, 1e12),))


def output(name: str, *shape: int, on: str = "") -> Block:
    return Block(name, shape, "1", "output", "Real", "", on)


def test_as_many_nodes_as_cells_are_not_confused() -> None:
    """All nodes of the ring are contact nodes too: three places with 16 rows."""
    i = ring(8)
    assert len(i.nodes) == len(i.triangles) == len(i.contact_nodes) == 16
    assert place_of(output("a", 16), i) is On.NOTHING
    assert place_of(output("contact.a", 16), i) is On.PAIR_NODES
    assert place_of(output("surface.a", 16), i) is On.CONTACT_NODES
    assert place_of(output("contact.a", 16, on="cells"), i) is On.CELLS
    assert place_of(output("a", 16, 2, on="nodes"), i) is On.NODES
    assert place_of(output("a", 15, on="nodes"), i) is On.NOTHING, "a half that is wrong about its own mesh"
    fields = output_fields("thermal", {b.name: b for b in (output("a", 16), output("b", 16, on="none"))}, i, (), ())
    assert [f.on for f in fields] == [On.NOTHING, On.NOTHING]
    (note,) = unclear("thermal", fields, i)
    assert "thermal.a has 16 rows, as many as there are nodes and cells and contact nodes" in note


def test_names_the_coupler_has_itself_are_kept_apart() -> None:
    i = ring(8)
    blocks = {n: output(n, 16, on="nodes") for n in ("T", "gap", "heat/flux")}
    labels = {f.name: f.label for f in output_fields("mechanical", blocks, i, (), ("T",))}
    assert labels == {"T": "mechanical.T", "gap": "mechanical.gap", "heat/flux": "heat_flux"}
    assert [f.exchanged for f in output_fields("mechanical", blocks, i, (), ("T",))] == [True, False, False]


def test_components_by_letter_and_by_number() -> None:
    columns = {"q": 2, "sigma": 4, "T": 1, "a.b": 5}
    assert component_of("T", columns) == ("T", 0)
    assert component_of("q.y", columns) == ("q", 1)
    assert [component_of(f"sigma.{c}", columns) for c in ("xx", "yy", "xy", "zz")] == [("sigma", k) for k in range(4)]
    assert component_of("sigma[3]", columns) == component_of("sigma.xy", columns)
    assert component_of("a.b[5]", columns) == ("a.b", 4)
    for wrong in ("q", "q.z", "q[0]", "q[3]", "a.b", "a.b.x", "T.x", "nothing"):
        assert component_of(wrong, columns) is None, wrong
    assert all(component_of(name, columns) for name in names_of(columns))


def test_two_halves_may_have_outputs_of_one_name(tmp_path: Path) -> None:
    i = ring(8)
    fields = [f for half in ("thermal", "mechanical")
              for f in output_fields(half, {"own": output("own", 16, on="cells")}, i, (), ())]
    level = Level(0.0, np.zeros(16), i.nodes, *(np.zeros(16) for _ in range(3)))
    header = {"scenario": {"text": ""}, "pairs": [], "probes": {}, "outputs": [f.to_json() for f in fields],
              "fields": {"thermal": {"point": ["T"], "cell": ["own"]}, "mechanical": {"point": ["u"], "cell": ["own"]}}}
    recorder = Recorder(tmp_path / "run.h5", header, i)
    recorder.start(level, np.zeros(0))
    recorder.frame(level, {"thermal/own": np.arange(16.0), "mechanical/own": -np.arange(16.0)})
    recorder.end("completed", "", {})
    run = Results(tmp_path / "run.h5")
    assert np.array_equal(run.field("thermal.own")[1], [np.arange(16.0)])
    assert np.array_equal(run.field("mechanical.own")[1], [-np.arange(16.0)])
