"""Steps of a time method at the stations, and of heat put in at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from thermal_fmu import phase_change
from thermal_fmu.boundary import TERMS, Heat, inflow_outflow, through_prescribed
from thermal_fmu.cells import BadPropertyError
from thermal_fmu.elsewhere import Damped, TemperatureCourse, solved_at
from thermal_fmu.limiter import NodesAtEnd, went_beyond
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHODS, Stage, TimeMethod
from thermal_fmu.scene import prescribed_values
from thermal_fmu.sources import Calendar, LoadFactors, ThermalLoads, loads_at
from thermal_fmu.stations.balance import Floats, StationProblem, StationSubstep, at_stations
from thermal_fmu.stations.scene import StationScene
from thermal_fmu.stations.solve import SolvedStations, solve_stations


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
        M[own] = at_stations(body, body.material.rho * substep.first.volume[own], s_n[own], last.s[own])[1]
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
