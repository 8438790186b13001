"""Heat through each named condition: exact in closed forms, and adding up to what the bodies stored in any scene."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, inputs_of, run, scene, spec

from contact.half.interface import Pair
from contact.half.model import Done
from contact.half.state import from_bytes, to_bytes
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu.conditions import HeatSoFar, no_heat_yet
from thermal_fmu.half import load
from thermal_fmu.stations.half import load_rod

HEAT = "condition.heat."
NAMED = [
    {"on": "a.left", "temperature": {"t": [0, 3, 3, 9], "value": [300, 420, 500, 380]}, "name": "wall"},
    {"on": "a.bottom", "temperature": 350.0, "name": "floor"},
    {"on": "a.right", "convection": {"h": 200.0, "T": 280.0}, "name": "flux"},
    {"on": "a.top", "radiation": {"emissivity": 0.8, "T": 900.0}, "name": "glow"},
    {"on": "a.right", "flux": {"t": [0, 2, 9], "value": [2e4, -1e4, 3e4]}, "name": "lamp"},
]
STEEL = {"k": 45.0, "c": {"T": [250.0, 600.0], "value": [450.0, 620.0]}, "rho": 7800.0, "T0": 300.0}


def heats(outputs: dict[str, Any]) -> dict[str, np.ndarray]:
    """Name -> heat since the start [J], two of a pair."""
    return {n.removeprefix(HEAT): np.atleast_1d(v) for n, v in outputs.items() if n.startswith(HEAT)}


def terms(outputs: list[dict[str, Any]], *prefixes: str) -> float:
    """Heat by mechanism over all steps [J]."""
    return float(sum(v for o in outputs for n, v in o.items() if n.startswith(tuple(f"heat.{p}" for p in prefixes))))


def moved(outputs: list[dict[str, Any]]) -> float:
    """Sum of the sizes of all heats [J]."""
    return float(sum(abs(v) for o in outputs for n, v in o.items() if n.startswith("heat.")))


def strip(n: int, boundary: list[dict[str, Any]], k: Any = 2.0) -> Any:
    """A parallelogram of 1.0 by 0.3 m whose ends lean by 0.4, steady: its only step."""
    def skew(X):
        return np.stack([X[:, 0] + 0.4 * X[:, 1], X[:, 1]], axis=1)

    mesh = scene(Box(0, 1.0, 0, 0.3, 4 * n, 2 * n), move=skew)
    return run(mesh, spec(boundary, k=k, T0=300.0, method="steady"), 1.0, 1).outputs[-1]


@pytest.mark.fast
def test_a_skew_strip_tells_the_heat_that_flows():
    """k = 10 and 1 along slanted axes: near corners heat flows in and out; what the one end takes the other gives."""
    hot = []
    for n in (3, 6, 12):
        ends = [{"on": "a.left", "temperature": 400.0, "name": "hot"},
                {"on": "a.right", "temperature": 300.0, "name": "cold"}]
        out = strip(n, ends, {"k_1": 10.0, "k_2": 1.0, "angle": -1.0})
        told = heats(out)
        hot.append(float(told["hot"][0]))
        assert told["hot"][0] == pytest.approx(-float(told["cold"][0]), rel=1e-12)
        assert n > 3 or out["heat.temperature.in"] > 1.05 * hot[-1]  # summed over nodes that take heat: another number
    assert abs(hot[2] - hot[1]) < 0.5 * abs(hot[1] - hot[0]) < 0.04 * hot[2]


@pytest.mark.fast
def test_a_linear_field_gives_the_exact_heat():
    """T = 400 - 100 x on both leaning ends: k 100 K/m over a height of 0.3 m, to round-off."""
    field = {"terms": [{"t": 400.0}, {"t": -100.0, "x": {"at": [0.0, 2.0], "value": [0.0, 2.0]}}]}
    told = heats(strip(4, [{"on": "a.left", "temperature": field, "name": "hot"},
                           {"on": "a.right", "temperature": field, "name": "cold"}]))
    assert told["hot"][0] == pytest.approx(60.0, rel=1e-11)
    assert told["cold"][0] == pytest.approx(-60.0, rel=1e-11)


@pytest.mark.few("sdirk2", "backward_euler")
@pytest.mark.fast
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler", "theta"])
def test_the_conditions_add_up_to_the_stored_heat(method):
    """Every kind at once, nodes of two conditions, jumps, c(T): to 1e-9 of what moved, and by mechanism to 1e-12."""
    more = {"theta": 0.7} if method == "theta" else {}
    mesh = scene(Box(0, 0.02, 0, 0.01, 8, 5))
    model = spec(NAMED, **STEEL, method=method, **more)
    model["bodies"]["a"]["Q_T"] = 3e6
    ran = run(mesh, model, 0.5, 18)
    told = {n: float(v[0]) for n, v in heats(ran.outputs[-1]).items()}
    assert set(told) == {"wall", "floor", "flux", "glow", "lamp", "source.a"}
    scale = moved(ran.outputs)
    assert sum(told.values()) == pytest.approx(terms(ran.outputs, "stored."), abs=1e-9 * scale)
    for names, mechanism in ((("wall", "floor"), "temperature"), (("flux",), "convection"), (("glow",), "radiation"),
                             (("lamp",), "flux"), (("source.a",), "source")):
        assert sum(told[n] for n in names) == pytest.approx(terms(ran.outputs, mechanism), abs=1e-12 * scale), names


@pytest.mark.fast
def test_an_adaptive_substep_tells_all_its_inner_steps():
    mesh = scene(Box(0, 0.02, 0, 0.01, 8, 5))
    ran = run(mesh, spec(NAMED, **STEEL, adaptive={"tolerance": 0.05}), 3.0, 3)
    assert ran.outputs[0]["substeps"] > 3
    scale = moved(ran.outputs)
    assert sum(float(v[0]) for v in heats(ran.outputs[-1]).values()) == pytest.approx(
        terms(ran.outputs, "stored."), abs=1e-9 * scale)


@pytest.mark.fast
def test_a_node_of_two_conditions_is_the_later_ones():
    """A corner has the later temperature, and the later condition has its heat: 800 J against 200 J."""
    mesh = scene(Box(0, 1.0, 0, 1.0, 1, 1))
    sides = [{"on": "a.left", "temperature": 400.0, "name": "left"},
             {"on": "a.bottom", "temperature": 800.0, "name": "bottom"}]
    ran = run(mesh, spec([*sides, {"on": "a.top", "flux": 0.0, "name": "none"}], k=1e-9, c=1.0, T0=300.0,
                         method="backward_euler"), 1.0, 1)
    told = heats(ran.outputs[-1])
    # A quarter of the body's capacity of 1 J/K at every node: two corners below rise by 500 K, one by 100 K.
    assert told["bottom"][0] == pytest.approx(2 * 0.25 * 500.0, rel=1e-6)
    assert told["left"][0] == pytest.approx(0.25 * 100.0, rel=1e-6)
    assert told["none"][0] == 0.0


@pytest.mark.fast
def test_films_of_a_cylinder_over_the_full_turn():
    """Between films inside and outside: 2 pi L dT/(1/(h_i r_i) + ln(r_o/r_i)/k + 1/(h_o r_o)) for 1 s, in and out."""
    r_i, r_o, L, k, h_i, h_o = 0.05, 0.08, 0.1, 15.0, 300.0, 40.0
    mesh = scene(Box(r_i, r_o, 0, L, 60, 2), geometry="axisymmetric")
    ran = run(mesh, spec([{"on": "a.left", "convection": {"h": h_i, "T": 500.0}, "name": "gas"},
                          {"on": "a.right", "convection": {"h": h_o, "T": 300.0}, "name": "air"}],
                         k=k, T0=400.0, method="steady"), 1.0, 1)
    exact = 2 * np.pi * L * 200.0 / (1 / (h_i * r_i) + np.log(r_o / r_i) / k + 1 / (h_o * r_o))
    told = heats(ran.outputs[-1])
    assert told["gas"][0] == pytest.approx(exact, rel=2e-5)
    assert told["air"][0] == pytest.approx(-float(told["gas"][0]), rel=1e-9)


@pytest.mark.fast
def test_either_side_of_each_pair_and_every_body_add_up():
    """Three bars, friction in one pair, near radiation in the other: each body stores what its own conditions gave."""
    bars = (Box(0, 0.01, 0, 0.02, 4, 5), Box(0, 0.01, 0.02, 0.03, 3, 4), Box(0, 0.01, 0.031, 0.04, 5, 4))
    pairs = (Pair("shoe", "b.bottom", "a.top", 0.1, 1e9), Pair("roof", "c.bottom", "b.top", 0.1, 1e9))
    mesh = scene(*bars, pairs=pairs, names=("a", "b", "c"))
    shoe_laws = {"closed": {"law": "constant", "h": 2e3}, "open": {"law": "constant", "h": 0.0}}
    model = spec([{"on": "a.bottom", "temperature": 300.0, "name": "shoe"},
                  {"on": "c.top", "convection": {"h": 500.0, "T": 900.0}, "name": "roof"}],
                 **STEEL, pairs={"shoe": {"conduction": shoe_laws},
                                 "roof": {"radiation": {"emissivity_slave": 0.9, "emissivity_master": 0.7}}})
    model["bodies"] = {n: {"material": "m", "T0": T} for n, T in (("a", 300.0), ("b", 420.0), ("c", 800.0))}
    E = np.zeros(len(mesh.nodes))
    E[np.unique(mesh.surfaces["b.bottom"])] = 7.0
    t_N = np.zeros(len(mesh.nodes))
    t_N[np.unique(mesh.surfaces["b.bottom"])] = -1e6
    given = {"t_N": t_N[mesh.contact_nodes], "contact.E_friction": E[mesh.contact_nodes]}
    ran = run(mesh, model, 1.0, 6, link=DirectLink(ContactService().handle), **given)
    told, scale = heats(ran.outputs[-1]), moved(ran.outputs)
    shoe, roof = told["pair.shoe"], told["pair.roof"]
    assert sum(shoe) == pytest.approx(6 * E.sum(), rel=1e-12)
    assert sum(roof) == pytest.approx(0.0, abs=1e-12 * scale)
    assert abs(roof[0]) > 1.0
    for body, gave in (("a", shoe[1] + told["shoe"][0]), ("b", shoe[0] + roof[1]), ("c", roof[0] + told["roof"][0])):
        assert gave == pytest.approx(terms(ran.outputs, f"stored.{body}"), abs=1e-9 * scale), body


@pytest.mark.fast
def test_rods_tell_it_too():
    mesh = scene(Box(0, 0.02, 0, 0.01, 8, 2))
    model = spec([NAMED[0], NAMED[2]], k=45.0, c=500.0, rho=7800.0, T0=300.0) | {"half": "thermal_rod"}
    half = load_rod(mesh, model)
    given = inputs_of(mesh, half)  # type: ignore[arg-type]
    state, first = half.start(given, 0.0, DirectLink(ContactService().handle))
    assert first["condition.heat.wall"] == 0.0
    stored = 0.0
    for n in range(8):
        done = half.step(state, given, float(n), 1.0, DirectLink(ContactService().handle))
        assert isinstance(done, Done)
        state, stored = done.state, stored + done.outputs["heat.stored.a"]
    told = heats(done.outputs)
    assert told["wall"][0] + told["flux"][0] == pytest.approx(stored, abs=1e-9 * abs(told["wall"][0]))
    assert abs(told["flux"][0]) > 1.0


@pytest.mark.fast
def test_it_travels_with_the_state():
    """A state restored from its bytes goes on with the heat so far; a step taken again counts once."""
    mesh = scene(Box(0, 0.02, 0, 0.01, 4, 3))
    half, link = load(mesh, spec(NAMED, **STEEL)), DirectLink(ContactService().handle)
    given = inputs_of(mesh, half)
    state, _ = half.start(given, 0.0, link)
    first = half.step(state, given, 0.0, 1.0, link)
    again = half.step(state, given, 0.0, 1.0, link)
    assert isinstance(first, Done)
    assert isinstance(again, Done)
    assert again.outputs["condition.heat.wall"] == first.outputs["condition.heat.wall"]
    restored = from_bytes(to_bytes(first.state), ("thermal_fmu",))
    a, b = (half.step(s, given, 1.0, 1.0, link) for s in (first.state, restored))
    assert isinstance(a, Done)
    assert isinstance(b, Done)
    assert b.outputs["condition.heat.wall"] == a.outputs["condition.heat.wall"]


@pytest.mark.fast
def test_many_small_heats_add_up_exactly():
    so_far: HeatSoFar = no_heat_yet(2).plus(np.array([1e6, 0.0]))
    for _ in range(10_000):
        so_far = so_far.plus(np.array([0.1 + 1e-12, 1e-3]))
    assert so_far.total + so_far.lost == pytest.approx([1e6 + 1000.00000001, 10.0], rel=2e-16)
