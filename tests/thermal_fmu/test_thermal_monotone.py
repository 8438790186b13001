"""Without sources T stays within its data over any number of steps, whatever signs mesh and material conduct with."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from thermal_scenes import Box, FlatContact, Ran, inputs_of, run, scene, spec

from contact.half.interface import Interface, Pair
from contact.half.model import Done
from thermal_fmu import step
from thermal_fmu.half import load
from thermal_fmu.known import LEAST as LEFT

PRESSED = -1e6
LEAST = 1e-7  # of the span


def blocks(seed: int, cells: tuple[tuple[int, int], tuple[int, int]] = ((6, 4), (8, 5)), **more: Any) -> Interface:
    """Two blocks, "a" on "b", of skewed quads: inner nodes are moved by up to 0.3 of a cell."""
    rng = np.random.default_rng(seed)

    def move(X: np.ndarray) -> np.ndarray:
        inner = (X[:, 0] > 1e-9) & (X[:, 0] < 1 - 1e-9) & (np.abs(np.abs(X[:, 1]) - 0.5) < 0.5 - 1e-9)
        return X + np.where(inner[:, None], rng.uniform(-0.3, 0.3, X.shape) * (1 / 8, 1 / 5), 0.0)

    (ax, ay), (bx, by) = cells
    return scene(Box(0, 1, 0, 1, ax, ay), Box(0, 1, -1, 0, bx, by), move=move,
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),), **more)


def skewed(angle: float, ratio: float) -> dict[str, Any]:
    return {"k_1": ratio, "k_2": 1.0, "angle": angle, "turns": False}


def stepped(mesh: Interface, k: Any, dt: float, n: int, h: float = 10.0, boundary: Any = (), T: tuple[float, float] =
            (0.0, 1.0), pair: Any = None, **more: Any) -> Ran:
    laws = pair or {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}
    model = spec(list(boundary), k=k, pairs={"p": laws}, T0=T[0], **more)
    model["bodies"]["b"] = {"material": "m", "T0": T[1]}
    return run(mesh, model, dt, n, t_N=np.full(len(mesh.contact_nodes), PRESSED if pair is None else 0.0))


def stays(ran: Ran, low: float = 0.0, high: float = 1.0) -> None:
    slack = LEAST * (high - low)
    assert ran.T.min() >= low - slack
    assert ran.T.max() <= high + slack
    assert ran.imbalance() < 1e-10


@pytest.mark.few("0-axisymmetric-midpoint")
@pytest.mark.parametrize("method", ["backward_euler", "midpoint", "sdirk2"])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize("seed", range(4))
def test_no_node_leaves_its_data(seed: int, geometry: str, method: str) -> None:
    """Skewed quads, skewed axes, contact at cell Biot numbers to 1e4, a film, a wall: 5 to 60 % of the span before."""
    rng = np.random.default_rng(100 + seed)
    mesh = blocks(seed, geometry=geometry)
    k, h = skewed(float(rng.uniform(0, np.pi)), float(10 ** rng.uniform(0, 2))), float(10 ** rng.uniform(-1, 5))
    boundary = [{"on": "a.right", "convection": {"h": float(10 ** rng.uniform(-1, 5)), "T": 1.0}},
                {"on": "b.bottom", "temperature": 0.0}]
    for dt in (1e-3, 0.03, 1.0):
        stays(stepped(mesh, k, dt, 8, h, boundary, method=method))


def test_steady_states_stay_within_their_data() -> None:
    boundary = [{"on": "a.right", "convection": {"h": 1e5, "T": 1.0}}, {"on": "b.bottom", "temperature": 0.0}]
    for seed in range(4):
        stays(stepped(blocks(seed), skewed(0.8, 50.0), 1.0, 1, 1e3, boundary, method="steady"))


@pytest.mark.slow
def test_nothing_creeps_out_over_many_steps() -> None:
    """What one step leaves by the next one takes for its data: 40 K of 100 in 50 s before."""
    stays(stepped(blocks(2, ((4, 3), (5, 3))), skewed(0.7, 30.0), 1e-4, 400, 1e3))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "method", "dt", "k", "h"), [
    (13, "backward_euler", 1.7e-4, skewed(2.8, 11.0), 0.24), (6, "backward_euler", 6.1e-5, skewed(0.0086, 4.1), 1.5),
    (18, "midpoint", 1.6e-4, skewed(0.86, 25.0), 85.0), (4, "sdirk2", 3.1e-5, skewed(0.19, 17.0), 4.6)])
def test_what_a_step_leaves_is_left_once(seed: int, method: str, dt: float, k: Any, h: float) -> None:
    """Two hundred steps leave no more than is seen of one; 2 to 24 times that where each knew of the last one alone."""
    ran = stepped(blocks(seed, ((4, 3), (5, 3))), k, dt, 200, h, method=method)
    assert max(-ran.T.min(), ran.T.max() - 1.0) <= 1.01 * LEFT


COOLING = {"t": [0.0, 0.4, 0.5], "value": [0.0, 1.0, 0.5]}  # in parts of a run


@pytest.mark.slow
@pytest.mark.parametrize(("method", "dt", "k", "h"), [
    ("midpoint", 5.8e-3, skewed(0.5, 304.0), 7e3), ("midpoint", 5.6e-3, skewed(1.0, 41.0), 2.8e3),
    ("sdirk2", 2.7e-3, skewed(2.0, 144.0), 150.0), ("backward_euler", 7e-4, skewed(2.5, 157.0), 210.0)])
def test_within_all_that_was_nothing_is_taken_off(method: str, dt: float, k: Any, h: float,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that stays within the data of its bodies is, to the bit, one from which nothing can be taken off.

    That a step leaves those of its own start means nothing: bodies were warmer and colder before.
    """
    n, mesh = 100, blocks(4, ((4, 3), (5, 3)))
    wall = {"t": (n * dt * np.array(COOLING["t"])).tolist(), "value": COOLING["value"]}
    model = spec([{"on": "a.left", "temperature": wall}], k=k, T0=0.0, method=method,
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 1.0}
    half, link = load(mesh, model), FlatContact()
    inputs = inputs_of(mesh, half, t_N=np.full(len(mesh.contact_nodes), PRESSED))
    state, outputs = half.start(inputs, 0.0, link)
    beyond_start = 0
    for i in range(n):
        before = np.asarray(outputs["T"])
        done = half.step(state, inputs, i * dt, dt, link)
        with monkeypatch.context() as patch:
            patch.setattr(step, "monotone", lambda *_: None)
            free = half.step(state, inputs, i * dt, dt, link)
        assert isinstance(done, Done)
        assert isinstance(free, Done)
        T = np.asarray(free.outputs["T"])
        state, outputs = done.state, done.outputs
        if T.min() >= 0.0 and T.max() <= 1.0:
            assert np.array_equal(T, np.asarray(outputs["T"])), i
            wall_T = T[half._scene.fixed].max()
            beyond_start += T.min() < before.min() - 1e-6 or T.max() > max(before.max(), wall_T) + 1e-6
    assert beyond_start >= 5


@pytest.mark.few("0-damped quarters")
@pytest.mark.parametrize("more", [{}, {"adaptive": {"tolerance": 0.01}}], ids=["damped quarters", "inner steps"])
@pytest.mark.parametrize("seed", range(2))
def test_what_was_within_a_substep_is_a_datum_of_its_rest(seed: int, more: dict[str, Any],
                                                          monkeypatch: pytest.MonkeyPatch) -> None:
    """A pulse of a wall: the peak it leaves stays as without any correction (0.1 % lower; 8 % if forgotten)."""
    wall = [{"on": "a.right", "temperature": {"t": [0, 0.01, 0.02], "value": [0.0, 1.0, 0.0]}}]

    def peak() -> float:
        return float(stepped(blocks(seed, ((6, 4), (5, 3))), skewed(0.8, 10.0), 0.03, 1, 1e2, wall, T=(0.0, 0.0),
                             **more).T.max())

    kept = peak()
    monkeypatch.setattr(step, "monotone", lambda *_: None)
    assert kept == pytest.approx(peak(), rel=3e-3)


def test_a_node_at_its_bound_comes_to_rest() -> None:
    """All of a correction in one step and none in the next made nodes go up and down by 8 % of the span."""
    boundary = [{"on": "a.right", "convection": {"h": 1e5, "T": 1.0}}, {"on": "b.bottom", "temperature": 0.0}]
    ran = stepped(blocks(3), skewed(0.8, 50.0), 1.0, 60, 1e3, boundary, method="backward_euler")
    stays(ran)
    assert np.abs(np.diff(ran.T[-10:], axis=0)).max() < 1e-3


@pytest.mark.parametrize("k", [1e-3])
def test_near_radiation_stays_within_its_data(k: float) -> None:
    """Slow conductors that radiate to each other across a gap, the master unevenly warm."""
    uneven = {"terms": [{"t": 300.0}, {"t": 1200.0, "x": {"at": [0, 0.49, 0.51, 1], "value": [1, 1, 0, 0]}}]}
    mesh = scene(Box(0, 1, 0, 1, 8, 4), Box(0, 1, -1, 0, 5, 4),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),))
    for dt in (1e-3, 0.1):
        stays(stepped(mesh, k, dt, 4, boundary=[{"on": "b.top", "temperature": uneven}], T=(300.0, 300.0),
                      pair={"radiation": {"emissivity_slave": 1.0, "emissivity_master": 1.0}}), 300.0, 1500.0)


def test_bodies_that_exchange_nothing_have_their_own_data() -> None:
    """A cold body far away is no datum of a skewed one; one that is touched is."""
    mesh, k = blocks(1), skewed(0.8, 50.0)
    apart = {"conduction": {"closed": {"law": "constant", "h": 1.0}, "open": None}}
    wall = [{"on": "a.left", "temperature": 2.0}]
    ran = stepped(mesh, k, 0.01, 12, boundary=wall, T=(1.0, -50.0), pair=apart)
    a = np.array(mesh.node_body) == 0
    assert ran.T[:, a].min() >= 1.0 - LEAST
    assert np.abs(ran.T[:, ~a] + 50.0).max() < 1e-9


def test_a_field_linear_in_place_stays_exact() -> None:
    """Within its data nothing is taken off: the patch test of skewed quads and axes."""
    line = {"terms": [{"t": 1.0, "x": {"polynomial": [1.0, 2.0]}}]}
    sides = [{"on": f"{b}.{s}", "temperature": line} for b in "ab" for s in ("left", "right")]
    mesh = blocks(5)
    top = {"on": "a.top", "temperature": line}, {"on": "b.bottom", "temperature": line}
    ran = stepped(mesh, 3.0, 1.0, 1, 1e3, [*sides, *top], method="steady")
    assert np.abs(ran.T[-1] - (1.0 + 2.0 * mesh.nodes[:, 0])).max() < 1e-11


def test_a_source_keeps_its_peak() -> None:
    """What a source heats beyond all data is no matter of signs: to the bit as without any correction."""
    mesh = blocks(2, ((4, 4), (4, 4)))
    model = spec([{"on": "a.top", "temperature": 0.0}], k=1.0, pairs={})
    model["bodies"] |= {"a": {"material": "m", "T0": 0.0, "Q_T": 5.0}, "b": {"material": "m", "T0": 0.0}}
    ran = run(mesh, model, 0.05, 20)
    assert ran.T.max() > 1.0
    assert ran.outputs[-1]["iterations"] == 1.0


def galerkin(mesh: Interface, k: Any, heat: np.ndarray, held: np.ndarray) -> np.ndarray:
    """T : (n,) of quads by four points each, nodes `held` at 0 and heat : (n,) [W] into the others: nothing taken off.
    """
    c, s = np.cos(k["angle"]), np.sin(k["angle"])
    axes = np.array([[c, -s], [s, c]])
    K, A = axes @ np.diag([k["k_1"], k["k_2"]]) @ axes.T, np.zeros((len(mesh.nodes),) * 2)
    for cell in mesh.quads:
        for p, q in ((0.5 + 0.5 * i / np.sqrt(3.0), 0.5 + 0.5 * j / np.sqrt(3.0)) for i in (-1, 1) for j in (-1, 1)):
            dN = np.array([[q - 1.0, 1.0 - q, q, -q], [p - 1.0, -p, p, 1.0 - p]])
            J = dN @ mesh.nodes[cell]
            G = np.linalg.solve(J, dN)
            A[np.ix_(cell, cell)] += 0.25 * abs(np.linalg.det(J)) * G.T @ K @ G
    T, free = np.zeros(len(A)), ~held
    T[free] = np.linalg.solve(A[np.ix_(free, free)], heat[free])
    return T


@pytest.mark.parametrize("n", [8, 16])
@pytest.mark.parametrize("how", ["steady", "backward_euler"])
def test_bodies_beside_a_source_keep_their_conduction(n: int, how: str) -> None:
    # All that a flux warms was taken for beyond its data, and lost what couples it with the wrong sign: 0.05 for 0.12.
    mesh, k = scene(Box(0, 1, 0, 1, n, n)), skewed(0.3, 10.0)
    strip = {"at": [0.44, 0.440001, 0.559999, 0.56], "value": [0.0, 1.0, 1.0, 0.0]}
    ran = run(mesh, spec([{"on": "a.top", "flux": {"terms": [{"x": strip}]}}, {"on": "a.bottom", "temperature": 0.0}],
                         k=k, method=how), 1.0, 1 if how == "steady" else 20)
    x, y = mesh.nodes.T
    heat = np.zeros(x.size)
    at = np.linspace(0.44, 0.56, 1201)[:-1] + 0.5e-4
    for node in np.flatnonzero(y > 1.0 - 1e-9):
        heat[node] = 0.12 * np.maximum(1.0 - np.abs(at - x[node]) * n, 0.0).mean()
    T = galerkin(mesh, k, heat, y < 1e-9)
    assert T.min() >= 0.0  # within its data, so nothing is to be taken off
    assert ran.T[-1] == pytest.approx(T, abs=1e-4 * T.max())


@pytest.mark.slow
def test_adaptive_steps_do_not_see_an_error_in_what_is_taken_off() -> None:
    """48 inner steps, 40 without any correction; 218 where the flows they are compared with have wrong signs."""
    boundary = [{"on": "a.right", "convection": {"h": 1e5, "T": 1.0}}, {"on": "b.bottom", "temperature": 0.0}]
    ran = stepped(blocks(3), skewed(0.8, 50.0), 0.1, 2, 1e3, boundary, adaptive={"tolerance": 0.05})
    stays(ran)
    assert sum(o["substeps"] for o in ran.outputs) < 60
