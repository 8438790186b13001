"""Patch tests, objectivity, free expansion, and the tangent."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.linalg import pattern_of
from contact.half.model import Discard
from mechanical_fmu.advance import drive_of
from mechanical_fmu.loads import pressure_blocks, pressure_forces
from mechanical_fmu.material import Moduli
from mechanical_fmu.newton import SolverSettings, solve
from mechanical_fmu.predicting import predicted
from mechanical_fmu.warm import beginning

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, done, elastic, hold, inputs_of, press, stress_of

LINK = NoLink()
KINDS = ("quads", "triangles")
GEOMETRIES = ("plane", "axisymmetric")
GRID = np.linspace(0.0, 1.0, 5)


def distorted(nodes):
    """Move the inner nodes of the unit square, and put it 1 to 2 m from the axis."""
    x, y = nodes.T
    bump = np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.stack([1.0 + x + 0.08 * bump * np.cos(7 * y), y + 0.08 * bump * np.sin(5 * x)], axis=1)


def edge_nodes(interface):
    return np.unique(np.concatenate([e.ravel() for e in interface.surfaces.values()]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_linear_field_is_reproduced_in_the_plane(kind):
    plain = block(GRID, GRID, kind, move=distorted)
    G = np.array([[0.02, 0.03], [-0.01, -0.04]])
    rim = edge_nodes(plain)
    interface = replace(plain, node_sets={f"n{i}": np.array([i], np.int32) for i in rim})
    u = plain.nodes @ G.T
    half = elastic(interface, [hold(f"n{i}", c, float(u[i, c])) for i in rim for c in (0, 1)], tolerance=1e-12)
    state, outputs = half.start(inputs_of(half), 0.0, LINK)
    assert np.abs(state.u - u).max() <= 1e-10
    stress = stress_of(half, state, inputs_of(half)["T"])[0].reshape(-1, 4)
    assert np.ptp(stress, axis=0).max() <= 1e-10 * np.abs(stress).max()
    assert np.abs(stress).max() > 1e9
    assert np.ptp(outputs["sigma_v"]) <= 1e-10 * outputs["sigma_v"].max()


@pytest.mark.parametrize("kind", KINDS)
def test_uniform_stretch_is_reproduced_about_an_axis(kind):
    """u_r = a r, u_z = b z has the same strain everywhere; held at the rim it must be found inside."""
    plain = block(GRID, GRID, kind, "axisymmetric", move=distorted)
    u = plain.nodes * [0.02, -0.03]
    rim = edge_nodes(plain)
    interface = replace(plain, node_sets={f"n{i}": np.array([i], np.int32) for i in rim})
    half = elastic(interface, [hold(f"n{i}", c, float(u[i, c])) for i in rim for c in (0, 1)], tolerance=1e-12)
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    assert np.abs(state.u - u).max() <= 1e-10
    stress = stress_of(half, state, inputs_of(half)["T"])[0]
    assert np.abs(stress[..., 0] - stress[..., 3]).max() <= 1e-10 * np.abs(stress).max()


@pytest.mark.parametrize("kind", KINDS)
def test_turned_by_75_degrees_in_three_unequal_steps_the_stress_turns_along(kind):
    """B17: a block stretched by 1.3, then turned rigidly."""
    half = elastic(block(GRID, GRID, kind, move=distorted))
    volume, X = half.system.volume, half.system.interface.nodes
    T = np.full(len(X), 300.0)
    moduli = half.system.moduli(T)
    stretch = np.diag([1.3, 1.0])
    still = volume.stress(X @ (stretch - np.eye(2)).T, moduli)[0][0]
    forces = volume.forces(X @ (stretch - np.eye(2)).T, moduli)
    for degrees in (10.0, 31.0, 75.0):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        Q = np.array([[c, -s], [s, c]])
        u = X @ (Q @ stretch - np.eye(2)).T
        turned = volume.stress(u, moduli)[0][0]
        tensor = np.stack([still[..., 0], still[..., 2], still[..., 2], still[..., 1]], axis=-1)
        expected = Q @ tensor.reshape(*still.shape[:2], 2, 2) @ Q.T
        assert np.abs(turned[..., [0, 2, 2, 1]].reshape(expected.shape) - expected).max() <= 1e-8 * np.abs(still).max()
        assert np.abs(volume.forces(u, moduli) - forces @ Q.T).max() <= 1e-8 * np.abs(forces).max()
        nothing = volume.stress(X @ (Q - np.eye(2)).T, moduli)[0][0]
        assert np.abs(nothing).max() <= 1e-8 * np.abs(still).max()


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_free_body_expands_without_stress(kind, geometry):
    """alpha (T - T_ref) = .012 stretches every free direction alike; plane strain is not free out of plane."""
    interface = block(GRID, GRID, kind, geometry, move=distorted, node_sets={"corner": [0]})
    boundary = [hold("corner", 1)] + ([] if geometry == "axisymmetric" else [hold("block.left", 0)])
    half = elastic(interface, boundary, tolerance=1e-11)
    inputs = inputs_of(half, 1300.0)
    state, outputs = half.start(inputs, 0.0, LINK)
    X, stretch = interface.nodes, 1.0 + 1.2e-5 * 1000.0
    if geometry == "axisymmetric":
        assert np.abs(outputs["x"] - X * stretch - [0.0, (1.0 - stretch) * X[0, 1]]).max() <= 1e-10
        assert outputs["sigma_v"].max() <= 1e-9 * 2e11
    else:
        stress = stress_of(half, state, inputs["T"])[0]
        assert np.abs(stress[..., :3]).max() <= 1e-9 * 2e11
        # In the plane the sheet grows by more than alpha dT: (1 + nu) alpha dT to first order.
        width = np.ptp(outputs["x"][:, 1]) - 1.0
        assert width == pytest.approx(1.3 * 0.012, rel=0.02)
        assert np.abs(stress[..., 3] - stress[0, 0, 3]).max() <= 1e-9 * 2e11


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_tangent_is_the_derivative_of_the_forces(kind, geometry):
    half = elastic(block(GRID[:3], GRID[:3], kind, geometry, move=distorted))
    volume = half.system.volume
    n = volume.n_cells
    moduli = (Moduli(np.linspace(1.0, 2.0, n), np.linspace(3.0, 50.0, n), np.linspace(-0.01, 0.03, n)[:, None]),)
    u = 0.03 * np.random.default_rng(1).standard_normal((volume.n_nodes, 2))
    K = pattern_of(u.size, volume.kinds[0].dofs).matrix(volume.tangent(u, moduli)[1]).toarray()
    assert np.array_equal(K, K.T)
    step, numbers = 1e-6, np.empty_like(K)
    for i in range(u.size):
        d = np.zeros(u.size)
        d[i] = step
        ahead, back = volume.forces(u + d.reshape(u.shape), moduli), volume.forces(u - d.reshape(u.shape), moduli)
        numbers[:, i] = ((ahead - back) / (2 * step)).ravel()
    assert np.abs(K - numbers).max() <= 1e-6 * np.abs(K).max()


@pytest.mark.parametrize("axisymmetric", [False, True])
def test_the_tangent_of_a_follower_pressure_is_the_derivative_of_its_forces(axisymmetric):
    x = np.array([[1.0, 0.2], [1.7, 0.9], [1.1, 1.3]])
    edges, p = np.array([[0, 1], [1, 2]], np.int32), np.array([2.0, 3.0])
    blocks = pressure_blocks(x, edges, p, axisymmetric).reshape(2, 2, 2, 2, 2)
    for node in range(3):
        for component in range(2):
            d = np.zeros_like(x)
            d[node, component] = 1e-6
            change = (pressure_forces(x + d, edges, p, axisymmetric)
                      - pressure_forces(x - d, edges, p, axisymmetric)) / 2e-6
            expected = -np.where((edges == node)[:, :, None, None, None], 1.0, 0.0)
            total = sum(blocks[:, :, :, b, component] * (edges[:, b] == node)[:, None, None] for b in range(2))
            assert expected.any()
            assert np.abs(total + change).max() <= 1e-8


def test_pressure_all_around_leaves_no_resultant_and_the_pressure_itself():
    around = [press(f"block.{s}", 1e8) for s in ("bottom", "right", "top", "left")]
    interface = block(GRID, GRID, move=distorted, node_sets={"corner": [0], "other": [20]})
    half = elastic(interface, [*around, hold("corner", 0), hold("corner", 1), hold("other", 1)], tolerance=1e-11)
    inputs = inputs_of(half)
    state, outputs = half.start(inputs, 0.0, LINK)
    stress = stress_of(half, state, inputs["T"])[0]
    assert np.abs(stress[..., :2] + 1e8).max() <= 1e-6 * 1e8
    assert np.abs(stress[..., 2]).max() <= 1e-6 * 1e8
    assert np.abs(outputs["reaction.block"]).max() <= 1e-6 * 1e8


def test_newton_converges_quadratically():
    """B16: without reuse the last residuals above round-off fall with an exponent of at least 1.8."""
    half = elastic(block(GRID, GRID, move=distorted), [hold("block.left", 0), hold("block.left", 1),
                                                        press("block.top", 2e9), press("block.right", -1e10)])
    system = half.system
    loading = half._loading(drive_of(system, inputs_of(half), 0.0, 1), beginning(system), LINK)
    start = predicted(system, np.zeros((system.volume.n_nodes, 2)), loading, tangent=True)
    found = solve(system, loading, start, None, SolverSettings(1e-11))
    r = [e for e in found.history if e > 1e-12][-3:]
    assert found.iterations <= 6
    assert np.log(r[2] / r[1]) / np.log(r[1] / r[0]) >= 1.8


def test_a_cell_turned_inside_out_is_named():
    half = elastic(block(GRID, GRID), [hold("block.left", 0), hold("block.left", 1),
                                       hold("block.right", 0, {"t": [0, 1], "value": [0, -2.0]})])
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    answer = half.step(state, inputs_of(half), 0.0, 1.0, LINK)
    assert isinstance(answer, Discard)
    assert "of body block would be turned inside out" in answer.message
    assert 0 < answer.dt_suggest < 1


@pytest.mark.parametrize(("boundary", "motion"), [([], "moving along"), ([hold("block.left", 0)], "moving along y"),
                                                  ([hold("corner", 0), hold("corner", 1)], "turning")])
def test_a_body_that_nothing_holds_is_named_with_its_motion(boundary, motion):
    half = elastic(block(GRID, GRID, node_sets={"corner": [0]}), [*boundary, press("block.top", 1e6)])
    with pytest.raises(ArithmeticError, match=f"nothing holds body block against {motion}"):
        half.start(inputs_of(half), 0.0, LINK)


def test_a_driven_block_moves_without_distortion():
    """Through 1.1 L in one step with u_x given at one node only: no strain, no reaction, no iteration."""
    interface = block(GRID, GRID, node_sets={"middle": [14]})
    half = elastic(interface, [hold("block.top", 1), hold("middle", 0, {"t": [0, 1], "value": [0, 1.1]})])
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    state, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, LINK))
    assert np.abs(outputs["x"] - interface.nodes - [1.1, 0.0]).max() <= 1e-15
    assert outputs["iterations"] == 0
    assert outputs["sigma_v"].max() <= 1e-12 * 2e11


def test_jumps_are_seen_from_the_left_at_the_end_of_a_step():
    half = elastic(block(GRID, GRID), [hold("block.bottom", 1), hold("block.left", 0),
                                       hold("block.top", 1, {"t": [0, 1, 1], "value": [0, 0.001, 0.002]})])
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    state, at_jump = done(half.step(state, inputs_of(half), 0.0, 1.0, LINK))
    _, after = done(half.step(state, inputs_of(half), 1.0, 1.0, LINK))
    assert at_jump["x"][4, 1] == pytest.approx(1.001, abs=1e-14)
    assert after["x"][4, 1] == pytest.approx(1.002, abs=1e-14)


def test_load_factors_scale():
    half = elastic(block(GRID, GRID), [hold("block.bottom", 1), hold("block.left", 0),
                                       press("block.top", 1e6, name="p"),
                                       hold("block.right", 0, 1e-5, name="stretch")])
    _, once = half.start(inputs_of(half, p=1.0, stretch=0.0), 0.0, LINK)
    _, twice = half.start(inputs_of(half, p=2.0, stretch=2.0), 0.0, LINK)
    assert once["reaction.block"][1] == pytest.approx(1e6, rel=1e-4)
    assert twice["reaction.block"][1] == pytest.approx(2e6, rel=1e-4)
    assert twice["x"][-1, 0] == 1.0 + 2e-5


def test_nothing_loaded_leaves_the_reference_exactly():
    interface = block(GRID, GRID, move=distorted)
    half = elastic(interface, [hold("block.left", 0), hold("block.left", 1)])
    _, outputs = half.start(inputs_of(half), 0.0, LINK)
    assert np.array_equal(outputs["x"], interface.nodes)
    assert outputs["iterations"] == 0
