"""The thermal rod: on rectangles whose columns share a temperature it says what the two-dimensional half says."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.half.model import Discard, Done
from contact.half.state import from_bytes, to_bytes
from contact.rpc.link import open_link
from thermal_fmu.half import load as load_plane
from thermal_fmu.stations.half import load_rod

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, imbalance, inputs_of, scene

METAL = {"rho": 7800.0, "k": 45.0, "c": 480.0}
CURVED = {"rho": 7800.0, "k": {"T": [300, 600, 900], "value": [60, 40, 30], "form": "cubic"},
          "c": {"T": [300, 600, 900], "value": [450, 600, 800], "form": "cubic"}}
MELT = {"rho": 2500.0, "k": {"solid": 210.0, "liquid": 95.0}, "c": {"solid": 1100.0, "liquid": 1180.0},
        "latent": {"L": 3.97e5, "T_s": 931.0, "T_l": 933.0}}
PAIR = {"p": {"conduction": {"closed": {"law": "power", "h0": 500.0, "h1": 900.0, "p0": 1e6, "exponent": 0.95},
                             "open": {"law": "gas", "k_g": 0.06, "g_m": 3e-5}},
                             "radiation": {"emissivity_slave": 0.4, "emissivity_master": 0.8, "gap": None}}}
ROUND = [{"on": "a.left", "flux": {"t": [0, 10, 10], "value": [1e5, 2e5, 0]}, "name": "q"},
         {"on": "a.left", "convection": {"h": 30.0, "T": 350.0, "exponent": 0.25, "gap": None}},
         {"on": "a.left", "radiation": {"emissivity": 0.7, "T": 300.0}},
         {"on": "b.left", "convection": {"h": 40.0, "T": 300.0, "gap": {"d_cut": 1e-3, "d_full": 6e-3}}},
         {"on": "b.right", "temperature": {"t": [0, 20], "value": [400, 500]}}]


def two(rows: int = 1, gap: float = 2e-3, geometry: str = "plane") -> Interface:
    """Two rods in a row along x, a and b."""
    return scene(Box(0.1, 0.15, 0, 0.01, 12, rows, x_lines=0.1 + 0.05 * np.linspace(0, 1, 13) ** 1.3),
                 Box(0.15 + gap, 0.18 + gap, 0, 0.01, 5, rows), geometry=geometry,
                 pairs=(Pair("p", "a.right", "b.left", 0.01, 0.0),))


def model(material: dict[str, Any], T0: float = 700.0, **more: Any) -> dict[str, Any]:
    return {"half": "thermal", "format": 2, "materials": {"m": material, "w": METAL},
            "bodies": {"a": {"material": "m", "T0": T0, "Q_T": 1e5}, "b": {"material": "w", "T0": 400.0}},
            "boundary": ROUND, "pairs": PAIR, **more}


def drive(load: Any, interface: Interface, spec: dict[str, Any], n: int, **given: Any) -> list[dict[str, Any]]:
    """Outputs of n steps of 1.5 s."""
    half, link = load(interface, spec), open_link("direct")
    inputs, out = inputs_of(interface, half, **given), []
    state, first = half.start({**inputs, "x": interface.nodes}, 0.0, link)
    out.append(dict(first))
    for i in range(n):
        done = half.step(state, inputs, 1.5 * i, 1.5, link)
        assert isinstance(done, Done), done
        state = done.state
        out.append(dict(done.outputs))
    return out


def same(interface: Interface, spec: dict[str, Any], n: int = 12, within: float = 1e-9, **given: Any) -> None:
    """Every output of the rod is that of the half in the plane, as a share of the largest of its name.

    Films along the sides would tell the two apart: in the plane they cool the sides more than the middle.
    """
    plane = drive(load_plane, interface, spec, n, **given)
    rod = drive(load_rod, interface, {**spec, "half": "thermal_rod"}, n, **given)
    assert all(step["across.T_off"] == 0.0 for step in rod), "nothing goes through the sides"
    for name in rod[0]:
        if name not in ("iterations", "residual", "across.T_off"):
            a, b = (np.array([step[name] for step in run]) for run in (plane, rod))
            size = max(float(np.abs(a).max()), max(abs(step["heat.stored.a"]) for step in plane)
                       if name.startswith("heat") else 0.0)
            assert np.abs(a - b).max() <= within * size, name
    assert imbalance(rod) < 1e-10


# Both integrate with two Gauss points along x; the tolerance is that of Newton's method, 1e-11 of the heat a step.
@pytest.mark.few("tables-sdirk2", "constant-midpoint", "tables-backward_euler")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("material", [METAL, CURVED], ids=["constant", "tables"])
def test_it_is_the_plane_half_on_one_row(method: str, material: dict[str, Any]) -> None:
    same(two(), model(material, method=method))


def test_theta_many_rows_and_pressure() -> None:
    n_q = two(3).pair_nodes.size
    same(two(3, 0.0), model(METAL, method="theta", theta=0.7), t_N=np.full(n_q, -2e6), load_q=0.3)


def test_around_an_axis() -> None:
    same(two(geometry="axisymmetric"), model(CURVED))


@pytest.mark.few("mush")
@pytest.mark.parametrize("T_s", [931.0, 933.0], ids=["mush", "point"])
def test_a_melting_rod(T_s: float) -> None:
    """Here the stages stop where 1e-11 of the heat is missing, and the steps of Newton's method differ in round-off."""
    same(two(), model({**MELT, "latent": {"L": 3.97e5, "T_s": T_s, "T_l": 933.0}}, T0=940.0, method="sdirk2"),
         within=1e-8)


def test_heat_of_the_other_half_and_a_mesh_that_moved() -> None:
    interface = two()
    n = len(interface.quads)
    x = interface.nodes * np.array([1.01, 1.1])
    same(interface, model(METAL), x=x, E_M=np.linspace(0, 500, n), E_S=np.linspace(300, 0, n),
         **{"contact.E_friction": np.full(interface.pair_nodes.size, 50.0)})


def test_a_fin() -> None:
    """Film on the long sides: T - T_e = (T_b - T_e) cosh(m (L - x))/cosh(m L), m2 = 2 h/(k H)."""
    interface = scene(Box(0, 0.1, 0, 0.002, 100))
    sides = [{"on": f"a.{side}", "convection": {"h": 50.0, "T": 300.0}} for side in ("top", "bottom")]
    spec = {"half": "thermal_rod", "format": 2, "materials": {"m": METAL}, "method": "backward_euler",
            "bodies": {"a": {"material": "m", "T0": 300.0}},
            "boundary": [*sides, {"on": "a.left", "temperature": 400.0}]}
    half, link = load_rod(interface, spec), open_link("direct")
    inputs = inputs_of(interface, half)
    state, _ = half.start(inputs, 0.0, link)
    done = half.step(state, inputs, 0.0, 1e9, link)
    x, m = interface.nodes[:, 0], np.sqrt(2 * 50.0 / (45.0 * 0.002))
    T = done.outputs["T"]
    # Linear elements: the error of a fin is about (m dx)^2/12 = 1e-4 of its curvature's share.
    assert pytest.approx(300 + 100 * np.cosh(m * (0.1 - x)) / np.cosh(m * 0.1), abs=0.01) == T


def test_a_freezing_rod_in_one_step() -> None:
    """All of it, 80 times the latent heat a fine step would take: by the detour."""
    interface = scene(Box(0, 0.02, 0, 0.01, 40))
    boundary = [{"on": "a.right", "temperature": 600.0}]
    spec = {"half": "thermal_rod", "format": 2, "materials": {"m": MELT}, "boundary": boundary,
            "method": "backward_euler", "bodies": {"a": {"material": "m", "T0": 940.0}}}
    half, link = load_rod(interface, spec), open_link("direct")
    inputs = inputs_of(interface, half)
    state, _ = half.start(inputs, 0.0, link)
    done = half.step(state, inputs, 0.0, 1e5, link)
    assert isinstance(done, Done), done
    assert done.outputs["T"] == pytest.approx(600.0, abs=0.2)
    assert imbalance([dict(done.outputs)]) < 1e-10


def test_a_prescribed_ramp_is_no_change_that_is_watched() -> None:
    """Of a quick ramp at one end max_dT is the largest change of the other nodes."""
    interface = two()
    ramp = [{"on": "a.left", "temperature": {"t": [0, 6], "value": [700, 1100]}}]
    told = drive(load_rod, interface, {**model(METAL, boundary=ramp), "half": "thermal_rod"}, 4)
    change = np.abs(np.diff([step["T"] for step in told], axis=0))
    hot = np.unique(interface.surfaces["a.left"])
    assert change[:, hot] == pytest.approx(100.0)
    assert [step["max_dT"] for step in told[1:]] == pytest.approx(np.delete(change, hot, axis=1).max(axis=1))
    assert 0.0 < max(step["max_dT"] for step in told) < 99.0


def test_a_restored_rod_gives_the_same_bits() -> None:
    interface = two()
    spec = {**model(MELT, T0=940.0), "half": "thermal_rod"}
    half, link = load_rod(interface, spec), open_link("direct")
    inputs = inputs_of(interface, half)
    state, _ = half.start(inputs, 0.0, link)
    state = half.step(state, inputs, 0.0, 2.0, link).state
    hot = half.step(state, inputs, 2.0, 2.0, link)
    cold = load_rod(interface, spec).step(from_bytes(to_bytes(state), ("thermal_fmu",)), inputs, 2.0, 2.0, link)
    for name, value in hot.outputs.items():
        assert np.array_equal(value, cold.outputs[name]), name


def test_a_rod_in_a_row_is_tridiagonal() -> None:
    half = load_rod(two(3), {**model(METAL), "half": "thermal_rod"})
    assert half._scene.stations.width == 1
    assert half._scene.stations.n == 13 + 6


@pytest.mark.parametrize(("change", "words"), [
    ({"adaptive": {"max_dT": 1.0}}, "adaptive"),
    ({"method": "steady"}, "no method 'steady'"),
    ({"boundary": [{"on": "b.right", "temperature": {"terms": [{"x": {"polynomial": [1, 2]}}]}}]},
     "depend on time alone"),
    ({"half": "thermal"}, "is not thermal_rod"),
])
def test_refusals(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        load_rod(two(), {**model(METAL), "half": "thermal_rod", **change})


def test_what_is_no_rod_is_refused() -> None:
    slanted = scene(Box(0, 1, 0, 1, 2, 2), move=lambda X: X @ np.array([[1.0, 0.0], [0.3, 1.0]]))
    spec = {"half": "thermal_rod", "format": 2, "materials": {"m": METAL}, "bodies": {"a": {"material": "m", "T0": 1}}}
    with pytest.raises(ValueError, match="no rod along x"):
        load_rod(slanted, spec)
    flat = scene(Box(0, 1, 0, 1, 2, 1))
    with pytest.raises(ValueError, match="belongs to no cell"):
        load_rod(replace(flat, nodes=np.vstack([flat.nodes, [[5.0, 5.0]]])), spec)


def test_coordinates_that_turn_it_inside_out_are_discarded() -> None:
    interface = two()
    half, link = load_rod(interface, {**model(METAL), "half": "thermal_rod"}), open_link("direct")
    inputs = inputs_of(interface, half)
    state, _ = half.start(inputs, 0.0, link)
    x = interface.nodes.copy()
    x[interface.node_body == 0, 0] *= -1.0
    done = half.step(state, {**inputs, "x": x}, 0.0, 1.0, link)
    assert isinstance(done, Discard)
    assert "inside out" in done.message
