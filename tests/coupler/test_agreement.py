"""A half that computes another scene than the one it stands in is found by what Slideline's own half says of it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from coupler import load_scenario
from coupler.errors import HalfError
from coupler.fmu.half import Half
from coupler.scenario import Scenario
from coupler.verify.agreement import agrees
from coupler.verify.bench import Bench, Declared, settled
from coupler.verify.border import CheckVerdict
from coupler.verify.needs import unmet
from coupler.verify.physics import AGREES
from coupler.verify.verdicts import border_of
from mechanical_fmu.elastic_half import load as load_elastic
from thermal_fmu import ThermalVolume, VolumeMaterial, VolumeMesh, thermal_half
from thermal_fmu.half import load as load_thermal

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import install_mine
from model_half import ModelHalf
from wrong_laws import FAULTS, SCENES, Deaf, Wrong, model_of

LOADS = {"thermal": load_thermal, "mechanical": load_elastic}


@cache
def scene_of(name: str) -> Scenario:
    with TemporaryDirectory() as folder:
        (Path(folder) / "s.yaml").write_text(SCENES[name])
        return load_scenario(Path(folder) / "s.yaml")


def own(role: str, scene: str) -> Callable[[], Half]:
    scenario = scene_of(scene)
    return lambda: ModelHalf(LOADS[role](scenario.interface, scenario.models[role]))


def bench_of(wrong: Wrong) -> Bench:
    scenario = scene_of(wrong.scene)
    model = LOADS[wrong.role](wrong.built(scenario.interface), model_of(wrong, scenario.models))
    return settled(lambda: Deaf(ModelHalf(model), wrong.hears), 1.0, border_of(scenario, wrong.role),
                   reference=own(wrong.role, wrong.scene))


@pytest.mark.few(
    "thermal: latent heat left out", "thermal: the gap taken as half as wide", "thermal: pressure not heard",
    "thermal: mechanical heat not heard", "mechanical: stiffness a third too large",
    "mechanical: temperatures not heard", "mechanical: no turn around the axis")
@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_law_is_named(name: str) -> None:
    finding = agrees(bench_of(FAULTS[name]), AGREES)
    assert finding.verdict is CheckVerdict.FAIL
    assert FAULTS[name].says in finding.reason


@pytest.mark.few("thermal-pressed", "mechanical-blocks")
@pytest.mark.parametrize(("role", "scene"), [
    ("thermal", "apart"), ("thermal", "pressed"), ("thermal", "round"), ("mechanical", "blocks"),
    ("mechanical", "round blocks")])
def test_the_half_itself_passes(role: str, scene: str) -> None:
    assert agrees(bench_of(Wrong(role, scene)), AGREES).verdict is CheckVerdict.PASS


@pytest.mark.few("backward_euler")
@pytest.mark.parametrize("method", ["midpoint", "backward_euler"])
def test_another_method_in_time_passes(method: str) -> None:
    """Ten times as wrong as the own half's, and it says so itself: by its substeps in two halves."""
    wrong = Wrong("thermal", "apart", told=lambda model: model.update(method=method))
    assert agrees(bench_of(wrong), AGREES).verdict is CheckVerdict.PASS


class Triangles(ThermalVolume):
    """Heat conduction in triangles: each quad is two of them, so nodes hold other shares of the heat."""

    def start(self, mesh: VolumeMesh, materials: tuple[VolumeMaterial, ...]) -> None:
        q = mesh.quads
        self.cells = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])
        part = np.tile(mesh.quad_part, 2)
        self.k, self.c = (np.array(v)[part] for v in ([m.k.constant for m in materials],
                                                      [m.rho * m.c.constant for m in materials]))

    def matrices(self, x: np.ndarray, T: np.ndarray) -> tuple[np.ndarray, csr_matrix, None]:
        a, b, c = (x[self.cells[:, k]] for k in range(3))
        area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        g = np.stack([b - c, c - a, a - b], axis=1)  # edges, which are the gradients turned by a right angle
        K = np.einsum("eik,ejk->eij", g, g) * (self.k / (4.0 * area))[:, None, None]
        rows, columns = np.repeat(self.cells, 3, axis=1), np.tile(self.cells, 3)
        n = len(x)
        C = np.bincount(self.cells.ravel(), weights=np.repeat(self.c * area / 3.0, 3), minlength=n)
        return C, csr_matrix((K.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)), None


@pytest.mark.few("pressed")
@pytest.mark.parametrize("scene", ["apart", "pressed"])
def test_other_elements_pass(scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_mine(monkeypatch)
    (tmp_path / "s.yaml").write_text(SCENES[scene])
    scenario = load_scenario(tmp_path / "s.yaml", overrides={"thermal.half": "mine"})
    model = thermal_half(Triangles(), scenario.interface, scenario.models["thermal"])
    bench = settled(lambda: ModelHalf(model), 1.0, border_of(scenario, "thermal"), reference=own("thermal", scene))
    assert agrees(bench, AGREES).verdict is CheckVerdict.PASS


@pytest.mark.slow
def test_cells_of_another_order_of_error_pass_and_a_coarse_mesh_says_less() -> None:
    """Enhanced cells bend as they should, on a mesh whose own cells miss some of the energy."""
    wrong = Wrong("mechanical", "blocks", told=lambda model: model.update(element="enhanced"))
    assert agrees(bench_of(wrong), AGREES).verdict is CheckVerdict.PASS


@pytest.mark.few("thermal: density left out")
@pytest.mark.parametrize("name", ["thermal: conductivity twice too large", "thermal: density left out",
                                  "thermal: the matrices of the first x"])
def test_temperatures_alone_say_it_too(name: str) -> None:
    """A half that states no heat."""
    bench = bench_of(FAULTS[name])
    mute = {n: b for n, b in bench.blocks.items() if not n.startswith("heat.")}
    finding = agrees(replace(bench, blocks=mute), AGREES)
    assert finding.verdict is CheckVerdict.FAIL
    assert "the temperature of body" in finding.reason


def test_a_half_that_is_not_compared_says_why() -> None:
    bench = bench_of(Wrong("thermal", "apart"))
    assert unmet(AGREES, bench) is None
    for none, why in ((replace(bench, reference=None, why_none="it is told to be alone"), "it is told to be alone"),
                      (replace(bench, declared=Declared(any_step=False)), "all its steps have one length")):
        row = unmet(AGREES, none)
        assert row is not None
        assert row.verdict is CheckVerdict.NOT_APPLICABLE
        assert why in row.reason


def test_an_own_half_that_fails_is_no_fault_of_the_other() -> None:
    def fails() -> Half:
        raise HalfError("no room")

    finding = agrees(replace(bench_of(Wrong("thermal", "apart")), reference=fails), AGREES)
    assert finding.verdict is CheckVerdict.NOT_APPLICABLE
    assert finding.reason == "Slideline's own half fails in this scene: no room"
