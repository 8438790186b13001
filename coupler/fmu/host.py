"""The process around one half:  python -m coupler.fmu.host --name NAME --fmu FILE --extracted DIR --run ID --listen AT

It lives as long as its parent (contact.rpc.server), which it tells `ready ENDPOINT INSTANCE` and from which it
first hears the secret of the run and the endpoint of the contact service.  It serves the one who calls it first,
whoever has the secret, and every call into the FMU comes from the main thread.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from contact.rpc.calls import LinkSpecError
from contact.rpc.seal import keep_secret, secret_line
from contact.rpc.server import Server, become_child
from contact.rpc.zenoh_session import close_all_sessions, open_session
from coupler.errors import HalfError
from coupler.fmu.half import Advance, Half, Status
from coupler.fmu.remote import (
    VERBS,
    Acknowledged,
    Ahead,
    Close,
    Describe,
    Described,
    Deserialise,
    Failed,
    Initialise,
    LogTail,
    Read,
    Release,
    Restore,
    Save,
    Serialise,
    StateBytes,
    Step,
    Text,
    Values,
    Verb,
)

PARENT_PATIENCE = 120.0  # s to hear of the contact service, which may be compiling
# s that a half waits for a contact service that is silent: one that died is named by the coupler before, or started
# anew, which takes as long as seeing that it is gone (60 s on another machine) and its start (120 s).
CONTACT_PATIENCE = 200.0
ROUND_OFF = 8  # ulps by which the time of a step may differ from the sum of the steps before it
Load = Callable[[Path, Path, str], Half]


def main(load: Load, arguments: list[str] | None = None) -> None:
    """Load the half, serve it, and end the process.  load : (FMU, where to unpack it, name) -> half."""
    parser = argparse.ArgumentParser(prog="python -m coupler.fmu.host", description=__doc__)
    for name in ("--name", "--fmu", "--extracted", "--run", "--listen"):
        parser.add_argument(name, required=True)
    options = parser.parse_args(arguments)
    parent = become_child(close_all_sessions)
    try:
        seal = keep_secret(options.run, secret_line(parent.hear(PARENT_PATIENCE)), CONTACT_PATIENCE)
    except (LinkSpecError, TimeoutError) as exc:
        _end(2, str(exc))
    try:
        half = load(Path(options.fmu), Path(options.extracted), options.name)
    except HalfError as exc:
        _end(1, str(exc))
    # One session for both: calls from the coupler come in at `listen`, the half's own link to contact, opened
    # later inside the FMU, finds the `connect` endpoint here and shares it.
    session = open_session(listen=(options.listen,), connect=(parent.hear(PARENT_PATIENCE),))
    hosted = Hosted(half)
    with Server(session, seal, role_of(options.name), VERBS, one_owner=True) as server:
        parent.say(f"ready {session.listen[0]} {server.instance}")
        server.work(lambda verb: answer_or_stop(hosted, verb, server))
    close_all_sessions()
    _end(0, "")


def role_of(name: str) -> str:
    """The role of a half among the servers of a run."""
    return f"half-{name}"


class Hosted:
    """A half that answers verbs, and knows its own time.

    t : [s], of the state it has; None where it is not known: before the start, and in a state that came as bytes.
    """

    def __init__(self, half: Half) -> None:
        self.half = half
        self.t: float | None = None
        # By the caller's tokens: the half's own, and the time of the state.
        self._kept: dict[int, tuple[int, float | None]] = {}

    def answer(self, verb: Verb) -> Any:
        """Carry out a verb.  Returns one of coupler.fmu.remote.ANSWERS."""
        try:
            return self._answer(verb)
        except HalfError as exc:
            return Failed(exc.message, exc.log)

    def _answer(self, verb: Verb) -> Any:
        half = self.half
        match verb:
            case Describe():
                return Described(half.name, tuple(half.blocks.values()), dict(half.strings), half.can_save,
                                 half.can_serialise)
            case Initialise(t_start, t_end, parameters, inputs, outputs):
                values = Values(half.initialise(t_start, t_end, parameters, inputs, outputs))
                self.t = t_start
                return values
            case Step():
                return self._step(verb)
            case Read(names, finite):
                return Values(half.read(names, finite))
            case Ahead(first, then):
                begun = time.perf_counter()
                # fault: what goes ahead of a step is not done -> for one in (): | coupler/test_ahead
                for one in first:
                    self._answer(one)
                took = time.perf_counter() - begun
                answer = self._answer(then)
                return replace(answer, states=took) if isinstance(answer, Advance) else answer
            case Save(token):
                self._keep(token, half.save(), self.t)
            case Restore(token):
                own, t = self._known(token)
                half.restore(own)
                self.t = t
            case Release(token):
                half.release(self._known(token)[0])
                del self._kept[token]
            case Serialise(token):
                return StateBytes(half.serialise(self._known(token)[0]))
            case Deserialise(token, data):
                self._keep(token, half.deserialise(data), None)
            case LogTail():
                return Text(half.log_tail())
            case Close():
                half.close()
        return Acknowledged()

    def _step(self, step: Step) -> Any:
        # fault: a half steps from a time that is not its own -> if False: | coupler/test_strangers
        if self.t is not None and abs(step.t - self.t) > ROUND_OFF * math.ulp(max(abs(step.t), abs(self.t))):
            return Failed(f"was asked for a step from t = {step.t!r} s, and is at t = {self.t!r} s", "")
        done = self.half.advance(step.t, step.h, step.inputs, step.outputs)
        if done.status is Status.OK:
            self.t = step.t + step.h
        return done

    def _keep(self, token: int, own: int, t: float | None) -> None:
        # fault: a second state takes the name of one that is kept -> if False: | coupler/test_ahead
        if token in self._kept:
            self.half.release(own)
            raise HalfError(f"keeps a state {token} already", half=self.half.name)
        self._kept[token] = own, t

    def _known(self, token: int) -> tuple[int, float | None]:
        # fault: a state that nobody keeps is a traceback -> if False: | coupler/test_fuzzed
        if token not in self._kept:
            raise HalfError(f"keeps no state {token}", half=self.half.name)
        return self._kept[token]


def answer_or_stop(hosted: Hosted, verb: Verb, server: Server) -> Any:
    if isinstance(verb, Close):
        server.stop()
    return hosted.answer(verb)


def _end(code: int, message: str) -> NoReturn:
    """End at once: after an FMU was loaded, an orderly end of the interpreter may corrupt the heap."""
    if message:
        print(message, file=sys.stderr)
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    from functools import partial

    from coupler.fmu.fmi import load_half

    main(partial(load_half, past_lists=True))
