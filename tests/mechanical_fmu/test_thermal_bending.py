"""Heat that changes inside a cell: cells of enhanced strain follow it, and bend by it as the continuum does.

The closed forms are linear: temperatures are scaled by SMALL and stresses by 1/SMALL.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from cell_scenes import PLANE, Stuff, equilibrium, grid, moduli_of, quads, volume_of
from mechanical_scenes import NoLink, block, elastic, hold, inputs_of

from mechanical_fmu.cells import at_points

E, NU, SMALL = 1.0, 0.3, 1e-6
LINK = NoLink()
ENHANCED = ("enhanced", "enhanced plane stress")


def heated(form, map_, n, strain, geometry="plane"):
    """Volume and moduli of the mapped grid of n[0] by n[1] cells with free strain SMALL strain(X) at the nodes."""
    nodes, cells = grid(*n, map_)
    volume = volume_of(quads(nodes, cells, geometry), PLANE[form])
    free = SMALL * strain(nodes)
    warm = at_points(volume.kinds[0], free) if "enhanced" in form else volume.means(free)[0][:, None]
    e_th = 3.0 * np.log(1.0 + warm)
    return nodes, volume, (replace(moduli_of(volume, Stuff(E, NU))[0], e_th=e_th),)


@pytest.mark.parametrize("form", ENHANCED)
@pytest.mark.parametrize("slope", [(1.0, 0.0), (0.0, 1.0), (0.6, -0.8)])
@pytest.mark.parametrize("map_", [lambda s, t: (2.0 * s**2, t), lambda s, t: (2.0 * s - 0.7 * t, t + s)],
                         ids=["graded", "parallelograms"])
def test_a_temperature_that_changes_linearly_presses_no_free_body(form, slope, map_):
    _, volume, moduli = heated(form, map_, (3, 2), lambda X: X @ slope)
    found = equilibrium(volume, moduli, {(0, 0): 0.0, (0, 1): 0.0, (1, 0): 0.0}, tolerance=1e-9, floor=SMALL)
    stress = volume.stress(found.u, moduli, replace(found.step, history=found.history))[0][0] / SMALL
    # In its plane; across it plane strain holds it by E alpha (T - T_ref).
    assert np.abs(stress[..., :3]).max() <= 1e-4 * E


def moment(form, through, h=0.3, L=2.0, n=6):
    """What holds the ends of a bar whose lower side is cold and whose upper side is warm by 1 per m."""
    nodes, volume, moduli = heated(form, lambda s, t: (L * s, h * (t - 0.5)), (n, through), lambda X: X[:, 1])
    ends = (nodes[:, 0] < 1e-9) | (nodes[:, 0] > L - 1e-9)
    held = {(int(i), 0): 0.0 for i in np.flatnonzero(ends)} | {(0, 1): 0.0, (n * (through + 1), 1): 0.0}
    found = equilibrium(volume, moduli, held, tolerance=1e-9, floor=SMALL)
    right = nodes[:, 0] > L - 1e-9
    exact = E * h**3 / 12.0 / (1.0 if "stress" in form else 1.0 - NU)
    return -(found.r[right, 0] * nodes[right, 1]).sum() / SMALL / exact


@pytest.mark.parametrize("form", ENHANCED)
@pytest.mark.parametrize("through", [1, 2, 5])
def test_a_bar_held_at_both_ends_wants_to_bend_as_it_should(form, through):
    """M = E alpha T' h^3/12, over 1 - nu in plane strain, at any number of cells through the thickness."""
    assert moment(form, through) == pytest.approx(1.0, rel=1e-4)


def test_cells_of_one_dilatation_take_the_mean_and_miss_its_moment():
    """What docs/elements.md says of the default element: 1/n^2 too little for n cells through the thickness."""
    short = [(1.0 - moment("mean dilatation", through)) * through**2 for through in (2, 4, 8)]
    assert short == pytest.approx([1.0] * 3, rel=0.1)


@pytest.mark.parametrize("drawn", [None, 350.0])
def test_the_half_gives_each_point_its_own_expansion(drawn):
    """alpha may change with temperature, and the mesh may be drawn warm."""
    table = {"T": [300.0, 900.0], "value": [1e-5, 2e-5]}
    body = {"material": "m", "element": "enhanced"} | ({} if drawn is None else {"drawn_at": drawn})
    half = elastic(block([0.0, 1.0], [0.0, 0.5, 1.0]), material={"alpha": table}, bodies={"block": body})
    T = np.array([300.0, 400.0, 500.0, 600.0, 800.0, 900.0])
    cells = half.system.volume.kinds[0]
    at = at_points(cells, T)

    def e_th(T):
        return 3.0 * np.log(1.0 + (1e-5 + 1e-5 * (T - 300.0) / 600.0) * (T - 300.0))

    of = e_th(at) - (0.0 if drawn is None else e_th(drawn))
    assert half.system.moduli(T)[0].e_th == pytest.approx(of, rel=1e-10)


@pytest.mark.parametrize("n", [1, 3])
def test_a_ring_that_is_warmer_outside_is_pressed_as_lame_says(n):
    """A thin disc, free: s_hoop of a temperature linear in r (Timoshenko & Goodier, art. 150), at points of n cells."""
    a, b = 1.0, 1.5
    nodes, volume, moduli = heated("enhanced", lambda s, t: (a + (b - a) * s, 0.02 * t), (n, 1), lambda X: X[:, 0],
                                   "axisymmetric")
    found = equilibrium(volume, moduli, {(0, 1): 0.0}, tolerance=1e-9, floor=SMALL)
    stress = volume.stress(found.u, moduli, replace(found.step, history=found.history))[0][0] / SMALL
    r = np.einsum("qa,ea->eq", volume.kinds[0].N, nodes[volume.kinds[0].nodes][..., 0])
    inner = (r**3 - a**3) / 3.0
    whole = (b**3 - a**3) / 3.0
    exact = E / r**2 * ((r**2 + a**2) / (b**2 - a**2) * whole + inner - r**3)
    off = np.abs(stress[..., 3] - exact).max() / np.abs(exact).max()
    assert off <= {1: 0.25, 3: 0.05}[n]


def dropped(T, element="mean_dilatation", body=None, **material):
    """Told by the half of one unit cell that nothing strains, E alpha = 2.4 MPa/K: missed [J]."""
    x = [0.0, 1.0]
    half = elastic(block(x, x, node_sets={"all": range(4)}), [hold("all", 0), hold("all", 1)], material=material,
                   bodies={"block": {"material": "m", "element": element, **(body or {})}})
    _, outputs = half.start(inputs_of(half, T), 0.0, LINK)
    return outputs["mesh.missed.block"]


def test_what_a_cell_drops_is_told_with_what_the_mesh_misses():
    """E/2 (alpha dT)^2/12 of a temperature that changes by dT across; no more than the stress at which it yields."""
    T = np.array([300.0, 340.0, 300.0, 340.0])
    all_of_it = 0.5 * 2e11 * (1.2e-5 * 40.0) ** 2 / 12.0
    assert dropped(T) == pytest.approx(all_of_it, rel=1e-3)
    assert dropped(np.full(4, 340.0)) < 1e-6 * all_of_it
    assert dropped(T, plastic={"s_y": 1e9}) == pytest.approx(all_of_it, rel=1e-3)
    assert dropped(T, plastic={"s_y": 1e6}) == pytest.approx(0.5 * 1e12 / 2e11, rel=1e-3)
    # A body that was drawn with this heat has none of it to drop.
    field = {"terms": [{"y": {"polynomial": [300.0, 40.0]}}]}
    assert dropped(T, body={"drawn_at": field}) < 1e-6 * all_of_it
    # Each point as it is: what is recovered of a single cell is its own stress.
    assert dropped(T, "enhanced") < 1e-6 * all_of_it
