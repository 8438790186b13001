"""A plate that warms on a slope creeps down it: the points that stick are few, and a step finds them.

Moseley's plate: under its own weight on a slope of angle a, with friction mu > tan a, a plate of length L that warms by
dT grows from where as much of it rubs uphill as its weight asks for, L_down - L_up = L tan(a)/mu, and shrinks towards
the mirror image of that place when it cools: it goes down by alpha dT L tan(a)/mu a cycle, however slowly or quickly.
"""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, STEEL, done, elastic, hold, inputs_of, rectangle

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link
from mechanical_fmu import slipping, stabilisation
from mechanical_fmu.tangent import LooseBodyError

L, THICK, CELLS, RHO, G, WARM = 1.0, 0.02, 40, 7800.0, 9.81, 100.0
ANGLE = float(np.radians(10.0))


def plate(mu: float) -> Interface:
    """A plate on a longer floor; the slave is the plate's bottom."""
    x1, c1, s1 = rectangle(np.linspace(-0.1, 1.1, 25), np.array([-0.05, 0.0]))
    x2, c2, s2 = rectangle(np.linspace(0.0, L, CELLS + 1), np.array([0.0, THICK]), first=len(x1))
    body = np.repeat(np.array([0, 1], np.int32), [len(c1), len(c2)])
    return Interface("plane", np.concatenate([x1, x2]), np.concatenate([c1, c2]), NO_CELLS[3], body,
                     np.empty(0, np.int32), ("floor", "plate"), ("m", "m"),
                     {f"floor.{k}": v for k, v in s1.items()} | {f"plate.{k}": v for k, v in s2.items()}, {},
                     (Pair("face", "plate.bottom", "floor.top", 1e-3, STEEL["E"] / (L / CELLS), mu=mu),))


def ends(mu: float, angle: float, steps: int, cycles: int = 1):
    """u_x [m] of both ends of the plate's bottom, after it warmed and after it cooled, by turns: (2 cycles, 2).

    angle : [rad], downhill to the right where positive.
    """
    interface = plate(mu)
    weight = {"gravity": {"x": G * np.sin(angle), "y": -G * np.cos(angle)}}
    half = elastic(interface, [hold("floor.bottom", 0), hold("floor.bottom", 1)], {"rho": RHO, "nu": 0.0}, 1e-8,
                   **weight)
    own, told = interface.nodes[:, 1] > 0.0, []
    own[interface.surfaces["plate.bottom"].ravel()] = True
    bottom = np.unique(interface.surfaces["plate.bottom"])
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half, STEEL["T_ref"]), 0.0, link)
        for i in range(2 * steps * cycles):
            share = (i + 1) % (2 * steps) / steps
            warmth = WARM * min(share, 2.0 - share)
            T = STEEL["T_ref"] + np.where(own, warmth, 0.0)
            state, outputs = done(half.step(state, inputs_of(half, T), float(i), 1.0, link))
            if (i + 1) % steps == 0:
                told.append((outputs["x"] - interface.nodes)[bottom[[0, -1]], 0])
    return np.array(told)


def expected(mu: float, angle: float, cycles: int):
    growth, lean = STEEL["alpha"] * WARM * L, np.tan(angle) / mu
    warm = growth * np.array([-0.5 * (1.0 - lean), 0.5 * (1.0 + lean)])
    return np.array([[n * growth * lean + warm, np.full(2, (n + 1) * growth * lean)] for n in range(cycles)]
                    ).reshape(-1, 2)


@pytest.mark.few("0.4-0.17453292519943295-1")
@pytest.mark.parametrize(("mu", "angle", "steps"), [(0.4, ANGLE, 1), (0.4, ANGLE, 4), (0.4, -ANGLE, 1),
                                                   (0.2, ANGLE, 2), (0.9, ANGLE, 1), (0.3, 0.0, 1)])
def test_it_creeps_down_as_moseley_says(mu: float, angle: float, steps: int) -> None:
    went = np.diff(ends(mu, angle, steps, cycles=2), axis=0, prepend=0.0)
    # Where it stands still is one of the points, at most 0.58 of a cell from the next.
    off = went - np.diff(expected(mu, angle, 2), axis=0, prepend=0.0)
    assert np.abs(off).max() < 0.3 * STEEL["alpha"] * WARM * L / CELLS


@pytest.mark.few("0.4")
@pytest.mark.parametrize("mu", [0.2, 0.4, 0.9])
def test_what_sticks_is_found_soon(mu: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """At most 20 solves a step where all damped increments did not do."""
    tried: list[int] = []
    for where in (slipping, stabilisation):
        def counted(*given, find=where.solve_step):
            tried.append(1)
            return find(*given)

        monkeypatch.setattr(where, "solve_step", counted)
    ends(mu, ANGLE, 2)
    assert len(tried) <= 20 * 4


def test_one_that_nothing_holds_is_refused_by_name() -> None:
    """Its friction does not hold it on the slope: at any share of sticking it goes on."""
    with pytest.raises(LooseBodyError, match=r"nothing holds body plate against moving along x.*; damped, it went"):
        ends(0.15, ANGLE, 1)
