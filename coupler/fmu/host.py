"""The process around one half:  python -m coupler.fmu.host --name NAME --fmu FILE --extracted DIR --run ID

It lives as long as its parent (contact.rpc.server), which it tells `ready ENDPOINT INSTANCE` and from which it
first hears the endpoint of the contact service.  Every call into the FMU comes from the main thread.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from contact.rpc.server import Server, become_child
from contact.rpc.zenoh_session import close_all_sessions, open_session
from coupler.errors import HalfError
from coupler.fmu.half import Half
from coupler.fmu.remote import (
    VERBS,
    Acknowledged,
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
    Token,
    Values,
    Verb,
)

PARENT_PATIENCE = 120.0  # s to hear of the contact service, which may be compiling
Load = Callable[[Path, Path, str], Half]


def main(load: Load, arguments: list[str] | None = None) -> None:
    """Load the half, serve it, and end the process.  load : (FMU, where to unpack it, name) -> half."""
    parser = argparse.ArgumentParser(prog="python -m coupler.fmu.host", description=__doc__)
    for name in ("--name", "--fmu", "--extracted", "--run"):
        parser.add_argument(name, required=True)
    options = parser.parse_args(arguments)
    parent = become_child(close_all_sessions)
    try:
        half = load(Path(options.fmu), Path(options.extracted), options.name)
    except HalfError as exc:
        _end(1, str(exc))
    # One session for both: calls from the coupler come in at `listen`, the half's own link to contact, opened
    # later inside the FMU, finds the `connect` endpoint here and shares it.
    session = open_session(listen=("tcp/127.0.0.1:0",), connect=(parent.hear(PARENT_PATIENCE),))
    with Server(session, options.run, role_of(options.name), VERBS) as server:
        parent.say(f"ready {session.listen[0]} {server.instance}")
        server.work(lambda verb: _answer_or_stop(half, verb, server))
    close_all_sessions()
    _end(0, "")


def role_of(name: str) -> str:
    """The role under which a half is found on the network."""
    return f"half-{name}"


def answer(half: Half, verb: Verb) -> Any:
    """Carry out a verb on a half.  Returns one of coupler.fmu.remote.ANSWERS."""
    try:
        return _answer(half, verb)
    except HalfError as exc:
        return Failed(exc.message, exc.log)


def _answer(half: Half, verb: Verb) -> Any:
    match verb:
        case Describe():
            return Described(half.name, tuple(half.blocks.values()), dict(half.strings), half.can_save,
                             half.can_serialise)
        case Initialise(t_start, t_end, parameters, inputs, outputs):
            return Values(half.initialise(t_start, t_end, parameters, inputs, outputs))
        case Step(t, h, inputs, outputs):
            return half.advance(t, h, inputs, outputs)
        case Read(names, finite):
            return Values(half.read(names, finite))
        case Save():
            return Token(half.save())
        case Restore(token):
            half.restore(token)
        case Release(token):
            half.release(token)
        case Serialise(token):
            return StateBytes(half.serialise(token))
        case Deserialise(data):
            return Token(half.deserialise(data))
        case LogTail():
            return Text(half.log_tail())
        case Close():
            half.close()
    return Acknowledged()


def _answer_or_stop(half: Half, verb: Verb, server: Server) -> Any:
    if isinstance(verb, Close):
        server.stop()
    return answer(half, verb)


def _end(code: int, message: str) -> None:
    """End at once: after an FMU was loaded, an orderly end of the interpreter may corrupt the heap."""
    if message:
        print(message, file=sys.stderr)
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    from coupler.fmu.fmi import load_half

    main(load_half)
