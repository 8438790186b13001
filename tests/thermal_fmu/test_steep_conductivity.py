"""A conductivity that changes many times within a few kelvin conducts right however many kelvin a cell spans.

Heat through a wall is the integral of k over temperature by its thickness (Kirchhoff), whatever the cells.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_matrix

sys.path.insert(0, str(Path(__file__).parent))
from test_thermal_space import distorted
from thermal_scenes import Box, FlatContact, inputs_of, run, scene, spec

from contact.half.model import Done
from contact.rpc.link import open_link
from thermal_fmu.cells import MatrixEntries, conduct, shapes_of
from thermal_fmu.half import load
from thermal_fmu.phase_change import fields
from thermal_fmu.stations.half import load_rod

T, K = [300.0, 398.0, 402.0, 600.0], [1.0, 1.0, 30.0, 30.0]
STEEP = {"T": T, "value": K}
HOT, COLD, L = 500.0, 300.0, 0.02
THROUGH = (98.0 * 1.0 + 4.0 * 15.5 + 98.0 * 30.0) / L  # W/m2
HELD = [{"on": "a.left", "temperature": HOT, "name": "hot"}, {"on": "a.right", "temperature": COLD}]
FROZEN, MOLTEN = {"L": 1e5, "T_s": 900.0, "T_l": 900.0}, {"L": 1e5, "T_s": 200.0, "T_l": 210.0}
KINDS: dict[str, tuple[Any, dict[str, float] | None]] = {
    "isotropic": (STEEP, None),
    "along axis 1": ({"k_1": STEEP, "k_2": 3.0, "angle": 0.0, "turns": False}, None),
    "along axis 2": ({"k_1": 3.0, "k_2": STEEP, "angle": 0.5 * np.pi, "turns": False}, None),
    "solid": ({"solid": STEEP, "liquid": 7.0}, FROZEN),
    "liquid": ({"solid": 7.0, "liquid": STEEP}, MOLTEN)}


def integral(at: Any) -> Any:
    """The integral of k from 300 K to `at`, written out apart from the sources."""
    below, steep, above = (np.clip(at - low, 0.0, most) for low, most in ((300.0, 98.0), (398.0, 4.0), (402.0, 198.0)))
    return below + steep + 0.5 * 29.0 / 4.0 * steep ** 2 + 30.0 * above


def model_of(kind: str, boundary: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    k, latent = KINDS[kind]
    model = spec(boundary, k=k, c=500.0, rho=2000.0, T0=400.0, **more)
    if latent is not None:
        model["materials"]["m"] |= {"latent": latent, "c": {"solid": 500.0, "liquid": 500.0}}
    return model


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_heat_through_a_wall_is_the_integral(kind, triangles):
    """Red with k at points of cells: 5 cells of 40 K carried 0.5 to 0.9 of it."""
    mesh = scene(Box(0, L, 0, 0.01, 5, 2, triangles=triangles))
    ran = run(mesh, model_of(kind, HELD, method="steady"), 1.0, 1)
    assert ran.outputs[-1]["condition.heat.hot"] == pytest.approx(THROUGH * 0.01, rel=1e-9)
    assert ran.outputs[-1]["q"][:, 0] == pytest.approx(np.full(len(ran.outputs[-1]["q"]), THROUGH), rel=1e-9)
    falls = integral(HOT) - THROUGH * mesh.nodes[:, 0]
    assert np.abs(integral(ran.T[-1]) - falls).max() < 1e-9 * THROUGH * L


def test_potentials_are_those_of_a_constant_conductivity():
    """On any mesh, whatever flows: the potentials at nodes are the temperatures of k = 1 whose ends are theirs."""
    mesh = scene(Box(0, 1, 0, 1, 5, 4), move=distorted)
    ends = [("a.left", 500.0), ("a.right", 310.0), ("a.top", 420.0)]
    steep = run(mesh, spec([{"on": on, "temperature": at} for on, at in ends], k=STEEP, T0=400.0, method="steady"),
                1.0, 1)
    plain = run(mesh, spec([{"on": on, "temperature": float(integral(at))} for on, at in ends], k=1.0, T0=1000.0,
                           method="steady"), 1.0, 1)
    assert np.abs(integral(steep.T[-1]) - plain.T[-1]).max() < 1e-8 * integral(500.0)


@pytest.mark.parametrize("kind", KINDS)
def test_the_secant_gives_what_flows(kind):
    mesh = scene(Box(0, 1, 0, 1, 4, 3), move=distorted)
    half = load(mesh, model_of(kind, HELD))
    half.start(inputs_of(mesh, half), 0.0, FlatContact())
    sc = half._scene
    volume, s = sc.volume, 430.0 + 80.0 * np.sin(np.arange(len(mesh.nodes)))
    at, f, data = fields(sc.melting, s), np.zeros(s.size), np.zeros(sc.volume.pattern.indices.size)
    conduct(volume, shapes_of(volume, mesh.nodes), sc.model.parts, at, f, MatrixEntries(data, 1.0, secant=True))
    S = csr_matrix((data, volume.pattern.indices, volume.pattern.indptr))
    assert np.abs(S @ at.T + f).max() < 1e-12 * np.abs(f).max()
    assert np.abs((S - S.T).toarray()).max() < 1e-12 * np.abs(data).max()


@pytest.mark.parametrize("kind", ["isotropic", "solid", "liquid"])
def test_a_rod_carries_the_integral(kind):
    """In steps of 100 times the time that heat takes through it, to the steady flow."""
    mesh = scene(Box(0, L, 0, 0.01, 5))
    model = model_of(kind, HELD, method="backward_euler") | {"half": "thermal_rod"}
    half, link = load_rod(mesh, model), open_link("direct")
    inputs = inputs_of(mesh, half)
    state, _ = half.start({**inputs, "x": mesh.nodes}, 0.0, link)
    heat = []
    for i in range(8):
        done = half.step(state, inputs, 1e5 * i, 1e5, link)
        assert isinstance(done, Done), done
        heat.append(done.outputs["condition.heat.hot"])
        state = done.state
    assert (heat[-1] - heat[-2]) / 1e5 == pytest.approx(THROUGH * 0.01, rel=1e-6)
