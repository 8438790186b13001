"""A slender body that lies along another without a load: where its contact is at the start is found."""

import sys
from contextlib import closing
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, elastic, hold, inputs_of, rectangle

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link

R, THICK, EDGES = 0.05, 5e-4, 40  # m


def belt_on_a_drum():
    """A quarter of a drum and a belt on it: their nodes do not face each other, so that their edges overlap."""
    around, n, at = [], 0, {}
    for name, turn, r, rows in (("drum", 0.55 * np.pi, (0.03, R), 4), ("belt", 0.5 * np.pi, (R, R + THICK), 2)):
        nodes, cells, surfaces = rectangle(np.linspace(0.5 * np.pi - turn, 0.5 * np.pi, EDGES + 1),
                                           np.linspace(*r, rows + 1), first=n)
        around.append((np.column_stack([nodes[:, 1] * np.sin(nodes[:, 0]), nodes[:, 1] * np.cos(nodes[:, 0])]), cells))
        at |= {f"{name}.{side}": edges for side, edges in surfaces.items()}
        n += len(nodes)
    body = np.repeat(np.arange(2, dtype=np.int32), [len(cells) for _, cells in around])
    pair = Pair("f", "belt.bottom", "drum.top", 2e-3, 2e12)
    return Interface("plane", np.concatenate([x for x, _ in around]), np.concatenate([c for _, c in around]),
                     NO_CELLS[3], body, np.zeros(0, np.int32), ("drum", "belt"), ("m", "m"), at, {}, (pair,))


def test_a_belt_without_a_load_finds_where_it_touches_its_drum():
    """It is held at its lower end alone and peels off node by node: no load says where it is to lie."""
    half = elastic(belt_on_a_drum(), [hold("drum.bottom", 0), hold("drum.bottom", 1), hold("belt.right", 0),
                                            hold("belt.right", 1)],
                   element="enhanced", pairs={"f": {"augmented": {"method": "semi_smooth", "tolerance": 1e-3}}})
    with closing(open_link("direct")) as link:
        _, told = half.start(inputs_of(half), 0.0, link)
    assert told["iterations"] > half.settings.max_iterations
    assert told["residual"] <= half.settings.tolerance
    assert told["contact.gap"].min() > -2e-5, "edges lie 10 um inside their arcs"
