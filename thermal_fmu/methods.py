"""Time integration methods as tables of stages.

A stage solves (E(T_s) - E_n)/(a dt) - sum_j (a_j/a) F_j = f(T_n + theta (T_s - T_n), t_n + c dt) for T_s, where E is
the nodal enthalpy [J], f the heat flow into the nodes [W] and F_j the flows of earlier stages.  Storage enters as a
difference of enthalpies, so no method loses heat, whatever c(T).  The last stage is the end of the substep.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from contact.problem import thermal


@dataclass(frozen=True)
class Stage:
    """One stage of a method.

    c : its time, as a part of dt.  a : its own weight.  theta : where between T_n and T_s f is taken.
    earlier : weights of the flows of earlier stages.
    """

    c: float
    a: float
    theta: float
    earlier: tuple[float, ...] = ()


@dataclass(frozen=True)
class DampedStart:
    """How a method starts anew after a jump: a substep is cut into `parts` equal steps of `method`."""

    method: str
    parts: int


@dataclass(frozen=True)
class TimeMethod:
    """A time integration method: stages in order; weights : part of dt of each stage's flow in the substep's heat.

    stores : False for the steady method, which has no storage.  damped : the damped start after a jump; None: none
    needed.
    order : the local error falls like dt^(order + 1).
    """

    stages: tuple[Stage, ...]
    weights: tuple[float, ...]
    stores: bool = True
    damped: DampedStart | None = None
    order: int = 2


# The substep after a jump, of every method that leaves some of the stiff part.
QUARTER_STEPS = DampedStart("backward_euler", 4)

# fault: wrong gamma -> _GAMMA = 0.5 | thermal_fmu/test_thermal_time
_GAMMA = 1.0 - 1.0 / sqrt(2.0)


def theta_method(theta: float) -> TimeMethod:
    """Return the theta rule: all but storage at T_n + theta (T_{n+1} - T_n), t_n + theta dt.

    theta : 1/2 (midpoint) to 1 (backward Euler).  Only at theta = 1 the stiff part of a jump is gone after a step; else
    it
    is multiplied by (1 - theta)/theta.
    """
    # fault: theta not damped -> return TimeMethod((Stage(theta, 1.0, theta),), (1.0,), damped=None if theta >= 0.5 else
    #   QUARTER_STEPS, | thermal_fmu/test_thermal_order
    # fault: theta at the wrong time -> return TimeMethod((Stage(1.0, 1.0, theta),), (1.0,), damped=None if theta == 1.0
    #   else QUARTER_STEPS, | thermal_fmu/test_thermal_order
    return TimeMethod((Stage(theta, 1.0, theta),), (1.0,), damped=None if theta == 1.0 else QUARTER_STEPS,
                      order=2 if theta == 0.5 else 1)


METHODS: dict[str, TimeMethod] = {
    # The true midpoint rule, Eq. (22).  It does not damp the stiff part of a jump, so it starts with backward Euler.
    # fault: midpoint theta -> "midpoint": TimeMethod((Stage(0.5, 1.0, 0.6),), (1.0,), damped=QUARTER_STEPS), |
    #   thermal_fmu/test_thermal_time
    "midpoint": TimeMethod((Stage(0.5, 1.0, 0.5),), (1.0,), damped=QUARTER_STEPS),
    "backward_euler": TimeMethod((Stage(1.0, 1.0, 1.0),), (1.0,), order=1),
    # L-stable, yet not monotone: without a damped start it overshoots once after a jump (10 of 100 K at dt a/h^2 = 8).
    "sdirk2": TimeMethod((Stage(_GAMMA, _GAMMA, 1.0), Stage(1.0, _GAMMA, 1.0, (1.0 - _GAMMA,))),
                     # fault: sdirk2 undamped -> (1.0 - _GAMMA, _GAMMA)), | thermal_fmu/test_thermal_time
                         (1.0 - _GAMMA, _GAMMA), damped=QUARTER_STEPS),
    "steady": TimeMethod((Stage(1.0, 1.0, 1.0),), (1.0,), stores=False),
}

# control.method: 0 is the method of model.json.
METHOD_NUMBERS = {number: method.value for number, method in enumerate(thermal.Method, start=1)}

# After a jump this many substeps of a method that needs it are damped.  Four quarter steps of backward Euler in one
# substep: no rise beside a shock from dt a/h^2 = 1 to 40, second order kept, and half the error of twice two half
# steps.  sdirk2 in the place of backward Euler rings with the midpoint rule (its stiff modes fall like 1/z a step, not
# 1/z^4); in front of sdirk2 itself the damped start costs a quarter more error and takes the overshoot away.
DAMPED_SUBSTEPS = 1

# Parts of a substep at which a method may ask for, or find, temperatures: its start, stages that stand for themselves,
# the ends of damped parts, its end.  Between them nobody looks.
KNOTS: tuple[float, ...] = tuple(sorted(
    {0.0, 1.0} | {stage.c for method in METHODS.values() for stage in method.stages if stage.theta == 1.0}
    | {(k + 1) / QUARTER_STEPS.parts for k in range(QUARTER_STEPS.parts)}))
