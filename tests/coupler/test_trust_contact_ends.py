"""How much too large the force of a contact is because it ends on a body that yields: a line of the trust table."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mesh_scenes import interface_of, turned, vars_of

from contact.half.interface import Interface
from coupler import Results, load_scenario, run
from coupler.running.resume import resume
from coupler.scenario.mesh import Rectangle, rectangle_mesh
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.in_space.contact_ends import NAME, ContactEnds, EndLog

YIELDS = 1e8  # Pa
BEARS = 2.0 * YIELDS / np.sqrt(3.0) * (1.0 + 0.5 * np.pi)  # Prandtl
SOFT, HARD = {"plastic": {"s_y": YIELDS}}, {"E": 1e12}


def scene(cells: int = 6, *, off: float = 0.0, geometry: str = "plane", swapped: bool = False, wide: float = 1.0,
          scale: float = 1.0) -> Interface:
    """A punch from 0.5 to 1.1 + off on a body with nodes at each 0.1.  wide : of the body, 0.6: as the punch.

    swapped : the body is the slave.  cells : of the punch.
    """
    low = Rectangle(origin=((0.8 - 0.5 * wide) * scale, -0.2 * scale), size=(wide * scale, 0.2 * scale),
                    cells=(round(10 * wide), 2))
    up = Rectangle(origin=(0.5 * scale, 0.0), size=((0.6 + off) * scale, 0.4 * scale), cells=(cells, 4))
    meshes = {"low": rectangle_mesh(low), "up": rectangle_mesh(up)}
    return interface_of(meshes, geometry, ("low.top", "up.bottom") if swapped else ("up.bottom", "low.top"))


def covered(interface: Interface, first: float, last: float) -> np.ndarray:
    """The share of each pair node's part of its side from x = first to x = last, (n_q,)."""
    found, r, w = np.zeros(interface.pair_nodes.size), interface.axisymmetric, np.polynomial.legendre.leggauss(4)
    for side in interface.pair_sides:
        place = {int(k): side.at.start + i for i, k in enumerate(side.nodes)}
        part, whole = np.zeros_like(found), np.zeros_like(found)
        for edge in interface.surfaces[side.surface].tolist():
            x = interface.nodes[edge, 0]
            for (a, b), into in (((min(x), max(x)), whole), ((max(min(x), first), min(max(x), last)), part)):
                for at, weight in zip(0.5 * (a + b) + 0.5 * (b - a) * w[0], w[1] * max(b - a, 0.0), strict=True):
                    for k in range(2):
                        N = abs(at - x[1 - k]) / abs(x[1] - x[0])
                        into[place[edge[k]]] += N * weight * (at if r else 1.0)
        found += np.where(whole > 0.0, part / np.where(whole > 0.0, whole, 1.0), 0.0)
    return found


def level(interface: Interface, pressures: dict[float, float], t: float = 1.0, *, scale: float = 1.0, last: float = 1.1,
          x: np.ndarray | None = None) -> Level:
    """pressures : at x [m] of the slave's nodes, in `BEARS`; elsewhere under the punch 1."""
    share = covered(interface, 0.5 * scale, last * scale)
    at = interface.nodes[interface.pair_nodes, 0] / scale
    t_N = np.where(share > 0.0, -BEARS, 0.0)
    for where, p in pressures.items():
        t_N[np.abs(at - where) < 1e-9] *= p
    x = interface.nodes if x is None else x
    return Level(t, np.full(len(x), 300.0), x, t_N, np.zeros(t_N.size), share)


def model(**more: Any) -> dict[str, Any]:
    return {"half": "elastic", "materials": {"soft": SOFT, "hard": HARD}, "state": "plane_strain",
            "bodies": {"low": {"material": "soft"}, "up": {"material": "hard"}}} | more


def row(interface: Interface, *levels: Level, of: dict[str, Any] | None = None,
        flows: bool | tuple[bool, ...] | np.ndarray = True, yields: float = YIELDS) -> Check | None:
    """The row of a run that looked at these levels."""
    ends, n = ContactEnds(interface, model() if of is None else of), len(interface.quads)
    sigma_v, log, peeq = np.full(n, yields), EndLog(), np.zeros(n)
    start = level(interface, {})
    log = ends.watched(log, {"peeq": peeq, "sigma_v": sigma_v}, replace(start, t_N=0.0 * start.t_N))
    for k, now in enumerate(levels):
        peeq = peeq + 1e-6 * (flows[k] if isinstance(flows, tuple) else flows)
        log = ends.watched(log, {"peeq": peeq, "sigma_v": sigma_v}, now)
    rows = ends.checks(log)
    assert all(one.name == NAME for one in rows)
    return rows[0] if rows else None


def wider(by: float, h: float = 0.1) -> dict[float, float]:
    """Pressures as if the contact were wider by so much at both ends."""
    return {0.5: 1.0 + by / (0.5 * h), 1.1: 1.0 + by / (0.5 * h)}


@pytest.mark.parametrize("swapped", [False, True], ids=["punch", "body"])
@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_a_force_as_of_a_wider_contact_is_told_by_its_width(swapped: bool, scale: float) -> None:
    """0.03 of 0.6 m at either end: 10 %.  The largest of the run is told, and when it was."""
    interface = scene(swapped=swapped, scale=scale)
    told = row(interface, *(level(interface, wider(by), t, scale=scale) for by, t in ((0.03, 1.0), (0.01, 2.0))))
    assert told is not None
    assert told.number == pytest.approx(0.1, rel=1e-9)
    assert (told.verdict, told.t) == (TrustVerdict.NOTED, 1.0)
    assert "narrow column" in told.remedy
    assert "10 % too large" in told.what


@pytest.mark.parametrize("swapped", [False, True], ids=["punch", "body"])
def test_it_is_told_alike_however_the_scene_lies(swapped: bool) -> None:
    interface = scene(swapped=swapped)
    told = row(interface, level(interface, wider(0.07)))
    for angle in (0.4, 2.0, -1.2):
        there = turned(interface, angle, (3.0, -1.0))
        now = level(interface, wider(0.07), x=there.nodes)
        other = row(interface, now)
        assert told is not None
        assert other is not None
        assert other.number == pytest.approx(told.number, rel=1e-9)
        assert other.verdict is TrustVerdict.BROKEN


def test_about_an_axis_the_outer_end_counts_by_its_radius() -> None:
    interface = scene(geometry="axisymmetric")
    F = np.pi * (1.1**2 - 0.5**2)
    ends = [np.pi * 0.1 * (2.0 * 1.1 + 1.0) / 3.0, np.pi * 0.1 * (2.0 * 0.5 + 0.6) / 3.0]  # m2 of the last nodes
    for at, area in zip((1.1, 0.5), ends, strict=True):
        told = row(interface, level(interface, {at: 1.8}))
        assert told is not None
        assert told.number == pytest.approx(0.8 * area / F, rel=1e-9)


def test_the_end_of_a_punch_within_an_edge_is_told_by_its_last_nodes() -> None:
    """The body is the slave; the punch ends half an edge on."""
    interface = scene(off=0.05, swapped=True)
    share = covered(interface, 0.5, 1.15)
    at = interface.nodes[interface.pair_nodes, 0]
    side = interface.pair_sides[0].at
    faced = {x: 0.1 * float(share[side][np.abs(at[side] - x) < 1e-9][0]) for x in (1.1, 1.2)}
    assert faced == pytest.approx({1.1: 0.0875, 1.2: 0.0125})
    told = row(interface, level(interface, {1.1: 1.2, 1.2: 4.0}, last=1.15))
    assert told is not None
    assert told.number == pytest.approx((0.2 * 0.0875 + 3.0 * 0.0125) / 0.65, rel=1e-6)
    # A sliver that faces the punch is not yet its end: what lies beyond the next node need not yield.
    beyond = interface.nodes[interface.quads].mean(axis=1)[:, 0] > 1.2
    told = row(interface, level(interface, {1.1: 2.0}, last=1.1 + 1e-4), flows=~beyond)
    assert told is not None
    assert told.number == pytest.approx(0.05 / 0.6, rel=0.02)


@pytest.mark.parametrize(("pressures", "what"), [
    ({}, "no more than it bears"),
    ({0.5: 0.3, 1.1: 0.0}, "a pressure that falls to the end"),
    ({0.5: 1.9, 0.6: 1.9, 0.7: 1.9, 0.8: 1.9, 0.9: 1.9, 1.0: 1.9, 1.1: 0.5}, "a pressure that is higher inside"),
])
def test_what_the_body_bears_is_not_told(pressures: dict[float, float], what: str) -> None:
    interface = scene()
    told = row(interface, level(interface, pressures))
    assert told is not None, what
    assert told.number < (0.2 if "inside" in what else 1e-12), what
    assert told.verdict is not TrustVerdict.BROKEN, what


def test_a_pressure_that_rises_inwards_is_held_against_that() -> None:
    """At a place between the end and what is pressed further inside the body bears what is between."""
    interface = scene(12)
    p = {0.5 + 0.05 * k: 1.0 + 0.5 * min(k, 12 - k) / 2.0 for k in range(13)}
    p = {x: min(v, 2.0) for x, v in p.items()}
    told = row(interface, level(interface, p))
    assert told is not None
    assert told.number < 0.02


@pytest.mark.parametrize("swapped", [False, True])
def test_where_the_yielding_body_ends_nothing_is_dragged_along(swapped: bool) -> None:
    """A block as wide as the die; a soft block on a wider body."""
    interface = scene(wide=0.6, swapped=swapped)
    told = row(interface, level(interface, wider(0.07)))
    assert told is not None
    assert told.number == 0.0
    interface = scene(swapped=swapped)
    soft_punch = model(bodies={"low": {"material": "hard"}, "up": {"material": "soft"}})
    told = row(interface, level(interface, wider(0.07)), of=soft_punch)
    assert told is not None
    assert told.number == 0.0


@pytest.mark.parametrize("of", [
    model(bodies={"low": {"material": "hard"}, "up": {"material": "hard"}}),
    model(bodies={"low": {"material": "soft", "rigid": True}, "up": {"material": "hard"}}),
    model(dynamics={}), {"half": "rigid"},
], ids=["elastic", "rigid", "inertia", "another half"])
def test_of_bodies_that_cannot_yield_there_is_no_row(of: dict[str, Any]) -> None:
    interface = scene()
    assert row(interface, level(interface, wider(0.07)), of=of) is None


def test_a_part_of_a_body_may_yield() -> None:
    parts = model(bodies={"low": {"material": "hard", "regions": {"low.r": {"material": "soft"}}},
                          "up": {"material": "hard"}})
    interface = scene()
    told = row(interface, level(interface, wider(0.03)), of=parts)
    assert told is not None
    assert told.number == pytest.approx(0.1)


def test_creep_counts_as_flow() -> None:
    interface, of = scene(), model(materials={"soft": {"creep": {"K": 1e8, "m": 0.1}}, "hard": HARD})
    ends, n = ContactEnds(interface, of), len(interface.quads)
    still = {"peeq": np.zeros(n), "sigma_v": np.full(n, YIELDS)}
    log = EndLog(flowed=np.zeros(n))
    for ceeq, number in ((0.0, 0.0), (1e-6, 0.1)):
        log = ends.watched(log, still | {"ceeq": np.full(n, ceeq)}, level(interface, wider(0.03)))
        (told,) = ends.checks(log)
        assert told.number == pytest.approx(number, rel=1e-9)


def test_only_what_yields_by_then_is_told() -> None:
    interface = scene()
    told = row(interface, level(interface, wider(0.03)), flows=False)
    assert told is not None
    assert told.number == 0.0
    # It has flowed, and is held now.
    told = row(interface, level(interface, {}), level(interface, wider(0.03), 2.0), flows=(True, False))
    assert told is not None
    assert told.number == 0.0


def test_what_two_pairs_press_side_by_side_is_no_end() -> None:
    """The cell beyond is pressed too."""
    interface = scene(swapped=True)
    now = level(interface, wider(0.07))
    at, side = interface.nodes[interface.pair_nodes, 0], interface.pair_sides[0].at
    t_N, share = now.t_N.copy(), now.covered.copy()
    beyond = np.flatnonzero((np.abs(at[side] - 1.2) < 1e-9) | (np.abs(at[side] - 0.4) < 1e-9)) + side.start
    other = Interface(**{**vars_of(interface), "pairs": (interface.pairs[0], interface.pairs[0].__class__(
        "next", "low.top", "up.left", gap_max=0.1, eps_N=1e9))})
    of_next = next(s for s in other.pair_sides if s.pair == "next" and s.surface == "low.top").at
    grown = [np.concatenate([v, np.zeros(other.pair_nodes.size - v.size)]) for v in (t_N, share)]
    grown[0][of_next.start + beyond - side.start], grown[1][of_next.start + beyond - side.start] = -BEARS, 1.0
    alone = Level(1.0, now.T, now.x, np.where(np.arange(grown[0].size) < t_N.size, grown[0], 0.0),
                  np.zeros(grown[0].size), grown[1])
    both = Level(1.0, now.T, now.x, grown[0], np.zeros(grown[0].size), grown[1])
    ends, n = ContactEnds(other, model()), len(other.quads)
    told = []
    for one in (alone, both):
        log = EndLog(flowed=np.zeros(n))
        log = ends.watched(log, {"peeq": np.ones(n), "sigma_v": np.full(n, YIELDS)}, one)
        told.append(log.excess.get("face", (0.0,))[0])
    assert told[0] == pytest.approx(0.14 * BEARS)
    assert told[1] == 0.0


@pytest.mark.parametrize("behind", [0.0, 0.1])
def test_a_load_on_a_line_is_borne_by_what_lies_behind(behind: float) -> None:
    """A sheet that bends lifts off a punch behind its corner, and carries its load there."""
    interface = scene()
    pressures = dict.fromkeys([0.5 + 0.1 * k for k in range(5)], 0.0) | {1.0: behind, 1.1: 1.9}
    told = row(interface, level(interface, pressures))
    assert told is not None
    assert told.number == 0.0


def test_a_contact_of_one_edge_is_told_once() -> None:
    interface = scene(1)
    told = row(interface, level(interface, {0.5: 1.1, 1.1: 1.1}))
    assert told is not None
    assert told.number == pytest.approx(0.1, rel=1e-9)


def test_in_plane_stress_a_body_bears_less() -> None:
    interface = scene()
    least = 1.0 / (1.0 + 0.5 * np.pi)
    flat = dict.fromkeys([0.5 + 0.1 * k for k in range(7)], least)
    much = {**flat, 0.5: 1.6 * least, 1.1: 1.6 * least}
    for state, number in (("plane_stress", 0.1), ("plane_strain", 0.0)):
        told = row(interface, level(interface, much), of=model(state=state))
        assert told is not None
        assert told.number == pytest.approx(number, abs=1e-9)


PUNCH = """
slideline: 2
units: {{temperature: K}}
geometry: {geometry}
signals: {{stroke: {{t: [0, 1], value: [0, -1.0e-4]}}}}
materials:
  soft: {{rho: 7800, k: 40, c: 500, E: 2.0e11, nu: 0.3, alpha: 0, plastic: {{s_y: 1.0e8}}}}
  hard: {{rho: 7800, k: 40, c: 500, E: 2.0e11, nu: 0.3, alpha: 0}}
bodies:
  body: {{mesh: {{rectangle: {{origin: [0, -0.04], size: [0.04, 0.04], cells: [{m}, {m}]}}}}, material: soft, T0: 300}}
  punch: {{mesh: {{rectangle: {{origin: [0, 0], size: [{wide}, 0.005], cells: [{n}, 2]}}}}, material: hard, T0: 300}}
contact: {{face: {{slave: {slave}, master: {master}, gap_max: 5.0e-4}}}}
thermal: {{}}
mechanical:
  half: elastic
  elastic:
    tolerance: 1.0e-6
    bodies: {{punch: {{rigid: true}}}}
    boundary:
      - {{on: body.bottom, u_y: 0}}
      - {{on: body.left, u_x: 0}}
      - {{on: body.right, u_x: 0}}
      - {{body: punch, u_x: 0, u_y: stroke, angle: 0}}
coupling: {{scheme: staggered, end: 1, windows: [{{until: 1, size: 0.1}}]}}
output: {{checkpoint: 0.5, fields: {{every: 2}}}}
"""


def punched(folder: Path, n: int, geometry: str = "plane", swapped: bool = False, off: float = 0.0) -> Results:
    """A punch of 10 mm (and `off` edges) on n cells."""
    sides = ("body.top", "punch.bottom") if swapped else ("punch.bottom", "body.top")
    file = folder / f"{geometry}{n}{swapped}{off}.yaml"
    file.write_text(PUNCH.format(n=n, m=4 * n, geometry=geometry, slave=sides[0], master=sides[1],
                                 wide=0.01 * (1.0 + off / n)))
    return run(load_scenario(file), out=file.with_suffix(".h5"))


def told_and_force(results: Results) -> tuple[float, float]:
    """The number of the row, and the largest pressure [Pa] over the face in the mean."""
    _, F = results.field("mechanical.reaction.punch")
    return next(float(c.number) for c in results.trust if c.name == NAME), float(np.abs(F[:, 1]).max())


def test_a_punch_on_three_cells_presses_a_tenth_too_hard(tmp_path: Path) -> None:
    results = punched(tmp_path, 3)
    told, F = told_and_force(results)
    true = F / (BEARS * 0.01) - 1.0
    assert 0.07 < true < 0.12
    assert 0.6 * true < told < 1.5 * true


def test_a_run_that_went_on_tells_the_same(tmp_path: Path) -> None:
    whole = told_and_force(punched(tmp_path, 3))
    scenario = load_scenario(tmp_path / "plane3False0.0.yaml")
    run(scenario, out=tmp_path / "part.h5", until=0.5)
    assert told_and_force(resume(tmp_path / "part.h5")) == whole


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("swapped", [False, True], ids=["punch", "body"])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a_punch_on_some_cells_is_told_within_a_factor_of_two(tmp_path: Path, geometry: str, swapped: bool,
                                                             off: float) -> None:
    """Prandtl in plane strain; about an axis 3.05 of the yield stress, from smaller and smaller cells."""
    for n in (3, 6):
        told, F = told_and_force(punched(tmp_path, n, geometry, swapped, off))
        R = 0.01 * (1.0 + off / n)
        true = F / (BEARS * R if geometry == "plane" else 3.05 * YIELDS * np.pi * R**2) - 1.0
        assert 0.5 * true < told < 2.0 * true, n
