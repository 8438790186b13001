"""A line between two interfaces that is slow, narrow, and loses, doubles and reorders what it carries.

    python bad_line.py LEFT RIGHT '{"delay": 0.005, "rate": 1e7, "loss": 0.01, "double": 0.01, "late": 0.02}'

It copies frames of two interfaces without addresses (Linux, as root of a network namespace), as a bridge would.
"""

from __future__ import annotations

import heapq
import json
import random
import select
import socket
import sys
import time
from dataclasses import dataclass

SOL_PACKET, ADD_MEMBERSHIP, VNET_HEADER, PROMISCUOUS = 263, 1, 15, 1
EVERYTHING = 0x0003  # ETH_P_ALL
OUTGOING = 4  # a frame that this side sent
LARGEST = 1 << 17  # bytes of a frame and its header: the kernel hands over what it would have cut up on the way
LATE = 0.02  # s, of a frame that others overtake


@dataclass(frozen=True)
class Line:
    """delay [s] one way.  rate [bit/s] each way; 0: any.  loss, double, late : the shares of frames with that fate."""

    delay: float = 0.0
    rate: float = 0.0
    loss: float = 0.0
    double: float = 0.0
    late: float = 0.0


def opened(name: str) -> socket.socket:
    """All frames of an interface, with what the kernel still had to do with each (checksums, cutting it up)."""
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(EVERYTHING))
    end.setsockopt(SOL_PACKET, VNET_HEADER, 1)
    end.bind((name, EVERYTHING))
    request = socket.if_nametoindex(name).to_bytes(4, sys.byteorder) + PROMISCUOUS.to_bytes(2, sys.byteorder)
    end.setsockopt(SOL_PACKET, ADD_MEMBERSHIP, request + bytes(10))
    end.setblocking(False)
    return end


def carry(left: str, right: str, line: Line, seed: int = 1) -> None:
    """Carry frames to and fro until the process is ended."""
    chance = random.Random(seed)
    ends = (opened(left), opened(right))
    other = {ends[0]: ends[1], ends[1]: ends[0]}
    free = dict.fromkeys(ends, 0.0)  # when the line into an end has sent what it was given
    waiting: list[tuple[float, int, socket.socket, bytes]] = []
    number = 0
    while True:
        pause = max(waiting[0][0] - time.monotonic(), 0.0) if waiting else None
        for end in select.select(ends, (), (), pause)[0]:
            frame, about = end.recvfrom(LARGEST)
            if about[2] == OUTGOING or chance.random() < line.loss:
                continue
            to, now = other[end], time.monotonic()
            free[to] = max(free[to], now) + (8 * len(frame) / line.rate if line.rate else 0.0)
            at = free[to] + line.delay + (LATE if chance.random() < line.late else 0.0)
            for _ in range(2 if chance.random() < line.double else 1):
                number += 1
                heapq.heappush(waiting, (at, number, to, frame))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, to, frame = heapq.heappop(waiting)
            to.send(frame)


if __name__ == "__main__":
    carry(sys.argv[1], sys.argv[2], Line(**json.loads(sys.argv[3])))
