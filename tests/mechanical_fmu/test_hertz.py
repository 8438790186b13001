"""C3, Hertz's line contact: a cylinder on a half-space of its own steel, and an aluminium one on a rigid plane."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, NO_CELLS, done, hold, inputs_of, rectangle

from contact.half.interface import Interface, Pair
from contact.half.outlines import cell_sizes
from contact.rpc.link import open_link
from mechanical_fmu.elastic_half import load

R, FINE = 0.05, 5e-5


def graded(first, last, ratio=1.4):
    """Lines from 0 to last, of size `first` over the contact and growing beyond it."""
    lines = list(np.arange(0.0, 1.2e-3, first))
    while lines[-1] < last:
        lines.append(lines[-1] + min(first * 1.2 ** (len(lines) - 1.2e-3 / first), ratio * (lines[-1] - lines[-2])))
    return np.array(lines[:-1]) * (last / lines[-2])


def scene(rigid):
    """Half of it, symmetric at x = 0: the cylinder above (slave), R wide enough for what the load feels."""
    x, depth = graded(FINE, 0.8 * R), graded(FINE, R)
    upper, c2, s2 = rectangle(x, depth)
    arc = R - np.sqrt(R**2 - upper[:, 0] ** 2)
    upper[:, 1] = arc + upper[:, 1] / R * (R - arc)
    x_low, y_low = graded(1.3 * FINE, R * (1.0 if rigid else 3.0)), -graded(1.3 * FINE, 3 * R)[::-1]
    if rigid:
        y_low = np.array([-1e-3, 0.0])
    lower, c1, s1 = rectangle(x_low, y_low)
    c2, s2 = c2 + len(lower), {k: v + len(lower) for k, v in s2.items()}
    body = np.repeat([0, 1], [len(c1), len(c2)]).astype(np.int32)
    surfaces = {f"lower.{k}": v for k, v in s1.items()} | {f"upper.{k}": v for k, v in s2.items()}
    return Interface("plane", np.concatenate([lower, upper]), np.concatenate([c1, c2]).astype(np.int32), NO_CELLS[3],
                     body, np.empty(0, np.int32), ("lower", "upper"), ("a", "b"), surfaces, {},
                     (Pair("interface", "upper.bottom", "lower.top", 1e-3, 2e11 / FINE),))


def by_default(interface, E, nu, below=1.0):
    """The penalty a scenario has that states none: it grows as the mesh becomes finer towards the contact.

    below : how many times as stiff the half-space is.
    """
    (pair,) = interface.pairs
    M = E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    stiffness = {side: M * times / cell_sizes(interface, interface.surfaces[side])
                 for side, times in ((pair.slave, 1.0), (pair.master, below))}
    return replace(interface, stiffness=stiffness, pairs=(replace(pair, eps_N=0.5 * M / FINE, local=True),))


def of_hertz(interface, outputs):
    """Half width [m] and largest pressure [Pa] of what presses the cylinder's nodes."""
    nodes = np.unique(interface.surfaces["upper.bottom"])
    p = -outputs["contact.t_N"][next(side.at for side in interface.pair_sides if side.surface == "upper.bottom")]
    x = outputs["x"][nodes, 0]
    # p^2 falls linearly in x^2 to zero at a: fitted where it is neither the edge nor the middle.
    fit = (p > 0.3 * p.max()) & (p < 0.9 * p.max())
    slope, top = np.polyfit(x[fit] ** 2, p[fit] ** 2, 1)
    return np.sqrt(-top / slope), p.max()


RIGID = 1e5  # times as stiff as what lies on it


@pytest.mark.few("steel-True")
@pytest.mark.parametrize("default", [False, True])
@pytest.mark.parametrize("case", ["steel", "aluminium"])
def test_half_width_and_pressure(case, default):
    """By default too, where edges of the surface are 0.05 to 10 mm long: with E over their mean p0 was 6.7 % low."""
    expected = EXPECTED["C3"][case]
    rigid = case == "aluminium"
    interface = scene(rigid)
    augmented = {"pairs": {"interface": {"augmented": {}}}} if default else {}
    if default:
        interface = by_default(interface, expected["E"], expected["nu"], RIGID if rigid else 1.0)
    upper = {"E": expected["E"], "nu": expected["nu"]}
    lower = {"E": RIGID * upper["E"], "nu": 0.3} if rigid else upper
    boundary = [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0),
                hold("upper.top", 1, {"t": [0.0, 2.0], "value": [0.0, -expected["push"]]})]
    half = load(interface, {"half": "elastic", "format": 2, "tolerance": 1e-8,
                            "materials": {"lower": lower, "upper": upper},
                            "bodies": {b: {"material": b} for b in interface.bodies}, "boundary": boundary,
                            **augmented})
    with closing(open_link("direct")) as link:
        state, outputs = half.start(inputs_of(half), 0.0, link)
        for i in range(2):
            state, outputs = done(half.step(state, inputs_of(half), float(i), 1.0, link))
    load_now = 2.0 * abs(outputs["reaction.upper"][1])
    assert load_now == pytest.approx(expected["load"], rel=0.1)
    # a and p0 both grow as the root of the load: brought to the page's load.
    scale = np.sqrt(load_now / expected["load"])
    a, p_0 = of_hertz(interface, outputs)
    assert p_0 / scale == pytest.approx(expected["p0"], rel=expected["tolerance"])
    assert a / scale == pytest.approx(expected["a"], rel=expected["tolerance"])
