"""A wrong model.json or mesh is refused with the key, the value and what would do."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mechanical_fmu.elastic_half import load

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import block, blocks, elastic, hold, press


@pytest.mark.parametrize(("material", "text"), [
    ({"nu": 0.5}, "materials.m.nu: must lie between -1 and 0.5, both excluded, not 0.5"),
    ({"nu": -1.0}, "materials.m.nu"), ({"E": 0.0}, "materials.m.E: must be greater than zero, not 0.0"),
    ({"E": {"T": [0, 1], "value": [1.0, -1.0]}}, "materials.m.E.value.1: must be greater than zero, not -1.0"),
    ({"E": {"T": [1, 0], "value": [1.0, 1.0]}}, r"materials\.m\.E\.T\.1: the temperatures of a table must increase"),
    ({"colour": 1.0}, "materials.m.colour: unknown key, not 1.0"),
    ({"T_ref": "cold"}, "materials.m.T_ref: a number is needed here, not text"),
])
def test_materials(material, text):
    with pytest.raises(ValueError, match=text):
        elastic(block([0, 1], [0, 1]), material=material)


@pytest.mark.parametrize(("boundary", "text"), [
    (hold("block.lid", 0), r"boundary\.0\.on: there is no surface 'block.lid'\. .*block.bottom, block.left"),
    (hold("block.top", 2), r"boundary\.0\.angle: only a rigid body has an angle"),
    (press("corner", 1.0), r"boundary\.0\.at: pressure acts on a surface, not at points"),
    ({"glue": 1.0, "on": "block.top"}, r"boundary\.0\.glue: unknown key, not 1.0\. Did you mean 'angle'"),
    ({"on": "block.top"}, "one kind of condition is needed"),
    (hold("block.top", 0, {"t": [0], "value": []}), r"boundary\.0\.u_x: 1 time, but 0 values"),
])
def test_boundaries(boundary, text):
    with pytest.raises(ValueError, match=text):
        elastic(block([0, 1], [0, 1], node_sets={"corner": [0]}), [boundary])


def test_two_prescriptions_of_one_component_must_agree():
    interface = block([0, 1], [0, 1], node_sets={"corner": [0]})
    elastic(interface, [hold("block.bottom", 1), hold("corner", 1)])
    with pytest.raises(ValueError, match=r"boundary\.1\.u_y: u_y of 1 node of corner is prescribed by entry 0 "
                       r"\(block\.bottom\) already, and differently: 0 m there, 0\.1 m here, for node 1"):
        elastic(interface, [hold("block.bottom", 1), hold("corner", 1, 0.1)])


def test_bodies_and_pairs():
    interface = blocks(2, 2)
    model = {"half": "elastic", "format": 2, "materials": {"m": {"E": 1.0, "nu": 0.0}},
             "bodies": {"lower": {"material": "m"}}}
    with pytest.raises(ValueError, match="bodies: key 'upper' is missing"):
        load(interface, model)
    with pytest.raises(ValueError, match=r"bodies\.upper\.material: there is no material 'n'"):
        load(interface, model | {"bodies": {"lower": {"material": "m"}, "upper": {"material": "n"}}})
    with pytest.raises(ValueError, match="half 'thermal', format 2 is not elastic, 2"):
        load(interface, model | {"half": "thermal"})
    with pytest.raises(ValueError, match=r"pairs\.interface: no penalty can be found"):
        elastic(blocks(2, 2, eps_N=0.0))


def test_meshes():
    interface = block([0, 1, 2], [0, 1])
    with pytest.raises(ValueError, match="mesh: cell 2 of body block has no volume or its nodes run clockwise"):
        elastic(replace(interface, quads=np.array([interface.quads[0], interface.quads[1][::-1]])))
    with pytest.raises(ValueError, match="cell 1 of body block lies on the wrong side of the axis"):
        elastic(block([-1, 0], [0, 1], geometry="axisymmetric"))
    with pytest.raises(ValueError, match="body ghost has no cells"):
        elastic(replace(interface, bodies=("block", "ghost")))


def test_nodes_on_the_axis_stay_on_it_and_stray_nodes_stay():
    interface = block([0, 1], [0, 1], geometry="axisymmetric")
    half = elastic(replace(interface, nodes=np.vstack([interface.nodes, [[5.0, 5.0]]])))
    assert half.system.constraints.fixed.tolist() == [0, 2, 8, 9]
