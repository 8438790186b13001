"""One window: both halves from t to t + H by a scheme.  Values in, values out; a failed window leaves no trace."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from coupler.account import HEATS, Accounts, after_window, share_of
from coupler.clock import Clock
from coupler.half import Advance, Half, Status
from coupler.ledger import PREFIX
from coupler.level import Level, Scheme, between, geometry_at

Array = NDArray[np.float64]


class Verdict(Enum):
    """What became of a window; never overwritten."""

    ACCEPTED = "accepted"
    THERMAL_DISCARD = "thermal discard"
    MECHANICAL_DISCARD = "mechanical discard"


@dataclass(frozen=True)
class Work:
    """What a window cost: half-solves (the hardware-free unit), iterations, and seconds."""

    thermal_solves: int = 0
    mechanical_solves: int = 0
    thermal_iterations: int = 0
    mechanical_iterations: int = 0
    thermal_seconds: float = 0.0
    mechanical_seconds: float = 0.0
    fmi_seconds: float = 0.0  # calls to the halves less the seconds inside them: FMI and transport
    values: int = 0  # real numbers that crossed a border

    def plus(self, other: Work) -> Work:
        """The sum of two."""
        return Work(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


@dataclass(frozen=True)
class CoupledState:
    """Everything the coupler remembers between windows.

    now, before : the exchange at the end of the last window and of the one before it (None after an event).
    events : the count that tells a half to restart damped.  accounts : block -> heat made and delivered.
    sent : what each half was last given, so that a block which did not change is not sent again.
    """

    now: Level
    before: Level | None
    events: int
    accounts: Accounts
    sent: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)


@dataclass(frozen=True)
class Solved:
    """The outcome of a window.  terms : the heat terms of each thermal substep [J] (empty after a discard)."""

    verdict: Verdict
    message: str
    state: CoupledState
    terms: tuple[Mapping[str, float], ...]
    work: Work
    monitors: Mapping[str, float]


@dataclass(frozen=True)
class Halves:
    """The two halves of a run and what is asked of each after a substep."""

    thermal: Half
    mechanical: Half
    thermal_outputs: tuple[str, ...]
    mechanical_outputs: tuple[str, ...]


def wanted_outputs(thermal: Half, mechanical: Half) -> Halves:
    """Which outputs to ask for, from what the halves have."""
    t = [n for n, b in thermal.blocks.items() if b.causality == "output" and b.kind == "Real"
         and (n.startswith(PREFIX) or n in ("T", "iterations", "contact.touching")
              or (n == "f_s" and _takes(mechanical, n)))]
    wanted = ("x", "contact.t_N", "contact.gap", "contact.covered", *HEATS, "iterations", "contact.touching")
    m = [n for n in wanted if n in mechanical.blocks and mechanical.blocks[n].causality == "output"]
    return Halves(thermal, mechanical, tuple(t), tuple(m))


def _takes(half: Half, name: str) -> bool:
    return name in half.blocks and half.blocks[name].causality == "input"


class _DiscardError(Exception):
    """A half could not do its substep."""

    def __init__(self, verdict: Verdict, message: str) -> None:
        super().__init__(message)
        self.verdict = verdict


@dataclass(frozen=True)
class _Call:
    """One substep asked of a half: who, from when to when, with which inputs."""

    half: Half
    side: str
    t0: float
    t1: float
    inputs: Mapping[str, Array]
    outputs: tuple[str, ...]


def solve_window(halves: Halves, state: CoupledState, clock: Clock, k0: int, k1: int, scheme: Scheme,
                 substeps: Mapping[str, int]) -> Solved:
    """Solve the window of ticks [k0, k1], thermal half first.

    substeps : {"thermal": n, "mechanical": m}.  After a discard the halves are where the discard left them:
    the caller restores what it saved.
    """
    work = Work()
    try:
        thermal = _thermal(halves, state, _substep_times(clock, k0, k1, substeps["thermal"]), scheme)
        work = work.plus(thermal.work)
        mechanical = _mechanical(halves, replace(state, sent=thermal.sent), thermal.outputs,
                                 _substep_times(clock, k0, k1, substeps["mechanical"]))
        work = work.plus(mechanical.work)
    except _DiscardError as discard:
        return Solved(discard.verdict, str(discard), state, (), work, {})
    out = mechanical.outputs
    n_s = len(state.now.t_N)
    now = Level(clock.seconds(k1), thermal.outputs["T"], out["x"], out.get("contact.t_N", np.zeros(n_s)),
                out.get("contact.gap", state.now.gap), out.get("contact.covered", state.now.covered),
                thermal.outputs.get("f_s"))
    accounts = after_window(state.accounts, halves.thermal.blocks, mechanical.made)
    new = CoupledState(now, state.now, state.events, accounts, mechanical.sent)
    monitors = {"touching": float(out.get("contact.touching", np.zeros(()))),
                "max_T": float(now.T.max()), "max_p": float(-now.t_N.min(initial=0.0))}
    return Solved(Verdict.ACCEPTED, "", new, thermal.terms, work, monitors)


@dataclass(frozen=True)
class _Pass:
    """A half taken over a whole window.  made : block -> energies the mechanical half made in it [J]."""

    outputs: Mapping[str, Array]
    sent: Mapping[str, Mapping[str, Array]]
    work: Work
    terms: tuple[Mapping[str, float], ...] = ()
    made: Mapping[str, Array] = field(default_factory=dict)


def _substep_times(clock: Clock, k0: int, k1: int, n: int) -> list[float]:
    return [clock.seconds(k0 + (k1 - k0) * i // n) for i in range(n + 1)]


def _thermal(halves: Halves, state: CoupledState, times: list[float], scheme: Scheme) -> _Pass:
    """The thermal half over the window, given the carried heat: spread evenly in time, the entropy part at once."""
    H, sent, work, terms = times[-1] - times[0], state.sent, Work(), []
    outputs: Mapping[str, Array] = {}
    for t0, t1 in pairwise(times):
        x, t_N = geometry_at(scheme, state.now, state.before, 0.5 * (t0 + t1))
        inputs = {"x": x, "contact.t_N": t_N, **share_of(state.accounts, (t1 - t0) / H, t0 == times[0]),
                  "control.event": np.array(float(state.events))}
        call = _Call(halves.thermal, "thermal", t0, t1, inputs, halves.thermal_outputs)
        outputs, sent, cost = _advance(call, sent, Verdict.THERMAL_DISCARD)
        work = work.plus(cost)
        terms.append({n: float(v) for n, v in outputs.items() if n.startswith(PREFIX)})
    return _Pass(outputs, sent, work, tuple(terms))


def _mechanical(halves: Halves, state: CoupledState, thermal: Mapping[str, Array], times: list[float]) -> _Pass:
    """The mechanical half over the window, T and f_s interpolated to the end of each of its substeps."""
    H, sent, work = times[-1] - times[0], state.sent, Work()
    outputs: Mapping[str, Array] = {}
    made: dict[str, Array] = {}
    for t0, t1 in pairwise(times):
        inputs = {**between(state.now, thermal, (t1 - times[0]) / H if t1 != times[-1] else 1.0),
                  "control.event": np.array(float(state.events))}
        call = _Call(halves.mechanical, "mechanical", t0, t1, inputs, halves.mechanical_outputs)
        outputs, sent, cost = _advance(call, sent, Verdict.MECHANICAL_DISCARD)
        work = work.plus(cost)
        for name in HEATS.keys() & outputs.keys():
            made[name] = made[name] + outputs[name] if name in made else outputs[name]
    return _Pass(outputs, sent, work, made=made)


def _advance(call: _Call, sent: Mapping[str, Mapping[str, Array]],
             verdict: Verdict) -> tuple[Mapping[str, Array], Mapping[str, Mapping[str, Array]], Work]:
    """One substep of one half; raises _DiscardError."""
    half, known = call.half, sent.get(call.side, {})
    fits = {n: v for n, v in call.inputs.items() if n in half.blocks and half.blocks[n].causality == "input"}
    news = {n: v for n, v in fits.items() if not _same(known.get(n), v)}
    started = time.perf_counter()
    answer: Advance = half.advance(call.t0, call.t1 - call.t0, news, call.outputs)
    seconds = time.perf_counter() - started
    if answer.status is not Status.OK:
        raise _DiscardError(verdict, f"{half.name}: {answer.message}")
    iterations = int(answer.outputs.get("iterations", np.zeros(())))
    values = sum([v.size for v in news.values()]) + sum([v.size for v in answer.outputs.values()])
    fmi = seconds - answer.seconds
    if call.side == "thermal":
        cost = Work(thermal_solves=1, thermal_iterations=iterations, thermal_seconds=answer.seconds,
                    fmi_seconds=fmi, values=values)
    else:
        cost = Work(mechanical_solves=1, mechanical_iterations=iterations, mechanical_seconds=answer.seconds,
                    fmi_seconds=fmi, values=values)
    return answer.outputs, {**sent, call.side: {**known, **news}}, cost


def _same(a: Array | None, b: Array) -> bool:
    return a is not None and (a is b or np.array_equal(a, b))
