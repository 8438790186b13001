"""Sums at nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def at_nodes(nodes: NDArray[np.integer], share: Floats, n: int) -> Floats:
    """(n,) sums at the nodes of what each place gives to its own; nodes, share : (n_places, m)."""
    return np.bincount(nodes.ravel(), weights=share.ravel(), minlength=n).astype(np.float64, copy=False)
