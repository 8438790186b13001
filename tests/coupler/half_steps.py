"""A few steps of a half with contact, and their outputs as bytes: the same however the half is run.

As a program, in a process of its own: python half_steps.py FMU LINK OUT
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from contact.records import encode_record
from coupler.fmu.half import Half, Status

TIMES = (0.0, 9000.0, 11000.0, 11300.0, 13000.0)  # s of the sliding blocks: apart, closing, pressed, sliding
OUTPUTS = ("x", "contact.t_N", "contact.gap", "contact.covered")


def steps(half: Half, link: str) -> bytes:
    """Start, step through TIMES with one step taken twice, return all outputs as a record."""
    inputs = {"T": np.full(half.blocks["T"].shape, 300.0)} if "T" in half.blocks else {}
    arrays = {f"{k} 0": v for k, v in half.initialise(0.0, TIMES[-1], {"contact.link": link}, inputs, OUTPUTS).items()}
    for i, (t0, t1) in enumerate(pairwise(TIMES), start=1):
        token = half.save()
        first = half.advance(t0, t1 - t0, {}, OUTPUTS)
        half.restore(token)
        again = half.advance(t0, t1 - t0, {}, OUTPUTS)
        half.release(token)
        assert first.status is again.status is Status.OK, first.message
        for name in OUTPUTS:
            assert first.outputs[name].tobytes() == again.outputs[name].tobytes()
            arrays[f"{name} {i}"] = again.outputs[name]
    return encode_record(half.name, {}, arrays)


if __name__ == "__main__":
    from coupler.fmu.fmi import load_half

    Path(sys.argv[3]).write_bytes(steps(load_half(Path(sys.argv[1]), None, "mechanical"), sys.argv[2]))
