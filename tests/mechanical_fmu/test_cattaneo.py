"""Cattaneo and Mindlin's contact: a pressed cylinder dragged along slips in rings from the edge of the contact inwards.

Where Q of mu P is dragged, c/a = sqrt(1 - Q/(mu P)) sticks and mu p - q is an ellipse over c (Johnson 1985, sec. 7.2).
"""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, NO_CELLS, done, hold, inputs_of, rectangle
from test_hertz import R, by_default, graded

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link
from mechanical_fmu.elastic_half import load

MU, FINE, FINER = 0.3, 1e-4, 5e-5
DRAGS = (4.71e-6, 9.42e-6)  # m, of the top


def scene(fine: float = FINE) -> Interface:
    """Both halves of Hertz's scene, the cylinder above.  fine : its edges in the contact [m]."""
    def both(x):
        return np.concatenate([-x[:0:-1], x])

    upper, c2, s2 = rectangle(both(graded(fine, 0.8 * R)), graded(fine, R))
    arc = R - np.sqrt(R**2 - upper[:, 0] ** 2)
    upper[:, 1] = arc + upper[:, 1] / R * (R - arc)
    lower, c1, s1 = rectangle(both(graded(1.3 * fine, 3 * R)), -graded(1.3 * fine, 3 * R)[::-1])
    surfaces = {f"lower.{k}": v for k, v in s1.items()} | {f"upper.{k}": v + len(lower) for k, v in s2.items()}
    body = np.repeat([0, 1], [len(c1), len(c2)]).astype(np.int32)
    return Interface("plane", np.concatenate([lower, upper]), np.concatenate([c1, c2 + len(lower)]).astype(np.int32),
                     NO_CELLS[3], body, np.empty(0, np.int32), ("lower", "upper"), ("m", "m"), surfaces, {},
                     (Pair("interface", "upper.bottom", "lower.top", 1e-3, 2e11 / fine, mu=MU),))


def dragged_along(interface: Interface | None = None, **pair: Any) -> list[dict[str, Any]]:
    """What the half gives out at 1 to 4 s: pressed in two steps, then dragged to each of DRAGS.  pair : its options."""
    steel, interface = EXPECTED["C3"]["steel"], interface or scene()
    boundary = [hold("lower.bottom", 0), hold("lower.bottom", 1),
                hold("upper.top", 1, {"t": [0.0, 2.0], "value": [0.0, -steel["push"]]}),
                hold("upper.top", 0, {"t": [2.0, 3.0, 4.0], "value": [0.0, *DRAGS]})]
    half = load(interface, {"half": "elastic", "format": 2, "tolerance": 1e-8,
                            "materials": {"m": {"E": steel["E"], "nu": steel["nu"]}},
                            "bodies": {b: {"material": "m"} for b in interface.bodies}, "boundary": boundary,
                            **({"pairs": {"interface": pair}} if pair else {})})
    outputs = []
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for i in range(4):
            state, out = done(half.step(state, inputs_of(half), float(i), 1.0, link))
            outputs.append(out)
    return outputs


def at_slave(out: dict[str, Any], interface: Interface | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x from the middle of the contact [m], pressure and shear [Pa] of the cylinder's nodes."""
    interface = interface or scene()
    nodes = np.unique(interface.surfaces["upper.bottom"])
    at = next(side.at for side in interface.pair_sides if side.surface == "upper.bottom")
    x, p, q = out["x"][nodes, 0], -out["contact.t_N"][at], np.abs(out["contact.t_T"][at])
    return x - np.trapezoid(x * p, x) / np.trapezoid(p, x), p, q


@pytest.mark.few("0.0001-False", "0.0001-True")
@pytest.mark.parametrize(("fine", "default"), [(FINE, False), (FINE, True), (FINER, True)])
def test_what_sticks_shrinks_to_the_middle(fine, default):
    """At Q/(mu P) = .351 and .684 a zone of .806 and .562 of a sticks.

    By default to 0.2 and 1.3 % in edges of 100 um.  With a spring of sticking as soft as the cells there 2.1 and 5.4 %.
    """
    interface, more = scene(fine), {}
    if default:
        steel = EXPECTED["C3"]["steel"]
        interface, more = by_default(interface, steel["E"], steel["nu"]), {"augmented": {}}
    at = next(side.at for side in interface.pair_sides if side.surface == "upper.bottom")
    outputs = dragged_along(interface, **more)
    for out, ratio, sticks in zip(outputs[2:], EXPECTED["Cattaneo"]["Q_over_mu_P"], EXPECTED["Cattaneo"]["c_over_a"],
                                  strict=True):
        Q, P = np.abs(out["reaction.upper"])
        dragged = Q / (MU * P)
        assert dragged == pytest.approx(ratio, rel=0.02 if default else 0.01)
        x, p, q = at_slave(out, interface)
        # An ellipse over c has the second moment c^2/4.
        a, c = (2.0 * np.sqrt(np.trapezoid(x**2 * f, x) / np.trapezoid(f, x)) for f in (p, MU * p - q))
        assert c / a == pytest.approx(np.sqrt(1.0 - dragged), rel=EXPECTED["Cattaneo"]["tolerance"])
        assert c / a == pytest.approx(sticks, rel=EXPECTED["Cattaneo"]["tolerance"] + 0.01)
        share = out["contact.slip_share"][at]
        assert (share[np.abs(x) < c - 2.0 * fine] == 0.0).all()
        assert (share[(np.abs(x) > c + 2.0 * fine) & (p > 0.0)] == 1.0).all()
