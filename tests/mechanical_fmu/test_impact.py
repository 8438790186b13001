"""Impact: bars against the exact wave at any penalty and step; what moving mass off surfaces keeps; energy.

A bar of length L that meets a wall with v (a like bar at rest: half of all) has the pressure rho c v (1 - exp(-t/tau))
until the wave is back at t = 2 L/c; tau = rho c/eps_N (half) is what the penalty's own softness makes of the front.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.half.state import from_bytes, frozen_copy, to_bytes
from contact.rpc.link import open_link
from mechanical_fmu.contact_mass import taken_along

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, blocks, done, elastic, hold, inputs_of, rectangle

E, RHO, V, L, GAP = 1e9, 1000.0, 0.1, 1.0, 1e-4


def modulus(nu):
    """Of a bar that is held across."""
    return E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))


def bars(kind, n, penalty, nu=0.0, cells="quads", geometry="plane", grade=1.0, swapped=False, across=2):
    """A bar above a wall, or above a like bar; penalty over modulus/h."""
    x, y = np.linspace(0.0, 0.1, across + 1), L * np.linspace(0.0, 1.0, n + 1) ** grade
    below = -y[::-1] if kind == "bars" else np.array([-0.1, 0.0])
    n1, c1, s1 = rectangle(x, below, cells)
    n2, c2, s2 = rectangle(x, y + GAP, cells, len(n1))
    body = np.r_[np.zeros(len(c1), np.int32), np.ones(len(c2), np.int32)]
    both = np.concatenate([c1, c2]).astype(np.int32)
    quads = (both, NO_CELLS[3], body, body[:0]) if cells == "quads" else (NO_CELLS[4], both, body[:0], body)
    surfaces = {f"lower.{k}": v for k, v in s1.items()} | {f"upper.{k}": v for k, v in s2.items()}
    sides = ("lower.top", "upper.bottom") if swapped else ("upper.bottom", "lower.top")
    return Interface(geometry, np.concatenate([n1, n2]), *quads, ("lower", "upper"), ("m", "m"), surfaces, {},
                     (Pair("face", *sides, 0.5, penalty * modulus(nu) * n / L),))


def stiff(half, state):
    """Energy of motion, of strain (small, so u.f/2) and of contact's springs [J]."""
    M = half.system.masses.matrix(half.system.spec.dynamics.lumped)
    f = half.system.volume.forces(np.array(state.u), half.system.moduli(np.array(state.drive.T)))
    return np.array([0.5 * state.v.ravel() @ (M @ state.v.ravel()), 0.5 * (state.u * f).sum(), state.stored])


def momentum(half, state):
    """Of each body, (2, 2) [kg m/s], and moment of all about the origin."""
    M = half.system.masses.matrix(half.system.spec.dynamics.lumped)
    p = (M @ state.v.ravel()).reshape(-1, 2)
    x = half.system.interface.nodes + state.u
    of = [p[half.system.interface.node_body == b].sum(axis=0) for b in (0, 1)]
    return np.array(of), (x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]).sum()


class Impact:
    """A run: t, mean pressure of the face, energies and the bars' momentum at every step."""

    def __init__(self, kind, n=30, penalty=1.0, cfl=1.0, nu=0.0, how=None, augmented=None, after=0.3, **more):
        interface = bars(kind, n, penalty, nu, **more)
        held = [hold(f"{body}.{side}", 0) for body in ("lower", "upper") for side in ("left", "right")]
        held += [hold(f"lower.{side}", 1) for side in ("top", "bottom")] if kind == "wall" else []
        extra = {} if augmented is None else {"pairs": {"face": {"augmented": {"method": augmented}}}}
        self.half = elastic(interface, held, {"E": E, "nu": nu, "alpha": 0.0, "rho": RHO}, tolerance=1e-9,
                            bodies={"lower": {"material": "m"}, "upper": {"material": "m", "v0": [0.0, -V]}},
                            dynamics=how or {}, **extra)
        self.c = np.sqrt(modulus(nu) / RHO)
        self.scale = RHO * self.c * V * (1.0 if kind == "wall" else 0.5)
        self.tau = RHO * self.c / interface.pairs[0].eps_N * (1.0 if kind == "wall" else 0.5)
        self.mass = RHO * L * (0.1 if interface.geometry == "plane" else np.pi * 0.01)
        link = open_link("direct")
        state, _ = self.half.start(inputs_of(self.half), 0.0, link)
        self.begin = stiff(self.half, state).sum()
        times = np.r_[0.0, np.arange(0.95 * GAP / V, GAP / V + (2.0 + after) / self.c, cfl / n / self.c)]
        upper = interface.node_body == 1
        rows = []
        for a, b in pairwise(times):
            state, out = done(self.half.step(state, inputs_of(self.half), a, b - a, link))
            assert (state.push[upper].sum() > 0.0) == (out["contact.touching"] > 0.0)
            p = state.push[upper, 1].sum() * RHO * L / self.mass
            rows.append([b - GAP / V, p, *stiff(self.half, state), *momentum(self.half, state)[0][:, 1]])
        link.close()
        self.t, self.p, *self.energies, self.lower, self.upper = np.array(rows).T

    @property
    def energy(self):
        return np.sum(self.energies, axis=0) / self.begin - 1.0

    @property
    def episodes(self):
        return int((np.diff(np.r_[0, self.p > 0.0]) == 1).sum())

    def mean_pressure(self, a, b):
        """Over the exact one, of times from a to b in L/c."""
        inside = (self.t * self.c > a) & (self.t * self.c < b)
        return self.p[inside].mean() / (self.scale * (1.0 - np.exp(-self.t[inside] / self.tau)).mean())

    def impulse(self, kind):
        """Over the exact one: what the upper bar has taken."""
        return (self.upper[-1] / self.mass + V) / (2.0 * V if kind == "wall" else V)


# Bars, which cost three times as much, by each way of enforcing contact.
@pytest.mark.few("1.0-None-wall")
@pytest.mark.parametrize(("penalty", "augmented", "kind"), [
    (0.1, None, "wall"), (1.0, None, "wall"), (100.0, None, "bars"),
    (0.1, "semi_smooth", "bars"), (1.0, "uzawa", "wall"), (1.0, "uzawa", "bars"), (10.0, "semi_smooth", "wall")])
def test_a_bar_comes_back_as_the_wave_says_at_any_penalty(kind, penalty, augmented):
    """With 20 times the penalty it left with five times the energy it came with, in 26 episodes."""
    soft = penalty < 1.0 and augmented is None  # it parts later by what the penalty gives
    run = Impact(kind, penalty=penalty, augmented=augmented, cfl=0.5, after=1.5 if soft else 0.4)
    assert np.abs(run.energy).max() < 0.005
    assert run.episodes == 1
    if augmented is None:
        spring = run.p**2 * 0.1 / (2.0 * run.half.system.interface.pairs[0].eps_N)
        assert run.energies[2] == pytest.approx(spring, rel=1e-3, abs=1e-6 * run.begin)
    run.tau = run.tau if augmented is None else 1e-12
    assert run.mean_pressure(0.2, 1.8) == pytest.approx(1.0, abs=0.02)
    assert run.impulse(kind) == pytest.approx(1.0, abs=0.02)


@pytest.mark.few("bars-2.0-1.0-semi_smooth", "bars-150.0-10.0-None")
@pytest.mark.parametrize(("kind", "cfl", "penalty", "augmented"), [
    (kind, cfl, *((10.0, None), (1.0, "semi_smooth"))[(i + k) % 2])
    for i, cfl in enumerate((2.0, 15.0, 30.0, 150.0)) for k, kind in enumerate(("wall", "bars"))])
def test_energy_and_momentum_stay_in_steps_of_any_length(kind, cfl, penalty, augmented):
    """From 20 steps a passage of the wave to five passages a step; without the impulse up to 660 % more energy."""
    run = Impact(kind, penalty=penalty, augmented=augmented, cfl=cfl, after=0.3 if cfl < 10.0 else 0.5 * cfl)
    assert np.abs(run.energy).max() < 0.005
    assert run.episodes == 1
    if kind == "bars":
        assert run.lower + run.upper == pytest.approx(-V * run.mass, rel=1e-6)


@pytest.mark.few("10.0-how0", "100.0-how4")
@pytest.mark.parametrize("how", [{"rho_inf": 0.8}, {"rho_inf": 0.0}, {"alpha": -0.1}, {"mass": "lumped"},
                                 {"beta": 0.3, "gamma": 0.6}])
@pytest.mark.parametrize("cfl", [1.0, 10.0, 100.0])
def test_contact_never_gains_by_any_method(how, cfl):
    run = Impact("wall", penalty=20.0, cfl=cfl, how=how, after=0.3 if cfl < 10.0 else 0.5 * cfl)
    assert run.energy.max() < 0.001
    assert run.episodes == 1


ANY = ({"nu": 0.49}, {"nu": 0.4999}, {"geometry": "axisymmetric"}, {"geometry": "axisymmetric", "nu": 0.4999},
       {"grade": 1.2}, {"cells": "triangles"}, {"swapped": True}, {"across": 1})


# Bars, which cost three times as much, where the two sides differ in what they do.
@pytest.mark.few("wall-{'across': 1}")
@pytest.mark.parametrize(("kind", "more"), [*(("wall", more) for more in ANY),
                                            *(("bars", ANY[i]) for i in (3, 5, 6))], ids=str)
def test_any_material_geometry_mesh_and_roles(kind, more):
    run = Impact(kind, n=36, penalty=30.0, cfl=0.5, after=0.4, **more)
    assert np.abs(run.energy).max() < 0.005
    assert run.episodes == 1
    assert run.mean_pressure(0.2, 1.8) == pytest.approx(1.0, abs=0.02)
    assert run.impulse(kind) == pytest.approx(1.0, abs=0.02)


# What moving mass off a surface keeps.

def moments(X, M):
    """Mass, first and second moments of a mass matrix of one component."""
    P = np.column_stack([np.ones(len(X)), X])
    return P.T @ (M @ P)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("cells", ["quads", "triangles"])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_mass_centre_and_inertia_of_every_body_are_kept(mass, cells, geometry):
    rng = np.random.default_rng(3)
    interface = bars("bars", 5, 1.0, cells=cells, geometry=geometry, grade=1.7, across=4)
    inner = rng.uniform(-0.3, 0.3, interface.nodes.shape) * 0.02
    interface.nodes[:] += inner * (interface.nodes[:, :1] > 1e-9)
    half = elastic(interface, [], {"rho": RHO}, dynamics={"mass": mass})
    kept = elastic(interface, [], {"rho": RHO}, dynamics={"mass": mass, "contact_mass": "kept"})
    M, full = (h.system.masses.matrix(mass == "lumped").toarray() for h in (half, kept))
    off = half.system.masses.without
    assert off[interface.contact_nodes].all()
    assert np.abs(M[np.repeat(off, 2)]).max() == 0.0
    for body in (0, 1):
        here = np.flatnonzero(interface.node_body == body)
        for i in range(2):
            at = np.ix_(2 * here + i, 2 * here + i)
            want = moments(interface.nodes[here], full[at])
            assert moments(interface.nodes[here], M[at]) == pytest.approx(want, rel=1e-11, abs=1e-11 * want.max())
    inside = M[np.ix_(np.repeat(~off, 2), np.repeat(~off, 2))]
    # In rings off the axis, where the first row of nodes has little mass of its own, as without.
    assert np.linalg.eigvalsh(inside).min() > 0.2 * np.linalg.eigvalsh(full).min()


def test_a_strip_between_surfaces_keeps_its_mass():
    """One or two cells thick there is nothing behind, or a row that cannot turn: nothing is moved, none is lost."""
    for rows in (1, 2):
        nodes, cells, surfaces = rectangle(np.linspace(0, 1, 6), np.linspace(0, 0.1, rows + 1))
        at = np.unique(np.concatenate([surfaces["bottom"], surfaces["top"]]))
        massless = np.zeros(len(nodes), dtype=bool)
        massless[at] = True
        T, without = taken_along(nodes, [cells.astype(np.int32)], massless, len(nodes))
        assert not without.any()
        assert (T.toarray() == np.eye(len(nodes))).all()


def collide(interface, v0, steps=80, t=0.008):
    """Two free bodies that meet: the half, start and end state, (n, 2) energy and heat of friction so far [J]."""
    half = elastic(interface, [], {"E": E, "nu": 0.3, "alpha": 0.0, "rho": RHO}, tolerance=1e-10,
                   bodies={"lower": {"material": "m"}, "upper": {"material": "m"} | v0}, dynamics={})
    link = open_link("direct")
    state, _ = half.start(inputs_of(half), 0.0, link)
    begin, heat, path = state, 0.0, []
    for i in range(steps):
        state, out = done(half.step(state, inputs_of(half), i * t / steps, t / steps, link))
        heat += float(np.sum(out.get("contact.E_friction", 0.0)))
        path.append((stiff(half, state).sum(), heat))
    link.close()
    return half, begin, state, np.array(path)


@cache
def collided(mu=0.0, turn=0.0):
    """What becomes of `oblique`, and the turn of its frame."""
    interface, v0, R = oblique(mu, turn)
    return *collide(interface, v0), R


def oblique(mu=0.0, turn=0.0, penalty=20.0):
    """Two blocks of unlike meshes, the upper to the side, so that they turn after they have met."""
    interface = blocks(5, 7, gap=1e-4, eps_N=penalty * E * 7)
    interface.nodes[interface.node_body == 1, 0] += 0.3
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    interface.nodes[:] = interface.nodes @ R.T
    pair = interface.pairs[0]
    return replace(interface, pairs=(replace(pair, mu=mu),)), {"v0": list(R @ [2.0 * V, -V])}, R


@pytest.mark.few("0.3")
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_bodies_that_meet_askew_keep_momentum_and_what_friction_leaves(mu):
    half, begin, end, path, _ = collided(mu)
    e0 = stiff(half, begin).sum()
    assert np.abs(path.sum(axis=1) / e0 - 1.0).max() < 0.005
    if mu:
        assert path[-1, 1] > 0.005 * e0
    before, after = momentum(half, begin), momentum(half, end)
    assert after[0].sum(axis=0) == pytest.approx(before[0].sum(axis=0), rel=1e-7)
    assert after[1] == pytest.approx(before[1], rel=2e-4)
    # It has rebounded: the upper one flies up in the frame of both.
    assert (after[0][1] - after[0][0])[1] > 0.05 * RHO * V


def test_the_frame_does_not_matter():
    found = []
    for turn in (0.0, 0.7):
        _, _, end, path, R = collided(0.3, turn)
        found.append((end.u @ R, path))
    assert np.abs(found[0][0] - found[1][0]).max() < 1e-6 * np.abs(found[0][0]).max()
    assert found[0][1] == pytest.approx(found[1][1], rel=1e-6, abs=1e-8)


def test_a_state_in_an_impact_restores_the_same_bits():
    interface, v0, _ = oblique(0.3)
    half, _, state, _ = collide(interface, v0, steps=15, t=0.0015)
    again = from_bytes(to_bytes(frozen_copy(state)), {"contact", "mechanical_fmu"})
    link = open_link("direct")
    ends = [done(half.step(s, inputs_of(half), 0.0015, 1e-4, link))[0] for s in (state, again)]
    link.close()
    assert to_bytes(frozen_copy(ends[0])) == to_bytes(frozen_copy(ends[1]))
    assert state.stored > 0.0
