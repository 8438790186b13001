"""The calls of both halves, timed: what a window's seconds went to."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Advance, Answer, Array, Block, Half, begin, seconds_of

SIDES = ("thermal", "mechanical")
CALLS = ("initialise", "advance", "read", "save", "restore", "release", "serialise", "deserialise")
"""Names of the calls of a half, as `Timing.calls` numbers them."""
STATES = ("save", "restore", "release", "serialise", "deserialise")
ValueT = TypeVar("ValueT")


@dataclass(frozen=True)
class Timing:
    """Where the time of a window tried went.

    parts : (len(PARTS),) as named there.  calls : (n, len(CALL_PARTS)) a row a call, those while the window was
    recorded too.
    """

    parts: Array
    calls: NDArray[np.float32]


PARTS = ("begun", "seconds", "thermal", "mechanical", "thermal_contact", "mechanical_contact", "border", "transport",
         "states", "coupler", "thermal_wait", "mechanical_wait", "record", "calls", "requests", "overlap")
"""What a timing tells of a window tried; [s] but for the last two.

begun : since the first window.  seconds : until it was solved and judged.  Of these: thermal, mechanical : the half's
own work in its steps; thermal_contact, mechanical_contact : it waited for contact; border : inputs set and outputs got
there; transport : messages of steps; states : saved, restored, released; coupler : all else; overlap : counts in these
twice, because both halves were called.  Beside them
thermal_wait, mechanical_wait : of `seconds` those in which the half was not called; record : after `seconds`, until the
window was recorded.  calls : of halves, with those of the record.  requests : of the halves to contact.
"""

CALL_PARTS = ("side", "call", "begun", "seconds", "work", "contact", "border", "transport")
"""What is told of a call: which of SIDES and of CALLS; [s] since its window began; [s]; of these, of a step, those of
its own work, of contact, of the border and of transport (what is left: of states, ahead of it in the same message)."""


class Meter:
    """Collects the calls of both halves; window by window it says where the time went.

    spent : [s] of windows in processes before this one, of a run that was resumed.
    """

    def __init__(self, spent: float = 0.0) -> None:
        self._calls: list[tuple[float, ...]] = []
        self._requests = 0
        self._ahead = 0.0  # [s] of states, within steps
        self._origin: float | None = None
        self._spent = spent
        self._begun = self._solved = 0.0

    def call(self, side: int, name: int, call: Callable[[], ValueT]) -> ValueT:
        """What a call gives, timed; nothing is kept of one that raises."""
        begun = time.perf_counter()
        value = call()
        self._calls.append((side, name, begun - self._begun, time.perf_counter() - begun, 0.0, 0.0, 0.0, 0.0))
        return value

    def step(self, side: int, answer: Answer, begun: float) -> Advance:
        """What a step gives that was begun at a time [s], timed."""
        asked = time.perf_counter()
        done = answer()
        took = seconds_of(done, ended_at := time.perf_counter(), asked)
        # One that was at work while another was waited for began when it was told, one in this process just now.
        at = begun if took > ended_at - asked else asked
        self._calls.append((side, _ADVANCE, at - self._begun, took, done.seconds - done.waited, done.waited,
                            done.border, done.transport))
        self._requests += done.requests
        self._ahead += done.states
        return done

    def begin(self) -> None:
        """A window begins; calls before are no part of it."""
        self._calls.clear()
        self._requests = 0
        self._ahead = 0.0
        self._begun = time.perf_counter()
        if self._origin is None:
            self._origin = self._begun - self._spent

    def solved(self) -> None:
        """The window is solved and judged, and is now recorded."""
        self._solved = time.perf_counter()

    def end(self) -> Timing:
        """The window is recorded: where its time went."""
        assert self._origin is not None
        ended, seconds = time.perf_counter(), self._solved - self._begun
        # Plain sums: for a dozen calls arrays take ten times as long, and a window may be over in a millisecond.
        called, work, contact = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        border = transport = 0.0
        states = self._ahead
        overlap = called_until = 0.0
        for side, name, begun, took, own, waited, at_border, on_way in sorted(self._calls, key=_BEGUN):
            # fault: calls of the record count as the window's own -> if begun > ended: |
            #   coupler/test_timings::test_every_second_of_a_window_is_in_one_part
            if begun >= seconds:
                break
            which = int(side)
            called[which] += took
            work[which] += own
            contact[which] += waited
            overlap += min(max(called_until - begun, 0.0), took)
            called_until = max(called_until, begun + took)
            border += at_border
            transport += on_way
            states += took if name in _STATES else 0.0
        # fault: what halves did at the same time counts as time of the coupler -> rest = seconds - sum(work) -
        #   sum(contact) - border - transport - states | coupler/test_overlap
        rest = seconds - sum(work) - sum(contact) - border - transport - states + overlap
        parts = np.array([self._begun - self._origin, seconds, *work, *contact, border, transport, states, rest,
                          seconds - called[0], seconds - called[1], ended - self._solved, len(self._calls),
                          self._requests, overlap])
        return Timing(parts, np.array(self._calls, dtype=np.float32).reshape(-1, len(CALL_PARTS)))


_ADVANCE = CALLS.index("advance")
_BEGUN = itemgetter(2)
_READ, _SAVE, _RESTORE, _RELEASE = (CALLS.index(n) for n in ("read", "save", "restore", "release"))
_STATES = frozenset(CALLS.index(n) for n in STATES)


class MeteredHalf:
    """A half (coupler.fmu.half.Half) that is another one, each call of it timed."""

    def __init__(self, half: Half, side: str, meter: Meter) -> None:
        self.half, self._side, self._meter = half, SIDES.index(side), meter
        self.name: str = half.name
        self.blocks: Mapping[str, Block] = half.blocks
        self.strings: Mapping[str, str] = half.strings
        self.can_save, self.can_serialise = half.can_save, half.can_serialise

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """As of the half."""
        return self.half.initialise(t_start, t_end, parameters, inputs, outputs)

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """As of the half."""
        return self.begin(t, h, inputs, outputs)()

    def begin(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Answer:
        """As of the half."""
        begun = time.perf_counter()
        answer = begin(self.half, t, h, inputs, outputs)
        return lambda: self._meter.step(self._side, answer, begun)

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """As of the half."""
        return self._meter.call(self._side, _READ, lambda: self.half.read(names, finite))

    def save(self) -> int:
        """As of the half."""
        return self._meter.call(self._side, _SAVE, self.half.save)

    def restore(self, token: int) -> None:
        """As of the half."""
        self._meter.call(self._side, _RESTORE, lambda: self.half.restore(token))

    def release(self, token: int) -> None:
        """As of the half."""
        self._meter.call(self._side, _RELEASE, lambda: self.half.release(token))

    def serialise(self, token: int) -> bytes:
        """As of the half."""
        return self._meter.call(self._side, CALLS.index("serialise"), lambda: self.half.serialise(token))

    def deserialise(self, data: bytes) -> int:
        """As of the half."""
        return self._meter.call(self._side, CALLS.index("deserialise"), lambda: self.half.deserialise(data))

    def log_tail(self) -> str:
        """As of the half."""
        return self.half.log_tail()

    def close(self) -> None:
        """As of the half."""
        self.half.close()
