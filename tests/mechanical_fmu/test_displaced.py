"""How much farther nodes would be on a finer mesh: against finer meshes, of bodies that do more than bend."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, blocks, elastic, hold, inputs_of, press

from contact.rpc.link import open_link
from mechanical_fmu.unstable import PLACES

H, L, E = 0.05, 1.0, 1e9
EULER = np.pi**2 * E * H**3 / 12.0 / (4.0 * L**2)  # held at one end, plane strain with nu 0
PULL = -20.0  # of Euler's loads: what it does lies along the bar, and stiffens it


def told(interface, held, material, link=None, T=300.0, **more):
    """Where nodes are and how much farther they would be, (n_nodes, 2) [m] each, in equilibrium at the start."""
    half = elastic(interface, held, {"E": E, "rho": 1000.0, **material}, start="equilibrium", **more)
    _, outputs = half.start(inputs_of(half, T), 0.0, link or NoLink())
    return outputs["x"] - interface.nodes, outputs[PLACES]


def cut(interface, above=0.0):
    """The same mesh, every quad above a height [m] cut in two."""
    whole = interface.nodes[interface.quads, 1].mean(axis=1) < above
    q = interface.quads[~whole]
    halves = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]]).astype(np.int32)
    return replace(interface, quads=interface.quads[whole], quad_body=interface.quad_body[whole], triangles=halves,
                   triangle_body=np.zeros(len(halves), np.int32))


def bar(cells, load=0.0, side=0.0, nu=0.0, bow=0.0, triangles=False, angle=0.0, above=0.0, **more):
    """How far the end of a bar of (across, along) cells went to its side, and how much farther it would be [m].

    load : along it, of Euler's; below 0 it pulls.  side [Pa] on its end.  bow [m]: as drawn.
    """
    interface = block(np.linspace(0.0, H, cells[0] + 1), np.linspace(0.0, L, cells[1] + 1),
                      move=lambda X: X + np.outer(bow * (1.0 - np.cos(0.5 * np.pi * X[:, 1] / L)), [1.0, 0.0]))
    interface = cut(interface, above) if triangles else interface
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    t = np.array([side, -load * EULER / H]) @ turn
    end = int(np.argmax(interface.nodes[:, 1] - 1e-9 * interface.nodes[:, 0]))
    u, du = told(replace(interface, nodes=interface.nodes @ turn),
                 [hold("block.bottom", 0), hold("block.bottom", 1), {"on": "block.top", "t_x": t[0], "t_y": t[1]}],
                 {"nu": nu}, **more)
    return (u[end] @ turn.T)[0], (du[end] @ turn.T)[0]


# Of what the end would go: 2 x 20 quads stop 29 % short of it, 2 x 40 (nu = .49) go 10 % too far.
@pytest.mark.parametrize("cells", [(2, 20), (2, 40)])
@pytest.mark.parametrize("scene", [{"side": 1e3}, {"side": 1e3, "nu": 0.3}, {"side": 1e3, "nu": 0.49},
                                   {"side": 1e3, "load": PULL}, {"bow": 5e-3, "load": 0.1}, {"bow": 5e-3, "load": 0.3},
                                   {"side": 1e3, "state": "plane_stress"}])
def test_what_a_bar_stops_short_of_is_told(cells, scene):
    """Bent alone, pulled hard and bent a little, pressed and bent by how it is drawn: the energy tells of the first."""
    fine, _ = bar((6, 160), **scene, element="enhanced")
    u, du = bar(cells, **scene)
    assert du / u == pytest.approx(1.0 - u / fine if u < fine else fine / u - 1.0, abs=0.03)


@pytest.mark.parametrize(("scene", "cells"), [({"side": 1e3}, (4, 80)), ({"side": 1e3, "nu": 0.3}, (4, 40)),
                                              ({"side": 1e3, "nu": 0.49}, (4, 40)),
                                              ({"bow": 5e-3, "load": 0.3}, (4, 80))])
def test_what_triangles_stop_short_of_is_told(scene, cells):
    """18 to 73 % of the way, to a seventh of it."""
    fine, _ = bar((6, 160), **scene, element="enhanced")
    u, du = bar(cells, **scene, triangles=True)
    assert du / u == pytest.approx(1.0 - u / fine, rel=0.15)


def test_of_quads_that_bend_and_triangles_in_one_body_it_is_told():
    """Both are of one part of the mesh, and quads alone have modes: 10 % of the way are missing, 8 are told."""
    fine, _ = bar((6, 160), side=1e3, nu=0.3, element="enhanced")
    u, du = bar((4, 40), side=1e3, nu=0.3, triangles=True, above=0.3 * L, element="enhanced")
    assert du / u == pytest.approx(1.0 - u / fine, rel=0.25)


@pytest.mark.parametrize("cells", [(1, 10), (2, 20)])
@pytest.mark.parametrize("scene", [{"side": 1e3}, {"side": 1e3, "load": PULL, "nu": 0.3}, {"bow": 5e-3, "load": 0.5}])
def test_cells_that_bend_are_told_to_be_right(cells, scene):
    u, du = bar(cells, **scene, element="enhanced")
    assert abs(du / u) < 0.015


def test_it_does_not_hang_on_where_a_bar_stands():
    straight, turned = (bar((2, 20), side=1e3, nu=0.3, angle=angle) for angle in (0.0, 0.7))
    assert turned == pytest.approx(straight, rel=1e-3)


def test_of_a_single_row_of_quads_nothing_is_known():
    u, du = bar((1, 40), side=1e3)
    assert np.isfinite(u)
    assert np.isnan(du)


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_a_round_plate_under_pressure_is_told(nu):
    """Around an axis: the middle of a plate that is held at its rim, two cells thick."""
    def middle(cells, **more):
        interface = block(np.linspace(0.0, L, cells[0] + 1), np.linspace(0.0, H, cells[1] + 1), geometry="axisymmetric")
        u, du = told(interface, [hold("block.right", 0), hold("block.right", 1), hold("block.left", 0),
                                 press("block.top", 1e3)], {"nu": nu}, **more)
        return u[0, 1], du[0, 1]

    fine, _ = middle((160, 8), element="enhanced")
    u, du = middle((16, 2))
    assert abs(1.0 - u / fine) > 0.1
    assert du / u == pytest.approx(1.0 - u / fine, abs=0.05)


def test_what_fits_a_mesh_is_right():
    """An even strain by pressure, or by heat, and a free block that is as warm as it was drawn."""
    held = [hold("block.bottom", 1), hold("block.left", 0)]
    for more, T in (([press("block.top", 1e5)], 300.0), ([], 300.0), ([], 400.0)):
        u, du = told(block([0.0, 0.3, 1.0], [0.0, 0.5, 1.0]), [*held, *more], {"nu": 0.3}, T=T)
        assert np.abs(du).max() <= 1e-9 * max(np.abs(u).max(), 1e-6)


def test_a_rigid_body_goes_with_what_it_stands_on():
    """A rigid block on a pad that is glued at its foot: it sinks as its pad, and does not deform."""
    interface = blocks(6, 1)
    with closing(open_link("direct")) as link:
        u, du = told(interface, [hold("lower.bottom", 0), hold("lower.bottom", 1), {"on": "upper", "f_y": -1e6},
                                 hold("upper", 0), hold("upper", 2)], {"nu": 0.45}, link,
                     bodies={"lower": {"material": "m"}, "upper": {"material": "m", "rigid": True}})
    upper = interface.node_body == 1
    assert np.ptp(du[upper], axis=0) == pytest.approx(0.0, abs=1e-15)
    assert 0.0 < abs(du[upper, 1].mean() / u[upper, 1].mean()) < 0.1
