"""Dead loads, inputs that drive them, rigid bodies: forces against closed forms."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import STEEL, NoLink, block, blocks, done, elastic, hold, inputs_of, press

GRID = np.linspace(0.0, 1.0, 5)
HELD = [hold("block.bottom", 0), hold("block.bottom", 1)]
RHO = {"rho": 7800.0}


def dead(kind, on, component, value, **more):
    keys = {"traction": ("t_x", "t_y"), "force": ("f_x", "f_y", "moment"), "body_force": ("b_x", "b_y")}
    return {"on": on, keys[kind][component]: value, **more}


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_the_holds_carry_what_the_loads_weigh(geometry, kind):
    """Sum of reactions = - sum of loads, each from its own closed form (a ring from r = 1 to 2, height 1)."""
    interface = block(1.0 + GRID, GRID, kind, geometry, node_sets={"corner": [4]})
    around = geometry == "axisymmetric"
    volume, top = (3.0 * np.pi, 3.0 * np.pi) if around else (1.0, 1.0)
    loads = {"gravity": ({"gravity": {"y": -9.81}}, -9.81 * 7800.0 * volume),
             "body": (dead("body_force", "block", 1, 3e4), 3e4 * volume),
             "traction": (dead("traction", "block.top", 1, 2e5), 2e5 * top),
             "force": (dead("force", "corner", 1, -7e3), -7e3)}
    for name, (load, total) in loads.items():
        more = load if name == "gravity" else {}
        half = elastic(interface, HELD if more else [*HELD, load], RHO, tolerance=1e-11, **more)
        _, outputs = half.start(inputs_of(half), 0.0, NoLink())
        # Internal forces are differences of stresses whose round-off is that of E.
        assert outputs["reaction.block"][1] == pytest.approx(-total, rel=1e-9, abs=4e-15 * STEEL["E"]), name
        if not around:
            assert abs(outputs["reaction.block"][0]) <= 1e-8 * abs(total), name


def test_a_column_under_its_weight_shortens_as_the_integral_says():
    """u(top) = - rho g L2/(2 M), M = E (1 - nu)/((1 + nu)(1 - 2 nu)): sides held, one-dimensional."""
    sides = [hold("block.left", 0), hold("block.right", 0), hold("block.bottom", 1)]
    half = elastic(block(GRID, GRID), sides, RHO, tolerance=1e-11, gravity={"y": -9.81})
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    E, nu = STEEL["E"], STEEL["nu"]
    M = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    assert state.u[4, 1] == pytest.approx(-7800.0 * 9.81 / (2.0 * M), rel=1e-5)


def test_a_dead_traction_keeps_its_direction_where_a_pressure_turns():
    """On a block turned by 30 degrees by its held edge: the traction's resultant stays along y."""
    angle = np.radians(30.0)
    interface = block(GRID, GRID, node_sets={f"b{i}": [i] for i in range(0, 25, 5)})
    turned = [hold(f"b{i}", c, float((interface.nodes[i] @ (np.array([[np.cos(angle), np.sin(angle)],
              [-np.sin(angle), np.cos(angle)]]) - np.eye(2)))[c])) for i in range(0, 25, 5) for c in (0, 1)]
    flat, follower = (h.start(inputs_of(h), 0.0, NoLink())[1] for h in (
        elastic(interface, [*turned, load]) for load in (dead("traction", "block.top", 1, 1e6),
                                                         press("block.top", -1e6))))
    assert flat["reaction.block"] == pytest.approx([0.0, -1e6], abs=1.0)
    assert follower["reaction.block"] == pytest.approx([1e6 * np.sin(angle), -1e6 * np.cos(angle)], rel=1e-3)


def test_inputs_scale_and_set_any_condition():
    interface = block(GRID, GRID, node_sets={"corner": [4]})
    half = elastic(interface, [*HELD, dead("force", "corner", 0, 10.0, name="f"), press("block.right", 5.0, name="p"),
                               hold("block.top", 1, 0.0, name="lid")], tolerance=1e-12)
    units = {v.name: v.unit for v in half.variables}
    assert (units["bc.f"], units["bc.p"], units["bc.lid"]) == ("N", "Pa", "m")
    inputs = inputs_of(half) | {"load.f": 0.0, "bc.f": 1e4, "load.p": 2.0, "bc.p": 1e4 - 10.0}
    _, outputs = half.start(inputs, 0.0, NoLink())
    assert outputs["reaction.block"][0] == pytest.approx(-1e4 + 1e4, abs=1.0)
    _, moved = half.start(inputs_of(half) | {"bc.lid": 1e-6, "load.p": 0.0, "load.f": 0.0}, 0.0, NoLink())
    assert moved["x"][4, 1] == 1.0 + 1e-6


def test_a_body_that_nothing_can_hold_is_refused_though_nothing_pushes_it():
    half = elastic(block(GRID, GRID), [hold("block.left", 0)])
    with pytest.raises(ArithmeticError, match="nothing holds body block against moving along y"):
        half.start(inputs_of(half), 0.0, NoLink())


def stamp(boundary, **rigid):
    """Two unit squares, the upper one rigid, 0.5 mm above the lower one, which is held at its bottom."""
    interface = blocks(4, 3, gap=5e-4)
    held = [hold("lower.bottom", 1), hold("lower.bottom", 0)]
    return elastic(interface, [*held, *boundary], tolerance=1e-10,
                   bodies={"lower": {"material": "m"}, "upper": {"material": "m", "rigid": True, **rigid}})


@pytest.fixture
def link():
    link = open_link("direct")
    yield link
    link.close()


def test_a_driven_rigid_body_turns_and_moves_exactly(link):
    half = stamp([hold("upper", i, {"t": [0, 1], "value": [0, end]}) for i, end in enumerate((0.3, 5.0, 2.5))])
    state, _ = half.start(inputs_of(half), 0.0, link)
    state, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    X = half.system.interface.nodes[25:41]
    c, s = np.cos(2.5), np.sin(2.5)
    centre = np.array([0.5, 1.5005])
    expected = (X - centre) @ np.array([[c, s], [-s, c]]) + centre + [0.3, 5.0]
    assert np.abs(outputs["x"][25:41] - expected).max() <= 1e-14 * 5
    assert outputs["motion.upper"] == pytest.approx([0.3, 5.0, 2.5], rel=1e-14)


def test_a_rigid_stamp_pressed_by_a_force_rests_where_one_driven_there_does(link):
    sunk = {"t": [0, 1], "value": [0, -6e-4]}
    driven = stamp([hold("upper", 0), hold("upper", 1, sunk), hold("upper", 2)])
    state, _ = driven.start(inputs_of(driven), 0.0, link)
    state, outputs = done(driven.step(state, inputs_of(driven), 0.0, 1.0, link))
    held = float(outputs["reaction.upper"][1])
    assert held < -1e6
    assert outputs["reaction.lower"][1] == pytest.approx(-held, rel=1e-8)
    free = stamp([hold("upper", 0), hold("upper", 2), dead("force", "upper", 1, 2.0 * held, name="push")])
    again, pressed = done(free.step(state, inputs_of(free, push=0.5), 1.0, 1.0, link))
    assert again.u[-2, 1] == pytest.approx(-6e-4, rel=1e-9)
    _, pressed = done(free.step(state, inputs_of(free), 1.0, 1.0, link))
    assert pressed["reaction.lower"][1] == pytest.approx(-2.0 * held, rel=1e-8)


def test_a_moment_turns_a_rigid_stamp_against_its_contact(link):
    """Newton must know how the lever turns: quadratic to the end, and moments balance about the centre."""
    half = stamp([hold("upper", 0), dead("force", "upper", 1, -3e7), dead("force", "upper", 2, 1e6)])
    touch = stamp([hold("upper", 0), hold("upper", 1, -7e-4), hold("upper", 2)])
    state, _ = touch.start(inputs_of(touch), 0.0, link)
    state, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    force = half.system.contact.tractions(link, half.system.interface.nodes + state.u, state.contact).force
    at = half.system.interface.contact_nodes
    upper = at >= 25
    point = half.system.interface.nodes[-2] + state.u[-2]
    arm = (half.system.interface.nodes + state.u)[at][upper] - point
    moment = (arm[:, 0] * force[upper, 1] - arm[:, 1] * force[upper, 0]).sum()
    assert moment == pytest.approx(-1e6, rel=1e-5)
    assert force[upper, 1].sum() == pytest.approx(3e7, rel=1e-6)
    assert outputs["iterations"] <= 12


def test_holding_a_node_of_a_rigid_body_is_refused():
    with pytest.raises(ValueError, match="body 'upper' is rigid: it moves as a whole"):
        stamp([hold("upper.top", 1)])


@pytest.mark.parametrize("rigid", [False, True])
def test_a_block_rests_on_another_as_drawn(link, rigid):
    """Gap 0 and no pressure yet: its weight, and nothing but its contact to hold it against falling and turning."""
    interface = blocks(4, 3, gap=0.0)
    half = elastic(interface, [hold("lower.bottom", 1), hold("lower.bottom", 0), hold("upper", 0) if rigid else
                               hold("upper.middle", 0), dead("body_force", "upper", 1, -9.81 * 7800.0)], RHO,
                               tolerance=1e-10,
                   bodies={"lower": {"material": "m"}, "upper": {"material": "m", "rigid": rigid}})
    _, outputs = half.start(inputs_of(half), 0.0, link)
    assert outputs["reaction.lower"][1] == pytest.approx(7800.0 * 9.81, rel=1e-6)
