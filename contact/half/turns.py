"""Turns of the plane: by how much points turned, and how far a turn takes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def turn_between(a: Floats, b: Floats) -> float:
    """Find the angle [rad] by which arms a : (n, 2) [m] turn best into b : (n, 2) [m], in (-pi, pi].

    The least squares of Wahba's problem in the plane; 0 where all arms vanish.
    """
    return float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))


def rotated(arm: Floats, angle: float) -> Floats:
    """Compute (n, 2) R(angle) arm - arm [m] of arm : (n, 2) [m]; angle [rad], anticlockwise."""
    # cos - 1 by half angles: small turns keep their digits.
    c1, s = -2.0 * np.sin(0.5 * angle) ** 2, np.sin(angle)
    # fault: points go along the chord of a turn -> return np.stack([-angle * arm[:, 1], angle * arm[:, 0]], axis=1) |
    #   mechanical_fmu/test_motions
    return np.stack([c1 * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c1 * arm[:, 1]], axis=1)
