"""Force and moment of each named condition: closed forms, and action equal to reaction on any body."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, blocks, done, elastic, hold, inputs_of, press

from contact.half.layout import layout_of, model_description, standard_variables
from contact.rpc.link import DirectLink
from contact.service import ContactService

E, NU = 2.0e11, 0.3
LINE = np.linspace(0.0, 1.0, 5)


def force(outputs: dict[str, Any], name: str) -> np.ndarray:
    """(2,) [N]."""
    return np.asarray(outputs[f"condition.reaction.{name}"])


def started(half: Any, link: Any = None, **loads: float) -> dict[str, Any]:
    return dict(half.start(inputs_of(half, T=300.0, **loads), 0.0, link or NoLink())[1])


def skewed(X: np.ndarray) -> np.ndarray:
    return np.stack([X[:, 0] + 0.1 * np.sin(3 * X[:, 1]) * X[:, 0] * (1 - X[:, 0]),
                     X[:, 1] + 0.1 * X[:, 0] * X[:, 1] * (1 - X[:, 1])], axis=1)


@pytest.mark.fast
def test_grip_and_foot_of_a_tension_test():
    """Equal and opposite to round-off of the solution, sigma A each; the sum by body is nothing, as it was."""
    strain = 1e-6
    half = elastic(block(LINE, LINE, move=skewed), [
        hold("block.bottom", 1, name="foot"), hold("block.top", 1, strain, name="grip"), hold("block.left", 0)],
        state="plane_stress", tolerance=1e-11)
    out = started(half)
    grip, foot = force(out, "grip"), force(out, "foot")
    assert grip == pytest.approx(-foot, abs=1e-9 * abs(grip[1]))
    assert grip[1] == pytest.approx(E * strain, rel=5e-6)  # true strain and stress: second order in 1e-6
    assert grip[0] == 0.0
    assert np.abs(out["reaction.block"]).max() < 1e-8 * grip[1]


@pytest.mark.fast
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_all_forces_on_a_body_add_up_to_nothing(geometry):
    """Pressure, traction, force, weight, body force and what holds, on a mesh that is skew and bends far."""
    r0 = 0.5 if geometry == "axisymmetric" else 0.0
    mesh = block(r0 + LINE, LINE, geometry=geometry, node_sets={"block.tip": [24]})
    kinds: list[dict[str, Any]] = [
        press("block.top", 3e8, name="steam"), {"on": "block.right", "t_y": 2e8, "name": "drag"},
        {"at": "block.tip", "f_y": -4e7, "name": "hook"}, {"body": "block", "b_y": 1e7, "name": "field"}]
    half = elastic(mesh, [hold("block.bottom", 1, name="foot"), hold("block.bottom", 0, name="rail"), *kinds],
                   {"rho": 7800.0}, tolerance=1e-12, gravity={"y": -9.81, "name": "weight"})
    out = started(half)
    names = ("foot", "rail", "steam", "drag", "hook", "field", "weight")
    each = np.array([force(out, n) for n in names])
    total = np.abs(each).sum()
    # Along r, axisymmetric, forces hold a ring together: they need not add up.
    along = slice(1, 2) if geometry == "axisymmetric" else slice(0, 2)
    assert np.abs(each.sum(axis=0)[along]).max() < 1e-9 * total
    area = np.pi * (1.5**2 - 0.5**2) if geometry == "axisymmetric" else 1.0
    side = 2 * np.pi * 1.5 if geometry == "axisymmetric" else 1.0
    closed = {"drag": 2e8 * side, "hook": -4e7, "field": 1e7 * area, "weight": -7800 * 9.81 * area}
    for name, value in closed.items():
        assert force(out, name)[1] == pytest.approx(value, rel=1e-12), name
    assert force(out, "foot")[0] == 0.0
    assert force(out, "rail")[1] == 0.0
    assert out["reaction.block"] == pytest.approx(force(out, "foot") + force(out, "rail"), rel=1e-12)


@pytest.mark.fast
def test_a_turned_scene_turns_the_forces():
    """A quarter turn of everything: (f_x, f_y) -> (-f_y, f_x) of what holds and presses."""
    def cantilever(turn: bool) -> dict[str, Any]:
        x, y = LINE, np.linspace(0.0, 2.0, 7)
        names = {"left": "bottom", "bottom": "right", "right": "top", "top": "left"}
        side = (lambda s: f"block.{names[s]}") if turn else (lambda s: f"block.{s}")
        across = (lambda v: hold(side("bottom"), 1 - v, name=f"held{v}")) if turn else (
            lambda v: hold(side("bottom"), v, name=f"held{v}"))
        mesh = block(-y[::-1], x) if turn else block(x, y)
        return started(elastic(mesh, [across(0), across(1), press(side("left"), 5e8, name="wind")], tolerance=1e-11))

    straight, turned = cantilever(False), cantilever(True)
    for name in ("held0", "held1", "wind"):
        fx, fy = force(straight, name)
        assert force(turned, name) == pytest.approx([-fy, fx], abs=1e-7 * np.abs(force(straight, "wind")).max()), name


@pytest.mark.fast
def test_pressed_blocks_pass_the_force_on():
    """Across contact: what drives the upper block holds the lower one, with signs."""
    mesh = blocks(3, 4)
    link = DirectLink(ContactService().handle)
    half = elastic(mesh, [hold("lower.bottom", 1, name="foot"), hold("lower.left", 0), hold("upper.left", 0),
                          hold("upper.top", 1, {"t": [0, 1], "value": [0, -1e-4]}, name="ram")], tolerance=1e-11)
    given = inputs_of(half, T=300.0)
    state, _ = half.start(given, 0.0, link)
    _, out = done(half.step(state, given, 0.0, 1.0, link))
    assert force(out, "ram")[1] == pytest.approx(-float(force(out, "foot")[1]), rel=1e-9)
    assert force(out, "ram")[1] < -1e5


@pytest.mark.few("dynamics1")
@pytest.mark.fast
@pytest.mark.parametrize("dynamics", [{}, {"rho_inf": 0.8}, {"rho_inf": 0.5}, {"alpha": -0.1}])
def test_reactions_and_inertia_add_up_over_time(dynamics):
    """The mean force over many steps is that of rest, whatever the method's alphas; of Newmark's every step adds up."""
    mesh = block(np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 3))
    half = elastic(mesh, [hold("block.bottom", 1, name="foot"), hold("block.left", 0),
                          {"on": "block.top", "t_y": 1e6, "name": "pull"}], {"rho": 7800.0}, tolerance=1e-11,
                   dynamics=dynamics)
    given = inputs_of(half, T=300.0)
    state, _ = half.start(given, 0.0, NoLink())
    feet, t, h = [], 0.0, 4e-5
    m = half.system.masses.consistent
    for _ in range(100):
        state, out = done(half.step(state, given, t, h, NoLink()))
        t += h
        feet.append(float(force(out, "foot")[1]))
        if not dynamics:
            inertia = (m @ np.asarray(state.a).ravel()).reshape(-1, 2).sum(axis=0)
            assert feet[-1] + force(out, "pull")[1] == pytest.approx(inertia[1], abs=1e-8 * 1e6)
    assert np.mean(feet) == pytest.approx(-1e6, rel=0.03)


@pytest.mark.fast
def test_what_holds_and_turns_a_rigid_body():
    """A rigid beam held at its middle under a load at its end: the force, and load times arm as the moment."""
    mesh = block(np.linspace(-1.0, 1.0, 9), np.linspace(-0.1, 0.1, 2), node_sets={"block.tip": [16, 17]})
    bodies = {"block": {"material": "m", "rigid": True, "reference": [0.0, 0.0]}}
    half = elastic(mesh, [hold("block", 0, name="pin"), hold("block", 1, name="post"), hold("block", 2, name="key"),
                          {"at": "block.tip", "f_y": -1000.0, "name": "load"},
                          {"body": "block", "moment": 300.0, "name": "twist"}], bodies=bodies)
    out = started(half)
    assert force(out, "post") == pytest.approx([0.0, 1000.0], abs=1e-6)
    assert force(out, "pin") == pytest.approx([0.0, 0.0], abs=1e-6)
    assert force(out, "load") == pytest.approx([0.0, -1000.0])
    assert out["condition.reaction_moment.key"] == pytest.approx(1000.0 * 1.0 - 300.0, abs=1e-6)
    assert out["condition.reaction_moment.twist"] == 300.0
    assert "condition.reaction.key" not in out
    assert "condition.reaction.twist" not in out


@pytest.mark.fast
def test_what_turns_an_edge():
    """A beam whose end is turned about a point beside it: the moment there, of a tip force and of nothing else."""
    mesh = block(np.linspace(0.0, 2.0, 9), np.linspace(-0.1, 0.1, 3))
    about = [0.5, 0.3]
    half = elastic(mesh, [{"on": "block.left", "rotation": {"about": about, "angle": 0.4}, "name": "grip"},
                          {"on": "block.right", "t_y": -1e5, "name": "load"}], tolerance=1e-11)
    out = started(half)
    down = -1e5 * 0.2
    tip = np.asarray(out["x"])[np.asarray(half.system.interface.surfaces["block.right"])]
    arm = 0.5 * (tip[:, 0] + tip[:, 1]).mean(axis=0) - about  # of an even traction on edges of one length
    assert force(out, "grip") == pytest.approx([0.0, -down], abs=1e-6 * abs(down))
    assert out["condition.reaction_moment.grip"] == pytest.approx(-arm[0] * down, rel=1e-8)


@pytest.mark.fast
@pytest.mark.parametrize("condition", [
    {"on": "block.left", "rotation": {"about": [0.0, 0.0], "angle": 0.1}}, {"body": "block", "angle": 0.1},
    {"body": "block", "moment": 1.0}, {"body": "block", "f_x": 1.0}, {"on": "block.left", "u_x": 0.1},
    press("block.left", 1.0), {"body": "block", "b_x": 1.0}], ids=lambda c: next(iter(reversed(c))))
def test_an_fmu_can_say_the_unit_of_whatever_has_a_name(condition):
    """Inputs and outputs of every kind of condition are put into a modelDescription.xml: what is refused there, no
    half with such a name could be built of."""
    rigid = "body" in condition and "b_x" not in condition
    half = elastic(block(LINE, LINE), [condition | {"name": "it"}],
                   bodies={"block": {"material": "m", "rigid": rigid}})
    layout = layout_of(half.variables, standard_variables(half.system.interface, ""))
    text = model_description(layout, "elastic", "g", "tool", "a half")
    assert 'name="bc.it"' in text
    assert ".it" in text.replace("bc.it", "").replace("load.it", "")


@pytest.mark.fast
def test_what_is_released_tells_nothing_held():
    """A named condition keeps its outputs when it ends."""
    mesh = block(LINE, LINE)
    half = elastic(mesh, [hold("block.bottom", 1), hold("block.left", 0),
                          {"on": "block.top", "u_y": -1e-6, "until": 1.5, "name": "ram"}], tolerance=1e-11)
    given = inputs_of(half, T=300.0)
    state, out = half.start(given, 0.0, NoLink())
    assert force(out, "ram")[1] < -1e4
    for t in (0.0, 1.0, 2.0):
        state, out = done(half.step(state, given, t, 1.0, NoLink()))
    assert force(out, "ram") == pytest.approx([0.0, 0.0], abs=1e-6)
