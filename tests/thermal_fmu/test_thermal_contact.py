"""Heat between bodies: laws, films and shares of an edge (D1, D2, D3, D4, D11, F1's closed forms)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, imbalance, inputs_of, run, scene, spec

from contact.half.contact_client import ContactSurfaces
from contact.half.interface import Pair
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu.contact_quadrature import contact_points
from thermal_fmu.half import load

LINKS = {"flat": FlatContact, "service": lambda: DirectLink(ContactService().handle)}


@pytest.fixture(params=LINKS)
def link(request):
    """A small service of the tests' own, and the real one."""
    return LINKS[request.param]()


def two_bodies(boundary, k=(210.0, 45.0), rho_c=(2.75e6, 3.744e6), T0=(300.0, 300.0), pairs=None, **more):
    """A model.json for bodies a and b of two materials."""
    return spec(boundary, **more) | {
        "materials": {"p": {"rho": 1000.0, "k": k[0], "c": rho_c[0] / 1000.0},
                      "q": {"rho": 1000.0, "k": k[1], "c": rho_c[1] / 1000.0}},
        "bodies": {"a": {"material": "p", "T0": T0[0]}, "b": {"material": "q", "T0": T0[1]}},
        "pairs": pairs or {}}


def stacked(nx=(3, 4), ny=(10, 5), gap=0.0, lengths=(0.1, 0.05), geometry="plane", slide=0.0):
    """Body a below, body b above it by a gap; b is the slave."""
    return scene(Box(0.0, 0.1, 0.0, lengths[0], nx[0], ny[0]),
                 Box(slide, 0.1 + slide, lengths[0] + gap, lengths[0] + gap + lengths[1], nx[1], ny[1]),
                 geometry=geometry, pairs=(Pair("p", "b.bottom", "a.top", 0.1, 1e9),))


def ends(T_a, T_b):
    return [{"on": "a.bottom", "temperature": T_a},
            {"on": "b.top", "temperature": T_b}]


def pressed(mesh, p=1e6):
    return np.full(len(mesh.pair_nodes), -p)


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_d1_bars_in_series(link, geometry):
    """Aluminium and steel through h = 2000, 3 against 4 edges: exact, since T is linear in each bar."""
    case = EXPECTED["D1"]
    mesh = stacked(geometry=geometry)
    model = two_bodies(ends(500.0, 300.0), method="steady",
                       pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 2000.0}, "open": None}}})
    ran = run(mesh, model, 1.0, 1, link, t_N=pressed(mesh))
    area = 0.1 if geometry == "plane" else np.pi * 0.01
    top = np.unique(mesh.surfaces["a.top"])
    bottom = np.unique(mesh.surfaces["b.bottom"])
    # The page gives seven digits after q's first three.
    assert np.abs(ran.T[-1, top] - case["T1"]).max() < 1e-5
    assert np.abs(ran.T[-1, bottom] - case["T2"]).max() < 1e-5
    assert abs(ran.outputs[-1]["heat.contact.slave"] / (case["q"] * area) - 1.0) < 1e-9
    assert ran.outputs[-1]["contact.touching"] == 12
    assert ran.outputs[-1]["heat.gap.slave"] == 0.0


@pytest.mark.few("service")
def test_d2_two_half_spaces(link):
    """Graded bars of .6 and .4 m, dt grown by 4 % from 2 ms: surface temperatures and flux within 2e-3."""
    case = EXPECTED["D2"]
    mesh = scene(Box(0, 0.1, 0, 0.6, 1, 60), Box(0, 0.1, 0.6, 1.0, 1, 60),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 1e9),), move=_graded)
    model = two_bodies([], T0=(500.0, 300.0), pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 2000.0},
                                                                          "open": None}}})
    for t_end, q in zip(case["t"], case["q"], strict=True):
        n = 120
        steps = 1.04 ** np.arange(n)
        ran = run(mesh, model, steps * t_end / steps.sum(), 0, link, t_N=pressed(mesh))
        surface = [ran.T[-1, np.unique(mesh.surfaces[name])].mean() for name in ("a.top", "b.bottom")]
        assert abs(2000.0 * (surface[0] - surface[1]) / q - 1.0) < 2e-3
        if t_end == 10:
            assert np.abs(np.subtract(surface, case["T_10"])).max() < 0.1
        assert ran.imbalance() < EXPECTED["A16"]["tolerance"]


def _graded(X):
    """Quadratic grading away from the interface y = .6: its first cells are a tenth of a millimetre."""
    length = np.where(X[:, 1] > 0.6, 0.4, 0.6)
    s = (X[:, 1] - 0.6) / length
    return np.stack([X[:, 0], 0.6 + length * s * np.abs(s)], axis=1)


def test_d3_what_leaves_one_side_enters_the_other(link):
    """Partly overlapping, 24 against 31 edges, both branches: to 1e-13 of what passes."""
    mesh = stacked(nx=(24, 31), slide=0.0337, gap=1e-4)
    laws = {"p": {"conduction": {"closed": {"law": "constant", "h": 3000.0},
                                 "open": {"law": "gas", "k_g": 0.05, "g_m": 2e-5}}}}
    t_N = np.where(mesh.nodes[mesh.pair_nodes, 0] < 0.08, -1e6, 0.0)
    ran = run(mesh, two_bodies(ends(500.0, 300.0), pairs=laws), 1.0, 5, link, t_N=t_N)
    for out in ran.outputs:
        for mechanism in ("contact", "gap"):
            slave, master = out[f"heat.{mechanism}.slave"], out[f"heat.{mechanism}.master"]
            assert slave > 0
            assert abs(slave + master) < EXPECTED["D3"]["tolerance"] * abs(slave)
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]


def test_d4_unit_gap(link):
    """h = k_g/g over 1 m with k_g = 1, faces held at 200 and 100: q = 100."""
    mesh = scene(Box(0, 1, 0, 1, 4, 2), Box(0, 1, 2, 3, 3, 2), pairs=(Pair("p", "b.bottom", "a.top", 2.0, 1e9),))
    model = two_bodies([{"on": s, "temperature": T}
                        for s, T in (("a.top", 200.0), ("b.bottom", 100.0))], T0=(200.0, 100.0),
                       method="steady", pairs={"p": {"conduction": {"closed": None,
                                                                    "open": {"law": "gas", "k_g": 1.0, "g_m": 1e-13}}}})
    out = run(mesh, model, 1.0, 1, link).outputs[-1]
    assert abs(out["heat.gap.slave"] / EXPECTED["D4"]["q"] - 1.0) < 1e-12
    assert abs(out["heat.gap.master"] / EXPECTED["D4"]["q"] + 1.0) < 1e-12


@pytest.mark.parametrize("slide", [-0.093, -0.05, 0.0, 0.0123456, 0.05, 0.0999])
def test_d11_partial_overlap(link, slide):
    """Rigid blocks, uniform T: Q = h w dT at every slide position."""
    mesh = stacked(nx=(5, 7), slide=slide)
    everywhere = [{"on": f"{b}.{s}", "temperature": T} for b, T in (("a", 500.0), ("b", 300.0))
                  for s in ("top", "bottom")]
    model = two_bodies(everywhere, T0=(500.0, 300.0), method="steady",
                       pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 2000.0}, "open": None}}})
    out = run(mesh, model, 1.0, 1, link, t_N=pressed(mesh)).outputs[-1]
    Q = 2000.0 * (0.1 - abs(slide)) * 200.0
    assert abs(out["heat.contact.slave"] / Q - 1.0) < EXPECTED["D11"]["tolerance"]


@pytest.mark.parametrize(("gap", "touching", "share"), [(3.5e-3, False, 0.5), (2e-4, False, 0.0), (8e-3, False, 1.0),
                                                        (3.5e-3, True, 0.0)])
@pytest.mark.parametrize("slide", [0.0, 0.037])
def test_films_take_kappa_where_faced_and_all_where_not(link, gap, touching, share, slide):
    """Uniform bodies at 400 and 300, gas at 200: film = h (uncovered + kappa covered), both sides; Eq. (7)."""
    mesh = stacked(nx=(5, 7), gap=gap, slide=slide)
    films = [{"on": s, "convection": {"h": 40.0, "T": 200.0, "gap": {"d_cut": 1e-3, "d_full": 6e-3}}, "name": n}
             for s, n in (("a.top", "lower"), ("b.bottom", "upper"))]
    model = two_bodies([*films, *ends(400.0, 300.0), {"on": "a.top", "temperature": 400.0},
                        {"on": "b.bottom", "temperature": 300.0}], T0=(400.0, 300.0),
                       method="steady", pairs={})
    t_N = pressed(mesh) if touching else 0.0 * pressed(mesh)
    covered = 0.1 - slide
    area = slide + share * covered
    for lower, upper in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        out = run(mesh, model, 1.0, 1, link, t_N=t_N, load_lower=lower, load_upper=upper).outputs[-1]
        expected = -40.0 * area * (lower * 200.0 + upper * 100.0)
        assert abs(out["heat.convection"] - expected) < 1e-10 * 40 * 200 * 0.1


def test_a_film_without_gaps_and_a_film_in_no_pair_convect_fully(link):
    mesh = stacked()
    films = [{"on": "b.bottom", "convection": {"h": 40.0, "T": 200.0}},
             {"on": "a.left", "convection": {"h": 40.0, "T": 200.0, "gap": {"d_cut": 1e-3, "d_full": 6e-3}}}]
    held = [{"on": s, "temperature": 300.0} for s in ("b.bottom", "a.left", "b.top")]
    out = run(mesh, two_bodies([*films, *held], method="steady"), 1.0, 1, link, t_N=pressed(mesh)).outputs[-1]
    assert abs(out["heat.convection"] / (-40.0 * 100.0 * 0.2) - 1.0) < 1e-12


def blocks(n, gap):
    """The two blocks of case F1, n against n + 7 edges, with its model.json (degC on the page: K here)."""
    L = 0.0762
    mesh = scene(Box(0, L, 0, L, n, n), Box(0, L, L + gap, 2 * L + gap, n + 7, n),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 1e9),))
    films = [{"on": s, "convection": {"h": 40.0, "T": 473.15, "gap": {"d_cut": 1e-3, "d_full": 6e-3}}}
             for s in ("a.top", "b.bottom")]
    laws = {"p": {"conduction": {"closed": {"law": "power", "h0": 2000, "h1": 6000, "p0": 1e7, "exponent": 0.95,
                                            "p_max": 1e7}, "open": {"law": "gas", "k_g": 0.05, "g_m": 25e-6},
                                            "open_factor": {"t": [0, 2500, 2500], "value": [0, 0, 1]}}}}
    model = two_bodies(ends(273.15, 1273.15) + films, k=(30.0, 30.0), rho_c=(4e6, 4e6), T0=(273.15, 1273.15),
                       pairs=laws)
    return mesh, model


def test_f1_at_rest_before_and_after_touch(link):
    """The closed forms of the scene: 18.44590 apart, 487.9923 and q 192122.96 at h 8000 (degC scale)."""
    mesh, model = blocks(6, 0.0508)
    top = np.unique(mesh.surfaces["a.top"])
    apart = run(mesh, model, 100.0, 25, link)
    assert np.abs(apart.T[-1, top] - 273.15 - EXPECTED["F1"]["closed_form_2500"]).max() < 0.05
    mesh, model = blocks(6, 0.0)
    touch = run(mesh, model | {"method": "steady"}, 1.0, 1, link, t_N=pressed(mesh, 1e7))
    assert np.abs(touch.T[-1, top] - 273.15 - 487.9923).max() < 1e-4
    assert abs(touch.outputs[-1]["heat.contact.master"] / (192122.96 * 0.0762) - 1.0) < 1e-7


def test_factors_switch_branches(link):
    """open_factor jumps from 0 to 1 at 2500 s: nothing through the gap before, heat from then on."""
    mesh, model = blocks(4, 5e-4)
    ran = run(mesh, model, 500.0, 7, link)
    assert [o["heat.gap.slave"] == 0.0 for o in ran.outputs] == [True] * 5 + [False] * 2
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]


@pytest.mark.few("service")
def test_balance_over_a_long_slide(link):
    """200 substeps with pieces changing at every one: the ledger of the run closes, one solve each.

    Where a column of nodes comes into contact the step overshoots: it is taken again in four.
    """
    mesh, model = blocks(8, 0.0)
    half = load(mesh, model)
    given = inputs_of(mesh, half, t_N=pressed(mesh, 1e7))
    state, _ = half.start(given, 0.0, link)
    outputs = []
    upper = mesh.node_body == 1
    for i in range(200):
        x = mesh.nodes + np.where(upper, 4.3e-4 * i, 0.0)[:, None] * np.array([1.0, 0.0])
        done = half.step(state, given | {"x": x}, 9.0 * i, 9.0, link)
        state = done.state
        outputs.append(dict(done.outputs))
    assert imbalance(outputs) < EXPECTED["A16"]["tolerance"]
    iterations = np.array([o["iterations"] for o in outputs[1:]])
    assert set(iterations) <= {1.0, 5.0}
    assert (iterations == 5.0).sum() <= 2


def test_a_corner_that_stands_below_closes_nothing_beside():
    """One node, two pairs: it stands on the floor, and presses neither a wall a millimetre away nor one in touch."""
    pairs = Pair("wall", "a.right", "b.left", 0.01, 1e9), Pair("floor", "a.bottom", "c.top", 0.01, 1e9)
    interface = scene(Box(0.0, 0.1, 0.0, 0.05, 2, 2), Box(0.101, 0.15, 0.0, 0.05, 2, 2),
                      Box(0.0, 0.15, -0.05, 0.0, 3, 2), pairs=pairs, names=("a", "b", "c"))
    surfaces = ContactSurfaces(interface)
    facing = surfaces.facing(DirectLink(ContactService().handle), interface.nodes)
    floor, beside = interface.side_of("floor", "a.bottom"), interface.side_of("wall", "a.right")
    t_N = np.zeros(interface.pair_nodes.size)
    t_N[floor.at] = -1e6
    points = contact_points(surfaces, facing, t_N, interface.nodes)
    wall = points.pair == 0
    assert points.p[~wall] == pytest.approx(1e6)
    assert (points.p[wall] == 0.0).all()
    assert points.gap[wall] == pytest.approx(1e-3)
    moved = interface.nodes - np.where(interface.node_body == 1, 1e-3, 0.0)[:, None] * np.array([1.0, 0.0])
    facing = surfaces.facing(DirectLink(ContactService().handle), moved)
    points = contact_points(surfaces, facing, t_N, moved)
    assert points.p[points.pair == 1] == pytest.approx(1e6)
    assert (points.p[points.pair == 0] == 0.0).all()
    # Pressed against the wall, it is the wall's own pressure that closes it.
    t_N[beside.at] = -2e5
    points = contact_points(surfaces, facing, t_N, moved)
    assert points.p[points.pair == 1] == pytest.approx(1e6)
    assert points.p[points.pair == 0] == pytest.approx(2e5)


def test_what_presses_a_surface_as_a_master_closes_nothing_it_faces_as_a_slave():
    """A lid on its contents, a millimetre off its seat: the node between the two is pressed from below by one only."""
    pairs = Pair("seat", "a.bottom", "b.top", 0.01, 1e9), Pair("top", "c.top", "a.bottom", 0.01, 1e9)
    interface = scene(Box(0.0, 0.1, 0.0, 0.05, 3, 1), Box(0.05, 0.1, -0.05, -0.001, 2, 1),
                      Box(0.0, 0.05, -0.05, 0.0, 2, 1), pairs=pairs, names=("a", "b", "c"))
    surfaces = ContactSurfaces(interface)
    facing = surfaces.facing(DirectLink(ContactService().handle), interface.nodes)
    t_N = np.zeros(interface.pair_nodes.size)
    for surface in ("c.top", "a.bottom"):
        t_N[interface.side_of("top", surface).at] = -1e6
    points = contact_points(surfaces, facing, t_N, interface.nodes)
    assert points.p[points.pair == 1] == pytest.approx(1e6)
    assert (points.p[points.pair == 0] == 0.0).all()
    assert points.gap[points.pair == 0] == pytest.approx(1e-3)
