"""Monitors: what rules look at and a user is shown, by name, of a window that was tried."""

from __future__ import annotations

import math

from coupler.control.error_estimate import Estimate
from coupler.control.state import ControlState
from coupler.schemes.state import PREFIX, Ledger, Solved, Span
from coupler.schemes.sweep import OF_A_SUBSTEP


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
            found |= {f"{name}.{n}": v for n, v in parts.items()}
    ledger = Ledger()
    for terms in solved.terms:
        ledger = ledger.plus({n: v for n, v in terms.items() if n.startswith(PREFIX)})
    return found | {"imbalance": ledger.imbalance}


def failed_monitors(control: ControlState, span: Span, solved: Solved) -> dict[str, float]:
    """Of a window that failed.  t : where it begins.  failures : with this one.  SIDE.status : 1 where it gave up."""
    t = span.clock.seconds(span.k0)
    gave_up = solved.verdict.value.removesuffix(" discard")
    return {"t": t, "window": span.end - t, "number": float(control.number + 1),
            "failures": float(control.failures + 1), "thermal.status": float(gave_up == "thermal"),
            "mechanical.status": float(gave_up == "mechanical"),
            **({"iterations": float(len(solved.history.misfits))} if solved.history else {})}
