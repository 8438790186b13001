"""One step of a method at the stations: its stages in order, and the heat they moved; damped steps after jumps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermal_fmu import phase
from thermal_fmu.boundary import TERMS
from thermal_fmu.heat import Heat, both_ways
from thermal_fmu.held import prescribed_values
from thermal_fmu.loads import Calendar, LoadFactors, Loads, loads_at
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHODS, Method, Stage
from thermal_fmu.station_balance import Ground, StationProblem
from thermal_fmu.station_newton import StationSolved, solve_stations
from thermal_fmu.station_scene import StationScene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StationCourse:
    """What a step needs beside time and state.  power_M : (n,) [W], E_M spread evenly over the substep."""

    ground: Ground
    load: LoadFactors
    calendar: Calendar
    power_M: Floats

    @property
    def scene(self) -> StationScene:
        """The scene."""
        return self.ground.scene


@dataclass(frozen=True)
class StationStepped:
    """s : (n,) [K] at the end, heat of the step, linear solves, worst relative residual."""

    s: Floats
    heat: Heat
    iterations: int
    residual: float

    def then(self, more: StationStepped) -> StationStepped:
        """This step and the one after it as one."""
        return replace(more, heat=self.heat + more.heat, iterations=self.iterations + more.iterations,
                       residual=max(self.residual, more.residual))


def advance_stations(course: StationCourse, method: Method, s: Floats, damped: int, t: float,
                     h: float) -> tuple[StationStepped, int]:
    """From t to t + h [s], and how many substeps are still to be damped.  Raises as solve_stations."""
    left = DAMPED_SUBSTEPS if course.calendar.jump_within(t, h) else damped
    if left == 0 or method.damped is None:
        return _take(course, method, s, t, h), max(left - 1, 0)
    name, parts = method.damped
    done = _take(course, METHODS[name], s, t, h / parts)
    for part in range(1, parts):
        end = t + h if part == parts - 1 else t + (part + 1) * h / parts
        done = done.then(_take(course, METHODS[name], done.s, end - h / parts, h / parts))
    return done, left - 1


def entropy_stations(course: StationCourse, E: Floats, s: Floats, t: float) -> StationStepped:
    """The jump of s that energies E : (n,) [J] make; prescribed stations stay, and what they hold back counts."""
    model = course.scene.model
    loads = loads_at(model, course.load, course.calendar.snap(t, 0.0), 1)
    problem = StationProblem(course.ground, loads, Stage(0.0, 1.0, 1.0), 0.0, s, course.power_M, E)
    solved = solve_stations(problem, s, model.stepping.tolerance)
    terms = np.zeros(len(TERMS))
    terms[TERMS.index("entropy")] = E.sum()
    held_back = both_ways(solved.balance.R[course.scene.fixed])
    return StationStepped(solved.s, Heat(solved.balance.stored, held_back, terms), solved.iterations,
                          solved.balance.share)


def _take(course: StationCourse, method: Method, s_n: Floats, t: float, dt: float) -> StationStepped:
    model = course.scene.model
    solved: list[StationSolved] = []
    for stage in method.stages:
        # The end of a step is before a jump that happens then.
        loads = loads_at(model, course.load, course.calendar.snap(t + stage.c * dt, dt), -1 if stage.c == 1.0 else 1)
        held_T = loads if stage.c == 1.0 or stage.theta == 1.0 else \
            loads_at(model, course.load, course.calendar.snap(t + dt, dt), -1)
        earlier = np.zeros(s_n.size)
        for weight, done in zip(stage.earlier, solved, strict=True):
            earlier += weight * dt * done.balance.flow
        problem = StationProblem(course.ground, loads, stage, dt, s_n, course.power_M, earlier)
        guess = _with_prescribed(course, held_T, solved[-1].s if solved else s_n)
        solved.append(solve_stations(problem, guess, model.stepping.tolerance))
    return StationStepped(solved[-1].s, _heat(course.scene, method, solved, dt), sum(s.iterations for s in solved),
                          max(s.balance.share for s in solved))


def _with_prescribed(course: StationCourse, loads: Loads, s: Floats) -> Floats:
    melting = course.scene.melting
    T = prescribed_values(course.ground.held, loads.prescribed, phase.temperature(melting, s))
    return phase.prescribe(melting, s, T, course.scene.fixed)


def _heat(scene: StationScene, method: Method, solved: list[StationSolved], dt: float) -> Heat:
    terms = sum((w * dt * s.balance.terms for w, s in zip(method.weights, solved, strict=True)), np.zeros(1))
    through = np.zeros(np.count_nonzero(scene.fixed))
    for w, s, stage in zip(method.weights, solved, method.stages, strict=True):
        through += w / stage.a * s.balance.R[scene.fixed]
    return Heat(solved[-1].balance.stored, both_ways(through), np.asarray(terms))
