"""Displacements as a function of place, and turns about a point: laws that hold of any of them."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import STEEL, NoLink, block, blocks, done, elastic, hold, inputs_of, stress_of, told_in

from contact.rpc.link import open_link
from mechanical_fmu.advance import between, drive_of
from mechanical_fmu.small_halves import load_rigid
from mechanical_fmu.warm import beginning

LINK = NoLink()
GRID = np.linspace(0.0, 1.0, 5)
SIDES = ("bottom", "right", "top", "left")
QUARTER = 0.5 * np.pi
ABOUT = [0.3, -0.7]


def distorted(nodes):
    x, y = nodes.T
    bump = np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.stack([1.0 + x + 0.08 * bump * np.cos(7 * y), y + 0.08 * bump * np.sin(5 * x)], axis=1)


def linear(a, b, t=1.0, c=0.0):
    """The field c + a x + b y."""
    return {"terms": [{"t": t, "x": {"polynomial": [c, a]}}, {"t": t, "y": {"polynomial": [0.0, b]}}]}


def ramp(value, end=1.0):
    return {"t": [0.0, end], "value": [0.0, value]}


def turned(X, angle, about=ABOUT):
    c, s = np.cos(angle), np.sin(angle)
    return (X - about) @ np.array([[c, s], [-s, c]]) + about


@pytest.mark.parametrize("element", ["mean_dilatation", "enhanced"])
@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_a_linear_field_on_the_outside_is_reproduced_inside(kind, element):
    interface = block(GRID, GRID, kind, move=distorted)
    G = np.array([[0.02, 0.03], [-0.01, -0.04]])
    half = elastic(interface, [{"on": f"block.{s}", "u_x": linear(*G[0], c=1e-3), "u_y": linear(*G[1])} for s in SIDES],
                   tolerance=1e-12, element=element)
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    assert np.abs(state.u - interface.nodes @ G.T - [1e-3, 0.0]).max() <= 1e-9 * np.abs(interface.nodes @ G.T).max()
    stress = stress_of(half, state, inputs_of(half)["T"])[0].reshape(-1, 4)
    assert np.abs(stress).max() > 1e9
    # Enhanced cells that are not parallelograms answer uniform strain uniformly to second order only.
    uniform = 1e-9 if element == "mean_dilatation" else 1e-6
    assert np.ptp(stress, axis=0).max() <= uniform * np.abs(stress).max()


@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_the_same_stretch_in_every_direction_across_an_axis(kind):
    """u_r = a r, u_z = b z has the same strain everywhere."""
    interface = block(GRID, GRID, kind, "axisymmetric", move=distorted)
    half = elastic(interface, [{"on": f"block.{s}", "u_x": linear(0.02, 0.0), "u_y": linear(0.0, -0.03)}
                               for s in SIDES], tolerance=1e-12)
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    assert np.abs(state.u - interface.nodes * [0.02, -0.03]).max() <= 1e-9 * 0.04


def test_a_field_is_of_the_reference_and_goes_with_time():
    interface = block(GRID, GRID)
    half = elastic(interface, [{"on": "block.bottom", "u_x": linear(0.3, 0.0, ramp(1.0, 4.0)), "u_y": 0.0},
                               hold("block.top", 0, {"terms": [{"t": ramp(2.0)}, {"t": -1.0}]})])
    target = half.system.constraints.motions
    fixed = half.system.constraints.fixed
    for t, share in ((0.0, 0.0), (1.0, 0.25), (4.0, 1.0), (9.0, 1.0)):
        u = np.full(2 * len(interface.nodes), np.nan)
        u[fixed] = target.target(target.levels(t, 1, inputs_of(half)))
        bottom = np.unique(interface.surfaces["block.bottom"])
        top = np.unique(interface.surfaces["block.top"])
        np.testing.assert_allclose(u.reshape(-1, 2)[bottom, 0], 0.3 * share * interface.nodes[bottom, 0], atol=1e-15)
        np.testing.assert_allclose(u.reshape(-1, 2)[top, 0], 2.0 * min(t, 1.0) - 1.0, atol=1e-15)


def test_inputs_scale_and_shift_a_field_and_an_angle():
    interface = block(GRID, GRID)
    half = elastic(interface, [{"on": "block.bottom", "u_x": linear(0.1, 0.0), "name": "pull"},
                               {"on": "block.top", "rotation": {"about": ABOUT, "angle": 0.2}, "name": "crank"}])
    values = inputs_of(half, pull=2.0, crank=0.5) | {"bc.pull": 0.01, "bc.crank": 0.3}
    assert {v.name: v.unit for v in half.variables if v.name.startswith("bc.")} == {"bc.pull": "m", "bc.crank": "rad"}
    motions, fixed = half.system.constraints.motions, half.system.constraints.fixed
    u = np.full(2 * len(interface.nodes), np.nan)
    u[fixed] = motions.target(motions.levels(0.0, 1, values))
    u = u.reshape(-1, 2)
    bottom, top = (np.unique(interface.surfaces[f"block.{side}"]) for side in ("bottom", "top"))
    np.testing.assert_allclose(u[bottom, 0], 0.2 * interface.nodes[bottom, 0] + 0.01, atol=1e-15)
    np.testing.assert_allclose(interface.nodes[top] + u[top], turned(interface.nodes[top], 0.4), atol=1e-15)


@pytest.mark.parametrize("windows", [1, 3, 9])
@pytest.mark.parametrize("angle", [0.1, QUARTER, -2.5, np.pi, 7.0])
@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_a_free_body_turned_by_its_edge_carries_no_stress(kind, angle, windows):
    interface = block(GRID, GRID, kind, move=distorted)
    half = elastic(interface, [{"on": "block.top", "rotation": {"about": ABOUT, "angle": ramp(angle)}}])
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    for i in range(windows):
        state, outputs = done(half.step(state, inputs_of(half), i / windows, 1.0 / windows, LINK))
        assert outputs["cuts"] == 0.0
        # No worse than the round-off of coordinates in the strain.
        assert outputs["sigma_v"].max() <= 1e-9 * STEEL["E"]
        assert np.abs(outputs["x"] - turned(interface.nodes, angle * (i + 1) / windows)).max() <= 1e-9


def test_pieces_of_a_step_go_along_the_arc():
    interface = block(GRID, GRID)
    half = elastic(interface, [{"on": "block.top", "u_y": 0.1, "rotation": {"about": ABOUT, "angle": ramp(2.0)}}])
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    end = replace(state.drive, levels=half.system.constraints.motions.levels(1.0, -1, inputs_of(half)))
    top = np.unique(interface.surfaces["block.top"])
    for share in (0.25, 0.5, 1.0):
        target = half.system.constraints.motions.target(between(state.drive, end, share).levels).reshape(-1, 2)
        np.testing.assert_allclose(interface.nodes[top] + target, turned(interface.nodes[top] + [0.0, 0.1],
                                                                         2.0 * share), atol=1e-15)


# Two blocks that press, and are turned

PRESS = 1e-4


def pressed(windows, angle=QUARTER, mu=0.0, augmented=None, upper=None):
    """Outputs of two blocks that are pressed, and then turned about a point in so many windows."""
    interface = blocks(4, 3)
    interface = replace(interface, pairs=tuple(replace(p, mu=mu) for p in interface.pairs))
    turn = {"about": ABOUT, "angle": {"t": [1.0, 2.0], "value": [0.0, angle]}}
    boundary = [{"on": "lower.bottom", "rotation": turn},
                upper or {"on": "upper.top", "u_x": ramp(0.1 * PRESS), "u_y": ramp(-PRESS), "rotation": turn}]
    more = {} if augmented is None else {"pairs": {"interface": {"augmented": {"method": augmented}}}}
    return told_in(elastic(interface, boundary, tolerance=1e-10, **more), windows)


@pytest.mark.few("1.5707963267948966-3-uzawa", "-3.141592653589793-9-semi_smooth", "1.5707963267948966-9-None")
@pytest.mark.parametrize("augmented", [None, "uzawa", "semi_smooth"])
@pytest.mark.parametrize("windows", [1, 3, 9])
@pytest.mark.parametrize("angle", [QUARTER, -np.pi])
def test_pressed_blocks_that_are_turned_keep_their_pressure(angle, windows, augmented):
    """Against the same windows without a turn: where a part slips, friction lets go a little at rest, too."""
    before, *during = pressed(windows, angle, 0.3, augmented)
    assert np.abs(before["contact.t_N"]).max() > 1e6
    for outputs, still in zip(during, pressed(windows, 0.0, 0.3, augmented)[1:], strict=True):
        assert outputs["cuts"] == 0.0
        for name in ("contact.t_N", "contact.t_T", "sigma_v"):
            assert np.abs(outputs[name] - still[name]).max() <= 1e-6 * np.abs(still[name]).max()
        # Of the work of the shear over a thousandth of the press.
        work = 1e-3 * PRESS * np.abs(before["contact.t_T"]).max()
        assert np.abs(outputs["contact.E_friction"] - still["contact.E_friction"]).max() <= 1e-3 * work
    assert np.abs(during[-1]["x"] - turned(still["x"], angle)).max() <= 1e-9


def test_a_mirrored_scene_mirrors():
    """Mirrored about x = 1/2: u_x and angles change their signs."""
    right = pressed(3, 0.8)[-1]
    turn = {"about": [0.7, ABOUT[1]], "angle": {"t": [1.0, 2.0], "value": [0.0, -0.8]}}
    interface = blocks(4, 3)
    half = elastic(interface, [{"on": "lower.bottom", "rotation": turn},
                               {"on": "upper.top", "u_x": ramp(-0.1 * PRESS), "u_y": ramp(-PRESS), "rotation": turn}],
                   tolerance=1e-10)
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for t0, t1 in ((0.0, 1.0), (1.0, 2.0)):
            state, left = done(half.step(state, inputs_of(half), t0, t1 - t0, link))
    key = np.round(interface.nodes * [1.0, 1.0], 9)
    image = np.round(interface.nodes * [-1.0, 1.0] + [1.0, 0.0], 9)
    which = [int(np.flatnonzero((key == row).all(axis=1) & (interface.node_body == body))[0])
             for row, body in zip(image, interface.node_body, strict=True)]
    assert np.abs(left["x"][which] * [-1.0, 1.0] + [1.0, 0.0] - right["x"]).max() <= 1e-10


def test_moment_times_angle_is_the_work():
    """A block twisted by its top stores half of moment times angle; with one stress a triangle energy is a sum."""
    interface = block(GRID, GRID, "triangles")
    angle, about = 1e-6, np.array([0.4, 1.0])
    half = elastic(interface, [{"on": "block.bottom", "u_x": 0.0, "u_y": 0.0},
                               {"on": "block.top", "rotation": {"about": list(about), "angle": angle}}],
                   tolerance=1e-12)
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    begin = replace(beginning(half.system), contact=state.contact)
    loading = half._loading(drive_of(half.system, inputs_of(half), 0.0, 1), begin, LINK)
    balance = half.system.balance(np.array(state.u), loading)
    top = np.unique(interface.surfaces["block.top"])
    arm, force = interface.nodes[top] - about, balance.r[top]
    moment = (arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum()
    s = stress_of(half, state, inputs_of(half)["T"])[0].mean(axis=1)
    E, nu = STEEL["E"], STEEL["nu"]
    trace = s[:, 0] + s[:, 1] + s[:, 3]
    density = ((1 + nu) * (s[:, [0, 1, 3]] ** 2).sum(axis=1) + 2 * (1 + nu) * s[:, 2] ** 2 - nu * trace**2) / (2 * E)
    volume = 0.5 * (GRID[1] - GRID[0]) ** 2
    assert 0.5 * moment * angle == pytest.approx(density.sum() * volume, rel=1e-5)


# Places, rigid bodies, other halves

def test_a_whole_body_and_a_point_may_be_moved():
    interface = blocks(2, 2, gap=0.5)
    half = elastic(interface, [{"body": "upper", "u_y": 0.2, "rotation": {"about": ABOUT, "angle": 1.0}},
                               {"on": "lower.bottom", "u_x": 0.0, "u_y": 0.0}, hold("lower.middle", 1)])
    with closing(open_link("direct")) as link:
        _, outputs = half.start(inputs_of(half), 0.0, link)
    upper = interface.node_body == 1
    np.testing.assert_allclose(outputs["x"][upper], turned(interface.nodes[upper] + [0.0, 0.2], 1.0), atol=1e-14)
    assert outputs["sigma_v"].max() <= 1e-9 * STEEL["E"]


@pytest.mark.parametrize("method", ["newton", "explicit"])
def test_a_rigid_tool_turns_about_a_point(method):
    interface = blocks(2, 2, gap=0.5)
    model = {"bodies": {"lower": {"material": "m"}, "upper": {"material": "m", "rigid": True}}}
    half = elastic(interface, [{"body": "upper", "u_y": -0.1, "rotation": {"about": ABOUT, "angle": ramp(2.0, 1e-3)}},
                               {"on": "lower.bottom", "u_x": 0.0, "u_y": 0.0}], method=method,
                   material={"rho": 7800.0}, **model)
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for i in range(3):
            state, outputs = done(half.step(state, inputs_of(half), i / 3e3, 1 / 3e3, link))
    upper = interface.node_body == 1
    np.testing.assert_allclose(outputs["x"][upper], turned(interface.nodes[upper] - [0.0, 0.1], 2.0), atol=1e-12)
    assert outputs["motion.upper"][2] == pytest.approx(2.0)


def test_an_edge_moved_explicitly_stays_on_its_arc():
    interface = block(GRID, GRID)
    half = elastic(interface, [{"on": "block.top", "rotation": {"about": ABOUT, "angle": ramp(1e-2, 1e-3)}}],
                   method="explicit", material={"rho": 7800.0})
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    state, outputs = done(half.step(state, inputs_of(half), 0.0, 1e-3, LINK))
    top = np.unique(interface.surfaces["block.top"])
    np.testing.assert_allclose(outputs["x"][top], turned(interface.nodes[top], 1e-2), atol=1e-14)


def test_with_inertia_a_body_that_is_turned_fast_is_pulled_outwards_and_no_cell_is_turned_inside_out():
    interface = block(GRID, GRID)
    half = elastic(interface, [{"on": "block.top", "rotation": {"about": [0.5, 1.0], "angle": ramp(QUARTER, 0.1)}}],
                   dynamics={"rho_inf": 0.5}, material={"rho": 7800.0})
    state, _ = half.start(inputs_of(half), 0.0, LINK)
    state, outputs = done(half.step(state, inputs_of(half), 0.0, 0.1, LINK))
    assert outputs["cuts"] == 0.0
    assert 0.0 < np.abs(outputs["x"] - turned(interface.nodes, QUARTER, [0.5, 1.0])).max() < 1e-3


def test_the_half_rigid_turns_its_bodies_and_what_touches_presses():
    interface = blocks(4, 5)
    turn = {"rotation": {"about": ABOUT, "angle": ramp(3.0)}}
    half = load_rigid(interface, {"half": "rigid", "format": 2, "motion": {"lower": turn, "upper": turn},
                                  "pressure": {"interface": 1e6}})
    with closing(open_link("direct")) as link:
        state, first = half.start({}, 0.0, link)
        state, outputs = done(half.step(state, {}, 0.0, 0.6, link))
    np.testing.assert_allclose(outputs["x"], turned(interface.nodes, 1.8), atol=1e-14)
    np.testing.assert_array_equal(outputs["contact.t_N"], first["contact.t_N"])
    np.testing.assert_allclose(outputs["contact.gap"], first["contact.gap"], atol=1e-14)


# What does not fit

TURN = {"about": [0.0, 0.0], "angle": 0.1}


@pytest.mark.parametrize(("boundary", "text"), [
    ([{"on": "block.bottom", "u_x": 0.0}, {"on": "block.left", "u_x": linear(0.1, 0.2)}],
     r"boundary\.1\.u_x: u_x of 1 node of block\.left is prescribed by entry 0 \(block\.bottom\) already, and "
     r"differently: 0 m there, 0\.1 m here, for node 1 at \(1, 0\)"),
    ([{"on": "block.bottom", "u_x": 0.0, "u_y": 0.0}, {"on": "block.left", "rotation": TURN}],
     r"boundary\.1\.rotation: u_x of 1 node of block\.left is prescribed by entry 0"),
    ([{"on": "block.bottom", "rotation": TURN}, {"body": "block", "rotation": TURN | {"angle": -0.1}}],
     r"boundary\.1\.rotation: u_y of 2 nodes of block is prescribed by entry 0"),
    ([{"on": "block.bottom", "u_x": 0.0, "name": "a"}, {"on": "block.left", "u_x": 0.0}], "goes by another input"),
    ([{"body": "block", "angle": 0.1}], "body 'block' is not rigid"),
    ([{"body": "block", "angle": 0.1, "rotation": TURN}], "the rotation has the angle of the body already"),
    ([{"on": "block.top", "rotation": {"about": [0.0, 0.0]}}], r"rotation\.angle: a required key is missing"),
    ([{"on": "block.top", "rotation": TURN, "u_x": 0.1, "name": "a"}], "a name stands for one factor"),
    ([{"on": "block.top", "u_x": 0, "u_y": 0.1, "rotation": TURN, "name": "a"}], "name: a_3"),
    ([{"on": "block.top", "u_x": 0.0, "u_y": 0.1, "name": "a"}],
     r"\{on: block\.top, name: a, u_x: \.\.\.\}, \{on: block\.top, name: a_2, u_y: \.\.\.\}"),
])
def test_what_does_not_fit_is_told(boundary, text):
    with pytest.raises(ValueError, match=text):
        elastic(block([0, 1], [0, 1], move=lambda x: x + [1.0, 0.0]), boundary)


def test_the_same_place_prescribed_twice_is_no_conflict():
    field = {"on": "block.left", "u_x": linear(0.1, 0.2, c=-0.1), "u_y": linear(0.0, 0.3)}
    still = {"on": "block.bottom", "u_x": linear(0.0, 0.2), "u_y": {"t": [0, 1], "value": [0, 0]}}
    elastic(block([0, 1], [0, 1], move=lambda x: x + [1.0, 0.0]), [still, field])
    elastic(block([0, 1], [0, 1]), [{"on": f"block.{s}", "rotation": TURN} for s in SIDES])


def test_rigid_bodies_take_one_motion_as_a_whole():
    rigid = {"bodies": {"block": {"material": "m", "rigid": True}}}
    for b, text in (([{"body": "block", "u_x": linear(0.1, 0.0)}], "is rigid: it moves as a whole"),
                    ([{"on": "block.top", "rotation": TURN}], "is rigid: it moves as a whole"),
                    ([{"body": "block", "angle": 0.1}, {"body": "block", "rotation": TURN}],
                     r"boundary\.1\.rotation: angle of body 'block' is prescribed by entry 0")):
        with pytest.raises(ValueError, match=text):
            elastic(block([0, 1], [0, 1]), b, **rigid)


def test_nothing_turns_about_an_axis():
    with pytest.raises(ValueError, match="does not turn in the plane of its section"):
        elastic(block([1, 2], [0, 1], geometry="axisymmetric"), [{"on": "block.top", "rotation": TURN}])
    with pytest.raises(ValueError, match="does not turn in the plane of its section"):
        load_rigid(block([1, 2], [0, 1], geometry="axisymmetric"),
                   {"half": "rigid", "format": 2, "motion": {"block": {"rotation": TURN}}})
