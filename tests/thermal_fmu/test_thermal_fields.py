"""Boundary data that depend on place, time and temperature (A14 through fields), and every derivative of a term."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, inputs_of, run, scene, spec

from contact.half.interface import Pair
from contact.half.model import Discard
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu.boundary import boundary_flow
from thermal_fmu.half import contact_at, load
from thermal_fmu.scene import freeze
from thermal_fmu.sources import loads_at


def poly(*terms):
    """A field of terms (t, x coefficients, y coefficients)."""
    made = []
    for t, x, y in terms:
        made.append({key: value for key, value in (("t", t), ("x", x and {"polynomial": x}),
                                                   ("y", y and {"polynomial": y})) if value is not None})
    return {"terms": made}


TIME = {"t": [0, 100], "value": [0, 100]}


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("T_prescribed", ["a.left", "everywhere"])
@pytest.mark.parametrize("twist", [0.0, 2.0])
def test_a14_through_fields(method, T_prescribed, twist):
    """T = 1 + x2 + 3y2 + 1.2t (+ 2xy) with T*, q* and Q_T given as fields: nodally exact."""
    T = poly((None, None, [1.0, 0.0, 3.0]), (None, [0.0, 0.0, 1.0], None), (TIME, [1.2], None),
             (twist, [0.0, 1.0], [0.0, 1.0]))
    sides = ["a.left"] if T_prescribed == "a.left" else ["a.left", "a.right", "a.top", "a.bottom"]
    boundary = [{"on": s, "temperature": T} for s in sides]
    if T_prescribed == "a.left":
        top = poly((None, [5.0, 1.0], [0.0, 1.0]), (-1.0, [-1.0, 1.0], None), (twist, [0.0, 1.0], None))
        fluxes = {"a.right": poly((None, [0.0, 2.0], None), (twist, None, [0.0, 1.0])), "a.top": top,
                  "a.bottom": poly((-twist, [0.0, 1.0], None))}
        boundary += [{"on": on, "flux": value} for on, value in fluxes.items()]
    mesh = scene(Box(0, 1, 0, 1, 6, 6))
    model = spec(boundary, T0=1.0, method=method)
    model["bodies"]["a"]["Q_T"] = poly((None, [-6.8, 1.5], None), (None, [0.0, -1.5], None))
    x, y = mesh.nodes.T
    half = load(mesh, model)
    given = inputs_of(mesh, half)
    state, _ = half.start(given, 0.0, None)
    state = replace(state, s=1.0 + x**2 + 3.0 * y**2 + twist * x * y)
    t = 0.0
    for h in (0.1, 0.2, 0.05, 0.15):
        state, t = half.step(state, given, t, h, None).state, t + h
    expected = 1.0 + x**2 + 3.0 * y**2 + 1.2 * t + twist * x * y
    assert np.abs(state.s - expected).max() < EXPECTED["A14"]["tolerance"]


def test_a_prescribed_field_holds_at_the_current_coordinates():
    mesh = scene(Box(0, 1, 0, 1, 3, 2))
    value = poly((TIME, [0.0, 10.0], [0.0, 1.0]), (300.0, None, None))
    model = spec([{"on": "a.top", "temperature": value, "name": "top"}], T0=300.0)
    x = mesh.nodes * [2.0, 3.0]
    T = run(mesh, model, 4.0, 1, x=x, load_top=0.5).T[-1]
    top = np.unique(mesh.surfaces["a.top"])
    assert np.abs(T[top] - 0.5 * (300.0 + 4.0 * 10.0 * x[top, 0] * 3.0)).max() < 1e-12


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_integrals_of_fields_on_the_current_geometry(geometry):
    """Flux, film and source on a stretched body: the ledger holds the exact integrals."""
    mesh = scene(Box(1.0, 2.0, 0.0, 1.0, 3, 4), geometry=geometry)
    model = spec([{"on": "a.right", "flux": poly((None, None, [1.0, 2.0])), "name": "lamp"},
                  {"on": "a.left", "convection": {"h": poly((2.0, None, [1.0, 1.0])),
                                                  "T": poly((None, None, [300.0, -10.0]))}},
                  *({"on": f"a.{s}", "temperature": 400.0}
                    for s in ("left", "right", "top", "bottom"))],
                 T0=400.0, method="steady")
    model["bodies"]["a"]["Q_T"] = poly((3.0, [0.0, 1.0], [1.0, 1.0]))
    x = mesh.nodes * [1.5, 2.0]  # 1.5 to 3 by 0 to 2
    out = run(mesh, model, 1.0, 1, x=x, load_lamp=2.0).outputs[-1]
    left, right = (2.0 * np.pi * r if geometry == "axisymmetric" else 1.0 for r in (1.5, 3.0))
    radial = 2.0 * np.pi * (27.0 - 3.375) / 3.0 if geometry == "axisymmetric" else (9.0 - 2.25) / 2.0
    assert abs(out["heat.flux"] / (2.0 * right * (2.0 + 4.0)) - 1.0) < 1e-13
    # 2 (1 + y)(100 + 10 y) from 0 to 2.
    assert abs(-out["heat.convection"] / (left * 2.0 * (200.0 + 220.0 + 80.0 / 3.0)) - 1.0) < 1e-13
    assert abs(out["heat.source"] / (3.0 * radial * 4.0) - 1.0) < 1e-12


def lumped(boundary=(), Q_T=0.0, Q_T_factor=None, T0=300.0):
    """A body of rho c V/A = 1000 that conducts too well to have two temperatures: T at 1 s, of 50 and 100 steps."""
    model = spec(list(boundary), k=1e9, c=1.0, rho=1000.0, T0=T0)
    model["bodies"]["a"] |= {"Q_T": Q_T} | ({} if Q_T_factor is None else {"Q_T_factor": Q_T_factor})
    found = [run(scene(Box(0, 1, 0, 1, 2)), model, 1.0 / n, n) for n in (50, 100)]
    assert max(ran.imbalance() for ran in found) < EXPECTED["A16"]["tolerance"]
    coarse, fine = (ran.T[-1].mean() for ran in found)
    return (4.0 * fine - coarse) / 3.0


@pytest.mark.few("field")
@pytest.mark.parametrize("Q_T", [2e5, poly((4e5, [0.0, 1.0], None))], ids=["uniform", "field"])
def test_a_source_that_grows_with_temperature(Q_T):
    """1000 dT/dt = Q (1 + .01 (T - 300)): an exponential."""
    T = lumped(Q_T=Q_T, Q_T_factor={"polynomial": [1.0, 0.01], "T_ref": 300.0})
    assert abs(T - (300.0 + 100.0 * np.expm1(0.01 * 200.0))) < 2e-3


def test_a_source_with_factor_follows_the_current_volume():
    mesh = scene(Box(0, 1, 0, 1, 2, 2))
    model = spec([], T0=300.0)
    model["bodies"]["a"] |= {"Q_T": poly((2.0, None, [1.0, 1.0])), "Q_T_factor": {"T": [200, 400], "value": [1.0, 3.0]}}
    out = run(mesh, model, 1e-9, 1, x=mesh.nodes * [2.0, 3.0]).outputs[-1]
    assert abs(out["heat.source"] / 1e-9 / (2.0 * 2.0 * 2.0 * 7.5) - 1.0) < 1e-6


def test_a_film_that_grows_with_temperature():
    """1000 dT/dt = -2 T (T - 0): hyperbola."""
    film = {"on": "a.right", "convection": {"h": 2.0, "h_factor": {"polynomial": [0.0, 1.0]}, "T": 0.0}}
    assert abs(lumped([film], T0=300.0) - 300.0 / (1.0 + 2e-3 * 300.0)) < 1e-4


def test_h_depends_on_place_time_and_temperature():
    """h = y t (1 + (T - 300)/100) over an edge held at 350 K, ambient 250 + 10 t."""
    film = {"on": "a.right", "convection": {"h": poly((TIME, None, [0.0, 1.0])), "T": TIME | {"value": [250, 1250]},
                                            "h_factor": {"T": [200, 300, 400], "value": [0.0, 1.0, 2.0],
                                                         "form": "cubic"}}}
    model = spec([film, {"on": "a.right", "temperature": 350.0}], T0=350.0, method="backward_euler")
    ran = run(scene(Box(0, 1, 0, 1, 2, 3)), model, 2.0, 2)
    factor = 1.5  # the table is a straight line
    for out, t in zip(ran.outputs, ran.t, strict=True):
        assert abs(-out["heat.convection"] / 2.0 / (0.5 * t * factor * (100.0 - 10.0 * t)) - 1.0) < 1e-12


EPS = {"T": [200.0, 500.0, 900.0], "value": [0.3, 0.6, 0.7], "form": "cubic"}
EVERY = {
    "film": [{"on": "b.top", "convection": {"h": poly((50.0, [1.0, 3.0], None)), "T": 700.0, "exponent": 0.25,
                                            "h_factor": {"T": [200, 500, 900], "value": [1.0, 2.0, 2.5],
                                                         "form": "cubic"}}}],
    "radiation": [{"on": "a.left", "radiation": {"emissivity": EPS, "T": poly((300.0, None, [1.0, 2.0]))}},
                  {"on": "b.bottom", "radiation": {"emissivity": EPS, "T": 300.0,
                                                   "gap": {"d_near": 5e-5, "d_far": 3e-4}}}],
    "near": [], "source": [], "exchange": []}


def every_term(which):
    """A model with the terms of one kind, all their factors on."""
    model = spec(EVERY[which], T0=400.0)
    pair = {"near": {"radiation": {"emissivity_slave": EPS, "emissivity_master": {"polynomial": [0.9, -1e-3]},
                                   "gap": {"d_near": 5e-5, "d_far": 3e-4}}},
            "exchange": {"conduction": {"closed": {"law": "table", "variable": "T", "x": [200, 450, 900],
                                                   "h": [1e3, 4e3, 5e3], "form": "cubic"},
                                                   "open": {"law": "sum", "of": [
                             {"law": "gas", "k_g": 0.05, "g_m": 2e-5},
                             {"law": "table", "variable": "T", "x": [200, 900], "h": [10, 90]}]}}}}
    source = {"Q_T": poly((2e5, [1.0, 3.0], None)),
              "Q_T_factor": {"T": [200, 500, 900], "value": [1, 2, 1], "form": "cubic"}}
    model["bodies"] = {b: {"material": "m", "T0": 400.0} | (source if which == "source" else {}) for b in "ab"}
    return model | {"pairs": {"p": pair.get(which, {})}}


@pytest.mark.parametrize("which", EVERY)
def test_derivatives_are_exact(which):
    """Central differences of every term, step 1e-3 K: relative 1e-6 of the largest."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 3, 2, triangles=True), Box(0.01, 0.11, 0.1002, 0.2, 4, 2), geometry="axisymmetric",
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 0.0),))
    half, link = load(mesh, every_term(which)), DirectLink(ContactService().handle)
    t_N = np.where(mesh.nodes[mesh.pair_nodes, 0] < 0.04, -1e6, 0.0)
    given = inputs_of(mesh, half, t_N=t_N)
    half.start(given, 0.0, link)
    sc = half._scene
    held = freeze(sc, sc.masses(mesh.nodes), mesh.nodes, np.zeros(20), contact_at(sc.surfaces, mesh.nodes, given, link))
    n = len(mesh.nodes)
    T = 450.0 + 90.0 * np.sin(1.7 * np.arange(n))
    loads = loads_at(sc.model, {}, 0.0, 1)

    def f(T):
        return boundary_flow(held, loads, np.zeros(n), T)

    here, J, pattern = f(T), np.zeros((n, n)), sc.volume.pattern
    rows = np.repeat(np.arange(n), np.diff(pattern.indptr))
    for slots, values in here.places:
        np.add.at(J, (rows[slots.ravel()], pattern.indices[slots.ravel()]), values.ravel())
    for nodes, values in here.across:
        k = nodes.shape[1]
        np.add.at(J, (np.repeat(nodes, k, axis=1).ravel(), np.tile(nodes, (1, k)).ravel()), values.ravel())
    numeric = np.array([(f(T - 1e-3 * e).f - f(T + 1e-3 * e).f) / 2e-3 for e in np.eye(n)]).T
    assert np.abs(numeric).max() > 0.0
    assert np.abs(J - numeric).max() < 1e-6 * np.abs(numeric).max()


def test_kinks_of_fields_are_the_halfs_own():
    """A term of a field that jumps restarts the half damped, as a signal does."""
    jump = {"t": [0.0, 1.0, 1.0], "value": [0.0, 0.0, 1e5]}
    lamp = {"on": "a.left", "flux": poly((jump, None, [1.0, 1.0]), (2.0, None, None))}
    model = spec([lamp], T0=300.0)
    assert load(scene(Box(0, 1, 0, 1, 2)), model)._calendar.jumps.tolist() == [1.0]
    ran = run(scene(Box(0, 1, 0, 1, 2)), model, 0.5, 4)
    assert [round(o["iterations"]) for o in ran.outputs] == [4, 1, 4, 1]


def film(**change):
    """A film on a surface, changed."""
    return {"on": "a.top", "convection": {"h": 1.0, "T": 0.0} | change}


@pytest.mark.parametrize(("boundary", "message"), [
    ({"on": "corner", "flux": 1.0}, "there is no surface 'corner'"),
    (film(exponent=-0.5), "exponent: must not be negative, not -0.5"),
    (film(h=poly((-1.0, None, None))), "h: must not be less than 0, but reaches -1"),
    (film(h_factor=-2.0), "h_factor: must be greater than zero, not -2.0"),
    (film(h_factor={"T": [1, 2], "value": [0, 0]}), "not 0"),
    ({"on": "a.top", "flux": {"terms": [{"x": {"at": [1, 0], "value": [0, 1]}}]}},
     r"boundary\.0\.flux\.terms\.0\.x\.at\.1: the places of a profile must increase")])
def test_what_the_boundary_refuses(boundary, message):
    mesh = scene(Box(0, 1, 0, 1, 2))
    mesh.node_sets["corner"] = np.array([0], dtype=np.int32)
    with pytest.raises(ValueError, match=message) as refused:
        load(mesh, spec([boundary]))
    assert str(refused.value).startswith("model.json: ")


@pytest.mark.parametrize(("change", "message"), [
    ({"h": poly((1.0, None, [-0.5, 1.0]))}, "film coefficient of surface a.right is negative"),
    ({"h_factor": {"polynomial": [-1.0]}}, "h_factor of surface a.right is -1")])
def test_a_film_that_turns_negative_is_told(change, message):
    mesh = scene(Box(0, 1, 0, 1, 2, 2))
    film = {"on": "a.right", "convection": {"h": 1.0, "T": 200.0} | change}
    half = load(mesh, spec([film], T0=300.0))
    given = inputs_of(mesh, half)
    done = half.step(half.start(given, 0.0, None)[0], given, 0.0, 1.0, None)
    assert isinstance(done, Discard)
    assert message in done.message
