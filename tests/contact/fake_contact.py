"""A stand-in for the contact service whose replies can be told by eye; also a program like contact.rpc.serve."""

from __future__ import annotations

import os
import time

import numpy as np

from contact.messages import (
    Facing,
    Passes,
    Project,
    Refused,
    Register,
    Registered,
    Reply,
    Request,
    Traction,
    Tractions,
)

SECRET = bytes(range(32))  # of the runs of tests
SLOW, BUG, DIE = -1.0, -2.0, -3.0  # x[0, 0] of a Project that is to take 3 s, raise, or end the process


def register(n: int = 4) -> Register:
    edges = np.array([[0, 1], [2, 3]], dtype=np.int32)
    zero, one = np.zeros(1, np.int32), np.ones(1, np.int32)
    passes = Passes(zero, zero, one, np.ones(1), zero, np.array([0.1]), np.array([1e12]), np.ones(1), np.zeros(1))
    return Register(n, edges, np.array([0, 1], dtype=np.int32), axisymmetric=False, passes=passes)


class FakeContact:
    """Registered surfaces by name; `calls` counts what was carried out."""

    def __init__(self) -> None:
        self.known: set[str] = set()
        self.calls: list[str] = []

    def handle(self, request: Request) -> Reply:
        self.calls.append(type(request).__name__)
        if isinstance(request, Register):
            self.known.add(f"surfaces-{request.n_nodes}")
            return Registered(f"surfaces-{request.n_nodes}")
        if request.surfaces not in self.known:
            return Refused("unknown_surfaces", f"{request.surfaces} was never registered")
        return facing(request) if isinstance(request, Project) else tractions(request)


def facing(request: Project) -> Facing:
    x = request.x
    if x[0, 0] == SLOW:
        time.sleep(3.0)
    if x[0, 0] == DIE:
        os.kill(os.getpid(), 9)
    if x[0, 0] == BUG:
        raise ZeroDivisionError("planted")
    n = len(x)
    i = np.arange(n, dtype=np.int32)
    return Facing(i, i, i, np.sin(x[:, 0]), np.cos(x[:, 0]), x[:, 1], np.full(n, np.nan), x[:, 0] / 3, x[:, 1] / 7,
                  np.ones(n), np.ones(n), np.zeros(n))


def tractions(request: Traction) -> Tractions:
    n = len(request.x)
    return Tractions(request.x * 3, np.zeros(n + 1, np.int32), np.zeros(0, np.int32), np.zeros((0, 2, 2)),
                     -np.abs(request.multipliers), np.full(n, np.inf), np.zeros(n), request.multipliers,
                     request.mobilised, np.zeros((0, 3)), request.mobilised, np.zeros(n), np.zeros(n), np.zeros(n),
                     2, 1, 0.0)


if __name__ == "__main__":
    from contact.rpc.serve import main

    main(FakeContact().handle)
