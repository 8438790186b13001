"""What a scheme costs for the error that is wanted: solver calls a second, from windows whose error was measured.

A window of H seconds with an error of e tolerances would have the wanted one at H (AIM/e)^(1/(p + 1)) of its order p;
its calls over that length are its rate.  Windows solved once and windows iterated are held against each other by it:
twice the calls pay where they let windows be more than twice as long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.control.error_estimate import Estimate
from coupler.control.window_size import AIM
from coupler.schemes.state import Solved

# Iterated windows are kept to where they cost less than this share of windows solved once: near one another the two
# are as good, and a change costs a measurement.
CLEARLY = 0.8
# Where they are, windows solved once are tried again after so many, twice as many each time they lose.
FIRST_PAUSE, LONGEST_PAUSE = 4, 64
# Errors below this share of the wanted one say that any window will do.
NO_ERROR = 1e-3


@dataclass(frozen=True)
class SchemeCosts:
    """once, iterated [1/s] : the calls a second of windows solved once, and iterated; nan: not known.

    waited : windows since one was solved once, of `pause` that pass until one is again; 0: they need not wait.
    """

    once: float = math.nan
    iterated: float = math.nan
    waited: int = 0
    pause: int = 0

    @property
    def waits(self) -> bool:
        """Whether the next window is iterated because that costs less."""
        return self.waited < self.pause


def rate(solved: Solved, H: float, error: Estimate) -> float:
    """Return the calls a second [1/s] that a window's scheme would take for the wanted error.

    H [s] : of the window, in one.
    """
    work = (solved.whole or solved).work
    longer = (AIM / max(error.size, NO_ERROR * AIM)) ** (1.0 / (error.order + 1))
    return (work.thermal_solves + work.mechanical_solves) / (H * longer)


def learned(costs: SchemeCosts, solved: Solved, H: float, error: Estimate | None, exact: bool) -> SchemeCosts:
    """Return the costs after a window of H seconds was taken.

    exact : iterates were taken as far as the user said; else the window tells nothing of what iterating costs.
    """
    iterated = solved.history is not None
    costs = replace(costs, waited=costs.waited + 1 if iterated else 0)
    if error is None or not error.measured or (iterated and not exact):
        return costs
    found = rate(solved, H, error)
    costs = replace(costs, iterated=found) if iterated else replace(costs, once=found)
    if math.isnan(costs.iterated) or math.isnan(costs.once):
        return costs
    # fault: windows are iterated whatever they cost -> dearer = False | coupler/test_cost
    dearer = costs.iterated >= CLEARLY * costs.once
    if dearer:
        return replace(costs, pause=0)
    if not iterated or not costs.pause:
        return replace(costs, waited=0, pause=min(max(2 * costs.pause, FIRST_PAUSE), LONGEST_PAUSE))
    return costs
