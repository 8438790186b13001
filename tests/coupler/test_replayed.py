"""A half whose process dies while it is brought to a state that was kept before."""

from __future__ import annotations

import numpy as np

from coupler.errors import HalfError
from coupler.fmu.half import Advance, Status
from coupler.fmu.replayed import ReplayedHalf


class Counter:
    """A half whose state is the number of its steps.  dies : at its next restore."""

    name, blocks, strings, can_save, can_serialise = "counter", {}, {}, True, True

    def __init__(self) -> None:
        self.n, self.kept, self.dies = 0, [], False

    def initialise(self, *of):
        return {}

    def advance(self, t, h, inputs, outputs):
        self.n += 1
        return Advance(Status.OK, "", {"n": np.array(float(self.n))}, 0.0)

    def read(self, names, finite=True):
        return {"n": np.array(float(self.n))}

    def save(self):
        self.kept.append(self.n)
        return len(self.kept) - 1

    def restore(self, token):
        if self.dies:
            raise HalfError("it died", half="counter")
        self.n = self.kept[token]

    def release(self, token):
        pass

    def serialise(self, token):
        return bytes([self.kept[token]])

    def deserialise(self, data):
        self.kept.append(data[0])
        return len(self.kept) - 1


def test_who_dies_on_the_way_to_a_kept_state_goes_on_from_where_it_was():
    """Two lives are lost: one after a step, the next while it is brought back to the state before for its bytes."""
    half = ReplayedHalf(Counter(), lambda: half.replace(Counter()) is None)
    half.initialise(0.0, 9.0, {}, {}, ())
    half.advance(0.0, 1.0, {}, ("n",))
    token = half.save()
    half.advance(1.0, 1.0, {}, ("n",))
    half.replace(Counter())
    half.read(("n",))  # brings the new life to 2 steps
    half.half.dies = True
    assert half.serialise(token) == bytes([1])
    assert half.read(("n",))["n"] == 2.0
