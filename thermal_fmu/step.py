"""One step of a method: its stages solved in order, and the heat they moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu import phase
from thermal_fmu.heat import Heat
from thermal_fmu.held import Held, Scene, prescribed_values
from thermal_fmu.loads import Calendar, LoadFactors, loads_at
from thermal_fmu.methods import Method
from thermal_fmu.newton import Solved, solve_stage
from thermal_fmu.solver import Anchor, Factors
from thermal_fmu.stage import StageProblem

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stepped:
    """s : (n,) [K] at the end, heat of the step, linear solves, worst relative residual, anchor of the next solve."""

    s: Floats
    heat: Heat
    iterations: int
    residual: float
    anchor: Anchor | None


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
        loads = loads_at(model, course.load, at, -1 if stage.c == 1.0 else 1)
        end = course.calendar.snap(t + dt, dt)
        held_T = loads if stage.c == 1.0 or stage.theta == 1.0 else loads_at(model, course.load, end, -1)
        earlier = np.zeros(s_n.size)
        for weight, done in zip(stage.earlier, solved, strict=True):
            earlier += weight * dt * done.balance.flow
        problem = StageProblem(course.scene, course.held, loads, stage, dt, s_n, course.power_M, earlier,
                               method.stores)
        s = solved[-1].s if solved else s_n
        T = prescribed_values(course.held, held_T.prescribed, phase.temperature(course.scene.melting, s))
        guess = phase.prescribe(course.scene.melting, s, T, course.scene.fixed)
        solved.append(solve_stage(problem, guess, model.tolerance, course.factors, anchor))
        anchor = solved[-1].anchor
    return Stepped(solved[-1].s, _heat(course.scene, method, solved, dt), sum(s.iterations for s in solved),
                   max(s.residual for s in solved), anchor)


def _heat(scene: Scene, method: Method, solved: list[Solved], dt: float) -> Heat:
    """Energies with the weights of the stages; the reaction of a stage is its residual at fixed nodes."""
    terms = sum((w * dt * s.balance.terms for w, s in zip(method.weights, solved, strict=True)), np.zeros(1))
    reaction = sum(w * float(s.balance.R[scene.fixed].sum()) / stage.a
                   for w, s, stage in zip(method.weights, solved, method.stages, strict=True))
    return Heat(solved[-1].balance.stored, float(reaction), np.asarray(terms))
