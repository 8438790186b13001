"""A block pressed on a floor beside a wall that it only touches: the floor carries all of it, the wall nothing.

Without Poisson's ratio both are bars in a row: p = E delta/(2 L + E/eps_N), with multipliers E delta/(2 L).  The strain
is 2.5e-5: by so much a pressure of finite strain differs from that, and what is left at the wall is of second order.
"""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.half.state import from_bytes, to_bytes
from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, done, elastic, hold, inputs_of, rectangle

L, E, DELTA = 0.04, 2.0e11, 2e-6
STRAIN = 2.0 * 2.5e-5  # of the pressure, by finite strain
SECOND_ORDER = 1e-6  # of the pressure
NAMES = {"floor": ("block.bottom", "ground.top"), "wall": ("block.left", "post.right")}
HOLDS = [hold("ground.bottom", 0), hold("ground.bottom", 1), hold("ground.left", 0), hold("post.left", 0),
         hold("post.left", 1), hold("block.top", 0)]


def corner(n, order=("floor", "wall"), mu=0.0, eps=None):
    """Three squares: block above the ground, post on its left."""
    grid = np.linspace(0.0, L, n + 1)
    parts = {"ground": (grid, grid - L), "post": (np.linspace(-L, 0.0, n + 1), np.linspace(0.0, L, n + 2)),
             "block": (grid, grid)}
    nodes, cells, surfaces, of = [], [], {}, []
    for k, (body, (x, y)) in enumerate(parts.items()):
        own, quads, edges = rectangle(x, y, first=sum(map(len, nodes)))
        nodes.append(own)
        cells.append(quads)
        surfaces |= {f"{body}.{name}": e for name, e in edges.items()}
        of.append(np.full(len(quads), k, np.int32))
    pairs = tuple(Pair(name, *NAMES[name], 0.01, eps or E * n / L, mu) for name in order)
    return Interface("plane", np.concatenate(nodes), np.concatenate(cells).astype(np.int32), NO_CELLS[3],
                     np.concatenate(of), np.empty(0, np.int32), tuple(parts), ("m",) * 3, surfaces, pairs=pairs)


def pressed(interface, augmented=(), steps=2, drag=0.0, link="direct", **more):
    """The half and what it gives out after some steps, the block's top lower by DELTA and then dragged aside."""
    driven = [hold("block.top", 1, {"t": [0, 1], "value": [0.0, -DELTA]})]
    holds = [b for b in HOLDS if not (drag and b == HOLDS[-1])]
    if drag:
        driven.append(hold("block.top", 0, {"t": [0, 1, 2], "value": [0.0, 0.0, drag]}))
    pairs = {name: {"augmented": {"tolerance": 1e-9, "method": "semi_smooth"}} for name in augmented}
    half = elastic(interface, [*holds, *driven], {"nu": 0.0}, tolerance=1e-11, pairs=pairs, **more)
    with closing(open_link(link)) as service:
        state, outputs = half.start(inputs_of(half), 0.0, service)
        for i in range(steps):
            state, outputs = done(half.step(state, inputs_of(half), float(i), 1.0, service))
    return half, state, outputs


def sides(interface):
    return [interface.side_of(name, NAMES[name][0]).at for name in ("floor", "wall")]


@pytest.mark.few("4-no", "4-floor", "4-wall", "4-both", "8-no", "8-floor", "8-wall", "8-both")
@pytest.mark.parametrize("augmented", [(), ("floor",), ("wall",), ("floor", "wall")],
                         ids=["no", "floor", "wall", "both"])
@pytest.mark.parametrize("n", [4, 8, 16])
def test_the_floor_carries_all_and_the_wall_nothing(n, augmented):
    """At any mesh, whichever pair has multipliers."""
    interface = corner(n)
    below, beside = sides(interface)
    _, _, outputs = pressed(interface, augmented)
    soft = 0.0 if "floor" in augmented else L / n
    p = E * DELTA / (2.0 * L + soft)
    assert outputs["contact.t_N"][below] == pytest.approx(-p, rel=STRAIN)
    assert np.abs(outputs["contact.t_N"][beside]).max() < SECOND_ORDER * p
    assert abs(outputs["reaction.post"][0]) < SECOND_ORDER * p * L
    assert outputs["reaction.ground"][1] == pytest.approx(p * L, rel=STRAIN)


def test_the_order_of_the_pairs_changes_nothing():
    """With friction, dragged away from the wall; values of each pair, to what the solver leaves."""
    found = []
    for order in (("floor", "wall"), ("wall", "floor")):
        interface = corner(5, order, mu=0.3)
        _, _, outputs = pressed(interface, ("floor",), steps=3, drag=4e-7)
        names = [n for n, v in outputs.items() if n.startswith("contact.") and np.ndim(v)]
        found.append({"x": outputs["x"]} | {f"{n} {k}": outputs[n][at] for k, at in enumerate(sides(interface))
                                            for n in names})
    for name, value in found[0].items():
        scale = max(np.abs(v).max() for n, v in found[0].items() if n.split()[0] == name.split()[0])
        np.testing.assert_allclose(found[1][name], value, rtol=0.0, atol=1e-7 * scale, err_msg=name)
    assert found[0]["contact.t_T 0"].any()


def test_what_slides_on_the_floor_makes_no_heat_at_the_wall():
    """Dragged away from it, at Coulomb's bound: the corner's friction is the floor's."""
    interface = corner(6, mu=0.1)
    below, beside = sides(interface)
    _, _, outputs = pressed(interface, ("floor",), steps=2, drag=3e-6)
    assert outputs["contact.E_friction"][below].min() > 0.0
    assert not outputs["contact.E_friction"][beside].any()
    assert not outputs["contact.t_T"][beside].any()
    p = -outputs["contact.t_N"][below]
    assert np.abs(outputs["contact.t_T"][below]) == pytest.approx(0.1 * p, rel=1e-9)


def test_the_link_and_a_state_written_down_change_no_bit():
    interface = corner(4, mu=0.3)
    half, state, outputs = pressed(interface, ("floor", "wall"), drag=2e-7)
    _, there, encoded = pressed(interface, ("floor", "wall"), drag=2e-7, link="codec")
    assert to_bytes(there) == to_bytes(state)
    assert all(np.asarray(v).tobytes() == np.asarray(encoded[n]).tobytes() for n, v in outputs.items())
    assert state.contact.multipliers.shape == state.contact.mobilised.shape == (interface.pair_nodes.size,)
    again = from_bytes(to_bytes(state), {"mechanical_fmu", "contact"})
    with closing(open_link("direct")) as link:
        one, other = (done(half.step(s, inputs_of(half), 2.0, 1.0, link))[1] for s in (state, again))
    assert all(np.asarray(v).tobytes() == np.asarray(other[n]).tobytes() for n, v in one.items())
