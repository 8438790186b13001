"""One communication substep: in one step, by adaptive inner steps, or by load increments to the steady state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from contact.half.linalg import SingularMatrixError
from contact.problem.thermal import InnerSteps, ThermalProblem
from thermal_fmu import phase_change
from thermal_fmu.cells import BadPropertyError, MatrixEntries
from thermal_fmu.limiter import MOST
from thermal_fmu.linear import AnchorMatrix
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHODS, TimeMethod
from thermal_fmu.newton import NotConvergedError, SolvedStage, StageProblem, balance, solve_stage
from thermal_fmu.sources import SNAP_STEP, SNAP_TIME, Calendar
from thermal_fmu.step import (
    Floats,
    NodalFlow,
    StepContext,
    ThermalStep,
    damped_step,
    flow_at,
    limited_step,
    local_error,
    take_step,
    with_prescribed,
)

# Length of the next inner step: a PI controller

SAFETY = 0.9  # of the length that would just meet the bound
# Exponents (times 1/(order + 1)) of the error of this step and of the last one.  A purely integral controller
# oscillates where the bound changes from step to step.
OF_ERROR, OF_LAST_ERROR = 0.7, 0.4
MOST_GROWTH, MOST_CUT = 4.0, 0.1  # of a length from one step to the next
FAILED_CUT = 0.5  # of a step that was not solved
SMALLEST = 1e-6  # of a bound: a smaller measure is raised to it before it divides
SHORTENED = 1.0 - 1e-9  # of a length: a remainder beyond it is round-off, not a step


@dataclass(frozen=True)
class StepController:
    """What adaptive inner steps remember.  h : length to try next [s], 0: none yet.

    error : of the last inner step, as a part of the tolerance; 1 where its method or its data were others.
    """

    h: float = 0.0
    error: float = 1.0


NO_STEPS_YET = StepController()


@dataclass(frozen=True)
class StepMeasure:
    """How far a solved step is from its bounds.

    error, change : estimated local error and largest change of T, as parts of what is allowed [1].
    order : the error falls like h^(order + 1).
    """

    error: float
    change: float
    order: int

    @property
    def passes(self) -> bool:
        """Whether it is within both bounds; NaN is not."""
        # fault: max_dT not kept to -> return self.error <= 1.0 | thermal_fmu/test_thermal_adaptive
        return self.error <= 1.0 and self.change <= 1.0


def step_length(h: float, remaining: float) -> float:
    """Return the step to try [s] where h is wished (0: no wish) and `remaining` remain [s], without a tiny last step.
    """
    if h == 0.0 or h >= SHORTENED * remaining:
        return remaining
    # fault: a sliver for the last inner step -> return h | thermal_fmu/test_thermal_adaptive
    return 0.5 * remaining if 2.0 * h > remaining else h


def shorter_step(h: float, measure: StepMeasure | None) -> float:
    """Return the next try [s] after a step h [s] that did not pass; measure : None where it was not solved."""
    if measure is None:
        return FAILED_CUT * h
    by_error = SAFETY * max(measure.error, SMALLEST) ** (-1.0 / (measure.order + 1))
    return h * max(MOST_CUT, min(SAFETY, by_error, SAFETY / max(measure.change, SMALLEST)))


def after_step(controller: StepController, h: float, measure: StepMeasure, retried: bool) -> StepController:
    """Return the controller after a step h [s] that passed; retried : a longer one did not."""
    power = measure.order + 1
    error = max(measure.error, SMALLEST)
    growth = SAFETY * error ** (-OF_ERROR / power) * controller.error ** (OF_LAST_ERROR / power)
    growth = min(growth, SAFETY / max(measure.change, SMALLEST), 1.0 if retried else MOST_GROWTH)
    if not retried and h < SHORTENED * controller.h:
        return StepController(max(controller.h, growth * h), controller.error)  # cut short by a breakpoint
    return StepController(growth * h, error)


# Inner steps of a substep

LEAST_SHARE = 1e-9  # of the substep: the shortest inner step where none is given, and
# of the time in which the quickest node follows its neighbours (h^2/a of its cells, or so).  In 1e-6 of it a node has
# moved by 1e-6 of what pulls it, and what no step resolves by then is no matter of steps.
LEAST_OF_CELL = 1e-6


class LeastStepError(ArithmeticError):
    """The shortest inner step allowed is still too long.  least : its length [s]."""

    def __init__(self, message: str, least: float) -> None:
        super().__init__(message)
        self.least = least


@dataclass(frozen=True)
class SubstepProgress:
    """A substep part of the way.

    s : (n,) [K].  damped : inner steps still to be damped.  done : all steps so far as one.  rate : (n,) of the last
    one [K/s].
    substeps, rejected : inner steps that passed, and that did not.
    """

    s: Floats
    anchor: AnchorMatrix | None
    controller: StepController
    damped: int
    done: ThermalStep | None = None
    rate: Floats | None = None
    substeps: int = 0
    rejected: int = 0


@dataclass(frozen=True)
class SubstepPlan:
    """What every inner step of a substep needs.

    s : (n,) [K] at its start.  h : its length [s].
    """

    context: StepContext
    method: TimeMethod
    adaptive: InnerSteps
    s: Floats
    h: float

    @cached_property
    def least(self) -> float:
        """The shortest inner step allowed [s]."""
        if self.adaptive.least is not None:
            return min(self.adaptive.least, self.h)
        # fault: inner steps without a bound from the cells -> return LEAST_SHARE * self.h |
        #   thermal_fmu/test_thermal_adaptive
        return min(max(LEAST_SHARE * self.h, LEAST_OF_CELL * self.quickest[0]), self.h)

    @cached_property
    def quickest(self) -> tuple[float, int]:
        """The time in which the quickest node follows its neighbours [s], and the node."""
        scene, substep = self.context.scene, self.context.substep
        pattern = scene.volume.pattern
        entries, at = np.zeros(pattern.indices.size), phase_change.fields(scene.melting, self.s)
        scene.bulk.conduct(substep, at, np.zeros(self.s.size), MatrixEntries(entries, 1.0))
        rows = np.repeat(np.arange(self.s.size), np.diff(pattern.indptr))
        K = np.bincount(rows, np.where(rows == pattern.indices, entries, 0.0), self.s.size)
        M = scene.bulk.capacities(substep, self.s)
        time = np.divide(M, K, out=np.full(self.s.size, np.inf), where=K > 0.0)
        node = int(np.argmin(time))
        return float(time[node]), node


@dataclass(frozen=True)
class StepPoint:
    """A time t [s] between two inner steps, and the flow after a jump there; None where no error is estimated."""

    t: float
    flow: NodalFlow | None = None


@dataclass(frozen=True)
class SolvedStep:
    """An inner step that was solved, its measure, and the point it led to."""

    done: ThermalStep
    measure: StepMeasure
    there: StepPoint


def inner_steps(context: StepContext, method: TimeMethod, adaptive: InnerSteps, progress: SubstepProgress, t: float,
                h: float) -> SubstepProgress:
    """Take adaptive inner steps through [t, t + h] [s].

    They end at every breakpoint of the half's own signals; after a jump one is damped.  Raises LeastStepError.
    """
    plan = SubstepPlan(context, method, adaptive, progress.s, h)
    begin = t
    for end in ends_within(context.calendar, t, h):
        if context.calendar.jump_within(begin, end - begin):
            progress = replace(progress, damped=DAMPED_SUBSTEPS)
        point = _point(plan, progress.s, begin, end - begin)
        while point.t < end:
            progress, point = _inner_step(plan, progress, point, end)
        begin = end
    return progress


def ends_within(calendar: Calendar, t: float, h: float) -> tuple[float, ...]:
    """Return the breakpoints inside [t, t + h] [s] and its end; those closer together than a clock resolves are one."""
    near = SNAP_STEP * h + SNAP_TIME * abs(t)
    ends: list[float] = []
    for time in calendar.breakpoints:
        # fault: inner steps across kinks -> if (ends[-1] if ends else t) + near < time < t - h: |
        #   thermal_fmu/test_thermal_adaptive
        if (ends[-1] if ends else t) + near < time < t + h - near:
            ends.append(float(time))
    return (*ends, t + h)


def _point(plan: SubstepPlan, s: Floats, t: float, h: float) -> StepPoint:
    return StepPoint(t) if plan.adaptive.tolerance is None else StepPoint(t, flow_at(plan.context, s, t, h, 1))


def _inner_step(plan: SubstepPlan, progress: SubstepProgress, point: StepPoint, end: float) -> tuple[SubstepProgress,
                                                                                                     StepPoint]:
    """Take one step that passes; return the progress and the point it led to."""
    remaining = end - point.t
    size, rejected, anchor = step_length(progress.controller.h, remaining), 0, progress.anchor
    while True:
        attempt = _attempt(plan, progress, anchor, point, end if size == remaining else point.t + size)
        if isinstance(attempt, SolvedStep) and attempt.measure.passes:
            controller = after_step(progress.controller, size, attempt.measure, rejected > 0)
            return _advanced(progress, attempt.done, size, controller, rejected), attempt.there
        if size <= plan.least:
            raise LeastStepError(f"an inner step of {size:.3g} s at {point.t:.9g} s {_why(attempt)}; "
                                 f"{_cure(plan)}", plan.least)
        measure, anchor = (attempt.measure, attempt.done.anchor) if isinstance(attempt, SolvedStep) else (None, anchor)
        size, rejected = step_length(max(plan.least, shorter_step(size, measure)), remaining), rejected + 1


def _attempt(plan: SubstepPlan, progress: SubstepProgress, anchor: AnchorMatrix | None, point: StepPoint,
             stop: float) -> SolvedStep | str:
    """Solve the step from `point` to stop [s] and measure it; return why it failed where it did."""
    method, context, h = plan.method, plan.context, stop - point.t
    # fault: an inner step knows of the data at the start of all alone -> if False: | thermal_fmu/test_thermal_monotone
    if progress.done is not None:
        context = replace(context, known=progress.done.known, rate=progress.rate)
    # fault: inner steps not damped after a jump -> take = take_step | thermal_fmu/test_thermal_adaptive
    take = damped_step if progress.damped > 0 else limited_step
    try:
        done = take(context, method, progress.s, anchor, point.t, h)
        error, there = _error(plan, point, done, stop, h)
    except (NotConvergedError, BadPropertyError, SingularMatrixError) as exc:
        return str(exc)
    free, melting = ~context.scene.fixed, context.scene.melting
    dT = phase_change.temperature(melting, done.s) - phase_change.temperature(melting, progress.s)
    change, most = float(np.abs(dT[free]).max(initial=0.0)), plan.adaptive.max_dT
    used = METHODS[method.damped.method] if progress.damped > 0 and method.damped is not None else method
    return SolvedStep(done, StepMeasure(error, 0.0 if most is None else change / most, used.order), there)


def _error(plan: SubstepPlan, point: StepPoint, done: ThermalStep, stop: float, h: float) -> tuple[float, StepPoint]:
    if point.flow is None or plan.adaptive.tolerance is None:
        return 0.0, StepPoint(stop)
    error, end = local_error(plan.context, point.flow, done, point.t, h)
    return error / plan.adaptive.tolerance, StepPoint(stop, end)


def _advanced(progress: SubstepProgress, done: ThermalStep, h: float, controller: StepController,
              rejected: int) -> SubstepProgress:
    # After a damped step another method goes on, whose error has nothing to do with this one's.
    controller = replace(controller, error=1.0) if progress.damped > 0 else controller
    total = done if progress.done is None else progress.done.then(done)
    return SubstepProgress(done.s, done.anchor, controller, max(progress.damped - 1, 0), total,
                           (done.s - progress.s) / h, progress.substeps + 1, progress.rejected + rejected)


def _why(attempt: SolvedStep | str) -> str:
    if isinstance(attempt, str):
        return f"was not solved: {attempt}"
    return f"has {attempt.measure.error:.3g} of adaptive.tolerance and {attempt.measure.change:.3g} of adaptive.max_dT"


def _cure(plan: SubstepPlan) -> str:
    if plan.adaptive.least is not None:
        return "adaptive.least allows none shorter"
    time, node = plan.quickest
    interface = plan.context.scene.interface
    body, (x, y) = interface.bodies[interface.node_body[node]], interface.nodes[node]
    return (f"none is shorter than {plan.least:.3g} s, for the quickest node, of {body} at ({x:.6g}, {y:.6g}) "
            f"m, follows its neighbours in {time:.3g} s and shorter steps resolve nothing: data jump there, or the "
            "bounds of adaptive are too tight. Raise adaptive.tolerance or max_dT, let the data rise in a time instead "
            "of at once, or ask for shorter steps by adaptive.least")


# Steady states by load increments

STEADY = METHODS["steady"]
MAX_HALVINGS = 10  # of an increment: 1/1024 of one


def steady_by_increments(context: StepContext, increments: int, s_start: Floats, anchor: AnchorMatrix | None, t: float,
                         dt: float) -> ThermalStep:
    """Go from s_start : (n,) [K] to the steady state under the loads of t + dt [s], prescribed values moving along.

    The path R(T) = (1 - lambda) R(T_start), lambda from 0 to 1, starts where the residual is zero by construction.  An
    increment that fails is halved, and grows again as the next ones succeed.  Raises NotConvergedError,
    SingularMatrixError.
    """
    whole = 2**MAX_HALVINGS
    done, size, last = 0, whole, increments * whole  # lambda = done/last, exactly
    s, iterations = s_start, 0
    path: _Path | None = None
    while True:
        size = min(size, last - done)
        try:
            if done + size == last:
                stepped = take_step(context, STEADY, s, anchor, t, dt)
                return replace(stepped, iterations=iterations + stepped.iterations)
            path = path or _path(context, s_start, t, dt)
            solved = _increment(path, (done + size) / last, s, anchor)
        except (NotConvergedError, BadPropertyError) as exc:
            if size == 1:
                return _all_at_once(context, s_start, anchor, t, dt, f"at {done / last:.3g} of the load no "
                                    f"increment helps: {exc}")
            size //= 2
            continue
        s, anchor, iterations = solved.s, solved.anchor, iterations + solved.iterations
        done, size = done + size, min(2 * size, whole)


def _all_at_once(context: StepContext, s_start: Floats, anchor: AnchorMatrix | None, t: float, dt: float,
                 why: str) -> ThermalStep:
    """Solve the end of the path from its start: where the path turns back, Newton's method may still reach it."""
    try:
        return take_step(context, STEADY, s_start, anchor, t, dt)
    except (NotConvergedError, BadPropertyError) as exc:
        raise NotConvergedError(why) from exc


@dataclass(frozen=True)
class _Path:
    """The path to a steady state.

    problem : of lambda = 1.  f : (n,) [W] at the start.  s_start, s_end : (n,) [K], right at fixed nodes.
    """

    context: StepContext
    problem: StageProblem
    f: Floats
    s_start: Floats
    s_end: Floats


def _path(context: StepContext, s_start: Floats, t: float, dt: float) -> _Path:
    loads = context.loads_at(context.calendar.snap(t + dt, dt), -1)
    problem = StageProblem(context.scene, context.substep, loads, STEADY.stages[0], dt, s_start, context.power_M,
                           np.zeros(s_start.size), False)
    f = -balance(problem, s_start, jacobian=False).R / dt
    return _Path(context, problem, np.where(context.scene.fixed, 0.0, f), s_start,
                 with_prescribed(context, loads, s_start))


def _increment(path: _Path, fraction: float, s: Floats, anchor: AnchorMatrix | None) -> SolvedStage:
    """Solve the point of the path at lambda = fraction, from s : (n,) [K]."""
    context, problem = path.context, path.problem
    fixed = context.scene.fixed
    # fault: prescribed values do not move along -> guess = np.where(fixed, path.s_end, s) |
    #   thermal_fmu/test_thermal_steady
    guess = np.where(fixed, (1.0 - fraction) * path.s_start + fraction * path.s_end, s)
    # fault: increments without a path -> partial = replace(problem, earlier=0.0 * path.f) |
    #   thermal_fmu/test_thermal_steady
    partial = replace(problem, earlier=-(1.0 - fraction) * problem.dt * path.f)
    return solve_stage(partial, guess, context.scene.model.stated.tolerance, context.factors, anchor)


# One communication substep

@dataclass(frozen=True)
class SubstepStart:
    """Where a substep begins: s : (n,) [K], anchor of its first solve, (inner) steps still to be damped, controller."""

    s: Floats
    anchor: AnchorMatrix | None
    damped: int
    controller: StepController


@dataclass(frozen=True)
class SubstepResult:
    """The substep as one step, steps still to be damped, the controller, (n,) the rate of the last (inner) step [K/s];
    inner steps that passed, and that did not.
    """

    done: ThermalStep
    damped: int
    controller: StepController
    rate: Floats | None
    substeps: int = 1
    rejected: int = 0


def held_value_jumps(context: StepContext, s: Floats, t: float, h: float) -> bool:
    """Return whether a factor moved a prescribed temperature at t [s], the start of a substep h [s], from s : (n,) [K].

    Jumps of signals are in the calendar; a factor is set from outside.  A midpoint step would take it for a slope, and
    all that follows be half a step late.
    """
    model, fixed = context.scene.model, context.scene.fixed
    if not any(b.name for b in model.prescribed):
        return False
    loads = context.loads_at(context.calendar.snap(t, h), 1)
    T, held = (phase_change.temperature(context.scene.melting, v) for v in (s, with_prescribed(context, loads, s)))
    span = max(float(np.ptp(T)), float(np.ptp(held)))
    # fault: loads that a rule sets are slopes -> return False | thermal_fmu/test_thermal_windows
    return bool((np.abs(held - T)[fixed] > MOST * span).any())


def advance(context: StepContext, stated: ThermalProblem, method: TimeMethod, begin: SubstepStart, t: float,
            h: float) -> SubstepResult:
    """Take a substep from t to t + h [s].

    Raises NotConvergedError, SingularMatrixError, BadPropertyError; LeastStepError with adaptive inner steps.
    """
    still_damped = max(begin.damped - 1, 0)
    if not method.stores:
        done = steady_by_increments(context, stated.increments or 1, begin.s, begin.anchor, t, h)
        return SubstepResult(done, still_damped, begin.controller, None)
    if stated.adaptive is not None:
        damped = DAMPED_SUBSTEPS if held_value_jumps(context, begin.s, t, h) else begin.damped
        start = SubstepProgress(begin.s, begin.anchor, begin.controller, damped)
        end = inner_steps(context, method, stated.adaptive, start, t, h)
        assert end.done is not None
        return SubstepResult(end.done, end.damped, end.controller, end.rate, end.substeps, end.rejected)
    # fault: jumps of own signals not seen -> jumps = held_value_jumps(context, begin.s, t, h) |
    #   thermal_fmu/test_thermal_time
    jumps = context.calendar.jump_within(t, h) or held_value_jumps(context, begin.s, t, h)
    damped = DAMPED_SUBSTEPS if jumps else begin.damped
    done = (damped_step if damped > 0 else limited_step)(context, method, begin.s, begin.anchor, t, h)
    return SubstepResult(done, max(damped - 1, 0), begin.controller, (done.s - begin.s) / h)
