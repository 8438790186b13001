"""The outline of a body, against a count of the cells at each edge."""

from collections import Counter

import numpy as np
import pytest

from contact.half.outlines import outline


def counted(*cells: np.ndarray) -> list[tuple[int, int]]:
    """Edges of one cell only, in the order of the cells."""
    edges = [(int(a), int(b)) for kind in cells for column in range(kind.shape[1])
             for a, b in zip(kind[:, column], np.roll(kind, -1, axis=1)[:, column], strict=True)]
    times = Counter(frozenset(edge) for edge in edges)
    return sorted(edge for edge in edges if times[frozenset(edge)] == 1)


@pytest.mark.parametrize("kept", [0, 1, 5, 30, 60])
def test_outline_has_the_edges_of_one_cell(kept: int) -> None:
    """Of quads and triangles with holes, however they are numbered."""
    rng = np.random.default_rng(kept)
    grid = rng.permutation(99).reshape(9, 11)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    quads = quads[rng.permutation(len(quads))[:kept]].astype(np.int32)
    halved, quads = quads[::2], quads[1::2]
    triangles = np.concatenate([halved[:, [0, 1, 2]], halved[:, [0, 2, 3]]])
    found = outline(quads, triangles)
    assert found.shape[1] == 2
    assert sorted((int(a), int(b)) for a, b in found) == counted(quads, triangles)
