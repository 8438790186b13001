"""The penalty of a contact quadrature point: what its pair states, or that of the two edges there in a row."""

from __future__ import annotations

from contact.compiled import kernel
from contact.messages import Floats, Ints


@kernel
def penalties(stated: Floats, stiffness: Floats, met: Ints) -> Floats:
    """Return eps_N (n_p,) [Pa/m] of points: as stated, or that of the two edges in a row where that is 0.

    stated : (n_p,) [Pa/m].  stiffness : (n_edges,) [Pa/m].  met : (n_p, 2) slave and master edge.
    """
    eps = stated.copy()
    for i in range(eps.size):
        if not eps[i] > 0.0:
            # fault: one penalty for the whole of a surface -> eps[i] = in_a_row(stiffness.max(), stiffness.max()) |
            #   contact/test_local_penalty
            eps[i] = in_a_row(stiffness[met[i, 0]], stiffness[met[i, 1]])
    return eps


@kernel
def in_a_row(first: float, second: float) -> float:
    """Return the stiffness [Pa/m] of two layers one behind the other, each [Pa/m], 0 where one has none."""
    return first * second / (first + second) if first > 0.0 and second > 0.0 else 0.0
