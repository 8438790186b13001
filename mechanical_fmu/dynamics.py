"""Inertia in time: the generalised-alpha method, and explicit central differences."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.loads import edge_shares
from mechanical_fmu.masses import Inertia, Masses
from mechanical_fmu.newton import NoEquilibriumError
from mechanical_fmu.problem import DynamicsOptions
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.volume import PointStep

Floats = NDArray[np.float64]


# The generalised-alpha method, Newmark's among them.  Eq. (23); coefficients in problem.py.

ROUND = 1e-9  # of a step: what pieces of it may be off by as they add up


@dataclass(frozen=True)
class Rubbing:
    """Friction at pair nodes, (n_q,) each; (0,) where nothing rubs or it is not known.

    force : [N] at Coulomb's bound, of what slips, with the sign of that; not a number: that at the end of the step is
    taken, too.  rate : [m/s] at which it slips, or did when
    it parted.  slip : [m] since the start of the step, as contact tells it.  dt [s] : in which it slipped at that rate.
    along : mean speed at the end of what slipped in the step, the way it did then [m/s]; less than 0: it turned round.
    """

    force: Floats = field(default_factory=lambda: np.empty(0))
    rate: Floats = field(default_factory=lambda: np.empty(0))
    slip: Floats = field(default_factory=lambda: np.empty(0))
    dt: float = 0.0
    along: float = 0.0


@dataclass(frozen=True)
class BodyMotion:
    """u : (n, 2) [m], v : (n, 2) [m/s], a : (n, 2) [m/s2], f : (n, 2) [N] internal less external, all at one time.

    push : (n, 2) [N] contact forces of f, (0, 2) where they were not noted.  stored : [J] in the springs of contact,
    less what it owes, of energy that it made of nothing and could not take back yet.  rubbing : friction then.
    owed : [J].
    """

    u: Floats
    v: Floats
    a: Floats
    f: Floats
    push: Floats = field(default_factory=lambda: np.empty((0, 2)))
    stored: float = 0.0
    rubbing: Rubbing = field(default_factory=Rubbing)
    owed: float = 0.0


def of_contact(before: BodyMotion, after: BodyMotion, heat: float) -> float:
    """Return the energy [J] that contact makes of nothing in a step: work of its forces, its springs and its friction.

    before, after : the motion at both ends, with the contact forces noted.  heat : [J] of friction.
    """
    work = 0.5 * float(((before.push + after.push) * (after.u - before.u)).sum())
    return work + after.stored - before.stored + heat


@dataclass(frozen=True)
class HeldMotion:
    """How components that are prescribed move in a step.

    rows : (k,) of the components.  u : (k,) [m] at its end.  a : (k,) [m/s2] all through.

    From places alone the trapezoidal rule makes velocities that ring without end where a motion has a kink, and all
    data in tables have.  These are those of the data; what they change by in the step is the acceleration in it.
    """

    rows: NDArray[np.intp]
    u: Floats
    a: Floats

    def start(self, system: System, now: BodyMotion, lumped: bool) -> BodyMotion:
        """Return the motion at the start of the step with the acceleration in it, and what that makes of the others."""
        more = self._with(np.zeros_like(now.a), self.a - now.a.ravel()[self.rows])
        if not more.any():
            return now
        # fault: the kink of a prescribed motion pushes neighbours in the step after it too -> push = 0.0 * more.ravel()
        #   | mechanical_fmu/test_held_motion
        push = -(system.masses.matrix(lumped) @ more.ravel()) * system.moving
        return replace(now, a=system.masses.followed(now.a + more + system.accelerations(push).reshape(more.shape)))

    def origin(self, flight: Floats, beta: float, dt: float) -> Floats:
        """Return (n, 2) u* [m] of which the acceleration of what is held follows as that of what is free."""
        # fault: what is let go flies on with a velocity that rings -> return flight | mechanical_fmu/test_held_motion
        return self._with(flight, self.u - beta * dt * dt * self.a)

    def _with(self, of_all: Floats, held: Floats) -> Floats:
        out = of_all.copy()
        out.ravel()[self.rows] = held
        return out


def inertia_of(masses: Masses, how: DynamicsOptions, now: BodyMotion, dt: float, held: HeldMotion) -> Inertia:
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
    origin = held.origin(free_flight(how, now, dt), how.beta, dt)
    return Inertia(scale * M, origin, rest / (1.0 - how.alpha_f))


def free_flight(how: DynamicsOptions, now: BodyMotion, dt: float) -> Floats:
    """Compute (n, 2) u* [m]: where u would be without the acceleration at the end of the step."""
    # fault: Newmark's free flight without its acceleration -> return now.u + dt * now.v |
    #   mechanical_fmu/test_solution_dynamics
    return now.u + dt * now.v + dt * dt * (0.5 - how.beta) * now.a


def motion_after(system: System, now: BodyMotion, found: ForceBalance, inertia: Inertia, dt: float) -> BodyMotion:
    """Compute the motion at the end of a step solved for."""
    how = system.spec.dynamics
    assert how is not None
    a = (found.u - inertia.origin) / (how.beta * dt * dt)
    v = now.v + dt * ((1.0 - how.gamma) * now.a + how.gamma * a)
    # Without mass a node's own rates are differences of places, and ring; inertia asks for those of what moves it.
    follow = system.masses.followed
    return BodyMotion(found.u, follow(v), follow(a), found.r - inertia.force(found.u), *contact_of(system, found))


def contact_of(system: System, found: ForceBalance) -> tuple[Floats, float]:
    """Return the contact forces (n, 2) [N], a rigid body's at its reference rows, and the energy [J] in their springs.
    """
    if found.tractions is None:
        return np.zeros_like(found.u), 0.0
    force = system.contact.force(found.tractions)
    return force if system.rigid is None else system.rigid.reduced(force, found.u), found.tractions.stored


def rubbed(system: System, before: Rubbing, found: ForceBalance, dt: float, since: float) -> tuple[Rubbing, Floats]:
    """Return how bodies with inertia rub at the end of dt [s], and the heat of it, (n_q,) [J], (0,) where nothing rubs.

    since : [s] from the start of the step, from which contact tells slip and heat, to that end.
    Half of a friction force acts at either end of a step, as of any force: that at the end alone, over all of it,
    makes another heat than bodies lose where surfaces meet and part, and `with_its_energy` gave them the difference
    back.  What parted slipped on as it did.
    """
    if found.tractions is None or not system.contact.slips:
        return Rubbing(), np.empty(0)
    slip, touches, known = found.tractions.slip, found.tractions.t_N < 0.0, before.force.size > 0
    force = np.divide(found.tractions.E_friction, slip, out=np.zeros_like(slip), where=slip != 0.0)
    # Of a step in pieces contact tells what slipped in all of them so far.
    # fault: slip of the pieces of a step before this one counts again -> later = False |
    #   mechanical_fmu/test_friction_inertia
    later = known and since > dt * (1.0 + ROUND)
    way = np.where(before.slip != 0.0, slip - before.slip, slip * dt / since) if later else slip * dt / since
    rate = np.where(touches, way / dt, before.rate if known else 0.0)
    # fault: friction heat of bodies with inertia is by the pressure at the end of steps -> then = force |
    #   mechanical_fmu/test_friction_inertia
    then = np.where(np.isnan(before.force), force, before.force) if known else force
    # By rates in the middle of two steps, as of an even acceleration.
    went = before.rate != 0.0 if known and before.dt > 0.0 else np.zeros_like(touches)
    speed = rate + np.where(went, dt / (dt + before.dt) * (rate - before.rate), 0.0) if went.any() else rate
    all_of_it = float(np.abs(force).sum())
    along = float(force @ speed) / all_of_it if all_of_it > 0.0 else 0.0
    # Where slip turned round, the friction of before has helped it on for half of the step.
    # fault: friction brakes what turned round in all of the step -> heat = 0.5 * dt * rate * (np.abs(then) *
    #   np.sign(rate) + force) | mechanical_fmu/test_friction_inertia
    heat = 0.5 * dt * rate * (then + force)
    return Rubbing(force, rate, slip, dt, along), np.maximum(heat, 0.0)


def end_residual(system: System, found: ForceBalance, motion: BodyMotion) -> Floats:
    """Compute (n, 2) [N] internal less external force and inertia at the end of a step: what holds held components.

    The residual of the step itself is of times before its end where alpha_f or alpha_m is not 0.
    """
    how = system.spec.dynamics
    if how is None:
        return found.r
    # fault: what holds a body told for the middle of the step -> return found.r |
    #   mechanical_fmu/test_named_forces
    return motion.f + np.asarray(system.masses.matrix(how.lumped) @ motion.a.ravel()).reshape(motion.a.shape)


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
    v = (v.ravel() * system.constraints.free).reshape(v.shape) if system.rigid is None else v
    v.ravel()[system.constraints.fixed] = 0.0
    f, a = _accelerated(system, found.r.copy(), lumped)
    still = found.tractions is not None and system.contact.slips and not found.tractions.n_touching
    nothing = np.zeros(system.contact.pair_nodes.size if still else 0)
    return BodyMotion(found.u, v, a, f, *contact_of(system, found), Rubbing(nothing, nothing, nothing))


def after_jump(system: System, motion: BodyMotion, added: Floats, lumped: bool) -> BodyMotion:
    """Return the motion at the same time, behind a jump of what acts.  added : (n, 2) [N] it acts by more."""
    df, da = _accelerated(system, -added, lumped)
    return replace(motion, f=motion.f + df, a=motion.a + da)


def _accelerated(system: System, f: Floats, lumped: bool) -> tuple[Floats, Floats]:
    """Return f : (n, 2) [N] without what pushes nodes without mass, and the accelerations M a = -f, (n, 2) [m/s2]."""
    free, masses = system.constraints.free, system.masses
    # Nodes without mass are in equilibrium from the first step on; what pushes them now is no inertia.
    f[masses.without] *= 1.0 - free.reshape(-1, 2)[masses.without]
    b = -f.ravel() * free
    if lumped and not masses.without.any():
        m = masses.lumped
        a = np.divide(b, m, out=np.zeros_like(b), where=m > 0.0)
    else:
        a = system.accelerations(b) * system.moving
    return f, masses.followed(a.reshape(f.shape))


# Explicit dynamics: central differences with a diagonal mass, cut into stable pieces.
#
#     u_{n+1} = u_n + h v_n + h2/2 a_n,   M a_{n+1} = -f(u_{n+1}),   v_{n+1} = v_n + h/2 (a_n + a_{n+1}),
# stable while h <= 2/w, w2 the largest of all cells (and of contact) of K_e against its share of the mass, which
# bounds that of the whole mesh.  Work by the trapezoidal rule and kinetic energy part by the sum of m h2/8 (a_{n+1}2
# - a_n2): small where the motion is resolved, and the first thing to grow where it is not, so it is what is watched.

# Share of the stable step taken: frequencies rise where cells are squeezed.
STABLE_STEP_FRACTION = 0.9
# Lumped at its corners a rigid cell has three times its moment of inertia; finer ones less.
TURNING_FACTOR = 3.0
# Pieces after which the stable step is worked out anew.
RECHECK_EVERY = 50
MAX_PIECES = 1_000_000
# Difference of work and kinetic energy, over the largest energy met, beyond which the motion is not believed.
ENERGY_ERROR = 0.1


@dataclass(frozen=True)
class Flight:
    """Where a step ended.  heat : (n_cells,) [J] of all pieces.  pieces : how many.  dt_stable : [s] at the end.

    last : the step of the points in the last piece.  rubbed : (n_q,) [J] heat of friction of all pieces, (0,) without.
    """

    motion: BodyMotion
    balance: ForceBalance
    heat: Floats
    pieces: int
    dt_stable: float
    last: PointStep
    rubbed: Floats


def fly(system: System, start: BodyMotion, history: Floats, dt: float,
        loading_at: Callable[[float, float, Floats], Loading]) -> Flight:
    """Compute the motion dt [s] later.  loading_at : (share of the step, piece [s], history) -> loading.

    history : (n_history,) of points and cells at the start.
    Raises NoEquilibriumError where the energies part or the pieces are too many.
    """
    now, heat, rub, share, pieces = start, np.empty(0), np.empty(0), 0.0, 0
    m = np.maximum(system.masses.lumped, np.finfo(float).tiny).reshape(-1, 2)
    limit, balance, drift, largest, last = 0.0, None, 0.0, float(np.finfo(float).tiny), PointStep()
    while share < 1.0:
        if pieces % RECHECK_EVERY == 0:
            limit = stable_step(system, now.u, loading_at(share, 0.0, history))
            if pieces + (1.0 - share) * dt / (STABLE_STEP_FRACTION * limit) > MAX_PIECES:
                raise NoEquilibriumError(f"a stable step is {limit:.3g} s: more than {MAX_PIECES} pieces of this one")
        left = (1.0 - share) * dt
        n = math.ceil(left / (STABLE_STEP_FRACTION * limit))
        h, share = left / n, 1.0 if n == 1 else share + (1.0 - share) / n
        loading = loading_at(share, h, history)
        last = loading.step
        after, balance = _piece(system, now, loading, h)
        drift += float((m * (after.a**2 - now.a**2)).sum()) * h * h / 8.0
        largest = max(largest, 0.5 * float((m * after.v**2).sum()))
        if abs(drift) > ENERGY_ERROR * largest and pieces > RECHECK_EVERY:
            raise NoEquilibriumError(f"work and kinetic energy part by {abs(drift) / largest:.0%}: the motion is not "
                                     "resolved")
        rubbing, more = rubbed(system, now.rubbing, balance, h, share * dt)
        rub = more if rub.size == 0 else rub + more
        now, history, pieces = replace(after, rubbing=rubbing), balance.history, pieces + 1
        heat = balance.heat if heat.size == 0 else heat + balance.heat
    assert balance is not None
    return Flight(now, balance, heat, pieces, limit, last, rub)


def _piece(system: System, now: BodyMotion, loading: Loading, h: float) -> tuple[BodyMotion, ForceBalance]:
    fixed, free = system.constraints.fixed, system.constraints.free.reshape(-1, 2)
    u = now.u + h * now.v + 0.5 * h * h * now.a
    u.ravel()[fixed] = loading.target
    u = u if system.rigid is None else system.rigid.placed(u)
    balance = system.balance(u, loading)
    m = system.masses.lumped.reshape(-1, 2)
    a = np.divide(-balance.r * free, m, out=np.zeros_like(u), where=m > 0.0)
    # fault: explicit velocities from the new acceleration alone -> v = now.v + h * a |
    #   mechanical_fmu/test_solution_dynamics
    v = now.v + 0.5 * h * (now.a + a)
    v.ravel()[fixed] = (u - now.u).ravel()[fixed] / h
    return BodyMotion(u, v, a, balance.r), balance


def stable_step(system: System, u: Floats, loading: Loading) -> float:
    """Compute the stable step 2/w [s] at u : (n_nodes, 2) [m]."""
    balance = system.balance(u, loading, tangent=True)
    assert balance.entries is not None
    largest, start = 0.0, 0
    for cells in system.volume.kinds:
        n = 2 * cells.nodes.shape[1]
        K = balance.entries[start : start + len(cells.nodes) * n * n].reshape(-1, n, n)
        start += K.size
        rho = system.masses.density[cells.part]
        m = np.repeat(rho[:, None] * np.einsum("eq,qa->ea", cells.weight, cells.N), 2, axis=1) ** -0.5
        scaled = 0.5 * (K + K.transpose(0, 2, 1)) * m[:, :, None] * m[:, None, :]
        largest = max(largest, float(np.linalg.eigvalsh(scaled)[:, -1].max()))
    # fault: open contact not counted in the stable step -> return 2.0 / math.sqrt(max(largest, np.finfo(float).tiny)) |
    #   mechanical_fmu/test_solution_waves
    return 2.0 / math.sqrt(max(largest + contact_rate(system), np.finfo(float).tiny))


def contact_rate(system: System) -> float:
    """Bound w2 [1/s2] of contact alone, all surfaces closed: eps_N A/m, the largest on either side of a pair.

    Open ones count too: they may close within the step, and a piece too long for that gains energy from nothing.
    """
    masses = system.masses
    nodal = (masses.density[:, None] * masses.volume).sum(axis=0)[: len(masses.interface.nodes)]
    rate = np.zeros(nodal.size)
    for pair in masses.interface.pairs:
        for side in (pair.slave, pair.master):
            edges = masses.interface.surfaces[side]
            stiff = max(pair.eps_N, pair.eps_T) * edge_shares(masses.interface, edges)
            np.add.at(rate, edges, stiff / np.maximum(nodal[edges], np.finfo(float).tiny))
    if system.rigid is not None:
        rate[system.rigid.nodes] *= TURNING_FACTOR
    sides = ([rate[masses.interface.surfaces[side]].max() for side in (pair.slave, pair.master)]
             for pair in masses.interface.pairs)
    return max((float(slave + master) for slave, master in sides), default=0.0)
