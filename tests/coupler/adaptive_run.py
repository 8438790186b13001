"""Case E8 (a lumped body and the gap its shrinkage opens) in windows that find their own size."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from coupled_run import start
from fake_halves import FakeHalf, gap_of, lumped, shrinking

from coupler.control.loop import Plan, Tried, windows
from coupler.scenario.options import Adaptive, Scheme, WindowRange
from coupler.schemes.ledger import Ledger
from coupler.schemes.schedule import schedule
from coupler.schemes.state import wanted_outputs

END = 20.0
EXACT_E8 = 831.7186022526  # K, verification.md E8
SIZES = Adaptive(first=0.05, least=1e-6, most=END)


def plan_to(end: float = END, kinks: Iterable[float] = (), scheme: Scheme = Scheme.ITERATED, **more: Any) -> Plan:
    """Windows that find their own size to `end` [s]; more : fields of Plan."""
    fields = {"adaptive": SIZES} | more
    return Plan(schedule(end, [WindowRange(end, end, end)], kinks), scheme, {"thermal": 1, "mechanical": 1}, **fields)


def tries(plan: Plan, thermal: FakeHalf | None = None, mechanical: FakeHalf | None = None) -> list[Tried]:
    """Every window tried from 840 K."""
    halves = wanted_outputs(thermal or lumped(840.0), mechanical or shrinking(840.0))
    return list(windows(halves, start(840.0, gap_of(840.0)), plan))


def ledger_of(tried: list[Tried]) -> Ledger:
    """Over the windows taken."""
    ledger = Ledger()
    for terms in (terms for w in tried if w.accepted for terms in w.solved.terms):
        ledger = ledger.plus(terms)
    return ledger
