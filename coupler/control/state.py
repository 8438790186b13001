"""What control remembers between windows: with the coupled state all that a run is, beside its two halves."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from coupler.control import auto, error_estimate, events, step_size, two_cycle
from coupler.control.plan import Plan
from coupler.control.two_cycle import home
from coupler.rules import engine as rules
from coupler.schemes.state import CoupledState, Settings


@dataclass(frozen=True)
class ControlState:
    """Put back with a window that is rejected, but for what the next try needs: size, ends, aim, below, failures.

    tick : where the last window ended.  number : windows taken.  failures : tries rejected since then.
    size : the next window [s] where windows find their own size, with the reason in words.
    ends : ticks at which the pieces of a window cut in two end, the next last.
    aim : the tick at which the next try ends, whatever its size; 0: none.
    below : the next try ends before this tick; 0: anywhere.  fresh : the tick where histories were last forgotten.
    event : the tick of the last event found; 0: none.  slow : windows on end in which hardly anything changed.
    stop : why the run ends here; "": it goes on.
    """

    settings: Settings
    tick: int = 0
    number: int = 0
    failures: int = 0
    size: float = 0.0
    reason: str = ""
    ends: tuple[int, ...] = ()
    aim: int = 0
    below: int = 0
    fresh: int = 0
    event: int = 0
    slow: int = 0
    stop: str = ""
    cycle: two_cycle.Watch = field(default_factory=two_cycle.Watch)
    estimate: error_estimate.Memory = field(default_factory=error_estimate.Memory)
    controller: step_size.Memory = field(default_factory=step_size.Memory)
    choice: auto.Memory = field(default_factory=auto.Memory)
    rules: rules.Memory = field(default_factory=rules.Memory)
    events: events.Memory = field(default_factory=events.Memory)


@dataclass(frozen=True)
class Committed:
    """All the coupler remembers after a window.  With the states of both halves the run can go on from here."""

    state: CoupledState
    control: ControlState


def first(state: CoupledState, plan: Plan) -> Committed:
    """Before the first window."""
    size = plan.adaptive.first if plan.adaptive is not None else 0.0
    memory = rules.Memory()
    if plan.rules:
        memory = rules.first_memory(plan.rules, {"t": state.now.t, **plan.probed(state.now)})
    return Committed(state, ControlState(rules.first_settings(plan.rules, plan.settings), size=size,
                                         reason="the first" if size else "", rules=memory))


def opened(at: Committed, plan: Plan) -> Committed:
    """With the histories forgotten where the next window begins at a kink or an event; once, however often it is tried.

    Halves restart damped there, but not where only thermal data bend.
    """
    state, control, k = at.state, at.control, at.control.tick
    if k == control.fresh or (k not in plan.schedule.kinks and k != control.event):
        return at
    damped = k in plan.schedule.events or k == control.event
    # fault: halves restart damped where thermal data only bend -> state = replace(state, past=(), memory=(),
    #   events=state.events + 1) | coupler/test_coupling
    state = replace(state, past=(), memory=(), events=state.events + damped)
    if k in plan.schedule.kinks:
        # Not where contact opens and closes by turns: that may be the cycle itself.
        # fault: halved windows stay halved past a kink -> control = replace(control, cycle=two_cycle.Watch()) |
        #   coupler/test_cycle_action
        control = replace(control, cycle=two_cycle.Watch(), settings=home(control.cycle, control.settings))
    control = replace(control, fresh=k, estimate=error_estimate.forgotten(control.estimate),
                      controller=step_size.forgotten(control.controller), choice=auto.forgotten(control.choice),
                      events=events.forgotten(control.events))
    if plan.adaptive is not None and damped and control.size > plan.adaptive.first:
        control = replace(control, size=plan.adaptive.first, reason="the first after a kink or an event")
    return Committed(state, control)
