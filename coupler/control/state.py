"""What control remembers between windows, with the coupled state all that a run is; the monitors of a window."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from coupler.control import auto, error_estimate, events, flutter, quantities, spare, two_cycle, window_size
from coupler.control.error_estimate import Estimate
from coupler.control.plan import Plan
from coupler.control.two_cycle import home
from coupler.rules import engine as rules
from coupler.schemes.ledger import Ledger
from coupler.schemes.state import CoupledState, Settings, Solved, Span
from coupler.schemes.sweep import OF_A_SUBSTEP
from coupler.trust.surfaces.courses import Course


@dataclass(frozen=True)
class Obstacle:
    """What mechanics gave up on the way to.  first [s] : where the first window began that did not get there.

    end [s] : the earliest time that none of them reached.  tries : how many they were.
    """

    first: float
    end: float
    tries: int


@dataclass(frozen=True)
class ControlState:
    """Put back with a window that is rejected, but for what the next try needs: size, ends, aim, below, failures.

    tick : where the last window ended.  number : windows taken.  failures : tries rejected since then.
    size : the next window [s] where windows are adaptive, with the reason in words.
    ends : ticks at which the pieces of a window cut in two end, the next last.
    aim : the tick at which the next try ends, whatever its size; 0: none.
    below : the next try ends before this tick; 0: anywhere.  fresh : the tick where histories were last forgotten.
    event : the tick of the last event found; 0: none.  slow : windows on end in which hardly anything changed.
    unconverged : a try of this window, or the window before it, was iterated to no end.
    course : how bodies go that forces move.
    stop : why the run ends here; "": it goes on.  obstacle : that no window got past so far.
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
    unconverged: bool = False
    stop: str = ""
    obstacle: Obstacle | None = None
    cycle: two_cycle.Watch = field(default_factory=two_cycle.Watch)
    estimate: error_estimate.Memory = field(default_factory=error_estimate.Memory)
    controller: window_size.Memory = field(default_factory=window_size.Memory)
    choice: auto.Memory = field(default_factory=auto.Memory)
    rules: rules.Memory = field(default_factory=rules.Memory)
    events: events.Memory = field(default_factory=events.Memory)
    spare: spare.Memory = field(default_factory=spare.Memory)
    flutter: flutter.Memory = field(default_factory=flutter.Memory)
    course: Course = field(default_factory=Course)


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
                                         reason="the first" if size else "", rules=memory,
                                         spare=spare.first(plan, state),
                                         course=Course() if plan.ways is None else plan.ways.begun()))


def opened(at: Committed, plan: Plan) -> Committed:
    """With the histories forgotten where the next window begins at a breakpoint or an event; once per window end.

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
                      controller=window_size.forgotten(control.controller), choice=auto.forgotten(control.choice),
                      events=events.forgotten(control.events))
    if plan.adaptive is not None and damped and control.size > plan.adaptive.first:
        control = replace(control, size=plan.adaptive.first, reason="the first after a breakpoint or an event")
    return Committed(state, control)


# Monitors: what rules look at and a user is shown, by name, of a window that was tried.

def monitors(control: ControlState, span: Span, solved: Solved, error: Estimate | None = None) -> dict[str, float]:
    """Name -> value, SI.  control : before the window.

    t : where it ends.  window : its size [s].  number : of it, from 1.  failures : tries rejected before it.
    iterations, contraction : of the exchange; contraction is missing where it is not known.  error, error.QUANTITY,
    splitting.QUANTITY, own.QUANTITY : in tolerances, where known.  imbalance : of its heat.  max_T, max_p, touching.
    thermal.NAME, mechanical.NAME : scalars the halves told; iterations are sums over the window.  Where it was solved
    in two halves too, all that depends on the length of a step is of the window in one: a rule means the same then.
    """
    # fault: monitors of a window solved in two halves too are of its second half -> one = solved | coupler/test_rules
    one = solved.whole or solved
    history, work = one.history, one.work
    found = {"t": span.end, "window": span.end - span.clock.seconds(span.k0), "number": float(control.number + 1),
             "failures": float(control.failures), "iterations": float(len(history.misfits)) if history else 1.0,
             **solved.monitors,
             **{n: v for n, v in one.monitors.items() if n.partition(".")[2].startswith(OF_A_SUBSTEP)},
             "thermal.iterations": float(work.thermal_iterations),
             "mechanical.iterations": float(work.mechanical_iterations)}
    if history is not None and not math.isnan(history.contraction):
        found["contraction"] = history.contraction
    if "mechanical.contact.slipping" in found:
        found["slipping"] = found["mechanical.contact.slipping"]
    if error is not None:
        found["error"] = error.error
        for name, parts in (("error", error.shares), ("splitting", error.splitting), ("own", error.own)):
            of_all = {q: error.largest(parts, q) for q in quantities.QUANTITIES}
            found |= {f"{name}.{q}": v for q, v in of_all.items() if v is not None}
    ledger = Ledger().after(solved.terms)
    return found | {"imbalance": ledger.imbalance}


def failed_monitors(control: ControlState, span: Span, solved: Solved) -> dict[str, float]:
    """Of a window that failed.  t : where it begins.  failures : with this one.  SIDE.status : 1 where it gave up."""
    t = span.clock.seconds(span.k0)
    gave_up = solved.verdict.value.removesuffix(" discard")
    return {"t": t, "window": span.end - t, "number": float(control.number + 1),
            "failures": float(control.failures + 1), "thermal.status": float(gave_up == "thermal"),
            "mechanical.status": float(gave_up == "mechanical"),
            **({"iterations": float(len(solved.history.misfits))} if solved.history else {})}
