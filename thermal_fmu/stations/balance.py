"""One substep at the stations: heat balance of a stage as a band matrix, Newton's method, and steps of a method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from thermal_fmu import phase_change
from thermal_fmu.boundary import (
    TERMS,
    BoundaryHeat,
    Heat,
    boundary_flow,
    demand_limits,
    inflow_outflow,
    through_prescribed,
)
from thermal_fmu.cells import BadPropertyError
from thermal_fmu.elsewhere import Damped, TemperatureCourse, solved_at
from thermal_fmu.limiter import NodesAtEnd, went_beyond
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHODS, Stage, TimeMethod
from thermal_fmu.newton import (
    MAX_CLIMBS,
    MAX_ITERATIONS,
    ROUND_OFF,
    NotConvergedError,
    descend,
    phase_continuation,
)
from thermal_fmu.phase_change import Melting, NodalFields, temperature
from thermal_fmu.problem import ThermalBody
from thermal_fmu.scene import SubstepData, prescribed_values
from thermal_fmu.settled import STAGE_TOLERANCE, is_solved, left_over
from thermal_fmu.sources import Calendar, LoadFactors, ThermalLoads, loads_at
from thermal_fmu.stations.scene import StationScene
from thermal_fmu.stations.stations import (
    N,
    StationGeometry,
    add_melting_fields,
    add_rod_conduction,
    add_rod_slopes,
    melting_heat,
    rod_points,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StationSubstep:
    """What is constant through a substep: shape now, first the shape in the reference, and the boundary data."""

    scene: StationScene
    shape: StationGeometry
    first: StationGeometry
    data: SubstepData


@dataclass(frozen=True)
class StationProblem:
    """Find s with  E(s) - E(s_n) = dt (sum_j a_j F_j + a f(T_n + theta (T(s) - T_n))).

    s_n : (n,) start of the step [K], T itself in bodies that do not melt.  power_M : (n,) [W].
    earlier : (n,) dt sum_j a_j F_j [J].  blur : as in thermal_fmu/newton.py.
    """

    substep: StationSubstep
    loads: ThermalLoads
    stage: Stage
    dt: float
    s_n: Floats
    power_M: Floats
    earlier: Floats
    blur: float = 0.0

    @cached_property
    def start(self) -> NodalFields:
        """The fields at s_n."""
        return _fields(self.substep.scene.melting, self.s_n)


@dataclass(frozen=True)
class StationBalance:
    """The heat balance of a stage at the stations.

    R : (n,) residual [J]; at fixed stations the heat that came through them.  flow : (n,) [W] into the stations,
    reactions included.  terms : (n_terms,) [W], as boundary.TERMS, each : as BoundaryHeat has it.
    stored : (n_bodies,) [J].  norm : sum of |R| at free stations, missing : |sum of R| there, scale : of
    the sizes of all heats [J].
    band : (3 width + 1, n) dR/ds [J/K].
    pull : (n,) what the change of prescribed values since s_n does to the residual of their neighbours [J].
    moved : sum over the stations of what each took up or gave off [J].
    """

    R: Floats
    flow: Floats
    terms: Floats
    each: Floats
    stored: Floats
    norm: float
    missing: float
    scale: float
    band: Floats
    pull: Floats
    moved: float

    @property
    def relative_residual(self) -> float:
        """norm as a part of scale [1]."""
        return self.norm / self.scale if self.scale > 0 else 0.0


def station_balance(problem: StationProblem, s: Floats) -> StationBalance:
    """Evaluate residual and derivative (identity in rows and columns of fixed stations) at s : (n,) [K].

    Raises BadPropertyError.
    """
    scene, stage = problem.substep.scene, problem.stage
    weight = stage.a * problem.dt
    at = _fields(scene.melting, s)
    if problem.blur > 0.0:
        at = phase_change.blurred(scene.melting, at, s, problem.blur, scene.fixed)
    if stage.theta != 1.0:
        # fault: stations see the boundary at the end of a stage only -> at = phase_change.between(problem.start, at,
        #   1.0) | thermal_fmu/test_lumped
        at = phase_change.between(problem.start, at, stage.theta)
    band = np.zeros((3 * scene.stations.width + 1, scene.stations.n))
    S, stored = _store(problem, s, band)
    f = _conduct(problem.substep, at, stage.theta * weight, band)
    boundary = boundary_flow(problem.substep.data, problem.loads, problem.power_M, at.T)
    f += boundary.f
    _gather(scene, boundary, stage.theta * weight, at.dT, band)
    pull = scene.stations.times(band, np.where(scene.fixed, s - problem.s_n, 0.0))
    touched, diagonal = scene.fixed_places
    band.reshape(-1)[touched], band.reshape(-1)[diagonal] = 0.0, 1.0
    R = S - problem.earlier - weight * f
    reaction = np.where(scene.fixed, R, 0.0)
    moved, free = float(np.abs(S).sum()), R - reaction
    scale = moved + float(np.abs(reaction).sum()) + weight * boundary.magnitude
    of_own = moved if problem.substep.data.solved is None else float(np.abs(S[problem.substep.data.solved]).sum())
    return StationBalance(R, f + reaction / weight if weight else f, boundary.terms, boundary.each, stored,
                          float(np.abs(free).sum()), abs(float(free.sum())), scale, band, pull, of_own)


def _fields(melting: tuple[Melting, ...], s: Floats) -> NodalFields:
    """Evaluate the fields as phase_change.fields does."""
    if not melting:
        return NodalFields(s)
    T, f_s, dT, df = s.copy(), np.ones(s.size), np.ones(s.size), np.zeros(s.size)
    for body in melting:
        change = body.change
        add_melting_fields(s, body.nodes, change.T_s, change.T_l, change.W, T, f_s, dT, df)
    return NodalFields(T, f_s, dT, df)


def _gather(scene: StationScene, boundary: BoundaryHeat, slope: float, dT: Floats | None, band: Floats) -> None:
    """Add the derivatives of the boundary terms to the band."""
    stations, flat = scene.stations, band.reshape(-1)
    places = [(slots.ravel(), values.ravel()) for slots, values in boundary.places]
    for nodes, values in boundary.across:
        slots = stations.slots(nodes[:, :, None].astype(np.intp), nodes[:, None, :].astype(np.intp))
        places.append((slots.ravel(), values.ravel()))
    for slots, values in places:
        change = slope * values
        np.add.at(flat, slots, change if dT is None else change * dT[slots % stations.n])


def _store(problem: StationProblem, s: Floats, band: Floats) -> tuple[Floats, Floats]:
    """Return (n,) increase of enthalpy since s_n [J], and (n_bodies,) sums of it where it is stored; band += dE/ds."""
    scene, first = problem.substep.scene, problem.substep.first
    S, stored = np.zeros(s.size), np.zeros(len(scene.stations.own))
    middle = 2 * scene.stations.width
    for b, (body, own) in enumerate(zip(scene.model.bodies, scene.stations.own, strict=True)):
        dE, C = _at_stations(body, body.material.rho * first.volume[own], problem.s_n[own], s[own])
        S[own] += dE
        band[middle, own] += C
        stored[b] = dE.sum()
    return S, stored


def _at_stations(body: ThermalBody, mass: Floats, s0: Floats, s1: Floats) -> tuple[Floats, Floats]:
    """Store at the stations, as thermal_fmu/cells.py does at nodes and for its reasons; also their capacity [J/K]."""
    change = body.material.phase
    if change is None:
        c = body.material.c.solid
        return mass * c.increase(s0, s1), mass * _positive("heat capacity", c(s1), body)
    if change.T_s == change.T_l and change.solid.constant is not None and change.liquid.constant is not None:
        C = np.empty(s0.size)
        dh = melting_heat(s0, s1, change.T_s, change.W, change.L, change.solid.constant, change.liquid.constant, C)
        # fault: lumped latent heat lost -> return mass * C * (s1 - s0), mass * C | thermal_fmu/test_lumped
        return mass * dh, mass * C
    return mass * change.increase(s0, s1), mass * _positive("heat capacity", change.capacity(s1), body)


def _conduct(substep: StationSubstep, at: NodalFields, scale: float, band: Floats) -> Floats:
    """Return (n,) heat that flows into the stations from their neighbours [W].

    band : to it scale times the derivative of -f by s is added.
    """
    f = np.zeros(at.T.size)
    dT = np.ones(at.T.size) if at.dT is None else at.dT
    for body, own, piece in zip(substep.scene.model.bodies, substep.scene.stations.own, substep.shape.pieces,
                                strict=False):
        k = body.material.k.k_1
        if k.is_constant:
            kA = float(k.solid(at.T[:1])[0]) * piece.conducts
            add_rod_slopes(own, add_rod_conduction(at.T, own, N, kA, np.zeros(kA.shape), f), dT, scale, band)
            continue
        T = rod_points(at.T, own, N)
        f_s = None if at.f_s is None or k.is_one else rod_points(at.f_s, own, N)
        kA = _positive("conductivity", k(T, f_s), body) * piece.conducts
        slope = add_rod_conduction(at.T, own, N, kA, k.slope(T, f_s) * piece.conducts, f)
        add_rod_slopes(own, slope, dT, scale, band)
        if f_s is not None and at.df is not None:
            drop = at.T[own[:-1]] - at.T[own[1:]]
            add_rod_slopes(own, (k.phase_slope(T) * piece.conducts) @ N * drop[:, None], at.df, scale, band)
    return f


def _positive(what: str, values: Floats, body: ThermalBody) -> Floats:
    if not (values > 0).all():
        raise BadPropertyError(f"the {what} of body {body.name} is {np.nanmin(values):.6g} at a temperature that was "
                               "met")
    return values


# Newton's method, with the phase continuation of thermal_fmu/newton.py

@dataclass(frozen=True)
class NewtonLimits:
    """How many iterations, and whether a line search must lower the residual in each."""

    iterations: int
    line_search: bool


FULL_STEPS = NewtonLimits(10, False)  # they converge in about five, or go round in circles
LINE_SEARCH = NewtonLimits(MAX_ITERATIONS, True)


@dataclass(frozen=True)
class SolvedStations:
    """A stage that was solved.

    s : (n,) [K], its balance, the number of linear solves.  residual : norm beyond round-off over scale [1].
    """

    s: Floats
    balance: StationBalance
    iterations: int
    residual: float


def solve_stations(problem: StationProblem, s: Floats, tolerance: float) -> SolvedStations:
    """Solve a stage from the guess s : (n,) [K] (prescribed values already in it).

    Converged as in thermal_fmu/newton.py.  Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    melting = problem.substep.scene.melting
    solved = _melting_strategies(problem, s, tolerance) if melting else _newton(problem, s, tolerance, LINE_SEARCH)
    demand_limits(problem.substep.data, problem.loads, temperature(melting, solved.s))
    return solved


def _melting_strategies(problem: StationProblem, s: Floats, tolerance: float) -> SolvedStations:
    """Try full steps, then a line search, then phase continuation by the one and by the other.

    A line search creeps from edge to edge of the phases, where full steps are mostly past them at once.
    """
    for limits, solve in ((FULL_STEPS, _newton), (LINE_SEARCH, _newton), (FULL_STEPS, _phase_continuation)):
        try:
            return solve(problem, s, tolerance, limits)
        except (NotConvergedError, BadPropertyError):
            pass
    return _phase_continuation(problem, s, tolerance, LINE_SEARCH)


def _phase_continuation(problem: StationProblem, s: Floats, tolerance: float, limits: NewtonLimits) -> SolvedStations:
    return phase_continuation(lambda blur, last, goal: _newton(
        replace(problem, blur=blur), s if last is None else last.s, goal, limits), tolerance)


def _newton(problem: StationProblem, s: Floats, tolerance: float, limits: NewtonLimits) -> SolvedStations:
    scene = problem.substep.scene
    now = station_balance(problem, s)
    floor = ROUND_OFF * float(np.abs(now.band).sum(axis=0) @ np.abs(s))
    climbs = MAX_CLIMBS if scene.melting else 0
    last: StationBalance | None = None
    for iteration in range(limits.iterations):
        if is_solved(now, last, tolerance, floor):
            return SolvedStations(s, now, iteration, left_over(now, floor))
        last = now
        step = scene.stations.solve(now.band, np.where(scene.fixed, 0.0, -now.R))
        if not np.isfinite(step).all():
            raise NotConvergedError(f"the temperature of iteration {iteration + 1} is not finite")
        if not limits.line_search:
            s = s + step
            now = station_balance(problem, s)
            continue
        s, now = descend(partial(station_balance, problem), s, step, now, floor, climbs > 0)
        climbs -= int(now.norm >= last.norm and now.norm > floor)
    raise NotConvergedError(f"{limits.iterations} iterations left a residual of {now.relative_residual:.2e} of the "
                            f"heat that flows (tolerance {STAGE_TOLERANCE * tolerance:.1e})")


# Steps of a method

@dataclass(frozen=True)
class StationContext:
    """What a step needs beside time and state.  power_M : (n,) [W], E_M spread evenly over the substep.  rate : (n,) at
    which s moved in the substep before [K/s]; None: nothing is known of it.  elsewhere : temperatures of bodies that
    another half solves for; None: there are none.
    """

    substep: StationSubstep
    load_factors: LoadFactors
    calendar: Calendar
    power_M: Floats
    rate: Floats | None = None
    elsewhere: TemperatureCourse | None = None

    def loads_at(self, t: float, side: int) -> ThermalLoads:
        """Evaluate the boundary data at t [s], before a jump then (side = -1) or after it."""
        return loads_at(self.scene.model, self.load_factors, t, side, self.elsewhere)

    @property
    def scene(self) -> StationScene:
        """The scene."""
        return self.substep.scene


@dataclass(frozen=True)
class StationStep:
    """A step that was solved.

    s : (n,) [K] at the end, heat of the step, linear solves, worst relative residual [1]; whether a station went beyond
    what pulls it.  path : times [s] in order at which something was solved, and s : (n,) [K] then.  damped : whether it
    was taken by the method that damps.
    """

    s: Floats
    heat: Heat
    iterations: int
    residual: float
    overshoots: bool = False
    path: tuple[tuple[float, Floats], ...] = ()
    damped: bool = False

    def then(self, more: StationStep) -> StationStep:
        """Join this step and the one after it."""
        return replace(more, heat=self.heat + more.heat, iterations=self.iterations + more.iterations,
                       residual=max(self.residual, more.residual), path=self.path + more.path)


def advance_stations(context: StationContext, method: TimeMethod, s: Floats, damped: int, t: float,
                     h: float) -> tuple[StationStep, int]:
    """Take a substep from s : (n,) [K] at t to t + h [s]; return how many substeps are still to be damped, too.

    Raises as solve_stations.
    """
    damped_left = DAMPED_SUBSTEPS if context.calendar.jump_within(t, h) else damped
    if method.damped is None:
        return _take(context, method, s, t, h), max(damped_left - 1, 0)
    tried, how = 0, Damped.AS_IT_IS if context.elsewhere is None else context.elsewhere.damped
    if damped_left == 0 and how is not Damped.ALWAYS:
        try:
            done = _take(context, method, s, t, h)
        except BadPropertyError:
            pass
        else:
            if not done.overshoots or how is Damped.AFTER_A_JUMP:
                return done, 0
            tried = done.iterations
    damping, parts = METHODS[method.damped.method], method.damped.parts
    done = _take(context, damping, s, t, h / parts)
    done = replace(done, iterations=done.iterations + tried)
    for part in range(1, parts):
        end = t + h if part == parts - 1 else t + (part + 1) * h / parts
        done = done.then(_take(context, damping, done.s, end - h / parts, h / parts))
    return replace(done, damped=True), max(damped_left - 1, 0)


def entropy_stations(context: StationContext, E: Floats, s: Floats, t: float) -> StationStep:
    """Find the jump of s : (n,) [K] that energies E : (n,) [J] make.

    Prescribed stations stay, and the heat they hold back counts.
    """
    model = context.scene.model
    loads = context.loads_at(context.calendar.snap(t, 0.0), 1)
    problem = StationProblem(context.substep, loads, Stage(0.0, 1.0, 1.0), 0.0, s, context.power_M, E)
    solved = solve_stations(problem, s, model.stated.tolerance)
    terms = np.zeros(len(TERMS))
    terms[TERMS.index("entropy")] = E.sum()
    held_back, own = solved.balance.R[context.scene.fixed], context.scene.solved[context.scene.fixed]
    of_prescribed = through_prescribed(held_back, context.scene.owners, len(model.prescribed))
    each = np.concatenate([of_prescribed, 0.0 * solved.balance.each])
    heat = Heat(context.scene.counted(solved.balance.stored), inflow_outflow(held_back[own]), terms, each,
                solved.balance.moved)
    return StationStep(solved.s, heat, solved.iterations,
                       solved.residual)


def _take(context: StationContext, method: TimeMethod, s_n: Floats, t: float, dt: float) -> StationStep:
    model = context.scene.model
    solved: list[SolvedStations] = []
    for stage in method.stages:
        # The end of a step is before a jump that happens then.
        loads = context.loads_at(context.calendar.snap(t + stage.c * dt, dt), -1 if stage.c == 1.0 else 1)
        held_T = loads if stage.c == 1.0 or stage.theta == 1.0 else \
            context.loads_at(context.calendar.snap(t + dt, dt), -1)
        earlier = np.zeros(s_n.size)
        for weight, done in zip(stage.earlier, solved, strict=True):
            earlier += weight * dt * done.balance.flow
        problem = StationProblem(context.substep, loads, stage, dt, s_n, context.power_M, earlier)
        guess = _with_prescribed(context, held_T, solved[-1].s if solved else s_n)
        solved.append(solve_stations(problem, guess, model.stated.tolerance))
    over = method.damped is not None and _overshoots(context, method.stages[-1], s_n, solved[-1], dt)
    return StationStep(solved[-1].s, _heat(context.scene, method, solved, dt), sum(s.iterations for s in solved),
                       max(s.residual for s in solved), over,
                       solved_at(method, [one.s for one in solved], t, dt))


def _overshoots(context: StationContext, stage: Stage, s_n: Floats, last: SolvedStations, dt: float) -> bool:
    """Return whether a station went beyond what pulls it (thermal_fmu/limiter.py)."""
    scene, substep, weight = context.scene, context.substep, stage.a * dt
    M = np.zeros(s_n.size)
    for body, own in zip(scene.model.bodies, scene.stations.own, strict=True):
        M[own] = _at_stations(body, body.material.rho * substep.first.volume[own], s_n[own], last.s[own])[1]
    band, ds = last.balance.band, last.s - s_n
    conducted = scene.stations.times(band, np.where(scene.fixed, 0.0, ds)) + last.balance.pull - M * ds
    into = weight * last.balance.flow - (1.0 - stage.theta) / stage.theta * conducted
    before = None if context.rate is None else dt * context.rate
    end = NodesAtEnd(s_n, last.s, ~scene.fixed, into, M, band[2 * scene.stations.width], before)
    return went_beyond(end, stage.theta)


def _with_prescribed(context: StationContext, loads: ThermalLoads, s: Floats) -> Floats:
    melting = context.scene.melting
    T = prescribed_values(context.substep.data, loads.prescribed, phase_change.temperature(melting, s))
    return phase_change.prescribe(melting, s, T, context.scene.fixed)


def _heat(scene: StationScene, method: TimeMethod, solved: list[SolvedStations], dt: float) -> Heat:
    terms = sum((w * dt * s.balance.terms for w, s in zip(method.weights, solved, strict=True)), np.zeros(1))
    through = np.zeros(np.count_nonzero(scene.fixed))
    for w, s, stage in zip(method.weights, solved, method.stages, strict=True):
        through += w / stage.a * s.balance.R[scene.fixed]
    each = sum((w * dt * s.balance.each for w, s in zip(method.weights, solved, strict=True)), np.zeros(1))
    own = scene.solved[scene.fixed]
    return Heat(scene.counted(solved[-1].balance.stored), inflow_outflow(through[own]), np.asarray(terms),
                np.concatenate([through_prescribed(through, scene.owners, len(scene.model.prescribed)), each]),
                solved[-1].balance.moved)
