"""Heat across open curved gaps: the closed forms of cylinders and spheres, whichever side is the slave."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, inputs_of, run, scene

from contact.half.contact_client import ContactSurfaces
from contact.half.gap_area import logarithmic_mean
from contact.half.interface import Interface, Pair
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu.contact_quadrature import contact_points
from thermal_fmu.stations.half import load_lumped

SIGMA = 5.670374419e-8
CELLS = 16  # a quarter
K, HOT, COLD = 0.03, 500.0, 300.0
EPS_IN, EPS_OUT = 0.8, 0.3
GAP = {"closed": {"law": "constant", "h": 1.0}, "open": {"law": "gas", "k_g": K, "g_m": 0.0}}
SLAVES = ("in", "out")


def between(r_in, r_out, slave, geometry="plane", cells=(4 * CELLS, 4 * CELLS), **more):
    """A layer of cells within r_in, and one outside of r_out: whole rings, or half ones about the axis."""
    nodes, quads, surfaces, first = [], [], {}, 0
    around = geometry == "plane"
    for name, radii, n in (("in", (0.5 * r_in, r_in), cells[0]), ("out", (r_out, 1.1 * r_out), cells[1])):
        angle = np.linspace(-0.5 * np.pi, 1.5 * np.pi, n + 1)[:-1] if around else np.linspace(-0.5, 0.5, n + 1) * np.pi
        along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        if not around:
            along[[0, -1], 0] = 0.0
        nodes.append(np.concatenate([r * along for r in radii]))
        at = np.arange(len(along))
        a, b = (at, np.roll(at, -1)) if around else (at[:-1], at[1:])
        a, b = first + a, first + b
        quads.append(np.stack([a, a + len(along), b + len(along), b], axis=1))
        surfaces |= {f"{name}.inner": np.stack([b, a], axis=1), f"{name}.outer": np.stack([a, b], axis=1) + len(along)}
        first += 2 * len(along)
    body = np.repeat([0, 1], [len(q) for q in quads]).astype(np.int32)
    sides = {"in": "in.outer", "out": "out.inner"}
    other = {"in": "out", "out": "in"}[slave]
    pair = Pair("gap", sides[slave], sides[other], 2.0 * r_out, 1e9, **more)
    return Interface(geometry, np.concatenate(nodes), np.concatenate(quads).astype(np.int32),
                     np.empty((0, 3), np.int32), body, np.empty(0, np.int32), ("in", "out"), ("m", "m"),
                     {k: v.astype(np.int32) for k, v in surfaces.items()}, {}, (pair,))


def heat_outwards(mesh, laws, mechanism):
    """The heat that crosses in a second [W], with both sides of the gap held at their temperatures."""
    slave = mesh.pairs[0].slave[:-6]
    if "radiation" in laws:
        eps = {"in": EPS_IN, "out": EPS_OUT}
        laws = {"radiation": {"emissivity_slave": eps.pop(slave), "emissivity_master": eps.popitem()[1]}}
    model = {"half": "thermal", "format": 2, "method": "steady", "materials": {"m": {"rho": 1.0, "k": 1.0, "c": 1.0}},
             "bodies": {"in": {"material": "m", "T0": HOT}, "out": {"material": "m", "T0": COLD}},
             "boundary": [{"on": f"{name}.{side}", "temperature": T} for name, T in (("in", HOT), ("out", COLD))
                          for side in ("inner", "outer")],
             "pairs": {"gap": laws}}
    ran = run(mesh, model, 1.0, 1, DirectLink(ContactService().handle))
    out = ran.outputs[-1]
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]
    sides = {end: out[f"heat.{mechanism}.{end}"] for end in ("slave", "master")}
    assert abs(sides["slave"] + sides["master"]) < 1e-14 * abs(sides["slave"])  # one flow with two ends
    return sides["master"] if slave == "in" else sides["slave"]


def exact(r_in, r_out, geometry):
    """Conduction through the gas, and radiation across [W], Incropera & DeWitt 3.3 and 13.3."""
    if geometry == "plane":
        gas, area, ratio = 2.0 * np.pi / np.log(r_out / r_in), 2.0 * np.pi * r_in, r_in / r_out
    else:
        gas, area, ratio = 4.0 * np.pi / (1.0 / r_in - 1.0 / r_out), 4.0 * np.pi * r_in**2, (r_in / r_out) ** 2
    return (K * gas * (HOT - COLD),
            area * SIGMA * (HOT**4 - COLD**4) / (1.0 / EPS_IN + ratio * (1.0 / EPS_OUT - 1.0)))


@pytest.mark.parametrize("slave", SLAVES)
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize(("r_in", "r_out"), [(0.1, 0.2), (0.1, 0.12), (0.05, 0.051)])
def test_conduction_between_cylinders_and_spheres(r_in, r_out, geometry, slave):
    heat = heat_outwards(between(r_in, r_out, slave, geometry, _cells(geometry)), {"conduction": GAP}, "gap")
    assert abs(heat / exact(r_in, r_out, geometry)[0] - 1.0) < 1e-5


@pytest.mark.parametrize("slave", SLAVES)
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize(("r_in", "r_out"), [(0.1, 0.2), (0.05, 0.051)])
def test_radiation_between_cylinders_and_spheres(r_in, r_out, geometry, slave):
    heat = heat_outwards(between(r_in, r_out, slave, geometry, _cells(geometry)), {"radiation": {}}, "near_radiation")
    assert abs(heat / exact(r_in, r_out, geometry)[1] - 1.0) < 1e-5


def _cells(geometry, quarter=CELLS):
    return (4 * quarter, 4 * quarter) if geometry == "plane" else (2 * quarter, 2 * quarter)


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize("cells", [(64, 48), (40, 64)])
def test_meshes_that_do_not_match_agree_from_either_side(geometry, cells):
    """Also where both passes count half."""
    heat = [heat_outwards(between(0.1, 0.2, slave, geometry, cells), {"conduction": GAP}, "gap") for slave in SLAVES]
    heat.append(heat_outwards(between(0.1, 0.2, "in", geometry, cells, two_pass=True), {"conduction": GAP}, "gap"))
    assert np.ptp(heat) < 1e-7 * heat[0]
    near = [heat_outwards(between(0.1, 0.2, slave, geometry, cells), {"radiation": {}}, "near_radiation")
            for slave in SLAVES]
    near.append(heat_outwards(between(0.1, 0.2, "out", geometry, cells, two_pass=True), {"radiation": {}},
                              "near_radiation"))
    assert np.ptp(near) < 1e-6 * near[0]


@pytest.mark.parametrize("side", ["inner", "outer"])
def test_a_straight_can_has_its_closed_form(side):
    """Walls along the axis, 50 and 51 mm: only the radii differ."""
    pair = ("can.right", "wall.left") if side == "inner" else ("wall.left", "can.right")
    mesh = scene(Box(0.04, 0.05, 0.0, 0.1, 1, 5), Box(0.051, 0.06, 0.0, 0.1, 1, 7), geometry="axisymmetric",
                 names=("can", "wall"), pairs=(Pair("gap", *pair, 0.01, 1e9),))
    held = [{"on": f"{b}.{s}", "temperature": T} for b, T in (("can", HOT), ("wall", COLD)) for s in ("left", "right")]
    model = {"half": "thermal", "format": 2, "method": "steady", "materials": {"m": {"rho": 1.0, "k": 1.0, "c": 1.0}},
             "bodies": {"can": {"material": "m", "T0": HOT}, "wall": {"material": "m", "T0": COLD}},
             "boundary": held, "pairs": {"gap": {"conduction": GAP}}}
    out = run(mesh, model, 1.0, 1, DirectLink(ContactService().handle)).outputs[-1]
    heat = out["heat.gap.master" if side == "inner" else "heat.gap.slave"]
    assert heat == pytest.approx(2.0 * np.pi * 0.1 * K / np.log(51.0 / 50.0) * (HOT - COLD), rel=1e-10)


@pytest.mark.parametrize("slave", SLAVES)
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_one_point_a_node(geometry, slave):
    """`form: nodes` measures the stretch of an edge where its two nodes' rays meet the other side."""
    mesh = between(0.1, 0.2, slave, geometry, _cells(geometry), by_node=True)
    wanted = exact(0.1, 0.2, geometry)
    assert heat_outwards(mesh, {"conduction": GAP}, "gap") == pytest.approx(wanted[0], rel=5e-3)
    assert heat_outwards(mesh, {"radiation": {}}, "near_radiation") == pytest.approx(wanted[1], rel=5e-3)


@pytest.mark.parametrize("slave", SLAVES)
def test_lumped_bodies_see_the_same_area(slave):
    """Bodies too heavy to change their temperature in a second."""
    mesh, link = between(0.1, 0.2, slave, "axisymmetric", _cells("axisymmetric")), DirectLink(ContactService().handle)
    half = load_lumped(mesh, {
        "half": "lumped", "format": 2, "materials": {"m": {"rho": 1e12, "k": 1.0, "c": 1.0}}, "boundary": [],
        "bodies": {"in": {"material": "m", "T0": HOT}, "out": {"material": "m", "T0": COLD}},
        "pairs": {"gap": {"conduction": GAP}}})
    inputs = inputs_of(mesh, half)
    done = half.step(half.start(inputs, 0.0, link)[0], inputs, 0.0, 1.0, link)
    heat = done.outputs["heat.gap.master" if slave == "in" else "heat.gap.slave"]
    assert heat == pytest.approx(heat_outwards(mesh, {"conduction": GAP}, "gap"), rel=1e-8)


def test_closed_contact_keeps_the_area_it_is_searched_from():
    mesh = between(0.1, 0.2, "in", "axisymmetric", _cells("axisymmetric"))
    surfaces = ContactSurfaces(mesh)
    facing = surfaces.facing(DirectLink(ContactService().handle), mesh.nodes)
    pressed = contact_points(surfaces, facing, np.full(len(mesh.pair_nodes), -1e6), mesh.nodes)
    assert (pressed.p > 0.0).all()
    for area in (pressed.area, pressed.open_area, pressed.end_s, pressed.end_m):
        assert (area == facing.area).all()


def test_the_logarithmic_mean():
    a, b = np.array([1.0, 2.0, 1.0, 0.0, 1.0, 3.0, 0.0]), np.array([1.0, 1.0, 2.0, 1.0, 0.0, 3.0 + 3e-9, 0.0])
    wanted = [1.0, 1.0 / np.log(2.0), 1.0 / np.log(2.0), 0.0, 0.0, 3.0 + 1.5e-9, 0.0]
    assert logarithmic_mean(a, b) == pytest.approx(wanted, rel=1e-15, abs=0.0)
