"""Gaps that close or open within one window: there its error has no order yet, and nothing before it announces it.

Heat across a gap that falls steadily to zero goes with 1/(layer + gap).  Until windows are as short as the last layer
takes to close, a window and its two halves both miss most of what crosses just before touch: their difference hardly
falls with the window, so a quarter of it is not the error of the halves' answer.
"""

from __future__ import annotations

import numpy as np

from coupler.schemes.level import Level

# A gap that falls to, or rises from, less than this share of itself: over that 1/gap is no parabola.
SHARE = 0.1
# [m] A hundredth of a gas layer of 10 um: a gap that was never wider changes no law of conductance by more than 1 %.
THIN = 1e-7


def closes(start: Level, end: Level) -> bool:
    """Whether some gap, faced at both ends of a window, all but closes in it, or opens."""
    faced = np.isfinite(start.gap) & np.isfinite(end.gap) & (start.covered > 0.0) & (end.covered > 0.0)
    a, b = (np.maximum(level.gap[faced], 0.0) for level in (start, end))
    wider = np.maximum(a, b)
    return bool(((wider > THIN) & (np.minimum(a, b) < SHARE * wider)).any())
