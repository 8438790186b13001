"""A half in another process, behind the same protocol as one in this process."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, TypeVar, get_args

import numpy as np

from contact.codec import kinds_of
from contact.records import WireError
from contact.rpc.calls import LinkError, ServiceDownError, name_of
from contact.rpc.client import BegunCall, Client
from coupler.errors import HalfError
from coupler.fmu.half import Advance, Answer, Array, Block, Status

# What the coupler says to a half that lives in another process, and what it hears back.
#
# Coarse on purpose: a substep is one message each way.  States stay with the half; only tokens travel.  The coupler
# chooses them, so it need not hear that a state was kept: what is done with states goes ahead of the next call, in its
# message.  Repeating a message is harmless: the server knows a call by its number and carries it out once.

@dataclass(frozen=True)
class Describe:
    """Which half are you?  Answered by Described."""


@dataclass(frozen=True)
class Described:
    """A half's name, blocks, strings and what it can do: the attributes of coupler.fmu.half.Half."""

    name: str
    blocks: tuple[Block, ...]
    strings: dict[str, str]
    can_save: bool
    can_serialise: bool


@dataclass(frozen=True)
class Initialise:
    """Half.initialise.  Answered by Values."""

    t_start: float
    t_end: float
    parameters: dict[str, str]
    inputs: dict[str, Array]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """Half.advance.  Answered by coupler.fmu.half.Advance."""

    t: float
    h: float
    inputs: dict[str, Array]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Read:
    """Half.read.  Answered by Values."""

    names: tuple[str, ...]
    finite: bool = True


@dataclass(frozen=True)
class Values:
    """Blocks by name."""

    values: dict[str, Array]


@dataclass(frozen=True)
class Save:
    """Half.save.  token : by which the caller will name the state.  Answered by Acknowledged."""

    token: int


@dataclass(frozen=True)
class Restore:
    """Half.restore.  Answered by Acknowledged."""

    token: int


@dataclass(frozen=True)
class Release:
    """Half.release.  Answered by Acknowledged."""

    token: int


@dataclass(frozen=True)
class Serialise:
    """Half.serialise.  Answered by StateBytes."""

    token: int


@dataclass(frozen=True)
class StateBytes:
    """A half's state, written down."""

    data: bytes


@dataclass(frozen=True)
class Deserialise:
    """Half.deserialise.  token : by which the caller will name the state.  Answered by Acknowledged."""

    token: int
    data: bytes


@dataclass(frozen=True)
class Ahead:
    """What is done with states, in this order, before a verb.  Answered as the verb is."""

    first: tuple[Save | Restore | Release, ...]
    verb: Initialise | Step | Read | Serialise | Deserialise


@dataclass(frozen=True)
class LogTail:
    """Half.log_tail.  Answered by Text."""


@dataclass(frozen=True)
class Text:
    """Some text."""

    text: str


@dataclass(frozen=True)
class Close:
    """Half.close, and the end of its process.  Answered by Acknowledged."""


@dataclass(frozen=True)
class Acknowledged:
    """It is done."""


@dataclass(frozen=True)
class Failed:
    """The half raised HalfError.  message, log : its parts."""

    message: str
    log: str


OfStates = Save | Restore | Release
Verb = Describe | Initialise | Step | Read | OfStates | Serialise | Deserialise | Ahead | LogTail | Close
VERBS = kinds_of(get_args(Verb))
ANSWERS = kinds_of((Described, Values, Advance, StateBytes, Text, Acknowledged, Failed))


# The half itself.

CARRIERS = (Initialise, Step, Read, Serialise, Deserialise)  # verbs that others go ahead of
LEAST_DEADLINE = 60.0  # s
TIMES_MEDIAN = 20.0  # the deadline of a step, by the median of those before it
RECENT_STEPS = 100
KNOWN_STEPS = 5  # before that the first, which may compile, would count for too much


class Course:
    """The steps of a half that went well: how long they took, and where the last one ended.

    stated : seconds that a step may take, if the scenario says so.
    """

    def __init__(self, stated: float | None = None) -> None:
        self._stated = stated
        self._seconds: deque[float] = deque(maxlen=RECENT_STEPS)
        self.t: float | None = None

    def add(self, t: float, seconds: float) -> None:
        """Count a step that ended at t [s]."""
        self.t = t
        self._seconds.append(seconds)

    @property
    def deadline(self) -> float | None:
        """Seconds that the next step may take; None where too few are known."""
        if self._stated is not None:
            return self._stated
        if len(self._seconds) < KNOWN_STEPS:
            return None
        # fault: a half that has become slow is given no more than a minute -> return LEAST_DEADLINE |
        #   coupler/test_stopped
        return max(LEAST_DEADLINE, TIMES_MEDIAN * median(self._seconds))


CLOSE_DEADLINE = 2.0  # s; after it the process is ended from outside
LOG_DEADLINE = 2.0  # s; a log is asked for when something is wrong already
AnswerT = TypeVar("AnswerT")


class RemoteHalf:
    """coupler.fmu.half.Half over a link.

    client : calls the half's process.  blame : asks whether every process lives and none is stopped; raises the error
    that names the one at fault, and returns whether one was started anew; its argument is how long to wait for a
    death to show.  step_deadline : seconds that a
    step may take; None: 20 times the median of those before, and a minute at least.  tail : the end of its log, where
    it cannot be asked for it.
    """

    def __init__(self, name: str, client: Client, blame: Callable[[float], bool],
                 step_deadline: float | None = None, tail: Callable[[], str] = str) -> None:
        self.name = name
        self._client = client
        self._blame = blame
        self._course = Course(step_deadline)
        self._tail = tail
        self._token = 0
        self._ahead: list[OfStates] = []  # not sent yet
        self._failed = False
        description = self._call(Describe(), Described)
        self.blocks = {block.name: block for block in description.blocks}
        self.strings = description.strings
        self.can_save = description.can_save
        self.can_serialise = description.can_serialise

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str],
                   inputs: Mapping[str, Array], outputs: Sequence[str]) -> dict[str, Array]:
        """Set parameters and first inputs, leave initialisation mode, return the outputs asked for.

        t_start, t_end : start and stop time [s].  inputs : shape and unit of the block of that name.  outputs : names;
        each comes back by name in the shape and unit of its block.
        """
        verb = Initialise(t_start, t_end, dict(parameters), _blocks(inputs), tuple(outputs))
        return self._call(verb, Values).values

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """Set the inputs (only those that changed need be given), do one step from t to t + h [s], get the outputs.

        inputs : shape and unit of the block of that name.  outputs : names; the answer holds each in the shape and
        unit of its block.
        """
        return self.begin(t, h, inputs, outputs)()

    def begin(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Answer:
        """As of Half: its process has the message when this returns."""
        begun = time.perf_counter()
        step = Step(t, h, _blocks(inputs), tuple(outputs))
        answer = self._begin(step, Advance, self._course.deadline)
        return lambda: self._judged(step, answer(), begun)

    def _judged(self, step: Step, done: Advance, begun: float) -> Advance:
        """The answer to a step that was begun at a time [s]."""
        took = self._client.answered_at - begun
        # fault: what messages take is not told -> pass | coupler/test_timings
        done = replace(done, transport=max(took - done.seconds - done.border - done.states, 0.0))
        if done.status is Status.OK:
            self._course.add(step.t + step.h, took)
        # A half that lost its contact service can only discard; a smaller step would not help it, the same one does
        # where the service lives again.
        # fault: a step discarded because contact died puts its window back -> if done.status is Status.DISCARD and
        #   self._blame(0.0) is None: |
        #   coupler/test_replayed::test_a_discard_while_contact_was_started_anew_is_no_discard
        if done.status is Status.DISCARD and self._blame(0.0):
            raise HalfError(f"its step was broken off: {done.message}{self._where(step)}", half=self.name)
        return done

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """Return the outputs as they stand: name -> array in the shape and unit of its block.

        finite : whether one that is not finite is a HalfError.
        """
        return self._call(Read(tuple(names), finite), Values).values

    def save(self) -> int:
        self._token += 1
        self._of_states(Save(self._token))
        return self._token

    def restore(self, token: int) -> None:
        self._of_states(Restore(token))

    def release(self, token: int) -> None:
        self._of_states(Release(token))

    def serialise(self, token: int) -> bytes:
        return self._call(Serialise(token), StateBytes).data

    def deserialise(self, data: bytes) -> int:
        self._token += 1
        self._call(Deserialise(self._token, data), Acknowledged)
        return self._token

    def log_tail(self) -> str:
        return self._call(LogTail(), Text, LOG_DEADLINE).text

    def close(self) -> None:
        self._call(Close(), Acknowledged, CLOSE_DEADLINE)

    def _of_states(self, verb: OfStates) -> None:
        """Do something with states: ahead of the next call, or at once where the last one failed."""
        # Nobody else calls this half, so its state is then still the one of now.
        # fault: whether a half that failed does as it is told is not heard -> if False: |
        #   coupler/test_ahead::test_after_a_failure_nothing_is_put_off
        if self._failed:
            self._call(verb, Acknowledged)
        else:
            self._ahead.append(verb)

    def _call(self, verb: Verb, kind: type[AnswerT], deadline: float | None = None) -> AnswerT:
        """The answer to a verb.  Raises HalfError, or what `blame` raises."""
        return self._begin(verb, kind, deadline)()

    def _begin(self, verb: Verb, kind: type[AnswerT], deadline: float | None) -> Callable[[], AnswerT]:
        """Send a verb; what is returned gives the answer, and raises as `_call`."""
        sent: Verb = verb
        if self._ahead and isinstance(verb, CARRIERS):
            sent = Ahead(tuple(self._ahead), verb)
            self._ahead.clear()
        call: BegunCall | LinkError | WireError
        try:
            call = self._client.begin(sent, deadline)
        except (LinkError, WireError) as exc:
            call = exc
        return lambda: self._told(verb, sent, call, kind)

    def _told(self, verb: Verb, sent: Verb, call: BegunCall | LinkError | WireError, kind: type[AnswerT]) -> AnswerT:
        """The answer to a verb that was sent, or could not be."""
        try:
            answer = self._answered(sent, call, kind)
            self._failed = False
            return answer
        except HalfError as exc:
            self._failed = True
            if exc.half == self.name:
                exc.message += self._where(verb)
            else:  # another one is at fault, and was found while this one was called
                exc.add_note(f"found when half {self.name!r} was called{self._where(verb)}")
            raise
        except ServiceDownError as exc:
            self._failed = True
            exc.add_note(f"found when half {self.name!r} was called{self._where(verb)}")
            raise

    def _where(self, verb: Verb) -> str:
        """The last call, and the time to which all was well."""
        call = f"{type(verb).__name__} from t = {verb.t:.9g} s by {verb.h:.3g} s" if isinstance(verb, Step) else (
            type(verb).__name__)
        good = "" if self._course.t is None else f"; its last good step ended at t = {self._course.t:.9g} s"
        return f" (in {call}{good})"

    def _answered(self, verb: Verb, call: BegunCall | LinkError | WireError, kind: type[AnswerT]) -> AnswerT:
        try:
            if isinstance(call, Exception):
                raise call
            answer: Any = self._client.answer(call)
        except LinkError as exc:
            self._blame(1.0)
            raise HalfError(str(exc), half=self.name, log=self._tail()) from exc
        except WireError as exc:
            raise HalfError(f"{name_of(verb)} cannot be sent: {exc}", half=self.name) from exc
        if isinstance(answer, Failed):
            self._blame(0.0)
            raise HalfError(answer.message, half=self.name, log=answer.log)
        if not isinstance(answer, kind):
            raise HalfError(f"{name_of(verb)} was answered by {type(answer).__name__}", half=self.name)
        return answer


def _blocks(values: Mapping[str, Array]) -> dict[str, Array]:
    return {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}
