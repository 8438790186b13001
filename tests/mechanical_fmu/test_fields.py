"""Fields to look at: strain, plastic and creep strain, the hoop stress by its name, what each pair node does."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, done, elastic, hold, inputs_of, press

from mechanical_fmu.contact import ALONE, OPEN, SLIPS, TOUCHES, status
from mechanical_fmu.heat import flow_variables

STEEL = {"E": 2e11, "nu": 0.3, "alpha": 0.0}


def test_strain_is_that_of_the_stretch():
    """A block stretched to 1.01 and free across: Green-Lagrange, ((1 + e)^2 - 1)/2 along."""
    half = elastic(block([0.0, 0.4, 1.0], [0.0, 0.3, 0.5]), [
        hold("block.left", 0), hold("block.bottom", 1), hold("block.right", 0, 0.01)], STEEL)
    _, outputs = half.start(inputs_of(half), 0.0, NoLink())
    assert outputs["strain"].shape == (4, 4)
    np.testing.assert_allclose(outputs["strain"][:, 0], 0.5 * (1.01**2 - 1.0), rtol=1e-9)
    np.testing.assert_allclose(outputs["strain"][:, 2:], 0.0, atol=1e-12)
    assert (outputs["strain"][:, 1] < -0.003).all()


def test_the_hoop_stress_of_a_tube_is_lames():
    """r = 1 to 2 m under 10 MPa inside, no strain along: sigma_hoop = p a2/(b2 - a2) (1 + b2/r2), in cell means."""
    r, p = np.linspace(1.0, 2.0, 41), 1.0e7
    half = elastic(block(list(r), [0.0, 0.1], geometry="axisymmetric"), [
        hold("block.bottom", 1), hold("block.top", 1), press("block.left", p)], STEEL)
    _, outputs = half.start(inputs_of(half), 0.0, NoLink())
    middle = 0.5 * (r[1:] + r[:-1])
    np.testing.assert_allclose(outputs["sigma_hoop"], p / 3.0 * (1.0 + 4.0 / middle**2), rtol=2e-3)
    np.testing.assert_array_equal(outputs["sigma_hoop"], outputs["sigma"][:, 3])


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_the_equivalent_stress_of_every_window_is_that_of_the_whole_stress(geometry):
    """A body sheared evenly: the stress of a cell is that of its points, and so is von Mises' of it."""
    half = elastic(block([1.0, 1.4, 2.0], [0.0, 0.3, 0.5], geometry=geometry), [
        hold("block.left", 0), hold("block.left", 1), hold("block.right", 1, 0.02), hold("block.right", 0),
        hold("block.top", 0), hold("block.bottom", 0)], STEEL)
    _, outputs = half.start(inputs_of(half), 0.0, NoLink())
    s11, s22, s12, s33 = outputs["sigma"].T
    assert (np.abs(s12) > 5e8).all()
    of_the_mean = np.sqrt(0.5 * ((s11 - s22) ** 2 + (s22 - s33) ** 2 + (s33 - s11) ** 2) + 3.0 * s12**2)
    # The mean of a root is the root of the mean but for what varies within a cell, squared: u_x is 1e-3 of u_y, and
    # about an axis shear falls with 1/r2.
    np.testing.assert_allclose(outputs["sigma_v"], of_the_mean, rtol=1e-5 if geometry == "plane" else 2e-2)


@pytest.mark.parametrize(("law", "told", "silent"), [({"plastic": {"s_y": 5e7}}, "peeq", "ceeq"),
                                                     ({"creep": {"K": 1e9, "m": 0.5}}, "ceeq", "peeq")])
@pytest.mark.parametrize("more", [{}, {"element": "enhanced"}, {"state": "plane_stress"}])
def test_plastic_and_creep_strain_of_cells_have_the_mean_of_the_body(law, told, silent, more):
    draw = {"t": [0.0, 5.0], "value": [0.0, 5e-3]}
    half = elastic(block([0.0, 0.4, 1.0], [0.0, 0.2, 0.5]), [
        hold("block.left", 0), hold("block.bottom", 1), hold("block.right", 0, draw), hold("block.right", 1)],
        {**STEEL, **law}, **more)
    assert {v.name for v in flow_variables(half.system)} == {told, "flow.block", "flow_rate.block"}
    state, outputs = half.start(inputs_of(half), 0.0, NoLink())
    np.testing.assert_array_equal(outputs[told], 0.0)
    _, outputs = done(half.step(state, inputs_of(half), 0.0, 5.0, NoLink()))
    volume = np.concatenate([cells.volume for cells in half.system.volume.kinds])
    assert np.ptp(outputs[told]) > 1e-5
    assert (outputs[told] * volume).sum() / volume.sum() == pytest.approx(outputs["flow.block"], rel=1e-12)
    assert silent not in outputs


@pytest.mark.parametrize("more", [{}, {"state": "plane_stress"}])
def test_elastic_strain_is_that_of_the_stress_by_hookes_law(more):
    """A block that flows, drawn and sheared: E e = (1 + nu) s - nu tr(s), and nothing is told where nothing flows."""
    draw = {"t": [0.0, 5.0], "value": [0.0, 5e-3]}
    held = [hold("block.left", 0), hold("block.bottom", 1), hold("block.right", 0, draw), hold("block.right", 1)]
    half = elastic(block([0.0, 0.4, 1.0], [0.0, 0.2, 0.5]), held, {**STEEL, "plastic": {"s_y": 5e7}}, **more)
    state, outputs = half.start(inputs_of(half), 0.0, NoLink())
    np.testing.assert_array_equal(outputs["elastic_strain"], 0.0)
    _, outputs = done(half.step(state, inputs_of(half), 0.0, 5.0, NoLink()))
    s, e = outputs["sigma"], outputs["elastic_strain"]
    assert np.abs(s).max() > 5e7
    assert np.abs(s[:, 2]).max() > 1e6
    trace = s[:, [0, 1, 3]].sum(axis=1)
    normal = 1.3 * s[:, [0, 1, 3]] - 0.3 * trace[:, None]
    np.testing.assert_allclose(2e11 * e[:, [0, 1, 3]], normal, rtol=1e-9, atol=1.0)
    np.testing.assert_allclose(2e11 * e[:, 2], 1.3 * s[:, 2], rtol=1e-9, atol=1.0)
    other = elastic(block([0.0, 1.0], [0.0, 1.0]), held, STEEL, **more)
    assert "elastic_strain" not in {v.name for v in other.variables}


def test_what_pair_nodes_do():
    told = SimpleNamespace(t_N=np.array([0.0, 0.0, -1.0, -1.0, -1.0]), node_covered=np.array([0.0, 0.5, 1.0, 1.0, 0.2]),
                           slipping=np.array([0.0, 0.0, 0.4, 0.6, 0.0]))
    np.testing.assert_array_equal(status(told), [ALONE, OPEN, TOUCHES, SLIPS, TOUCHES])
