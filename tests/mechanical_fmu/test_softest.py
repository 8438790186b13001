"""What a mesh makes of the stiffness that loads leave to a column: against the load at which it buckles on the mesh."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, elastic, hold, inputs_of

from mechanical_fmu.newton import with_tangent
from mechanical_fmu.softest import motion_stress, stiffness_off
from mechanical_fmu.system import Loading
from mechanical_fmu.tangent import constrained, stiffness
from mechanical_fmu.unstable import NAME, SOFT

H, L, E = 0.05, 1.0, 1e9
EULER = np.pi**2 * E * H**3 / 12.0 / (4.0 * L**2)  # held at one end, plane strain with nu 0


def column(load, cells, triangles=False, angle=0.0, element="mean_dilatation"):
    """Outputs of a column of cells along x and y under so many times Euler's load, turned by an angle."""
    interface = block(np.linspace(0.0, H, cells[0] + 1), np.linspace(0.0, L, cells[1] + 1))
    if triangles:
        q = interface.quads
        cut = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]]).astype(np.int32)
        interface = replace(interface, quads=np.empty((0, 4), np.int32), quad_body=np.empty(0, np.int32), triangles=cut,
                            triangle_body=np.zeros(len(cut), np.int32))
    c, s = np.cos(angle), np.sin(angle)
    interface = replace(interface, nodes=interface.nodes @ np.array([[c, s], [-s, c]]))
    force = load * EULER / H
    half = elastic(interface, [hold("block.bottom", 0), hold("block.bottom", 1),
                               {"on": "block.top", "t_x": s * force, "t_y": -c * force}],
                   {"E": E, "nu": 0.0, "rho": 1000.0}, element=element)
    return half.start(inputs_of(half), 0.0, NoLink())[1]


# The load at which the count finds the column to leave its straight line, over Euler's, by halving: to 0.3 %.
@pytest.mark.parametrize(("cells", "triangles", "element", "buckles", "load"), [
    ((2, 20), False, "mean_dilatation", 1.418, 0.9), ((2, 80), False, "mean_dilatation", 0.951, 0.7),
    ((2, 40), True, "mean_dilatation", 1.879, 0.7), ((4, 80), True, "mean_dilatation", 1.227, 0.9),
    ((2, 20), False, "enhanced", 1.001, 0.9)])
def test_it_is_what_the_load_at_which_it_buckles_is_off_by(cells, triangles, element, buckles, load):
    """A column has 1 - load of its stiffness left, and on the mesh 1 - load/buckles: told to a tenth, and to 0.01."""
    told = column(load, cells, triangles, element=element)[SOFT]
    assert told == pytest.approx(1.0 - (1.0 - load) / (1.0 - load / buckles), rel=0.1, abs=0.01)


def test_a_mesh_that_hides_that_it_buckles_is_told():
    """Triangles that bend 23 % too stiffly, at Euler's load: stable, and all that is left is the mesh's."""
    told = column(1.0, (4, 80), True)
    assert told[NAME] == 0.0
    assert told[SOFT] == pytest.approx(1.0, rel=0.1)


def test_it_does_not_hang_on_where_a_column_stands():
    straight, turned = (column(0.7, (2, 20), angle=angle)[SOFT] for angle in (0.0, 0.7))
    assert turned == pytest.approx(straight, rel=1e-3)


def test_loads_that_stiffen_and_none_at_all_make_nothing_of_it():
    assert column(0.0, (2, 20), True)[SOFT] == 0.0
    assert column(-1.0, (2, 20), True)[SOFT] == 0.0


def test_a_column_that_buckles_is_told_by_the_count():
    told = column(1.6, (2, 20))
    assert (told[NAME], told[SOFT]) == (1.0, 0.0)


def test_what_goes_from_cell_to_cell_is_no_motion_of_a_body():
    """A hot strip on a wall, two cells thick: the softest of its motions ripple its surface, each cell another way."""
    half = elastic(block(np.linspace(0.0, 0.02, 3), np.linspace(0.0, 0.16, 9)), [hold("block.left", 0),
                                                                              hold("block.left", 1)],
                   {"E": 5e9, "nu": 0.45, "alpha": 5e-5, "T_ref": 300.0})
    told = half.start(inputs_of(half, 1500.0), 0.0, NoLink())[1]
    assert (told[NAME], told[SOFT]) == (0.0, 0.0)


@pytest.mark.parametrize("cells", [(8, 4), (16, 8)])
def test_rubber_that_is_squeezed_far_keeps_what_it_resists_with(cells):
    """A pad glued to plates, a fifth of its height pressed out at its sides: a mesh of four times the cells says 0.00.

    Motions that keep its volume are not resisted by its bulk modulus, which is 50 times the shear modulus.
    """
    half = elastic(block(np.linspace(0.0, 0.04, cells[0] + 1), np.linspace(0.0, 0.02, cells[1] + 1)), [
        hold("block.bottom", 0), hold("block.bottom", 1), hold("block.top", 0), hold("block.top", 1, -0.004)],
        {"E": 2e6, "nu": 0.49, "rho": 1100.0})
    told = half.start(inputs_of(half), 0.0, NoLink())[1]
    assert told[NAME] == 0.0
    assert abs(told[SOFT]) < 0.1


@pytest.mark.parametrize("state", [{}, {"element": "enhanced"}])
def test_stress_of_a_motion_is_that_of_the_lengths_there_are_now(state):
    """A block drawn to twice its length and turned: d log of its lengths, whatever these are."""
    half = elastic(block(np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 3)), [hold("block.bottom", 0)],
                   {"E": 3.0, "nu": 0.25}, **state)
    system, (c, s) = half.system, (np.cos(0.7), np.sin(0.7))
    turn, X = np.array([[c, -s], [s, c]]), half.system.interface.nodes
    loading = Loading(system.moduli(np.full(len(X), 293.15)), np.zeros(system.constraints.fixed.size), np.zeros(0),
                      None)
    u = X * (2.0, 0.6) @ turn.T - X
    stress, dilatation = motion_stress(system, u, X * (2.0 * 0.02, 0.6 * -0.03) @ turn.T, loading)
    mu, la = 1.2, 1.2
    assert np.concatenate(dilatation) == pytest.approx(-0.01, rel=1e-5)
    assert np.concatenate(stress)[..., 0] == pytest.approx(2.0 * mu * 0.02 - la * 0.01, rel=1e-5)
    assert np.concatenate(stress)[..., 1] == pytest.approx(-2.0 * mu * 0.03 - la * 0.01, rel=1e-5)


def test_of_a_single_row_of_quads_of_one_dilatation_nothing_is_said():
    """It buckles at 1.17 times Euler's load, and would be told four times as much; others are known."""
    assert column(0.7, (1, 20))[SOFT] == -1.0
    assert column(0.01, (1, 20))[SOFT] == 0.0
    assert column(0.7, (1, 20), True)[SOFT] == pytest.approx(1.0 - 0.3 / (1.0 - 0.7 / 4.509), rel=0.1)
    assert abs(column(0.7, (1, 20), element="enhanced")[SOFT]) < 0.01


def test_a_body_that_nothing_holds_and_one_that_is_held_all_over():
    """Three motions without work are no motions that loads made soft; of none nothing is told."""
    half = elastic(block(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 5)), [hold("block.bottom", 0)])
    for system in (half.system.without((0,)), elastic(block(np.linspace(0.0, 1.0, 2), np.linspace(0.0, 1.0, 2)), [
            hold("block.bottom", 0), hold("block.bottom", 1), hold("block.top", 0), hold("block.top", 1)]).system):
        n = len(system.interface.nodes)
        loading = Loading(system.moduli(np.full(n, 293.15)), np.zeros(system.constraints.fixed.size), np.zeros(0), None)
        u = np.zeros((n, 2))
        K = constrained(system, stiffness(system, with_tangent(system, system.balance(u, loading), loading), loading))
        even = csr_matrix(K + diags_array(1e-9 * K.diagonal(), format="csr"))
        assert abs(stiffness_off(system, even, u, loading)) < 1e-6
