"""The elastic half: deformable and rigid bodies, large displacement, with contact.  Eqs. (14)-(16), (21), (23)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Discard, Done, Link, Value, Values
from contact.half.surfaces import History
from mechanical_fmu.advance import Found, PartWayError, Task, in_pieces, loading_of, predicted
from mechanical_fmu.asking import asking
from mechanical_fmu.augment import remembered, settle
from mechanical_fmu.drive import Drive, drive_of
from mechanical_fmu.dynamics import Motion, first_motion
from mechanical_fmu.elastic_face import Moved, elastic_variables, outputs_of
from mechanical_fmu.elastic_spec import parse_elastic
from mechanical_fmu.elastic_state import ElasticState
from mechanical_fmu.explicit import stable_step
from mechanical_fmu.material import MaterialRangeError
from mechanical_fmu.method_spec import METHODS
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, Settings
from mechanical_fmu.rest import resting
from mechanical_fmu.skip import expected_change, may_skip
from mechanical_fmu.system import Balance, Loading, System, system_of
from mechanical_fmu.tangent import MOST_SURFACE_DOFS, Anchor, refuse_unheld
from mechanical_fmu.volume import CellError, InvertedCellError

Floats = NDArray[np.float64]

# An old factor that needs more iterations than this in a step has had its time.
MOST_ANCHORED = 8
# Anchors kept: one in use, one that a rollback may return to.
KEPT_ANCHORS = 2
ISOTHERMAL, ADIABATIC = 0, 1


class ElasticHalf:
    """HalfModel of deformable bodies.  What is kept on the object can be rebuilt bit for bit from any state."""

    def __init__(self, system: System, settings: Settings) -> None:
        self.system, self.settings = system, settings
        self.variables = elastic_variables(system)
        self._anchors: dict[bytes, Anchor] = {}

    def start(self, inputs: Values, t: float, link: Link) -> tuple[ElasticState, Mapping[str, Value]]:
        """Equilibrium at t from the reference, all at once; with inertia, the reference itself and its velocity.

        Raises ArithmeticError where there is none, or nothing can hold a body.
        """
        system = self.system
        drive = drive_of(system, inputs, t, 1)
        history = system.contact.no_history(system.interface.nodes)
        u, none = np.zeros((system.volume.n_nodes, 2)), np.empty((0, 2))
        loading = self._loading(inputs, t, 1, history, link)
        motion = Motion(u, none, none, none)
        if system.spec.inert:
            at = system.constraints.moved(u, drive.target)
            at.ravel()[system.constraints.fixed] = drive.target
            balance = system.balance(at if system.rigid is None else system.rigid.placed(at), loading)
            dynamics = system.spec.dynamics
            motion = first_motion(system, balance, dynamics is None or dynamics.lumped)
            found = Found(balance, motion, balance.heat, 0, 0.0, dt_stable=self._dt_stable(balance, loading),
                          last=loading.step)
        else:
            refuse_unheld(system)
            settings = replace(self.settings, method=self._method(0))
            equilibrium = settle(system, loading, resting(system, u, loading), None, settings)
            found = replace(_found(equilibrium, motion), last=loading.step)
        now = found.balance
        state = ElasticState(t, now.u, remembered(system, now, history), now.u, drive.T, False, drive, t, now.history,
                             motion.v, motion.a, motion.f)
        return state, outputs_of(system, found, Moved(loading, u, loading.step.history, drive, False), state)

    def step(self, state: ElasticState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Equilibrium, or motion, at t + h."""
        method, mode = int(inputs.get("control.method", 0)), int(inputs.get("control.mode", ISOTHERMAL))
        if refusal := self._refusal(method, mode):
            return Discard(refusal)
        try:
            return self._step(state, inputs, t, h, link)
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
        frozen = u if int(inputs.get("control.mode", ISOTHERMAL)) == ADIABATIC else None
        task = Task(state.drive, drive, t + h - state.solved, asking(system, link, state.contact), frozen)
        loading = loading_of(system, task, 1.0, task.dt, _array(state.history))
        if method == "newton" and self._anchors_serve and frozen is None:
            found, after = self._anchored(state, task, loading)
        else:
            found = self._in_pieces(state, task, method)
            after = replace(state, anchor_u=found.balance.u, anchor_T=drive.T, anchored=False)
        motion = found.motion
        contact = remembered(system, found.balance, state.contact)
        after = replace(after, t=t + h, u=found.balance.u, contact=contact, drive=drive, solved=t + h,
                        history=found.balance.history, v=motion.v, a=motion.a, f=motion.f, skipped=0)
        moved = Moved(loading, u, _array(state.history), state.drive, frozen is not None)
        return Done(after, outputs_of(system, found, moved, after), found.dt_stable)

    def _loading(self, inputs: Values, t: float, side: int, history: History, link: Link) -> Loading:
        """The loading at t of points without a past."""
        drive = drive_of(self.system, inputs, t, side)
        task = Task(drive, drive, 0.0, asking(self.system, link, history), None)
        return loading_of(self.system, task, 1.0, 0.0, self.system.start_history())

    def _predicted(self, u: Floats, loading: Loading, tangent: bool = True) -> Balance:
        return predicted(self.system, u, loading, tangent)

    def _in_pieces(self, state: ElasticState, task: Task, method: str,
                   failed: ArithmeticError | None = None) -> Found:
        motion = Motion(_array(state.u), _array(state.v), _array(state.a), _array(state.f))
        settings = replace(self.settings, method=method)
        cuts = 0 if method == "explicit" else self.system.spec.cuts
        return in_pieces(self.system, task, (motion, _array(state.history)), settings, cuts, failed)

    @property
    def _anchors_serve(self) -> bool:
        """Whether one tangent may stand for those of many steps: elastic, at rest, no body that turns as a whole."""
        system = self.system
        return system.volume.elastic and system.rigid is None and not system.spec.inert

    def _anchored(self, state: ElasticState, task: Task, loading: Loading) -> tuple[Found, ElasticState]:
        """One solve with the anchor's factor where that serves; the step in pieces where one solve does not do."""
        anchor = self._anchor(state)
        try:
            first = self._predicted(_array(state.u), loading, tangent=not state.anchored)
            anchored = state.anchored or self._adopts(anchor, first)
            solved = self._solved(loading, first, anchor if anchored else None)
        except ArithmeticError as exc:
            if self.system.spec.cuts == 0 or isinstance(exc, MaterialRangeError):
                raise
            found = self._in_pieces(state, task, "newton", exc)
            return found, replace(state, anchor_u=found.balance.u, anchor_T=task.end.T, anchored=False)
        fits = anchored and not solved.fresh and solved.iterations <= MOST_ANCHORED
        after = replace(state, anchored=fits)
        if not fits:
            after = replace(after, anchor_u=solved.balance.u, anchor_T=task.end.T)
        return _found(solved, Motion(solved.balance.u, state.v, state.a, state.f)), after

    def _solved(self, loading: Loading, first: Balance, anchor: Anchor | None) -> Equilibrium:
        if anchor is not None:
            try:
                return settle(self.system, loading, first, anchor, self.settings)
            except (InvertedCellError, NoEquilibriumError):
                # An old tangent may lead astray where today's would not.
                pass
        return settle(self.system, loading, first, None, self.settings)

    def _adopts(self, anchor: Anchor, first: Balance) -> bool:
        """Whether the anchor's factor is worth keeping: the stiffness has hardly changed over a whole step."""
        if self.settings.adopt < 0.0 or self.system.contact.dofs.size > MOST_SURFACE_DOFS:
            return False
        assert first.entries is not None
        return anchor.drift(first.entries) <= self.settings.adopt

    def _method(self, number: int) -> str:
        return METHODS[number - 1] if number else self.system.spec.method

    def _refusal(self, method: int, mode: int) -> str:
        if not 0 <= method <= len(METHODS):
            return f"control.method {method} is none of 0 to {len(METHODS)}"
        if self._method(method) == "explicit" and not self.system.spec.inert:
            return "control.method explicit needs dynamics, or method explicit, in model.json"
        if mode not in (ISOTHERMAL, ADIABATIC):
            return f"control.mode {mode} is none of 0 (isothermal), 1 (adiabatic)"
        if mode == ADIABATIC and not self.system.spec.adiabatic:
            return 'control.mode 1 needs "adiabatic": true in model.json'
        return ""

    def _discard(self, exc: ArithmeticError, share: float, h: float) -> Discard:
        reached = f"; {share:.4g} of the step's change was reached" if share else ""
        if isinstance(exc, CellError):
            body = self.system.interface.bodies[exc.body]
            why = "would be turned inside out" if isinstance(exc, InvertedCellError) else f"fails: {exc.why}"
            return Discard(f"cell {exc.cell + 1} of body {body} {why}{reached}", h * max(0.25, share))
        suggest = 0.0 if isinstance(exc, MaterialRangeError) else h * (share or 0.5)
        return Discard(f"{exc}{reached}", suggest)

    def _skips(self, state: ElasticState, drive: Drive) -> bool:
        skip = self.system.spec.skip
        return (skip is not None and state.skipped < skip.most and may_skip(self.system)
                and expected_change(self.system, state.drive, drive, _array(state.u)) < skip.u)

    def _skipped_outputs(self, state: ElasticState) -> dict[str, Value]:
        out: dict[str, Value] = {"skipped": float(state.all_skipped), "iterations": 0.0, "cuts": 0.0,
                                 "max_strain_increment": 0.0}
        made: dict[str, Value] = {v.name: np.zeros(v.shape) for v in self.variables if v.name in ("E_M", "E_S")}
        made |= {v.name: 0.0 for v in self.variables if v.name.startswith("flow_rate.")}
        return out | made

    def _dt_stable(self, balance: Balance, loading: Loading) -> float:
        return stable_step(self.system, balance.u, loading) if self.system.spec.method == "explicit" else 0.0

    def _anchor(self, state: ElasticState) -> Anchor:
        # fault: an old factor used whatever the state says -> key = b"" | mechanical_fmu/test_elastic_contact
        key = state.anchor_u.tobytes() + state.anchor_T.tobytes()
        anchor = self._anchors.pop(key, None)
        if anchor is None:
            u, T = _array(state.anchor_u), _array(state.anchor_T)
            anchor = Anchor(self.system, u, self.system.moduli(T))
        self._anchors[key] = anchor
        while len(self._anchors) > KEPT_ANCHORS:
            del self._anchors[next(iter(self._anchors))]
        return anchor


def load(interface: Interface, model: Mapping[str, Any]) -> ElasticHalf:
    """The elastic half of an interface and a model.json.  Raises ValueError naming what is wrong."""
    spec = parse_elastic(interface, model)
    return ElasticHalf(system_of(interface, spec), Settings(spec.tolerance))


def _found(solved: Equilibrium, motion: Motion) -> Found:
    return Found(solved.balance, motion, solved.balance.heat, solved.iterations, solved.residual)


def _array(value: Any) -> Floats:
    """A private, writable copy: the kernels are compiled for such arrays, and states are read-only."""
    return np.array(value, dtype=np.float64, order="C")
