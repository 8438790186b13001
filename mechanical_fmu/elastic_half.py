"""The elastic half: deformable and rigid bodies, large displacement, with contact.  Eqs. (14)-(16), (21), (23)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Discard, Done, Link, Value, Values
from contact.half.program import ProgramError
from contact.half.volume import volume_mesh
from contact.problem.mechanical import Solution, Start
from mechanical_fmu.advance import (
    Departure,
    PartWayError,
    StepDrive,
    StepResult,
    Task,
    drive_of,
    expected_change,
    in_pieces,
    loading_of,
    may_skip,
    solved,
    way_of,
)
from mechanical_fmu.contact import slid
from mechanical_fmu.dynamics import BodyMotion, after_jump, first_motion, stable_step
from mechanical_fmu.elastic_face import elastic_variables, outputs_of
from mechanical_fmu.elastic_state import ElasticState, after_release
from mechanical_fmu.enforcement import contact_history, contact_query
from mechanical_fmu.given import ElasticMaterial, MechanicalVolume
from mechanical_fmu.heat import log_dilatation
from mechanical_fmu.material import MaterialRangeError, SolidMaterial
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, SolverSettings
from mechanical_fmu.predicting import predicted
from mechanical_fmu.problem import METHODS, parse_elastic, parse_foreign
from mechanical_fmu.program import MechanicalProgram
from mechanical_fmu.starting import started
from mechanical_fmu.stress_outputs import Moved
from mechanical_fmu.system import ForceBalance, Loading, System, system_of
from mechanical_fmu.tangent import MAX_SURFACE_DOFS, StiffnessAnchor, refuse_unheld
from mechanical_fmu.volume import CellError, CellInversionError
from mechanical_fmu.warm import Beginning, beginning

Floats = NDArray[np.float64]


# An old factor that needs more iterations than this in a step has had its time.
MAX_ANCHORED_ITERATIONS = 8
# What a motion by a table may be off by, of its way in a step, where it goes on with the slope it begins with.
STRAIGHT = 1e-6
# Anchors kept: one in use, one that a rollback may return to.
MAX_ANCHORS = 2
ISOTHERMAL, ADIABATIC = 0, 1


class ElasticHalf:
    """HalfModel of deformable bodies.  What is kept on the object can be rebuilt bit for bit from any state."""

    def __init__(self, system: System, settings: SolverSettings) -> None:
        self.system, self.settings = system, settings
        self.variables = elastic_variables(system)
        self._anchors: dict[bytes, StiffnessAnchor] = {}
        self._without: dict[tuple[int, ...], ElasticHalf] = {}

    def start(self, inputs: Values, t: float, link: Link) -> tuple[ElasticState, Mapping[str, Value]]:
        """Find the equilibrium at t, from the reference or where another run ended, at once, under loads before a jump.

        With inertia, the reference itself and its velocity.
        Raises ArithmeticError where there is none, or nothing can hold a body.
        """
        system = self.system
        # Inertia needs the force just after a jump, and nothing has moved by then.
        # fault: a jump at the start has happened before it -> side = 1 | coupler/test_load_at_the_start
        side = 1 if system.spec.stated.inert or system.spec.stated.start is Start.EQUILIBRIUM else -1
        drive = drive_of(system, inputs, t, side)
        begin, none = beginning(system), np.empty((0, 2))
        u, history = begin.u, begin.contact
        loading = self._loading(drive, begin, link)
        motion = BodyMotion(u, none, none, none)
        if system.spec.stated.inert:
            at = system.constraints.moved(u, loading.target, system.interface.nodes)
            at.ravel()[system.constraints.fixed] = loading.target
            balance = system.balance(at if system.rigid is None else system.rigid.placed(at), loading)
            dynamics = system.spec.dynamics
            motion = first_motion(system, balance, dynamics is None or dynamics.lumped)
            explicit = system.spec.stated.method is Solution.EXPLICIT
            found = StepResult(balance, motion, balance.heat, 0, 0.0, last=loading.step,
                               dt_stable=stable_step(system, balance.u, loading) if explicit else 0.0)
        elif begin.as_left:
            # Solved again, friction would be taken from points to nodes once more than in a run that goes on.
            balance = replace(system.balance(u, loading), history=begin.history)
            found = StepResult(balance, motion, balance.heat, 0, 0.0, last=loading.step)
        else:
            refuse_unheld(system)
            equilibrium = started(system, u, loading, replace(self.settings, method=self._method(0)))
            found = replace(_found(equilibrium, motion), last=loading.step)
        now = found.balance
        contact = begin.contact if begin.as_left else contact_history(system, now, history)
        state = ElasticState(t, now.u, contact, now.u, drive.T, False, drive, t, now.history, motion.v, motion.a,
                             motion.f, motion.push, motion.stored, motion.rubbing, damped=found.work,
                             slid=np.zeros(system.contact.pair_nodes.size if system.contact.slips else 0))
        outputs = outputs_of(system, found, Moved(loading, u, loading.step.history, drive, False, drive), state)
        return after_release(system, state, found.balance), outputs

    def step(self, state: ElasticState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Find the equilibrium, or the motion, at t + h."""
        method, mode = int(inputs.get("control.method", 0)), int(inputs.get("control.mode", ISOTHERMAL))
        if refusal := self._refusal(method, mode):
            return Discard(refusal)
        try:
            return self._of(state)._step(state, inputs, t, h, link)
        except PartWayError as exc:
            return self._discard(exc.cause, exc.share, h)
        except ArithmeticError as exc:
            return self._discard(exc, 0.0, h)

    def _step(self, state: ElasticState, inputs: Values, t: float, h: float, link: Link) -> Done:
        system = self.system
        # fault: jumps seen from the right -> drive = drive_of(system, inputs, t + h, 1) |
        #   mechanical_fmu/test_elastic_patch
        drive = drive_of(system, inputs, t + h, -1)
        if self._skips(state, drive):
            # fault: skipped steps measured from the last one, solved or not -> after = replace(state, t=t + h,
            #   drive=drive, skipped=state.skipped + 1, all_skipped=state.all_skipped + 1) |
            #   mechanical_fmu/test_solution_methods
            after = replace(state, t=t + h, skipped=state.skipped + 1, all_skipped=state.all_skipped + 1)
            return Done(after, self._skipped_outputs(after))
        method = self._method(int(inputs.get("control.method", 0)))
        u = _array(state.u)
        frozen = None
        if int(inputs.get("control.mode", ISOTHERMAL)) == ADIABATIC:
            frozen = log_dilatation(system, u, _array(state.history))
        task = Task(state.drive, drive, t + h - state.solved, contact_query(system, link, state.contact), frozen,
                    _array(state.handed) if len(state.handed) else None)
        if system.spec.stated.inert:
            before, behind = (drive_of(system, inputs, t, side) for side in (-1, 1))
            task = replace(task, jump=behind.levels - before.levels, kink=self._kink(inputs, t, behind, drive, h))
            state, task = self._behind_jump(state, task, behind)
        loading = loading_of(system, task, 1.0, task.dt, _array(state.history))
        if method == "newton" and self._anchors_serve and frozen is None:
            found, after = self._anchored(state, task, loading)
        else:
            found = self._in_pieces(state, task, method)
            after = replace(state, anchor_u=found.balance.u, anchor_T=drive.T, anchored=False)
            if not system.spec.stated.inert:
                # fault: no step knows how the one before went -> pass | mechanical_fmu/test_trend
                after = replace(after, trend=(found.balance.u - u) / task.dt)
        motion = found.motion
        contact = contact_history(system, found.balance, state.contact)
        after = replace(after, t=t + h, u=found.balance.u, contact=contact, drive=drive, solved=t + h,
                        history=found.balance.history, v=motion.v, a=motion.a, f=motion.f, push=motion.push,
                        stored=motion.stored, owed=motion.owed, rubbing=motion.rubbing, skipped=0,
                        damped=state.damped + found.work, made=state.made + found.made,
                        slid=slid(found.slid, _array(state.slid)))
        moved = Moved(loading, u, _array(state.history), state.drive, frozen is not None, drive)
        outputs = outputs_of(system, found, moved, after)
        return Done(after_release(system, after, found.balance), outputs, found.dt_stable)

    def _behind_jump(self, state: ElasticState, task: Task, now: StepDrive) -> tuple[ElasticState, Task]:
        """The state and the task of a step that begins with a jump of loads: forces and accelerations behind it.

        now : what acts from its start on; a signal that jumps there, or an input that is another one from there on.
        """
        before = state.drive
        # fault: a load that ends goes on for a part of the next step -> if True: | mechanical_fmu/test_jump_of_load
        if np.array_equal(before.pressure, now.pressure) and np.array_equal(before.dead, now.dead):
            return state, task
        system, dynamics, u = self.system, self.system.spec.dynamics, _array(state.u)
        added = (system.applied_at(u, now.pressure, now.dead) - system.applied_at(u, before.pressure, before.dead))
        motion = BodyMotion(u, _array(state.v), _array(state.a), _array(state.f))
        motion = after_jump(system, motion, added, dynamics is None or dynamics.lumped)
        start = replace(task.start, pressure=now.pressure, dead=now.dead)
        return replace(state, a=motion.a, f=motion.f), replace(task, start=start)

    def _kink(self, inputs: Values, t: float, behind: StepDrive, end: StepDrive, h: float) -> Floats:
        """By how much the slopes of the levels change at t, (n_levels,) [1/s], where they go on straight; else (0,)."""
        if not self.system.contact.slips:
            return np.empty(0)
        before, after = (self.system.constraints.motions.slopes(t, side, inputs) for side in (-1, 1))
        # Of several kinks in one step the first is none of those that the step sees.
        went, way = end.levels - behind.levels, h * after
        straight = np.allclose(went, way, rtol=STRAIGHT, atol=STRAIGHT * float(np.abs(way).max()))
        return after - before if straight and not np.array_equal(before, after) else np.empty(0)

    def _of(self, state: ElasticState) -> ElasticHalf:
        """The half in which what the state has released prescribes nothing."""
        if not state.released:
            return self
        if state.released not in self._without:
            self._without[state.released] = ElasticHalf(self.system.without(state.released), self.settings)
        return self._without[state.released]

    def _loading(self, drive: StepDrive, begin: Beginning, link: Link) -> Loading:
        """The loading of what a scene begins with."""
        task = Task(drive, drive, 0.0, contact_query(self.system, link, begin.contact), None)
        return loading_of(self.system, task, 1.0, 0.0, begin.history)

    def _in_pieces(self, state: ElasticState, task: Task, method: str,
                   failed: ArithmeticError | None = None) -> StepResult:
        motion = BodyMotion(_array(state.u), _array(state.v), _array(state.a), _array(state.f), _array(state.push),
                            state.stored, state.rubbing, state.owed)
        settings = replace(self.settings, method=method)
        cuts = 0 if method == "explicit" else self.system.spec.stated.cuts
        begin = Departure(motion, _array(state.history), _array(state.trend))
        return in_pieces(self.system, task, begin, settings, cuts, failed)

    @property
    def _anchors_serve(self) -> bool:
        """Whether one tangent may stand for those of many steps: elastic, at rest, no body that turns as a whole."""
        system = self.system
        return system.volume.elastic and system.rigid is None and not system.spec.stated.inert

    def _anchored(self, state: ElasticState, task: Task, loading: Loading) -> tuple[StepResult, ElasticState]:
        """One solve with the anchor's factor where that serves; the step in pieces where one solve does not do."""
        anchor = self._anchor(state)
        try:
            first = predicted(self.system, _array(state.u), loading, tangent=not state.anchored)
            anchored = state.anchored or self._adopts(anchor, first)
            now = self._solved(state, loading, first, anchor if anchored else None)
        except ArithmeticError as exc:
            if self.system.spec.stated.cuts == 0 or isinstance(exc, MaterialRangeError | ProgramError):
                raise
            found = self._in_pieces(state, task, "newton", exc)
            return found, replace(state, anchor_u=found.balance.u, anchor_T=task.end.T, anchored=False)
        fits = anchored and not now.fresh and now.iterations <= MAX_ANCHORED_ITERATIONS
        after = replace(state, anchored=fits)
        if not fits:
            after = replace(after, anchor_u=now.balance.u, anchor_T=task.end.T)
        return _found(now, BodyMotion(now.balance.u, state.v, state.a, state.f)), after

    def _solved(self, state: ElasticState, loading: Loading, first: ForceBalance,
                anchor: StiffnessAnchor | None) -> Equilibrium:
        u = _array(state.u)
        if anchor is not None:
            try:
                return solved(self.system, u, loading, first, anchor, self.settings)
            except (CellInversionError, NoEquilibriumError):
                # An old tangent may lead astray where today's would not.
                pass
        return solved(self.system, u, loading, first, None, self.settings)

    def _adopts(self, anchor: StiffnessAnchor, first: ForceBalance) -> bool:
        """Whether the anchor's factor is worth keeping: the stiffness has hardly changed over a whole step."""
        if self.settings.adopt < 0.0 or self.system.contact.dofs.size > MAX_SURFACE_DOFS:
            return False
        assert first.entries is not None
        return anchor.drift(first.entries) <= self.settings.adopt

    def _method(self, number: int) -> str:
        return METHODS[number - 1] if number else self.system.spec.stated.method.value

    def _refusal(self, method: int, mode: int) -> str:
        if not 0 <= method <= len(METHODS):
            return f"control.method {method} is none of 0 to {len(METHODS)}"
        if self._method(method) == "explicit" and not self.system.spec.stated.inert:
            return "control.method explicit needs dynamics, or method explicit, in model.json"
        # fault: pressures that settle are pressed by their penalty in explicit steps, unsaid -> if (settle := {}): |
        #   mechanical_fmu/test_solution_dynamics::test_explicit_steps_refuse_pressures_that_settle
        if self._method(method) == "explicit" and (settle := self.system.spec.augmented):
            return ("control.method explicit finds no equilibrium in which pressures settle: pairs."
                    f"{next(iter(settle))} must not be augmented in model.json")
        if mode not in (ISOTHERMAL, ADIABATIC):
            return f"control.mode {mode} is none of 0 (isothermal), 1 (adiabatic)"
        if mode == ADIABATIC and not self.system.spec.stated.adiabatic:
            return 'control.mode 1 needs "adiabatic": true in model.json'
        return ""

    def _discard(self, exc: ArithmeticError, share: float, h: float) -> Discard:
        reached = f"; {share:.4g} of the step's change was reached" if share else ""
        if isinstance(exc, CellError):
            body = self.system.interface.bodies[exc.body]
            why = "would be turned inside out" if isinstance(exc, CellInversionError) else f"fails: {exc.why}"
            return Discard(f"cell {exc.cell + 1} of body {body} {why}{reached}", h * max(0.25, share))
        # A program would fail again: a step as long as this one says that no shorter one helps.
        again = h if isinstance(exc, ProgramError) else h * (share or 0.5)
        suggest = 0.0 if isinstance(exc, MaterialRangeError) else again
        return Discard(f"{exc}{reached}", suggest)

    def _skips(self, state: ElasticState, drive: StepDrive) -> bool:
        skip = self.system.spec.stated.skip
        return (skip is not None and not len(state.handed) and state.skipped < skip.most and may_skip(self.system)
                and expected_change(self.system, state.drive, drive, _array(state.u)) < skip.u)

    def _skipped_outputs(self, state: ElasticState) -> dict[str, Value]:
        out: dict[str, Value] = {"skipped": float(state.all_skipped), "iterations": 0.0, "cuts": 0.0,
                                 "max_strain_increment": 0.0}
        # fault: what a step rubbed is told again by those that are skipped -> of_the_step = ("E_M", "E_S") |
        #   mechanical_fmu/test_slip_path
        of_the_step = ("E_M", "E_S", "contact.E_friction", "contact.slip")
        made: dict[str, Value] = {v.name: np.zeros(v.shape) for v in self.variables if v.name in of_the_step}
        made |= {v.name: 0.0 for v in self.variables if v.name.startswith("flow_rate.")}
        made |= {v.name: 0.0 for v in self.variables if v.name == "program.runs"}
        made |= {v.name: state.damped for v in self.variables if v.name == "work.stabilisation"}
        return out | made

    def _anchor(self, state: ElasticState) -> StiffnessAnchor:
        # fault: an old factor used whatever the state says -> key = b"" | mechanical_fmu/test_elastic_contact
        key = state.anchor_u.tobytes() + state.anchor_T.tobytes()
        anchor = self._anchors.pop(key, None)
        if anchor is None:
            u, T = _array(state.anchor_u), _array(state.anchor_T)
            anchor = StiffnessAnchor(self.system, u, self.system.moduli(T))
        self._anchors[key] = anchor
        while len(self._anchors) > MAX_ANCHORS:
            del self._anchors[next(iter(self._anchors))]
        return anchor


def load(interface: Interface, model: Mapping[str, Any]) -> ElasticHalf:
    """Make the elastic half of an interface and a model.json.  Raises ValueError naming what is wrong."""
    spec = parse_elastic(interface, model)
    system = system_of(interface, spec)
    beginning(system)  # what does not fit is told before anything runs
    return ElasticHalf(system, SolverSettings(spec.stated.tolerance))


def mechanical_half(volume: MechanicalVolume, interface: Interface, model: Mapping[str, Any]) -> ElasticHalf:
    """Make the elastic half of an interface and a model.json, with the inside of its bodies by `volume`.

    Raises ValueError naming what is wrong.
    """
    spec = parse_foreign(interface, model)
    volume.start(volume_mesh(interface), tuple(_told(spec.materials[m]) for m in spec.part_material))
    system = system_of(interface, spec, volume)
    beginning(system)
    return ElasticHalf(system, SolverSettings(spec.stated.tolerance))


def mechanical_program_half(program: MechanicalProgram, interface: Interface, model: Mapping[str, Any]) -> ElasticHalf:
    """Make the elastic half of an interface and a model.json, with the inside of its bodies by a program.

    Raises ValueError naming what is wrong.
    """
    spec = parse_foreign(interface, model)
    system = replace(system_of(interface, spec), program=program)
    if spec.dynamics is not None:
        raise ValueError("mechanical.elastic.dynamics: a program finds equilibria; choose the half elastic")
    if program.takes == "force" and system.can_be_loose:
        raise ValueError("contact alone holds a body: a program that is given forces there cannot hold it. Prescribe "
                         "a displacement of the body, or let the program take displacements")
    program.start(volume_mesh(interface), tuple(_told(spec.materials[m]) for m in spec.part_material))
    beginning(system)
    return ElasticHalf(system, SolverSettings(spec.stated.tolerance))


def _told(material: SolidMaterial) -> ElasticMaterial:
    return ElasticMaterial(material.E, material.nu, material.alpha, material.T_ref)


def _found(solved: Equilibrium, motion: BodyMotion) -> StepResult:
    return StepResult(solved.balance, motion, solved.balance.heat, solved.iterations, solved.residual, work=solved.work,
                      runs=solved.runs, slid=way_of(solved.balance))


def _array(value: Any) -> Floats:
    """A private, writable copy: the kernels are compiled for such arrays, and states are read-only."""
    return np.array(value, dtype=np.float64, order="C")
