"""How long the next inner step may be: a controller with memory."""

from __future__ import annotations

from dataclasses import dataclass

SAFETY = 0.9
# The proportional and the integral share: a pure integral one swings where the bound changes from step to step.
OF_ERROR, OF_LAST_ERROR = 0.7, 0.4
MOST_GROWTH, MOST_CUT = 4.0, 0.1
FAILED_CUT = 0.5  # of a step that was not solved
SMALLEST = 1e-6  # share of a bound: one that is not felt at all must not be divided by
SHORTENED = 1.0 - 1e-9  # of a length: what is left beyond it is round-off, not a step


@dataclass(frozen=True)
class Pace:
    """What inner steps hand on.  h : length to try next [s], 0: not known yet.

    error : of the last inner step, as a share of the tolerance; 1 where its method or its data were others.
    """

    h: float = 0.0
    error: float = 1.0


NO_PACE = Pace()


@dataclass(frozen=True)
class Measure:
    """A step that was solved.  error, change : estimated local error and largest change of T, as shares of what is
    allowed.  order : the error falls like h^(order + 1).
    """

    error: float
    change: float
    order: int

    @property
    def passes(self) -> bool:
        """Whether it keeps to both bounds; a measure that is no number does not."""
        # fault: max_dT not kept to -> return self.error <= 1.0 | thermal_fmu/test_thermal_adaptive
        return self.error <= 1.0 and self.change <= 1.0


def length(h: float, left: float) -> float:
    """The step to try where h [s] is wished (0: no wish) and `left` [s] remain: never a sliver for the last one."""
    if h == 0.0 or h >= SHORTENED * left:
        return left
    # fault: a sliver for the last inner step -> return h | thermal_fmu/test_thermal_adaptive
    return 0.5 * left if 2.0 * h > left else h


def shorter(h: float, found: Measure | None) -> float:
    """The next try after a step h [s] that did not pass; found : None where it was not solved."""
    if found is None:
        return FAILED_CUT * h
    by_error = SAFETY * max(found.error, SMALLEST) ** (-1.0 / (found.order + 1))
    return h * max(MOST_CUT, min(SAFETY, by_error, SAFETY / max(found.change, SMALLEST)))


def after(pace: Pace, h: float, found: Measure, retried: bool) -> Pace:
    """The pace after a step h [s] that passed; retried : a longer one did not."""
    power = found.order + 1
    error = max(found.error, SMALLEST)
    growth = SAFETY * error ** (-OF_ERROR / power) * pace.error ** (OF_LAST_ERROR / power)
    growth = min(growth, SAFETY / max(found.change, SMALLEST), 1.0 if retried else MOST_GROWTH)
    if not retried and h < SHORTENED * pace.h:
        return Pace(max(pace.h, growth * h), pace.error)  # cut short by a kink, which says nothing against the pace
    return Pace(growth * h, error)
