"""One conforming mesh of several materials, starts and sources: exact where a wall or a strip has a closed form."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from contact.half.model import load_directory
from coupler import run
from coupler.errors import ScenarioError
from mechanical_fmu.elastic_half import load

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import BAR, STEEL, edited, linear, loaded, solved, temperatures

pytestmark = pytest.mark.usefixtures("unlooked")

HELD = {"half": "elastic", "elastic": {"boundary": [{"on": "bar.left", "u_x": 0}, {"at": "bar.left.bottom", "u_y": 0}]}}
LEFT, RIGHT = ({"origin": [x, 0.0], "size": [0.05, 0.02]} for x in (0.0, 0.05))
WALLS = [{"on": "bar.left", "temperature": 400.0}, {"on": "bar.right", "temperature": 300.0}]


def errors_of(folder: Path, doc: dict[str, Any]) -> dict[str, str]:
    with pytest.raises(ScenarioError) as told:
        loaded(folder, doc)
    return {e.key: str(e) for e in (told.value, *told.value.others)}


@pytest.mark.few("True-mechanics1")
@pytest.mark.parametrize(("triangles", "mechanics"), [(False, {}), (True, {"gravity": {"y": -9.81}})])
def test_regions_of_one_material_are_one_body(tmp_path, triangles, mechanics):
    """To round-off: the same sums in another order."""
    flows = {**STEEL, "E": {"polynomial": [2e11, -1e8], "T_ref": 300.0}, "k": {"polynomial": [40.0, 0.02]},
             "plastic": {"s_y": 1e8, "hardening": {"law": "linear", "H": 1e9}}}
    held = {"half": "elastic", "elastic": {"boundary": [{"on": "bar.left", "u_x": 0, "u_y": 0},
                                                        {"on": "bar.right", "u_x": 0}], **mechanics}}
    one = edited(BAR, materials__steel=flows, thermal__boundary=WALLS, mechanical=held, bodies__bar__Q_T=1e6,
                 bodies__bar__mesh__rectangle__triangles=triangles)
    same = {"left": {"rectangle": LEFT, "material": "twin"}, "spot": {"rectangle": {"origin": [0.06, 0.01],
                                                                                    "size": [0.02, 0.01]}}}
    two = edited(one, materials__twin=flows, bodies__bar__regions=same)
    a, b = solved(tmp_path, one, "one"), solved(tmp_path, two, "two")
    np.testing.assert_allclose(temperatures(b), temperatures(a), rtol=1e-12)
    u = a.field("mechanical.u")[1]
    np.testing.assert_allclose(b.field("mechanical.u")[1], u, rtol=0, atol=1e-9 * np.abs(u).max())
    flow = a.field("mechanical.sigma_v")[1]
    np.testing.assert_allclose(b.field("mechanical.sigma_v")[1], flow, rtol=0, atol=1e-7 * flow.max())
    for term, heat in a.ledger.items():
        assert b.ledger[term] == pytest.approx(heat, rel=1e-9, abs=1e-9 * a.ledger["source"])
    # The source of a body is that of its regions too.
    np.testing.assert_allclose(b.condition("heat.source.bar")[1], a.condition("heat.source.bar")[1], rtol=1e-9)
    if not mechanics:
        assert flow.max() > 1e8, "it must have flowed"


@pytest.mark.few("axisymmetric-k1", "plane-k0")
@pytest.mark.parametrize("k", [(40.0, 4.0), (400.0, 0.1)])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a_composite_wall_is_resistances_in_a_row(tmp_path, k, geometry):
    """Plane: q = dT / sum L_i/k_i, T linear in each layer, exact on any mesh; around an axis along z likewise."""
    doc = edited(BAR, thermal__boundary=WALLS, thermal__method="steady", geometry=geometry,
                 materials__steel__k=k[0], materials__felt={**STEEL, "k": k[1]},
                 bodies__bar__regions={"felt": {"rectangle": {"origin": [0.02, 0], "size": [0.03, 0.02]},
                                                "material": "felt"}})
    if geometry == "axisymmetric":  # the layers along z
        doc = edited(doc, bodies__bar__mesh__rectangle={"origin": [0.1, 0], "size": [0.02, 0.1], "cells": [2, 10]},
                     bodies__bar__regions__felt__rectangle={"origin": [0.1, 0.02], "size": [0.02, 0.03]},
                     thermal__boundary=[{"on": "bar.bottom", "temperature": 400.0},
                                        {"on": "bar.top", "temperature": 300.0}])
    results, nodes = solved(tmp_path, doc), loaded(tmp_path, doc).interface.nodes
    x = nodes[:, 1 if geometry == "axisymmetric" else 0]
    q = 100.0 / (0.07 / k[0] + 0.03 / k[1])
    exact = 400.0 - q * (np.minimum(x, 0.02) / k[0] + np.clip(x - 0.02, 0.0, 0.03) / k[1]
                         + np.clip(x - 0.05, 0.0, None) / k[0])
    np.testing.assert_allclose(temperatures(results)[-1], exact, rtol=0, atol=1e-9)
    area = np.pi * (0.12**2 - 0.1**2) if geometry == "axisymmetric" else 0.02
    assert results.ledger["temperature.in"] == pytest.approx(q * area * 20.0, rel=1e-10)


def test_sources_by_region_add_up(tmp_path):
    """The heat made is the sum of volume times source, a field and a factor of temperature among them."""
    doc = edited(BAR, bodies__bar__Q_T=1e5, bodies__bar__regions={
        "hot": {"rectangle": {"origin": [0.0, 0.0], "size": [0.02, 0.01]}, "Q_T": 4e6},
        "field": {"rectangle": {"origin": [0.04, 0.01], "size": [0.02, 0.01]},
                  "Q_T": {"terms": [{"t": 1e7, "x": {"polynomial": [0.0, 1.0]}}]}},
        "factor": {"rectangle": {"origin": [0.08, 0.0], "size": [0.02, 0.02]}, "Q_T": 2e6, "Q_T_factor": 0.5},
        "none": {"rectangle": {"origin": [0.02, 0.0], "size": [0.02, 0.02]}, "Q_T": 0}})
    ledger = solved(tmp_path, doc).ledger
    rest = 0.1 * 0.02 - 0.02 * 0.01 * 2 - 0.02 * 0.02 * 2
    power = 1e5 * rest + 4e6 * 0.02 * 0.01 + 1e7 * 0.05 * 0.02 * 0.01 + 0.5 * 2e6 * 0.02 * 0.02
    assert ledger["source"] == pytest.approx(20.0 * power, rel=1e-12)
    assert ledger["stored.bar"] == pytest.approx(20.0 * power, rel=1e-10)


def test_a_strip_of_two_metals_bends_as_timoshenko_says(tmp_path):
    """S. Timoshenko, Analysis of bi-metal thermostats, J. Opt. Soc. Am. 11 (1925) 233, eq. (4); in plane strain with
    E/(1 - nu2) and (1 + nu) alpha."""
    h, L, dT, nu = 0.004, 0.1, 50.0, 0.3
    E, alpha = (2e11, 1e11), (1e-5, 2e-5)
    metals = {name: {**STEEL, "E": E[i], "nu": nu, "alpha": alpha[i]} for i, name in enumerate(("low", "high"))}
    doc = edited(BAR, materials=metals, bodies__bar__material="low", bodies__bar__T0=300.0 + dT,
                 bodies__bar__mesh__rectangle={"origin": [0, 0], "size": [L, h], "cells": [100, 8]},
                 bodies__bar__regions={"high": {"rectangle": {"origin": [0, h / 2], "size": [L, h / 2]},
                                                "material": "high"}},
                 mechanical=edited(HELD, elastic__element="enhanced"), coupling__end=1.0,
                 coupling__windows=[{"until": 1.0, "size": 1.0}])
    u = solved(tmp_path, doc).field("mechanical.u")[1][-1]
    X = loaded(tmp_path, doc).interface.nodes
    middle = np.abs(X[:, 1] - h / 2) < 1e-9
    x, v = X[middle, 0], u[middle, 1]
    inner = (x > 0.3 * L) & (x < 0.7 * L)
    curvature = 2.0 * np.polyfit(x[inner] - x[inner].mean(), v[inner], 2)[0]
    n = E[0] / E[1]
    exact = 24.0 * (1.0 + nu) * (alpha[1] - alpha[0]) * dT / (h * (14.0 + n + 1.0 / n))  # of equal thickness
    assert curvature == pytest.approx(-exact, rel=5e-3)


def test_where_regions_of_different_warmth_meet_their_heat_is_kept(tmp_path):
    """The nodes between have the heat of both sides, so the mean by heat capacity is what all comes to."""
    heavy = {**STEEL, "rho": 16000.0}
    doc = edited(BAR, materials__heavy=heavy, bodies__bar__regions={
        "hot": {"rectangle": LEFT, "T0": 500.0, "material": "heavy"}}, coupling__end=1e5,
        coupling__windows=[{"until": 1e5, "size": 1e4}], thermal__method="backward_euler")
    T = temperatures(solved(tmp_path, doc))
    x = loaded(tmp_path, doc).interface.nodes[:, 0]
    between = np.abs(x - 0.05) < 1e-9
    np.testing.assert_allclose(T[0][between], (2.0 * 500.0 + 300.0) / 3.0, rtol=1e-12)
    assert set(T[0][~between]) == {300.0, 500.0}
    np.testing.assert_allclose(T[-1], (2.0 * 500.0 + 300.0) / 3.0, rtol=0, atol=1e-6)


def test_a_region_may_melt_beside_one_that_melts_alike(tmp_path):
    """A casting of two regions of one alloy and of two conductivities solidifies with all its latent heat."""
    latent = {"L": 4e5, "T_s": 800.0, "T_l": 820.0}
    alloy, twin = {**STEEL, "latent": latent}, {**STEEL, "latent": latent, "k": 100.0}
    doc = edited(BAR, materials__steel=alloy, materials__twin=twin, bodies__bar__T0=900.0,
        bodies__bar__regions={"right": {"rectangle": RIGHT, "material": "twin"}},
        thermal__boundary=[{"on": "bar.left", "temperature": 500.0}], coupling__end=20000.0,
        coupling__windows=[{"until": 20000.0, "size": 500.0}])
    results = solved(tmp_path, doc)
    np.testing.assert_allclose(temperatures(results)[-1], 500.0, rtol=0, atol=0.5)
    lost = 8000.0 * 0.002 * (500.0 * (900.0 - temperatures(results)[-1].mean()) + 4e5)
    assert results.ledger["stored.bar"] == pytest.approx(-lost, rel=1e-4)
    found = errors_of(tmp_path, edited(doc, materials__twin__latent__L=3e5))
    assert "melts otherwise than what it shares nodes with (bar)" in found["bodies.bar.regions.right.material"]
    found = errors_of(tmp_path, edited(doc, materials__twin__latent=None))
    assert list(found) == ["bodies.bar.regions.right.material"]


def gmsh_bar(path: Path) -> None:
    """The bar as a file of triangles and quads, with the groups `left` and `right`, the line between them named too."""
    x, y = np.meshgrid(np.linspace(0, 0.1, 11), np.linspace(0, 0.02, 3))
    grid = np.arange(33).reshape(3, 11)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1)
    left, right = quads[:, :5].reshape(-1, 4), quads[:, 5:].reshape(-1, 4)
    triangles = np.concatenate([right[:, [0, 1, 2]], right[:, [0, 2, 3]]])
    lines = {"in": grid[:, 0], "out": grid[:, -1], "between": grid[:, 5]}
    edges = {n: np.stack([g[:-1], g[1:]], axis=1) for n, g in lines.items()}
    mesh = meshio.Mesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1),
                       [("quad", left), ("triangle", triangles), *(("line", e) for e in edges.values())],
                       cell_data={"gmsh:physical": [np.full(len(left), 1), np.full(len(triangles), 2),
                                                    *(np.full(2, 3 + i) for i in range(3))],
                                  "gmsh:geometrical": [np.full(len(left), 1), np.full(len(triangles), 2),
                                                       *(np.full(2, 3 + i) for i in range(3))]},
                       field_data={"left": np.array([1, 2]), "right": np.array([2, 2]),
                                   **{n: np.array([3 + i, 1]) for i, n in enumerate(edges)}})
    mesh.write(path, file_format="gmsh22", binary=False)


def test_groups_of_a_mesh_file_are_regions(tmp_path):
    gmsh_bar(tmp_path / "bar.msh")
    doc = edited(BAR, bodies__bar__mesh={"file": {"path": "bar.msh"}}, materials__felt={**STEEL, "k": 4.0},
                 thermal__method="steady", bodies__bar__regions={"r": {"group": "right", "material": "felt"}},
                 thermal__boundary=[{"on": "bar.in", "temperature": 400.0}, {"on": "bar.out", "temperature": 300.0}])
    results, x = solved(tmp_path, doc), loaded(tmp_path, doc).interface.nodes[:, 0]
    q = 100.0 / (0.05 / 40.0 + 0.05 / 4.0)
    exact = 400.0 - q * (np.minimum(x, 0.05) / 40.0 + np.clip(x - 0.05, 0.0, None) / 4.0)
    np.testing.assert_allclose(temperatures(results)[-1], exact, rtol=0, atol=1e-9)
    found = errors_of(tmp_path, edited(doc, bodies__bar__regions__r__group="rihgt"))
    assert "Did you mean 'right'?" in found["bodies.bar.regions.r.group"]
    found = errors_of(tmp_path, edited(doc, bodies__bar__regions__r={"rectangle": RIGHT}))
    assert "only a body that is a rectangle" in found["bodies.bar.regions.r.rectangle"]
    half = edited(doc, bodies__bar__mesh__file__region="left", bodies__bar__regions={"r": {"group": "right"}},
                  thermal__boundary=[])
    assert "has no cell of this body" in errors_of(tmp_path, half)["bodies.bar.regions.r.group"]


def test_what_is_wrong_with_regions_is_told_all_at_once(tmp_path):
    bar = BAR["bodies"]["bar"]
    doc = edited(BAR, bodies={"bar": {**bar, "regions": {
        "cut": {"rectangle": {"origin": [0.013, 0.0], "size": [0.027, 0.02]}},
        "off": {"rectangle": {"origin": [0.0, 0.0], "size": [0.02, 0.5]}},
        "a": {"rectangle": LEFT, "material": "gold"}, "b": {"rectangle": {"origin": [0.04, 0], "size": [0.02, 0.01]}},
        "named": {"group": "g"}, "cold": {"rectangle": RIGHT, "T0": linear(-300.0, 1.0)},
        "run": {"rectangle": {"origin": [0.09, 0], "size": [0.01, 0.01]}, "T0": {"from": "x.h5"}}}}})
    found = errors_of(tmp_path, doc)
    key = "bodies.bar.regions."
    assert "reaches from x = 0.013 m, where no line of the mesh is" in found[f"{key}cut.rectangle.origin.0"]
    assert "The nearest: 0.01 and 0.02 m" in found[f"{key}cut.rectangle.origin.0"]
    assert f"{key}off.rectangle.size.1" in found
    assert "there is no material 'gold'" in found[f"{key}a.material"]
    assert "1 of its cells are already those of the region 'a'" in found[f"{key}b"]
    assert "a rectangle has no named groups" in found[f"{key}named.group"]
    assert "reaches -299.95" in found[f"{key}cold.T0.terms"]
    assert "with its body" in found[f"{key}run.T0"]
    for body in ({"group": "g", "rectangle": LEFT}, {}):
        assert "exactly one of group, rectangle" in str(errors_of(tmp_path, edited(
            BAR, bodies__bar__regions={"r": body})))


@pytest.mark.parametrize(("doc", "words"), [
    ({"thermal__half": "lumped"}, "the half 'lumped' has no regions"),
    ({"thermal__half": "rod"}, "the half 'rod' has no regions"),
    ({"mechanical": {"half": "rod", "rod": {"held": {"bar": {"left": 0}}}}},
     "the mechanical half `rod` has no regions"),
    ({"mechanical": {"half": "elastic", "elastic": {"dynamics": {}, "bodies": {"bar": {"rigid": True}}}}},
     "a rigid body with inertia has one density")])
def test_halves_without_regions_refuse_them(tmp_path, doc, words):
    scene = edited(BAR, materials__lead={**STEEL, "rho": 11000.0}, bodies__bar__regions={
        "left": {"rectangle": LEFT, "material": "lead"}}, **doc)
    assert words in str(errors_of(tmp_path, scene))


def test_masses_and_weights_go_by_region(tmp_path):
    """Both mass matrices and the weight are the sum of volume times density, in a file and read back."""
    doc = edited(BAR, materials__lead={**STEEL, "rho": 11000.0}, mechanical={"half": "elastic", "elastic": {
        "dynamics": {}, "gravity": {"y": -10.0}, "boundary": [{"on": "bar.left", "u_x": 0, "u_y": 0}]}},
        bodies__bar__regions={"left": {"rectangle": LEFT, "material": "lead"}})
    loaded(tmp_path, doc).write_half("mechanical", tmp_path / "half")
    system = load(*load_directory(tmp_path / "half")).system
    mass = 0.05 * 0.02 * (11000.0 + 8000.0)
    for matrix in (system.masses.matrix(True), system.masses.matrix(False)):
        along_y = np.tile([0.0, 1.0], 33)
        assert along_y @ matrix @ along_y == pytest.approx(mass, rel=1e-12)
    weight = np.asarray(system.masses.dead.unit.sum(axis=1)).reshape(-1, 2)[:, 1]
    assert weight.sum() == pytest.approx(mass, rel=1e-12)
    assert weight[system.interface.nodes[:, 0] < 0.045].sum() > weight[system.interface.nodes[:, 0] > 0.055].sum()


def test_the_penalty_is_of_what_lies_at_the_surface_and_friction_heats_by_it(tmp_path):
    """auto is that of the two cells that meet at a place, in a row; the heat of friction goes by what lies there."""
    felt = {**STEEL, "E": 1e9, "k": 1.0}
    bar = BAR["bodies"]["bar"]
    top = {**bar, "mesh": {"rectangle": {"origin": [0.0, 0.02], "size": [0.1, 0.02], "cells": [10, 2]}}}
    doc = edited(BAR, materials__felt=felt, bodies={"bar": bar, "lid": {**top, "regions": {
        "skin": {"rectangle": {"origin": [0, 0.02], "size": [0.1, 0.01]}, "material": "felt"}}}},
        contact={"face": {"slave": "lid.bottom", "master": "bar.top", "gap_max": 0.01, "friction": {"mu": 0.5}}},
        mechanical={"half": "elastic", "elastic": {"boundary": [
            {"on": "bar.bottom", "u_x": 0, "u_y": 0},
            {"on": "lid.top", "u_x": {"t": [0, 20], "value": [0, 1e-3]}, "u_y": -1e-6}]}})
    (pair,) = loaded(tmp_path, doc).interface.pairs
    squeezed = 0.7 / (1.3 * 0.4)
    soft, hard = squeezed * 1e9 / 0.01, squeezed * STEEL["E"] / 0.01
    assert pair.eps_N == pytest.approx(soft * hard / (soft + hard), rel=1e-6)
    ledger = solved(tmp_path, doc).ledger
    share = ledger["friction.slave"] / (ledger["friction.slave"] + ledger["friction.master"])
    assert share == pytest.approx(1.0 / (1.0 + np.sqrt(40.0)), rel=1e-3)


@pytest.mark.slow
def test_embedded_codec_processes_and_resumed_give_the_same_bits(tmp_path):
    doc = edited(BAR, materials__felt={**STEEL, "k": 4.0, "E": 1e10}, thermal__boundary=WALLS, mechanical=HELD,
                 bodies__bar__T0=linear(300.0, 100.0), bodies__bar__regions={
                     "felt": {"rectangle": LEFT, "material": "felt", "T0": 350.0, "Q_T": 1e5}},
                 output={"fields": {"every": 1}, "checkpoint": 0.0})
    a = run(loaded(tmp_path, doc), tmp_path / "a.h5")
    b = run(loaded(tmp_path, edited(doc, coupling__link="codec")), tmp_path / "b.h5")
    c = run(loaded(tmp_path, doc), tmp_path / "c.h5", processes=True)
    from coupler.running.resume import resume
    run(loaded(tmp_path, doc), tmp_path / "d.h5", until=8.0)
    d = resume(tmp_path / "d.h5")
    for other in (b, c, d):
        np.testing.assert_array_equal(temperatures(a), temperatures(other))
        np.testing.assert_array_equal(a.field("mechanical.u")[1], other.field("mechanical.u")[1])
