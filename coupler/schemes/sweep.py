"""Both halves over a window once, in either order: each substep by substep, on what a scheme gives it of the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Advance, Answer, Half, Status, begin, seconds_of
from coupler.scenario.options import Scheme
from coupler.schemes.accounts import HEATS, Accounts, EnergyAccount, Foreseen, delivered, due, share_of, with_made
from coupler.schemes.ledger import NO_TERMS, PREFIX
from coupler.schemes.levels import Level, Slope, between, exchanged, geometry_at
from coupler.schemes.state import (
    ACROSS,
    ELASTIC_STRAIN,
    NO_WORK,
    CoupledState,
    Halves,
    IterationHistory,
    Solved,
    Span,
    Verdict,
    Work,
)

Array = NDArray[np.float64]
Sent = Mapping[str, Mapping[str, Array]]
STORED = PREFIX + "stored."

# Forces and motions of a body: blocks of so many values are told value by value.
FEW = 3
# Outputs of which a window has the largest of its substeps.
OF_A_SUBSTEP = ("max_", "cuts", "substeps", "rejected", "residual", "iterations", ACROSS)


class DiscardError(Exception):
    """A half could not do its substep.  work : what the whole passes before it cost.

    final : whether the half says that no shorter substep would do.  share : of the pass that it says would; 0: it says
    nothing.
    """

    def __init__(self, verdict: Verdict, message: str, work: Work, final: bool = False, share: float = 0.0) -> None:
        super().__init__(message)
        self.verdict = verdict
        self.work = work
        self.final = final
        self.share = share


def _is_final(answer: Advance, h: float) -> bool:
    """Whether a half that could not do a substep of h [s] suggests none that is shorter."""
    return answer.dt_suggest >= h * (1.0 - 1e-9)


def _share(answer: Advance, t: float, times: Sequence[float]) -> float:
    """The share of a pass over these times [s] up to where a half that gave up at t says that it can go; 0: nowhere."""
    reached = t - times[0] + answer.dt_suggest
    return min(reached / (times[-1] - times[0]), 1.0) if answer.dt_suggest > 0.0 else 0.0


@dataclass(frozen=True)
class Pass:
    """A half taken over a window.  side : thermal or mechanical.  outputs : at its end.

    work : of this pass and of those before it in the window.
    terms : the heat terms of each thermal substep [J].  made : block -> energies the mechanical half made [J].
    told : every other number it was asked for (NAME, NAME[1]).  accounts : of heat, after a thermal pass.
    """

    side: str
    outputs: Mapping[str, Array]
    sent: Sent
    work: Work
    terms: tuple[Mapping[str, float], ...] = ()
    made: Mapping[str, Array] = field(default_factory=dict)
    told: Mapping[str, float] = field(default_factory=dict)
    accounts: Accounts = field(default_factory=dict)


@dataclass(frozen=True)
class _Call:
    """One substep asked of a half: who, from when to when, with which inputs."""

    half: Half
    side: str
    t0: float
    t1: float
    inputs: Mapping[str, Array]
    outputs: tuple[str, ...]


# An answer, what the half has been sent then, and what it cost.
Stepped = tuple[Advance, Sent, Work]
# A half on its way over a window, substep by substep, each begun when it is given out.
Substeps = Generator[Callable[[], Stepped], Stepped, Pass]


class Leading(Protocol):
    """What tells x and t_N of a substep from the heat stored so far (coupler.schemes.schemes)."""

    def seen(self, t0: float, t1: float, stored: Array, rate: Array | None) -> tuple[Array, Array]:
        """Return x (n_nodes, 2) [m] and t_N (n_q,) [Pa] for the substep from t0 to t1 [s].

        stored : (n_bodies,) [J] since the start of the window, at t0; one 0 in the first substep.
        rate : (n_bodies,) [W] of the substep before; None in the first one.
        """
        ...


def thermal_pass(halves: Halves, state: CoupledState, times: list[float], slope: Slope | Leading | None, done: Work,
                 at_end: bool = False, ahead: Foreseen | None = None) -> Pass:
    """The thermal half over the window, given the carried heat: spread evenly in time, the entropy part at once.

    times : of its substeps [s].  slope : how x and t_N move; each substep is given them at its middle, or at its end.
    done : the work before.  ahead : as of coupler.schemes.accounts.due.  Raises DiscardError.
    """
    return _alone(_thermal(halves, state, times, slope, done, at_end, ahead))


def _thermal(halves: Halves, state: CoupledState, times: list[float], slope: Slope | Leading | None, done: Work,
             at_end: bool = False, ahead: Foreseen | None = None) -> Substeps:
    H, sent, work = times[-1] - times[0], state.sent, done
    handed = due(state.accounts, ahead)
    terms: list[dict[str, float]] = []
    outputs: Mapping[str, Array] = {}
    told: Mapping[str, float] = {}
    for t0, t1 in pairwise(times):
        if slope is None or isinstance(slope, tuple):
            # fault: window-time lag: extrapolation to the end instead of the middle -> x, t_N = geometry_at(state.now,
            #   slope, t1) | coupler/test_coupling
            x, t_N = geometry_at(state.now, slope, t1 if at_end else 0.5 * (t0 + t1), halves.bodies)
        else:
            x, t_N = slope.seen(t0, t1, *_stored(terms, times))
        # fault: a rule's inputs do not reach the thermal half -> inputs = { | coupler/test_rules
        # fault: inputs of the settings do not reach the half -> inputs = {**{}, | coupler/test_control
        inputs = {**_given(halves, "thermal"),
                  # fault: mechanical heat delivered twice -> "x": x, "contact.t_N": t_N, **share_of(handed,
                  #   1.0, t0 == times[0]), | coupler/test_coupling
                  # fault: conductance that never hears of the pressure -> "x": x, "contact.t_N": 0.0 * t_N,
                  #   **share_of(handed, (t1 - t0) / H, t0 == times[0]), | scenarios/test_contact_rods
                  #   scenarios/test_contact_two_way
                  # fault: the thermal half never hears that bodies move -> "contact.t_N": t_N,
                  #   **share_of(handed, (t1 - t0) / H, t0 == times[0]), | scenarios/test_sealed_container_fire
                  "x": x, "contact.t_N": t_N, **share_of(handed, (t1 - t0) / H, t0 == times[0]),
                  "control.event": np.array(float(state.events))}
        answer, sent, cost = yield _begun(
            _Call(halves.thermal, "thermal", t0, t1, inputs, halves.thermal_outputs), sent)
        if answer.status is not Status.OK:
            raise DiscardError(Verdict.THERMAL_DISCARD, f"{halves.thermal.name}: {answer.message}", done,
                               _is_final(answer, t1 - t0), _share(answer, t0, times))
        outputs, work = answer.outputs, work.plus(cost)
        terms.append({n: float(v) for n, v in outputs.items() if n.startswith(PREFIX) or n in NO_TERMS})
        told = _told(told, outputs)
    return Pass("thermal", outputs, sent, work, tuple(terms), told=told,
                accounts=delivered(state.accounts, handed, halves.thermal.blocks, ahead))


def _stored(terms: list[dict[str, float]], times: list[float]) -> tuple[Array, Array | None]:
    """Heat stored by each body in the substeps so far [J], and the rate of the last one [W]."""
    if not terms:
        return np.zeros(()), None
    each = np.array([stored(t) for t in terms])
    k = len(terms)
    return each.sum(axis=0), each[-1] / (times[k] - times[k - 1])


def stored(terms: Mapping[str, float]) -> Array:
    """Return the heat stored in a substep, (n_bodies,) [J], bodies in the order of their names.

    terms : heat terms of the substep [J].
    """
    return np.array([terms[n] for n in sorted(terms) if n.startswith(STORED)])


def mechanical_pass(halves: Halves, state: CoupledState, times: list[float], end: Mapping[str, Array],
                    done: Work) -> Pass:
    """Take the mechanical half over the window, T and f_s interpolated to the end of each of its substeps.

    times : of its substeps [s].  end : (n_nodes,) each, T [K] and f_s [1] at the end of the window, known or guessed;
    the very arrays of the start hold them.  done : the work before.  Raises DiscardError.
    """
    return _alone(_mechanical(halves, state, times, end, done))


def _mechanical(halves: Halves, state: CoupledState, times: list[float], end: Mapping[str, Array],
                done: Work) -> Substeps:
    H, sent, work = times[-1] - times[0], state.sent, done
    outputs: Mapping[str, Array] = {}
    made: dict[str, Array] = {}
    told: Mapping[str, float] = {}
    for t0, t1 in pairwise(times):
        inputs = {**_given(halves, "mechanical"),
                  **between(state.now, end, (t1 - times[0]) / H if t1 != times[-1] else 1.0),
                  "control.event": np.array(float(state.events))}
        call = _Call(halves.mechanical, "mechanical", t0, t1, inputs, halves.mechanical_outputs)
        answer, sent, cost = yield _begun(call, sent)
        if answer.status is not Status.OK:
            raise DiscardError(Verdict.MECHANICAL_DISCARD, f"{halves.mechanical.name}: {answer.message}", done,
                               _is_final(answer, t1 - t0), _share(answer, t0, times))
        outputs, work = answer.outputs, work.plus(cost)
        told = _told(told, outputs)
        for name in HEATS:
            if name not in outputs:
                continue
            # fault: the last mechanical substep's friction heat for the window's -> made[name] = outputs[name] |
            #   scenarios/test_brake_pad
            made[name] = made[name] + outputs[name] if name in made else outputs[name]
    return Pass("mechanical", outputs, sent, work, made=made, told=told)


def _given(halves: Halves, side: str) -> dict[str, Array]:
    return {n: np.array(v) for n, v in halves.inputs.get(side, {}).items()}


def _told(known: Mapping[str, float], outputs: Mapping[str, Array]) -> dict[str, float]:
    """Numbers that are no heat, and the values of blocks of a few: as they stand, or the largest of the substeps so far
    of those that tell of a substep."""
    told: dict[str, float] = {}
    for n, v in outputs.items():
        if v.ndim == 0 and not n.startswith(PREFIX):
            value = float(v)
            told[n] = max(value, known.get(n, value)) if n.startswith(OF_A_SUBSTEP) else value
        elif v.ndim == 1 and v.size <= FEW:
            told |= {f"{n}[{i + 1}]": float(x) for i, x in enumerate(v)}
    return told


def _begun(call: _Call, sent: Sent) -> Callable[[], Stepped]:
    """Begin one substep of one half; what is returned waits for the answer."""
    half, known = call.half, sent.get(call.side, {})
    news = {n: v for n, v in call.inputs.items() if (block := half.blocks.get(n)) is not None
            and block.causality == "input" and not _same(known.get(n), v)}
    started = time.perf_counter()
    answer = begin(half, call.t0, call.t1 - call.t0, news, call.outputs)
    began = time.perf_counter() - started
    return lambda: _stepped(call, sent, news, answer, began)


def _stepped(call: _Call, sent: Sent, news: Mapping[str, Array], step: Answer, began: float) -> Stepped:
    """The answer to a substep that took `began` [s] to begin with these news."""
    asked = time.perf_counter()
    answer = step()
    seconds = began + seconds_of(answer, time.perf_counter(), asked)
    iterations = int(answer.outputs.get("iterations", np.zeros(())))
    values = sum([v.size for v in news.values()]) + sum([v.size for v in answer.outputs.values()])
    fmi = seconds - answer.seconds
    known = sent.get(call.side, {})
    if call.side == "thermal":
        cost = Work(thermal_solves=1, thermal_iterations=iterations, thermal_seconds=answer.seconds,
                    fmi_seconds=fmi, values=values)
    else:
        cost = Work(mechanical_solves=1, mechanical_iterations=iterations, mechanical_seconds=answer.seconds,
                    fmi_seconds=fmi, values=values)
    return answer, {**sent, call.side: {**known, **news}} if news else sent, cost


def _alone(substeps: Substeps) -> Pass:
    """Take one half over the window."""
    answer: Stepped | None = None
    while True:
        try:
            step = next(substeps) if answer is None else substeps.send(answer)
        except StopIteration as over:
            return over.value
        answer = step()


def _together(both: Sequence[Substeps]) -> list[Pass]:
    """Take halves over the window that need nothing of each other: one in another process works while others do.

    Raises what the first of them raises, when none works any more.
    """
    found: list[Pass | Exception | None] = [None] * len(both)
    steps: dict[int, Callable[[], Stepped]] = {}

    def on(k: int, move: Callable[[], Callable[[], Stepped]]) -> None:
        """Begin the next substep of one of them, or keep how it ended."""
        try:
            steps[k] = move()
        except StopIteration as over:
            found[k] = over.value
        except Exception as exc:  # noqa: BLE001  raised below: the others are to be waited for
            found[k] = exc

    for k, substeps in enumerate(both):
        on(k, partial(next, substeps))
    while steps:
        for k in list(steps):
            step = steps.pop(k)
            try:
                answer = step()
            except Exception as exc:  # noqa: BLE001  as above
                found[k] = exc
            else:
                on(k, partial(both[k].send, answer))
    passes: list[Pass] = []
    for one in found:
        if isinstance(one, Exception):
            raise one
        assert one is not None
        passes.append(one)
    return passes


def _same(a: Array | None, b: Array) -> bool:
    if a is None or a is b:
        return a is b
    # A plain number is compared as one: that takes a tenth of the time.
    return a.shape == b.shape and (bool((a == b).all()) if b.ndim else float(a) == float(b))


@dataclass(frozen=True)
class Swept:
    """Both halves taken over a window once.  level : at its end.  accounts : after it.

    made : block -> energies the mechanical half made in it [J].
    """

    level: Level
    accounts: Mapping[str, EnergyAccount]
    sent: Sent
    terms: tuple[Mapping[str, float], ...]
    work: Work
    monitors: Mapping[str, float]
    made: Mapping[str, Array] = field(default_factory=dict)

    def solved(self, state: CoupledState, scheme: Scheme, history: IterationHistory | None = None,
               extrapolation: float = 0.0) -> Solved:
        """The accepted window.  state : before it.  scheme, extrapolation : by which it was solved."""
        past = (state.now, *state.past)[:3]
        new = CoupledState(self.level, past, state.events, self.accounts, self.sent, state.memory)
        return Solved(Verdict.ACCEPTED, "", new, self.terms, self.work, self.monitors, history, scheme=scheme,
                      extrapolation=extrapolation)


def thermal_first(halves: Halves, state: CoupledState, span: Span, slope: Slope | Leading | None,
                  trend: float | None = None) -> Swept:
    """Thermal, then mechanics with the new T.  Heat made in the window is due in the next.

    trend : of heat that goes on as it went (coupler.schemes.accounts): it is delivered in this window, and the
    difference in the next; None: it is not.
    """
    ahead = None if trend is None else Foreseen(span.end - state.now.t, trend)
    thermal = thermal_pass(halves, state, span.times("thermal"), slope, NO_WORK, ahead=ahead)
    mechanical = mechanical_pass(halves, replace(state, sent=thermal.sent), span.times("mechanical"),
                                 thermal.outputs, thermal.work)
    fresh = ahead is None or not state.past
    times, pressed = span.times("mechanical"), _pressed(state, mechanical)
    accounts = with_made(thermal.accounts, mechanical.made, times, fresh, pressed)
    return _swept(state, span, thermal, mechanical, accounts)


def at_once(halves: Halves, state: CoupledState, span: Span) -> Swept:
    """Both from the start of the window: x, t_N and T held.  Heat made in the window is due in the next.

    They work at the same time where they have processes of their own.
    """
    # fault: parallel mechanics given the new T -> now = exchanged(replace(state.now, T=thermal_pass(halves, state,
    #   span.times("thermal"), None, NO_WORK).outputs["T"])) | coupler/test_schemes
    now = exchanged(state.now)
    thermal, mechanical = _together([_thermal(halves, state, span.times("thermal"), None, NO_WORK),
                                     _mechanical(halves, state, span.times("mechanical"), now, NO_WORK)])
    accounts = with_made(thermal.accounts, mechanical.made, span.times("mechanical"), True, _pressed(state, mechanical))
    sent = {one.side: one.sent[one.side] for one in (thermal, mechanical) if one.side in one.sent}
    last = replace(mechanical, sent=sent, work=thermal.work.plus(mechanical.work))
    return _swept(state, span, thermal, last, accounts)


def mechanical_first(halves: Halves, state: CoupledState, span: Span, end: Mapping[str, Array],
                     done: Work = NO_WORK, at_end: bool = False) -> Swept:
    """Solve mechanics with a T given at the end, then thermal on the way x and t_N went.  Heat is delivered at once.

    end : (n_nodes,) each, T [K] and f_s [1] at the end of the window.
    at_end : thermal substeps are given x and t_N of their end, not of their middle.
    """
    times, fresh = span.times("mechanical"), not state.past
    mechanical = mechanical_pass(halves, state, times, end, done)
    # fault: heat of the last iterate forgotten -> accounts = state.accounts | coupler/test_iterated
    accounts = with_made(state.accounts, mechanical.made, times, fresh, _pressed(state, mechanical))
    made = replace(state, sent=mechanical.sent, accounts=accounts)
    # fault: an iterated window holds x and t_N as they were at its start -> slope = None |
    #   scenarios/test_casting_order::test_order_of_the_exchange_between_two_cells[Scheme.ITERATED-2.0-2.5e-13]
    slope = (state.now, _level(state.now, span, {}, mechanical.outputs))
    # fault: mechanics first, but thermal on the geometry of the start -> thermal = thermal_pass(halves, made,
    #   span.times("thermal"), None, mechanical.work, at_end) | coupler/test_schemes
    thermal = thermal_pass(halves, made, span.times("thermal"), slope, mechanical.work, at_end, ahead=Foreseen(0.0))
    return _swept(state, span, mechanical, thermal, thermal.accounts)


def _pressed(state: CoupledState, mechanical: Pass) -> tuple[Array, Array]:
    """What presses at the start and the end of a mechanical pass (Level.pressed), (n_q,) [Pa] each."""
    now = state.now
    end = replace(now, t_N=mechanical.outputs.get("contact.t_N", now.t_N),
                  covered=mechanical.outputs.get("contact.covered", now.covered))
    return now.pressed, end.pressed


def _swept(state: CoupledState, span: Span, first: Pass, last: Pass, accounts: Mapping[str, EnergyAccount]) -> Swept:
    """first, last : the passes in their order.  accounts : after the window."""
    thermal, mechanical = (first, last) if first.side == "thermal" else (last, first)
    now = _level(state.now, span, thermal.outputs, mechanical.outputs, _heat(state.now, thermal))
    monitors = {"touching": float(mechanical.outputs.get("contact.touching", np.zeros(()))),
                "max_T": float(now.T.max()), "max_p": float(-now.t_N.min(initial=0.0)),
                **{f"thermal.{n}": v for n, v in thermal.told.items()},
                **{f"mechanical.{n}": v for n, v in mechanical.told.items()}}
    return Swept(now, accounts, last.sent, thermal.terms, last.work, monitors, mechanical.made)


def _heat(start: Level, thermal: Pass) -> Array | None:
    """Heat stored by each body since the start of the run; None where the thermal half tells none."""
    names = sorted([n for n in thermal.terms[0] if n.startswith(STORED)]) if thermal.terms else []
    if not names:
        return None
    found = np.array([sum([terms[n] for terms in thermal.terms]) for n in names])
    # fault: heat stored told of the last window only -> return found | stability/test_freezing
    return found if start.heat is None else start.heat + found


def _level(start: Level, span: Span, thermal: Mapping[str, Array], mechanical: Mapping[str, Array],
           heat: Array | None = None) -> Level:
    """The level at the end of the window; what a half has not told is as at the start."""
    end = replace(start, t=span.end, T=thermal.get("T", start.T), f_s=thermal.get("f_s"), heat=heat)
    return mechanical_level(end, mechanical)


def mechanical_level(level: Level, mechanical: Mapping[str, Array]) -> Level:
    """Return the level with what the mechanical half tells; what it does not tell is as it was."""
    return replace(level, x=mechanical["x"], t_N=mechanical.get("contact.t_N", np.zeros(len(level.t_N))),
                   gap=mechanical.get("contact.gap", level.gap),
                   covered=mechanical.get("contact.covered", level.covered),
                   elastic_strain=mechanical.get(ELASTIC_STRAIN, level.elastic_strain))
