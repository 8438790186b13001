"""One step of a method: its stages solved in order, and the heat they moved; damped steps after jumps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermal_fmu import phase_change
from thermal_fmu.boundary import TERMS
from thermal_fmu.cells import spread_energies
from thermal_fmu.heat import Heat, both_ways
from thermal_fmu.methods import METHODS, Method, Stage
from thermal_fmu.newton import Anchor, Factors, Solved, solve_stage
from thermal_fmu.scene import Held, Scene, prescribed_values
from thermal_fmu.sources import Calendar, LoadFactors, Loads, loads_at
from thermal_fmu.stage import StageProblem, balance

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stepped:
    """s : (n,) [K] at the end, heat of the step, linear solves, worst relative residual, anchor of the next solve.

    moved : (n,) [J] that flowed into the nodes, held nodes' reactions included: their increase of enthalpy.
    inside : (n,) [J] the part of it that did not come through the surface.
    """

    s: Floats
    heat: Heat
    iterations: int
    residual: float
    anchor: Anchor | None
    moved: Floats
    inside: Floats

    def then(self, more: Stepped) -> Stepped:
        """This step and the one after it as one."""
        return replace(more, heat=self.heat + more.heat, iterations=self.iterations + more.iterations,
                       residual=max(self.residual, more.residual), moved=self.moved + more.moved,
                       inside=self.inside + more.inside)


@dataclass(frozen=True)
class Course:
    """What a step needs beside time and state.  power_M : (n,) [W], E_M spread evenly over the substep."""

    scene: Scene
    held: Held
    load: LoadFactors
    calendar: Calendar
    power_M: Floats
    factors: Factors


def take_step(course: Course, method: Method, s_n: Floats, anchor: Anchor | None, t: float, dt: float) -> Stepped:
    """From s_n : (n,) [K], T where nothing melts, at t to t + dt [s].

    Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    model = course.scene.model
    solved: list[Solved] = []
    for stage in method.stages:
        # The end of a step is before a jump that happens then.
        at = course.calendar.snap(t + stage.c * dt, dt)
        # fault: jump seen too early -> loads = loads_at(model, course.load, at, 1) | thermal_fmu/test_thermal_time
        loads = loads_at(model, course.load, at, -1 if stage.c == 1.0 else 1)
        end = course.calendar.snap(t + dt, dt)
        held_T = loads if stage.c == 1.0 or stage.theta == 1.0 else loads_at(model, course.load, end, -1)
        earlier = np.zeros(s_n.size)
        for weight, done in zip(stage.earlier, solved, strict=True):
            earlier += weight * dt * done.balance.flow
        problem = StageProblem(course.scene, course.held, loads, stage, dt, s_n, course.power_M, earlier,
                               method.stores)
        guess = with_prescribed(course, held_T, solved[-1].s if solved else s_n)
        solved.append(solve_stage(problem, guess, model.stepping.tolerance, course.factors, anchor))
        anchor = solved[-1].anchor
    moved, inside = np.zeros(s_n.size), np.zeros(s_n.size)
    for weight, done in zip(method.weights, solved, strict=True):
        moved += weight * dt * done.balance.flow
        inside += weight * dt * done.balance.inside
    return Stepped(solved[-1].s, _heat(course.scene, method, solved, dt), sum(s.iterations for s in solved),
                   max(s.residual for s in solved), anchor, moved, inside)


def damped_step(course: Course, method: Method, s: Floats, anchor: Anchor | None, t: float, h: float) -> Stepped:
    """A step after a jump: cut into parts of the damping method, where the method needs it.  Raises as take_step."""
    if method.damped is None:
        return take_step(course, method, s, anchor, t, h)
    name, parts = method.damped
    done = take_step(course, METHODS[name], s, anchor, t, h / parts)
    for part in range(1, parts):
        end = t + h if part == parts - 1 else t + (part + 1) * h / parts
        start = end - h / parts
        done = done.then(take_step(course, METHODS[name], done.s, done.anchor, start, h / parts))
    return done


def with_prescribed(course: Course, loads: Loads, s: Floats) -> Floats:
    """s : (n,) [K] with the prescribed temperatures of `loads` put in."""
    melting = course.scene.melting
    T = prescribed_values(course.held, loads.prescribed, phase_change.temperature(melting, s))
    return phase_change.prescribe(melting, s, T, course.scene.fixed)


def flow_at(course: Course, s: Floats, t: float, dt: float, side: int) -> tuple[Floats, Floats]:
    """s : (n,) [K] with the prescribed values of t [s] put in, and (n,) [W] the heat that flows into each node.

    dt : of the step [s], by which a kink is told.  side : the flow before a jump at t (-1) or after it (1).
    Raises BadPropertyError.
    """
    loads = loads_at(course.scene.model, course.load, course.calendar.snap(t, dt), side)
    s = with_prescribed(course, loads, s)
    steady = METHODS["steady"].stages[0]
    problem = StageProblem(course.scene, course.held, loads, steady, 1.0, s, course.power_M, np.zeros(s.size), False)
    return s, -balance(problem, s, jacobian=False).R


def _heat(scene: Scene, method: Method, solved: list[Solved], dt: float) -> Heat:
    """Energies with the weights of the stages; the reaction of a stage is its residual at fixed nodes."""
    terms = sum((w * dt * s.balance.terms for w, s in zip(method.weights, solved, strict=True)), np.zeros(1))
    through = np.zeros(np.count_nonzero(scene.fixed))
    for w, s, stage in zip(method.weights, solved, method.stages, strict=True):
        # fault: reaction of the last stage only -> through += (stage.c == 1.0) * s.balance.R[scene.fixed] |
        #   thermal_fmu/test_thermal_nonlinear
        through += w / stage.a * s.balance.R[scene.fixed]
    return Heat(solved[-1].balance.stored, both_ways(through), np.asarray(terms))


# The local error of a step, from the heat that flows along it.

def local_error(course: Course, start: tuple[Floats, Floats], done: Stepped, t: float,
                h: float) -> tuple[float, tuple[Floats, Floats]]:
    """Largest error at a free node [K] of the step `done` from t to t + h [s].

    start : s_0 (n,) [K] and the flow f_0 (n,) [W] where it began; the same of its end is returned too.  What it moved
    is compared with Simpson's rule along the cubic through both ends,

        d = h/6 (f_0 + 4 f(s_m) + f_1) - (E_1 - E_0),   s_m = (s_0 + s_1)/2 + h/8 (ds_0/dt - ds_1/dt),

    which is right to h^4 for any one-step method of order two or less; differences of temperatures alone see only one
    of the several products of derivatives an error is made of.  Rates and error come from dR/ds of the step, whose
    factors are at hand: A^-1 f and A^-1 d, so that the stiff modes the step did not resolve do not drown the rest.
    Raises BadPropertyError, SingularMatrixError.
    """
    free = ~course.scene.fixed
    s_0, f_0 = start
    s_1, f_1 = flow_at(course, done.s, t + h, h, -1)
    if done.anchor is None:
        return 0.0, (s_1, f_1)  # nothing was solved: nothing flows
    factors = course.factors.of(done.anchor)
    bend = factors(np.where(free, f_0 - f_1, 0.0))
    # fault: middle of a chord for the middle of the path -> middle = 0.5 * (s_0 + s_1) + 0.0 * bend |
    #   thermal_fmu/test_thermal_adaptive
    middle = 0.5 * (s_0 + s_1) + np.where(free, 0.125 * h * bend, 0.0)
    _, f_m = flow_at(course, middle, t + 0.5 * h, h, 1)
    # fault: local error by the trapezoidal rule -> missing = h / 2.0 * (f_0 + f_1) - done.moved |
    #   thermal_fmu/test_thermal_adaptive
    missing = h / 6.0 * (f_0 + 4.0 * f_m + f_1) - done.moved
    error = factors(np.where(free, missing, 0.0))
    return float(np.abs(error[free]).max(initial=0.0)), (s_1, f_1)


# The entropy part of the adiabatic split: a temperature jump at the start of a substep.

def entropy_jump(course: Course, E_S: Floats, s_n: Floats, anchor: Anchor | None, factors: Factors,
                 t: float) -> Stepped:
    """Find s with E(s) - E(s_n) = E_S spread over the nodes; prescribed nodes stay, and what they hold back counts.

    E_S : (n_cells,) [J].  factors, anchor : the jump's own, for its matrix is that of storage alone.
    Raises NotConvergedError, SingularMatrixError, BadPropertyError.
    """
    scene = course.scene
    given = spread_energies(scene.volume, course.held.shapes, E_S)
    loads = loads_at(scene.model, course.load, course.calendar.snap(t, 0.0), 1)
    problem = StageProblem(scene, course.held, loads, Stage(0.0, 1.0, 1.0), 0.0, s_n, course.power_M, given, True)
    solved = solve_stage(problem, s_n, scene.model.stepping.tolerance, factors, anchor)
    terms = np.zeros(len(TERMS))
    terms[TERMS.index("entropy")] = E_S.sum()
    held_back = np.where(scene.fixed, solved.balance.R, 0.0)
    # fault: entropy part at held nodes lost -> heat = Heat(solved.balance.stored, both_ways(0.0 * held_back), terms) |
    #   thermal_fmu/test_thermal_entropy
    heat = Heat(solved.balance.stored, both_ways(held_back), terms)
    return Stepped(solved.s, heat, solved.iterations, solved.residual, solved.anchor, given + held_back, given)
