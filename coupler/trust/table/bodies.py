"""The bodies of a scene as wholes: their mean temperature and displacement, how they deform, and a place in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.schemes.levels import Level

Array = NDArray[np.float64]


class Bodies:
    """Means over the nodes of each body."""

    def __init__(self, interface: Interface) -> None:
        self._interface = interface
        self._inside = np.flatnonzero(interface.node_body >= 0)
        self._of = interface.node_body[self._inside]
        self._counts = np.maximum(np.bincount(self._of, minlength=len(interface.bodies)), 1)

    def mean_temperatures(self, now: Level) -> Array:
        """Return the mean temperature of each body, (n_bodies,) [K]."""
        return np.bincount(self._of, weights=now.T[self._inside], minlength=len(self._counts)) / self._counts

    def extremes(self, now: Level, body: str) -> tuple[float, float]:
        """Return the lowest and the highest temperature of a body [K]."""
        T = now.T[self._interface.node_body == self._interface.bodies.index(body)]
        return float(T.min()), float(T.max())

    def moved(self, now: Level) -> Array:
        """Return the mean displacement of each body, (n_bodies, 2) [m]."""
        u = now.x[self._inside] - self._interface.nodes[self._inside]
        sums = np.stack([np.bincount(self._of, weights=c, minlength=len(self._counts)) for c in u.T], axis=1)
        return np.asarray(sums / self._counts[:, None])

    def deformed(self, now: Level) -> float:
        """Return the largest displacement [m] of a node beside the mean of its body."""
        u = now.x[self._inside] - self._interface.nodes[self._inside]
        return float(np.linalg.norm(u - self.moved(now)[self._of], axis=1).max(initial=0.0))

    def place(self, node: int, end: int | None = None) -> str:
        """Return a node in words, or the middle between it and another."""
        if node < 0:
            return "a node"
        x, y = 0.5 * (self._interface.nodes[node] + self._interface.nodes[node if end is None else end])
        body = int(self._interface.node_body[node])
        name = self._interface.bodies[body] if body >= 0 else "no body"
        return f"{name} at ({x:.6g}, {y:.6g}) m"
