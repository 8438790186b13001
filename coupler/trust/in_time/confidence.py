"""What companions in coarser windows, and on a coarser mesh, say of each probe of a run (Richardson)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupler.trust.checks import Check, TrustVerdict, amount, measured

Array = NDArray[np.float64]

NAME = "error against coarser windows"
WINDOWS, MESH = "windows of 2 and 4 times the size", "a mesh of half as many cells"
# Of the range of a probe: what a reader sees in a curve, and what spoils it.
NOTE_AT, LIMIT = 0.02, 0.12
# Orders this near are one; where the observed one is lower by more than this errors hardly fall with the window.
NEAR, LOST = 0.5, 1.0


@dataclass(frozen=True)
class ProbeConfidence:
    """The error of a probe over a run.

    by : what it was held against.  error : (n_t,) at the times of the run, in SI; nan where a companion failed.
    order, expected : observed order in the window, nan where all runs agree, and that of the scheme.
    range, unit : of the probe, in SI.  failed : why a comparison run has no result.
    """

    by: str
    error: Array
    order: float
    expected: int
    range: float
    unit: str
    failed: str = ""

    @property
    def share(self) -> float:
        """The largest error over the range of the probe; 0.0 where it does not move."""
        most = float(self.error.max(initial=0.0))
        return most / self.range if self.range > 0.0 else 0.0

    @property
    def as_expected(self) -> bool:
        """Whether the observed order is that of the scheme, or higher; true where all runs agree."""
        return math.isnan(self.order) or self.order > self.expected - NEAR

    @property
    def words(self) -> str:
        """The order in words."""
        if math.isnan(self.order):
            return "the same in all windows"
        return f"order {self.order:.2f}" + ("" if self.as_expected else f" (the scheme has order {self.expected})")


def check(found: Mapping[str, ProbeConfidence]) -> Check:
    """Return the row of the trust table."""
    failed = next((f.failed for f in found.values() if f.failed), "")
    if failed or not found:
        return Check(NAME, TrustVerdict.UNCHECKED, what=f"a comparison run has no result: {failed}" if failed else
                     "every probe tells what one step moved")
    name = max(found, key=lambda n: found[n].share)
    worst = found[name]
    unlike = [f"{n} ({f.words})" for n, f in found.items() if not f.as_expected and f.share > NOTE_AT]
    number = worst.share
    lost = [f.share for f in found.values() if f.order < f.expected - LOST and f.share > NOTE_AT]
    what = (f"{name} is off by about {100 * number:.3g} % of its range ({amount(number * worst.range, worst.unit)}), "
            f"by {worst.by}; {worst.words}")
    if unlike:
        what += f"; errors do not decrease with the order of the scheme: {', '.join(unlike)}"
    # Where errors do not fall with the window, what they are is not known.
    # fault: an order that is lost is no matter -> limits = (NOTE_AT, LIMIT) | coupler/test_confidence
    limits = (NOTE_AT, NOTE_AT) if lost else (NOTE_AT, LIMIT)
    return measured(NAME, number, limits, t=0.0, what=what,
                    remedy="Smaller windows" if MESH not in worst.by else "Smaller windows and a finer mesh")
