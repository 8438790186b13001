"""A step: what drives it, whether it is worth solving, and how it is gone in one piece or several."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Values
from contact.half.program import ProgramError
from mechanical_fmu.coming_to_rest import brought_to_rest
from mechanical_fmu.contact import ContactQuery
from mechanical_fmu.dynamics import BodyMotion, HeldMotion, fly, free_flight, inertia_of, motion_after, rubbed
from mechanical_fmu.energy import made
from mechanical_fmu.enforcement import contact_history, solve_step
from mechanical_fmu.heat import at_frozen_entropy
from mechanical_fmu.impact import with_its_energy
from mechanical_fmu.kinks import behind_kink
from mechanical_fmu.laws.law import CREEP, LIQUID, OVERSTRESS
from mechanical_fmu.loads import driven, pressure_forces
from mechanical_fmu.material import Moduli
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, SolverSettings
from mechanical_fmu.passing import refuse_passing
from mechanical_fmu.predicting import going_on, predicted
from mechanical_fmu.program_step import solve_by_program
from mechanical_fmu.slipping import slipped
from mechanical_fmu.stabilisation import SOON, left_behind, stabilised
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import LooseBodyError, StiffnessAnchor
from mechanical_fmu.volume import CellError, PointStep

Floats = NDArray[np.float64]


# What drives a step: prescribed motions, loads and temperatures, at its end and on the way there.

# Start value of the input f_s: no share of anything, so that a master that does not connect it gets f_s from T.
NOT_GIVEN = -1.0


@dataclass(frozen=True)
class StepDrive:
    """levels : (n_levels,) of prescribed displacements [m], [rad] (motions.py).  pressure : (n_pressures,) [Pa].

    dead : (n_dead,) size of each dead load.
    T : (n_nodes,) [K].  f_s : (n_nodes,) solid fraction; (0,) where nobody gave it, and T says it.
    """

    levels: Floats
    pressure: Floats
    dead: Floats
    T: Floats
    f_s: Floats


def drive_of(system: System, inputs: Values, t: float, side: int) -> StepDrive:
    """Compute the drive at time t [s], from the given side of a jump (-1 before it, 1 after it)."""
    spec = system.spec
    pressure = [driven(p.value, p.name, t, side, inputs) for p in spec.pressures]
    dead = [driven(d.value, d.name, t, side, inputs) for d in spec.dead]
    T = np.array(inputs["T"], dtype=np.float64, order="C")
    levels = system.constraints.motions.levels(t, side, inputs)
    return StepDrive(levels, np.array(pressure), np.array(dead), T, _given(inputs))


def between(a: StepDrive, b: StepDrive, share: float) -> StepDrive:
    """Compute the drive after a share of the way from a to b; b itself at its end."""
    if share == 1.0:
        return b
    return StepDrive(*(x + share * (y - x) for x, y in
                       ((a.levels, b.levels), (a.pressure, b.pressure), (a.dead, b.dead), (a.T, b.T),
                        (a.f_s if a.f_s.size == b.f_s.size else b.f_s, b.f_s))))


def _given(inputs: Values) -> Floats:
    """f_s as it was given, or nothing while all of it is at its start value."""
    f_s = np.array(inputs.get("f_s", ()), dtype=np.float64, order="C")
    return np.empty(0) if (f_s == NOT_GIVEN).all() else f_s


# Whether a step is worth solving: how far its inputs could move anything, to first order.
#
#     du ~ max|d target| + max(|d e_th|/3 + |d mu|/mu |u|/L) L + sum|dF| L/(E size)
# with L the size of a body and size = L per metre depth (2 pi r L when axisymmetric).  Bodies that bend move more than
# this says: there, a smaller bound is the remedy.  The change is counted from the last step that was solved, so what is
# skipped adds up and never drifts.

def may_skip(system: System) -> bool:
    """Say whether nothing moves while the inputs stand still: no creep, no flow in time."""
    return not any(m.kind & (CREEP | OVERSTRESS | LIQUID) for m in system.spec.materials)


def expected_change(system: System, solved: StepDrive, now: StepDrive, u: Floats) -> float:
    """Estimate max|du| [m] from the inputs last solved for to those of now, about u : (n_nodes, 2) [m]."""
    motions = system.constraints.motions
    moved = np.abs(motions.target(now.levels) - motions.target(solved.levels)).max(initial=0.0)
    L = np.array([np.ptp(system.interface.nodes[system.interface.node_body == b], axis=0).max()
                  for b in range(len(system.interface.bodies))])
    largest, E = float(np.abs(u).max()), np.full(len(L), np.inf)
    strain = np.zeros(len(L))
    for cells, before, after in zip(system.volume.kinds, system.moduli(solved.T), system.moduli(now.T), strict=True):
        softer = np.abs(after.mu - before.mu) / before.mu
        change = np.abs(after.e_th - before.e_th).max(axis=1) / 3.0 + softer * largest / L[cells.body]
        np.maximum.at(strain, cells.body, change)
        np.minimum.at(E, cells.body, after.E)
    forces = _change_of_forces(system, solved, now, u)
    node_force = np.abs(forces).sum(axis=1)
    on_body = np.bincount(system.constraints.holder + 1, weights=node_force, minlength=len(L) + 1)[1:]
    return float(moved + (strain * L).max(initial=0.0) + (on_body * L / (E * system.size)).max(initial=0.0))


def _change_of_forces(system: System, solved: StepDrive, now: StepDrive, u: Floats) -> Floats:
    change = np.zeros_like(u)
    if now.dead.size:
        change += system.masses.dead.at(now.dead - solved.dead)
    x = system.interface.nodes + u
    for load, p in zip(system.loads, now.pressure - solved.pressure, strict=True):
        if p != 0.0:
            forces = pressure_forces(x, load.edges, np.full(len(load.edges), p), system.interface.axisymmetric)
            np.add.at(change, load.edges, forces)
    return change


# From one time to another: one solve, or several where one cannot be done.

# The share of a step over which the velocity at its end is taken: of what turns it is off by half of that.
LAST_BIT = 1e-4


@dataclass(frozen=True)
class Task:
    """What a whole step is asked for.  Everything in it is the same for all pieces of the step.

    start : the drive at its beginning.  end : at its end.  dt : [s].  query : contact, None where nothing can touch.
    frozen : ln theta (heat.log_dilatation) at which the entropy is frozen, None for a given temperature.
    handed : (n, 2) [N] what held components that are released now, and goes to nothing within the step; None of none.
    jump : (n_levels,) by how much the levels jump at its beginning; (0,): they do not, or without inertia.
    kink : (n_levels,) [1/s] by how much their slopes change there; (0,): they do not, or that is of no account.
    """

    start: StepDrive
    end: StepDrive
    dt: float
    query: ContactQuery | None
    frozen: tuple[Floats, ...] | None
    handed: Floats | None = None
    jump: Floats = field(default_factory=lambda: np.empty(0))
    kink: Floats = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Departure:
    """What a piece of a step begins with.  history : (n_history,) of points and cells.

    trend : (n, 2) [m/s] at which nodes went in the step or the piece before, (0, 2): none did, or with inertia.
    """

    motion: BodyMotion
    history: Floats
    trend: Floats = field(default_factory=lambda: np.empty((0, 2)))


@dataclass(frozen=True)
class StepResult:
    """Where pieces of a step ended.  heat : (n_cells,) [J] of all of them, empty where none can be made.

    iterations : of all.  cuts : pieces beyond the first.  residual : largest of the pieces.
    last : what the points remembered when the last piece began, and its length.  work : [J] of all, of what damped
    bodies that contact did not hold yet.  runs : of a program that solves for the inside of bodies.  made : energy [J]
    that comes from nothing, of all (energy.py).
    rubbed : (n_q,) [J] heat of friction of all pieces, with inertia; (0,) where contact tells it, or none is made.
    slid : (n_q,) [m] how far slave nodes slipped in all of them, to and fro; (0,) without contact.
    """

    balance: ForceBalance
    motion: BodyMotion
    heat: Floats
    iterations: int
    residual: float
    cuts: int = 0
    dt_stable: float = 0.0
    last: PointStep = field(default_factory=PointStep)
    work: float = 0.0
    runs: int = 0
    made: float = 0.0
    rubbed: Floats = field(default_factory=lambda: np.empty(0))
    slid: Floats = field(default_factory=lambda: np.empty(0))


class PartWayError(ArithmeticError):
    """A step that went part of its way.  share : reached.  cause : why it went no further."""

    def __init__(self, share: float, cause: ArithmeticError) -> None:
        super().__init__(str(cause))
        self.share, self.cause = share, cause


def loading_of(system: System, task: Task, share: float, dt: float, history: Floats) -> Loading:
    """Make the loading after a share of the step, dt [s] after history : (n_history,).  Raises MaterialRangeError."""
    drive = between(task.start, task.end, share)
    # fault: a given solid fraction is not heeded -> moduli = system.moduli(drive.T) |
    #   mechanical_fmu/test_solution_melting scenarios/test_freezing_column
    moduli = system.moduli(drive.T, drive.f_s)
    if task.frozen is not None:
        moduli = at_frozen_entropy(system, moduli, drive.T, task.frozen)
    dead = system.masses.dead.at(drive.dead) if drive.dead.size else None
    if task.handed is not None and share < 1.0:
        # fault: a released condition lets go at once -> pass | mechanical_fmu/test_release
        dead = (1.0 - share) * task.handed + (0.0 if dead is None else dead)
    target = system.constraints.motions.target(drive.levels)
    return Loading(moduli, target, drive.pressure, task.query, PointStep(dt, history), dead)


def solved(system: System, u: Floats, loading: Loading, first: ForceBalance, anchor: StiffnessAnchor | None,
           settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to `first`, the prediction of a step from u : (n_nodes, 2) [m].

    Where contact alone could hold a body and does not yet, what would hold it is looked for (slipping.py).  A body that
    nothing pushes does not follow what draws back from it.
    Raises PassingError where a body would go through another, and what solve_step does.
    """
    may_slip = system.can_be_loose and system.contact.slips and loading.inertia is None
    direct = replace(settings, max_iterations=min(settings.max_iterations, SOON)) if may_slip else settings

    def by_cells(loading: Loading, first: ForceBalance) -> Equilibrium:
        try:
            return solve_step(system, loading, first, anchor, direct)
        except LooseBodyError:
            # fault: first contact under a force refused -> raise | mechanical_fmu/test_first_contact
            return slipped(system, loading, first, settings)
        except NoEquilibriumError:
            # Newton's method goes round where a body that only contact holds slips on nearly all of it.
            if not may_slip:
                raise
            # fault: a body that goes round is not damped -> raise | mechanical_fmu/test_first_contact
            return stabilised(system, loading, first, settings)

    found = by_cells(loading, first) if system.program is None else solve_by_program(
        system, system.program, loading, first, by_cells)
    if left := left_behind(system, loading, u, found.balance, settings.tolerance):
        # fault: a body sticks to what draws back from it -> pass | mechanical_fmu/test_left_behind
        found = _resumed(system, found, left, u, by_cells, settings)
    refuse_passing(system, u, found.balance)
    return found


def _resumed(system: System, found: Equilibrium, left: tuple[Loading, ForceBalance], u: Floats,
             by_cells: Callable[[Loading, ForceBalance], Equilibrium], settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium from where bodies were left behind, after one that took them along from u."""
    if settled := _settled(system, found, left, settings.tolerance):
        return settled
    then = by_cells(*left)
    then = replace(then, history=(*found.history, *then.history[1:]), work=found.work + then.work, runs=found.runs)
    # What only took its own shape was damped, and what is left of its forces carried it on a little.
    # fault: what takes its own shape drifts -> again = None | mechanical_fmu/test_left_behind
    again = left_behind(system, left[0], u, then.balance, settings.tolerance)
    return (_settled(system, then, again, settings.tolerance) if again else None) or then


def _settled(system: System, found: Equilibrium, left: tuple[Loading, ForceBalance],
             tolerance: float) -> Equilibrium | None:
    """Return what was found with its bodies where they were left behind; None where they are not in balance there."""
    error = float(system.error(left[1], system.floor(left[0], tolerance)).max())
    return replace(found, balance=left[1], residual=error) if error <= tolerance else None


def in_pieces(system: System, task: Task, begin: Departure, settings: SolverSettings, cuts: int,
              failed: ArithmeticError | None = None) -> StepResult:
    """Solve the step, halved where a piece cannot be solved, at most `cuts` times.

    failed : why the whole step was tried in vain, None if it was not tried.
    Raises PartWayError; its cause is the last, but a cell that failed tells more than forces out of balance.
    """
    share, found = 0.0, None
    size, left = (1.0, cuts) if failed is None else (0.5, cuts - 1)
    while share < 1.0:
        goal = min(share + size, 1.0)
        try:
            piece = _piece(system, task, begin, (share, goal), settings, left == 0)
        except ArithmeticError as exc:
            failed = failed if isinstance(failed, CellError) else exc
            if left == 0 or isinstance(exc, ProgramError):
                raise PartWayError(share, failed) from exc
            size, left = 0.5 * size, left - 1
            continue
        found = piece if found is None else _joined(found, piece)
        trend = (piece.motion.u - begin.motion.u) / ((goal - share) * task.dt)
        task, begin, share = _onwards(system, task, piece), Departure(piece.motion, piece.balance.history, trend), goal
        if size < 1.0 and left < cuts and (share / (2.0 * size)).is_integer():
            # A hard spot is behind: try larger pieces again, but the spot has used up its cuts.
            size, left = 2.0 * size, left + 1
    assert found is not None
    return found


def _piece(system: System, task: Task, begin: Departure, span: tuple[float, float],
           settings: SolverSettings, last: bool) -> StepResult:
    """One piece of a step.  last : whether it cannot be cut any more."""
    motion, history = begin.motion, begin.history
    (a, b), dt, dynamics, energy = span, (span[1] - span[0]) * task.dt, system.spec.dynamics, 0.0
    if settings.method == "explicit":
        def loading_at(share: float, h: float, at: Floats) -> Loading:
            return loading_of(system, task, a + share * (b - a), h, at)

        flight = fly(system, motion, history, dt, loading_at)
        refuse_passing(system, motion.u, flight.balance)
        return StepResult(flight.balance, flight.motion, flight.heat, flight.pieces, 0.0, 0, flight.dt_stable,
                          flight.last, rubbed=flight.rubbed, slid=way_of(flight.balance))
    loading = loading_of(system, task, b, dt, history)
    heat = np.empty(0)
    if dynamics is None:
        first = predicted(system, motion.u, loading, True)
        if begin.trend.size:
            first = going_on(system, motion.u, dt * begin.trend, loading, first, settings)
        equilibrium = solved(system, motion.u, loading, first, None, settings)
        found = equilibrium.balance
        rest = np.zeros_like(motion.v)
        after = BodyMotion(found.u, rest, rest, found.r if len(rest) else rest)
    else:
        if a == 0.0 and task.kink.size:
            inertia = inertia_of(system.masses, dynamics, motion, dt, held_motion(system, task, motion, (a, b), dt))
            kink = behind_kink(system, motion, _kinked(system, task), replace(loading, inertia=inertia))
            motion, task = kink.motion, replace(task, kink=np.empty(0))
            if kink.stops < 1.0:
                slips = _piece(system, task, replace(begin, motion=motion), (a, kink.stops * b), settings, last)
                task, begin = _onwards(system, task, slips), Departure(slips.motion, slips.balance.history)
                return _joined(slips, _piece(system, task, begin, (kink.stops * b, b), settings, last))
        held = held_motion(system, task, motion, (a, b), dt)
        motion = held.start(system, motion, dynamics.lumped)
        inertia = inertia_of(system.masses, dynamics, motion, dt, held)
        loading = replace(loading, inertia=inertia)
        moved = system.constraints.moved(motion.u, loading.target, system.interface.nodes)
        start = _carried(system, free_flight(dynamics, motion, dt), moved)
        equilibrium = solved(system, motion.u, loading, system.balance(start, loading, True), None, settings)
        found = equilibrium.balance
        after = motion_after(system, motion, found, inertia, dt)
        rubbing, heat = rubbed(system, motion.rubbing, found, dt, dt)
        after = with_its_energy(system, motion, after, found, loading, owes=last, heat=float(heat.sum()))
        after, more = brought_to_rest(system, replace(after, rubbing=rubbing), found, loading)
        heat = heat + more if more.size else heat

        def moduli(share: float) -> tuple[Moduli, ...]:
            drive = between(task.start, task.end, a + share * (b - a))
            return system.moduli(drive.T, drive.f_s)

        energy = made(system, motion, after, found, moduli, history, dt, float(heat.sum()))
    return StepResult(found, after, found.heat, equilibrium.iterations, equilibrium.residual, last=loading.step,
                      work=equilibrium.work, runs=equilibrium.runs, made=energy, rubbed=heat,
                      slid=way_of(found))


def way_of(found: ForceBalance) -> Floats:
    """Return how far slave nodes slipped, (n_q,) [m], (0,) without contact."""
    # fault: slip to and fro goes for none -> return np.empty(0) if found.tractions is None else found.tractions.slip |
    #   mechanical_fmu/test_slip_path
    return np.empty(0) if found.tractions is None else np.abs(found.tractions.slip)


def _onwards(system: System, task: Task, piece: StepResult) -> Task:
    """The task of the pieces that follow: contact remembers where this one went."""
    if task.query is None:
        return task
    # fault: contact forgets the way of the pieces before -> history = task.query.history | mechanical_fmu/test_kinks
    history = contact_history(system, piece.balance, task.query.history)
    return replace(task, query=replace(task.query, history=history, multipliers=history.multipliers))


def held_motion(system: System, task: Task, now: BodyMotion, span: tuple[float, float], dt: float) -> HeldMotion:
    """Compute how held components move in a piece of a step.  span : its shares of the step.  dt : of it [s]."""
    rows, motions = system.constraints.fixed, system.constraints.motions
    first, last = task.start.levels, task.end.levels
    # A jump is no velocity.
    # fault: what jumps is thrown -> behind = first | mechanical_fmu/test_held_motion
    behind = first + task.jump if task.jump.size else first

    def at(share: float) -> Floats:
        return motions.target(behind + share * (last - behind))

    (a, b), turns = span, any(p.turn is not None for p in motions.placed)
    # Along an arc the velocity at the end is not that of the chord: it is that of a last bit of the way.
    # fault: what is turned moves along its chords -> part = 1.0 | mechanical_fmu/test_held_motion
    part = LAST_BIT if turns else 1.0
    v = (at(b) - at(b - part * (b - a))) / (part * dt)
    u = motions.target(between(task.start, task.end, b).levels)
    return HeldMotion(rows, u, (v - now.v.ravel()[rows]) / dt)


def _kinked(system: System, task: Task) -> Floats:
    """(n_fixed,) [m/s] by which the velocity of prescribed components changes at the start of a step."""
    motions, levels = system.constraints.motions, task.start.levels
    dt = LAST_BIT * task.dt
    return (motions.target(levels + dt * task.kink) - motions.target(levels)) / dt


def _carried(system: System, flown: Floats, moved: Floats) -> Floats:
    """A first guess: free components fly on, driven bodies have moved; one that turns does so with all its nodes."""
    flies = system.constraints.free.reshape(-1, 2) > 0.0
    if system.constraints.turned_bodies.size:
        flies &= ~np.isin(system.constraints.node_body, system.constraints.turned_bodies)[:, None]
    guess = np.where(flies, flown, moved)
    return guess if system.rigid is None else system.rigid.placed(guess)


def _joined(first: StepResult, then: StepResult) -> StepResult:
    # fault: heat of all pieces of a step but the last forgotten -> heat = then.heat |
    #   mechanical_fmu/test_solution_methods
    heat = first.heat + then.heat if first.heat.size else then.heat
    balance, of, before = then.balance, then.balance.tractions, first.balance.tractions
    if of is not None and before is not None:
        balance = replace(balance, tractions=replace(of, slip=before.slip + of.slip,
                                                     E_friction=before.E_friction + of.E_friction))
    return StepResult(balance, then.motion, heat, first.iterations + then.iterations,
                      max(first.residual, then.residual), first.cuts + 1, then.dt_stable, then.last,
                      first.work + then.work, first.runs + then.runs, first.made + then.made,
                      first.rubbed + then.rubbed if first.rubbed.size else then.rubbed,
                      first.slid + then.slid if first.slid.size else then.slid)
