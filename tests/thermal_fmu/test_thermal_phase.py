"""Melting and freezing: the Stefan problem (A9), enthalpy whatever the step, moving meshes (A16), wrong materials."""

from __future__ import annotations

import copy
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, imbalance, inputs_of, run, scene, spec

from contact.half.functions import property_from
from contact.half.interface import Pair
from contact.half.model import Done
from thermal_fmu.half import load
from thermal_fmu.phase_change import PhaseChange, blend
from thermal_fmu.problem import parse_material

ALUMINIUM = {"k": {"solid": 210.0, "liquid": 95.0}, "c": {"solid": 1100.0, "liquid": 1180.0}, "rho": 2500.0}
PURE = {"L": 3.97e5, "T_s": 933.0, "T_l": 933.0}
MUSHY = {"L": 3.97e5, "T_s": 931.0, "T_l": 933.0}
WIDE = {"L": 3.97e5, "T_s": 850.0, "T_l": 933.0}


def metal(boundary, latent, T0=940.0, **more):
    """A model.json of the aluminium of A9."""
    model = spec(boundary, T0=T0, **ALUMINIUM, **more)
    model["materials"]["m"]["latent"] = latent
    return model


def held_at(side, T):
    return {"on": f"a.{side}", "temperature": T}


def test_a9_two_phases():
    """200 cells of 1 mm, dt .1 s, isothermal: front -.41 % (it goes like h), q -.05 %, T(.05) within .05 K.

    The far end feels nothing yet: T there has moved by less than 1e-4 K.
    """
    case = EXPECTED["A9"]
    mesh = scene(Box(0, 0.2, 0, 0.001, 200))
    ran = run(mesh, metal([held_at("left", 293.15)], PURE, method="sdirk2"), 0.1, 100)
    x, bottom = mesh.nodes[:201, 0], np.arange(201)
    f_s = np.array([o["f_s"][bottom] for o in ran.outputs])
    front = np.trapezoid(f_s[-1], x)
    assert abs(front / case["front"] - 1.0) < case["tolerance_front"]
    assert abs(ran.T[-1, 50] - case["T_05"]) < 0.05
    assert abs(ran.T[-1, 200] - 940.0) < 1e-4
    # q_wall = q(10) sqrt(10/t): its mean over the last 2 s against what left through the wall in them, 1 mm high.
    mean = case["q_wall"] * np.sqrt(10.0) * 2.0 * (np.sqrt(10.0) - np.sqrt(8.0)) / 2.0
    left = -sum(o["heat.temperature.in"] + o["heat.temperature.out"] for o in ran.outputs[80:]) / (2.0 * 0.001)
    assert abs(left / mean - 1.0) < case["tolerance_q"]
    assert (np.diff(f_s, axis=0) > -1e-12).all()
    # The same lambda from the front at 5 s: it goes like sqrt t.
    early = np.trapezoid(f_s[49], x)
    assert abs(front / early - np.sqrt(2.0)) < 0.01
    a_s = 210.0 / (2500.0 * 1100.0)
    assert abs(front / (2.0 * np.sqrt(a_s * 10.0)) / case["lambda"] - 1.0) < 0.005


def enthalpy(mesh, T, f_s):
    """(n,) J/kg from T and f_s alone, 0 in the solid at 933 K (isothermal data of A9)."""
    solid, liquid = 1100.0 * np.minimum(T - 933.0, 0.0), 1180.0 * np.maximum(T - 933.0, 0.0)
    return solid + liquid + 3.97e5 * (1.0 - f_s)


def ring_masses(mesh, axisymmetric):
    """(n,) kg of nodes on a grid of 2 rows: the integral of rho N_i, by Simpson's rule, exact for r N_i."""
    x, n = mesh.nodes[: len(mesh.nodes) // 2, 0], len(mesh.nodes) // 2
    m = np.zeros(n)
    for a, b in zip(range(n - 1), range(1, n), strict=True):
        r = np.array([x[a], 0.5 * (x[a] + x[b]), x[b]]) * 2 * np.pi if axisymmetric else np.ones(3)
        w = (x[b] - x[a]) / 6.0 * np.array([1.0, 4.0, 1.0]) * r
        m[a] += w @ [1.0, 0.5, 0.0]
        m[b] += w @ [0.0, 0.5, 1.0]
    return 2500.0 * np.tile(m, 2) * 0.5 * np.ptp(mesh.nodes[:, 1])


@pytest.mark.few("0.3-backward_euler-plane", "30.0-midpoint-plane", "3000.0-sdirk2-axisymmetric")
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("dt", [0.3, 30.0, 3000.0])
def test_a9_no_step_loses_latent_heat(dt, method, geometry):
    """Heat through the wall = change of the enthalpy worked out from T and f_s alone; 3000 s freezes all at once."""
    mesh = scene(Box(0.05, 0.15, 0, 0.01, 20), geometry=geometry)
    half = load(mesh, metal([held_at("right", 293.15)], PURE, method=method))
    state, first = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    m, before = ring_masses(mesh, geometry == "axisymmetric"), enthalpy(mesh, first["T"], first["f_s"])
    for i in range(2):
        done = half.step(state, inputs_of(mesh, half), i * dt, dt, FlatContact())
        assert isinstance(done, Done), done
        state, out = done.state, done.outputs
        after = enthalpy(mesh, out["T"], out["f_s"])
        gained, scale = float(m @ (after - before)), float(m @ np.abs(after - before))
        if i == 0:
            through = out["heat.temperature.in"] + out["heat.temperature.out"]
            assert abs(gained - through) <= EXPECTED["A9"]["tolerance_enthalpy"] * scale
            assert abs(gained - out["heat.stored.a"]) <= EXPECTED["A9"]["tolerance_enthalpy"] * scale
            assert scale > 1e3 * float(m.sum())
        before = after
    if dt == 3000.0 and method == "backward_euler":
        assert (out["f_s"] == 1.0).all()


@pytest.mark.few("True-freezes-mushy", "True-melts-pure")
@pytest.mark.parametrize("latent", [PURE, MUSHY, WIDE], ids=["pure", "mushy", "wide"])
@pytest.mark.parametrize(("T0", "wall"), [(940.0, 293.15), (500.0, 1500.0)], ids=["freezes", "melts"])
@pytest.mark.parametrize("triangles", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_slab_that_changes_phase_in_one_step_converges(triangles, T0, wall, latent):
    """400 s at once, 40 cells of 5 mm or a triangulated square: both fronts end inside or past the slab."""
    box = Box(0, 0.2, 0, 0.1, 12, 6, triangles=True) if triangles else Box(0, 0.2, 0, 0.01, 40)
    mesh = scene(box)
    for method, dt in (("sdirk2", 400.0), ("backward_euler", 100.0)):
        model = metal([held_at("right", wall)], latent, T0=T0, method=method)
        half = load(mesh, model)
        state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
        done = half.step(state, inputs_of(mesh, half), 0.0, dt, FlatContact())
        assert isinstance(done, Done), done
        assert imbalance([dict(done.outputs)]) < EXPECTED["A16"]["tolerance"]
        low, high = sorted((T0, wall))
        assert low - 1e-6 <= done.outputs["T"].min() <= done.outputs["T"].max() <= high + 1e-6


@pytest.mark.few("plane-midpoint", "axisymmetric-sdirk2")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a16_latent_heat_on_a_moving_mesh(method, geometry):
    """A casting that freezes, axes that turn, contact and gap, a film, E_M: each step's ledger closes."""
    mesh = scene(Box(0.1, 0.2, 0, 0.1, 6, 5, triangles=True), Box(0.1, 0.2, 0.1, 0.2, 5, 4), geometry=geometry,
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 0.0),))
    skew = {"k_1": {"solid": {"polynomial": [200.0, -0.03]}, "liquid": 90.0}, "k_2": {"solid": 150.0, "liquid": 80.0},
            "angle": 0.5, "turns": True}
    model = metal([{"on": "a.bottom", "temperature": {"t": [0, 10], "value": [900, 500]}},
                   {"on": "b.top", "convection": {"h": 800, "T": 400, "exponent": 0.25}}], MUSHY, method=method,
                  pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 9000.0},
                                              "open": {"law": "gas", "k_g": 0.5, "g_m": 1e-4}}}})
    model["materials"]["m"]["k"] = skew
    model["bodies"] = {"a": {"material": "m", "T0": 936.0, "Q_T": 2e5}, "b": {"material": "m", "T0": 932.0}}
    half, link = load(mesh, model), FlatContact()
    given = inputs_of(mesh, half, E_M=np.linspace(0, 500, len(mesh.quads) + len(mesh.triangles)))
    state, _ = half.start(given, 0.0, link)
    outputs = []
    for i in range(8):
        x = mesh.nodes * np.array([1.0 + 0.02 * i, 1.0 - 0.01 * i])
        x[mesh.node_body == 1, 1] += 0.002 * (i % 3)
        t_N = np.full(len(mesh.pair_nodes), -1e6 if i % 3 == 0 else 0.0)
        done = half.step(state, given | {"x": x, "contact.t_N": t_N}, 2.0 * i, 2.0, link)
        assert isinstance(done, Done), done
        state = done.state
        outputs.append(dict(done.outputs))
        assert imbalance(outputs[-1:]) < EXPECTED["A16"]["tolerance"]
    f_s = outputs[-1]["f_s"]
    assert 0.05 < f_s.mean() < 0.95
    assert ((f_s > 0.01) & (f_s < 0.99)).any()


def test_a_casting_in_steps_of_5_s():
    """The aluminium of the can, its table data, mush of 2 K, through 2000 W/m2K to 500 K: no step fails, few solves."""
    mesh = scene(Box(0, 0.05, 0, 0.01, 20), geometry="axisymmetric")
    model = spec([{"on": "a.right", "convection": {"h": 2000.0, "T": 500.0}}], rho=2375.0, T0=940.0,
                 k={"solid": {"T": [300, 400, 600, 800, 933], "value": [237, 240, 231, 218, 211], "form": "cubic"},
                    "liquid": {"T": [933, 1000], "value": [91, 94]}},
                 c={"solid": {"T": [300, 400, 600, 800, 933], "value": [903, 951, 1034, 1146, 1180], "form": "cubic"},
                    "liquid": 1177.0},
                 method="sdirk2")
    model["materials"]["m"]["latent"] = MUSHY
    ran = run(mesh, model, 5.0, 60)
    f_s = np.array([o["f_s"] for o in ran.outputs])
    assert f_s[0].min() < 0.01
    assert f_s[-1].min() == 1.0
    assert (np.diff(f_s, axis=0) > -1e-12).all()
    # 9 solves a step in the mean; each of the two stages takes three or four.  Seven steps of 59 overshoot and are
    # taken again in four of backward Euler.
    iterations = [o["iterations"] for o in ran.outputs[1:]]
    assert max(iterations) <= 50
    assert np.mean(iterations) < 10
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]


def test_cold_and_hot_give_the_same_bits_while_freezing():
    mesh = scene(Box(0, 0.2, 0, 0.1, 24, 18))
    model = metal([held_at("right", 293.15)], PURE, method="sdirk2")
    hot = load(mesh, model)
    given = inputs_of(mesh, hot)
    state, _ = hot.start(given, 0.0, FlatContact())
    for i in range(3):
        cold, kept = load(mesh, model), copy.deepcopy(state)
        done = hot.step(state, given, 10.0 * i, 10.0, FlatContact())
        again = cold.step(kept, given, 10.0 * i, 10.0, FlatContact())
        for name, value in done.outputs.items():
            assert np.array_equal(value, again.outputs[name]), name
        state = done.state


def test_the_law_of_s_is_monotone_and_consistent():
    """T, f_s, h along s: T(s(T)) = T, slopes against differences away from kinks, paths add up, joins are tight."""
    c_s = property_from({"T": [300, 600, 933], "value": [900, 1034, 1180], "form": "cubic"})
    c_l = property_from({"polynomial": [1177.]})
    for T_s in (933.0, 931.0, 700.0):
        law = PhaseChange(3.97e5, T_s, 933.0, c_s, c_l)
        s = np.linspace(250.0, 1500.0, 2001)
        T, h = law.temperature(s), law.increase(np.full(s.size, 300.0), s)
        assert (np.diff(T) >= 0).all()
        assert (np.diff(h) > 0).all()
        assert (np.diff(law.solid_fraction(s)) <= 0).all()
        apart = T[(T_s - 1e-9 > T) | (T > 933.0 + 1e-9)]
        assert np.abs(law.temperature(law.unknown(apart)) - apart).max() < 1e-12 * 1500
        kinks = np.array([T_s, T_s + law.W, 300.0, 600.0, 933.0])
        smooth = np.abs(s[:, None] - kinks).min(axis=1) > 0.1
        e = 1e-3
        for f, slope in ((law.temperature, law.temperature_slope), (law.solid_fraction, law.solid_fraction_slope),
                         (lambda v, law=law: law.increase(np.full(v.size, 300.0), v), law.capacity)):
            found = (f(s + e) - f(s - e)) / (2 * e)
            assert np.abs(found - slope(s))[smooth].max() < 1e-5 * max(1.0, np.abs(found).max())
        whole = law.increase(s[:1], s[-1:])
        assert abs(law.increase(s[:-1], s[1:]).sum() / whole[0] - 1.0) < 1e-12
    sharp = PhaseChange(3.97e5, 933.0, 933.0, c_s, c_l)
    through = sharp.increase(np.array([933.0]), np.array([933.0 + sharp.W]))
    assert abs(through[0] - 3.97e5) < 1e-6


def test_the_mush_blends_heat_capacities_exactly():
    """Against 200 Gauss points; a table with a knot inside the mush, a polynomial beside it."""
    solid = property_from({"T": [300, 870, 900, 1200], "value": [900, 1100, 1500, 1000], "form": "cubic"})
    liquid = property_from({"polynomial": [1000.0, 0.5, 1e-3], "T_ref": 400.0})
    made = blend(solid, liquid, 850.0, 933.0)
    points, weights = np.polynomial.legendre.leggauss(60)
    total = 0.0
    for low, high in ((850.0, 870.0), (870.0, 900.0), (900.0, 933.0)):
        T = 0.5 * (high + low) + 0.5 * (high - low) * points
        phi = (T - 850.0) / 83.0
        value = (1 - phi) * solid(T) + phi * liquid(T)
        assert np.abs(made(T) / value - 1.0).max() < 1e-12
        total += 0.5 * (high - low) * weights @ value
    assert abs(made.increase(np.array(850.0), np.array(933.0)) / total - 1.0) < 1e-12


def test_a_steady_state_knows_the_two_conductivities():
    """1000 K | 600 K: by Kirchhoff the heat is 95 (1000 - 933) + 210 (933 - 600); 40 cells smear the jump of k."""
    mesh = scene(Box(0, 1, 0, 1, 40))
    model = metal([held_at("left", 1000.0), held_at("right", 600.0)], PURE, T0=950.0, method="steady")
    ran = run(mesh, model, 1.0, 1)
    q = 95.0 * 67.0 + 210.0 * 333.0
    assert np.abs(ran.outputs[-1]["q"][:, 0] / q - 1.0).max() < 0.01
    front = 95.0 * 67.0 / q
    assert abs(np.trapezoid(1.0 - ran.outputs[-1]["f_s"][:41], mesh.nodes[:41, 0]) - front) < 0.5 / 40


@pytest.mark.parametrize(("change", "told"), [
    ({"latent": None}, "solid and liquid need to know when it melts"),
    ({"latent": {"L": 0.0, "T_s": 1.0, "T_l": 2.0}}, "latent.L: must be greater than zero"),
    ({"latent": {"L": 1.0, "T_s": 3.0, "T_l": 2.0}}, "T_l (liquidus) must not be below T_s (solidus)"),
    ({"latent": {"L": 1.0, "T_s": 3.0}}, "latent heat has either `T_m`, or both `T_s` and `T_l`"),
    ({"latent": {"L": 1.0, "T_s": float("nan"), "T_l": 2.0}}, "latent.T_s: the number is not finite"),
    ({"k": {"solid": 1.0}}, "k.liquid: a required key is missing"),
    ({"k": {"solid": 1.0, "liquid": -2.0}}, "k.liquid: must be greater than zero"),
    ({"k": {"k_1": 1.0, "k_2": 2.0, "angle": float("inf"), "turns": True}}, "k.angle: the number is not finite"),
    ({"k": {"k_1": 1.0, "k_2": 2.0, "angle": 0.0, "turns": 1}}, "k.turns: true or false is needed"),
    ({"k": {"k_1": 1.0, "k_2": 0.0, "angle": 0.0, "turns": True}}, "k.k_2: must be greater than zero"),
    ({"k": {"k_1": 1.0, "angle": 0.0, "turns": True}}, "k.k_2: a required key is missing"),
    ({"c": {"polynomial": [-5.0]}}, "c is not positive at T_s"),
    ({"rho": -1.0}, "rho: must be greater than zero"),
])
def test_wrong_materials_are_told(change, told):
    good = copy.deepcopy(ALUMINIUM) | {"latent": PURE}
    parse_material("m", good)
    wrong = {key: value for key, value in (good | change).items() if value is not None}
    with pytest.raises(ValueError, match=r"materials\.m") as error:
        parse_material("m", wrong)
    assert told in str(error.value)
