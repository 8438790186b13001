"""What a mesh misses of the strain energy: nothing of fields it can hold, about the truth where it is too stiff."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from cell_scenes import PLANE, Stuff, equilibrium, grid, moduli_of, quads, volume_of
from mechanical_scenes import NoLink, block, done, elastic, hold, inputs_of

from contact.half.nodal_stress import LINEAR, nodal_stress
from mechanical_fmu.laws.catalogue import POINT
from mechanical_fmu.material import Moduli
from mechanical_fmu.recovery import (
    Stressed,
    energies,
    heat_energy,
    held_pressure,
    log_volume,
    missed_energy,
    recovered,
    rounding_energy,
    stress_of_stretch,
    uneven_energy,
)
from mechanical_fmu.volume import PointStep

E, NU = 1e9, 0.3
LENGTH, HEIGHT, FORCE = 10.0, 1.0, 1000.0


def triangles_of(nodes, cells):
    halves = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]).astype(np.int32)
    return replace(quads(nodes, cells), quads=np.empty((0, 4), np.int32), quad_body=np.empty(0, np.int32),
                   triangles=halves, triangle_body=np.zeros(len(halves), np.int32))


def cantilever(nx, ny, form="plane stress", triangles=False):
    """What the mesh is told to miss, and what it does miss, both as shares of its strain energy.

    Bending by F L^3/(3 E I) and shear by 1.2 F L/(G H): under one force the energy is F u/2.
    """
    told, tip = looked_at(nx, ny, form, triangles)
    exact = FORCE * LENGTH**3 / (3.0 * E * HEIGHT**3 / 12.0) + 1.2 * FORCE * LENGTH * 2.0 * (1.0 + NU) / (E * HEIGHT)
    return told, exact / tip - 1.0


def looked_at(nx, ny, form, triangles=False, nu=NU, signed=False):
    """What the mesh is told to miss, as a share of its energy, and how far the tip of the cantilever moves [m]."""
    nodes, cells = grid(nx, ny, lambda s, t: (LENGTH * s, HEIGHT * t))
    interface = (triangles_of if triangles else quads)(nodes, cells)
    volume = volume_of(interface, PLANE[form])
    moduli, force = moduli_of(volume, Stuff(E, nu)), np.zeros_like(nodes)
    right = np.flatnonzero(np.isclose(nodes[:, 0], LENGTH))
    force[right, 1] = FORCE / ny * np.where(np.isin(nodes[right, 1], (0.0, HEIGHT)), 0.5, 1.0)
    held = {(int(j), c): 0.0 for j in np.flatnonzero(nodes[:, 0] == 0.0) for c in (0, 1)}
    found = equilibrium(volume, moduli, held, force, tolerance=1e-6)
    both = volume.stress(found.u, moduli, PointStep(0.0, found.history))
    plane = "stress" not in form
    of = Stressed([s for s, _ in both], [log_volume(e) for _, e in both], nodal_stress(interface, LINEAR),
                  [np.zeros(c.weight.shape) for c in volume.kinds])
    missed, energy = missed_energy(volume.kinds, of, moduli, len(nodes), 1, plane, signed)
    tip = float(force[:, 1] @ found.u[:, 1]) / FORCE
    assert energy[0] == pytest.approx(0.5 * FORCE * tip, rel=0.01)
    return missed[0] / energy[0], tip


@pytest.mark.parametrize(("nx", "ny", "triangles"), [
    (10, 1, False), (10, 2, False), (20, 2, False), (20, 4, False), (40, 4, False), (40, 4, True), (20, 2, True)])
def test_a_cantilever_that_is_too_stiff_is_told_so(nx, ny, triangles):
    """Of its energy d/(1 + d) is missed where it is 1 + d times too stiff, from 1.03 to 1.86: the share that its tip
    falls short."""
    told, true = cantilever(nx, ny, triangles=triangles)
    assert 0.75 * true < told * (1.0 + true) < 1.05 * true


@pytest.mark.parametrize("n", [2, 4])
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_cells_of_one_dilatation_are_told_as_stiff_as_they_are(n, nu):
    """Plane strain: 7 % too stiff (nu 0) to 6 % too soft (nu 0.49) in two rows, though their stress is off by 40 %."""
    told, tip = looked_at(10 * n, n, "mean dilatation", nu=nu, signed=True)
    true = looked_at(80, 8, "enhanced", nu=nu)[1] / tip - 1.0
    assert told == pytest.approx(true, abs=0.05 * (2.0 / n) ** 2)
    assert np.sign(told) == np.sign(true) == (1.0 if nu == 0.0 else -1.0)


@pytest.mark.parametrize("form", ["enhanced", "enhanced plane stress"])
def test_cells_that_bend_are_told_as_stiff_as_they_are(form):
    """Near nu = 1/2, where they are not exact: 2 and 0.5 %."""
    told, tip = looked_at(20, 2, form, nu=0.49)
    true = looked_at(120, 12, form, nu=0.49)[1] / tip - 1.0
    assert 0.75 * true < told < 1.4 * true


def test_two_cells_across_are_not_to_be_trusted_and_enhanced_ones_are():
    """29 % off in deflection: 0.53 in the energy norm, beyond 0.4; with modes that bend 0.9 % off."""
    told, true = cantilever(10, 2)
    assert true == pytest.approx(0.417, abs=0.005)
    assert np.sqrt(told) > 0.5
    bends, _ = cantilever(10, 2, "enhanced plane stress")
    assert np.sqrt(bends) < 0.1


@pytest.mark.parametrize(("around", "across", "off"), [(32, 1, 0.001), (16, 1, 0.006), (48, 2, 0.002)])
def test_an_arch_of_cells_that_bend_is_told_as_right_as_it_is(around, across, off):
    """A quarter of a ring, one row of cells: 0.06 % too stiff, and 79 % of its energy was told to be missed."""
    R, H = 0.1, 0.004
    told, end = {}, {}
    for cells in ((around, across), (128, 4)):
        nodes, quads_ = grid(*cells, lambda s, t: ((R + H * t) * np.sin(0.5 * np.pi * s),
                                                   (R + H * t) * np.cos(0.5 * np.pi * s)))
        interface = quads(nodes, quads_)
        volume = volume_of(interface, PLANE["enhanced"])
        moduli, force = moduli_of(volume, Stuff(E, 0.0)), np.zeros_like(nodes)
        tip = np.flatnonzero(np.isclose(nodes[:, 1], 0.0, atol=1e-9))
        force[tip, 0] = 1.0 / tip.size
        held = {(int(j), c): 0.0 for j in np.flatnonzero(np.isclose(nodes[:, 0], 0.0, atol=1e-9)) for c in (0, 1)}
        found = equilibrium(volume, moduli, held, force, tolerance=1e-6)
        both = volume.stress(found.u, moduli, PointStep(0.0, found.history))
        of = Stressed([s for s, _ in both], [log_volume(e) for _, e in both], nodal_stress(interface, LINEAR))
        missed, energy = missed_energy(volume.kinds, of, moduli, len(nodes), 1, True)
        told[cells], end[cells] = missed[0] / energy[0], found.u[tip, 0].mean()
    assert end[around, across] == pytest.approx(end[128, 4], rel=off)
    assert told[around, across] < 0.01


def stretched(F, mu=2.0, p=0.7):
    """Cauchy stress and ln J of (n, 3, 3) F, neo-Hookean with a pressure p, one point a cell; and p + 2 mu dev V."""
    J = np.linalg.det(F)
    b = F @ np.swapaxes(F, 1, 2) * (J ** (-2.0 / 3.0))[:, None, None]
    squares, axes = np.linalg.eigh(b)
    V = (axes * np.sqrt(squares)[:, None, :]) @ np.swapaxes(axes, 1, 2)
    both = [(of - np.trace(of, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)) for of in (b, V)]
    both = mu * both[0] / J[:, None, None] + p * np.eye(3), 2.0 * mu * both[1] + p * np.eye(3)
    stress, exact = (np.stack([of[:, 0, 0], of[:, 1, 1], of[:, 0, 1], of[:, 2, 2]], axis=-1)[:, None] for of in both)
    moduli = Moduli(np.full(len(F), mu), np.full(len(F), 1e3), np.zeros((len(F), 1)), np.zeros(len(F), POINT))
    return stress, np.log(J)[:, None], moduli, exact


@pytest.mark.parametrize("size", [1e-6, 1e-2, 0.3, 0.8])
def test_stress_at_large_strain_is_that_of_the_stretch(size):
    """By the eigenvalues of F F'; at small strain it is Cauchy's."""
    F = np.zeros((50, 3, 3)) + np.eye(3)
    F[:, :2, :2] += size * np.random.default_rng(1).uniform(-1.0, 1.0, (50, 2, 2))
    F[:, 2, 2] += 0.5 * size
    F = F[np.linalg.det(F) > 0.05]
    stress, log_J, moduli, exact = stretched(F)
    found = stress_of_stretch(stress, log_J, moduli)
    assert np.abs(found - exact).max() < 1e-8 * size + 1e-13 * np.abs(exact).max()
    assert size > 0.1 or np.abs(found - stress).max() < 20.0 * size**2


def test_the_energy_at_large_strain_is_about_that_of_the_law():
    """mu/2 (tr V V - 3) of a bar that is pulled, in each direction; the square of Cauchy stress has twelvefold at 4."""
    for stretch, low, high in ((1.0001, 0.999, 1.001), (1.5, 0.98, 1.06), (2.0, 1.0, 1.12), (4.0, 1.0, 1.3)):
        F = np.zeros((1, 3, 3)) + np.diag([stretch, 1.0 / stretch, 1.0])
        stress, log_J, moduli, _ = stretched(F, p=0.0)
        exact = 0.5 * moduli.mu[0] * (stretch**2 + stretch**-2 - 2.0)
        found = stress_of_stretch(stress, log_J, moduli)
        assert low < 0.5 * energies(found, moduli, np.ones((1, 1)))[0] / exact < high
    assert 0.5 * energies(stress, moduli, np.ones((1, 1)))[0] > 5.0 * exact


def test_rubber_that_is_squeezed_between_plates_is_told_what_it_misses():
    """A quarter of a pad of 40 by 20 mm, glued and squeezed by 20 %: work of 107.9, 102.4, 100.0, and 97 J on the
    finest mesh that was tried.  Its corners have no bound, and by the square of their stress a tenth was missed on any.
    """
    shares = []
    for n in (4, 8, 16):
        pad = block(np.linspace(0.0, 0.02, n + 1), np.linspace(0.0, 0.01, n // 2 + 1))
        down = {"t": [0, 1], "value": [0, -0.002]}
        half = elastic(pad, [hold("block.left", 0), hold("block.bottom", 1), hold("block.top", 0),
                              hold("block.top", 1, down)], {"E": 2e6, "nu": 0.49, "alpha": 0.0})
        state, told = half.start(inputs_of(half, 300.0), 0.0, NoLink())
        for k in range(4):
            state, told = done(half.step(state, inputs_of(half, 300.0), 0.25 * k, 0.25, NoLink()))
        shares.append(told["mesh.missed.block"] / told["mesh.energy.block"])
        assert 4.0 * told["mesh.energy.block"] == pytest.approx({4: 107.9, 8: 102.4, 16: 100.0}[n], rel=0.01)
    assert shares == pytest.approx([0.1, 0.053, 0.03], rel=0.5)


@pytest.mark.parametrize("form", ["mean dilatation", "plane stress"])
def test_a_field_that_is_linear_all_over_is_recovered(form):
    nodes, cells = grid(4, 3, lambda s, t: (2.0 * s + 0.2 * s * t, t - 0.1 * s * t))
    for interface in (quads(nodes, cells), triangles_of(nodes, cells)):
        volume = volume_of(interface, PLANE[form])
        kinds, slopes = volume.kinds, np.array([[3.0, -1.0], [0.5, 2.0], [1.0, 1.0], [-2.0, 4.0]]) * 1e6
        places = [np.einsum("qa,eai->eqi", c.N, nodes[c.nodes]) for c in kinds]
        smooth = [p @ slopes.T + 1e6 for p in places]
        if interface.triangles.size and kinds[0].N.shape[0] == 1:
            smooth = [np.ones_like(s) * 1e6 for s in smooth]  # one point knows no slope
        for found, exact in zip(recovered(kinds, smooth, len(nodes)), smooth, strict=True):
            assert np.abs(found - exact).max() < 1e-6


def test_stress_may_jump_where_the_material_changes():
    nodes, cells = grid(4, 1, lambda s, t: (4.0 * s, t))
    volume = volume_of(quads(nodes, cells), PLANE["plane stress"])
    (cells_of,) = volume.kinds
    left = nodes[cells_of.nodes][:, :, 0].mean(axis=1) < 2.0
    stress = np.zeros((len(left), cells_of.N.shape[0], 4))
    stress[~left, :, 0] = 1e6
    moduli = moduli_of(volume, Stuff(E, NU))
    missed, _ = missed_energy([cells_of], Stressed([stress]), moduli, len(nodes), 1)
    assert missed[0] > 0.0
    two = replace(cells_of, part=np.where(left, 0, 1))
    missed, _ = missed_energy([two], Stressed([stress]), moduli, len(nodes), 1)
    assert missed[0] == pytest.approx(0.0, abs=1e-12)


def test_the_energy_of_a_stress():
    """s^2/(2 E) of tension in a bar, t^2/(2 G) of shear, each per volume."""
    nodes, cells = grid(1, 1, lambda s, t: (s, t))
    volume = volume_of(quads(nodes, cells), PLANE["plane stress"])
    (cell,), (m,) = volume.kinds, moduli_of(volume, Stuff(E, NU))
    stress = np.zeros((1, cell.N.shape[0], 4))
    stress[..., 0] = 3e6
    assert energies(stress, m, cell.weight) == pytest.approx(9e12 / E)
    stress[..., 0], stress[..., 2] = 0.0, 2e6
    assert energies(stress, m, cell.weight) == pytest.approx(4e12 * 2.0 * (1.0 + NU) / E)


def test_what_is_held_across_the_plane_is_no_energy_of_the_mesh():
    """Plane strain: heat alone makes E alpha dT across, which nothing relieves; tension s (1 - nu^2)/E of its own."""
    nodes, cells = grid(1, 1, lambda s, t: (s, t))
    volume = volume_of(quads(nodes, cells), PLANE["mean dilatation"])
    (cell,), (m,) = volume.kinds, moduli_of(volume, Stuff(E, NU))
    stress = np.zeros((1, cell.N.shape[0], 4))
    stress[..., 3] = -5e6
    assert energies(stress, m, cell.weight, held=True)[0] == pytest.approx(0.0, abs=1e-6 * 25e12 / E)
    stress[..., 0] = 3e6
    stress[..., 3] += NU * 3e6
    assert energies(stress, m, cell.weight, held=True) == pytest.approx(9e12 * (1.0 - NU**2) / E)
    missed = [missed_energy([cell], Stressed([stress]), [m], len(nodes), 1, plane)[1][0] for plane in (True, False)]
    assert missed[0] == pytest.approx(0.5 * 9e12 * (1.0 - NU**2) / E)
    assert missed[1] == pytest.approx(missed[0] + 0.5 * 25e12 / E)


@pytest.mark.parametrize("form", ["mean dilatation", "enhanced"])
def test_what_heat_presses_across_a_held_plane_is_not_missed(form):
    """Free in its plane, warmer to one side: -E times the free strain across, of cells their mean, and nothing else."""
    nodes, cells = grid(4, 3, lambda s, t: (2.0 * s, t))
    interface = quads(nodes, cells)
    volume = volume_of(interface, PLANE[form])
    (cell,), (m,) = volume.kinds, moduli_of(volume, Stuff(E, NU))
    free = 1e-3 * np.einsum("qa,ea->eq", cell.N, nodes[cell.nodes][..., 1])
    across = held_pressure(cell, free, m)
    assert (np.ptp(across, axis=1).max() > 0.0) == (form == "enhanced")
    stress = np.zeros((len(cells), 4, 4))
    stress[..., 3] = -across
    for heat in ([across], [0.0 * across]):
        missed, energy = missed_energy([cell], Stressed([stress], None, None, heat), [m], len(nodes), 1, True)
        told = missed[0] + energy[0] > 1e-12 * heat_energy([cell], [free], [m], 1)[0]
        assert told == (heat[0] is not across)
    assert held_pressure(replace(cell, treatment=PLANE["plane stress"]), free, m) is None


def test_the_volume_of_a_strain():
    """J = 1.1 * 0.9 * 1.2 of three stretches; shear alone keeps it, with 1 + g2 along it."""
    F = np.array([1.1, 0.9, 1.2])
    assert log_volume(np.array([*(0.5 * (F[:2] ** 2 - 1.0)), 0.0, 0.5 * (F[2] ** 2 - 1.0)])) == pytest.approx(
        np.log(F.prod()))
    g = 0.3
    assert log_volume(np.array([0.0, 0.5 * g**2, 0.5 * g, 0.0])) == pytest.approx(0.0, abs=1e-15)


def test_the_energy_of_uneven_heat():
    """E/2 (e - mean)^2: of a strain that is linear over a length h, E/2 (e' h)^2/12; of an even one nothing."""
    nodes, cells = grid(4, 3, lambda s, t: (2.0 * s, t))
    volume = volume_of(quads(nodes, cells), PLANE["plane stress"])
    moduli, (kind,) = moduli_of(volume, Stuff(E, NU)), volume.kinds
    y = np.einsum("qa,ea->eq", kind.N, nodes[kind.nodes][..., 1])
    uneven = uneven_energy(volume.kinds, [1e-3 * y + 5e-3], moduli, 1)[0]
    assert uneven == pytest.approx(2.0 * 0.5 * E * 1e-6 / 12.0)
    assert uneven_energy(volume.kinds, [np.full_like(y, 5e-3)], moduli, 1)[0] < 1e-12 * uneven


def test_a_body_that_moves_bears_nothing_by_rounding():
    """Moved by 0.15 m, cells of 2 by 0.5 mm: 1e-13 of strain; squeezed by 1e-9 it bears."""
    x, y = np.linspace(-0.2, 0.05, 126), np.linspace(-0.015, 0.0, 31)
    told = {}
    for squeeze in (0.0, 1e-9):
        moved = {"terms": [{"x": {"polynomial": [0.15123456789, squeeze]}}]}
        half = elastic(block(x, y, node_sets={"all": range(len(x) * len(y))}), [hold("all", 0, moved), hold("all", 1)])
        _, told[squeeze] = half.start(inputs_of(half, 300.0), 0.0, NoLink())
    assert told[0.0]["max_strain_increment"] <= 1e-12
    assert told[0.0]["mesh.missed.block"] == told[0.0]["mesh.energy.block"] == 0.0
    assert told[1e-9]["mesh.energy.block"] > 0.0


def test_a_body_that_passes_the_origin_has_the_rounding_of_its_way():
    """Thrown up by 0.46 m and back in steps of up to 0.4 s: 1e-13 of strain, as much where it is drawn as above it."""
    x = np.linspace(0.0, 0.1, 5)
    half = elastic(block(x, x, geometry="axisymmetric"), [], {"rho": 7800.0, "alpha": 0.0, "E": 2e11},
                   bodies={"block": {"material": "m", "v0": [0.0, 3.0]}}, dynamics={}, gravity={"y": -9.81})
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    for t, then in pairwise((0.0, 0.001, 0.004, 0.013, 0.04, 0.121, 0.2425, 0.6215, 1.0)):
        state, told = done(half.step(state, inputs_of(half), t, then - t, NoLink()))
        assert told["mesh.missed.block"] == told["mesh.energy.block"] == 0.0


def test_the_energies_of_rounding_and_of_heat():
    """E/2 (4 units in the last place, over the cell)^2, more with the distance; E/2 of the square of a free strain."""
    nodes, cells = grid(4, 4, lambda s, t: (s, t))
    volume = volume_of(quads(nodes, cells), PLANE["plane stress"])
    moduli = moduli_of(volume, Stuff(E, NU))
    near, far = (rounding_energy(volume.kinds, moduli, nodes + at, 1)[0] for at in (1.0, 1e4))
    assert 1e-16 < np.sqrt(2.0 * near / E) < 1e-13
    assert np.sqrt(far / near) == pytest.approx(8192.0 / 1.0, rel=0.5)
    free = [np.full((16, volume.kinds[0].N.shape[0]), -2e-3)]
    assert heat_energy(volume.kinds, free, moduli, 1)[0] == pytest.approx(0.5 * E * 4e-6)
