"""Heat across curved gaps: quarters, halves and wholes, graded, turned and unlike meshes, from either side."""

from __future__ import annotations

import sys
from functools import partial
from math import acosh, sinh
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_thermal_gap_area import CELLS, COLD, GAP, HOT, SLAVES, K, exact, heat_outwards

from contact.half.interface import Interface, Pair

WHOLE, HALF, QUARTER = (0.0, 360.0), (-90.0, 90.0), (0.0, 90.0)
SPANS = {"whole": WHOLE, "half": HALF, "quarter": QUARTER}
SHELL = 5e-3  # [m], thick the layers of cells on either side


def arc(radius, span, n, grading=1.0, turn=0.0, centre=(0.0, 0.0)):
    """(n + 1, 2) points [m], counterclockwise, each step `grading` times the one before; of a whole circle (n, 2)."""
    steps = grading ** np.arange(n)
    at = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    angle = np.radians(span[0] + (span[1] - span[0]) * at + turn)
    points = np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    points[np.abs(points) < 1e-15] = 0.0
    return points[:-1] if span == WHOLE else points


def between(inner, outer, slave, geometry="plane", closed=False, **more):
    """A layer of cells within the line `inner`, and one outside of `outer`; both lines run counterclockwise."""
    nodes, quads, surfaces, first = [], [], {}, 0
    for name, line, way in (("in", inner, -1.0), ("out", outer, 1.0)):
        along = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
        if not closed:
            along[0], along[-1] = line[1] - line[0], line[-1] - line[-2]
        outwards = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        held = line + way * SHELL * outwards
        if geometry == "axisymmetric":
            held[line[:, 0] == 0.0, 0] = 0.0
        near, far = (held, line) if name == "in" else (line, held)
        n, at = len(line), np.arange(len(line))
        a, b = (at, np.roll(at, -1)) if closed else (at[:-1], at[1:])
        a, b = first + a, first + b
        nodes += [near, far]
        quads.append(np.stack([a, a + n, b + n, b], axis=1))
        surfaces |= {f"{name}.inner": np.stack([b, a], axis=1), f"{name}.outer": np.stack([a, b], axis=1) + n}
        first += 2 * n
    body = np.repeat([0, 1], [len(q) for q in quads]).astype(np.int32)
    sides = {"in": "in.outer", "out": "out.inner"}
    pair = Pair("gap", sides.pop(slave), sides.popitem()[1], 5.0, 1e9, **more)
    return Interface(geometry, np.concatenate(nodes), np.concatenate(quads).astype(np.int32),
                     np.empty((0, 3), np.int32), body, np.empty(0, np.int32), ("in", "out"), ("m", "m"),
                     {k: v.astype(np.int32) for k, v in surfaces.items()}, {}, (pair,))


def part_of(span, geometry):
    """The part of the whole body that lies between two angles [degrees]."""
    if geometry == "plane":
        return (span[1] - span[0]) / 360.0
    return 0.5 * (np.sin(np.radians(span[1])) - np.sin(np.radians(span[0])))


def concentric(r_in, r_out, slave, geometry, span, cells=(CELLS, CELLS), grading=(1.0, 1.0), turn=0.0, **more):
    quarters = (span[1] - span[0]) / 90.0
    lines = [arc(r, span, int(n * quarters), q, turn * k)
             for k, (r, n, q) in enumerate(zip((r_in, r_out), cells, grading, strict=True))]
    return between(*lines, slave, geometry, span == WHOLE, **more)


BODIES = [("plane", "whole"), ("plane", "half"), ("plane", "quarter"), ("axisymmetric", "half"),
          ("axisymmetric", "quarter")]
MESHES = {"alike": {}, "16 and 21": {"cells": (16, 21)}, "12 and 16": {"cells": (12, 16)},
          "graded": {"grading": (1.05, 1.0 / 1.06)}, "turned": {"turn": 2.8}}
# An arc that is turned ends elsewhere, and the ends of a graded one do not fit each other round a whole circle.
CASES = [(mesh, *body) for mesh in MESHES for body in BODIES
         if {"turned": body[1] == "whole", "graded": body[1] != "whole"}.get(mesh, True)]


@pytest.mark.parametrize("slave", SLAVES)
@pytest.mark.parametrize("radii", [*(pytest.param(r, marks=pytest.mark.slow) for r in ((0.1, 0.2), (0.05, 0.051))),
                                   (0.1, 0.3)])
@pytest.mark.parametrize(("mesh", "geometry", "part"), CASES)
def test_concentric_bodies_pass_the_exact_heat(mesh, geometry, part, radii, slave):
    """A twentieth of a percent is the can's demand; before, quarters lost up to 4 % and unlike meshes up to 3 %."""
    span = SPANS[part]
    made = concentric(*radii, slave, geometry, span, **MESHES[mesh])
    wanted = part_of(span, geometry) * np.array(exact(*radii, geometry))
    assert heat_outwards(made, {"conduction": GAP}, "gap") == pytest.approx(wanted[0], rel=1e-4)
    assert heat_outwards(made, {"radiation": {}}, "near_radiation") == pytest.approx(wanted[1], rel=1e-4)


def eccentric_cylinders(a, b, e):
    """Heat between cylinders whose axes lie e apart [W/m], Incropera & DeWitt, table 4.1."""
    return K * (HOT - COLD) * 2.0 * np.pi / acosh((a * a + b * b - e * e) / (2.0 * a * b))


def eccentric_spheres(a, b, e):
    """Heat between spheres whose centres lie e apart [W], by images (Smythe, Static and Dynamic Electricity, 5.08)."""
    U = acosh((a * a + b * b - e * e) / (2.0 * a * b))
    images = (a * b * sinh(U) / (b * sinh(n * U) - a * sinh((n - 1) * U)) for n in range(1, int(600.0 / U)))
    return K * (HOT - COLD) * 4.0 * np.pi * sum(images)


@pytest.mark.parametrize(("geometry", "closed_form", "tolerance"), [
    ("plane", eccentric_cylinders, 3e-4), ("axisymmetric", eccentric_spheres, 1.2e-3)])
@pytest.mark.parametrize(("radii", "e"), [((0.1, 0.2), 0.03), ((0.1, 0.2), 0.06), ((0.05, 0.051), 5e-4)])
def test_eccentric_bodies(radii, e, geometry, closed_form, tolerance):
    """Arcs are the lines of heat flow between eccentric cylinders; between spheres nearly.  The roles: 2e-4."""
    span = WHOLE if geometry == "plane" else HALF
    quarters = 4 if geometry == "plane" else 2
    lines = arc(radii[0], span, CELLS * quarters, centre=(0.0, e)), arc(radii[1], span, CELLS * quarters)
    heat = [heat_outwards(between(*lines, slave, geometry, span == WHOLE), {"conduction": GAP}, "gap")
            for slave in SLAVES]
    assert heat == pytest.approx([closed_form(*radii, e)] * 2, rel=tolerance)
    assert heat[0] == pytest.approx(heat[1], rel=3e-4)


def above_a_plane(slave, gap, cells=CELLS, flat=40, **more):
    """60 degrees to either side of a cylinder of radius 1 m, above a plane of 2.5 m to either side; its exact heat."""
    H = 1.0 + gap
    line = arc(1.0, (-150.0, -30.0), cells * 4 // 3)
    plane = np.column_stack([np.linspace(-2.5, 2.5, 2 * flat + 1), np.full(2 * flat + 1, -H)])
    # Bipolar coordinates: the heat through a line is the angle it spans, seen from both foci, over acosh(H).
    a, x, y = np.sqrt(H * H - 1.0), np.sin(np.pi / 3.0), H - 0.5
    one, two = np.array([x, y - a]), np.array([x, y + a])
    spans = np.pi - np.arccos(one @ two / np.linalg.norm(one) / np.linalg.norm(two))
    return between(line, plane, slave, **more), K * (HOT - COLD) * 2.0 * spans / acosh(H)


@pytest.mark.parametrize(("gap", "error"), [(0.002, 2e-3), (0.02, 6.4e-3), (0.1, 1.65e-2)])
def test_a_cylinder_above_a_plane_does_not_care_who_is_the_slave(gap, error):
    """By rays: 1.3, 4.1 and 10 % between the roles, and at a gap of 0.002 of the radius 15 % too little heat."""
    heat = []
    for slave in SLAVES:
        mesh, wanted = above_a_plane(slave, gap)
        heat.append(heat_outwards(mesh, {"conduction": GAP}, "gap"))
        assert heat[-1] == pytest.approx(wanted, rel=error)
    assert heat[0] == pytest.approx(heat[1], rel=3e-4)
    both = heat_outwards(above_a_plane("in", gap, two_pass=True)[0], {"conduction": GAP}, "gap")
    assert both == pytest.approx(0.5 * sum(heat), rel=1e-9)


def test_the_roles_agree_better_on_finer_meshes():
    """What is left is the quadrature of a piece, which falls with the square of its length."""
    apart = []
    for n in (8, 16, 32):
        heat = [heat_outwards(above_a_plane(slave, 0.05, 3 * n // 2, 3 * n)[0], {"conduction": GAP}, "gap")
                for slave in SLAVES]
        apart.append(abs(heat[0] / heat[1] - 1.0))
    assert apart[2] < apart[1] < apart[0]
    assert np.log2(apart[0] / apart[2]) / 2.0 > 1.7


def wavy(n, seed, above):
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 1.0, n + 1)
    y = above + sum(0.02 * np.sin(k * x * 3.0 + p) for k, p in zip((1, 2, 3), rng.uniform(0.0, 6.0, 3), strict=True))
    return np.column_stack([x, y])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_wavy_surfaces_do_not_care_who_is_the_slave(geometry, seed):
    """Conduction and radiation; one surface ends within the other."""
    upper, lower = wavy(29, seed, 0.25)[4:22], wavy(23, seed + 100, 0.0)
    for laws, mechanism in ((partial(dict, conduction=GAP), "gap"), (partial(dict, radiation={}), "near_radiation")):
        heat = [heat_outwards(between(upper, lower, slave, geometry), laws(), mechanism) for slave in SLAVES]
        assert heat[0] == pytest.approx(heat[1], rel=1e-3)
