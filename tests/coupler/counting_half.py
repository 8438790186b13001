"""A half that only counts: its state is a number."""

from __future__ import annotations

import numpy as np

from coupler.errors import HalfError
from coupler.fmu.half import Advance, Status


class CountingHalf:
    """Each step adds its length; one beyond 1 s is discarded, one beyond 5 s an error.  Tokens begin at 71."""

    name, blocks, strings, can_save, can_serialise = "counter", {}, {}, True, True

    def __init__(self) -> None:
        self.state, self.kept, self.token = 0.0, {}, 70

    def initialise(self, t_start, t_end, parameters, inputs, outputs):
        return {"y": np.array(self.state)}

    def advance(self, t, h, inputs, outputs):
        if h > 5.0:
            raise HalfError("too long", half=self.name)
        if h > 1.0:
            return Advance(Status.DISCARD, "shorter", {}, 0.0)
        self.state += h
        return Advance(Status.OK, "", {"y": np.array(self.state)}, 0.0)

    def read(self, names, finite=True):
        return {"y": np.array(self.state)}

    def save(self):
        self.token += 1
        self.kept[self.token] = self.state
        return self.token

    def restore(self, token):
        self.state = self.kept[token]

    def release(self, token):
        del self.kept[token]

    def serialise(self, token):
        return repr(self.kept[token]).encode()

    def deserialise(self, data):
        try:
            state = float(data)
        except ValueError:
            raise HalfError("no state of this half", half=self.name) from None
        self.token += 1
        self.kept[self.token] = state
        return self.token
