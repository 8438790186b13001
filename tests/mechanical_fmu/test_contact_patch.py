"""C1: a uniform pressure through edges that do not match leaves both bodies uniformly stressed."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, blocks, done, elastic, hold, inputs_of, press, stress_of

from contact.rpc.link import open_link

P = 1e6


def squeezed(lower, upper, **pair):
    """Stresses (n_e, nq, 4) of both bodies, the upper pressed by P, one side free; and tractions."""
    interface = blocks(lower, upper)
    interface = replace(interface, pairs=tuple(replace(p, **pair) for p in interface.pairs))
    boundary = [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0), press("upper.top", P)]
    # Nothing but contact holds the upper block: it starts a hair too deep.
    interface = replace(interface, nodes=interface.nodes - np.where(
        (interface.node_body == 1)[:, None], [0.0, 1e-7], [0.0, 0.0]))
    half = elastic(interface, boundary, tolerance=1e-12)
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        state, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
    return stress_of(half, state, np.full(len(interface.nodes), 300.0))[0], outputs


@pytest.mark.parametrize(("lower", "upper"), [(3, 4), (5, 7)])
@pytest.mark.parametrize("two_pass", [False, True])
def test_edges_cut_at_the_others_nodes_pass_it(lower, upper, two_pass):
    stress, outputs = squeezed(lower, upper, two_pass=two_pass)
    # Pressure follows the edge as it stretches, so that of both surfaces is P to round-off of the solution.
    assert np.abs(stress[..., 1] + P).max() <= EXPECTED["C1"]["tolerance"] * P
    assert np.abs(stress[..., 2]).max() <= EXPECTED["C1"]["tolerance"] * P
    assert np.abs(outputs["contact.t_N"] + P).max() <= EXPECTED["C1"]["tolerance"] * P


@pytest.mark.parametrize(("lower", "upper"), [(3, 4), (5, 7)])
def test_one_point_a_node_does_not(lower, upper):
    """The defect of the paper's form: percents of the pressure, however fine the solution."""
    stress, outputs = squeezed(lower, upper, by_node=True)
    assert 0.02 * P < np.abs(stress[..., 1] + P).max() < P
    assert outputs["reaction.lower"][1] == pytest.approx(P * np.ptp(outputs["x"][:, 0]), rel=1e-3)
