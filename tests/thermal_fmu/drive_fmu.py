"""Step built FMUs by a plan, each outputs kept: `python drive_fmu.py PLAN.json`, a process of its own.

The plan is a list of {"fmu", "out", "steps": [s, ...], "inputs": {name: value}, "outputs": [name, ...]}; `out` is the
.npz file that gets t and each output, a row a step (row 0: the start).
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from coupler.fmu.fmi import load_half
from coupler.fmu.half import Status


def drive(plan: dict) -> None:
    half = load_half(Path(plan["fmu"]), None, "thermal")
    names, steps = plan["outputs"], plan["steps"]
    inputs = {n: np.broadcast_to(np.asarray(v, dtype=float), half.blocks[n].shape).copy()
              for n, v in plan["inputs"].items()}
    rows = [half.initialise(0.0, float(sum(steps)), {}, inputs, names)]
    t = [0.0]
    for h in steps:
        done = half.advance(t[-1], h, inputs if len(t) == 1 else {}, names)
        assert done.status is Status.OK, done.message
        rows.append(done.outputs)
        t.append(t[-1] + h)
    half.close()
    np.savez(plan["out"], t=np.array(t), **{n: np.array([row[n] for row in rows]) for n in names})


if __name__ == "__main__":
    for one in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")):
        drive(one)
