"""Curved surfaces whose straight edges are too coarse for what presses: a line of the trust table."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from random_scenes.scene import Scene
from random_scenes.story import Story, told

from coupler.trust.surfaces.facets import GAPS, NAME, Chords, FacetLog, Facets, checks
from coupler.trust.surfaces.penetration import Yields

A, B, C, DELTA = 0.012, 0.028, 0.047, 2.0e-5
SHAFT, HUB = (1.1e11, 0.34), (2.1e11, 0.29)


def lame() -> float:
    """The pressure of a hub B..C shrunk on a hollow shaft A..B by the radial interference DELTA, plane strain."""
    (E_i, nu_i), (E_o, nu_o) = ((E / (1.0 - nu**2), nu / (1.0 - nu)) for E, nu in (SHAFT, HUB))
    return DELTA / B / (((B**2 + A**2) / (B**2 - A**2) - nu_i) / E_i + ((C**2 + B**2) / (C**2 - B**2) + nu_o) / E_o)


def fitted(edges: tuple[int, int], exchange: bool = False, drawn: float = 0.0, **more: Any) -> Story:
    """A quarter of a shaft in a quarter of a hub, with so many edges on either."""
    steel = {"rho": 7800, "k": 45, "c": 480, "alpha": 0}
    sides = ["shaft.outer", "hub.inner"]
    doc = {"slideline": 2, "title": "fit", "units": {"temperature": "K"}, "geometry": "plane",
           "materials": {name: {**steel, "E": E, "nu": nu} for name, (E, nu) in (("inner", SHAFT), ("outer", HUB))},
           "bodies": {"shaft": {"material": "inner", "T0": 300}, "hub": {"material": "outer", "T0": 300}},
           "contact": {"fit": dict(zip(("slave", "master"), sides[::-1] if exchange else sides, strict=True))
                       | {"gap_max": 0.005} | more},
           "thermal": {"half": "thermal", "method": "midpoint"},
           "mechanical": {"half": "elastic", "elastic": {"boundary": [
               {"on": f"{body}.{side}", name: 0} for body in ("shaft", "hub")
               for side, name in (("start", "u_y"), ("end", "u_x"))]}},
           "coupling": {"scheme": "staggered", "end": 1, "windows": [{"until": 1, "size": 0.5}]}}
    rings = {"shaft": (A, B + 0.5 * drawn), "hub": (B - 0.5 * drawn, C)}
    return told(Scene(doc, {body: {"ring": list(radii), "angles": [0, 90], "cells": [4, n]}
                            for (body, radii), n in zip(rings.items(), edges, strict=True)}))


def pressures(story: Story) -> np.ndarray:
    side = next(side for side in story.interface.pair_sides if side.own)
    return -story.t_N[-1, side.at]


@pytest.mark.few("how0-True")
@pytest.mark.parametrize("exchange", [False, True])
@pytest.mark.parametrize("how", [{"interference": DELTA}, {"drawn": DELTA}])
def test_a_fit_of_unlike_edges_is_broken_and_told_what_mends_it(how: dict[str, float], exchange: bool) -> None:
    """13 edges on 17: the mean pressure is 0.32 to 2.7 times Lame's, single ones 0 to 5 times."""
    story = fitted((13, 17), exchange, **how)
    p = pressures(story) / lame()
    assert p.min() < 0.1
    assert p.max() > 0.8
    assert story.says(NAME)
    assert story.says("smooth: true")
    mended = fitted((13, 17), exchange, smooth=True, **how)
    np.testing.assert_allclose(pressures(mended), lame(), rtol=7e-3)
    assert not mended.says(NAME)


@pytest.mark.parametrize("how", [{"interference": DELTA}, {"drawn": DELTA}])
def test_edges_that_match_are_as_good_as_arcs(how: dict[str, float]) -> None:
    story = fitted((16, 16), **how)
    np.testing.assert_allclose(pressures(story), lame(), rtol=8e-3)
    assert not story.says(NAME)


def test_a_stated_fit_strays_between_the_nodes_of_its_slave_alone() -> None:
    """Where nodes of the slave face all of the master's the stated gap is met at both ends and in between."""
    fine = fitted((32, 16), interference=DELTA)
    np.testing.assert_allclose(pressures(fine), lame(), rtol=7e-3)
    assert not fine.says(NAME)
    coarse = fitted((16, 32), interference=DELTA)
    assert pressures(coarse).mean() < 0.7 * lame()
    assert coarse.says(NAME)


def test_the_stray_is_that_of_the_chords() -> None:
    """An edge of length h on a radius R strays by (h^2/2R) xi (1 - xi); mean square 1/30 of (h^2/2R)^2."""
    interface = fitted((16, 32), drawn=-2.0e-3).interface
    strays, at_nodes, gap = Chords(interface).strays(interface.nodes)
    side = next(side for side in interface.pair_sides if side.own)
    r = B - 1.0e-3
    rise = 0.5 * r * (np.pi / 32.0) ** 2
    # Two chords of the hub, a quarter as high, to each of the shaft: rise (xi (1 - xi) - eta (1 - eta)/4 R/r).
    xi = np.linspace(0.0, 1.0, 20001)
    stray = rise * (xi * (1.0 - xi) - 0.25 * (B + 1.0e-3) / r * (2.0 * xi % 1.0) * (1.0 - 2.0 * xi % 1.0))
    np.testing.assert_allclose(strays[side.at], np.sqrt(np.mean(stray**2)), rtol=5e-3)
    np.testing.assert_allclose(gap[side.at][1:-1], 2.0e-3, rtol=2e-2)
    # Nodes of the shaft face nodes of the hub (nearly so at the ends); the other way round every second one faces
    # the middle of a chord.
    np.testing.assert_allclose(at_nodes[side.at], 0.0, atol=0.02 * rise)
    exchanged = fitted((16, 32), exchange=True, drawn=-2.0e-3).interface
    side = next(side for side in exchanged.pair_sides if side.own)
    np.testing.assert_allclose(Chords(exchanged).strays(exchanged.nodes)[1][side.at][1::2], 0.25 * rise, rtol=5e-3)


@pytest.mark.few("True")
@pytest.mark.parametrize("exchange", [False, True])
def test_a_gap_to_chords_is_told(exchange: bool) -> None:
    """A clearance of 50 um of 13 edges on 17: gaps at nodes are off by half of it, and by 1 % with `smooth`."""
    def gaps(story: Story) -> np.ndarray:
        return story.levels[-1].gap[next(side for side in story.interface.pair_sides if side.own).at]

    open_fit = fitted((13, 17), exchange, drawn=-5.0e-5)
    assert abs(gaps(open_fit).mean() - 5.0e-5) > 1.0e-5
    assert open_fit.says(GAPS)
    mended = fitted((13, 17), exchange, drawn=-5.0e-5, smooth=True)
    np.testing.assert_allclose(gaps(mended), 5.0e-5, rtol=1e-2)
    assert not mended.says(GAPS)
    assert not fitted((16, 16), exchange, drawn=-5.0e-5).says(GAPS)


def test_the_first_touch_of_a_ball_counts_by_its_pressure() -> None:
    """Of a faint touch the edges make as much pressure as of a firm one: all of the first, little of the second."""
    story = fitted((13, 17), drawn=-5.0e-5)
    facets = Facets(story.interface, Yields(story.interface))
    side = next(side for side in story.interface.pair_sides if side.own)

    def rows(*pressures: float) -> tuple[float, str]:
        log = FacetLog()
        for n, p in enumerate(pressures):
            t_N, covered = np.zeros_like(story.levels[-1].t_N), np.zeros_like(story.levels[-1].t_N)
            t_N[side.at], covered[side.at] = -p, 1.0
            log = facets.watched(log, replace(story.levels[-1], t=float(n), t_N=t_N, covered=covered))
        row = checks(log, facets)[0]
        return row.number, row.verdict

    faint, firm = rows(1.0e5), rows(1.0e11)
    assert faint[0] == pytest.approx(1.0e6 * firm[0])
    assert (faint[1], firm[1]) == ("broken", "holds")
    for pressures in ((1.0e5, 1.0e11), (1.0e11, 1.0e5)):
        assert rows(*pressures) == (pytest.approx(firm[0]), "holds")


@pytest.mark.parametrize("turned", [0.0, 0.5, 1.0])
def test_edges_that_match_stray_as_a_body_turns(turned: float) -> None:
    """16 edges on 16, turned by so many edges: the chords face each other, then each other's nodes, then each other."""
    story = fitted((16, 16), interference=DELTA)
    facets, end = Facets(story.interface, Yields(story.interface)), story.levels[-1]
    side = next(side for side in story.interface.pair_sides if side.own)
    angle = turned * np.pi / 32.0
    shaft = story.interface.node_body == story.interface.bodies.index("shaft")
    x = end.x.copy()
    x[shaft] = x[shaft] @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    inner = np.zeros_like(end.covered)
    inner[side.at][2:-2] = 1.0  # the ends of a quarter have turned away
    row = checks(facets.watched(FacetLog(), replace(end, x=x, covered=inner)), facets)[0]
    assert row.number == pytest.approx(0.95 if turned == 0.5 else 0.0, abs=0.1)
    assert row.verdict == ("broken" if turned == 0.5 else "holds")
