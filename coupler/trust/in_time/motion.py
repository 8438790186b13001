"""Whether windows resolve the motion of bodies with inertia: how much their acceleration changes from window to window.

A step that is long beside an oscillation does not fail: the body hops, and its pressure at the ends of windows is 0 or
many times what it carries.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import signal_from
from contact.half.interface import Interface
from coupler.scenario.timing import has_inertia
from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]

NAME = "motion resolved in time"
# pi/n where a period of an oscillation has n windows: noted below 20 windows (0.8 % of the period by the trapezoidal
# rule), broken below 8 (5 %).  A body that hops, with free flight between impacts of one window, reads 1/2.
# Only with friction it breaks: its heat was 5 and 10 % off where a body stopped in windows of 6 a period.
NOTE_AT, LIMIT = 0.15, 0.4
# Of the path of a body, and of coordinates: accelerations that move it less in a window are residuals and round-off.
OF_PATH, OF_PLACE = 1e-7, 1e-14
COUNTS = 0.1  # of the body that is accelerated most: the others lie on something
OF_WEIGHT = 0.01  # of gravity: what changes less presses as evenly as its weight


@dataclass(frozen=True)
class MotionLog:
    """What is remembered of bodies, a row each.

    v : (n_bodies, 2) [m/s] means in the last window, of H [s].  a : (n_bodies, 2) [m/s2] between the last two; empty
    arrays: not known yet.  changed, accelerated : (n_bodies,) [m/s] the sums of |change of a| H and of |a| H.
    moved, path : (n_bodies,) [m] the sums of |a| H2 and of |v| H, over so many `windows`.
    """

    v: Array = field(default_factory=lambda: np.empty((0, 2)))
    a: Array = field(default_factory=lambda: np.empty((0, 2)))
    H: float = 0.0
    changed: Array = field(default_factory=lambda: np.empty(0))
    accelerated: Array = field(default_factory=lambda: np.empty(0))
    moved: Array = field(default_factory=lambda: np.empty(0))
    path: Array = field(default_factory=lambda: np.empty(0))
    windows: int = 0


class Motion:
    """Follows the means of bodies.

    model : of the mechanical half (model.json).  substeps : of it in a window.
    """

    def __init__(self, model: Mapping[str, Any], interface: Interface, substeps: int) -> None:
        explicit = model.get("method") == "explicit"
        self.has_inertia = has_inertia(model)
        self._bodies = interface.bodies
        self._limit = LIMIT if any(p.mu > 0.0 for p in interface.pairs) else math.inf
        gravity = model.get("gravity") or {}
        g = math.hypot(*(float(np.abs(signal_from(gravity.get(axis) or 0.0).value).max()) for axis in ("x", "y")))
        # fault: a body that settled on its contact is told to shake -> self._least = 0.0 * g |
        #   coupler/test_trust_motion
        self._least = OF_WEIGHT * g
        self._round_off = OF_PLACE * float(np.abs(interface.nodes).max(initial=0.0))
        self._why_not = ("the mechanical half takes steps of its own in a window" if explicit else
                         f"the mechanical half takes {substeps} steps in a window" if substeps > 1 else "")

    def watched(self, log: MotionLog, ends: tuple[Array, Array], H: float, fresh: bool) -> MotionLog:
        """Return the log after a window of H [s].

        ends : (n_bodies, 2) [m] mean displacements at its start and its end.  fresh : it begins at a breakpoint, where
        forces may jump.
        """
        v = (ends[1] - ends[0]) / H
        if not len(log.v):
            none = np.zeros(len(v))
            log = replace(log, changed=none, accelerated=none, moved=none, path=none)
        known = replace(log, v=v, H=H, path=log.path + H * np.linalg.norm(v, axis=1), a=np.empty((0, 2)),
                        windows=log.windows + 1)
        if fresh or not len(log.v):
            return known
        a = (v - log.v) / (0.5 * (H + log.H))
        size = np.linalg.norm(a, axis=1)
        size = np.where(size > self._least, size, 0.0)
        known = replace(known, a=a, accelerated=log.accelerated + H * size, moved=log.moved + H * H * size)
        if not len(log.a):
            return known
        counts = (size > 0.0) | (np.linalg.norm(log.a, axis=1) > self._least)
        more = np.where(counts, np.linalg.norm(a - log.a, axis=1), 0.0)
        # fault: a motion that windows do not resolve is trusted -> return known | coupler/test_trust_motion
        return replace(known, changed=log.changed + H * more)

    def checks(self, log: MotionLog) -> tuple[Check, ...]:
        """Return the check at the end; none without inertia."""
        if not self.has_inertia:
            return ()
        if self._why_not or not log.accelerated.any():
            why = self._why_not or "no body was accelerated from window to window"
            return (Check(NAME, TrustVerdict.UNCHECKED, what=why),)
        # fault: a body at rest is told to shake by its round-off -> least = 0.0 * log.path |
        #   coupler/test_trust_motion
        least = OF_PATH * log.path + self._round_off * log.windows
        counts = (log.moved > least) & (log.accelerated > COUNTS * log.accelerated.max(initial=0.0))
        number = np.where(counts, log.changed / (2.0 * np.where(counts, log.accelerated, 1.0)), 0.0)
        b = int(np.argmax(number))
        windows = math.pi / max(float(number[b]), 1e-300)
        return (measured(
            NAME, float(number[b]), (NOTE_AT, self._limit),
            what=f"the acceleration of {self._bodies[b]} changes from window to window as much as that of an "
                 f"oscillation of {windows:.2g} windows a period: pressures at the ends of windows, and with them "
                 "heat, are not those of the motion",
            remedy="Use windows of a twentieth of the period of the fastest oscillation that matters; or leave out "
                   "mechanical.elastic.dynamics if the bodies move slowly"),)
