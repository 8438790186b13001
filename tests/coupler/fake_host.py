"""A program like coupler.fmu.host around a half that needs no FMU: x follows the gap that contact reports."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from contact.messages import Passes, Project, Register, Registered
from contact.rpc.calls import LinkError
from contact.rpc.link import open_link
from coupler.errors import HalfError
from coupler.fmu.half import Advance, Block, Status
from coupler.fmu.host import main


class Toy:
    """State: y, the sum of the gaps of all steps.  Steps longer than 10 s are discarded; h = 5 prints 20 MB,
    h = 6 takes 6 s, h = 7 hangs, h = 8 dies."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.blocks = {"x": Block("x", (4, 2), "m", "input", "Real"), "y": Block("y", (4,), "m", "output", "Real"),
                       "sum": Block("sum", (), "m", "output", "Real")}
        self.strings = {"mesh.hash": "abc"}
        self.can_save = self.can_serialise = True
        self.x, self.y = np.zeros((4, 2)), np.zeros(4)
        self.saved: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def initialise(self, t_start, t_end, parameters, inputs, outputs):
        self.link = open_link(parameters.get("contact.link", "direct"))
        self.x = inputs["x"]
        zero, one, real = np.zeros(1, np.int32), np.ones(1, np.int32), np.ones(1)
        reply = self.link.ask(Register(4, np.array([[0, 1], [2, 3]], np.int32), np.array([0, 1], np.int32), False,
                                       Passes(zero, zero, one, real, zero, real, real, real, real)))
        assert isinstance(reply, Registered)
        self.surfaces = reply.surfaces
        return self.read(outputs)

    def advance(self, t, h, inputs, outputs):
        self.x = inputs.get("x", self.x)
        if h == 7:
            time.sleep(60)
        if h == 6:
            time.sleep(6)
        if h == 5:
            os.write(2, b"noise, and more noise\n" * 900_000)
        if h == 8:
            print("about to die", file=sys.stderr, flush=True)
            os.kill(os.getpid(), 9)
        if h > 10:
            return Advance(Status.DISCARD, "too long", {}, 0.0, dt_suggest=5.0)
        try:
            facing = self.link.ask(Project(self.surfaces, self.x))
        except LinkError as exc:
            return Advance(Status.DISCARD, str(exc), {}, 0.0)
        self.y = self.y + h * facing.node_gap
        return Advance(Status.OK, "", self.read(outputs), 0.25)

    def read(self, names, finite=True):
        values = {"y": self.y, "sum": np.array(self.y.sum()), "x": self.x, "pid": np.array(float(os.getpid()))}
        if not set(names) <= values.keys():
            raise HalfError(f"no block {names}", half=self.name, log="the log of the toy")
        return {n: values[n] for n in names}

    def save(self):
        self.saved[len(self.saved)] = (self.x.copy(), self.y.copy())
        return len(self.saved) - 1

    def restore(self, token):
        x, y = self.saved[token]
        self.x, self.y = x.copy(), y.copy()

    def release(self, token):
        del self.saved[token]

    def serialise(self, token):
        return b"".join(a.tobytes() for a in self.saved[token])

    def deserialise(self, data):
        x, y = np.frombuffer(data[:64]).reshape(4, 2), np.frombuffer(data[64:])
        self.saved[len(self.saved)] = (x, y)
        return len(self.saved) - 1

    def log_tail(self):
        return "nothing to say"

    def close(self):
        self.link.close()


def load(fmu: Path, extracted: Path, name: str) -> Toy:
    if not fmu.exists():
        raise HalfError(f"{fmu} does not exist", half=name)
    return Toy(name)


if __name__ == "__main__":
    main(load)
