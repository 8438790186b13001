"""What a mesh misses of the heat: nothing of fields it can hold, about the true error where it is too coarse."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.special import erfcx

sys.path.insert(0, str(Path(__file__).parent))
from test_thermal_anisotropy import turn
from test_thermal_phase import PURE, held_at, metal
from test_thermal_space import distorted, fixed_to
from thermal_scenes import EXPECTED, Box, FlatContact, inputs_of, order, run, scene, spec

from contact.half.interface import Pair
from contact.half.state import from_bytes, to_bytes
from thermal_fmu.half import load
from thermal_fmu.mesh_error import MissedHeat, nothing_missed


def told(ran, body="a"):
    """What the mesh of a body is told to miss [K]."""
    return float(ran.outputs[-1][f"mesh.T_missed.{body}"])


def hot(T=1.0):
    return {"on": "a.left", "temperature": T}


def film(h):
    return {"on": "a.left", "convection": {"h": h, "T": 1.0}}


FLUX = {"on": "a.left", "flux": 1.0}


def wall(how, t, n=0, steps=60, triangles=False, **more):
    """A half space of cells of 1 m at 0 K, a = 1 m2/s, k = 1 W/mK, through t seconds: by t cells of diffusion time."""
    n = n or int(8 + 6 * np.sqrt(t))
    return run(scene(Box(0, n, 0, 1, n, triangles=triangles)), spec([how], **({"method": "sdirk2"} | more)), t / steps,
               steps)


def half_space(how, t):
    """Heat taken in [J/m2] and temperature of the surface [K] (Carslaw and Jaeger, sections 2.5, 2.7 and 2.9)."""
    root = np.sqrt(t)
    if "temperature" in how:
        return 2.0 * root / np.sqrt(np.pi), 1.0
    if "flux" in how:
        return t, 2.0 * root / np.sqrt(np.pi)
    h = how["convection"]["h"]
    return (erfcx(h * root) - 1.0) / h + 2.0 * root / np.sqrt(np.pi), 1.0 - erfcx(h * root)


# Against what is known.

@pytest.mark.few("T-0.1", "flux-5.0", "Bi=100-0.1", "Bi=1-5.0", "Bi=0.1-5.0")
@pytest.mark.parametrize("t", [0.1, *(pytest.param(t, marks=pytest.mark.slow) for t in (0.3, 1.0)), 5.0])
@pytest.mark.parametrize("how", [hot(), FLUX, film(100.0), film(10.0), film(1.0), film(0.1)],
                         ids=["T", "flux", "Bi=100", "Bi=10", "Bi=1", "Bi=0.1"])
def test_a_half_space(how, t):
    """The error of the heat, or of the surface over the span, from 67 to 0.5 %: told from 0.4 to 1.9 of it."""
    ran, (Q, T) = wall(how, t), half_space(how, t)
    span = 1.0 if "flux" not in how else T
    true = max(abs(ran.outputs[-1]["heat_stored"] / Q - 1.0), abs(ran.T[-1][0] - T) / span)
    number = told(ran) / (span if "flux" not in how else np.ptp(ran.T[-1]))
    assert 0.36 * true < number < 1.95 * true


@pytest.mark.parametrize("z", [0.2, 0.4])
@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("open_to", ["convection", "radiation"])
def test_a_fin(z, triangles, open_to):
    """A thin one with z = m h to a cell: films at nodes take z z/8 too much, of which a third is missed inside.

    Radiation of 1000 K to 990 K is a film.
    """
    w = 0.1
    strength = 0.5 * w * z * z
    low = 0.0 if open_to == "convection" else 990.0
    way = {"h": strength, "T": low} if open_to == "convection" else {"emissivity": 1.0, "T": low}
    sides = [{"on": f"a.{side}", open_to: way} for side in ("top", "bottom")]
    more = {} if open_to == "convection" else {"sigma_SB": strength / (4.0 * 995.0**3)}
    n = int(8.0 / z)
    model = spec([hot(low + 10.0), *sides], method="steady", **more)
    ran = run(scene(Box(0, n, 0, w, n, triangles=triangles)), model, 1.0, 2)
    Q = float(ran.outputs[-1]["heat.temperature.in"])
    exact = w * (10.0 * z if open_to == "convection" else fin_that_radiates(z, n, low))
    assert 0.8 * (Q / exact - 1.0) < told(ran) / 10.0 < 1.2 * (Q / exact - 1.0)


def fin_that_radiates(z, n, low):
    """Heat into it [W], by a fine solution along it."""
    x = np.linspace(0.0, n, 400)
    found = solve_bvp(lambda x, y: [y[1], z * z / (4.0 * 995.0**3) * (y[0] ** 4 - low**4)],
                      lambda a, b: [a[0] - low - 10.0, b[1]], x,
                      [low + 10.0 * np.exp(-z * x), -10.0 * z * np.exp(-z * x)], tol=1e-8)
    return -float(found.y[1, 0])


@pytest.mark.few("T")
@pytest.mark.parametrize("how", [hot(), FLUX, film(1.0)], ids=["T", "flux", "Bi=1"])
def test_triangles_say_as_much(how):
    for t in (0.3, 3.0):
        assert told(wall(how, t, triangles=True)) == pytest.approx(told(wall(how, t)), rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("how", [hot(), film(10.0)], ids=["T", "Bi=10"])
def test_steps_do_not_matter_as_long_as_they_resolve_the_heat(how):
    """A jump makes flux without bound in a short step."""
    for t in (0.2, 1.0):
        numbers = [told(wall(how, t, steps=steps)) for steps in (8, 60, 1000)]
        assert max(numbers) < 1.35 * min(numbers)


@pytest.mark.parametrize("triangles", [False, True])
def test_a_ring(triangles):
    """Steady, from r = 1 to 4: the error of its heat is told up to 1.7 times, from one cell across on."""
    for n in (1, 2, 4, 8):
        mesh = scene(Box(1, 4, 0, 3 / n, n, triangles=triangles), geometry="axisymmetric")
        ran = run(mesh, spec([hot(), {"on": "a.right", "temperature": 0.0}], method="steady"), 1.0, 1)
        true = ran.outputs[-1]["heat.temperature.in"] * np.log(4.0) / (2.0 * np.pi * 3.0 / n) - 1.0
        assert true < told(ran) < 1.8 * true


def test_two_bodies_that_meet():
    """By symmetry each is a half space behind a film of 2 h: what both miss, over the span of both."""
    for h in (3.0, 0.3):
        for t in (0.1, 0.3, 1.0):
            n = int(8 + 6 * np.sqrt(t))
            mesh = scene(Box(0, 1, -n, 0, 1, n), Box(0, 1, 0, n, 1, n), pairs=(Pair("p", "b.bottom", "a.top", 0.5,
                                                                                    1e9),))
            law = {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}
            model = spec([], method="sdirk2", pairs={"p": law}) | {"bodies": {
                n: {"material": "m", "T0": T0} for n, T0 in (("a", 0.0), ("b", 1.0))}}
            ran = run(mesh, model, t / 50, 50, t_N=np.full(len(mesh.pair_nodes), -1e6))
            Q, T = half_space(film(2.0 * h), t)
            true = max(abs(sum(o["heat.stored.a"] for o in ran.outputs) / (0.5 * Q) - 1.0),
                       abs(ran.T[-1][np.unique(mesh.surfaces["a.top"])].mean() - 0.5 * T))
            number = told(ran) + told(ran, "b")
            assert told(ran) == pytest.approx(told(ran, "b"), rel=1e-6)
            assert 0.35 * true < number < 2.0 * true


@pytest.mark.slow
def test_a_front_that_freezes():
    """Aluminium of A9, 10 s: heat 18 % off on cells of 50 mm, below 1 % on cells of 2 mm."""
    case, span = EXPECTED["A9"], 940.0 - 293.15
    numbers = {}
    for n in (4, 100):
        ran = run(scene(Box(0, 0.2, 0, 0.001, n)), metal([held_at("left", 293.15)], PURE, method="sdirk2"), 0.1, 100)
        true = abs(-ran.outputs[-1]["heat_stored"] / 0.001 / (2.0 * case["q_wall"] * 10.0) - 1.0)
        numbers[n] = told(ran) / span, true
    assert numbers[4][0] == pytest.approx(numbers[4][1], rel=0.5)
    assert max(numbers[100]) < 0.01


def test_a_source_between_cold_sides():
    """The steady parabola is right at nodes, and its mean too low by 1/n^2."""
    found = []
    for n in (4, 8, 16, 32):
        model = spec([hot(0.0), {"on": "a.right", "temperature": 0.0}], method="steady")
        model["bodies"]["a"]["Q_T"] = 1.0
        ran = run(scene(Box(0, 1, 0, 1 / n, n)), model, 1.0, 1)
        found.append(told(ran) / ran.T[-1].max())
        assert 0.6 / n**2 < found[-1] < 1.1 / n**2
    assert order(found) == pytest.approx(2.0, abs=0.15)


def test_what_is_resolved_is_trusted():
    """A plate behind a film, Biot number 0.1, of one cell; a bar of four whose end warms slowly."""
    one = run(scene(Box(0, 1, 0, 1, 1)), spec([film(0.1)]), 1.0, 20)
    assert told(one) < 0.005
    slow = run(scene(Box(0, 1, 0, 1, 4)), spec([hot({"t": [0, 10], "value": [0, 1]})]), 0.5, 20)
    assert 0.0 < told(slow) < 0.002


# Laws.

@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize(("geometry", "k"), [
    ("plane", 12.0), ("plane", {"k_1": 40.0, "k_2": 5.0, "angle": 0.6, "turns": False}), ("axisymmetric", 12.0)])
def test_a_linear_field_misses_nothing(geometry, k, triangles):
    mesh = scene(Box(0.5, 1.5, 0, 1, 5, 5, triangles=triangles), geometry=geometry, move=distorted)
    exact = 300.0 + mesh.nodes @ np.array([30.0 if geometry == "plane" else 0.0, -17.0])
    ran = run(mesh, spec(fixed_to(mesh, exact), k=k, method="steady", T0=300.0), 1.0, 1)
    assert 0.0 <= told(ran) < 1e-10


def test_a_body_at_rest_misses_nothing():
    assert told(run(scene(Box(0, 1, 0, 1, 3, 3)), spec([], T0=300.0), 1.0, 2)) == 0.0


def cooled(move=lambda X: X, geometry="plane", angle=0.0, size=1.0, time=1.0, heat=1.0, kelvin=1.0):
    """A square of unlike conductivities that cools at two sides, in other units or another frame."""
    mesh = scene(Box(0.2, 1.2, 0, 1, 5, 5), geometry=geometry, move=lambda X: move(size * distorted(X)))
    depth = size * (1.0 if geometry == "plane" else size)
    k = {"k_1": 4.0 * heat / time / depth / kelvin, "k_2": 1.0 * heat / time / depth / kelvin, "angle": 0.3 + angle,
         "turns": False}
    h = 3.0 * heat / time / (depth * size) / kelvin
    model = spec([{"on": "a.left", "temperature": 100.0 * kelvin},
                  {"on": "a.top", "convection": {"h": h, "T": 700.0 * kelvin}}], k=k,
                 c=heat / (depth * size) / kelvin, T0=500.0 * kelvin, tolerance=1e-12)
    return run(mesh, model, 0.02 * time, 5)


def test_it_is_the_same_in_other_frames_and_units():
    """The plane: of a metre of depth, whose heat goes by m2."""
    one = told(cooled())
    assert one > 5.0
    assert told(cooled(lambda X: X @ turn(0.8).T + [3.0, -2.0], angle=0.8)) == pytest.approx(one, rel=1e-9)
    assert told(cooled(time=60.0, heat=7.0)) == pytest.approx(one, rel=1e-9)
    assert told(cooled(kelvin=1.8)) == pytest.approx(1.8 * one, rel=1e-9)


def test_it_is_the_same_in_millimetres():
    """k in W/mK over a thousandth of the length: the same flow at the same temperatures, in a thousandth^2 of time."""
    def of(size, time):
        mesh = scene(Box(0, 6 * size, 0, size, 6))
        return told(run(mesh, spec([hot(300.0)], T0=0.0), 0.1 * time, 8))
    assert of(1e-3, 1e-6) == pytest.approx(of(1.0, 1.0), rel=1e-9)


def test_it_is_the_same_in_another_numbering():
    mesh = scene(Box(0, 1, 0, 1, 4, 3), move=distorted)
    new = np.random.default_rng(3).permutation(len(mesh.nodes)).astype(np.int32)
    nodes = np.empty_like(mesh.nodes)
    nodes[new] = mesh.nodes
    cells = np.roll(new[mesh.quads], 1, axis=1)[::-1].copy()
    other = replace(mesh, nodes=nodes, quads=cells, surfaces={n: new[e] for n, e in mesh.surfaces.items()})
    one, same = (told(run(m, spec([hot(), {"on": "a.top", "flux": 0.3}]), 0.05, 4)) for m in (mesh, other))
    assert same == pytest.approx(one, rel=1e-9)


def test_flux_may_jump_along_where_the_material_changes():
    """Two layers side by side, heat along both: linear in each."""
    mesh = scene(Box(0, 4, 0, 2, 4, 2))
    layers = np.where(mesh.nodes[mesh.quads][:, :, 1].mean(axis=1) < 1.0, 0, -1).astype(np.int32)
    mesh = replace(mesh, regions=("a.low",), quad_region=layers, triangle_region=np.empty(0, np.int32))
    model = spec([hot(), {"on": "a.right", "temperature": 0.0}], method="steady")
    model["materials"]["n"] = {"rho": 1.0, "k": 30.0, "c": 1.0}
    model["bodies"]["a"]["regions"] = {"low": {"material": "n", "T0": 0.0}}
    model["format"] = 3
    assert told(run(mesh, model, 1.0, 1)) < 1e-12


def test_an_early_error_is_made_good_by_later_heat():
    log = nothing_missed(2).plus(np.array([8.0, 0.0]), np.array([1.0, 0.0]))
    assert log.T_missed.tolist() == [8.0, 0.0]
    log = log.plus(np.array([0.0, 3.0]), np.array([1.0, 2.0]))
    assert log.T_missed == pytest.approx([1.0, 3.0])
    assert log.heat.tolist() == [2.0, 2.0]
    same = MissedHeat(np.array([4.0]), np.array([5.0])).plus(np.array([4.0]), np.array([1.0]))
    assert same.T_missed == pytest.approx([4.0]), "a mean of one number is that number"


def test_what_was_missed_is_part_of_the_state():
    """A half that goes on from bytes tells the same to the bit as one that went through."""
    mesh = scene(Box(0, 8, 0, 1, 8))
    half, link = load(mesh, spec([hot()])), FlatContact()
    inputs = inputs_of(mesh, half)
    state, _ = half.start(inputs, 0.0, link)
    for step in range(3):
        state = half.step(state, inputs, 0.2 * step, 0.2, link).state
    again = from_bytes(to_bytes(state), ("thermal_fmu",))
    one, other = (h.step(s, inputs, 0.6, 0.2, link).outputs["mesh.T_missed.a"]
                  for h, s in ((half, state), (load(mesh, spec([hot()])), again)))
    assert one == other > 0.0
    # Forgotten, it would be that of the last step alone.
    fresh = half.step(replace(state, missed=nothing_missed(1)), inputs, 0.6, 0.2, link).outputs["mesh.T_missed.a"]
    assert fresh < 0.7 * one
