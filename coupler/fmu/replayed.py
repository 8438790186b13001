"""A half that outlives its process: where its state came from is remembered, and a new process goes the same way.

Every state of a half is a state written down, or the step that led to it from another one.  So the way to a state is a
chain of steps from the last one that was written down; what was put back meanwhile is not on it.  A checkpoint writes
states down anyway, so a chain is seldom longer than the time between two of them.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from contact.rpc.calls import ServiceDownError
from coupler.errors import HalfError
from coupler.fmu.half import Advance, Answer, Array, Block, Half, Status, begin

MOST_SECONDS = 60.0  # of steps on a chain, which a new process takes again
MOST_BYTES = 128 << 20  # of their inputs
ValueT = TypeVar("ValueT")


@dataclass(frozen=True)
class _Step:
    """A step that went well.  digest : of its outputs, for a new process must give the same."""

    t: float
    h: float
    inputs: Mapping[str, Array]
    outputs: tuple[str, ...]
    digest: int


@dataclass(eq=False)
class Place:
    """A state that a half was in.

    data : it, written down; or else step : that led there from the place before.  seconds, size : of the steps since
    the last place with data, and bytes of their inputs.
    """

    before: Place | None = None
    step: _Step | None = None
    data: bytes | None = None
    seconds: float = 0.0
    size: int = 0

    def after(self, step: _Step, seconds: float) -> Place:
        """Return where a step led from here."""
        size = sum(value.nbytes for value in step.inputs.values())
        return Place(self, step, None, self.seconds + seconds, self.size + size)

    def write_down(self, data: bytes) -> None:
        """Keep the bytes of the state; what led here is forgotten."""
        self.data, self.before, self.step, self.seconds, self.size = data, None, None, 0.0, 0


@dataclass
class _Saved:
    """A state that was kept.

    place : None where it is not known.  token : of the half as it is now; None where that has to be brought there.
    """

    place: Place | None
    token: int | None


class ReplayedHalf:
    """coupler.fmu.half.Half around one in another process, which may be replaced by a new one.

    half : the one at hand.  mended : asked after a call that failed, whether whoever had died was replaced (`replace`
    was called for it, if it was this half): then the call is repeated from the state it was made in.  One that cannot
    write its state down cannot be replaced.
    """

    def __init__(self, half: Half, mended: Callable[[], bool]) -> None:
        self.half, self._mended = half, mended
        self.name: str = half.name
        self.blocks: Mapping[str, Block] = half.blocks
        self.strings: Mapping[str, str] = half.strings
        self.can_save, self.can_serialise = half.can_save, half.can_serialise
        self._begin: Callable[[Half], object] | None = None
        self._saved: dict[int, _Saved] = {}
        self._token = 0
        # None: the state is not known, behind a step that was discarded, and until the half has begun.
        self._at: Place | None = None
        self._lost = False  # the half is not at `_at`, and is brought there before it is asked anything
        self._fresh = False  # it is a new one that has not begun
        self.failed = False  # its last call failed for good
        self.spoiled = False  # it was left while it began, so it is of no use

    @property
    def at(self) -> Place | None:
        """Where it is; None where that is not known, or it cannot be brought there again."""
        return self._at

    def replace(self, half: Half) -> None:
        """Go on with a new half, which has not begun yet."""
        self.half, self._lost, self._fresh, self.spoiled = half, True, True, False
        for saved in self._saved.values():
            saved.token = None

    def bring_to(self, place: Place) -> None:
        """Bring the half to a place.  Raises HalfError where it does not come to the same state again."""
        self._at, self._lost, self.failed = place, True, False
        self._do(lambda half: None)

    # The Half protocol

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """Set parameters and first inputs, leave initialisation mode, return the outputs asked for.

        t_start, t_end : start and stop time [s].  inputs : shape and unit of the block of that name.  outputs : names;
        each comes back by name in the shape and unit of its block.
        """
        given = _copies(inputs)
        first = self.half.initialise(t_start, t_end, parameters, given, outputs)
        self._begin = lambda half: half.initialise(t_start, t_end, parameters, given, ())
        if self.can_serialise:
            self._at = Place(data=_written_down(self.half))
        return first

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """Set the inputs (only those that changed need be given), do one step from t to t + h [s], get the outputs.

        inputs : shape and unit of the block of that name.  outputs : names; the answer holds each in the shape and
        unit of its block.
        """
        return self.begin(t, h, inputs, outputs)()

    def begin(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Answer:
        """As of Half.  A process that dies meanwhile is replaced when the answer is asked for."""
        given = _copies(inputs)
        # One that has to be brought to its state first is, then.
        begun = None if self._lost else (self.half, begin(self.half, t, h, given, outputs))

        def call(half: Half) -> Advance:
            nonlocal begun
            answer = begin(half, t, h, given, outputs) if begun is None or begun[0] is not half else begun[1]
            begun = None
            return answer()

        def answer() -> Advance:
            done = self._do(call)
            if done.status is not Status.OK:
                self._at = None
            elif self._at is not None:
                step = _Step(t, h, given, tuple(outputs), digest(done.outputs))
                self._at = self._at.after(step, done.seconds)
            return done

        return answer

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """Return the outputs as they stand: name -> array in the shape and unit of its block.

        finite : whether one that is not finite is a HalfError.
        """
        return self._do(lambda half: half.read(names, finite))

    def save(self) -> int:
        """Keep the complete state; returns a token for restore and release."""
        token = self._do(lambda half: half.save())
        number = self._keep(self._at, token)
        if self._at is not None and (self._at.seconds > MOST_SECONDS or self._at.size > MOST_BYTES):
            self.serialise(number)
        return number

    def restore(self, token: int) -> None:
        """Go back to a kept state."""
        saved = self._known(token)
        self._at = saved.place
        if self.failed or self._lost or saved.token is None:
            self._lost = True  # when it is asked something
        else:
            self._do(lambda half: None if saved.token is None else half.restore(saved.token))

    def release(self, token: int) -> None:
        """Forget a kept state."""
        saved = self._known(token)
        try:
            if not self.failed and not self._lost:
                # A new half, if there is one meanwhile, has no such token.
                self._do(lambda half: None if saved.token is None else half.release(saved.token))
        finally:
            del self._saved[token]

    def serialise(self, token: int) -> bytes:
        """The bytes of a kept state, which restore the same bits in another process with the same FMU."""
        saved = self._known(token)
        if saved.place is not None and saved.place.data is not None:
            return saved.place.data
        data = self._do(lambda half: half.serialise(self._inner(saved, half)))
        if saved.place is not None:
            saved.place.write_down(data)
        return data

    def deserialise(self, data: bytes) -> int:
        """Keep the state behind bytes that serialise gave; returns a token."""
        return self._keep(Place(data=data), self._do(lambda half: half.deserialise(data)))

    def log_tail(self) -> str:
        """The half's last log messages, for error texts."""
        return self.half.log_tail()

    def close(self) -> None:
        """End the half."""
        self.half.close()

    # Inside

    def _do(self, call: Callable[[Half], ValueT]) -> ValueT:
        """What a call gives, made again where a process that died meanwhile was replaced."""
        while True:
            was_lost = self._lost
            try:
                if was_lost:
                    self._go_back()
                return call(self.half)
            except (HalfError, ServiceDownError):
                # A call that was broken off may still be going on: where the half is then is not known.
                # fault: a call broken off half way is repeated from where that left the half -> pass |
                #   coupler/test_replayed::test_a_step_broken_off_half_way_is_repeated_from_where_it_began
                self._lost = True
                known = self.can_serialise and self._begin is not None and self._at is not None
                # fault: a process that died is not replaced though it may be -> if True: |
                #   coupler/test_restarts::test_who_died_between_two_calls_is_started_anew_and_nothing_else_happened
                if not (known and self._mended()):
                    # Whoever goes on asking gets what the half says; `recover` is what brings it back.
                    self._lost, self.failed = was_lost, True
                    raise

    def _go_back(self) -> None:
        """Bring the half to where it was: to the nearest state at hand on the way there, then step by step."""
        if self._at is None:
            raise HalfError("its state is not known", half=self.name)
        if self._fresh and self._begin is not None:
            # Another one may die meanwhile: nobody begins twice.
            self.spoiled = True
            self._begin(self.half)
            self._fresh = self.spoiled = False
        kept = {id(saved.place): saved.token for saved in self._saved.values() if saved.token is not None}
        place, steps = self._at, []
        while place.data is None and id(place) not in kept:
            assert place.step is not None
            assert place.before is not None
            steps.append(place.step)
            place = place.before
        if id(place) in kept:
            self.half.restore(kept[id(place)])
        else:
            assert place.data is not None
            token = self.half.deserialise(place.data)
            self.half.restore(token)
            self.half.release(token)
        # fault: of the steps on the way back the last is left out -> for step in reversed(steps[1:]): |
        #   coupler/test_restarts::test_who_died_between_two_calls_is_started_anew_and_nothing_else_happened
        for step in reversed(steps):
            self._repeat(step)
        self._lost = False

    def _repeat(self, step: _Step) -> None:
        done = self.half.advance(step.t, step.h, step.inputs, step.outputs)
        # fault: a half that gives other numbers the second time is believed -> if done.status is not Status.OK: |
        #   coupler/test_restarts::test_a_half_that_gives_other_numbers_the_second_time_is_not_believed
        if done.status is not Status.OK or digest(done.outputs) != step.digest:
            raise HalfError(f"its new process did not do again what the old one had done (step from t = {step.t:.9g} s "
                            f"by {step.h:.3g} s: {done.message or 'other numbers'})", half=self.name)

    def _keep(self, place: Place | None, token: int) -> int:
        self._token += 1
        self._saved[self._token] = _Saved(place, token)
        return self._token

    def _known(self, token: int) -> _Saved:
        if token not in self._saved:
            raise HalfError(f"state {token} was released, or never kept", half=self.name)
        return self._saved[token]

    def _inner(self, saved: _Saved, half: Half) -> int:
        """The half's own token of a kept state; a new half is brought there for it."""
        if saved.token is None:
            here, self._at = self._at, saved.place
            try:
                if here is not saved.place:
                    self._go_back()
                saved.token = half.save()
            finally:
                # Also where its process died on the way: the call is repeated from where the half was.
                # fault: a half whose process dies on the way to a kept state stays there -> pass |
                #   coupler/test_replayed::test_who_dies_on_the_way_to_a_kept_state_goes_on_from_where_it_was
                self._at = here
                self._lost = here is not saved.place
        return saved.token


def digest(outputs: Mapping[str, Array]) -> int:
    """A checksum of the bits of outputs: against halves that do not repeat themselves, not against a forger."""
    total = 0
    for name in sorted(outputs):
        total = zlib.crc32(np.ascontiguousarray(outputs[name]).tobytes(), zlib.crc32(name.encode(), total))
    return total


def _copies(inputs: Mapping[str, Array]) -> dict[str, Array]:
    return {name: np.array(value, dtype=np.float64) for name, value in inputs.items()}


def _written_down(half: Half) -> bytes:
    token = half.save()
    try:
        return half.serialise(token)
    finally:
        half.release(token)
