"""What signing costs between processes: round trips with and without signatures, in turns, over both transports.
transports.

    python benchmarks/seal_cost.py [--rounds 15]

A server in a process of its own answers a message of n bytes with the same bytes.  "Without" signs nothing and checks
nothing on either side.  Every round asks all ways one after the other; the table has medians over rounds.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from contact.codec import kinds_of
from contact.rpc.client import Client
from contact.rpc.seal import Seal
from contact.rpc.server import Server, become_child, keep_freed_memory
from contact.rpc.zenoh_session import open_session, socket_in
from coupler.fmu.remote import StateBytes

SIZES = (64, 1_600, 20_000, 160_000, 1_000_000)  # bytes each way
ASKED = 40  # times a round
KINDS = kinds_of([StateBytes])
RUN, SECRET = "cost", bytes(32)


class Unsigned(Seal):
    """Signs nothing, believes everything."""

    def sign(self, about: str, payload: bytes) -> str:
        return super().sign(about, b"") if about.startswith(("role", "life")) else 64 * "0"

    def signed(self, about: str, payload: bytes, signature: str) -> bool:
        return True


SEALS: dict[str, type[Seal]] = {"signed": Seal, "unsigned": Unsigned}


def serve(seal: str, listen: str) -> None:
    parent = become_child(lambda: None)
    session = open_session(listen=(listen,))
    with Server(session, SEALS[seal](RUN, SECRET), "echo", KINDS) as server:
        parent.say(f"{session.listen[0]} {server.instance}")
        server.work(lambda message: message)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--serve", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        return serve(*options.serve)
    keep_freed_memory()
    with tempfile.TemporaryDirectory() as folder:
        clients, children = {}, []
        for seal in SEALS:
            for where, listen in (("socket", socket_in(Path(folder), seal)), ("tcp", "tcp/127.0.0.1:0")):
                child = subprocess.Popen([sys.executable, __file__, "--serve", seal, listen], stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE, text=True)
                assert child.stdout is not None
                endpoint, instance = child.stdout.readline().split()
                session = open_session(connect=(endpoint,))
                clients[f"{seal}, {where}"] = Client(session, SEALS[seal](RUN, SECRET), "echo", KINDS,
                                                     instance=instance)
                children.append(child)
        print("| bytes each way |", " | ".join(f"{name} [us]" for name in clients), "| signing adds, socket |")
        for size in SIZES:
            took = in_turns(clients, StateBytes(os.urandom(size)), options.rounds)
            added = took["signed, socket"] - took["unsigned, socket"]
            print(f"| {size} |", " | ".join(f"{t:.0f}" for t in took.values()),
                  f"| {added:.0f} us, {100 * added / took['unsigned, socket']:.0f} % |", flush=True)
        for child in children:
            child.kill()
    sys.stdout.flush()
    os._exit(0)  # sessions whose servers are killed would be waited for


def in_turns(clients: dict[str, Client], message: StateBytes, rounds: int) -> dict[str, float]:
    """Median microseconds of a round trip."""
    took: dict[str, list[float]] = {name: [] for name in clients}
    for _ in range(rounds):
        for name, client in clients.items():
            times = []
            for _ in range(ASKED):
                started = time.perf_counter()
                client.call(message)
                times.append(1e6 * (time.perf_counter() - started))
            took[name].append(statistics.median(times))
    return {name: statistics.median(times) for name, times in took.items()}


if __name__ == "__main__":
    main()
