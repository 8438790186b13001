"""Inertia in time: the generalised-alpha method, Newmark's among them.  Eq. (23); coefficients in problem.py."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.linalg import factorise
from mechanical_fmu.constraints import with_diagonal
from mechanical_fmu.masses import Inertia, Masses
from mechanical_fmu.problem import DynamicsOptions
from mechanical_fmu.system import ForceBalance, System
from mechanical_fmu.tangent import constrained

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BodyMotion:
    """u : (n, 2) [m], v : (n, 2) [m/s], a : (n, 2) [m/s2], f : (n, 2) [N] internal less external, all at one time."""

    u: Floats
    v: Floats
    a: Floats
    f: Floats


def inertia_of(masses: Masses, how: DynamicsOptions, now: BodyMotion, dt: float) -> Inertia:
    """Compute the inertia of the step of dt [s] from now, so that f(u) + force(u) = 0 is the balance at its end.

    With a_{n+1} = (u - u*)/(beta dt2), u* = u_n + dt v_n + dt2 (1/2 - beta) a_n, the balance of problem.py
    divided by 1 - alpha_f reads f_{n+1} + s M (u - u*) + (alpha_f f_n + alpha_m M a_n)/(1 - alpha_f) = 0 with
    s = (1 - alpha_m)/((1 - alpha_f) beta dt2).
    """
    M = masses.matrix(how.lumped)
    scale = (1.0 - how.alpha_m) / ((1.0 - how.alpha_f) * how.beta * dt * dt)
    # fault: generalised alpha without the forces at the start -> rest = 0.0 * now.f + how.alpha_m * (M @
    #   now.a.ravel()).reshape(now.a.shape) | mechanical_fmu/test_solution_dynamics
    rest = how.alpha_f * now.f + how.alpha_m * (M @ now.a.ravel()).reshape(now.a.shape)
    return Inertia(scale * M, free_flight(how, now, dt), rest / (1.0 - how.alpha_f))


def free_flight(how: DynamicsOptions, now: BodyMotion, dt: float) -> Floats:
    """Compute (n, 2) u* [m]: where u would be without the acceleration at the end of the step."""
    # fault: Newmark's free flight without its acceleration -> return now.u + dt * now.v |
    #   mechanical_fmu/test_solution_dynamics
    return now.u + dt * now.v + dt * dt * (0.5 - how.beta) * now.a


def motion_after(how: DynamicsOptions, now: BodyMotion, found: ForceBalance, inertia: Inertia, dt: float) -> BodyMotion:
    """Compute the motion at the end of a step solved for."""
    a = (found.u - inertia.origin) / (how.beta * dt * dt)
    v = now.v + dt * ((1.0 - how.gamma) * now.a + how.gamma * a)
    return BodyMotion(found.u, v, a, found.r - inertia.force(found.u))


def first_motion(system: System, found: ForceBalance, lumped: bool) -> BodyMotion:
    """Compute the motion at the start: the bodies' own velocities, Eq. (21), and accelerations M a = -f."""
    v = np.zeros_like(found.u)
    for body, spec in enumerate(system.spec.bodies):
        here = system.interface.node_body == body
        x = system.interface.nodes[here] + found.u[here]
        middle = 0.5 * (x.max(axis=0) + x.min(axis=0))
        if system.rigid is not None and spec.rigid:
            k = int(np.flatnonzero(system.rigid.body == body)[0])
            middle = system.rigid.reference[k] + found.u[system.rigid.point_rows[k]]
            v[system.rigid.point_rows[k]] = spec.v0
            v[system.rigid.turn_rows[k], 0] = spec.omega0 * system.rigid.size[k]
        arm = x - middle
        v[here] = np.array(spec.v0) + spec.omega0 * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    free = system.constraints.free
    v = (v.ravel() * free).reshape(v.shape) if system.rigid is None else v
    v.ravel()[system.constraints.fixed] = 0.0
    b = -found.r.ravel() * free
    if lumped:
        m = system.masses.lumped
        a = np.divide(b, m, out=np.zeros_like(b), where=m > 0.0)
    else:
        a = factorise(constrained(system, with_diagonal(system.masses.matrix(False))))(b) * free
    return BodyMotion(found.u, v, a.reshape(v.shape), found.r)
