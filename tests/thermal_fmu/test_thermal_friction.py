"""Friction heat shared between the sides of a pair (D10), and no joule lost between curved surfaces (D3)."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, imbalance, inputs_of, run, scene, spec

from contact.half.interface import Pair
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu.half import contact_at, load
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.scene import freeze, with_friction

STEEL = {"rho": 7800.0, "k": 45.0, "c": 480.0}
ALUMINIUM = {"rho": 2700.0, "k": 210.0, "c": 900.0}
PAIRS = (Pair("p", "b.bottom", "a.top", 0.1, 1e9),)
SLIDING = 0.3 * 1e6 * 0.5  # mu p v [W/m2]


def service():
    return DirectLink(ContactService().handle)


def two_metals(pair=None, T0=300.0, boundary=(), **more):
    """Aluminium a below, steel b above it: b is the slave."""
    return spec(list(boundary), **more) | {
        "materials": {"al": ALUMINIUM, "st": STEEL}, "pairs": {"p": pair or {}},
        "bodies": {"a": {"material": "al", "T0": T0}, "b": {"material": "st", "T0": T0}}}


def on_slave(mesh, Q):
    """(n_q,) energies on the slave's nodes, Q [J/m2], by their areas (edges along x)."""
    E = np.zeros(len(mesh.nodes))
    for i, j in mesh.surfaces["b.bottom"]:
        E[[i, j]] += 0.5 * Q * abs(mesh.nodes[i, 0] - mesh.nodes[j, 0])
    return E[mesh.pair_nodes]


def test_d10_two_half_spaces_that_slide():
    """Bars of .4 and .2 m, graded to .014 mm at the interface, dt grown by 6 %: surface temperatures within 5e-4."""
    case = EXPECTED["D10"]
    def graded(X):
        s = (X[:, 1] - 0.4) / np.where(X[:, 1] > 0.4, 0.2, 0.4)
        return np.stack([X[:, 0], 0.4 + np.where(X[:, 1] > 0.4, 0.2, 0.4) * s * abs(s)], axis=1)
    mesh = scene(Box(0, 0.01, 0, 0.4, 1, 170), Box(0, 0.01, 0.4, 0.6, 1, 170), pairs=PAIRS, move=graded)
    half, link = load(mesh, two_metals()), service()
    for t_end, dT in zip(case["t"], case["dT"], strict=True):
        given = inputs_of(mesh, half, t_N=np.full(len(mesh.pair_nodes), -1e6))
        state, _ = half.start(given, 0.0, link)
        steps = 1.06 ** np.arange(80)
        t, made = 0.0, []
        for h in steps * t_end / steps.sum():
            done = half.step(state, given | {"contact.E_friction": on_slave(mesh, SLIDING * h)}, t, float(h), link)
            state, t = done.state, t + float(h)
            made.append([done.outputs[f"heat.friction.{side}"] for side in ("slave", "master")])
        T = done.outputs["T"]
        for surface in ("a.top", "b.bottom"):
            assert np.abs((T[np.unique(mesh.surfaces[surface])] - 300.0) / dT - 1.0).max() < 5e-4
        slave, master = np.sum(made, axis=0)
        assert abs(slave / (slave + master) - case["share"]) < 1e-7
        assert abs((slave + master) / (0.01 * SLIDING * t_end) - 1.0) < 1e-12


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_a_given_share(share):
    mesh = scene(Box(0, 0.1, 0, 0.1, 3, 3), Box(0, 0.1, 0.1, 0.2, 4, 3), pairs=PAIRS)
    given = {"contact.E_friction": on_slave(mesh, 50.0), "t_N": np.full(len(mesh.pair_nodes), -1e6)}
    out = run(mesh, two_metals({"friction": {"share": share}}), 2.0, 1, service(), **given).outputs[-1]
    assert abs(out["heat.friction.slave"] - share * 5.0) < 1e-13 * 5.0
    assert abs(out["heat.friction.master"] - (1.0 - share) * 5.0) < 1e-13 * 5.0


def test_effusivities_at_the_temperature_of_the_start():
    """k of the slave quarters from 300 K to 400 K: sqrt(k rho c) halves, and with equal rest its share is 1/3."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 3, 1), Box(0, 0.1, 0.1, 0.2, 4, 1), pairs=PAIRS)
    model = two_metals()
    model["materials"]["st"] = ALUMINIUM | {"k": {"T": [300.0, 400.0], "value": [210.0, 52.5]}}
    given = {"contact.E_friction": on_slave(mesh, 50.0), "t_N": np.full(len(mesh.pair_nodes), -1e6)}
    for T0, share in ((300.0, 0.5), (400.0, 1.0 / 3.0)):
        model["bodies"] = {b: m | {"T0": T0} for b, m in model["bodies"].items()}
        out = run(mesh, model, 1e-3, 1, service(), **given).outputs[-1]
        assert abs(out["heat.friction.slave"] / 5.0 - share) < 1e-13


def test_even_rubbing_heats_both_faces_evenly():
    """3 against 4 edges: an even heat per area of the slave is one of the master too, by its shape functions."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 3, 1), Box(0, 0.1, 0.1, 0.2, 4, 1), pairs=PAIRS)
    half, link = load(mesh, two_metals({"friction": {"share": 0.25}})), service()
    given = inputs_of(mesh, half)
    half.start(given, 0.0, link)
    sc = half._scene
    points = contact_at(sc.surfaces, mesh.nodes, given, link)
    held = freeze(sc, sc.masses(mesh.nodes), mesh.nodes, np.zeros(len(mesh.quads)), points)
    made = with_friction(held, sc, points, on_slave(mesh, 60.0), NodalFields(np.full(len(mesh.nodes), 300.0)),
                         2.0).friction
    for power, surface, q in ((made.slave, "b.bottom", 7.5), (made.master, "a.top", 22.5)):
        edges = mesh.surfaces[surface]
        area = np.bincount(edges.ravel(), np.full(edges.size, 0.05 / len(edges)), len(mesh.nodes))
        assert np.abs(power - q * area).max() < 1e-13


def curved(geometry, lift=0.0):
    """Two bodies with curved faces, 7 against 10 edges, b to the right of a by a third and lifted by a varying gap."""
    def bend(X):
        y = X[:, 1] + np.where(X[:, 1] > 0.1501, lift, 0.0) * (1.0 + 20.0 * (X[:, 0] - 0.05))
        return np.stack([X[:, 0], y + 0.8 * (X[:, 0] - 0.09) ** 2], axis=1)
    return scene(Box(0.05, 0.15, 0.05, 0.15, 7, 4), Box(0.083, 0.183, 0.1502, 0.25, 10, 4), geometry=geometry,
                 pairs=PAIRS, move=bend)


LAWS = {"conduction": {"closed": {"law": "constant", "h": 3000.0}, "open": {"law": "gas", "k_g": 0.05, "g_m": 2e-5}},
        "radiation": {"emissivity_slave": 0.5, "emissivity_master": {"polynomial": [0.2, 5e-4]},
                      "gap": {"d_near": 1e-4, "d_far": 1e-3}}}


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_d3_no_joule_is_lost_between_curved_surfaces(geometry):
    """Partly overlapping, partly touching, radiating and rubbing: each side of every mechanism to 1e-13."""
    mesh = curved(geometry, lift=2e-4)
    rng = np.random.default_rng(3)
    nodes = mesh.pair_nodes
    E = rng.uniform(0.5, 1.5, nodes.size)  # on nodes of both sides, also where nothing is faced
    t_N = np.where(mesh.nodes[nodes, 0] < 0.11, -1e6, 0.0)
    far = [{"on": s, "radiation": {"emissivity": 0.7, "T": 300.0, "gap": {"d_near": 1e-4, "d_far": 1e-3}}}
           for s in ("a.top", "b.bottom")]
    model = two_metals(LAWS, boundary=far)
    model["bodies"]["b"]["T0"] = 700.0
    ran = run(mesh, model, 0.5, 4, service(), t_N=t_N, **{"contact.E_friction": E})
    for out in ran.outputs:
        for mechanism in ("contact", "gap", "near_radiation"):
            slave, master = out[f"heat.{mechanism}.slave"], out[f"heat.{mechanism}.master"]
            assert slave < 0
            assert abs(slave + master) < EXPECTED["D3"]["tolerance"] * abs(slave)
        with_friction = out["heat.friction.slave"] + out["heat.friction.master"]
        assert abs(with_friction / E.sum() - 1.0) < EXPECTED["D3"]["tolerance"]
        assert out["heat.radiation"] < 0
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "theta"])
def test_a16_with_every_term_of_the_surface(method):
    """Curved faces that slide and open, radiating near and far, rubbing, heated inside by place and temperature."""
    mesh = curved("axisymmetric", lift=2e-4)
    hot = {"terms": [{"t": {"t": [0, 3], "value": [1e6, 3e6]}, "x": {"polynomial": [1.0, 5.0]}}]}
    film = {"on": "b.right", "convection": {"h": {"terms": [{"y": {"at": [0.1, 0.2], "value": [50, 90]}}]}, "T": 350.0,
                                            "exponent": 0.25, "h_factor": {"T": [300, 900], "value": [1.0, 2.0]}}}
    far = [{"on": s, "radiation": {"emissivity": {"T": [300, 900], "value": [0.3, 0.8]}, "T": 300.0,
                                   "gap": {"d_near": 1e-4, "d_far": 1e-3}}} for s in ("a.top", "b.bottom")]
    model = two_metals(LAWS, boundary=[film, *far], method=method) | ({"theta": 0.7} if method == "theta" else {})
    model["bodies"]["b"] |= {"T0": 700.0, "Q_T": hot, "Q_T_factor": {"T": [300, 900], "value": [1.0, 0.2]}}
    half, link = load(mesh, model), service()
    given = inputs_of(mesh, half, **{"contact.E_friction": np.full(len(mesh.pair_nodes), 40.0)})
    state, _ = half.start(given, 0.0, link)
    outputs = []
    for i in range(6):
        x = mesh.nodes + np.where(mesh.node_body == 1, 0.003 * i, 0.0)[:, None] * np.array([1.0, 0.03])
        t_N = np.full(len(mesh.pair_nodes), -1e6 if i % 2 else 0.0)
        done = half.step(state, given | {"x": x, "contact.t_N": t_N}, 0.5 * i, 0.5, link)
        state = done.state
        outputs.append(dict(done.outputs))
        assert imbalance(outputs[-1:]) < EXPECTED["A16"]["tolerance"]
    assert imbalance(outputs) < EXPECTED["A16"]["tolerance"]
    some = {k for o in outputs for k, v in o.items() if k.startswith("heat.") and v != 0.0}
    assert {"heat.radiation", "heat.near_radiation.slave", "heat.friction.master", "heat.source", "heat.gap.slave",
            "heat.contact.slave", "heat.convection"} <= some


def test_who_takes_what_faces_nothing():
    """b hangs over by half: its free nodes keep their joules; a node that only serves as master keeps them too."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 4, 2), Box(0.05, 0.15, 0.1, 0.2, 4, 2), pairs=PAIRS)
    x, s = mesh.nodes[mesh.pair_nodes, 0], np.isin(mesh.pair_nodes, mesh.surfaces["b.bottom"])
    given = {"t_N": np.full(len(mesh.pair_nodes), -1e6)}
    for where, slave in ((s & (x > 0.13), 1.0), (~s, 0.0), (s & (x < 0.09), EXPECTED["D10"]["share"])):
        E = np.where(where, 2.0, 0.0)
        out = run(mesh, two_metals(), 1.0, 1, service(), **given, **{"contact.E_friction": E}).outputs[-1]
        assert abs(out["heat.friction.slave"] / E.sum() - slave) < 1e-7
        assert abs((out["heat.friction.slave"] + out["heat.friction.master"]) / E.sum() - 1.0) < 1e-13


@pytest.mark.parametrize("share", [0.25, None], ids=["given", "effusivities"])
def test_two_passes_keep_the_sides_of_their_pair(share):
    """What the second pass finds from the master still radiates, takes its share and is told as the pair says."""
    once, twice = (
        scene(Box(0, 0.1, 0, 0.1, 3, 2), Box(0, 0.1, 0.1, 0.2, 4, 2), pairs=(replace(PAIRS[0], two_pass=two),))
        for two in (False, True))
    pair = LAWS | {"radiation": {
        "emissivity_slave": {"polynomial": [0.1, 5e-4]}, "emissivity_master": {"polynomial": [0.9, -5e-4]}},
        "friction": {"share": share}}
    film = [{"on": s, "convection": {"h": 40.0, "T": 300.0, "gap": {"d_cut": 0.0, "d_full": 1e-3}}}
            for s in ("a.top", "b.bottom")]
    model = two_metals(pair, boundary=film)
    model["bodies"]["b"]["T0"] = 700.0
    E = on_slave(once, 50.0)
    # Half of what the slave's nodes carry once is carried by the master's in a second pass.
    on_master = np.zeros(len(once.nodes))
    for i, j in once.surfaces["a.top"]:
        on_master[[i, j]] += 25.0 * abs(once.nodes[i, 0] - once.nodes[j, 0]) * 0.5
    halves = 0.5 * E + on_master[once.pair_nodes]
    for p in (0.0, 1e6):
        one, two = (run(mesh, model, 1.0, 1, service(), t_N=np.full(E.size, -p), **{"contact.E_friction": given})
                    for mesh, given in ((once, E), (twice, halves)))
        heats = {k: v for k, v in one.outputs[-1].items() if k.startswith("heat.")}
        size = max(map(abs, heats.values()))
        for name, J in heats.items():
            assert abs(two.outputs[-1][name] - J) < 1e-12 * size, name
        assert np.abs(two.T - one.T).max() < 1e-9


def test_a_body_warms_where_it_is_rubbed():
    """All to the slave, nothing conducts: the joules are in the cells along its face."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 2, 2), Box(0, 0.1, 0.1, 0.2, 2, 2), pairs=PAIRS)
    model = two_metals({"friction": {"share": 1.0}})
    ran = run(mesh, model, 1e-6, 1, service(), t_N=np.full(len(mesh.pair_nodes), -1e6),
              **{"contact.E_friction": on_slave(mesh, 1000.0)})
    T = ran.T[-1]
    assert (T[np.unique(mesh.surfaces["b.bottom"])] > 300.0).all()
    assert np.abs(T[mesh.node_body == 0] - 300.0).max() < 1e-9


@pytest.mark.parametrize("share", [-0.1, 1.5, float("nan"), "half"])
def test_a_share_outside_0_to_1_is_refused(share):
    with pytest.raises(ValueError, match=r"pairs\.p\.friction\.share: "):
        load(curved("plane"), two_metals({"friction": {"share": share}}))


@pytest.mark.parametrize("p", [0.0, 1e6])
def test_a_surface_that_folds_is_as_two(p):
    """Both faces as one surface that meets itself: the same temperatures, and half of the friction heat a side."""
    apart = scene(Box(0, 0.1, 0, 0.1, 3, 2), Box(0.02, 0.12, 0.1005, 0.2, 4, 2), pairs=PAIRS)
    both = np.concatenate([apart.surfaces["b.bottom"], apart.surfaces["a.top"]])
    folded = replace(apart, surfaces=dict(apart.surfaces) | {"a.all": both},
                     pairs=(replace(PAIRS[0], slave="a.all", master="a.all"),))
    eps = {"polynomial": [0.1, 5e-4]}
    pair = LAWS | {"radiation": {"emissivity_slave": eps, "emissivity_master": eps}, "friction": {"share": 0.5}}
    found = []
    for mesh, surfaces in ((apart, ("a.top", "b.bottom")), (folded, ("a.all",))):
        film = [{"on": s, "convection": {"h": 40.0, "T": 300.0,
                                         "gap": {"d_cut": 0.0, "d_full": 1e-3}}} for s in surfaces]
        model = two_metals(pair, boundary=film)
        model["bodies"]["b"]["T0"] = 700.0
        # Only the faces of b carry heat; where they face nothing they keep it.
        E = np.where(mesh.node_body[mesh.pair_nodes] == 1, 3.0, 0.0)
        found.append(run(mesh, model, 1.0, 1, service(), t_N=np.full(E.size, -p), **{"contact.E_friction": E}))
    assert np.abs(found[0].T - found[1].T).max() < 1e-9
    assert found[1].imbalance() < EXPECTED["A16"]["tolerance"]
    assert abs(found[1].outputs[0]["heat.convection"] / found[0].outputs[0]["heat.convection"] - 1.0) < 1e-12
