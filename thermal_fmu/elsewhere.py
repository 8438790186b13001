"""Bodies that another half of the role solves for: here their temperature is given, and their heat is not counted.

Two halves whose bodies exchange heat tell each other how their temperatures went through a substep, at KNOTS: all that
a method asks for.  So either has, at each of its stages, what the other had there.  A step that rings is taken again,
damped, in all of them: `course.damped` says to each how to take it, `course.damps` how it did, or would have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Value, Values, Variable
from contact.half.start import start_temperatures
from thermal_fmu import phase_change
from thermal_fmu.methods import KNOTS, TimeMethod
from thermal_fmu.phase_change import Melting
from thermal_fmu.problem import Model

Floats = NDArray[np.float64]

COURSE, COURSE_ELSEWHERE = "course.T", "course.T_elsewhere"
DAMPED, DAMPS = "course.damped", "course.damps"


class Damped(IntEnum):
    """How a substep of a method is taken that leaves some of the stiff part.

    AS_IT_IS : damped after a jump, and where a node goes beyond what pulls it.  AFTER_A_JUMP : only there.  ALWAYS.
    """

    AS_IT_IS = 0
    AFTER_A_JUMP = 1
    ALWAYS = 2


class Damps(IntEnum):
    """What became of it.  WOULD : a node went beyond what pulls it, and the step stands."""

    NOT = 0
    WOULD = 1
    DID = 2


@dataclass(frozen=True)
class TemperatureCourse:
    """Temperatures over a substep, on straight lines between KNOTS.

    t, h : its start and length [s].  T : (n_knots, m) [K].  damped : how this half takes the substep.
    """

    t: float
    h: float
    T: Floats
    damped: Damped = Damped.AS_IT_IS

    def at(self, t: float) -> Floats:
        """Return (m,) [K] at t [s]."""
        part = min(max((t - self.t) / self.h, 0.0), 1.0) if self.h > 0.0 else 0.0
        k = min(max(int(np.searchsorted(KNOTS, part)), 1), len(KNOTS) - 1)
        weight = (part - KNOTS[k - 1]) / (KNOTS[k] - KNOTS[k - 1])
        # fault: between two knots what is elsewhere stays as it was at the first -> weight = float(part == 1.0) |
        #   coupler/test_several::test_with_every_method_in_time[sdirk2]
        return np.asarray((1.0 - weight) * self.T[k - 1] + weight * self.T[k])


def course_variables(interface: Interface, model: Model) -> tuple[Variable, ...]:
    """List what this half and those that solve for the bodies elsewhere tell each other; nothing where none are."""
    if not model.elsewhere.size:
        return ()
    parts = ", ".join(f"{part:.4g}" for part in KNOTS)
    T = start_temperatures(interface, [part.T0 for part in model.parts])[model.elsewhere]
    return (Variable(COURSE_ELSEWHERE, (len(KNOTS), model.elsewhere.size), "input", "K", np.tile(T, (len(KNOTS), 1)),
                     description=f"temperature of nodes of bodies elsewhere at {parts} of the substep", on="none"),
            Variable(DAMPED, (), "input", "1", 0.0,
                     description="the substep is damped: 0 where it has to be; 1 only after a jump; 2 always"),
            Variable(DAMPS, description="the substep was damped: 0 no; 1 no, and had to be; 2 yes"),
            Variable(COURSE, (len(KNOTS), len(interface.contact_nodes)), unit="K",
                     description=f"temperature of contact nodes at {parts} of the substep", on="none"))


def course_of(model: Model, inputs: Values, t: float, h: float,
              columns: NDArray[np.integer] | slice = slice(None)) -> TemperatureCourse | None:
    """Return the temperatures of what is elsewhere in a substep from t by h [s]; None where nothing is.

    columns : (m,) of the input, one for each node that is elsewhere.
    """
    if not model.elsewhere.size:
        return None
    return TemperatureCourse(t, h, np.array(inputs[COURSE_ELSEWHERE], dtype=np.float64)[:, columns],
                             Damped(int(float(np.asarray(inputs[DAMPED])))))


def begun_with(course: TemperatureCourse | None, melting: Sequence[Melting], s: Floats,
               at: NDArray[np.integer]) -> Floats:
    """Return s : (n,) [K] with what is elsewhere as it is at the start of the substep, after any jump there.

    at : (m,) the unknowns that are elsewhere.
    """
    if course is None:
        return s
    T, fixed = phase_change.temperature(melting, s).copy(), np.zeros(s.size, dtype=np.bool_)
    T[at], fixed[at] = course.T[0], True
    return phase_change.prescribe(melting, s, T, fixed)


def course_outputs(nodes: NDArray[np.integer], melting: Sequence[Melting], begin: Floats,
                   path: Sequence[tuple[float, Floats]], t: float, h: float,
                   damps: Damps = Damps.NOT) -> dict[str, Value]:
    """Return the outputs course.T and course.damps.

    nodes : (m,) where contact nodes are in s.  begin : (n,) [K] s at the start.  path : s at times [s], in order.
    """
    knots = np.array([0.0, *((at - t) / h for at, _ in path[:-1]), 1.0])
    T = np.array([phase_change.temperature(melting, s)[nodes] for s in (begin, *(s for _, s in path))])
    k = np.clip(np.searchsorted(knots, KNOTS), 1, len(knots) - 1)
    weight = np.clip((np.array(KNOTS) - knots[k - 1]) / (knots[k] - knots[k - 1]), 0.0, 1.0)[:, None]
    # fault: stages are told as if they lay on a straight line -> return {COURSE: (1.0 - np.array(KNOTS))[:, None] *
    #   T[0] + np.array(KNOTS)[:, None] * T[-1], DAMPS: float(damps)} |
    #   coupler/test_several::test_with_every_method_in_time[sdirk2]
    return {COURSE: (1.0 - weight) * T[k - 1] + weight * T[k], DAMPS: float(damps)}


def damps_of(damped: bool, overshoots: bool) -> Damps:
    """Return what became of a step that was damped, or that a node overshot in."""
    return Damps.DID if damped else Damps.WOULD if overshoots else Damps.NOT


def solved_at(method: TimeMethod, solved: Sequence[Floats], t: float, dt: float) -> tuple[tuple[float, Floats], ...]:
    """Return when the stages of a step from t by dt [s] were solved [s], and what for: solved, (n,) [K] of each.

    A theta rule solves for the end of the step.
    """
    return tuple((t + (stage.c if stage.theta == 1.0 else 1.0) * dt, s)
                 for stage, s in zip(method.stages, solved, strict=True))


def counted_of(interface: Interface, model: Model, of_bodies: Floats) -> Floats:
    """Return (n_bodies,) with 0 for bodies that another half solves for."""
    if not model.stated.elsewhere:
        return of_bodies
    # fault: what bodies elsewhere store is counted here too -> return of_bodies |
    #   coupler/test_several::test_numbers_of_the_role_are_those_of_one_half
    return np.where(np.isin(interface.bodies, model.stated.elsewhere or ()), 0.0, of_bodies)
