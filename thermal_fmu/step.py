"""One step of a method: its stages solved in order, and the heat they moved; damped steps after jumps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermal_fmu import phase
from thermal_fmu.heat import Heat, both_ways
from thermal_fmu.held import Held, prescribed_values
from thermal_fmu.loads import Calendar, LoadFactors, Loads, loads_at
from thermal_fmu.methods import METHODS, Method
from thermal_fmu.newton import Solved, solve_stage
from thermal_fmu.scene import Scene
from thermal_fmu.solver import Anchor, Factors
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
    T = prescribed_values(course.held, loads.prescribed, phase.temperature(melting, s))
    return phase.prescribe(melting, s, T, course.scene.fixed)


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
