"""Tied pairs in the elastic half: two bodies are one on any meshes, in pull, shear, bending, heat and motion."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import STEEL, block, blocks, done, elastic, hold, inputs_of, stress_of

from contact.half.interface import Pair
from contact.rpc.link import open_link
from mechanical_fmu.elastic_half import load

P, E, NU = 1e6, 2e11, 0.3
SEMI_SMOOTH = {"interface": {"augmented": {"tolerance": 1e-9}}}
DEFAULT = {"interface": {"augmented": {}}}
UZAWA = {"interface": {"augmented": {"tolerance": 1e-9, "method": "uzawa"}}}


def tied(interface, exchange=False):
    """The pairs of an interface bonded, with the other side for the slave if asked."""
    pairs = [replace(p, tied=True, slave=p.master if exchange else p.slave, master=p.slave if exchange else p.master)
             for p in interface.pairs]
    return replace(interface, pairs=tuple(pairs))


def turned(x, angle):
    c, s = np.cos(angle), np.sin(angle)
    return x @ np.array([[c, s], [-s, c]])


def ramp(value):
    return {"t": [0, 1], "value": [0, value]}


def run(interface, boundary, steps=1, T=None, **more):
    """The half, its state at 1 s and its outputs."""
    half = elastic(interface, boundary, **({"tolerance": 1e-11, "pairs": SEMI_SMOOTH} | more))
    with closing(open_link("direct")) as link:
        state, outputs = half.start(inputs_of(half), 0.0, link)
        for k in range(steps):
            state, outputs = done(half.step(state, inputs_of(half, T), k / steps, 1.0 / steps, link))
    return half, state, outputs


def stresses(half, state):
    n = len(half.system.interface.nodes)
    return np.concatenate([s.reshape(-1, 4) for s in stress_of(half, state, np.full(n, 300.0))])


# The patch test

def outer(interface):
    """Nodes of the outside of both bodies but for what is tied, with its ends."""
    names = [n for n in interface.surfaces if n not in ("upper.bottom", "lower.top")]
    return np.unique(np.concatenate([interface.surfaces[n].ravel() for n in names]))


def stretched(interface, F, **more):
    """Stress of both bodies with x = F X all around."""
    interface = replace(interface, node_sets={f"lower.n{n}": np.array([n], np.int32) for n in outer(interface)})
    boundary = []
    for n in outer(interface):
        u = (F - np.eye(2)) @ interface.nodes[n]
        boundary += [hold(f"lower.n{n}", c, ramp(float(u[c]))) for c in range(2)]
    half, state, outputs = run(interface, boundary, **more)
    return half, stresses(half, state), outputs


def graded(x):
    """Nodes of both blocks drawn together towards one side, each body to another."""
    low = x[:, 1] <= 1.0
    return np.column_stack([np.where(low, x[:, 0] ** 1.4, x[:, 0] ** 0.8), x[:, 1]])


MESHES = {
    "3 on 4": blocks(3, 4), "7 on 5": blocks(7, 5), "triangles on quads": blocks(3, 4, kinds=("quads", "triangles")),
}
SMALL = 1e-3 * np.array([[1.0, 0.4], [-0.2, 2.0]])
LARGE = np.array([[1.1, 0.2], [0.05, 0.8]])


@pytest.mark.few("plane_strain-even-0.0-3 on 4", "plane_stress-graded-0.7-7 on 5", "plane_stress-even-0.0-3 on 4")
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize("shape", ["even", "graded"])
@pytest.mark.parametrize("state", ["plane_strain", "plane_stress"])
def test_one_stress_fills_both_bodies(name, angle, shape, state):
    interface = tied(MESHES[name])
    x = graded(interface.nodes) if shape == "graded" else interface.nodes
    interface = replace(interface, nodes=np.ascontiguousarray(turned(x, angle)))
    _, stress, outputs = stretched(interface, np.eye(2) + SMALL, state=state, pairs=DEFAULT, tolerance=1e-8)
    # Until what tractions went on to change by was asked for, too, that was up to 2e-7 by this tolerance, the default.
    assert np.abs(stress - stress[0]).max() <= 1e-10 * np.abs(stress).max()
    assert (outputs["contact.status"] == 4.0).all()
    if state == "plane_stress":
        return  # the joint's tractions are those of the depth as drawn, the cells' of what is left of it
    # What the joint carries is that stress on its plane as it lies now, the slave looking down.
    t = (np.eye(2) + SMALL) @ turned(np.array([[1.0, 0.0]]), angle)[0]
    t /= np.linalg.norm(t)
    n = np.array([t[1], -t[0]])
    sigma = np.array([[stress[0, 0], stress[0, 2]], [stress[0, 2], stress[0, 1]]])
    slave = run_slave(interface)
    np.testing.assert_allclose(outputs["contact.t_N"][slave], n @ sigma @ n, rtol=1e-6)
    np.testing.assert_allclose(outputs["contact.t_T"][slave], t @ sigma @ n, rtol=1e-6)


def run_slave(interface):
    return next(side.at for side in interface.pair_sides if side.own)


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("exchange", [False, True])
def test_it_does_so_under_large_strains_with_either_side_as_slave(name, exchange):
    _, stress, _ = stretched(tied(MESHES[name], exchange), LARGE, steps=3)
    assert np.abs(stress - stress[0]).max() <= 1e-9 * np.abs(stress).max()


@pytest.mark.parametrize("name", MESHES)
def test_it_does_so_about_an_axis(name):
    lower, upper = {"3 on 4": (3, 4), "7 on 5": (7, 5), "triangles on quads": (3, 4)}[name]
    kinds = ("quads", "triangles") if "triangles" in name else ("quads", "quads")
    interface = tied(blocks(lower, upper, kinds=kinds, geometry="axisymmetric", r0=0.5))
    _, stress, _ = stretched(interface, np.diag([1.001, 0.998]))
    assert np.abs(stress - stress[0]).max() <= 1e-9 * np.abs(stress).max()


@pytest.mark.parametrize("way", ["penalty", "uzawa", "modified_newton", "bfgs"])
def test_every_enforcement_passes_it(way):
    more = {"penalty": {"pairs": {}}, "uzawa": {"pairs": UZAWA}}.get(way, {"method": way})
    interface = tied(blocks(3, 4))
    # Pulled at its top; what a spring yields then changes no stress.
    half, state, _ = run(interface, [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0),
                                     {"on": "upper.top", "pressure": ramp(-P)}], **more)
    stress = stresses(half, state)
    assert np.abs(stress[:, 1] - P).max() <= 1e-9 * P
    assert np.abs(stress[:, 2]).max() <= 1e-9 * P


# As one body

def sheared(interface, body, **more):
    top = [f"{name}.top" for name in interface.bodies][-1]
    return run(interface, [hold(f"{body}.bottom", 0), hold(f"{body}.bottom", 1),
                           {"on": top, "t_x": ramp(10 * P), "t_y": ramp(3 * P)}], **more)


def test_meshes_that_match_are_one_mesh():
    whole = block(np.linspace(0, 1, 5), np.linspace(0, 2, 9))
    _, _, one = sheared(whole, "block", pairs={})
    halves = tied(blocks(4, 4))
    _, _, two = sheared(halves, "lower")
    tip = np.flatnonzero((halves.nodes == [1.0, 2.0]).all(axis=1))[0]
    np.testing.assert_allclose(two["x"][tip] - [1.0, 2.0], one["x"][-1] - [1.0, 2.0], rtol=1e-9)


@pytest.mark.parametrize("exchange", [False, True])
@pytest.mark.parametrize(("nu", "rel"), [(0.0, 1e-8), (0.3, 1e-4)])
def test_a_bar_of_two_halves_bends_as_one(exchange, nu, rel):
    """Pure bending, whose stress is linear across the joint: on any two meshes that passes it, and plane sections stay.

    Poisson's contraction bends the section, which straight edges follow as far as they do.
    """
    M = 1e5  # Pa at the edge: small, so that the turn does not count
    tip = {}
    for name in ("one", "two"):
        interface = block(np.linspace(0, 1, 5), np.linspace(0, 2, 9)) if name == "one" else tied(blocks(3, 5), exchange)
        first, last = interface.bodies[0], interface.bodies[-1]
        nodes = np.flatnonzero(np.abs(interface.nodes[:, 1] - 2.0) < 1e-12)
        nodes = nodes[np.argsort(interface.nodes[nodes, 0])]
        x, force = interface.nodes[nodes, 0], np.zeros(nodes.size)
        for a, b in zip(range(nodes.size - 1), range(1, nodes.size), strict=True):
            h, s = x[b] - x[a], [M * (1.0 - 2.0 * x[a]), M * (1.0 - 2.0 * x[b])]
            force[a] += h * (2 * s[0] + s[1]) / 6.0
            force[b] += h * (s[0] + 2 * s[1]) / 6.0
        sets = {f"{last}.p{k}": np.array([n], np.int32) for k, n in enumerate(nodes)}
        corner = np.flatnonzero((interface.nodes == [0.5, 0.0]).all(axis=1))
        sets[f"{first}.pin"] = (corner if corner.size else np.flatnonzero((interface.nodes == 0.0).all(axis=1))
                                ).astype(np.int32)
        interface = replace(interface, node_sets=sets)
        boundary = [hold(f"{first}.bottom", 1), hold(f"{first}.pin", 0)]
        boundary += [{"on": f"{last}.p{k}", "f_y": ramp(float(f))} for k, f in enumerate(force)]
        _, _, outputs = run(interface, boundary, element="enhanced", state="plane_stress", tolerance=1e-13,
                            material={"nu": nu}, pairs={} if name == "one" else SEMI_SMOOTH)
        top = outputs["x"][nodes]
        tip[name] = (top[-1] - top[0])[1]
    assert tip["one"] == pytest.approx(-4.0 * M / E, rel=1e-6, abs=0.0)
    assert tip["two"] == pytest.approx(-4.0 * M / E, rel=rel, abs=0.0)


@pytest.mark.parametrize(("lower", "upper", "most"), [(3, 4, 6e-3), (6, 8, 4e-3)])
def test_a_sheared_bar_is_as_stiff_as_one(lower, upper, most):
    """On meshes that do not match the difference is within that of the meshes themselves."""
    n = lower
    one = sheared(block(np.linspace(0, 1, n + 1), np.linspace(0, 2, 2 * n + 1)), "block", pairs={})[2]["x"][-1]
    fine = sheared(block(np.linspace(0, 1, upper + 1), np.linspace(0, 2, 2 * upper + 1)), "block", pairs={})[2]["x"][-1]
    halves = tied(blocks(lower, upper))
    two = sheared(halves, "lower")[2]["x"][np.flatnonzero((halves.nodes == [1.0, 2.0]).all(axis=1))[0]]
    low, high = sorted([one[0] - 1.0, fine[0] - 1.0])
    assert low * (1 - most) <= two[0] - 1.0 <= high * (1 + most)


# Motion

@pytest.mark.parametrize("steps", [1, 3])
@pytest.mark.parametrize("gap", [0.0, 0.02])
def test_a_superposed_turn_changes_nothing(steps, gap):
    """Two blocks, pulled and sheared by their ends, and the same turned by a radian on the way."""
    interface = tied(blocks(3, 4, gap=gap))
    told = {}
    for angle in (0.0, 1.0):
        turn = {"about": [0.2, -0.3], "angle": ramp(angle)}
        half, state, outputs = run(interface, [{"on": "lower.bottom", "rotation": turn},
                                               {"on": "upper.top", "u_x": ramp(2e-4), "u_y": ramp(5e-4),
                                                "rotation": turn}], steps)
        told[angle] = stresses(half, state), outputs
    c, s = np.cos(1.0), np.sin(1.0)
    Q = np.array([[c, -s], [s, c]])
    still, turned_ = told[0.0][0], told[1.0][0]
    size = np.abs(still).max()
    for a, b in zip(still, turned_, strict=True):
        sigma = Q @ np.array([[a[0], a[2]], [a[2], a[1]]]) @ Q.T
        assert np.abs(sigma - [[b[0], b[2]], [b[2], b[1]]]).max() <= 1e-8 * size
    for name in ("contact.t_N", "contact.t_T"):
        t = told[0.0][1][name]
        np.testing.assert_allclose(told[1.0][1][name], t, rtol=0.0, atol=1e-8 * size)


def test_a_free_body_follows_what_it_is_tied_to():
    """Turned by its foot by two radians in one step: no stress."""
    interface = tied(blocks(3, 4))
    turn = {"about": [0.2, -0.3], "angle": ramp(2.0)}
    half, state, outputs = run(interface, [{"on": "lower.bottom", "rotation": turn}])
    assert np.abs(stresses(half, state)).max() <= 1e-9 * E
    np.testing.assert_allclose(outputs["x"] - [0.2, -0.3], turned(interface.nodes - [0.2, -0.3], 2.0), atol=1e-9)


@pytest.mark.parametrize("rigid", ["lower", "upper"])
def test_a_rigid_body_holds_what_it_is_tied_to(rigid):
    """Half a bar on a rigid foot, or a rigid head pulled: reaction and stress are those of the pull."""
    interface = tied(blocks(3, 4))
    half = load(interface, {"half": "elastic", "format": 2, "tolerance": 1e-11, "pairs": SEMI_SMOOTH,
                            "materials": {"m": STEEL | {"nu": 0.0}},
                            "bodies": {b: {"material": "m"} | ({"rigid": True} if b == rigid else {})
                                       for b in interface.bodies},
                            "boundary": [{"body": "lower", "u_x": 0, "u_y": 0, "angle": 0}
                                         if rigid == "lower" else {"on": "lower.bottom", "u_x": 0, "u_y": 0},
                                         {"body": "upper", "f_y": ramp(P)} if rigid == "upper"
                                         else {"on": "upper.top", "t_y": ramp(P)}]})
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        state, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    assert outputs["reaction.lower"] == pytest.approx([0.0, -P], abs=1e-6 * P)
    np.testing.assert_allclose(outputs["sigma"][outputs["sigma_v"] > 0.0][:, 1], P, rtol=1e-5)


# Heat

def test_a_bimetal_strip_bends_as_timoshenko_says():
    """kappa = 6 da dT (1 + m)2/(h (3 (1 + m)2 + (1 + m n)(m2 + 1/(m n)))), J. Opt. Soc. Am. 11 (1925) 233."""
    length, thick, dT, da = 0.2, (0.006, 0.004), 100.0, 1.1e-5
    E1, E2 = 1.0e11, 2.0e11

    def rectangle(n_x, n_y, y0, h, first):
        from mechanical_scenes import rectangle as made
        return made(np.linspace(0.0, length, n_x + 1), np.linspace(y0, y0 + h, n_y + 1), first=first)

    n1, c1, s1 = rectangle(40, 6, 0.0, thick[0], 0)
    n2, c2, s2 = rectangle(50, 5, thick[0], thick[1], len(n1))
    plain = blocks(1, 1)
    interface = replace(plain, nodes=np.concatenate([n1, n2]), quads=np.concatenate([c1, c2]).astype(np.int32),
                        quad_body=np.repeat([0, 1], [len(c1), len(c2)]).astype(np.int32), materials=("m1", "m2"),
                        surfaces={f"lower.{k}": v for k, v in s1.items()} | {f"upper.{k}": v for k, v in s2.items()},
                        node_sets={"lower.pin": np.array([0], np.int32)},
                        pairs=(Pair("interface", "upper.bottom", "lower.top", 1e-3, 1e13, tied=True),))
    material = {"nu": 0.3, "T_ref": 300.0}
    half = load(interface, {"half": "elastic", "format": 2, "tolerance": 1e-10, "pairs": SEMI_SMOOTH,
                            "state": "plane_stress", "element": "enhanced",
                            "materials": {"m1": material | {"E": E1, "alpha": 1e-6},
                                          "m2": material | {"E": E2, "alpha": 1e-6 + da}},
                            "bodies": {"lower": {"material": "m1"}, "upper": {"material": "m2"}},
                            "boundary": [hold("lower.left", 0), {"at": "lower.pin", "u_y": 0.0}]})
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        state, outputs = done(half.step(state, inputs_of(half, 300.0 + dT), 0.0, 1.0, link))
    bottom = np.unique(interface.surfaces["lower.bottom"])
    X, u = n1[bottom, 0], (outputs["x"] - interface.nodes)[bottom, 1]
    # Away from the free end, over a few thicknesses, where shear brings the stresses in; and from what is held.
    inner = (X > 0.03) & (X < 0.15)
    kappa = -2.0 * np.polyfit(X[inner], u[inner], 2)[0]
    m, n, h = thick[0] / thick[1], E1 / E2, sum(thick)
    exact = 6 * da * dT * (1 + m) ** 2 / (h * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))
    assert kappa == pytest.approx(exact, rel=5e-3)


def test_a_wave_passes_a_joint_of_like_meshes_as_if_there_were_none():
    """A push at one end, followed until it has gone to the other."""
    rho, cells = 7800.0, 8

    def pushed(interface, first, last, pairs):
        c = np.sqrt(E / rho)
        dt, steps = 1.0 / cells / c, 24
        half = elastic(interface, [{"on": f"{first}.bottom", "pressure": {"t": [0, 0], "value": [0, P]}}],
                       {"rho": rho, "nu": 0.0}, tolerance=1e-10, dynamics={}, pairs=pairs)
        with closing(open_link("direct")) as link:
            state, _ = half.start(inputs_of(half), 0.0, link)
            for k in range(steps):
                state, _ = done(half.step(state, inputs_of(half), k * dt, dt, link))
        end = np.unique(interface.surfaces[f"{last}.top"])
        return np.array(state.v).reshape(-1, 2)[end, 1].mean()

    one = pushed(block(np.linspace(0, 1, cells + 1), np.linspace(0, 2, 2 * cells + 1)), "block", "block", {})
    assert one > P / np.sqrt(E * rho)  # it has come, and doubles at the free end
    assert pushed(tied(blocks(cells, cells)), "lower", "upper", SEMI_SMOOTH) == pytest.approx(one, rel=1e-7)
