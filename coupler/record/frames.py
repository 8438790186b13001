"""Which window ends become frames of fields: after so much change, sooner at events, within a budget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.outputs import OutputField
from coupler.schemes.levels import Level

Array = NDArray[np.float64]

TIME_COUNTS = 0.5  # weight of plain time against change: a long rest deserves frames too
EVENT = 0.25  # share of the change between two frames after which an event makes one
FIRST = 1.5  # change expected of a run, in units of its span; each time it is more, half of the frames go
BYTES = 200_000_000  # of all frames of a run, at most


@dataclass(frozen=True)
class FrameChoice:
    """What decides whether a window's end is kept: a value, so that a resumed run chooses the same.

    most : frames; 0: none are chosen.  end [s] : of the run.  kept : chosen since the last thinning, and what was left.
    step [1] : change after which a frame is due.  told [1] : change since the last one.
    t [s], T : (n,) [K], x : (n, 2) [m] at the last window's end.  spans : of T [K] and size of the bodies [m], so far.
    """

    most: int = 0
    end: float = 1.0
    step: float = 0.0
    kept: int = 0
    told: float = 0.0
    t: float = 0.0
    T: Array = field(default_factory=lambda: np.empty(0))
    x: Array = field(default_factory=lambda: np.empty((0, 2)))
    spans: tuple[float, float] = (0.0, 1.0)

    def begun(self, now: Level) -> FrameChoice:
        """At the start, of which there is a frame in any case."""
        return replace(self, t=now.t, T=now.T, x=now.x,
                       spans=(float(np.ptp(now.T)), float(np.ptp(now.x, axis=0).max()) or 1.0))

    def after(self, now: Level, event: bool, asked: bool) -> tuple[FrameChoice, bool, bool]:
        """Look at the end of an accepted window: return the new state, whether to keep it, whether to thin before.

        event : contact opened or closed, stuck or slipped.  asked : it is kept in any case, and costs no budget.
        """
        if not self.most:
            return self, asked, False
        span, size = max(self.spans[0], float(np.ptp(now.T))), self.spans[1]
        change = float(np.abs(now.x - self.x).max()) / size + TIME_COUNTS * (now.t - self.t) / self.end
        warmed = float(np.abs(now.T - self.T).max())
        # A body of one temperature that is heated as a whole has no span of its own but what it was heated by.
        span = max(span, warmed)
        change += warmed / span if span else 0.0
        told = self.told + change
        # fault: frames: only time makes a frame due -> due = False | coupler/test_frames
        due = told >= self.step * (EVENT if event else 1.0)
        found = replace(self, told=0.0 if due or asked else told, t=now.t, T=now.T, x=now.x, spans=(span, size))
        if not due or asked:
            return found, asked, False
        # fault: frames: the budget is not kept -> thin = False | coupler/test_frames
        thin = self.kept + 1 >= self.most
        if thin:
            found = replace(found, step=2.0 * self.step, kept=(self.kept + 1) // 2)
        return replace(found, kept=found.kept + 1), True, thin


def frame_choice(most: int, end: float, nodes: int, fields: Sequence[OutputField]) -> FrameChoice:
    """The choice at the start of a run to the time `end` [s], of a mesh with so many nodes and these extra fields."""
    size = 8 * (7 * nodes + sum(int(np.prod(f.shape)) for f in fields))
    most = min(most, max(BYTES // size, 2))
    return FrameChoice(most, end, FIRST / most if most else 0.0)


def thinned(frames: dict[int, float], chosen: Sequence[int]) -> dict[int, float]:
    """Return frames (number -> time [s]) without every second of those that were chosen for change."""
    gone = set([k for k in chosen if k in frames][1::2])
    return {k: t for k, t in frames.items() if k not in gone}
