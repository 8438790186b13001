"""Somebody on the machine who was not given the secret of a run, and what comes of each thing tried, as JSON.

    python stranger.py ENDPOINT [ENDPOINT ...]        tries everything once, and ends
    python stranger.py --in-their-place ENDPOINT ...  answers every question it is asked, until its input ends

It speaks the protocol as well as we do, in a session of zenoh of its own.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
import zenoh

from contact.codec import decode, encode
from contact.messages import Facing
from contact.records import WireError
from coupler.fmu.half import Advance, Status
from coupler.fmu.remote import ANSWERS, VERBS, Close, Read, Save, Serialise, Step, Values

LIE = 1e6  # what it says of every number
SIGNED = "/1/" + 64 * "a"  # of an envelope of ours: the number of the attempt, and what is no signature


def session(endpoints: list[str]) -> Any:
    config = zenoh.Config()
    for key, value in {"mode": "client", "connect/endpoints": endpoints, "listen/endpoints": [],
                       "connect/timeout_ms": 3000, "scouting/multicast/enabled": False, "scouting/gossip/enabled":
                       False}.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def told(reply: Any) -> Any:
    """What an answer says: a message, or the text of a refusal."""
    said = reply.ok or reply.err
    data = said.payload.to_bytes()
    try:
        return decode(data, ANSWERS)
    except WireError:
        return data.decode(errors="replace")


def ask(network: Any, token: str, verb: Any, number: int, signed: str = SIGNED) -> list[Any]:
    """Ask the server of a token; the answers."""
    _, run, _, role, instance = token.split("/")
    return [told(r) for r in network.get(
        f"slideline/{run}/{role}/{instance}/v1/ask", payload=encode(verb), attachment=f"{instance}/me/{number}{signed}",
        encoding="application/x-slideline", timeout=10.0)]


def try_everything(network: Any, signed: str = SIGNED) -> dict[str, Any]:
    tokens = sorted(str(r.ok.key_expr) for r in network.liveliness().get("slideline/*/alive/**", timeout=3.0))
    got: dict[str, Any] = {"roles": [t.split("/")[3] for t in tokens], "read": [], "state": [], "step": [], "close": []}
    for token in tokens:
        read, _ = (ask(network, token, verb, n, signed) for n, verb in ((1, Read(("y",))), (2, Save(1))))
        got["read"] += [r.values["y"].tolist() if isinstance(r, Values) else r for r in read]
        state = ask(network, token, Serialise(1), 3, signed)
        got["state"] += [len(s.data) if hasattr(s, "data") else s for s in state]
        step = ask(network, token, Step(0.0, 0.02, {}, ("y",)), 4, signed)
        got["step"] += [s.status.value if isinstance(s, Advance) else str(s) for s in step]
    for token in tokens:
        got["close"] += [str(c) for c in ask(network, token, Close(), 5, signed)]
    return got


def lie(query: Any) -> None:
    """Answer in the place of a half or of the contact service, under the label a client of before looked for."""
    with query:
        label = query.attachment.to_string() if query.attachment is not None else ""
        reply: Any = b"idle"
        if query.payload is not None and str(query.key_expr).endswith("ask"):
            try:
                verb = decode(query.payload.to_bytes(), VERBS)
            except WireError:
                n = np.zeros(0, np.int32)
                lies = np.full(4, LIE)
                reply = encode(Facing(n, n, n, *[lies] * 9))
            else:
                values = {name: np.full(4, LIE) for name in getattr(verb, "outputs", getattr(verb, "names", ()))}
                reply = encode(Advance(Status.OK, "", values, 0.0) if isinstance(verb, Step) else Values(values))
        query.reply(str(query.key_expr), reply, encoding="application/x-slideline", attachment=label)


def main(arguments: list[str]) -> None:
    in_their_place = arguments[0] == "--in-their-place"
    with session(arguments[in_their_place:]) as network:
        if in_their_place:
            tokens = [str(r.ok.key_expr) for r in network.liveliness().get("slideline/*/alive/**", timeout=3.0)]
            for token in tokens:
                _, run, _, role, instance = token.split("/")
                for verb in ("ask", "status", "stats"):
                    network.declare_queryable(f"slideline/{run}/{role}/{instance}/v1/{verb}",
                                              zenoh.handlers.Callback(lie, indirect=False), complete=True)
                network.liveliness().declare_token(f"slideline/{run}/alive/{role}/{'0' * 12}")
            print(json.dumps({"tokens": tokens}), flush=True)
            sys.stdin.read()
            return
        print(json.dumps(try_everything(network, "" if "--before" in sys.argv else SIGNED)), flush=True)


if __name__ == "__main__":
    main([a for a in sys.argv[1:] if a != "--before"])
