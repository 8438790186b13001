"""Whether surfaces are in touch where the half `rigid` presses them.

It presses the whole of a pair by what rigid.pressure states as soon as one place of it touches: flat sides meet all at
once.  Where others do, a shaft in a wide bore or a block that stands on an edge, pressure and the heat that hangs on it
act across an open gap, and their force is that of a whole surface: 624 N where 12 N would be pressed.  The number is
the share of what is pressed, by length along the slave, that lies apart by more than a thousandth of an edge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, amount, measured

NAME = "surfaces touch where they are pressed"
SHARES = (0.01, 0.1)  # noted, broken
APART = 1e-3  # of an edge: less is how places are written, and how arcs are drawn


@dataclass(frozen=True)
class StatedLog:
    """share : the largest part of what is pressed that is apart, of `pair` at t [s]; gap : its largest gap [m]."""

    share: float = 0.0
    pair: str = ""
    gap: float = 0.0
    t: float = 0.0


class Stated:
    """The pairs of a scene that are pressed as prescribed."""

    def __init__(self, interface: Interface, mechanical: Mapping[str, Any]) -> None:
        """mechanical : model.json of the half."""
        self._sides = []
        pressed = mechanical.get("pressure", {}) if mechanical.get("half") == "rigid" else {}
        for side in interface.pair_sides:
            if side.own and side.pair in pressed:
                edges = interface.surfaces[side.surface]
                length = np.linalg.norm(np.diff(interface.nodes[edges], axis=1)[:, 0], axis=1)
                reach = np.zeros(len(side.nodes))
                np.add.at(reach, np.searchsorted(side.nodes, edges), 0.5 * length[:, None])
                self._sides.append((side.pair, side.at, reach, APART * float(length.mean())))

    def watched(self, log: StatedLog, now: Level) -> StatedLog:
        """Return the log after one more window."""
        for pair, at, reach, apart in self._sides:
            facing = np.where(now.t_N[at] < 0.0, reach * now.covered[at], 0.0)
            gap: NDArray[np.float64] = np.where(facing > 0.0, now.gap[at], 0.0)
            # fault: what is pressed across a gap is not told -> share = 0.0 | coupler/test_trust_stated
            share = float(facing[gap > apart].sum() / facing.sum()) if facing.any() else 0.0
            if share > log.share:
                log = StatedLog(share, pair, float(gap.max()), now.t)
        return log

    def checks(self, log: StatedLog) -> tuple[Check, ...]:
        """Return the row at the end, where a pressure is prescribed."""
        if not self._sides:
            return ()
        what = (f"pair {log.pair}: {100.0 * log.share:.3g} % of what rigid.pressure presses lies apart, by up to "
                f"{amount(log.gap, 'm')}, at t = {log.t:.6g} s: it acts on the whole pair as soon as one place touches")
        return (measured(NAME, log.share, SHARES, t=log.t, what=what,
                         remedy="Make a pair of the part that touches, or choose the half elastic, which finds where "
                                "surfaces press"),)
