"""One step of a method: its stages in order, the heat they moved, its local error; damped starts and entropy jumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import resolve
from thermal_fmu import phase_change
from thermal_fmu.boundary import TERMS, Heat, inflow_outflow, through_prescribed
from thermal_fmu.cells import BadPropertyError, spread_energies
from thermal_fmu.elsewhere import Damped, TemperatureCourse, solved_at
from thermal_fmu.known import DataRange, KnownRange, data_range, range_of
from thermal_fmu.limiter import end_of, went_beyond
from thermal_fmu.linear import AnchorMatrix, Factors
from thermal_fmu.methods import METHODS, Stage, TimeMethod
from thermal_fmu.monotone import StepEnd, Try, eased, monotone, needed, to_the_bound
from thermal_fmu.newton import SolvedStage, StageProblem, balance, solve_stage
from thermal_fmu.program_stage import solve_by_program
from thermal_fmu.scene import SubstepData, ThermalScene, prescribed_values
from thermal_fmu.sources import Calendar, LoadFactors, ThermalLoads, loads_at

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ThermalStep:
    """A step that was solved.

    s : (n,) [K] at the end.  heat : of the step.  iterations : linear solves.  residual : worst relative residual [1].
    overshoots : whether a node went beyond what pulls it (limiter.py).  anchor : of the next solve.
    moved : (n,) [J] that flowed into the nodes, fixed nodes' reactions included: their
    increase of enthalpy.  inside : (n,) [J] the part of it that did not come through the surface.  substep : the data
    it was taken with, wrong signs taken off.  known : the data of bodies after it.  path : times [s] in order at which
    something was solved, and s : (n,) [K] then.  damped : whether it was taken by the method that damps.  runs : of a
    program that solves for the inside of bodies.
    """

    s: Floats
    heat: Heat
    iterations: int
    residual: float
    anchor: AnchorMatrix | None
    moved: Floats
    inside: Floats
    substep: SubstepData
    known: KnownRange
    overshoots: bool = False
    path: tuple[tuple[float, Floats], ...] = ()
    damped: bool = False
    runs: int = 0

    def then(self, more: ThermalStep) -> ThermalStep:
        """Join this step and the one after it."""
        return replace(more, heat=self.heat + more.heat, iterations=self.iterations + more.iterations,
                       residual=max(self.residual, more.residual), moved=self.moved + more.moved,
                       inside=self.inside + more.inside, path=self.path + more.path,
                       runs=self.runs + more.runs)


@dataclass(frozen=True)
class StepContext:
    """What every step of a substep needs beside time and state.

    power_M : (n,) [W], E_M spread evenly over the substep.  known : the data of bodies before the step; None: what they
    are at its start.  rate : (n,) at which s moved in the step before [K/s]; None: nothing is known of it.
    elsewhere : temperatures of bodies that another half solves for; None: there are none.
    """

    scene: ThermalScene
    substep: SubstepData
    load_factors: LoadFactors
    calendar: Calendar
    power_M: Floats
    factors: Factors
    known: KnownRange | None = None
    rate: Floats | None = None
    elsewhere: TemperatureCourse | None = None

    @property
    def how_damped(self) -> Damped:
        """How it is to be taken, of a method that leaves some of the stiff part."""
        return Damped.AS_IT_IS if self.elsewhere is None else self.elsewhere.damped

    def loads_at(self, t: float, side: int) -> ThermalLoads:
        """Evaluate the boundary data at t [s], before a jump then (side = -1) or after it."""
        return loads_at(self.scene.model, self.load_factors, t, side, self.elsewhere)


MOST_RETAKEN = 8  # times a step is taken again without wrong signs,
MOST_EASED = 6  # with as much of it as takes nodes back to their data,
MOST_NEARER = 8  # and with less of it where that took them farther


@dataclass(frozen=True)
class Attempt:
    """A step as it was tried.

    substep : the data it was taken with.  stages : solved, in order.  rings : whether nodes left their data because
    wrong signs were taken off: another operator is a jump, which needs a method that damps.  known : data after it.
    """

    substep: SubstepData
    stages: tuple[SolvedStage, ...]
    iterations: int
    known: KnownRange
    rings: bool = False

    @property
    def last(self) -> SolvedStage:
        """The stage at the end of the step."""
        return self.stages[-1]


def take_step(context: StepContext, method: TimeMethod, s_n: Floats, anchor: AnchorMatrix | None, t: float,
              dt: float) -> ThermalStep:
    """Take one step from s_n : (n,) [K], T where nothing melts, at t to t + dt [s].

    Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    scene, stage = context.scene, method.stages[-1]
    done = _within_data(context, method, s_n, anchor, t, dt)
    moved, inside = np.zeros(s_n.size), np.zeros(s_n.size)
    for weight, one in zip(method.weights, done.stages, strict=True):
        moved += weight * dt * one.balance.flow
        inside += weight * dt * one.balance.inside
    over = method.damped is not None and (done.rings or went_beyond(
        end_of(scene, done.substep, stage, s_n, done.last, dt, context.rate), stage.theta))
    return ThermalStep(done.last.s, _heat(scene, method, done.stages, dt), done.iterations,
                       max(one.residual for one in done.stages), done.last.anchor, moved, inside, done.substep,
                       done.known, over, solved_at(method, [one.s for one in done.stages], t, dt),
                       runs=sum(one.runs for one in done.stages))


def _within_data(context: StepContext, method: TimeMethod, s_n: Floats, anchor: AnchorMatrix | None, t: float,
                 dt: float) -> Attempt:
    """Take a step, and take it again without wrong signs where nodes left their data by them (monotone.py)."""
    scene, melting, stage = context.scene, context.scene.melting, method.stages[-1]
    of_stages = tuple(_stage_loads(context, one, t, dt) for one in method.stages)
    stages, loads = _stages(context, method, of_stages, s_n, anchor, t, dt), of_stages[-1]
    factors = [loads.pairs[group.pair].of(group.closed) for group in context.substep.conduction_groups]
    T_first = T = phase_change.temperature(melting, stages[-1].s)
    known = KnownRange.nothing(len(scene.interface.bodies))
    if method.stores:
        known = context.known or range_of(scene, phase_change.temperature(melting, s_n))
    data = data_range(scene, context.substep, known, _around(scene, context.substep, loads, T))
    data = data.heated(T, stages[-1].balance.given)

    def attempt(substep: SubstepData, stages: tuple[SolvedStage, ...]) -> Attempt:
        end = stages[-1]
        T = phase_change.temperature(melting, end.s)
        after = data.after(T, end.balance.given if method.stores else np.ones(T.size))
        return Attempt(substep, stages, sum(one.iterations for one in stages), after)

    def again(substep: SubstepData) -> Attempt:
        return attempt(substep, _stages(replace(context, substep=substep), method, of_stages, s_n,
                                         done.last.anchor, t, dt))

    first = done = attempt(context.substep, stages)
    if scene.program is not None:
        return first  # the operator is the program's: no wrong sign can be taken off
    left_first, spent = data.left_by(T), first.iterations

    for _ in range(MOST_RETAKEN):
        left = data.left_by(T)
        if not left.any():
            break
        end = end_of(scene, done.substep, stage, s_n, done.last, dt)
        substep = monotone(scene, done.substep, factors, StepEnd(
            phase_change.fields(scene.melting, done.last.s), left, end.into / (stage.a * dt), done.last.balance.given,
            end.diagonal / (stage.a * dt), method.stores * end.M / (stage.a * dt)))
        if substep is None:
            break
        done = again(substep)
        T, spent = phase_change.temperature(melting, done.last.s), spent + done.iterations
        # fault: steps that ring without wrong signs stay -> if False: | thermal_fmu/test_thermal_exchange
        if method.damped is not None and ((data.left_by(T) != 0) & (left_first == 0)).any():
            return replace(first, iterations=spent, rings=True)
    if done is first:
        return first
    before = last = Try(np.zeros(T.size), T_first)
    for _ in range(MOST_EASED):
        much = needed(data, last, before, T)
        less = again(eased(done.substep, much))
        before, last = last, Try(much, phase_change.temperature(melting, less.last.s))
        spent += less.iterations
        if not _leaves(data, last.T, T):
            break
    else:
        return replace(done, iterations=spent)
    best = less
    # Without storage no heat is gained by steps.
    # fault: nodes are taken farther back than to where their data end -> nearer = None |
    #   thermal_fmu/test_thermal_stiff
    nearer = to_the_bound(data, last, Try(np.zeros(T.size), T_first)) if method.stores else None
    for _ in range(MOST_NEARER):
        if nearer is None:
            break
        less = again(eased(done.substep, nearer))
        spent += less.iterations
        tried = Try(nearer, phase_change.temperature(melting, less.last.s))
        if _leaves(data, tried.T, T):
            nearer = 0.5 * (last.much + nearer)
            continue
        nearer = to_the_bound(data, tried, last)
        best, last = less, tried
    return replace(best, iterations=spent)


def _leaves(data: DataRange, T: Floats, full_T: Floats) -> bool:
    """Return whether a node leaves its data at T : (n,) [K] that stays within them at full_T : (n,) [K]."""
    return bool(((data.left_by(T) != 0) & (data.left_by(full_T) == 0)).any())


def _stage_loads(context: StepContext, stage: Stage, t: float, dt: float) -> ThermalLoads:
    # The end of a step is before a jump that happens then.
    at = context.calendar.snap(t + stage.c * dt, dt)
    # fault: jump seen too early -> return context.loads_at(at, 1) |
    #   thermal_fmu/test_thermal_time
    return context.loads_at(at, -1 if stage.c == 1.0 else 1)


def _stages(context: StepContext, method: TimeMethod, of_stages: Sequence[ThermalLoads], s_n: Floats,
            anchor: AnchorMatrix | None, t: float, dt: float) -> tuple[SolvedStage, ...]:
    model = context.scene.model
    solved: list[SolvedStage] = []
    for stage, loads in zip(method.stages, of_stages, strict=True):
        end = context.calendar.snap(t + dt, dt)
        held_T = loads if stage.c == 1.0 or stage.theta == 1.0 else context.loads_at(end, -1)
        earlier = np.zeros(s_n.size)
        for weight, done in zip(stage.earlier, solved, strict=True):
            earlier += weight * dt * done.balance.flow
        problem = StageProblem(context.scene, context.substep, loads, stage, dt, s_n, context.power_M, earlier,
                               method.stores)
        guess = with_prescribed(context, held_T, solved[-1].s if solved else s_n)
        program = context.scene.program
        solved.append(solve_stage(problem, guess, model.stated.tolerance, context.factors, anchor) if program is None
                      else solve_by_program(problem, guess, program, context.factors, anchor))
        anchor = solved[-1].anchor
    return tuple(solved)


def _around(scene: ThermalScene, substep: SubstepData, loads: ThermalLoads, T: Floats) -> KnownRange:
    """Return for each body, and for nodes of none, the range of what it is held at, T : (n,) [K], and of what films and
    rays lead to.
    """
    around, body = KnownRange.nothing(len(scene.interface.bodies) + 1), scene.interface.node_body
    # fault: prescribed temperatures are no data -> around.add(body[scene.fixed][:0], T[:0]) |
    #   thermal_fmu/test_thermal_monotone
    around.add(body[scene.fixed], T[scene.fixed])
    films = [(film.points, resolve(now.Te, film.Te)) for now, film in zip(loads.films, substep.films, strict=True)]
    rays = [(one.points, resolve(now.T_inf, one.T_inf))
            for now, one in zip(loads.radiators, substep.radiators, strict=True)]
    # fault: surroundings are no data -> for points, T_e in (): | thermal_fmu/test_thermal_monotone
    for points, T_e in (*films, *rays):
        around.add(body[points.node], T_e)
    return around


def limited_step(context: StepContext, method: TimeMethod, s: Floats, anchor: AnchorMatrix | None, t: float,
                 h: float) -> ThermalStep:
    """Take a step from s : (n,) [K], and take it again, damped, where a node went beyond what pulls it.

    A step that meets a bad property, as kelvin below 0, may have overshot too.  Raises as take_step.
    """
    if method.damped is None:
        return take_step(context, method, s, anchor, t, h)
    if context.how_damped is Damped.ALWAYS:
        return damped_step(context, method, s, anchor, t, h)
    try:
        done = take_step(context, method, s, anchor, t, h)
    except BadPropertyError:
        return damped_step(context, method, s, anchor, t, h)
    if not done.overshoots or context.how_damped is Damped.AFTER_A_JUMP:
        return done
    again = damped_step(context, method, s, done.anchor, t, h)
    return replace(again, iterations=done.iterations + again.iterations, runs=done.runs + again.runs)


def damped_step(context: StepContext, method: TimeMethod, s: Floats, anchor: AnchorMatrix | None, t: float,
                h: float) -> ThermalStep:
    """Take a step from s : (n,) [K] after a jump, cut into steps of the damping method where the method needs it.

    Raises as take_step.
    """
    if method.damped is None:
        return take_step(context, method, s, anchor, t, h)
    damping, parts = METHODS[method.damped.method], method.damped.parts
    done = take_step(context, damping, s, anchor, t, h / parts)
    for part in range(1, parts):
        end = t + h if part == parts - 1 else t + (part + 1) * h / parts
        start = end - h / parts
        # fault: a quarter step knows of the data at the start of all alone -> context = replace(context) |
        #   thermal_fmu/test_thermal_monotone
        context = replace(context, known=done.known)
        done = done.then(take_step(context, damping, done.s, done.anchor, start, h / parts))
    return replace(done, damped=True)


def with_prescribed(context: StepContext, loads: ThermalLoads, s: Floats) -> Floats:
    """Put the prescribed temperatures of `loads` into s : (n,) [K]."""
    melting = context.scene.melting
    T = prescribed_values(context.substep, loads.prescribed, phase_change.temperature(melting, s))
    return phase_change.prescribe(melting, s, T, context.scene.fixed)


@dataclass(frozen=True)
class NodalFlow:
    """s : (n,) [K] with the prescribed values of its time put in.  f : (n,) heat that flows into each node [W]."""

    s: Floats
    f: Floats


def flow_at(context: StepContext, s: Floats, t: float, dt: float, side: int) -> NodalFlow:
    """Evaluate the heat flow into the nodes at s : (n,) [K] and t [s].

    dt : of the step [s], within which a time is taken for a breakpoint.  side : before a jump at t (-1) or after it
    (1).
    Raises BadPropertyError.
    """
    loads = context.loads_at(context.calendar.snap(t, dt), side)
    s = with_prescribed(context, loads, s)
    steady = METHODS["steady"].stages[0]
    problem = StageProblem(context.scene, context.substep, loads, steady, 1.0, s, context.power_M, np.zeros(s.size),
                           False)
    return NodalFlow(s, -balance(problem, s, jacobian=False).R)


def _heat(scene: ThermalScene, method: TimeMethod, solved: Sequence[SolvedStage], dt: float) -> Heat:
    """Sum the energies of a step with the weights of its stages; a stage's reaction is its residual at fixed nodes."""
    terms = sum((w * dt * s.balance.terms for w, s in zip(method.weights, solved, strict=True)), np.zeros(1))
    through = np.zeros(np.count_nonzero(scene.fixed))
    own = scene.model.solved[scene.fixed]
    for w, s, stage in zip(method.weights, solved, method.stages, strict=True):
        # fault: reaction of the last stage only -> through += (stage.c == 1.0) * s.balance.R[scene.fixed] |
        #   thermal_fmu/test_thermal_nonlinear
        through += w / stage.a * s.balance.R[scene.fixed]
    each = sum((w * dt * s.balance.each for w, s in zip(method.weights, solved, strict=True)), np.zeros(1))
    return Heat(scene.counted(solved[-1].balance.stored), inflow_outflow(through[own]), np.asarray(terms),
                np.concatenate([through_prescribed(through, scene.owners, len(scene.model.prescribed)), each]),
                solved[-1].balance.moved)


# Local error

def local_error(context: StepContext, start: NodalFlow, done: ThermalStep, t: float,
                h: float) -> tuple[float, NodalFlow]:
    """Estimate the largest error at a free node [K] of the step `done` from t to t + h [s].

    start : the flow where the step began; that of its end is returned too.  What it moved is compared with Simpson's
    rule
    along the cubic through both ends,

        d = h/6 (f_0 + 4 f(s_m) + f_1) - (E_1 - E_0),   s_m = (s_0 + s_1)/2 + h/8 (ds_0/dt - ds_1/dt),

    which is right to h^4 for any one-step method of order two or less; differences of temperatures alone contain only
    one
    of the several products of derivatives an error is made of.  Rates and error come from dR/ds of the step, whose
    factors are at hand: A^-1 f and A^-1 d, so that the stiff modes the step did not resolve do not drown the rest.
    Raises BadPropertyError, SingularMatrixError.
    """
    # fault: local error of a step as if it had wrong signs -> if False: | thermal_fmu/test_thermal_monotone
    if done.substep is not context.substep:  # wrong signs taken off, in the step alone
        own = replace(context, substep=done.substep)
        of_step, _ = local_error(own, flow_at(own, start.s, t, h, 1), done, t, h)
        return of_step, flow_at(context, done.s, t + h, h, -1)
    free = ~context.scene.fixed
    s_0, f_0 = start.s, start.f
    end = flow_at(context, done.s, t + h, h, -1)
    s_1, f_1 = end.s, end.f
    if done.anchor is None:
        return 0.0, end  # nothing was solved: nothing flows
    factors = context.factors.of(done.anchor)
    bend = factors(np.where(free, f_0 - f_1, 0.0))
    # fault: middle of a chord for the middle of the path -> middle = 0.5 * (s_0 + s_1) + 0.0 * bend |
    #   thermal_fmu/test_thermal_adaptive
    middle = 0.5 * (s_0 + s_1) + np.where(free, 0.125 * h * bend, 0.0)
    f_m = flow_at(context, middle, t + 0.5 * h, h, 1).f
    # fault: local error by the trapezoidal rule -> missing = h / 2.0 * (f_0 + f_1) - done.moved |
    #   thermal_fmu/test_thermal_adaptive
    missing = h / 6.0 * (f_0 + 4.0 * f_m + f_1) - done.moved
    error = factors(np.where(free, missing, 0.0))
    return float(np.abs(error[free]).max(initial=0.0)), end


# Entropy part of the adiabatic split

def entropy_jump(context: StepContext, E_S: Floats, s_n: Floats, anchor: AnchorMatrix | None, factors: Factors,
                 t: float) -> ThermalStep:
    """Find s with E(s) - E(s_n) = E_S spread over the nodes: the entropy part of the adiabatic split.

    E_S : (n_cells,) [J].  s_n : (n,) [K].  factors, anchor : the jump's own, for its matrix is that of storage alone.
    Prescribed nodes stay, and the heat they hold back counts.
    Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    scene = context.scene
    given = spread_energies(scene.volume, context.substep.shapes, E_S)
    loads = context.loads_at(context.calendar.snap(t, 0.0), 1)
    problem = StageProblem(scene, context.substep, loads, Stage(0.0, 1.0, 1.0), 0.0, s_n, context.power_M, given, True)
    solved = solve_stage(problem, s_n, scene.model.stated.tolerance, factors, anchor)
    terms = np.zeros(len(TERMS))
    terms[TERMS.index("entropy")] = E_S.sum()
    held_back = np.where(scene.fixed, solved.balance.R, 0.0)
    own = np.where(scene.model.solved, held_back, 0.0)
    of_prescribed = through_prescribed(held_back[scene.fixed], scene.owners, len(scene.model.prescribed))
    each = np.concatenate([of_prescribed, 0.0 * solved.balance.each])
    # fault: entropy part at fixed nodes lost -> heat = Heat(solved.balance.stored, inflow_outflow(0.0 * held_back),
    #   terms, each) | thermal_fmu/test_thermal_entropy
    heat = Heat(scene.counted(solved.balance.stored), inflow_outflow(own), terms, each, solved.balance.moved)
    return ThermalStep(solved.s, heat, solved.iterations, solved.residual, solved.anchor, given + held_back, given,
                       context.substep, range_of(scene, phase_change.temperature(scene.melting, solved.s)))
