"""How bodies go that nobody tells how to: by forces, with inertia or pushed by others.

Their motion is not stated, but it is known as it was: the mean of each body, how fast it goes, by how much that changes
and how fast the body turns, from window to window.  With that the next window is looked ahead
(coupler.trust.surfaces.ways).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.turns import turn_between
from coupler.schemes.levels import Level

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# What changes a velocity at once (a blow) says little of what follows: a change in the next window counts as no more
# than so many times the velocity.
CHANGES = 2.0


@dataclass(frozen=True)
class Course:
    """Of each body, at the end of a window of H [s]: v : (n, 2) [m/s], a : (n, 2) [m/s2], spin : (n,) [rad/s]."""

    v: Array = field(default_factory=lambda: np.empty((0, 2)))
    a: Array = field(default_factory=lambda: np.empty((0, 2)))
    spin: Array = field(default_factory=lambda: np.empty(0))
    H: float = 0.0


class Courses:
    """Follows the bodies of a scene."""

    def __init__(self, interface: Interface, model: Mapping[str, Any]) -> None:
        """model : of the mechanical half (model.json)."""
        self.nodes: tuple[Indices, ...] = tuple(
            np.flatnonzero(interface.node_body == b).astype(np.intp) for b in range(len(interface.bodies)))
        bodies = model.get("bodies") or {}
        specs = [bodies.get(name) or {} for name in interface.bodies]
        self._v0 = np.array([spec.get("v0") or (0.0, 0.0) for spec in specs], dtype=float).reshape(-1, 2)
        self._spin0 = np.array([spec.get("omega0") or 0.0 for spec in specs], dtype=float)

    def begun(self) -> Course:
        """Return the courses at the start."""
        # fault: what flies from the start on is taken to rest -> v0 = 0.0 * self._v0 | coupler/test_trust_courses
        v0 = self._v0
        return Course(v0, np.zeros_like(v0), self._spin0)

    def after(self, course: Course, before: Level, now: Level) -> Course:
        """Return the courses after a window."""
        mean, H = self.between(before, now), now.t - before.t
        if not course.H:
            a = 2.0 * (mean.v - course.v) / H
            return replace(mean, v=mean.v + 0.5 * H * a, a=a, H=H)
        # The mean velocity is that of the middle of a window, and so was the one before.
        was = course.v - 0.5 * course.H * course.a
        a = (mean.v - was) / (0.5 * (H + course.H))
        return replace(mean, v=mean.v + 0.5 * H * a, a=a, H=H)

    def between(self, before: Level, now: Level) -> Course:
        """Return the mean course of a window."""
        H, means = now.t - before.t, [(before.x[n].mean(axis=0), now.x[n].mean(axis=0)) for n in self.nodes]
        v = np.array([(b - a) / H for a, b in means]).reshape(-1, 2)
        spin = np.array([turn_between(before.x[n] - a, now.x[n] - b) / H
                         for n, (a, b) in zip(self.nodes, means, strict=True)])
        return Course(v, np.zeros_like(v), spin, H)

    @staticmethod
    def moved(course: Course, body: int, t: float) -> Array:
        """Return (2,) [m], how far a body goes in t [s] from there."""
        v, more = course.v[body], 0.5 * t * course.a[body]
        size, most = float(np.linalg.norm(more)), CHANGES * float(np.linalg.norm(v))
        # fault: what speeds up is looked ahead as if it went evenly -> return np.asarray(t * v) |
        #   coupler/test_trust_courses
        return np.asarray(t * (v + more * min(1.0, most / size if size > 0.0 else 1.0)))
