"""Windows whose error no window before them announces: a gap closes or opens in them, a front moves, or a pair that
slides begins, ends or goes on to face otherwise than before.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupler.control.contact_status import ROUND_OFF as TOUCH
from coupler.schemes.levels import Level, extent
from coupler.schemes.state import CoupledState

# Gaps that close or open within one window: there its error has no order yet, and nothing before it announces it.
#
# Heat across a gap that falls steadily to zero goes with 1/(layer + gap).  Until windows are as short as the last layer
# takes to close, a window and its two halves both miss most of what crosses just before touch: their difference hardly
# falls with the window, so a quarter of it is not the error of the halves' answer.

# A gap that falls to, or rises from, less than this share of itself: over that 1/gap is no parabola.
SHARE = 0.1
# Of the size of the scene: bodies of 100 mm have layers of gas of 10 um between them, and a gap that was never wider
# than a hundredth of that changes no law of conductance by more than 1 %.
THIN = 1e-6
# A node is wholly faced from this share on.
WHOLLY = 0.999


def thin(level: Level) -> float:
    """Return the widest gap that counts as thin [m]."""
    # fault: what is thin is a fixed length -> return 1e-7 | coupler/test_estimate
    return THIN * extent(level)


def open_gaps(level: Level) -> float:
    """The sum of 1/gap^2 over points that face another body and do not touch it [1/m2]; thin ones count as `thin`."""
    gap = level.gap[np.isfinite(level.gap) & (level.covered > 0.0)]
    # fault: a gap of round-off is open -> touch = 0.0 | coupler/test_auto
    touch = TOUCH * extent(level)
    return float((1.0 / np.maximum(gap[gap > touch], thin(level))**2).sum())


# What heat across open gaps feeds back goes with 1/gap^2: what was measured of the exchange holds up to this factor.
OTHER_GAPS = 4.0


def other_gaps(then: float, now: float) -> bool:
    """Whether open gaps feed back so much more or less than then that what was measured does not hold.

    then, now [1/m2] : `open_gaps`; nan: not known.
    """
    return now > OTHER_GAPS * then or then > OTHER_GAPS * now


def gap_closes(start: Level, end: Level) -> bool:
    """Whether some gap, wholly faced at both ends of a window, all but closes in it, or opens.

    One that is faced in part is at the end of a surface that slides: what is told of it goes to and fro there.
    """
    faced = np.isfinite(start.gap) & np.isfinite(end.gap)
    # fault: nodes at the end of a surface that slides close gaps in every window -> faced &= (start.covered > 0.0) &
    #   (end.covered > 0.0) | coupler/test_estimate
    faced &= (start.covered > WHOLLY) & (end.covered > WHOLLY)
    a, b = (np.maximum(level.gap[faced], 0.0) for level in (start, end))
    wider = np.maximum(a, b)
    return bool(((wider > thin(start)) & (np.minimum(a, b) < SHARE * wider)).any())


# A solid fraction that changes by more moves a front; less is what Newton leaves.
FRONT = 1e-6


def front_moves(start: CoupledState) -> bool:
    """Whether anything froze or melted in the window before.

    A node that begins or ends to freeze is a kink of T in time that no window before it announced, however well ratios
    agreed between two of them.
    """
    now, before = start.now.f_s, start.past[0].f_s
    return now is not None and before is not None and float(np.abs(now - before).max(initial=0.0)) > FRONT


# Of the surface of a pair that faces the other side: a line through the last two levels tells it as nearly as this
# where surfaces slide.  Where one comes to the end of the other, or leaves it, that area has a kink: until then its
# line was exact, so the ratio of an error to its bend is 0 and stays 0 however much the area misses the line by.
FACED = 0.05


def faces_otherwise(pairs: Sequence[NDArray[np.intp]], start: CoupledState, end: Level) -> bool:
    """Whether some pair faces the other side otherwise at the end of a window than it was about to at its start.

    pairs : the pair nodes of each.  start : with the level before it in `past`.
    """
    now, before = start.now, start.past[0]
    w = (end.t - now.t) / (now.t - before.t)
    for nodes in pairs:
        a, b, c = (float(level.covered[nodes].sum()) for level in (before, now, end))
        if abs(c - b - w * (b - a)) > FACED * max(b, c):
            return True
    return False
