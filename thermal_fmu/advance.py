"""The way of one communication substep: by increments, by inner steps, damped, or in one."""

from __future__ import annotations

from dataclasses import dataclass

from thermal_fmu.increments import walk_to_steady
from thermal_fmu.methods import DAMPED_SUBSTEPS, Method
from thermal_fmu.pace import Pace
from thermal_fmu.solver import Anchor
from thermal_fmu.step import Course, Floats, Stepped, damped_step, take_step
from thermal_fmu.stepping import Stepping
from thermal_fmu.substeps import Progress, walk


@dataclass(frozen=True)
class Begin:
    """Where a substep begins: s : (n,) [K], anchor of its first solve, (inner) steps still to be damped, pace."""

    s: Floats
    anchor: Anchor | None
    damped: int
    pace: Pace


@dataclass(frozen=True)
class Advanced:
    """The substep as one step, what is left to be damped, the pace; inner steps that passed, and that did not."""

    done: Stepped
    damped: int
    pace: Pace
    substeps: int = 1
    rejected: int = 0


def advance(course: Course, stepping: Stepping, method: Method, begin: Begin, t: float, h: float) -> Advanced:
    """From t to t + h [s].

    Raises NotConvergedError, SingularMatrixError, BadPropertyError; LeastStepError with adaptive inner steps.
    """
    left = max(begin.damped - 1, 0)
    if not method.stores:
        done = walk_to_steady(course, stepping.increments, begin.s, begin.anchor, t, h)
        return Advanced(done, left, begin.pace)
    if stepping.adaptive is not None:
        start = Progress(begin.s, begin.anchor, begin.pace, begin.damped)
        end = walk(course, method, stepping.adaptive, start, t, h)
        assert end.done is not None
        return Advanced(end.done, end.damped, end.pace, end.substeps, end.rejected)
    # fault: jumps of own signals not seen -> damped = begin.damped | thermal_fmu/test_thermal_time
    damped = DAMPED_SUBSTEPS if course.calendar.jump_within(t, h) else begin.damped
    done = (damped_step if damped > 0 else take_step)(course, method, begin.s, begin.anchor, t, h)
    return Advanced(done, max(damped - 1, 0), begin.pace)
