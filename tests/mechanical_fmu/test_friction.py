"""Coulomb's friction between elastic blocks: C5 (wedge), C6 (stick, slip, heat), C7 (sliding along facets)."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, NO_CELLS, blocks, done, elastic, hold, inputs_of, rectangle

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link
from mechanical_fmu.unstable import NAME, UNKNOWN

PRESS = 1e-6  # m, of two blocks of 1 m
E = 2.0e11
HELD = 1e-3  # of the drag may be lost at rest, of its work made into heat


def dragged(mu, slides, lower=4, upper=3, angle=0.0, press=PRESS, **pair):
    """Outputs after the press and after every slide [m] of the upper block's top along the surface, lifted by angle."""
    interface = blocks(lower, upper)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    interface = replace(interface, nodes=interface.nodes @ turn,
                        pairs=tuple(replace(p, mu=mu, **pair) for p in interface.pairs))
    way = np.array([[0.0, -press], *([d, -press] for d in slides)]) @ turn
    t = np.arange(len(way) + 1.0)
    boundary = [hold("lower.bottom", 0), hold("lower.bottom", 1)]
    boundary += [hold("upper.top", i, {"t": list(t), "value": [0.0, *way[:, i]]}) for i in range(2)]
    half = elastic(interface, boundary, material={"alpha": 0.0}, tolerance=1e-9)
    outputs = []
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for i in range(len(way)):
            state, out = done(half.step(state, inputs_of(half), float(i), 1.0, link))
            outputs.append(out)
    return outputs


def test_a_wedge_takes_the_force_of_the_closed_form():
    """C5: pushed up a slope of tan a = .1, F/G = (tan a + mu)/(1 - mu tan a); and less downhill."""
    expected = EXPECTED["C5"]
    angle = np.arctan(expected["tan"])
    up = dragged(expected["mu"], np.linspace(0.0, 1e-5, 6)[1:], angle=angle)[-1]["reaction.upper"]
    assert up[0] / -up[1] == pytest.approx(expected["F_over_G"], rel=expected["tolerance"])
    down = dragged(expected["mu"], -np.linspace(0.0, 1e-5, 6)[1:], angle=angle)[-1]["reaction.upper"]
    tan, mu = expected["tan"], expected["mu"]
    assert down[0] / -down[1] == pytest.approx((tan - mu) / (1 + mu * tan), rel=expected["tolerance"])


def test_it_sticks_below_mu_n_slides_at_mu_n_and_mu_n_s_becomes_heat():
    """C6, there and back: every step at the bound heats by mu N times what the surfaces slip."""
    slides = np.concatenate([np.linspace(0.0, 8e-6, 21)[1:], np.linspace(8e-6, -4e-6, 31)[1:]])
    outputs = dragged(0.3, slides)
    force = np.array([o["reaction.upper"] for o in outputs])
    ratio = force[1:, 0] / -force[1:, 1]
    heat = np.array([o["contact.E_friction"].sum() for o in outputs[1:]])
    slipping = np.array([o["contact.slipping"] == o["contact.touching"] for o in outputs[1:]])
    assert np.abs(ratio).max() <= 0.3 * (1 + 1e-9)
    assert slipping[:20][-1]
    assert slipping[-1]
    np.testing.assert_allclose(np.abs(ratio[slipping]), 0.3, rtol=1e-5)
    assert not heat[np.array([o["contact.slipping"] == 0 for o in outputs[1:]])].any()
    # Slipping everywhere before and after a step, the surfaces move past each other by the whole of the slide.
    steady = slipping[1:] & slipping[:-1] & (np.sign(ratio[1:]) == np.sign(ratio[:-1]))
    work = np.abs(force[1:, 0]) * np.abs(np.diff(np.concatenate([[0.0], slides])))
    np.testing.assert_allclose(heat[1:][steady], work[1:][steady], rtol=1e-3)
    assert (heat >= 0.0).all()


@pytest.mark.parametrize("two_pass", [False, True])
def test_sliding_along_facets_at_constant_pressure_is_smooth(two_pass):
    """C7: over 1.5 of 10 edges of the other's surface force and shear do not feel the nodes; no status flips."""
    slides = np.linspace(0.0, 0.15, 31)[1:]
    outputs = dragged(0.2, slides, lower=10, upper=7, two_pass=two_pass)[2:]
    normal = np.array([-o["reaction.upper"][1] for o in outputs])
    shear = np.array([o["reaction.upper"][0] for o in outputs])
    assert all(o["contact.slipping"] == o["contact.touching"] for o in outputs)
    # The pressed surfaces tilt by strains of 1e-6.
    np.testing.assert_allclose(shear / normal, 0.2, rtol=1e-5)
    # What is left is the covered width, which falls with the slide: a straight line to a percent.
    line = np.polyval(np.polyfit(slides[1:], normal, 2), slides[1:])
    assert np.abs(normal / line - 1.0).max() <= 0.01


ENFORCED = {"penalty": {}, "uzawa": {"augmented": {"tolerance": 1e-6, "method": "uzawa"}},
            "semi_smooth": {"augmented": {"tolerance": 1e-6, "method": "semi_smooth"}}}


def on_a_floor(floor, body, way, held, enforced, **pair):
    """Force (n, 2) on a short block on a floor, friction heat (n,), and where all of it slips (n,), after each step.

    floor, body : x of their nodes [m].  way : [m] of the block's top after each step; it is then held for `held` steps.
    """
    lower = rectangle(floor, np.linspace(0.0, 0.5, 8))
    upper = rectangle(body, 0.5 + body - body[0], first=len(lower[0]))
    surfaces = {f"{name}.{k}": v for name, s in (("lower", lower[2]), ("upper", upper[2])) for k, v in s.items()}
    interface = Interface("plane", np.concatenate([lower[0], upper[0]]),
                          np.concatenate([lower[1], upper[1]]).astype(np.int32), NO_CELLS[3],
                          np.repeat([0, 1], [len(lower[1]), len(upper[1])]).astype(np.int32), np.empty(0, np.int32),
                          ("lower", "upper"), ("m", "m"), surfaces, {},
                          (Pair("interface", "upper.bottom", "lower.top", 0.1, E / 0.05, mu=0.3, **pair),))
    t = list(np.arange(len(way) + 1.0))
    boundary = [hold("lower.bottom", 0), hold("lower.bottom", 1), hold("upper.top", 0, {"t": t, "value": [0.0, *way]}),
                hold("upper.top", 1, {"t": [0.0, 1.0], "value": [0.0, -1e-5]})]
    half = elastic(interface, boundary, material={"alpha": 0.0}, pairs={"interface": enforced} if enforced else {})
    force, heat, slips = [], [], []
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for i in range(len(way) + held):
            state, out = done(half.step(state, inputs_of(half), float(i), 1.0, link))
            force.append(out["reaction.upper"])
            heat.append(out["contact.E_friction"].sum())
            slips.append(out["contact.slipping"] == out["contact.touching"])
    return np.array(force), np.array(heat), np.array(slips)


@pytest.mark.few("7e-06-semi_smooth", "8e-06-penalty")
@pytest.mark.parametrize("enforced", ENFORCED)
@pytest.mark.parametrize("stop", [7e-6, 8e-6, 1.5e-5])
def test_a_block_held_at_the_bound_keeps_its_drag(stop, enforced):
    """A short block on a long floor, dragged until a part or all of it slips, and held for 100 steps."""
    force, heat, _ = on_a_floor(np.linspace(0.0, 1.0, 15), 0.25 + np.linspace(0.0, 0.5, 11),
                                np.linspace(0.0, stop, 11), 100, ENFORCED[enforced])
    assert heat[:11].sum() > 0.0
    assert force[-1, 0] == pytest.approx(force[10, 0], rel=HELD)
    assert heat[11:].sum() <= HELD * abs(force[10, 0] * stop)


@pytest.mark.few("edges-semi_smooth-40", "two passes-penalty-10")
@pytest.mark.parametrize("edges", [10, 40])
@pytest.mark.parametrize("enforced", ["penalty", "semi_smooth"])
@pytest.mark.parametrize("form", ["edges", "nodes", "two passes"])
def test_dragged_over_40_edges_it_has_its_drag_and_keeps_it(form, enforced, edges):
    """Drag mu N all along and heat mu N s; then held, the drag to the bit and no heat.  It lost 0.7 to 4 % of it."""
    way = np.linspace(0.0, 40.0 / 64.0, 38)
    force, heat, slips = on_a_floor(np.linspace(0.0, 1.0, 65), 0.04 + np.linspace(0.0, 0.3, edges + 1), way, 20,
                                    ENFORCED[enforced], two_pass=form == "two passes", by_node=form == "nodes")
    assert slips[1:38].all()
    drag, N = force[1:38, 0], -force[1:38, 1]
    # The pressed surfaces tilt by strains of 6e-5.
    np.testing.assert_allclose(drag, 0.3 * N, rtol=2e-4)
    np.testing.assert_allclose(heat[2:38], drag[1:] * np.diff(way)[1:], rtol=1e-3)
    assert (force[38:] == force[37]).all()
    assert heat[38:].sum() <= 1e-12 * heat.sum()


def test_whether_an_equilibrium_is_stable_is_not_known_where_surfaces_slip():
    pressed, *_, slipped = dragged(0.3, [8e-6, 1.6e-5])
    assert (pressed[NAME], slipped[NAME]) == (0.0, UNKNOWN)
